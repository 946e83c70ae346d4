"""What a probe has to say of each node: a row of a table, and a sentence for what is wrong."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from raymarch.errors import Location

Pixel: TypeAlias = tuple[int, int]
Vector: TypeAlias = tuple[float, float, float]

LEEWAY = 1e-3
"""By how much a slope may exceed its promise and still be rounding: two samples are 2^-10 of their coordinates apart or
more, so that each unit in the last place of a value counts 2^-13 at most."""

SURFACE = "surface"
"""In place of a node's name: materials, and the colour that light makes of them."""


@dataclass(frozen=True, slots=True)
class Fault:
    """The first fault of a node in a picture: what it is, the value, where it was asked, and the pixel (x, row)."""

    what: str
    value: float
    position: Vector
    pixel: Pixel


@dataclass(frozen=True, slots=True)
class Report:
    """A node in the probe.

    Attributes
    ----------
    name, where : of the node, and the user's line that made it.
    faults : pixels in which a value of it is the first of an evaluation to be at fault. first : the first such.
    promise : what its slope is at most, of the definition's own value, before that is divided to make it safe; infinite
        for an estimate, which promises nothing.
    taken : what the march takes for it, also of an estimate.
    slope : the steepest seen; None where it was not looked for, 0 where the node was asked less than twice a ray.
    steepest : where that was in the scene, and its pixel; None without a slope.
    inherits : True if a node below it is steeper than promised, so that this one may not be to blame.
    """

    name: str
    where: Location | None
    promise: float
    taken: float = 1.0
    faults: int = 0
    first: Fault | None = None
    slope: float | None = None
    steepest: tuple[Vector, Pixel] | None = None
    inherits: bool = False

    @property
    def broken(self) -> bool:
        """True if the node is steeper than it promises."""
        return self.slope is not None and self.slope > self.promise * (1.0 + LEEWAY)

    @property
    def place(self) -> str:
        """The name and the user's line."""
        return f"{self.name}, {self.where}" if self.where else self.name


def table(reports: Sequence[Report]) -> list[str]:
    """Lines of a table: each node with its faults and its slope."""
    rows = [("node", "line", "faults", "slope", "at most")]
    for report in reports:
        slope = "" if report.slope is None else f"{report.slope:.4g}"
        most = "" if report.name == SURFACE else "no promise" if np.isinf(report.promise) else f"{report.promise:.4g}"
        rows.append((report.name, str(report.where or ""), str(report.faults), slope, most))
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    lines = ["  ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)).rstrip() for row in rows]
    return [*lines, *sentences(reports)]


def summary(reports: Sequence[Report]) -> list[str]:
    """What is wrong, or that nothing is, for the reports of one of the two probes."""
    found = [*sentences(reports)]
    if found:
        return found
    steep = [report for report in reports if report.slope is not None and np.isfinite(report.promise)]
    nodes = f"{sum(report.name != SURFACE for report in reports)} nodes"
    if not any(report.slope is not None for report in reports):
        return [f"no value at fault: {nodes}"]
    if not steep:
        return [f"no slope is promised: {nodes}"]
    worst = max(steep, key=lambda report: (report.slope or 0.0) / report.promise)
    share = (worst.slope or 0.0) / worst.promise
    return [f"no slope beyond its promise: {nodes}; the steepest has {share:.5g} of it: {worst.place}"]


def sentences(reports: Sequence[Report]) -> Iterator[str]:
    """What is wrong, a sentence each: node and line, what, the value, the position, the pixel."""
    for report in reports:
        if report.first is not None:
            first = report.first
            yield (
                f"{report.place}: {first.what}, {first.value:g}, asked at {_shown(first.position)}, first in pixel "
                f"{first.pixel}, in {report.faults} pixels"
            )
    for report in reports:
        if report.broken and not report.inherits and report.steepest is not None:
            position, pixel = report.steepest
            yield (
                f"{report.place}: slope {report.slope:.5g}, it promises {report.promise:.5g} at most; at "
                f"{_shown(position)}, pixel {pixel}"
            )


def _shown(position: Vector) -> str:
    return "({})".format(", ".join(f"{v:.6g}" for v in position))
