"""Functions that find the objects of a point through cells, and evaluate them."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np

from raymarch.expr.derivative import companion, gradient
from raymarch.expr.function import Function, loop
from raymarch.expr.intervals import interval_of
from raymarch.expr.node import Expr, const, construct, expr, swizzle, var
from raymarch.expr.tables import Table, fetch
from raymarch.expr.types import FLOAT, VEC3
from raymarch.expr.vocabulary import all_of, clamp, dot, floor, length, min, normalize, where
from raymarch.expr.walk import substitute
from raymarch.plan.cells import Cells, build
from raymarch.scene.scene import Scene
from raymarch.sdf.blends import FAMILIES
from raymarch.sdf.booleans import balanced, smooth_min
from raymarch.sdf.rows import FARTHEST, Rows, gradient_at

_KEPT = 4
_built: OrderedDict[tuple[Rows, float], Located] = OrderedDict()
"""The cells that were built last, by content."""

Carried: TypeAlias = Callable[[int, Expr, tuple[Expr, Expr], Sequence[Expr]], Sequence[Expr]]
Mixed: TypeAlias = Callable[[Expr, Expr, Sequence[Expr], Sequence[Expr]], Sequence[Expr]]


def exact_distance(scene: Scene) -> float:
    """The distance to surfaces up to which effects read the field, so that it must be exact: ambient occlusion, and
    shadows of lights that have a size."""
    facts = scene.subject
    size = 0.0 if facts is None else float(np.linalg.norm(facts.size))
    found = [0.0]
    if scene.occlusion is not None:
        found.append(float(interval_of(scene.occlusion.reach)[1]))
    for light in scene.lights:
        if light.soft and light.penumbra != "sampled":
            found.append(float(interval_of(light.softness)[1]) * (1.0 if light.has_position else size))
    return float(np.minimum(np.max(found), size))


@dataclass(frozen=True, eq=False)
class Many:
    """The label of a mark that stands for many objects. inherited : the material of objects without one."""

    rows: Rows
    inherited: Any
    expressions: Sequence[Expr] = ()


@dataclass(eq=False)
class ObjectsInCells:
    """Evaluates rows through cells; see `raymarch.sdf.lower.Objects`.

    exact : for each of the rows, the distance up to which its field must be exact.
    """

    exact: Mapping[Rows, float]
    _labels: dict[Any, Many] = field(default_factory=dict)

    def located(self, rows: Rows) -> Located:
        """The rows with their cells, which are built once for equal rows."""
        key = (rows, self.exact[rows])
        if key not in _built:
            _built[key] = Located(rows, build(*key))
            while len(_built) > _KEPT:
                _built.popitem(last=False)
        _built.move_to_end(key)
        return _built[key]

    def distance(self, rows: Rows) -> Function:
        return self.located(rows).field

    def label(self, rows: Rows, inherited: Any) -> Many:
        return self._labels.setdefault((rows, inherited), Many(rows, inherited))


class Located:
    """Rows with their cells, and the functions that read them.

    field : the distance, a function of the point; its companion is the gradient.
    """

    def __init__(self, rows: Rows, cells: Cells) -> None:
        self.rows, self.cells = rows, cells
        firsts = np.cumsum([0, *map(len, rows.forms)])
        entries = np.empty(len(cells.lists))
        form_of = np.searchsorted(firsts, cells.lists, side="right") - 1
        for i in range(len(rows.forms)):
            mine = form_of == i
            entries[mine] = rows.stored.texel_of(i, cells.lists[mine] - firsts[i])
        listed = np.stack([entries, cells.merges], axis=1) if rows.family else entries[:, None]
        self.listed = Table(listed if len(listed) else np.zeros((1, listed.shape[1])), "lists of objects")
        self.texels = Table(cells.texels, "cells of objects")
        p = var("p", VEC3)
        place = _Place(self, p)
        if rows.family:
            value, slope = self._blended(place, p, False)[0], None
            slope = self._blended(place, p, True)[1]
        else:
            value, winner = self.nearest(place, p)
            slope = swizzle(gradient_at(rows, p, winner), "xyz")
        self.field = Function("objects", (p,), place.otherwise(value))
        both = construct(place.slope_otherwise(slope), place.otherwise(value))
        made = Function("objects_gradient", (p,), both)
        made.derived["gradient of"] = self.field
        self.field.derived["companion", 0] = made
        self.point, self.place = p, place

    # Hard unions

    def nearest(self, place: _Place, p: Expr) -> tuple[Expr, Expr]:
        """The smallest distance of the objects in the cell of a point, and where the row of that object begins."""
        stored = self.rows.stored
        first = fetch(self.listed, place.start)
        state: tuple[Expr, ...] = (place.start, first, const(FARTHEST), first)
        for i, form in enumerate(self.rows.forms):
            most = float(stored.first[i + 1]) if i + 1 < len(self.rows.forms) else None

            def step(_turn: Expr, at: Expr, entry: Expr, best: Expr, winner: Expr, i: int = i, form: Any = form) -> Any:
                d = stored.called(i, form.columns.field, p, entry)
                nearer = d < best
                return at + 1.0, fetch(self.listed, at + 1.0), where(nearer, d, best), where(nearer, entry, winner)

            def until(_turn: Expr, at: Expr, entry: Expr, *_: Expr, most: float | None = most) -> Expr:
                done = at >= place.end
                return done if most is None else done | (entry >= most)

            state = loop(max_turns(self.cells), state, step, until)
        return state[2], state[3]

    # Blends

    def _blended(self, place: _Place, p: Expr, slopes: bool) -> tuple[Expr, Expr]:
        value = self.blend(place, p, (lambda i, entry, d, read: (d[1],)) if slopes else None)
        return value[0], value[1] if slopes else value[0]

    def blend(
        self,
        place: _Place,
        p: Expr,
        carried: Carried | None,
        mixed: Mixed | None = None,
    ) -> tuple[Expr, ...]:
        """The blend of the objects in the cell of a point.

        carried : further values of an object, of its form, its row, its distance and gradient, and its columns. They
        are mixed by the partial derivatives of each fold. None for the distance alone.
        mixed : how further values are mixed; None for the sum with the derivatives as weights.
        """
        stored, rows = self.rows.stored, self.rows
        k = rows.k
        a, b, width = var("a", FLOAT), var("b", FLOAT), var("k", FLOAT)
        fold = smooth_min if rows.family == "quadratic" else FAMILIES[rows.family](4).fold
        folded = fold(a, b, width)
        by_a, by_b = gradient(folded, a), gradient(folded, b)
        depth = self.cells.stack

        def leaf(entry: Expr) -> list[Expr]:
            per_form: list[list[Expr]] = []
            for i, form in enumerate(rows.forms):
                read = stored.read(i, entry)
                columns = read[: len(form.columns.params)]
                if carried is None:
                    per_form.append([form.columns.field(p, *columns)])
                else:
                    both = companion(form.columns.field)(p, *columns)
                    pair = (swizzle(both, "w"), swizzle(both, "xyz"))
                    per_form.append([pair[0], *carried(i, entry, pair, read)])
            return [stored.choose(entry, [values[j] for values in per_form]) for j in range(len(per_form[0]))]

        def merge(left: Sequence[Expr], right: Sequence[Expr]) -> list[Expr]:
            known = {a: left[0], b: right[0], width: expr(k)}
            value, wa, wb = substitute([folded, by_a, by_b], known)
            if mixed is not None:
                return [value, *mixed(wa, wb, left[1:], right[1:])]
            return [value, *(wa * x + wb * y for x, y in zip(left[1:], right[1:], strict=True))]

        first = fetch(self.listed, place.start)
        size = len(leaf(swizzle(first, "x")))
        zeros = [const(np.zeros(value.type.shape)) for value in leaf(swizzle(first, "x"))]
        zeros[0] = const(FARTHEST)

        def step(_turn: Expr, at: Expr, *held: Expr) -> Sequence[Expr]:
            texel = fetch(self.listed, at)
            top, stack = held[:size], held[size:]
            del top
            value = leaf(swizzle(texel, "x"))
            folds = swizzle(texel, "y")

            def join(_i: Expr, *state: Expr) -> Sequence[Expr]:
                merged = merge(state[size : 2 * size], state[:size])
                return (*merged, *state[2 * size :], *zeros)

            done = loop(max_folds(self.cells), (*value, *stack), join, lambda i, *_: i >= folds)
            # The last value lies on top; the next object pushes it.
            return (at + 1.0, *done[:size], *done[:size], *done[size : len(done) - size])

        start = (place.start, *zeros, *(zeros * depth))
        final = loop(max_turns(self.cells), start, step, lambda _turn, at, *_: at >= place.end)
        return final[1 : 1 + size]


def max_turns(cells: Cells) -> int:
    """Constant bound of the loops over a list: compilers handle a variable bound badly."""
    return int(np.maximum(cells.most, 1))


def max_folds(cells: Cells) -> int:
    """Constant bound of the loop over the folds after an object."""
    return int(np.maximum(cells.merges.max(initial=1), 1))


class _Place:
    """The cell of a point.

    start, end : its list; empty in a far cell and outside of the grid. near : True if it has a list.
    bound : a lower bound of the field elsewhere, and `bound_slope` its gradient.
    """

    def __init__(self, located: Located, p: Expr) -> None:
        cells, texels = located.cells, located.texels
        counts = cells.counts.astype(float)
        q = (p - tuple(cells.low)) * (1.0 / cells.size)
        inside = all_of(*[condition for i in range(3) for condition in (q[i] >= 0.0, q[i] < float(counts[i]))])
        cell = clamp(floor(q), 0.0, tuple(counts - 1.0))
        texel = fetch(texels, dot(cell, (1.0, float(counts[0]), float(counts[0] * counts[1]))))
        fine: Expr = const(1.0)
        if cells.depth:
            state = (swizzle(texel, "x"), swizzle(texel, "y"), cell, fine)

            def step(_turn: Expr, x: Expr, y: Expr, at: Expr, scale: Expr) -> tuple[Expr, ...]:
                child = clamp(floor(q * (2.0 * scale)) - 2.0 * at, 0.0, 1.0)
                found = fetch(texels, x + dot(child, (1.0, 2.0, 4.0)))
                return swizzle(found, "x"), swizzle(found, "y"), 2.0 * at + child, 2.0 * scale

            x, y, cell, fine = loop(cells.depth, state, step, lambda _turn, x, y, *_: abs(y) > 0.5)
        else:
            x, y = swizzle(texel, "x"), swizzle(texel, "y")
        self.near = inside & (y > 0.5)
        self.start = where(self.near, x, 0.0)
        self.end = where(self.near, x + y, 0.0)
        away = p - ((cell + 0.5) * (cells.size / fine) + tuple(cells.low))
        out = p - clamp(p, tuple(cells.inner_low), tuple(cells.inner_high))
        beyond = length(out) * cells.steepness - cells.less
        self.bound = where(inside, x - length(away), beyond)
        self.bound_slope = where(inside, -normalize(away), normalize(out) * cells.steepness)
        outer = [form for form in located.rows.forms if not np.all(np.isfinite(form.lower))]
        self.open = [
            (form.columns.field(p), swizzle(companion(form.columns.field)(p), "xyz"))
            for form in outer
            if len(form) == 1
        ]

    def otherwise(self, value: Expr) -> Expr:
        """A value where the point has a list, else the bound; unbounded objects may be nearer."""
        bound = self.bound
        if self.open:
            bound = min(bound, balanced([d for d, _ in self.open], min))
        return where(self.near, value, bound)

    def slope_otherwise(self, slope: Expr) -> Expr:
        """The gradient likewise."""
        bound, bound_slope = self.bound, self.bound_slope
        for d, g in self.open:
            bound_slope = where(d < bound, g, bound_slope)
            bound = min(d, bound)
        return where(self.near, slope, bound_slope)
