"""The solid of a scene as operands of its outermost hard unions, each with an enclosure and a box.

A hard union is positive where all its operands are, and negative where one of them is. So each operand is proved on its
own, on the part of a ray that lies in its box. Operands whose expressions differ in numbers alone are one program.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from raymarch.expr.arrays import bound
from raymarch.expr.evaluate import Program
from raymarch.expr.function import Function
from raymarch.expr.node import Expr
from raymarch.expr.raw import limit_of
from raymarch.expr.types import STATE
from raymarch.expr.walk import find, topological
from raymarch.proof.blends import Blend, Tree
from raymarch.proof.enclosure import ENCLOSURES, SOLVED
from raymarch.proof.facts import OURS
from raymarch.proof.rays import Boxes, Rays, Stretch, Whole, picked
from raymarch.proof.rounding import ZERO, Array, Interval, up
from raymarch.proof.span import Span, constant, jumping, stretches
from raymarch.scene.parameter import Values
from raymarch.sdf.labels import rows_of
from raymarch.sdf.lower import Lowering
from raymarch.sdf.node import Node
from raymarch.truth.large import numbered_forms
from raymarch.truth.narrow import Parts

ROWS = 1 << 12
"""Stretches evaluated at once: their arrays then stay in the CPU cache."""

SIDES = 3
"""Most operations that jump on a stretch whose sides are evaluated one by one."""

LEAST = 1.0
"""Value at the centre of a stretch whose sides are evaluated, over the length from there to its farther end: of shorter
ones nine in ten are shown to be free so, of longer ones one in four."""

LONG = 100
"""Operations of a field that is long."""

MARGIN = 1e-9
"""Relative margin of a box, over its largest coordinate: above rounding errors, far below a pixel."""


@dataclass(frozen=True, slots=True, eq=False)
class Form:
    """Operands of one program. columns : the numbers of each that differ, shape (n, ...) each. nodes : (n,), or the one
    node of all."""

    program: Program
    columns: Sequence[Array]
    nodes: Sequence[Node]
    root: Expr
    params: Sequence[Expr]

    @classmethod
    def of(cls, body: Expr, params: Sequence[Expr], columns: Sequence[Array], nodes: Sequence[Node]) -> Form:
        columns = [np.asfortranarray(column) for column in columns]
        return cls(Program([body], params, ENCLOSURES), columns, nodes, body, params)

    def enclose(self, points: Span, rows: Whole) -> Span:
        found: Span = self.program(points, *(constant(picked(column, rows)) for column in self.columns))[0]
        return found

    def unbounded(self, points: Span, rows: Whole) -> Sequence[Expr | None]:
        """The first operation without bounds on each stretch, if there is one."""
        nodes = [
            node for node in topological([self.root]) if node.op not in ("const", "var") and node.type is not STATE
        ]
        program = Program(nodes, self.params, ENCLOSURES)
        values = program(points, *(constant(picked(column, rows)) for column in self.columns))
        blamed = np.full(len(rows), -1)
        for number, value in enumerate(values):
            if isinstance(value, Span) and value.slope is not None:
                steep = np.maximum(np.abs(value.slope[0]), np.abs(value.slope[1]))
                wide = np.broadcast_to(steep, (len(rows), *nodes[number].type.shape))
                blamed[(blamed < 0) & ~np.isfinite(wide).reshape(len(rows), -1).all(axis=1)] = number
        return [nodes[number] if number >= 0 else None for number in blamed]

    def node(self, row: int) -> Node:
        return self.nodes[row if len(self.nodes) > 1 else 0]


@dataclass(frozen=True, slots=True, eq=False)
class Blended:
    """A blend of many operands."""

    blend: Blend
    solid: Node

    def enclose(self, points: Span, _rows: Whole) -> Span:
        return self.blend.enclose(points)

    def unbounded(self, _points: Span, rows: Whole) -> Sequence[Expr | None]:
        return [None] * len(rows)

    def node(self, _row: int) -> Node:
        return self.solid


class Operands:
    """The operands of a solid.

    whole : True joins them to one, for rays that start inside of the solid: they leave it where they leave all.
    assumed : constants that the proof takes from the definitions.
    """

    def __init__(self, root: Node, values: Values, rays: str, whole: bool) -> None:
        self.values, self.whole = values, whole
        parts = Parts(root, rays)
        nodes: list[Node] = [root] if whole else [*parts.solids, *parts.blends]
        self.assumed = _assumed([root])
        self.forms: list[Form | Blended] = []
        form_of, row_of = [np.empty(0, np.int64)], [np.empty(0, np.int64)]
        found, forms, rows = numbered_forms([Lowering(rays=rays).field(node) for node in nodes])
        for number, (body, params, columns) in enumerate(found):
            own = [nodes[i] for i in np.flatnonzero(forms == number)]
            self.forms.append(self._blended(own[0], body, params) or Form.of(body, params, columns, own))
        form_of.append(forms)
        row_of.append(rows)
        facts = [node.facts for node in nodes]
        lower, upper = (
            [np.array([f.lower for f in facts]).reshape(-1, 3)],
            [np.array([f.upper for f in facts]).reshape(-1, 3)],
        )
        for many in () if whole else parts.many:
            for form in many.params["rows"].forms:
                field = form.columns.field
                with bound(values.params, values.time):
                    columns = [np.asarray(c, np.float64) for c in form.columns.values]
                form_of.append(np.full(len(form), len(self.forms)))
                row_of.append(np.arange(len(form)))
                self.forms.append(Form.of(field.body, field.params, columns, [many]))
                lower.append(form.lower)
                upper.append(form.upper)
        self.form_of, self.row_of = np.concatenate(form_of), np.concatenate(row_of)
        low, high = np.concatenate(lower), np.concatenate(upper)
        known = np.all(low <= high, axis=1)[:, None] & np.isfinite(low) & np.isfinite(high) & (not whole)
        size = np.where(known, np.maximum(np.abs(low), np.abs(high)), 0.0).max(axis=1, initial=0.0)[:, None]
        self.boxes = Boxes(np.where(known, low - MARGIN * size, -np.inf), np.where(known, high + MARGIN * size, np.inf))

    def _blended(self, node: Node, body: Expr, params: Sequence[Expr]) -> Blended | None:
        """A bounded blend of many operands; None for another solid, and for operands that differ in numbers."""
        low, high = node.facts.lower, node.facts.upper
        tree = Tree.of(body, params) if len(params) == 1 and np.all(np.isfinite([low, high]) & (low <= high)) else None
        if tree is None:
            return None
        with bound(self.values.params, self.values.time):
            return Blended(Blend(tree, params, low, high), node)

    def __len__(self) -> int:
        return len(self.form_of)

    @cached_property
    def blends(self) -> NDArray[np.bool_]:
        """Which operands are blends of many."""
        return np.array([isinstance(form, Blended) for form in self.forms])[self.form_of]

    def node(self, operand: int) -> Node:
        return self.forms[self.form_of[operand]].node(int(self.row_of[operand]))

    def enclose(self, rays: Rays, at: Stretch, centre: Array) -> tuple[Interval, Interval, Interval]:
        """The range, the value at the centre and the slope of the operand on each stretch."""
        n = len(at)
        results = [np.empty(n) for _ in range(6)]
        form_of = self.form_of[at.operands]
        with bound(self.values.params, self.values.time):
            for number in np.flatnonzero(np.bincount(form_of)):
                chosen = np.flatnonzero(form_of == number)
                for i in range(0, len(chosen), ROWS):
                    some = chosen[i : i + ROWS]
                    part, middle = at[some], centre[some]
                    with stretches(up(middle - part.start), up(part.end - middle)), jumping() as jumps:
                        points = rays.points(part.rays, part.start, part.end, middle)
                        found = self.forms[number].enclose(points, self.row_of[part.operands])
                    slope = found.slope or ZERO
                    for result, value in zip(results, (*found.range, *found.at, *slope), strict=True):
                        result[some] = value
                    if jumps:
                        self._on_both_sides(rays, self.forms[number], part, middle, some, np.array(jumps), results)
        for low, high in zip(results[::2], results[1::2], strict=True):
            low[np.isnan(low)], high[np.isnan(high)] = -np.inf, np.inf
        if self.whole:
            results = [-results[i] for i in (1, 0, 3, 2, 5, 4)]
        return (results[0], results[1]), (results[2], results[3]), (results[4], results[5])

    def holds(self, rays: Rays, start: Array) -> NDArray[np.bool_]:
        """Whether the start of each ray lies in the solid."""
        work = self.met(rays, start, start)
        _, at, _ = self.enclose(rays, work, work.start)
        inside = np.zeros(len(start), bool)
        inside[work.rays[at[1] < 0.0]] = True
        return inside

    def reasons(self, rays: Rays, left: Stretch, open_: NDArray[np.bool_]) -> dict[str, int]:
        """What kept rays open: the first stretch of each, by the operation whose enclosure is unbounded."""
        rows = np.flatnonzero(open_[left.rays])
        order = rows[np.lexsort((left.start[rows], left.rays[rows]))]
        first = order[np.unique(left.rays[order], return_index=True)[1]]
        found: dict[str, int] = {}
        for number in range(len(self.forms)):
            own = left[first[self.form_of[left.operands[first]] == number]]
            for i in range(0, len(own), ROWS):
                for what, count in self._blamed(rays, self.forms[number], own[i : i + ROWS]).items():
                    found[what] = found.get(what, 0) + count
        return found

    def _blamed(self, rays: Rays, form: Form | Blended, part: Stretch) -> dict[str, int]:
        """The solid of each stretch, and the first operation without bounds, if there is one."""
        middle = 0.5 * (part.start + part.end)
        rows = self.row_of[part.operands]
        here = stretches(up(middle - part.start), up(part.end - middle))
        with bound(self.values.params, self.values.time), here:
            blamed = form.unbounded(rays.points(part.rays, part.start, part.end, middle), rows)
        found: dict[str, int] = {}
        for first, row in zip(blamed, rows, strict=True):
            node = form.node(int(row))
            op = "values between wide bounds" if first is None else _named(first)
            where = f" at {node.where}" if node.where else ""
            what = f"{node.name}{where}: {op}"
            found[what] = found.get(what, 0) + 1
        return found

    def _on_both_sides(
        self,
        rays: Rays,
        form: Form | Blended,
        part: Stretch,
        middle: Array,
        some: Whole,
        jumps: Array,
        results: Sequence[Array],
    ) -> None:
        """Sharper ranges of the stretches over a few jumps: the hull of the values on all sides. At each point the
        field has the value of one side, so all values lie within the hull of those at the centre and of the slopes.
        Where one operation is given its side, others may jump no more: so each is parted by its first jump alone.
        Stretches that are long for the value at their centre are halved first: that parts most jumps, for less.
        """
        reach = np.maximum(middle - part.start, part.end - middle)
        worth = ~(results[0][some] > 0.0) & ~(results[3][some] <= LEAST * reach)
        rows = tried = np.flatnonzero(worth & jumps.any(axis=0) & (jumps.sum(axis=0) <= SIDES))
        ends = [np.full(len(part), end) for end in (np.inf, -np.inf) * 3]
        jumps, sides = jumps[:, rows], np.full((len(jumps), len(rows)), -1, np.int8)
        for left in reversed(range(SIDES)):
            rows, sides = np.tile(rows, 2), _parted(sides, jumps)
            found, jumps = self._given_sides(rays, form, part[rows], middle[rows], sides)
            done = ~jumps.any(axis=0) | (found[0] > 0.0) | (left == 0)
            for low, high, first, last in zip(ends[::2], ends[1::2], found[::2], found[1::2], strict=True):
                np.minimum.at(low, rows[done], first[done])
                np.maximum.at(high, rows[done], last[done])
            rows, sides, jumps = rows[~done], sides[:, ~done], jumps[:, ~done]
        for result, end, inner in zip(results, ends, (np.fmax, np.fmin) * 3, strict=True):
            result[some[tried]] = inner(result[some[tried]], end[tried])

    def _given_sides(
        self, rays: Rays, form: Form | Blended, part: Stretch, middle: Array, sides: Array
    ) -> tuple[Array, Array]:
        """The ends of range, value at the centre and slope on stretches, (6, N), and what still jumps."""
        found, jumps = np.empty((6, len(part))), np.zeros(sides.shape, bool)
        for i in range(0, len(part), ROWS):
            own, centre, here = part[i : i + ROWS], middle[i : i + ROWS], slice(i, i + ROWS)
            with stretches(up(centre - own.start), up(own.end - centre)), jumping(sides[:, here]) as more:
                points = rays.points(own.rays, own.start, own.end, centre)
                span = form.enclose(points, self.row_of[own.operands])
            for result, end in zip(found, (*span.range, *span.at, *(span.slope or ZERO)), strict=True):
                result[here] = end
            jumps[:, here] = more
        for end, unknown in zip(found, (-np.inf, np.inf) * 3, strict=True):
            end[np.isnan(end)] = unknown
        return found, jumps

    def met(self, rays: Rays, start: Array, end: Array) -> Stretch:
        """The parts of all rays, from start to end, in the boxes of the operands."""
        return self.boxes.met(rays, start, end)


def _parted(sides: Array, jumps: Array) -> Array:
    """The stretches on one side of their first jump, then on the other: (operations, 2 n).

    sides : as of `Stretches.sides`, (operations, n). jumps : where each operation has two values, (operations, n).
    """
    n = sides.shape[1]
    both, first = np.tile(sides, 2), np.tile(jumps.argmax(axis=0), 2)
    both[first, np.arange(2 * n)] = np.repeat(np.array([0, 1], np.int8), n)
    return both


def _assumed(roots: Sequence[Node]) -> tuple[str, ...]:
    """What is taken from definitions: the Lipschitz constants of shapes of the library whose field is long or solves an
    equation, and of GLSL of the user, whose twin is taken for it."""
    found: dict[str, str] = {}
    nodes = list(topological(list(roots), lambda node: node.children))
    for rows in [rows for node in nodes if (rows := rows_of(node)) is not None]:
        nodes += [node for form in rows.forms for node in topological([form.template], lambda node: node.children)]
    for node in nodes:
        if node.children or rows_of(node) is not None or not node.definition.source.__module__.startswith(OURS):
            continue
        field = node.definition.template(0, node.params)
        for function in [each.data for each in find([field.body], "raw") if limit_of(each.data) < np.inf]:
            found[function.name] = f"its twin, and its Lipschitz constant {function.lipschitz:.3g}"
        loops = any(loop.data.until is not None for loop in find([field.body], "loop"))
        if node.facts.exactness != "estimate" and (loops or _work(field) > LONG):
            SOLVED[field] = max(node.facts.undivided, SOLVED.get(field, 0.0))
            found[node.name] = f"its Lipschitz constant {SOLVED[field]:.3g}"
    return tuple(f"{name}: {what}" for name, what in sorted(found.items()))


def _work(field: Function) -> int:
    """Operations of a function, with those of the functions and loops that it calls, each as often as it is called."""
    total = 0
    for node in topological([field.body]):
        if node.op in ("call", "loop"):
            total += _work(node.data) if node.op == "call" else node.data.count * len(topological(node.data.inner))
        total += 1
    return total


def _named(node: Expr) -> str:
    """An operation as a user may know it."""
    if node.op != "call":
        return node.op
    return "GLSL of your own" if find([node], "raw") else f"in {node.data.name}"
