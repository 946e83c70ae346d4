"""Whether the default quality lies on the Pareto front of each example.

python -m tests.lab.front                                 # examples/*.py and examples/papers/*.py
python -m tests.lab.front hello papers/glass              # some
python -m tests.lab.front --size 160x90 --turns 0         # another size, without times
python -m tests.lab.front --json front.json               # every setting, for programs
python -m tests.lab.front --table front.json              # the table of an earlier run

Settings are those of `raymarch cost`, one change at a time, with the scene's own rays per pixel, light and resolution;
others cost a multiple. Costs are evaluations of the field (of a camera ray by pixels_p99, of all rays of a pixel by
flip_p99) and CPU time of a frame. A rival beats the default by an error and a cost if its error is no larger and its
cost at least 1 % less. The row names the cheapest of those that are no worse in all of `ERRORS`; if there is none, the
cheapest and what it gives up. It dominates the default if it beats it by both costs.
Times of rivals and of the default are taken in turns. Their ratios are medians with 95 % intervals. A rival is faster
only if its interval is below 1 in two rounds.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import raymarch as rm
from raymarch.cost.effects import evaluations_of
from raymarch.cost.reference import reference
from raymarch.cost.settings import Setting, axes, grid
from raymarch.cost.statistics import median
from raymarch.cost.sweep import Point, examine
from raymarch.scene import load
from tests.support.timing import cpu_time

ROOT = Path(__file__).parents[2] / "examples"
METRICS = ("pixels_p99", "flip_p99")
COSTS = {"pixels_p99": "evaluations", "flip_p99": "all_evaluations"}
ERRORS = {
    "pixels_p99": "px",
    "pixels_p999": "px, 99.9 %",
    "normal_p99": "° of normals",
    "flip_p99": "FLIP",
    "flip_mean": "FLIP, mean",
    "missed_at_edges": "hits missed at silhouettes",
    "false_at_edges": "false hits at silhouettes",
}
LESS = 0.99
"""Costs and errors that differ by less than 1 % are equal."""
RESOLVED = {"pixels_p999": 1e-3, "normal_p99": 1e-2}
"""Smaller errors are those of float32: pixel widths, and degrees."""
NEAR = 1.15
"""Rivals up to this many times as slow as the default in three turns are timed in all turns."""

Row = dict[str, Any]


def measure(name: str, size: tuple[int, int], turns: int) -> list[Row]:
    """Errors, evaluations and times of the settings of an example, the default first."""
    scene = load(ROOT / f"{name}.py")
    scene = scene.replace(quality=scene.quality.to_preset("normal"))
    known = reference(scene, size, samples=0 if scene.path_traced else 16)
    single = [replace(axis, crossed=False) for axis in axes()]
    settings = [s for s in grid(scene, single, size) if comparable(s, scene.quality)]
    with rm.Renderer(size) as renderer:
        renderer.kept = 8 * len(settings)
        points = [examine(scene, s, known, renderer, 0.0, None, "color") for s in settings]
        rows = [row(point, pictured=not scene.path_traced) for point in points]
        rivals = [k for k in range(1, len(rows)) if any(no_worse(rows[k], rows[0], metric) for metric in METRICS)]
        scenes = {k: settings[k].of(scene) for k in (0, *rivals)}
        for k, made in scenes.items():
            rows[k]["all_evaluations"] = all_evaluations(made, rows[k]["evaluations"], renderer)
        if turns and rivals:
            take_times(rows, scenes, renderer, turns)
    return rows


def comparable(setting: Setting, own: rm.Quality) -> bool:
    """True for a setting of the scene's own rays per pixel, light and resolution."""
    return (setting.frames, setting.scale, setting.variations, setting.quality.samples) == (1, 1.0, (), own.samples)


def row(point: Point, pictured: bool) -> Row:
    """What was measured of a setting. Errors are None where nothing is known, and all of them with a missed hit."""
    errors = point.errors.as_dict()
    return {
        "name": point.name,
        "light": point.setting.light,
        "evaluations": point.evaluations,
        "errors": {n: errors[n] if point.errors.sound and (pictured or "flip" not in n) else None for n in ERRORS},
    }


def no_worse(some: Row, own: Row, error: str) -> bool:
    """True if an error of a setting is known and at most that of the default."""
    a, b = some["errors"][error], own["errors"][error]
    return a is not None and b is not None and a * LESS <= b


def all_evaluations(scene: rm.Scene, evaluations: float, renderer: rm.Renderer) -> float:
    """Evaluations of all rays of a pixel, with one camera ray per pixel.

    They are counted without cones, so those of the camera ray are replaced by its own.
    """
    single = scene.replace(quality=scene.quality.replace(samples=1, schedule="single"))
    frame = renderer.render(single, outputs=("depth",))
    return evaluations_of(scene, renderer) - float(frame.evaluations.mean()) + evaluations


def take_times(rows: list[Row], scenes: dict[int, rm.Scene], renderer: rm.Renderer, turns: int) -> None:
    """Time the rivals and the default (0) in turns: the near ones in all turns, those that seem faster once more."""

    def ratios(some: Sequence[int], turns: int) -> dict[int, dict[str, Any]]:
        times: dict[int, list[float]] = {k: [] for k in (0, *some)}
        for turn in range(turns + 1):
            for k, taken in times.items():
                calls = renderer.draw_calls(scenes[k])
                milliseconds = cpu_time(renderer.context, lambda calls=calls: [call.draw() for call in calls])
                taken.extend([milliseconds] * (turn > 0))
        for k, taken in times.items():
            rows[k]["milliseconds"] = median(taken).value
        return {k: median([b / a for a, b in zip(times[0], times[k], strict=True)]).as_dict() for k in some}

    near = [k for k, ratio in ratios([k for k in scenes if k], min(3, turns)).items() if ratio["low"] < NEAR]
    for k, ratio in ratios(near, turns).items():
        rows[k]["ratio"] = ratio
    for k, ratio in ratios([k for k in near if rows[k]["ratio"]["high"] < 1.0], turns).items():
        rows[k]["again"] = ratio


def beats(some: Row, own: Row, metric: str, by_time: bool) -> bool:
    """True if a setting beats the default by an error and a cost."""
    if not no_worse(some, own, metric) or (some.get("light") and metric != "flip_p99"):
        return False
    if by_time:
        return all(some.get(n) is not None and some[n]["high"] < 1.0 for n in ("ratio", "again"))
    return bool(some[COSTS[metric]] < LESS * own[COSTS[metric]])


def given_up(some: Row, own: Row) -> list[str]:
    """The errors in which a setting is worse than the default, in words."""
    pairs = {n: (own["errors"][n], some["errors"][n]) for n in ERRORS if own["errors"][n] is not None}
    worse = {n: p for n, p in pairs.items() if p[1] * LESS > max(p[0], RESOLVED.get(n, 0.0))}
    return [f"{b:.2g} {ERRORS[n]} for {a:.2g}" for n, (a, b) in worse.items()]


def verdict(rows: list[Row], metric: str, by_time: bool) -> str:
    """A cell of the table: "yes", or the best of those that beat the default. Those that give up nothing come first."""
    own = rows[0]
    if own["errors"][metric] is None:
        return "no reference"
    if by_time and "milliseconds" not in own:
        return "-"

    def cost(some: Row) -> float:
        return float(some["ratio"]["median"] if by_time else some[COSTS[metric]] / own[COSTS[metric]])

    better = [k for k, some in enumerate(rows) if k and beats(some, own, metric, by_time)]
    found = sorted((len(given_up(rows[k], own)) > 0, cost(rows[k]), k) for k in better)
    if not found:
        return "yes"
    best = rows[found[0][2]]
    spread = " [{low:.2f}, {high:.2f}]".format(**best["ratio"]) if by_time else ""
    ratio = best.get("ratio")
    time = f", time × {ratio['median']:.2f} [{ratio['low']:.2f}, {ratio['high']:.2f}]" if ratio and not by_time else ""
    time = time or ("" if by_time or "milliseconds" not in own else ", slower")
    lost = given_up(best, own)
    end = f"; gives up: {', '.join(lost)}" if lost else "; no error is larger"
    return f"`{best['name']}` × {cost(best):.2f}{spread}{time}{end}"


def line(name: str, rows: list[Row]) -> str:
    """A row of the table."""
    own = rows[0]
    flip = "-" if own["errors"]["flip_p99"] is None else f"{own['errors']['flip_p99']:.3f}"
    figures = f"{own['errors']['pixels_p99']:.2g} px, {flip}; {own['evaluations']:.1f} ({own['all_evaluations']:.1f})"
    return f"| {name} | {figures} | {' | '.join(verdict(rows, m, t) for m in METRICS for t in (False, True))} |"


def main(arguments: Sequence[str]) -> int:
    names, options, rest = [], {"--size": "320x180", "--turns": "15", "--json": "", "--table": ""}, list(arguments)
    while rest:
        word = rest.pop(0)
        if word in options:
            options[word] = rest.pop(0)
        else:
            names.append(word)
    files = [*sorted(ROOT.glob("*.py")), *sorted(ROOT.glob("papers/*.py"))]
    known = json.loads(Path(options["--table"]).read_text(encoding="utf-8")) if options["--table"] else None
    names = names or list(known or [str(f.relative_to(ROOT).with_suffix("")) for f in files])
    width, height = map(int, options["--size"].split("x"))
    print(
        "| example | px, FLIP; evaluations of camera rays, of all | px: evaluations | time | FLIP: evaluations | time |"
    )
    print("|---|---|---|---|---|---|")
    found = {}
    for name in names:
        found[name] = known[name] if known else measure(name, (width, height), int(options["--turns"]))
        print(line(name, found[name]), flush=True)
        if options["--json"]:
            Path(options["--json"]).write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
