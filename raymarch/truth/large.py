"""The field of a scene of many objects: each point asks only the objects that can decide its value.

A tree of boxes over the operands of the outermost unions finds them. An operand is left out where the distance to its
box proves that it changes nothing, so all values are those of `Field`, which asks every object: bit for bit, but for
the order in which NumPy adds up rotations.

Operands whose expressions differ in numbers only are one program, which is run for pairs of points and operands.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from raymarch.expr.arrays import bound, evaluator
from raymarch.expr.derivative import gradient
from raymarch.expr.function import Function
from raymarch.expr.node import Expr, var
from raymarch.expr.raw import RawFunction, raw
from raymarch.expr.types import BOOL, FLOAT, VEC3
from raymarch.expr.walk import rebuild, topological
from raymarch.scene.parameter import Values
from raymarch.scene.scene import Scene
from raymarch.sdf.blends import FAMILIES, levels
from raymarch.sdf.facts import Facts
from raymarch.sdf.levels import may_touch
from raymarch.sdf.lower import Lowering
from raymarch.sdf.node import Node
from raymarch.sdf.rows import Form, Rows
from raymarch.truth.field import Field
from raymarch.truth.march import NOISE
from raymarch.truth.narrow import Boxes, Parts, Whole, influence

Array: TypeAlias = NDArray[Any]
Asked: TypeAlias = Callable[[Array, Whole], Array]
"""The field of some objects: points (n, 3) and the numbers of n of the objects -> (n,)."""

MANY = 100
"""Number of operands from which on points do not ask all of them."""

BRANCHES = 8
"""Boxes in a box of the tree."""

POINTS = 1 << 11
"""Points whose operands are found at once; this bounds the memory."""

PAIRS = 1 << 14
"""Pairs of a point and an object that are evaluated at once: their arrays stay in the CPU cache."""

ASIDE = 0.05
"""Share of the distance to the middle of a box that is added to that to the box: a point may lie in several boxes."""

TOGETHER = 64
"""Objects whose gradients and materials are evaluated by one program, at the points where they are the nearest."""

KEPT = 256
"""Number of such programs that are kept."""


def field_of(scene: Scene, values: Values, node: Node | None = None, rays: str = "camera") -> Field:
    """The field of a scene, or of a node in place of its solid: a `LargeField` if it has many objects."""
    parts = Parts(scene.node if node is None else node, rays)
    number = len(parts.solids) + sum(len(many.params["rows"]) for many in parts.many)
    if number < MANY and all(len(blend.children) < MANY for blend in parts.blends):
        return Field(scene, values, rays, node)
    return LargeField(scene, values, rays, parts)


class _Tree:
    """Boxes of boxes, `BRANCHES` in each, over objects in an order in which neighbours are close.

    order : the objects in that order.
    """

    def __init__(self, boxes: Boxes) -> None:
        self.order = _halved(boxes.middle)
        self.levels = [Boxes(boxes.middle[self.order], boxes.half[self.order], boxes.rise[self.order])]
        while len(low := self.levels[-1]) > BRANCHES:
            first = np.arange(0, len(low), BRANCHES)
            lower = np.minimum.reduceat(low.middle - low.half, first)
            upper = np.maximum.reduceat(low.middle + low.half, first)
            self.levels.append(Boxes.around(lower, upper, np.minimum.reduceat(low.rise, first)))
        self._columns = [(*b.middle.T.copy(), *b.half.T.copy(), b.rise) for b in self.levels]

    def _bounds(self, level: int, points: Sequence[Array], boxes: Array) -> Array:
        """The least value of the objects in some boxes at some points, by their distance. points : x, y and z."""
        columns = self._columns[level]
        total: Any = 0.0
        for x, middle, half in zip(points, columns, columns[3:6], strict=False):
            away = np.abs(x - middle[boxes])
            away -= half[boxes]
            np.maximum(away, 0.0, out=away)
            total = total + away * away
        result: Array = np.sqrt(total) * columns[6][boxes]
        return result

    def nearest(self, points: Array) -> Whole:
        """The object that is found by following the nearest box down the tree, of each point."""
        columns = [x[:, None] for x in points.T]
        boxes = np.zeros(len(points), np.int64)
        for level in reversed(range(len(self.levels))):
            below = np.minimum(boxes[:, None] * BRANCHES + np.arange(BRANCHES), len(self.levels[level]) - 1)
            beside = np.linalg.norm(points[:, None] - self.levels[level].middle[below], axis=-1)
            best = (self._bounds(level, columns, below) + ASIDE * beside).argmin(axis=1)
            boxes = below[np.arange(len(points)), best]
        return boxes

    def within(self, points: Array, limit: Array) -> tuple[Whole, Whole]:
        """All pairs of a point and an object that may be `limit` or less there, by the points in order."""
        columns, limit = list(points.T.copy()), np.maximum(limit, 0.0)  # in its box, an object may have any value
        at, boxes = np.arange(len(points)), np.zeros(len(points), np.int64)
        for level in reversed(range(len(self.levels))):
            at = np.repeat(at, BRANCHES)
            boxes = (boxes[:, None] * BRANCHES + np.arange(BRANCHES)).ravel()
            inside = boxes < len(self.levels[level])
            at, boxes = at[inside], boxes[inside]
            near = self._bounds(level, [x[at] for x in columns], boxes) <= limit[at]
            at, boxes = at[near], boxes[near]
        return at, boxes


def _halved(middle: Array) -> Whole:
    """An order of points in which each part of `BRANCHES`**n of them is a box: halves along their longest edges."""
    n = len(middle)
    order, size = np.arange(n), BRANCHES
    while size < n:
        size *= BRANCHES
    while size > 1:
        part = np.arange(n) // size
        first = np.arange(0, n, size)
        edges = np.maximum.reduceat(middle[order], first) - np.minimum.reduceat(middle[order], first)
        order = order[np.lexsort((middle[order, edges.argmax(axis=1)[part]], part))]
        size //= 2
    return order


class _Operands:
    """The operands of one union: solids, and objects of rows.

    Numbers of operands are those of the tree: from 0 in its order. `original` has their numbers in the union.
    """

    def __init__(self, solids: Sequence[Node], many: Sequence[Node], values: Values, rays: str) -> None:
        rows: list[Rows] = [node.params["rows"] for node in many]
        self.tree = _Tree(Boxes.joined([Boxes.of(solids), *map(Boxes.of_rows, rows)]))
        self.original = self.tree.order
        self.asked, form_of, row_of = _programs([Lowering(rays=rays).field(node) for node in solids])
        for each in rows:
            for form in each.forms:
                self.asked.append(_of_form(form))
                form_of = np.concatenate([form_of, np.full(len(form), len(self.asked) - 1)])
                row_of = np.concatenate([row_of, np.arange(len(form))])
        self.form_of, self.row_of = form_of[self.original], row_of[self.original]

    def ask(self, points: Array, objects: Whole) -> Array:
        """The field of an object at each point."""
        result = np.empty(len(points))
        form_of = self.form_of[objects]
        for form in np.flatnonzero(np.bincount(form_of)):
            chosen = np.flatnonzero(form_of == form)
            for i in range(0, len(chosen), PAIRS):
                some = chosen[i : i + PAIRS]
                result[some] = self.asked[form](points[some], self.row_of[objects[some]])
        return result

    def smallest(self, points: Array) -> tuple[Array, Whole, Whole, Array]:
        """The hard union at some points; and pairs of a point and an object that may be as near, with the values."""
        best = self.ask(points, self.tree.nearest(points))
        at, objects = self.tree.within(points, best)
        found = self.ask(points[at], objects)
        np.minimum.at(best, at, found)
        return best, at, objects, found


class _Blend:
    """A blend of many operands."""

    def __init__(self, node: Node, values: Values, rays: str) -> None:
        self.node, self.operands = node, _Operands(node.children, (), values, rays)
        self.influence = influence(node, values)
        a, b = var("a", FLOAT), var("b", FLOAT)
        family, k = FAMILIES[node.params["family"]](node.params["steps"]), node.params["k"]
        folded = family.fold(a, b, k)
        self._fold = evaluator([folded, gradient(folded, a), gradient(folded, b)], [a, b])

    def smallest(self, points: Array) -> tuple[Array, Whole, Whole, Array]:
        """The blend at some points; and pairs of a point and an object that changes it, with the value there."""
        best, tree = self.operands.ask(points, self.operands.tree.nearest(points)), self.operands.tree
        at, objects = tree.within(points, best + self.influence)
        found = self.operands.ask(points[at], objects)
        np.minimum.at(best, at, found)
        near = found <= (best + self.influence)[at]
        at, objects, found = at[near], objects[near], found[near]
        slot = self.operands.original[objects]
        order = np.lexsort((slot, at))
        at, objects, where, slot, value = at[order], objects[order], at[order], slot[order], found[order]
        folds: list[tuple[Whole, Array, Array, Array]] = []
        for _ in range(levels(len(self.node.children))):
            slot >>= 1
            left = np.flatnonzero((where[1:] == where[:-1]) & (slot[1:] == slot[:-1]))
            value[left], by_left, by_right = self._fold(value[left], value[left + 1])
            stays = np.ones(len(where), bool)
            stays[left + 1] = False
            folds.append((left, stays, by_left, by_right))
            where, slot, value = where[stays], slot[stays], value[stays]
        best[where] = value
        weight = np.ones(len(where))
        for left, stays, by_left, by_right in reversed(folds):
            below = np.empty(len(stays))
            below[stays] = weight
            below[left + 1] = below[left] * by_right
            below[left] *= by_left
            weight = below
        acts = weight != 0.0
        return best, at[acts], objects[acts], best[at[acts]]


class LargeField(Field):
    """The `Field` of many objects."""

    def __init__(self, scene: Scene, values: Values, rays: str, parts: Parts) -> None:
        self._node, self._parts = parts.root, parts
        self._scene, self._values, self._rays, self._kinds = scene, values, rays, {rays: self}
        self.certified = self._node.exactness != "estimate"
        self.touches = self.certified and may_touch(self._node)
        bounded = np.asarray(np.isfinite(Boxes.of(parts.solids).half).all(axis=1))
        self._beside = [node for node, found in zip(parts.solids, bounded, strict=True) if not found]
        self._solids = [node for node, found in zip(parts.solids, bounded, strict=True) if found]
        self._groups: list[_Operands | _Blend] = [_Blend(node, values, rays) for node in parts.blends]
        if self._solids or parts.many:
            self._groups.insert(0, _Operands(self._solids, parts.many, values, rays))
        self._known: dict[bytes, Field] = {}
        other = parts.part(self._beside, {})
        self._other = None if other is None else Field(scene, values, rays, other)
        if self._other is None or not self._other.has_rest:
            facts = [node.facts for node in (*self._solids, *parts.many, *parts.blends)]
            lower, upper = (np.array([getattr(f, side) for f in facts]) for side in ("lower", "upper"))
            self.rest_box = Facts("bound", 1.0, lower.min(axis=0), upper.max(axis=0))
        self.plane_normals = np.empty((0, 3)) if self._other is None else self._other.plane_normals

    @cached_property
    def _root_of_rays(self) -> Function:  # type: ignore[override]  # made when asked: few rays need it
        p = var("p", VEC3)
        return Function("field", (p,), raw(RawFunction("many_objects", "", self.distance, 1.0), p))

    def of(self, rays: str) -> Field:
        found = super().of(rays)
        return found if isinstance(found, LargeField) else field_of(self._scene, self._values, self._node, rays)

    def distance(self, points: Array) -> NDArray[np.float64]:
        return self._smallest(points, "distance")

    def rest(self, points: Array) -> NDArray[np.float64]:
        return self._smallest(points, "rest")

    @property
    def has_rest(self) -> bool:
        return True

    def planes(self, points: Array) -> NDArray[np.float64]:
        return np.empty((0, len(points))) if self._other is None else self._other.planes(points)

    def _smallest(self, points: Array, of_others: str) -> NDArray[np.float64]:
        result = np.full(len(points), np.inf)
        if self._other is not None:
            result = getattr(self._other, of_others)(points)
        with bound(self._values.params, self._values.time), np.errstate(all="ignore"):
            for i in range(0, len(points), POINTS):
                part = slice(i, i + POINTS)
                for group in self._groups:
                    result[part] = np.minimum(result[part], group.smallest(points[part])[0])
        self._refuse_nan(result, points)
        return result

    # Gradients and materials: of the objects that are nearest somewhere

    def gradient(self, points: Array) -> NDArray[np.float64]:
        return self._by_part(points, (), lambda field, at: {"": field.gradient(at)})[""]

    def material_weights(self, points: Array) -> NDArray[np.float64]:
        return self._by_part(points, (), lambda field, at: {"": field.material_weights(at)})[""]

    def material_values(self, points: Array, *frame: Array) -> dict[str, NDArray[np.float64]]:
        return self._by_part(points, frame, lambda field, at, *more: field.material_values(at, *more))

    def _by_part(
        self, points: Array, more: Sequence[Array], ask: Callable[..., dict[str, Array]]
    ) -> dict[str, NDArray[np.float64]]:
        """The answers of the fields of parts of the scene, each at the points where it decides."""
        result: dict[str, NDArray[np.float64]] = {}
        for i in range(0, max(len(points), 1), PAIRS):
            for rows, field in self._deciding(points[i : i + PAIRS]):
                for name, answer in ask(field, points[i + rows], *(v[i + rows] for v in more)).items():
                    if name not in result:
                        result[name] = np.zeros((len(points), *answer.shape[1:]))
                    result[name][i + rows] = answer
        return result

    def _deciding(self, points: Array) -> Iterator[tuple[Whole, Field]]:
        """Points, and the field of all objects that decide the value there."""
        value, where, keys = self.distance(points), [np.empty(0, np.int64)], [np.empty(0, np.int64)]
        value = value + NOISE * (np.abs(value) + np.abs(points).max(axis=1))
        first = 0
        with bound(self._values.params, self._values.time), np.errstate(all="ignore"):
            for group in self._groups:
                for i in range(0, len(points), POINTS):
                    _, at, objects, found = group.smallest(points[i : i + POINTS])
                    decides = found <= value[i + at]
                    where.append(i + at[decides])
                    keys.append(first + objects[decides])
                first += len(self._operands_of(group).original)
        at, key = np.concatenate(where), np.concatenate(keys)
        nearest = np.full(len(points), -1)
        np.maximum.at(nearest, at, key)
        order = np.argsort(nearest, kind="stable")
        together = np.zeros(len(points), np.int64)
        together[order[1:]] = np.cumsum(np.diff(nearest[order]) > 0) // TOGETHER
        for number in range(int(together.max(initial=0)) + 1):
            yield np.flatnonzero(together == number), self._field_of(np.unique(key[together[at] == number]))

    @staticmethod
    def _operands_of(group: _Operands | _Blend) -> _Operands:
        return group.operands if isinstance(group, _Blend) else group

    def _field_of(self, keys: Whole) -> Field:
        """The field of some objects, and of those that all points ask."""
        name = keys.tobytes()
        if name not in self._known:
            if len(self._known) >= KEPT:
                self._known.clear()
            solids, kept, first = list(self._beside), {}, 0
            for group in self._groups:
                original = self._operands_of(group).original
                mine = keys[(keys >= first) & (keys < first + len(original))] - first
                first += len(original)
                numbers = np.sort(original[mine])
                if isinstance(group, _Blend):
                    kept[group.node] = numbers
                    continue
                solids += [self._solids[i] for i in numbers[numbers < len(self._solids)]]
                numbers = numbers[numbers >= len(self._solids)] - len(self._solids)
                for node in self._parts.many:
                    size = len(node.params["rows"])
                    kept[node] = numbers[(numbers >= 0) & (numbers < size)]
                    numbers = numbers - size
            self._known[name] = Field(self._scene, self._values, self._rays, self._parts.part(solids, kept))
        return self._known[name]


# Programs of objects


def _of_form(form: Form) -> Asked:
    return lambda points, rows: form.columns.distance(points, rows)


def _programs(fields: Sequence[Function]) -> tuple[list[Asked], Whole, Whole]:
    """Programs for some fields, and for each field the number of its program and its position in it."""
    forms, form_of, row_of = numbered_forms(fields)
    return [_program(*form) for form in forms], form_of, row_of


def _program(body: Expr, params: Sequence[Expr], columns: Sequence[Array]) -> Asked:
    run = evaluator([body], params)
    return lambda points, rows: run(points, *(column[rows] for column in columns))[0]


Numbered: TypeAlias = tuple[Expr, Sequence[Expr], Sequence[Array]]
"""The field of objects of one form: an expression of the point and of the numbers in which they differ, these as
parameters, and their values for each object, (n, ...)."""


def numbered_forms(fields: Sequence[Function]) -> tuple[list[Numbered], Whole, Whole]:
    """The forms of some fields, and for each field the number of its form and its position in it."""
    groups: dict[Any, list[tuple[Function, list[Expr]]]] = {}
    form_of, row_of = np.zeros((2, len(fields)), np.int64)
    numbers: dict[Any, int] = {}
    for i, field in enumerate(fields):
        form, constants = _form_of(field.body)
        group = groups.setdefault(form, [])
        form_of[i], row_of[i] = numbers.setdefault(form, len(numbers)), len(group)
        group.append((field, constants))
    return [_numbered(*group[0], [constants for _, constants in group]) for group in groups.values()], form_of, row_of


def _numbers_in(node: Expr) -> list[bool]:
    """For each argument, whether it is a number that may differ from object to object."""
    return [arg.op == "const" and arg.type is not BOOL for arg in node.args]


def _form_of(body: Expr) -> tuple[Any, list[Expr]]:
    """What an expression is but for its numbers, hashable, and these in order of their use."""
    order = topological([body])
    place = {node: i for i, node in enumerate(order)}
    form: list[Any] = [body if body.op == "const" else None]
    constants: list[Expr] = []
    for node in order:
        if node.op == "const" and node.type is not BOOL:
            continue
        own = _numbers_in(node)
        form.append((node.op, node.type, node.data if node.op != "const" else bool(node.data)))
        form.append(tuple([a.type if c else place[a] for a, c in zip(node.args, own, strict=True)]))
        constants += [a for a, c in zip(node.args, own, strict=True) if c]
    return tuple(form), constants


def _numbered(field: Function, constants: Sequence[Expr], all_constants: Sequence[Sequence[Expr]]) -> Numbered:
    """The field of objects of one form, from its expression for the first of them."""
    leaves: list[Expr] = []
    columns: list[Array] = []
    replaced: list[Expr] = []
    for i, constant in enumerate(constants):
        column = np.array([each[i].data for each in all_constants], np.float64)
        if np.all(column == column[:1]):
            replaced.append(constant)
        else:
            replaced.append(var(f"number {len(leaves)}", constant.type))
            leaves.append(replaced[-1])
            columns.append(column)
    following = iter(replaced)
    made: dict[Expr, Expr] = {}
    for node in topological([field.body]):
        own = _numbers_in(node)
        args = tuple([next(following) if c else made[a] for a, c in zip(node.args, own, strict=True)])
        made[node] = rebuild(node, args) if node.args else node
    return made[field.body], [*field.params, *leaves], columns
