"""Cubic curves as tangent arcs: two arcs for a span (a biarc), halved until they are near enough."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from raymarch.errors import SceneError
from raymarch.sdf.flat import across
from raymarch.sdf.outlines import Outline, distance_to_circle, turn

Floats = NDArray[np.float64]
Arcs = list[tuple[Floats, float]]

MOST_HALVINGS = 16
_T = np.linspace(0.0, 1.0, 33)
_POWERS = np.stack([(1 - _T) ** 3, 3 * _T * (1 - _T) ** 2, 3 * _T**2 * (1 - _T), _T**3], axis=1)


def through(points: Floats, start: Floats | None, end: Floats | None) -> list[Floats]:
    """The control points of the cubic spans of a spline through points (n, 2).

    At an inner point the direction is that of the parabola through it and its neighbours, with the chords' lengths as
    steps. At a free end the second derivative is 0.
    """
    chords = np.diff(points, axis=0)
    steps = np.linalg.norm(chords, axis=1)[:, None]
    slopes = chords / steps
    inner = (steps[1:] * slopes[:-1] + steps[:-1] * slopes[1:]) / (steps[:-1] + steps[1:])
    ways = np.vstack([slopes[:1], inner, slopes[-1:]])
    for side, given, near, slope in ((0, start, 1, slopes[0]), (-1, end, -2, slopes[-1])):
        if given is None:
            ways[side] = 1.5 * slope - 0.5 * ways[near] if len(points) > 2 else slope
        elif not given.any():
            raise SceneError("sketch: spline_to: a direction of length 0", legal="two numbers, not both 0")
        else:
            ways[side] = given / np.linalg.norm(given)
    third = steps / 3.0
    return list(
        np.stack([points[:-1], points[:-1] + ways[:-1] * third, points[1:] - ways[1:] * third, points[1:]], axis=1)
    )


def as_arcs(curve: Floats, tolerance: float, halvings: int = 0) -> Arcs:
    """Ends and bulges of lines and arcs within a tolerance of a cubic curve with the control points (4, 2)."""
    a, b, c, d = curve
    if _is_straight(curve):
        return [(d, 0.0)]
    arcs = _biarc(a, _way(curve), d, -_way(curve[::-1]))
    if arcs is not None and _farthest(curve, arcs) <= tolerance:
        return arcs
    if halvings == MOST_HALVINGS:
        what = f"sketch: a curve turns too fast near {tuple(np.round(a, 6).tolist())}"
        raise SceneError(what, legal="a curve without a cusp, or a larger tolerance")
    ab, bc, cd = 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + d)
    left, right = 0.5 * (ab + bc), 0.5 * (bc + cd)
    middle = 0.5 * (left + right)
    first = as_arcs(np.array([a, ab, left, middle]), tolerance, halvings + 1)
    return first + as_arcs(np.array([middle, right, cd, d]), tolerance, halvings + 1)


def _is_straight(curve: Floats) -> bool:
    """True if the control points lie on the segment between the ends, in order."""
    along = curve[3] - curve[0]
    size = float(np.linalg.norm(along))
    if size == 0.0:
        return False
    over = curve - curve[0]
    t = over @ along / size
    aside = np.abs(across(over, along)) / size
    return bool(np.all(aside <= 1e-12 * size) and np.all(np.diff(t) >= -1e-12 * size))


def _way(curve: Floats) -> Floats:
    """The unit direction at the start of a curve."""
    for other in curve[1:]:
        step: Floats = other - curve[0]
        if np.linalg.norm(step) > 1e-12 * np.max(np.abs(curve - curve[0])):
            return step / np.linalg.norm(step)
    raise SceneError(f"sketch: a curve without length at {tuple(curve[0].tolist())}", legal="points that differ")


def _bulge(way: Floats, chord: Floats) -> float | None:
    """Of the arc that starts in a direction and has a chord; None for more than half a turn."""
    angle = turn(way, chord)
    return math.tan(0.5 * angle) if abs(angle) <= 0.5 * math.pi else None


def _biarc(a: Floats, start: Floats, b: Floats, end: Floats) -> Arcs | None:
    """Two arcs from a to b with the given directions, joined where both have equal tangent lengths (Bolton 1975)."""
    chord = b - a
    squared, along, spare = float(chord @ chord), float(chord @ (start + end)), 1.0 - float(start @ end)
    root = math.sqrt(max(along * along + 2.0 * spare * squared, 0.0)) + along
    if squared == 0.0 or root <= 1e-9 * math.sqrt(squared):
        return None
    length = squared / root
    joint = 0.5 * (a + b + length * (start - end))
    first, second = _bulge(start, joint - a), _bulge(-end, joint - b)
    return None if first is None or second is None else [(joint, first), (b, -second)]


def _farthest(curve: Floats, arcs: Arcs) -> float:
    """A bound of the distance of a curve's points from arcs between the same ends.

    The distance to one circle, at a step h between samples, is at most that at both of them and h^2 / 8 of its second
    derivative along the curve, |C'|^2 k + |C''|. The arcs have no other points far from the curve: it goes from end to
    end, and so do its nearest points on the arcs.
    """
    starts = [curve[0], arcs[0][0]]
    outline = Outline([(*a, *b, bulge) for a, (b, bulge) in zip(starts, arcs, strict=True)])
    points = _POWERS @ curve
    speed = 3.0 * float(np.max(np.linalg.norm(np.diff(curve, axis=0), axis=1)))
    bend = 6.0 * float(np.max(np.linalg.norm(np.diff(curve, 2, axis=0), axis=1)))
    found = []
    for i in range(2):
        apart = np.abs(distance_to_circle(outline, i, points))
        between = (speed**2 * abs(float(outline.curvature[i])) + bend) * (_T[1] ** 2 / 8.0)
        found.append(np.maximum(apart[:-1], apart[1:]) + between)
    return float(np.max(np.minimum(*found)))
