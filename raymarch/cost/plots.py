"""Figures of a sweep. They need matplotlib and do not change its global state."""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from raymarch.cost.answer import figures
from raymarch.cost.settings import differences
from raymarch.cost.sweep import METRICS, Point, Sweep
from raymarch.cost.text import labelled, worth
from raymarch.errors import CostError, printable
from raymarch.files import import_optional

STYLES = {
    "plain": ("#5f6770", "s"),
    "relaxed": ("#d98a00", "^"),
    "relaxed_again": ("#806400", "v"),
    "enhanced": ("#00795a", "D"),
    "auto_relaxed": ("#0066a8", "o"),
    "bracketing": ("#b4387f", "*"),
    "advance": ("#101010", "P"),
}
"""Colour and mark of each tracer in all figures. They differ for colour-blind readers too, and no colour is needed to
tell them apart."""
COLORS = {tracer: color for tracer, (color, _) in STYLES.items()}


def figure(made: Sweep, metric: str = "pixels_p99") -> Any:
    """The figure of a sweep: error against time, and evaluations with N*, the bound of tracers that know values alone.

    If tracers were measured at several numbers of steps, it also shows error and time relative to the plain tracer, as
    in figure 3 of Bálint and Valasek (2018).
    """
    steps = by_steps(made)
    columns = 3 if len(steps) > 1 and "plain" in steps else 2
    drawn = blank(6.4 * columns, 6.0)
    axes = drawn.subplots(1, columns)
    draw_front(axes[0], made, metric)
    draw_evaluations(axes[1], made)
    if columns == 3:
        draw_relative(axes[2], steps, "plain")
    drawn.suptitle(
        f"{printable(made.name)}, {made.known.size[0]}x{made.known.size[1]}, {_measured(made)}",
        fontsize=9,
        parse_math=False,
    )
    return drawn


def blank(width: float, height: float) -> Any:
    """An empty figure; width and height in inches."""
    import_optional("a figure", "matplotlib", "report", CostError)
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def save(drawn: Any, kind: str = "png") -> bytes:
    """A figure as the bytes of a file."""
    stream = io.BytesIO()
    drawn.savefig(stream, format=kind, dpi=110)
    return stream.getvalue()


def _measured(made: Sweep) -> str:
    env = made.environment
    return f"{env['driver']['renderer']}, {env['clock']['kind']}, {env['date'][:10]}, {made.repeats} frames a setting"


def draw_front(axes: Any, made: Sweep, metric: str) -> None:
    """Error against time: every sound setting with its interval, the front, the presets, the scene's own."""
    sound = [p for p in made.comparable(metric) if p.error(metric) == p.error(metric)]
    if not sound:
        axes.text(0.5, 0.5, "no setting finds every hit", ha="center", transform=axes.transAxes)
        return
    lowest = min([p.error(metric) for p in sound if p.error(metric) > 0], default=1.0) / 2

    def at(point: Point) -> float:
        return max(point.error(metric), lowest)

    for tracer in dict.fromkeys(p.tracer for p in sound):
        some = [p for p in sound if p.tracer == tracer]
        x = [p.time.value for p in some]
        spread = [[p.time.value - p.time.low for p in some], [p.time.high - p.time.value for p in some]]
        color, mark = STYLES.get(tracer, (None, "o"))
        style = {"lw": 0.5, "alpha": 0.8, "color": color, "label": tracer, "fmt": mark, "ms": 8 if mark == "*" else 5}
        axes.errorbar(x, [at(p) for p in some], xerr=spread, **style)
    front = made.front(metric)
    axes.step([p.time.value for p in front], [at(p) for p in front], where="post", color="black", lw=1, label="front")
    axes.plot(*_own(made.base, sound, at), "o", ms=13, mfc="none", mec="black", label="the scene's own")
    words = ", ".join(filter(None, METRICS[metric]))
    axes.set(xscale="log", yscale="log", xlabel="milliseconds a frame, median and 95 % interval", ylabel=words)
    plain_ticks(axes.xaxis)
    plain_ticks(axes.yaxis)
    named = [p for p in sound if p.setting.preset] + [p for p in worth(front, metric) if not p.setting.preset]
    label([(p.time.value, at(p), p.setting.preset or p.name) for p in named], axes)
    unsound = sum(not p.errors.sound for p in made.points)
    left = f"; {unsound} settings that miss hits are not shown" if unsound else ""
    axes.set_title(f"error against time{left}", fontsize=9)
    axes.grid(alpha=0.25, lw=0.4)
    _legend_below(axes)


def _own(base: Point, sound: Sequence[Point], at: Callable[[Point], float]) -> tuple[list[float], list[float]]:
    """The position of the scene's own setting; none if it misses hits."""
    return ([base.time.value], [at(base)]) if any(p is base for p in sound) else ([], [])


def _legend_below(axes: Any) -> None:
    axes.legend(fontsize=8, loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=4, frameon=False)


def plain_ticks(axis: Any) -> None:
    """Ticks of a logarithmic axis as plain numbers: 10, 20, 50. On a short one, with the digits that differ."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    low, high = sorted(axis.get_view_interval())
    decades = math.log10(high / low)
    subs = (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 7.0) if decades < 1 else (1.0, 2.0, 5.0) if decades < 2.5 else (1.0,)
    axis.set_major_locator(LogLocator(subs=subs, numticks=20))
    digits = max(2, math.ceil(1.5 - math.log10(max(decades, 1e-6))))
    axis.set_major_formatter(FuncFormatter(lambda value, _: figures(value, digits)))
    axis.set_minor_formatter(NullFormatter())


def label(places: Sequence[tuple[float, float, str]], axes: Any) -> None:
    """Write names beside their points (x, y), each where it is inside of the axes and covers no other name."""
    axes.figure.draw_without_rendering()
    size, scale = 8.0, 72.0 / axes.figure.dpi
    (left, bottom), (right, top) = scale * axes.bbox.get_points()
    taken: list[tuple[float, float, float, float]] = []
    for x, y, name in places:
        at = scale * axes.transData.transform((x, y))
        wide = 0.62 * size * len(name)
        for dx, dy in ((7, 5), (7, -12), (-7 - wide, 5), (-7 - wide, -12), (7, 16), (-7 - wide, 16), (7, -23)):
            box = (at[0] + dx, at[1] + dy, at[0] + dx + wide, at[1] + dy + size)
            inside = box[0] >= left and box[2] <= right and box[1] >= bottom and box[3] <= top
            if inside and not any(box[0] < t[2] and box[2] > t[0] and box[1] < t[3] and box[3] > t[1] for t in taken):
                taken.append(box)
                axes.annotate(name, (x, y), xytext=(dx, dy), textcoords="offset points", fontsize=size)
                break


def draw_evaluations(axes: Any, made: Sweep) -> None:
    """Evaluations per pixel of the presets and of each tracer at its most steps, with N*, which bounds those that know
    values alone."""
    shown = _longest(made)
    names = [labelled(p) for p in shown]
    colors = [COLORS.get(p.tracer, "#444444") for p in shown]
    axes.barh(range(len(shown)), [p.evaluations for p in shown], color=colors, alpha=0.85)
    axes.set_yticks(range(len(shown)), names, fontsize=8)
    axes.set_ylim(len(shown), -0.7)
    if made.floor > 0:
        axes.axvline(made.floor, color="black", lw=1)
        axes.text(made.floor, len(shown) - 0.3, f" N* = {made.floor:.2f}", fontsize=8, va="center")
    for row, point in enumerate(shown):
        over = f" ({point.evaluations / made.floor:.2f} N*)" if made.floor > 0 else ""
        axes.text(point.evaluations, row, f" {point.evaluations:.1f}{over}", fontsize=7, va="center")
    axes.margins(x=0.25)
    axes.set_xlabel("evaluations of the field per pixel, primary rays")
    axes.grid(alpha=0.25, axis="x", lw=0.4)


def _longest(made: Sweep) -> list[Point]:
    """The base, the presets, and each tracer at its largest number of steps."""
    shown = {id(p): p for p in made.points if p is made.base or p.setting.preset}
    for points in by_steps(made).values():
        shown[id(points[-1])] = points[-1]
    return list(shown.values())


def by_steps(made: Sweep) -> dict[str, list[Point]]:
    """The points that differ from the base in tracer and steps alone, by tracer, ascending in steps."""
    base = made.base.setting.quality
    found: dict[str, list[Point]] = {}
    for point in made.points:
        quality = point.setting.quality
        if point is not made.base and (point.setting.preset or quality.tracer == "auto"):
            continue
        if {"tracer", "max_steps", "omega"}.issuperset(differences(quality, base)):
            found.setdefault(point.tracer, []).append(point)
    for points in found.values():
        points.sort(key=lambda p: p.setting.quality.max_steps)
    return {name: points for name, points in found.items() if len(points) > 1}


def draw_relative(axes: Any, curves: Mapping[str, Sequence[Point]], baseline: str) -> None:
    """Time, error and their product over the steps a ray may take, each relative to a baseline: below 1 is better."""
    against = {p.setting.quality.max_steps: p for p in curves[baseline]}
    for name, points in curves.items():
        if name == baseline:
            continue
        pairs = [(p, against[s]) for p in points if (s := p.setting.quality.max_steps) in against]
        steps = [p.setting.quality.max_steps for p, _ in pairs]
        series = {
            "time": (":", [p.time.value / q.time.value for p, q in pairs]),
            "error": ("--", [p.errors.p1 / q.errors.p1 for p, q in pairs]),
            "error x time": ("-", [p.error_time / q.error_time for p, q in pairs]),
        }
        for what, (line, values) in series.items():
            axes.plot(steps, values, line, color=COLORS.get(name), lw=1.4, label=f"{name}, {what}")
    axes.set(xscale="log", yscale="log", xlabel="steps a ray may take", ylabel=f"relative to {baseline}")
    plain_ticks(axes.yaxis)
    axes.axhline(1.0, color="black", lw=0.8)
    ticks = sorted(against)
    axes.set_xticks(ticks, [str(t) for t in ticks])
    axes.minorticks_off()
    axes.set_title("squared depth error, time, and their product (Bálint and Valasek 2018)", fontsize=9)
    axes.grid(alpha=0.25, lw=0.4)
    axes.legend(fontsize=7, loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=3, frameon=False)
