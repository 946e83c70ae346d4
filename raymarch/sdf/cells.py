"""Repetition of a solid that differs from cell to cell.

The solid is built once, as a function of an expression that stands for the index of its cell. While facts are derived
the index ranges over all cells. In the field each evaluation gets the index of its cell.

A copy that is not in a neighbouring cell may be the nearest one, so no small number of evaluations is exact. The own
cell and the nearer neighbours are evaluated, and the step is clamped to the distance of the nearest unvisited cell.
That is a bound, and 1-Lipschitz: where the choice of cells changes, the field is at most the distance to the cells that
it drops.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import Annotated, Any
from uuid import uuid4

import numpy as np

from raymarch.errors import SceneError
from raymarch.expr.calls import checked
from raymarch.expr.convert import called, short
from raymarch.expr.intervals import interval_of
from raymarch.expr.node import Expr, construct, expr, make
from raymarch.expr.types import VEC3
from raymarch.expr.vocabulary import abs as absolute
from raymarch.expr.vocabulary import max, min, round, where
from raymarch.sdf.booleans import balanced
from raymarch.sdf.definition import Child, operator
from raymarch.sdf.domain import Domain, Scalar, Size3, Vec3, Vector, Whole
from raymarch.sdf.facts import Facts
from raymarch.sdf.node import Node
from raymarch.sdf.repetition import (
    INFINITE,
    UNBOUNDED,
    bounds_of_copies,
    box_of_copies,
    cells_of,
    check_centred,
    guarded,
    limited,
    outermost,
    shift_of,
)
from raymarch.sdf.values import at_least

__all__ = ["repeat_varied"]


@dataclass(frozen=True, slots=True)
class Cells:
    """The range of indices of the cells of one repetition along each axis; infinite without a limit.

    key : unique to this repetition, also after unpickling in another process.
    """

    low: tuple[float, float, float]
    high: tuple[float, float, float]
    key: str = field(default_factory=lambda: uuid4().hex, repr=False)

    @property
    def index(self) -> Expr:
        """The expression of the index of a cell, unique to this repetition."""
        return make("cell", VEC3, (), self)


ANY = Cells((-np.inf,) * 3, (np.inf,) * 3)

CellsOf = Annotated[Any, Domain(None, holds=Cells)]


def _check_room(child: Facts, cells: Cells, spacing: Expr, nx: int, ny: int, nz: int, middle: Expr, half: Expr) -> None:
    """The solid of every cell must lie in its cell, and within the box of all cells."""
    width = interval_of(spacing)[0]
    for i, n in enumerate((nx, ny, nz)):
        low, high = child.lower[i], child.upper[i]
        fits = n == 1 or 2.0 * np.maximum(-low, high) <= width[i] * (1 + 1e-12)
        reach = 0.0 if n == 1 else outermost(n) * interval_of(spacing)[1][i]
        m, h = middle.data[i], half.data[i] * (1 + 1e-12)
        if not fits or (h < UNBOUNDED and not (m - h <= low - reach and high + reach <= m + h)):
            raise SceneError("varied_cells: the solid does not fit its cell", legal="repeat_varied(build, spacing)")


@operator(bounds=bounds_of_copies, spread=1.0, check=_check_room, called="repeat_varied")
def varied_cells(
    p: Expr,
    child: Child,
    cells: CellsOf = ANY,
    spacing: Size3 = (2.0, 2.0, 2.0),
    nx: Whole = 3,
    ny: Whole = 1,
    nz: Whole = 1,
    middle: Vec3 = (0.0, 0.0, 0.0),
    half: Vec3 = (UNBOUNDED, UNBOUNDED, UNBOUNDED),
) -> Expr:
    """Copies in a grid of cells, each with its own index.

    nx, ny, nz : copies along each axis, 0 for infinitely many, 1 for no repetition.
    middle, half : centre and half extents of the box around all copies.
    """
    lookups: list[list[tuple[Expr, Expr, Expr | None]]] = []
    unseen = []
    for i, n in enumerate((nx, ny, nz)):
        if n == 1:
            lookups.append([(p[i], expr(0.0), None)])
            continue
        shift = shift_of(n)
        along = p[i] / spacing[i] - shift
        own = limited(round(along), n)
        local = along - own
        other = limited(own + where(local < 0.0, -1.0, 1.0), n)
        gap = (0.5 - absolute(local)) * spacing[i]
        lookups.append([(p[i] - spacing[i] * (cell + shift), cell, g) for cell, g in ((own, None), (other, gap))])
        unseen.append((0.5 + absolute(local)) * spacing[i])
    nearest = [_look_up(child, cells, choice) for choice in product(*lookups)]
    aside = absolute(p - middle) - half
    return at_least(balanced([*nearest, *unseen], min), max(*aside))


def _look_up(child: Child, cells: Cells, choice: Sequence[tuple[Expr, Expr, Expr | None]]) -> Expr:
    """The child of one cell. For a neighbour, the value is at least the distance to the neighbour's cell."""
    value = child(construct(*[q for q, _, _ in choice]))
    index = construct(*[cell for _, cell, _ in choice])
    distance = make(value.op, value.type, (*value.args, cells.index, index), value.data)
    return guarded(distance, [gap for _, _, gap in choice])


@checked
def repeat_varied(
    build: Callable[[Expr], Node], spacing: Vector | Scalar, count: int | Sequence[int | None] | None = None
) -> Node:
    """Copies at a spacing along the axes that differ from cell to cell.

    Parameters
    ----------
    build : function from the index of a cell to its solid, centred at the origin. The index is a vec3 expression of
        integers; along an axis with n cells it runs from -(n // 2) to (n - 1) // 2. Any parameter of any node may
        depend on it. `raymarch.hash(index)` gives a number from 0 to 1 for each cell.
    spacing : a length > 0 for each of x, y and z, or one number for all. None means no repetition along that axis.
    count : number of cells, centred on the origin: one number, or one for each axis. None means infinitely many.

    Returns
    -------
    Node

    Raises
    ------
    SceneError : arguments of another kind or outside their range.

    Notes
    -----
    Facts hold for every index. A value that depends on the index must have a finite range: with infinitely many cells
    use sin, mod or clamp. The solid must fit its cell, from -spacing/2 to spacing/2, for every index.

    A bound, 1-Lipschitz. It is exact up to the distance of the nearest unvisited cell, which is half a cell or more.
    Evaluates the own cell and the nearer neighbour along each axis: 2, 4 or 8 evaluations of the solid.
    """
    width, numbers = cells_of("repeat_varied", spacing, count)
    ends = [(-np.inf, np.inf) if n == INFINITE else (float(-(n // 2)), float((n - 1) // 2)) for n in numbers]
    low, high = zip(*ends, strict=True)
    cells = Cells(low, high)
    if not callable(build) or isinstance(build, Expr):
        raise SceneError(f"repeat_varied: build = {short(build)}", legal="a function of the index of a cell")
    node = called("repeat_varied: build", build, cells.index, legal="a function from the index of a cell to a solid")
    if not isinstance(node, Node) or node.dimension != 3:
        raise SceneError(f"repeat_varied: build gives {short(node)}", legal="a solid such as sphere()")
    for i in range(3):
        if numbers[i] != 1:
            check_centred("repeat_varied", node, width[i], i, "the middle of its cell")
    nx, ny, nz = numbers
    return varied_cells(node, cells, construct(*width), nx, ny, nz, *box_of_copies(node, width, numbers))
