"""The results of a probe for each node: a row of a table, and a sentence for each fault."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from raymarch.errors import Location

Pixel: TypeAlias = tuple[int, int]
Vector: TypeAlias = tuple[float, float, float]

LEEWAY = 1e-3
"""Relative excess over the stated Lipschitz bound that rounding can cause: two samples are at least 2^-10 of their
coordinates apart, so that a unit in the last place of a value changes a slope by 2^-13 at most."""

SURFACE = "surface"
"""Stands in place of a node's name for materials and shaded colours."""


@dataclass(frozen=True, slots=True)
class Fault:
    """The first fault of a node in a picture: its kind, the value, the point of evaluation, and the pixel (x, row)."""

    what: str
    value: float
    position: Vector
    pixel: Pixel


@dataclass(frozen=True, slots=True)
class Report:
    """What a probe found at one node.

    name, where : the node's name, and the user's line that made it.
    faults : number of pixels in which this node has the first fault of an evaluation. first : the first of these
        faults.
    promise : the node's stated Lipschitz bound, for the value of its definition before division by a safety factor;
        infinite for an estimate, which has no bound.
    taken : the bound that the march assumes, also for an estimate.
    slope : the largest measured slope; None if not measured, 0 if the node was evaluated less than twice on each ray.
    steepest : position and pixel of that slope; None without a slope.
    inherits : True if a descendant exceeds its bound, which may be the cause.
    refuted : sentences about bounds, spread, exactness and symmetry that samples of the field contradict.
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
    refuted: tuple[str, ...] = ()

    @property
    def broken(self) -> bool:
        """True if the measured slope exceeds the stated Lipschitz bound."""
        return self.slope is not None and self.slope > self.promise * (1.0 + LEEWAY)

    @property
    def place(self) -> str:
        """Name and line, for messages."""
        return f"{self.name}, {self.where}" if self.where else self.name


def table(reports: Sequence[Report]) -> list[str]:
    """The lines of a table with faults and slope of each node, followed by `sentences`."""
    rows = [("node", "line", "faults", "slope", "at most")]
    for report in reports:
        slope = "" if report.slope is None else f"{report.slope:.4g}"
        most = "" if report.name == SURFACE else "no promise" if np.isinf(report.promise) else f"{report.promise:.4g}"
        rows.append((report.name, str(report.where or ""), str(report.faults), slope, most))
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    lines = ["  ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)).rstrip() for row in rows]
    return [*lines, *sentences(reports)]


def summary(reports: Sequence[Report]) -> list[str]:
    """The sentences for one of the two probes; one sentence that nothing is wrong if there are none."""
    found = [*sentences(reports)]
    if found:
        return found
    steep = [report for report in reports if report.slope is not None and np.isfinite(report.promise)]
    nodes = f"{sum(report.name != SURFACE for report in reports)} nodes"
    if not any(report.slope is not None for report in reports):
        return [f"no value at fault: {nodes}"]
    if not steep:
        return [f"no node states a Lipschitz bound: {nodes}"]
    worst = max(steep, key=lambda report: (report.slope or 0.0) / report.promise)
    share = (worst.slope or 0.0) / worst.promise
    return [f"no slope exceeds its Lipschitz bound: {nodes}; the largest is {share:.5g} of its bound: {worst.place}"]


def sentences(reports: Sequence[Report]) -> Iterator[str]:
    """One sentence for each fault: node and line, kind, value, position, pixel."""
    for report in reports:
        if report.first is not None:
            first = report.first
            yield (
                f"{report.place}: {first.what}, {first.value:g}, evaluated at {_point_text(first.position)}, "
                f"first in pixel {first.pixel}, in {report.faults} pixels"
            )
    for report in reports:
        if report.broken and not report.inherits and report.steepest is not None:
            position, pixel = report.steepest
            yield (
                f"{report.place}: slope {report.slope:.5g} exceeds the Lipschitz bound {report.promise:.5g} at "
                f"{_point_text(position)}, pixel {pixel}"
            )
    for report in reports:
        yield from (f"{report.place}: {sentence}" for sentence in report.refuted)


def _point_text(position: Vector) -> str:
    return "({})".format(", ".join(f"{v:.6g}" for v in position))
