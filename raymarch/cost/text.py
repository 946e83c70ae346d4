"""A sweep as text: a table for people, JSON and CSV for programs."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable, Sequence
from dataclasses import asdict
from typing import Any

from rich.table import Table

from raymarch.cost.errors import picture_doubt
from raymarch.cost.rivals import ratio, ties
from raymarch.cost.sweep import Point, Sweep
from raymarch.cost.variants import VARIANTS

Column = tuple[str, Callable[[Point], str]]
JUDGED = ("pixels_p99", "pixels_p999", "missed", "false")
"""The errors of further views."""
FORMAT = 1
"""Version of the JSON format; it increases when a name changes its meaning or is removed."""


def as_dict(made: Sweep, metric: str = "pixels_p99") -> dict[str, Any]:
    """The sweep as plain data; docs/cost.md describes each name. Unknown values are None."""
    front = {id(p) for p in made.front(metric)}
    known = made.known
    return {
        "format": FORMAT,
        "scene": made.name,
        "size": list(known.size),
        "seed": made.seed,
        "repeats": made.repeats,
        "metric": metric,
        "environment": made.environment,
        "checks": [asdict(c) for c in made.checks],
        "truth": {
            "hits": int(known.hit.sum()),
            "edges": int(known.edges.sum()),
            "picture_samples": known.samples,
            "picture_standard_error_mean": float(known.spread.mean()),
            "picture_standard_error_max": float(known.spread.max()),
            "picture_flip_p99": picture_doubt(known),
            "edge_width": known.edge_width,
        },
        "floor": _number(made.floor),
        "proof": made.proof,
        "views": list(made.views),
        "points": [_point(p, made, id(p) in front) for p in made.points],
    }


def _point(point: Point, made: Sweep, on_front: bool) -> dict[str, Any]:
    return {
        "name": point.name,
        "quality": asdict(point.setting.quality),
        "tracer": point.tracer,
        "preset": point.setting.preset,
        "on_front": on_front,
        "errors": point.errors.as_dict(),
        "views": [{name: view.as_dict()[name] for name in JUDGED} for view in point.views],
        "evaluations": point.evaluations,
        "evaluations_over_floor": _number(point.evaluations / made.floor if made.floor > 0 else float("nan")),
        "worst_evaluations": point.worst_evaluations,
        "iterations": point.iterations,
        "all_evaluations": _number(point.all_evaluations),
        "held_against": held_against(point, made),
        "frames": point.setting.frames,
        "scale": point.setting.scale,
        "variations": dict.fromkeys(VARIANTS) | dict(point.setting.variations),
        "milliseconds": {**point.time.as_dict(), "all": point.times},
        "error_time": _number(point.error_time),
        "first_frame_milliseconds": _number(point.first_ms),
        "compile_milliseconds": _number(point.compile_ms),
        "shader_bytes": point.shader_bytes,
    }


def _number(value: float) -> float | None:
    return value if value == value and abs(value) != float("inf") else None


def as_json(made: Sweep, metric: str = "pixels_p99") -> str:
    """`as_dict` as text."""
    return json.dumps(as_dict(made, metric), indent=2, allow_nan=False) + "\n"


def as_csv(made: Sweep, metric: str = "pixels_p99") -> str:
    """A line for each setting; the columns are those of the JSON, with dots between nested names."""
    rows = [_flat(p) for p in as_dict(made, metric)["points"]]
    for row in rows:
        del row["milliseconds.all"], row["views"]
    stream = io.StringIO()
    writer = csv.DictWriter(stream, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return stream.getvalue()


def _flat(values: dict[str, Any], before: str = "") -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name, value in values.items():
        found.update(_flat(value, f"{before}{name}.") if isinstance(value, dict) else {before + name: value})
    return found


def table(made: Sweep, metric: str = "pixels_p99", shown: Sequence[Point] | None = None) -> Table:
    """The sweep as a table, fastest first. `*` marks the front; `shown` picks some of the points. Settings that change
    the light alone are in `light_table`, unless the front uses an error of the picture."""
    title = f"{made.name}, {made.known.size[0]}x{made.known.size[1]}"
    return _drawn(made, metric, in_table(made, metric, shown), title, _columns(made, metric))


def in_table(made: Sweep, metric: str, shown: Sequence[Point] | None = None) -> list[Point]:
    """The points of `table` in its order."""
    given = made.points if shown is None else shown
    apart = {id(p) for p in lights_of(made, metric)}
    return sorted((p for p in given if p is made.base or id(p) not in apart), key=made.cost)


def lights_of(made: Sweep, metric: str) -> list[Point]:
    """The points of `light_table` in its order: the scene's own, then the order of the axes; [] without others."""
    comparable = {id(p) for p in made.comparable(metric)}
    light = [p for p in made.points if p.setting.light and id(p) not in comparable]
    return [made.base, *light] if light else []


def light_table(made: Sweep, metric: str = "pixels_p99") -> Table | None:
    """Settings that change the light, with their costs and the errors of the picture; None if there are none."""
    points = lights_of(made, metric)
    columns: list[Column] = [
        *_times(made),
        ("all evals", lambda p: "-" if p.all_evaluations != p.all_evaluations else f"{p.all_evaluations:.1f}"),
        ("shader bytes", lambda p: str(p.shader_bytes)),
        ("flip p99", lambda p: _short(p.errors.flip_p99)),
        ("flip max", lambda p: _short(p.errors.flip_max)),
        ("bad region", lambda p: str(p.errors.flip_region)),
        ("compared with", lambda p: held_against(p, made)),
    ]
    return _drawn(made, metric, points, "light and shadow", columns) if points else None


def held_against(point: Point, made: Sweep) -> str:
    """The reference that a point's picture is compared with."""
    return "the scene's reference" if point.known is made.known else "the light's whole disc"


def _drawn(made: Sweep, metric: str, points: Sequence[Point], title: str, columns: Sequence[Column]) -> Table:
    front = {id(p) for p in made.front(metric)}
    drawn = Table(title=title, title_justify="left", box=None)
    drawn.add_column("", no_wrap=True)
    drawn.add_column("setting", no_wrap=True, min_width=12)
    for heading, _ in columns:
        drawn.add_column(heading, justify="right", no_wrap=True)
    for point in points:
        mark = "*" if id(point) in front else ""
        label = labelled(point)
        style = "bold" if mark else "dim" if not point.errors.sound else ""
        drawn.add_row(mark, label, *(cell(point) for _, cell in columns), style=style)
    return drawn


def labelled(point: Point) -> str:
    """A point's name, with its preset if it is one."""
    preset = point.setting.preset
    return f"{point.name} ({preset})" if preset and preset != point.name else point.name


def _columns(made: Sweep, metric: str) -> list[Column]:
    columns: list[Column] = [
        *_times(made),
        ("px p99", lambda p: _short(p.errors.pixels_p99)),
        ("px max", lambda p: _short(p.errors.pixels_max)),
        ("missed", lambda p: str(p.errors.missed + p.errors.false)),
        ("normal p99", lambda p: _short(p.errors.normal_p99)),
        ("flip p99", lambda p: _short(p.errors.flip_p99)),
        *([] if made.untimed else [("error x time", lambda p: _short(p.error_time))]),
        ("evals", lambda p: f"{p.evaluations:.1f}"),
    ]
    if made.floor > 0:
        columns.append(("/N*", lambda p: f"{p.evaluations / made.floor:.2f}"))
    if not made.untimed:
        columns.append(("first ms", lambda p: f"{p.first_ms:.0f}"))
    if metric not in ("pixels_p99", "pixels_max", "normal_p99", "flip_p99"):
        columns.insert(0, (metric, lambda p: _short(float(getattr(p.errors, metric)))))
    return columns


def _times(made: Sweep) -> list[Column]:
    """The columns of the time, if it was taken."""
    if made.untimed:
        return []
    return [
        ("ms", lambda p: f"{p.time.value:.2f}"),
        ("95 %", lambda p: f"{p.time.low:.2f}-{p.time.high:.2f}"),
    ]


def _short(value: float) -> str:
    return "-" if value != value else f"{value:.2g}"


def findings(made: Sweep, metric: str = "pixels_p99") -> list[str]:
    """The sentences below the table: the measurement, the front, and the rank of the scene's own setting."""
    env = made.environment
    front = made.front(metric)
    where = f"{env['driver']['renderer']}, {env['date'][:10]}"
    lines = [
        f"{made.repeats} frames of each setting in random order (seed {made.seed}), medians with 95 % intervals, "
        f"by {'' if env['clock']['kind'] == 'CPU time' else 'the '}{env['clock']['kind']}; {where}"
        if not made.untimed
        else f"no times: {made.untimed}; {where}"
    ]
    if made.known.samples > 1:
        lines.append(
            f"the reference picture has a noise of FLIP {picture_doubt(made.known):.2g} (99 % of the pixels) at "
            f"{made.known.samples} rays per pixel"
        )
    if made.note:
        lines.append(made.note[0].lower() + made.note[1:-1])
    if made.known.edge_width < 1.0:
        lines.append(
            f"nearly every pixel has an edge: excluded silhouettes are those within {made.known.edge_width:g} "
            "pixels of a ray"
        )
    if made.floor > 0:
        lines.append(
            f"N* = {made.floor:.2f} evaluations per pixel: the least by which a tracer can decide each ray that knows "
            'values alone, of no other ray; "advance", cones and closed forms can need fewer'
        )
    if front:
        better = "has fewer evaluations and is" if made.untimed else "is both faster and"
        lines.append(f"* Pareto front by {metric}: no other setting {better} more accurate")
        order = "cheapest" if made.untimed else "fastest"
        lines.append(
            f"of these, each with an error at least 10 % below the one before, {order} first: "
            + "; ".join(labelled(p) for p in worth(front, metric))
        )
    elif not made.blank:
        lines.append("no setting finds every hit: the front is empty")
    if made.base.errors.sound and not made.untimed and front:
        lines.append(f"the scene's own setting {standing(made, metric)}")
    if made.base.times:
        drawn, beside = made.base.time.value, made.base.cpu
        lines.append(f"of its frames, drawing takes {drawn:.2f} ms, and the CPU {beside:.2f} ms before and between")
    lines += [line[0].lower() + line[1:-1] for line in (judged(made), first_frames(made)) if line]
    unsound = sum(not p.errors.sound for p in made.points)
    if unsound:
        lines.append(f"{unsound} settings have missed or false hits and are never on the front")
    lines += [f"CHECK FAILED, {c.name}: {c.words}" for c in made.checks if not c.holds]
    return lines


def judged(made: Sweep) -> str:
    """How the recommended settings were judged; "" without further views, and if nothing is hit."""
    if not made.views or made.blank:
        return ""
    return (
        f"A setting of the march is recommended only if it keeps its error in {len(made.views)} further views too: "
        f"{', and '.join(made.views)}. It is called faster if it surely takes a tenth less; else the two tie, and the "
        "sturdier one is recommended, the scene's own first."
    )


def first_frames(made: Sweep) -> str:
    """With what first frames were measured; "" without times."""
    if made.untimed:
        return ""
    if made.environment.get("driver_cache") == "off":
        return "First frames are measured with the driver's disk cache of shaders switched off."
    return "First frames may be short: the driver's disk cache of shaders may hold them from an earlier run."


def proof_words(made: Sweep) -> str:
    """The share of pixels that intervals prove at the scene's own setting; "" without a proof."""
    if made.proof is None:
        return ""
    given = made.proof
    if given["pixels"] == 0:
        return str(given["words"])
    share = given["proved"] / given["pixels"]
    exact = given["proved"] == given["pixels"]
    percent = "100" if exact else f"{min(100.0 * share, 99.99):.2f}"
    return f"Proved by intervals at the scene's own setting, {percent} % of the pixels: {given['words']}."


def worth(front: Sequence[Point], metric: str) -> list[Point]:
    """The points of a front with an error at least a tenth below that of all faster ones."""
    kept: list[Point] = []
    for point in front:
        if not kept or point.error(metric) <= 0.9 * kept[-1].error(metric):
            kept.append(point)
    return kept


def standing(made: Sweep, metric: str) -> str:
    """Distance of the scene's own setting from the front, if it is certain and worth a change."""
    base = made.base
    rivals = [p for p in made.comparable(metric) if p.error(metric) <= base.error(metric)]
    best = min(rivals, key=lambda p: ratio(p, base).value)
    found = ratio(base, best)
    if best is base or ties(base, best):
        return "ties with the fastest that are as accurate: none surely takes a tenth less"
    return f"takes {found.value:.2f} times as long as the fastest setting that is as accurate: {best.name}"
