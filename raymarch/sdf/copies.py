"""Copies around an axis or, of flat shapes, the origin; in mirrored cells, and in a range of cells.

The number of evaluations of the child follows from its box and its symmetry. Around an axis, let s be a point of a copy
two or more sectors away from a point p, or in the farther of the two neighbours. Rotated towards p by whole sectors, s
becomes a point of the own copy or of the nearer neighbour, at the same radius and height and at a smaller angle from p,
so it is nearer. Two evaluations are therefore exact if each copy stays in its sector. One is exact if the child is also
symmetric about the half-plane in the middle of its sector. A child that extends beyond its sector is evaluated for
every copy.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, Any

import numpy as np

from raymarch.errors import SceneError
from raymarch.expr.convert import integer, short
from raymarch.expr.intervals import interval_of
from raymarch.expr.node import Expr, construct, expr
from raymarch.expr.types import VEC2
from raymarch.expr.vocabulary import abs as absolute
from raymarch.expr.vocabulary import atan2, columns, cos, length, max, min, mod, round, sin, vec2, where
from raymarch.prices import STANDARD
from raymarch.sdf.booleans import balanced, union
from raymarch.sdf.definition import Child, ChildFacts, around_y, cube, operator
from raymarch.sdf.domain import Angle, Count, Domain, Scalar, Size3, Vec4, Vector, Whole, as_length
from raymarch.sdf.facts import Exactness, Facts
from raymarch.sdf.node import Node, method, operand
from raymarch.sdf.placing import rotate, rotation_matrix, translate
from raymarch.sdf.repetition import (
    MOST,
    UNBOUNDED,
    cells_of,
    check_centred,
    each_axis,
    limited,
    outermost,
    repeat,
    shift_of,
)
from raymarch.sdf.values import at_least

# Around the y axis, or the origin of a plane: in the plane of the first and the last coordinate

OWN, NEARER, GUARDED, ALL = range(4)
"""The copies that are evaluated: the own copy; also the nearer neighbour; also the distance to all other sectors, for a
field that is only a bound and may order copies wrongly; every copy."""

Evaluated = Annotated[int, Domain(None, low=OWN, high=ALL)]

UP = (0.0, 1.0, 0.0)


def _turned(p: Expr, angle: Expr) -> Expr:
    """The point rotated back by an angle from x towards z, or y in the plane."""
    c, s = cos(angle), sin(angle)
    x, *height, z = p
    return construct(c * x + s * z, *height, c * z - s * x)


def _level(p: Expr) -> Expr:
    """The coordinates in the plane of rotation."""
    return p if p.type is VEC2 else p.xz


def _matrix(flat: bool, angle: float) -> Expr:
    """The rotation by an angle from x towards z, or y in the plane."""
    if not flat:
        return rotation_matrix(expr(UP), expr(-angle))
    c, s = cos(expr(angle)), sin(expr(angle))
    return columns(vec2(c, s), vec2(-s, c))


def _polar_bounds(child: ChildFacts, count: int, evaluated: int, **_: Any) -> tuple[Expr, Expr]:
    """The box of all copies; for very many copies, that of the cylinder or circle which contains them."""
    flat = child.lower.type is VEC2
    if count > STANDARD.copies or evaluated == GUARDED:
        reach = length(_level(max(absolute(child.lower), absolute(child.upper))))
        return cube((reach, reach)) if flat else around_y(reach, child.lower.y, child.upper.y)
    turns = [_matrix(flat, math.tau * i / count) @ child.box for i in range(count)]
    return balanced(turns, min), balanced(turns, max)


def _polar_symmetry(child: Facts, count: int, middle: Expr, evaluated: int, ring: Expr) -> str:
    """If the child has a mirror plane in its middle, the copies have mirror planes in and between the sectors."""
    last = "xyz"[len(child.lower) - 1]
    kept = "y" if last == "z" and "y" in child.symmetry else ""
    if evaluated != OWN or not middle.is_constant:
        return kept
    planes = {last: float(middle.data), "x": 0.5 * math.pi - float(middle.data)}
    sectors = {axis: angle * count / math.pi for axis, angle in planes.items()}
    return "".join(sorted([*(a for a, n in sectors.items() if abs(n - np.round(n)) < 1e-9), *kept]))


def _check_polar(child: Facts, count: int, middle: Expr, evaluated: int, ring: Expr) -> None:
    """SceneError if too few copies are evaluated for the child."""
    if evaluated == ALL:
        return
    own_middle, half = _wedge(child)
    at_middle = middle.is_constant and abs(float(middle.data) - own_middle) < 1e-9
    apart = half * count < math.pi * (1.0 - 1e-9)
    enough = (
        _mirrors_itself(child, own_middle) if evaluated == OWN else evaluated == GUARDED or child.exactness == "exact"
    )
    if not (at_middle and apart and enough and np.allclose(ring.data, _ring(child))):
        raise SceneError("polar evaluates too few copies of this solid", legal="polar(node, count)")


@operator(
    bounds=_polar_bounds,
    exactness=lambda child, evaluated: "exact" if evaluated in (OWN, NEARER) else "bound",
    # rotation can move a corner of a box to the side; with a guard, the field is at least the distance to the ring
    spread=lambda child, evaluated: 1.0 if evaluated == GUARDED else math.sqrt(2.0) * child.spread,
    symmetry=_polar_symmetry,
    check=_check_polar,
    dimension="any",
    called="polar",
)
def polar_sectors(
    p: Expr,
    child: Child,
    count: Count = 6,
    middle: Angle = 0.0,
    evaluated: Evaluated = ALL,
    ring: Vec4 = (0.0, UNBOUNDED, 0.0, UNBOUNDED),
) -> Expr:
    """Copies in equal sectors about the y axis, or the origin of the plane.

    middle : angle, from x towards z or y, of the half-plane in the middle of the child's sector. evaluated : see `OWN`.
    ring : inner and outer radius, middle and half the height of the ring that contains all copies.
    """
    sector = math.tau / count
    if evaluated == ALL:
        return balanced([child(_turned(p, expr(sector * i))) for i in range(count)], min)
    level = _level(p)
    along = (atan2(level.y, level.x) - middle) / sector
    index = round(along)
    own = child(_turned(p, sector * index))
    if evaluated == OWN:
        return own
    local = along - index
    side = where(local < 0.0, -1.0, 1.0)
    other = child(_turned(p, sector * (index + side)))
    if evaluated == NEARER:
        return min(own, other)
    radius, angle = length(level), sector * absolute(local)
    gap = radius * sin(0.5 * sector - angle)
    nearest = min(own, at_least(other, gap))
    if count > 2:
        nearest = min(nearest, radius * sin(min(0.5 * sector + angle, 0.5 * math.pi)))
    beyond = max(ring.x - radius, radius - ring.y)
    if len(p) == 3:
        beyond = max(beyond, absolute(p.y - ring.z) - ring.w)
    return at_least(nearest, beyond)


@method
def polar(node: Node, count: int = 6) -> Node:
    """Copies at equal angles about the y axis, or of a flat shape about the origin; the node itself is the first.

    Parameters
    ----------
    count : number of copies, >= 1.

    Returns
    -------
    Node

    Raises
    ------
    SceneError : arguments of another kind or outside their range.

    Notes
    -----
    Exact for an exact child that stays in its sector without touching the sides of the sector. Evaluates 1 copy of a
    child that is symmetric about the middle of its sector (about z = 0, or y = 0 in the plane, if it is on the x axis),
    else 2. A child that
    extends beyond its sector overlaps its neighbours: every copy is evaluated, or for more than 24 copies one or two of
    each of several rings that interleave. It is refused if no such number of rings divides the number of copies.
    """
    operand("polar", node)
    count = integer("polar: count", count, 1, 65535)
    if count == 1:
        return node
    middle, half = _wedge(node.facts)
    fraction = half * count / math.pi
    if fraction >= 1.0 - 1e-9:
        rings = next((n for n in range(2, STANDARD.copies + 1) if count % n == 0 and fraction / n < 1.0 - 1e-9), 0)
        if count > STANDARD.copies and rings:
            ring = polar(node, count // rings)
            turns = [math.tau * i / count for i in range(1, rings)]
            return union(ring, *[rotate(ring, a) if node.dimension == 2 else rotate(ring, -a, "y") for a in turns])
        if count > STANDARD.copies:
            raise SceneError(
                f"polar: {node.name} takes {2.0 * half:.4g} radians about the {_axis(node)}, its sector only "
                f"{math.tau / count:.4g}",
                legal=f"a count <= {_largest(half)}, or a smaller node farther from the {_axis(node)}",
            )
        evaluated = ALL
    elif _mirrors_itself(node.facts, middle):
        evaluated = OWN
    else:
        evaluated = NEARER if node.exactness == "exact" else GUARDED
    return polar_sectors(node, int(count), middle, evaluated, _ring(node.facts))


def _axis(node: Node) -> str:
    return "origin" if node.dimension == 2 else "y axis"


def _ring(facts: Facts) -> tuple[float, float, float, float]:
    """Inner and outer radius, middle and half the height of the ring that a box sweeps when it rotates."""
    low, high = facts.lower[[0, -1]], facts.upper[[0, -1]]
    nearest = np.linalg.norm(np.maximum(np.maximum(low, -high), 0.0))
    farthest = np.linalg.norm(np.maximum(np.abs(low), np.abs(high)))
    farthest = np.minimum(farthest, UNBOUNDED)
    bottom, top = facts.lower[1], facts.upper[1]
    if len(facts.lower) == 2 or not np.isfinite(top - bottom):
        return float(nearest), float(farthest), 0.0, UNBOUNDED
    return float(nearest), float(farthest), float(0.5 * (bottom + top)), float(0.5 * (top - bottom))


def _largest(half: float) -> int:
    return int(np.clip(np.ceil(math.pi / half) - 1, STANDARD.copies, 65535))


def _wedge(facts: Facts) -> tuple[float, float]:
    """The middle and half the opening of the wedge about the axis that contains a box."""
    (x0, z0), (x1, z1) = facts.lower[[0, -1]], facts.upper[[0, -1]]
    if (x0 <= 0.0 <= x1 and z0 <= 0.0 <= z1) or not np.all(np.isfinite([x0, x1, z0, z1])):
        return 0.0, math.pi
    towards = math.atan2(0.5 * (z0 + z1), 0.5 * (x0 + x1))
    c, s = math.cos(towards), math.sin(towards)
    angles = [math.atan2(c * z - s * x, c * x + s * z) for x in (x0, x1) for z in (z0, z1)]
    low, high = np.min(angles), np.max(angles)
    middle = towards + 0.5 * (low + high)
    nearest = 0.5 * math.pi * np.round(middle / (0.5 * math.pi))  # a box on an axis: no rounding in its direction
    return float(nearest if abs(middle - nearest) < 1e-12 else middle), 0.5 * float(high - low)


def _mirrors_itself(facts: Facts, middle: float) -> bool:
    """True if the field is known to be symmetric about the half-plane at an angle."""
    quarter = middle / (0.5 * math.pi)
    if abs(quarter - np.round(quarter)) > 1e-12:
        return False
    return ("xyz"[len(facts.lower) - 1] if int(np.round(quarter)) % 2 == 0 else "x") in facts.symmetry


# Mirrored cells


def _mirrored_bounds(child: ChildFacts, spacing: Expr, nx: int, ny: int, nz: int) -> tuple[Expr, Expr]:
    """The box of the first and the last copy, which are mirrored in odd cells."""
    low, high = [], []
    for i, n in enumerate((nx, ny, nz)[: len(spacing)]):
        reach = outermost(n) * spacing[i]
        low.append((-child.upper[i] if (n // 2) % 2 else child.lower[i]) - reach)
        high.append((-child.lower[i] if ((n - 1) // 2) % 2 else child.upper[i]) + reach)
    return construct(*low), construct(*high)


def _mirrored_symmetry(child: Facts, spacing: Expr, nx: int, ny: int, nz: int) -> str:
    """An even number of cells is symmetric about the wall in its middle, for any child."""
    counts = zip("xyz", (nx, ny, nz)[: len(child.lower)], strict=False)
    return "".join(a for a, n in counts if a in child.symmetry or (n and n % 2 == 0))


def _exact_if_apart(child: Facts, spacing: Expr, nx: int, ny: int, nz: int) -> Exactness:
    """A copy that touches the wall of its cell merges with its mirror image."""
    mirrored = np.array([n != 1 for n in (nx, ny, nz)[: len(spacing)]])
    touching = 2.0 * np.maximum(-child.lower, child.upper) >= interval_of(spacing)[0]
    return "bound" if np.any(mirrored & touching) else "exact"


@operator(
    bounds=_mirrored_bounds,
    exactness=_exact_if_apart,
    spread="keep",
    symmetry=_mirrored_symmetry,
    dimension="any",
    called="repeat_mirrored",
)
def mirrored_cells(
    p: Expr, child: Child, spacing: Size3 = (2.0, 2.0, 2.0), nx: Whole = 3, ny: Whole = 1, nz: Whole = 1
) -> Expr:
    """Copies in a grid of cells, every second one mirrored; 0 for infinitely many, 1 for no repetition.

    nz is 1 for flat shapes.
    """
    parts: list[Expr] = []
    for i, n in enumerate((nx, ny, nz)[: len(p)]):
        if n == 1:
            parts.append(p[i])
            continue
        shift = shift_of(n)
        cell = limited(round(p[i] / spacing[i] - shift), n)
        turn = 1.0 - 2.0 * mod(cell, 2.0)
        parts.append(turn * (p[i] - spacing[i] * (cell + shift)))
    return child(construct(*parts))


@method
def repeat_mirrored(
    node: Node, spacing: Vector | Scalar = 2.0, count: int | Sequence[int | None] | None = None
) -> Node:
    """Copies at a spacing along the axes, every second one mirrored, as between two mirrors.

    Parameters
    ----------
    spacing : width > 0 of the cells along x, y and z (x and y for a flat shape), or one number for all. The node's
        origin is at the centre of each cell. None means no repetition along that axis.
    count : number of cells, centred on the origin: one number, or one for each axis. None means infinitely many. An
        even number has a wall at the origin: the centres nearest to it are at spacing / 2 on either side.

    Returns
    -------
    Node

    Raises
    ------
    SceneError : arguments of another kind or outside their range.

    Notes
    -----
    The solid must lie in its cell, from -spacing/2 to spacing/2. One evaluation is exact for any exact child: the
    neighbour is the mirror image of the solid in the point's own cell, and the image of a surface point is farther away
    than the surface point itself.
    """
    operand("repeat_mirrored", node)
    width, numbers = cells_of("repeat_mirrored", spacing, count, node.dimension)
    for i, n in enumerate(numbers):
        if n != 1:
            check_centred("repeat_mirrored", node, width[i], i, "the origin")
    nx, ny, nz = (*numbers, 1)[:3]
    return mirrored_cells(node, construct(*width), nx, ny, nz)


# A range of cells


@method
def repeat_interval(
    node: Node, spacing: Vector | Scalar = 2.0, first: int | Sequence[int] = 0, last: int | Sequence[int] = 2
) -> Node:
    """Copies at integer multiples of a spacing, from the first to the last.

    Parameters
    ----------
    spacing : a length > 0 for each of x, y and z (x and y for a flat shape), or one number for all. None means no
        repetition along that axis.
    first, last : indices of the first and the last copy, first <= last: one, or one for each axis. Copy 0 is at the
        position of the node.

    Returns
    -------
    Node

    Raises
    ------
    SceneError : arguments of another kind or outside their range.

    Notes
    -----
    As for `repeat`, the child must fit its cell, and the field is exact for an exact child.
    """
    n = operand("repeat_interval", node).dimension
    steps = each_axis("repeat_interval", "spacing", spacing, n)
    ends = [each_axis("repeat_interval", "first", first, n), each_axis("repeat_interval", "last", last, n)]
    counts: list[int | None] = []
    offset = []
    for step, low, high in zip(steps, *ends, strict=True):
        if step is None:
            counts.append(1)
            offset.append(expr(0.0))
            continue
        legal = "integers up to 16777216 in size, first <= last"
        start = integer("repeat_interval: first", low, -MOST, MOST, legal)
        end = integer("repeat_interval: last", high, -MOST, MOST, legal)
        if start > end:
            raise SceneError(f"repeat_interval: first = {short(first)}, last = {short(last)}", legal=legal)
        counts.append(end - start + 1)
        each = as_length("repeat_interval: spacing", step)
        offset.append(each * (0.5 * (start + end)))
    return translate(repeat(node, steps, counts), construct(*offset))
