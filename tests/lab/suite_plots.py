"""Figures of the suite: P1's figures 3 and 5, and the front of each scene."""

from __future__ import annotations

from typing import Any

import numpy as np

from raymarch.cost.plots import COLORS, blank, draw_front
from tests.lab.suite import SCHEDULES, TRACERS, Suite, undone_of_all, undone_of_taken

WIDTH = 10.0
"""Inches: 1,100 pixels of a file, so that letters of 9 points are 9 pixels high on a page 770 pixels wide."""

SCHEDULE_COLORS = {"two": "#1f6fc4", "four": "#2a9d3a", "six": "#e07b00", "cone": "#b0207a"}


def figure_3(made: Suite) -> Any:
    """First each tracer over the plain one, then each schedule over a single resolution, by tracer."""
    tracers = made.scale.scheduled
    rows = -(-(1 + len(tracers)) // 2)
    drawn = blank(WIDTH, 6.0 * rows)
    axes = drawn.subplots(rows, 2, squeeze=False).reshape(-1)
    for rest in axes[1 + len(tracers) :]:
        rest.set_axis_off()
    for tracer in TRACERS[1:]:
        pair = ((tracer, "single"), ("plain", "single"))
        _draw_curves(axes[0], made, made.scale.steps, *pair, tracer, COLORS[tracer])
    _finish(axes[0], made.scale.steps, "tracers, relative to plain sphere tracing")
    for panel, tracer in zip(axes[1:], tracers, strict=False):
        for schedule in SCHEDULES[1:]:
            pair = ((tracer, schedule), (tracer, "single"))
            _draw_curves(panel, made, made.scale.schedule_steps, *pair, schedule, SCHEDULE_COLORS[schedule])
        _finish(panel, made.scale.schedule_steps, f"schedules of {tracer}, relative to one resolution")
    drawn.suptitle(
        "error x time; below 1 is better; geometric means over the three scenes, bands are 95 % intervals", fontsize=9
    )
    return drawn


def _draw_curves(axes: Any, made: Suite, steps: Any, one: Any, other: Any, name: str, color: str) -> None:
    ratios = [made.ratio(one, other, n, "product") for n in steps]
    axes.plot(steps, [r.value for r in ratios], color=color, lw=1.5, label=name)
    axes.fill_between(steps, [r.low for r in ratios], [r.high for r in ratios], color=color, alpha=0.12, lw=0)


def _finish(axes: Any, steps: Any, title: str) -> None:
    axes.axhline(1.0, color="black", lw=0.8)
    axes.set(xscale="log", yscale="log", xlabel="maximum steps of a ray, all levels together")
    axes.set_xticks(list(steps), [str(s) for s in steps])
    axes.minorticks_off()
    low, high = axes.get_ylim()
    ticks = [m * 10.0**n for n in range(-6, 6) for m in (1, 2, 5) if low <= m * 10.0**n <= high]
    axes.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.set_title(title, fontsize=9)
    axes.grid(alpha=0.25, lw=0.4)
    axes.legend(fontsize=8, loc="upper center", bbox_to_anchor=(0.5, -0.1), ncols=3)


def figure_5(made: Suite) -> Any:
    """Fraction of P1's steps 17 to 24 that were undone: black none, white all."""
    names = list(made.scenes[0].oversteps)
    drawn = blank(4.2 * len(names), 2.7 * len(made.scenes))
    axes = drawn.subplots(len(made.scenes), len(names), squeeze=False)
    for row, scene in enumerate(made.scenes):
        for column, name in enumerate(names):
            panel = axes[row, column]
            shown, taken = undone_of_all(scene.oversteps[name]), undone_of_taken(scene.oversteps[name])
            panel.imshow(shown, cmap="gray", vmin=0.0, vmax=1.0, interpolation="nearest")
            panel.set_title(f"{scene.name}, {name}: {taken:.1%} of those taken, {shown.mean():.1%} of all", fontsize=8)
            panel.set_axis_off()
    return drawn


def fronts(made: Suite) -> Any:
    """Error against time of every setting of each scene, as pictures."""
    drawn = blank(6.0, 5.0 * len(made.scenes))
    for panel, scene in zip(np.atleast_1d(drawn.subplots(len(made.scenes))), made.scenes, strict=True):
        draw_front(panel, scene.product, "pixels_p99")
        panel.set_title(scene.name, fontsize=10)
    return drawn
