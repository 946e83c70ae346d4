"""Repetition in space: one child, evaluated at the nearest of its copies.

The cell of the point alone overestimates the distance where a copy in the next cell is nearer. So the nearer neighbour
is evaluated as well, on each axis (2, 4 or 8 evaluations of the child). One evaluation is enough along an axis where
the child is symmetric. Cells are centred on the child's box, so an off-centre child needs no more space than its size.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Any

import numpy as np

from raymarch.errors import SceneError
from raymarch.expr.convert import LARGEST, integer, short
from raymarch.expr.intervals import interval_of
from raymarch.expr.node import Expr, construct, expr
from raymarch.expr.types import FLOAT
from raymarch.expr.vocabulary import clamp, max, min, round, where
from raymarch.sdf.booleans import balanced, union
from raymarch.sdf.definition import Child, ChildFacts, operator
from raymarch.sdf.domain import Scalar, Size3, Vec3, Vector, Whole, as_length
from raymarch.sdf.facts import Exactness, Facts
from raymarch.sdf.node import Node, method, operand
from raymarch.sdf.placing import translate, unmoved
from raymarch.sdf.values import at_least

INFINITE = 0
MOST = 2**24
"""Maximum number of copies along an axis: the largest consecutive integer of float32."""
UNBOUNDED = 1e30
"""Half the extent of an unbounded box: larger than any coordinate, and small enough for float32."""


def outermost(n: int) -> float:
    """Distance from the middle of n copies to the centre of the outermost one, in spacings."""
    return np.inf if n == INFINITE else 0.5 * (n - 1)


def shift_of(n: int) -> float:
    """Position of the cell of index 0, in spacings: an even number of cells has a wall at the origin."""
    return 0.5 if n and n % 2 == 0 else 0.0


def bounds_of_copies(child: ChildFacts, spacing: Expr, nx: int, ny: int, nz: int, **_: object) -> tuple[Expr, Expr]:
    """The box of the outermost copies. An axis without repetition has one copy."""
    reach = construct(*map(outermost, (nx, ny, nz)[: len(spacing)])) * spacing
    return child.lower - reach, child.upper + reach


def _exact_if_apart(child: Facts, spacing: Expr, nx: int, ny: int, nz: int, guard: int, **_: Any) -> Exactness:
    """Copies that touch merge, and their surface at the contact is then inside."""
    repeated = np.array([n != 1 for n in (nx, ny, nz)[: len(spacing)]])
    touching = child.size >= interval_of(spacing)[0]
    return "bound" if guard or np.any(repeated & touching) else "exact"


def _shift(by: Any, spacing: Expr, nx: int, ny: int, nz: int) -> tuple[dict[str, Any], Any] | None:
    """An infinite repetition is periodic: whole cells of the shift are dropped."""
    if not spacing.is_constant:
        return None
    width = np.asarray(spacing.data, np.float64)
    endless = np.array([n == INFINITE for n in (nx, ny, nz)[: len(width)]])
    return {}, np.where(endless, by - width * np.rint(by / width), by)


@operator(
    exactness=_exact_if_apart,
    bounds=bounds_of_copies,
    shift=_shift,
    symmetry=lambda child, centre: unmoved(child.symmetry, centre),
    # guarded, it is at least the distance to all copies' box
    spread=lambda child, guard: 1.0 if guard else child.spread,
    dimension="any",
    called="repeat",
)
def repeat_cells(
    p: Expr,
    child: Child,
    spacing: Size3,
    centre: Vec3,
    nx: Whole,
    ny: Whole,
    nz: Whole,
    both: Whole,
    guard: Whole,
    middle: Vec3,
    half: Vec3,
) -> Expr:
    """Copies in a grid of cells.

    nx, ny, nz : copies along each axis, 0 for infinitely many, 1 for no repetition; nz is 1 for flat shapes.
    both : bits of the axes on which the nearer neighbour is evaluated too.
    guard : 1 if the child's field is only a bound. It may then order copies wrongly, and the choice of neighbours would
        make it discontinuous. The distance to the nearest unvisited cell keeps it continuous.
    middle, half : centre and half extents of the box of all copies. Outside, the distance to it is a tighter bound than
        the guard.
    """
    counts = (nx, ny, nz)[: len(p)]
    axes = [i for i, count in enumerate(counts) if count != 1]
    lookups: list[list[tuple[Expr, Expr | None]]] = [[(p[i], None)] for i in range(len(p))]
    unseen = []
    for i in axes:
        shift = shift_of(counts[i])
        along = (p[i] - centre[i]) / spacing[i] - shift
        cell = round(along)
        local = along - cell
        side = where(local < 0.0, -1.0, 1.0)
        cells: list[tuple[Expr, Expr | None]] = [(cell, None)]
        if both >> i & 1:
            cells.append((cell + side, (0.5 - abs(local)) * spacing[i]))
            unseen.append((0.5 + abs(along - limited(cell, counts[i]))) * spacing[i])
        lookups[i] = [(p[i] - spacing[i] * (limited(c, counts[i]) + shift), gap) for c, gap in cells]
    distances = [
        guarded(child(construct(*[q for q, _ in choice])), [gap for _, gap in choice if guard])
        for choice in product(*lookups)
    ]
    if not guard:
        return balanced(distances, min)
    aside = abs(p - middle) - half
    return at_least(balanced([*distances, *unseen], min), max(*aside))


def limited(cell: Expr, count: int) -> Expr:
    """The index of a cell, clamped to the cells that exist: -(n-1)/2 to (n-1)/2, shifted by half if n is even."""
    if count == INFINITE:
        return cell
    return clamp(cell, -float(count // 2), float((count - 1) // 2))


def guarded(distance: Expr, gaps: Sequence[Expr | None]) -> Expr:
    """The field of the child in a cell, at least the distance to that cell: the largest of the gaps along the axes.

    gaps : None along an axis where it is the point's own cell.
    """
    known = [gap for gap in gaps if gap is not None]
    return at_least(distance, balanced(known, max)) if known else distance


def each_axis(name: str, what: str, value: Any, dimension: int = 3) -> list[Any]:
    """One entry for each axis of an argument of the function `name`."""
    if isinstance(value, Expr) and value.type is not FLOAT:
        value = list(value)
    if isinstance(value, np.ndarray) or (hasattr(value, "__array__") and not isinstance(value, Expr | np.generic)):
        value = np.asarray(value).tolist()
    if isinstance(value, tuple | list):
        if len(value) != dimension:
            each = "three for x, y and z" if dimension == 3 else "two for x and y"
            raise SceneError(f"{name}: {what} = {short(value)}", legal=f"one value, or {each}")
        return list(value)
    return [value] * dimension


def cells_of(name: str, spacing: Any, count: Any, dimension: int = 3) -> tuple[list[Expr], list[int]]:
    """The width of the cells and the number of copies along each axis: 0 for infinitely many, 1 without a spacing."""
    widths, numbers = [], []
    steps, counts = each_axis(name, "spacing", spacing, dimension), each_axis(name, "count", count, dimension)
    for axis, step, given in zip("xyz", steps, counts, strict=False):
        n = 1 if step is None else INFINITE if given is None else given
        try:
            numbers.append(integer("count", n, 0 if given is None else 1, MOST))
        except SceneError:
            legal = "integers >= 1, or None for infinitely many"
            raise SceneError(f"{name}: count = {short(count)}", legal=legal) from None
        widths.append(expr(1.0) if step is None else as_length(f"{name}: spacing", step))
        smallest = float(interval_of(widths[-1])[0])
        if numbers[-1] != 1 and not 0.0 < smallest <= LARGEST:
            legal = f"a number > 0, and finite; None leaves an axis alone: {name}((None, None, 2.4))"
            raise SceneError(f"{name}: spacing along {axis} = {smallest:g}", legal=legal)
    return widths, numbers


def box_of_copies(node: Node, widths: Sequence[Expr], counts: Sequence[int]) -> tuple[list[float], list[float]]:
    """Centre and half extents of the box around all copies."""
    middle, half = [], []
    for low, high, width, n in zip(*node.bounds, widths, counts, strict=True):
        reach = 0.0 if n == 1 else outermost(n) * float(interval_of(width)[1])
        bottom, top = float(low) - reach, float(high) + reach
        bounded = np.isfinite(top - bottom)
        middle.append(0.5 * (bottom + top) if bounded else 0.0)
        half.append(0.5 * (top - bottom) if bounded else UNBOUNDED)
    return middle, half


def check_centred(name: str, node: Node, width: Expr, i: int, place: str) -> None:
    """SceneError if a solid does not lie in its cell about the origin, along the axis of index i. place : the origin's
    name."""
    axis, half = "xyz"[i], 0.5 * float(interval_of(width)[0])
    reach = float(np.maximum(-node.facts.lower, node.facts.upper)[i])
    if not reach <= half * (1 + 1e-12):
        cure = f"None as the spacing along {axis}, or parameters with a finite range"
        what = f"{name}: {node.name} reaches {reach:.13g} from {place} along {axis}, its cell only {half:.13g}"
        raise SceneError(what, legal=f"a spacing >= {2.0 * reach:.13g} along {axis}" if np.isfinite(reach) else cure)


@method
def repeat(
    node: Node, spacing: Vector | Scalar, count: int | Sequence[int | None] | None = None, padding: int = 0
) -> Node:
    """Copies of a solid, or of a flat shape in its plane, at a spacing along the axes.

    Parameters
    ----------
    spacing : a length > 0 for each of x, y and z (x and y for a flat shape), or one number for all axes. None means no
        repetition along that axis.
    count : number of copies, centred on the origin: one number, or one for each axis. None means infinitely many.
    padding : number of neighbours on each side that a copy may overlap, 0 to 8, for weaves and chains. The box of the
        child may then be 2 padding + 1 times as large as the spacing.

    Returns
    -------
    Node

    Raises
    ------
    SceneError : arguments of another kind or outside their range.

    Notes
    -----
    The child must fit its cell: its box must not be larger than the spacing, wherever it is. Exact for an exact child.
    Evaluates 1 copy along an axis where the child is symmetric, else 2; 2 padding + 1 times as many with padding, which
    is a union of rows of every (2 padding + 1)-th copy.
    """
    operand("repeat", node)
    wide = integer("repeat: padding", padding, 0, 8)
    if wide:
        return _padded(node, spacing, count, 2 * wide + 1)
    width, numbers = cells_of("repeat", spacing, count, node.dimension)
    lower, upper = node.bounds
    centre, both = [], 0
    for i, (axis, step, n) in enumerate(zip("xyz", width, numbers, strict=False)):
        mirrored = n == 1 or axis in node.facts.symmetry
        if n != 1:
            _check_fit(node, axis, step, float(lower[i]), float(upper[i]))
        if not mirrored:
            both |= 1 << i
        centre.append(0.0 if mirrored else 0.5 * float(lower[i] + upper[i]))
    guard = int(both != 0 and node.exactness != "exact")
    nx, ny, nz = numbers if node.dimension == 3 else (*numbers, 1)
    box = box_of_copies(node, width, numbers)
    return repeat_cells(node, construct(*width), centre, nx, ny, nz, both, guard, *box)


def _padded(node: Node, spacing: Any, count: Any, every: int) -> Node:
    """The union of rows, each with every so many-th copy."""
    width, numbers = cells_of("repeat", spacing, count, node.dimension)
    choices: list[list[tuple[Any, int | None, Expr]]] = []  # of each axis: spacing, count and shift of each row
    for step, n in zip(width, numbers, strict=True):
        if n == 1:
            choices.append([(None, 1, expr(0.0))])
        elif n == INFINITE:
            choices.append([(step * every, None, step * float(first)) for first in range(every)])
        else:
            counts = [-(-(n - first) // every) for first in range(min(every, n))]
            middles = [first + 0.5 * every * (m - 1) - 0.5 * (n - 1) for first, m in enumerate(counts)]
            choices.append([(step * every, m, step * at) for m, at in zip(counts, middles, strict=True)])
    rows = []
    for chosen in product(*choices):
        steps, counts_of_row, shifts = zip(*chosen, strict=True)
        rows.append(translate(repeat(node, steps, counts_of_row), construct(*shifts)))
    return union(*rows)


def _check_fit(node: Node, axis: str, step: Expr, lower: float, upper: float) -> None:
    smallest = float(interval_of(step)[0])
    if not np.isfinite(upper - lower):
        raise SceneError(f"repeat: {node.name} is unbounded along {axis}", legal=f"None as the spacing along {axis}")
    if upper - lower > smallest * (1 + 1e-12):
        what = f"repeat: {node.name} is {upper - lower:.13g} wide along {axis}, its cell only {smallest:.13g}"
        raise SceneError(what, legal=f"a spacing >= {upper - lower:.13g} along {axis}, or padding")
