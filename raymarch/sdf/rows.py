"""Objects as rows of numbers: one form for all, and for each object the numbers that differ.

A form is a tree of nodes in which numbers are variables, its leaves. Its field is one function of the point and some
columns: numbers of an object that do not depend on the point, such as a rotation matrix. The columns are computed once,
in float64, and stored in a table, from which the shader reads them.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from raymarch.errors import SceneError
from raymarch.expr.arrays import FLOAT32, FLOAT64, Remembered, bound, evaluator
from raymarch.expr.derivative import companion, state_gradient
from raymarch.expr.function import Function, loop
from raymarch.expr.node import Expr, const, make, var
from raymarch.expr.tables import LiveTable, Table, fetch
from raymarch.expr.types import FLOAT, VEC3
from raymarch.expr.vocabulary import min as minimum
from raymarch.expr.vocabulary import where
from raymarch.expr.walk import find, substitute, topological
from raymarch.sdf.booleans import balanced
from raymarch.sdf.columns import Columns, Packing
from raymarch.sdf.facts import FARTHEST
from raymarch.sdf.labels import relabelled, seen_labels
from raymarch.sdf.lower import UNMARKED, Lowering
from raymarch.sdf.node import Node

Array: TypeAlias = NDArray[np.float64]

SPELLED = 2000
"""Maximum number of objects whose materials the reference evaluates: each is a part of the expression."""

PAIRS = 1 << 18
"""Pairs of a point and an object that are evaluated at once."""


@dataclass(frozen=True, slots=True)
class Slot:
    """The label of a part whose material differs from object to object."""

    index: int


@dataclass(frozen=True, eq=False)
class Moving:
    """Where objects are that depend on parameters or time: each in a ball of the space of a part of its form.

    point : the point in that space, an affine map of `var("p", VEC3)`, over the leaves of the form.
    middle, radius : of the balls, shape (n, 3) and (n,), for all values of parameters and time.
    """

    point: Expr
    middle: Array
    radius: Array

    def spheres(self, leaves: Sequence[Expr], numbers: Sequence[Array]) -> tuple[Array, Array]:
        """The balls in the space of the rows, for the bound parameters and time: centres and radii."""
        p = var("p", VEC3)
        run = evaluator([self.point], [p, *leaves])
        shape = (len(self.radius), 3)
        at = [np.broadcast_to(run(np.broadcast_to(q, shape), *numbers)[0], shape) for q in np.eye(4, 3, -1)]
        linear = np.stack([column - at[0] for column in at[1:]], axis=-1)
        centres = np.linalg.solve(linear, (self.middle - at[0])[..., None])[..., 0]
        return centres, self.radius / np.cbrt(np.abs(np.linalg.det(linear)))


@dataclass(frozen=True, eq=False)
class Form:
    """Objects of one form.

    template : the tree, whose numbers are the variables `leaves`.
    divisors : the divisors of the template's nodes that are leaves, by the id of the node.
    numbers : the value of each leaf for each object, shape (n, ...) each.
    slots : the material of each slot for each object, an index of `Rows.materials`, shape (n, slots).
    order : position of each object among the operands of the union, shape (n,).
    lower, upper : box of each object, shape (n, 3). radius : of a sphere about the centre of the box that holds it,
        shape (n,). spread, lipschitz : facts of each, shape (n,).
    exact : True if all are exact. divisor : the number by which the field of each is divided; 1 if these differ.
    moving : where objects are that depend on parameters or time; None for a form that does not.
    """

    template: Node
    leaves: tuple[Expr, ...]
    divisors: Mapping[int, Expr]
    numbers: tuple[Array, ...]
    slots: NDArray[np.int64]
    order: NDArray[np.int64]
    lower: Array
    upper: Array
    radius: Array
    spread: Array
    lipschitz: Array
    exact: bool
    divisor: float = 1.0
    moving: Moving | None = None

    def __len__(self) -> int:
        return len(self.order)

    @cached_property
    def key(self) -> tuple[Any, ...]:
        """The content, hashable."""
        digest = hashlib.sha256()
        for array in (*self.numbers, self.slots, self.order):
            digest.update(array.tobytes())
        return self.template, self.leaves, len(self), digest.hexdigest()

    @property
    def spheres(self) -> tuple[Array, Array]:
        """A ball around each object, for the bound parameters and time: centres (n, 3) and radii (n,)."""
        if self.moving is not None:
            return self.moving.spheres(self.leaves, self.numbers)
        return 0.5 * (self.lower + self.upper), self.radius

    def marked(self, label: Any) -> Expr:
        """The field with its labels, over the leaves; see `Lowering.field`."""
        return Lowering(divisors=self.divisors).field(self.template, label=label).body

    @cached_property
    def columns(self) -> Columns:
        """The numbers of each object on which the field depends."""
        lowered = Lowering(divisors=self.divisors).field(self.template, label=UNMARKED)
        parts = [lowered.body]
        if self.template.labelled:  # the points at which labels are evaluated depend on the same numbers
            parts.append(self.marked(Slot(0)))
        return Columns(self, lowered, parts)


@dataclass(frozen=True, eq=False)
class Rows:
    """Objects in a union, as rows of some forms.

    forms : the forms; the rows of the first come first.
    materials : the materials that objects may have; None stands for the material that is inherited.
    k, family : width and kind of the blend; 0 and "" for a hard union.
    given : the function that made the rows of `instances`, and its arguments; None for other rows.
    """

    forms: tuple[Form, ...]
    materials: tuple[Any, ...] = (None,)
    k: float = 0.0
    family: str = ""
    given: tuple[Any, ...] | None = None

    @cached_property
    def key(self) -> tuple[Any, ...]:
        """The content, hashable."""
        return tuple(form.key for form in self.forms), self.materials, self.k, self.family

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Rows) and self.key == other.key

    def __hash__(self) -> int:
        return self._hash

    @cached_property
    def _hash(self) -> int:
        return hash(self.key)

    def __reduce__(self) -> tuple[Any, ...]:
        make, *given = self.origin
        return make, tuple(given)

    @property
    def origin(self) -> tuple[Any, ...]:
        """The function that made the rows, and its arguments."""
        assert self.given is not None, "only the plan makes other rows, and does not change them"
        return self.given

    def relabelled(self, change: Callable[[Any], Any]) -> Rows:
        """The same objects with materials mapped by a function."""
        make, node, transforms, materials = self.origin
        if self.materials != (None,):
            materials = [change(m) for m in self.materials], self.forms[0].slots[:, 0]
        made: Rows = make(relabelled(node, change), transforms, materials)
        return made

    def materials_in(self, slots: Sequence[int | None], inherited: Any) -> list[Any]:
        """The materials by their index, with one that some object has in place of those that none has.

        slots : of each form, the slot that all its parts have, or None. inherited : in place of None.
        """
        pairs = zip(self.forms, slots, strict=True)
        columns = [form.slots if slot is None else form.slots[:, slot] for form, slot in pairs]
        used = {int(k) for column in columns for k in np.unique(column)}
        chosen = [self.materials[k if k in used else min(used)] for k in range(len(self.materials))]
        return [inherited if material is None else material for material in chosen]

    def __repr__(self) -> str:
        return f"Rows({len(self)})"

    def __len__(self) -> int:
        return sum(map(len, self.forms))

    @cached_property
    def live(self) -> tuple[Expr, ...]:
        """The parameters and time, on which some objects depend."""
        return tuple(dict.fromkeys(leaf for form in self.forms if form.moving for leaf in form.columns.live))

    @property
    def divisor(self) -> float:
        """The number by which the fields of all objects are divided; 1 if these differ."""
        found = {form.divisor for form in self.forms}
        return found.pop() if len(found) == 1 else 1.0

    @property
    def labelled(self) -> bool:
        """True if objects have materials of their own."""
        return self.materials != (None,) or any(form.template.labelled for form in self.forms)

    @cached_property
    def lower(self) -> Array:
        """Lower corner of the box around all objects, shape (3,)."""
        return np.min([form.lower.min(axis=0) for form in self.forms], axis=0)

    @cached_property
    def upper(self) -> Array:
        """Upper corner."""
        return np.max([form.upper.max(axis=0) for form in self.forms], axis=0)

    @cached_property
    def labels(self) -> tuple[Any, ...]:
        """The materials of all objects, each once; None if some inherit theirs."""
        inner = (seen_labels(form.template) for form in self.forms)
        fixed = [label for found in inner for label in found if not isinstance(label, Slot)]
        return tuple(dict.fromkeys([*self.materials, *fixed]))

    def spelled(self, label: tuple[Any, Expr], point: Expr) -> Expr:
        """The distance with a mark for each part of each object; `label` is the inherited one and its point.

        Raises SceneError for many objects.
        """
        if len(self) > SPELLED:
            raise SceneError(f"materials of {len(self):,} instances on the CPU", legal=f"up to {SPELLED:,} instances")
        terms: list[tuple[int, Expr]] = []
        for form in self.forms:
            bodies: dict[Any, Expr] = {}
            for row in range(len(form)):
                key = tuple(form.slots[row])
                if key not in bodies:
                    bodies[key] = _with_materials(form.marked(Slot(0)), [self.materials[m] for m in key], label)
                numbers = zip(form.leaves, form.numbers, strict=True)
                known = {leaf: const(value[row], leaf.type) for leaf, value in numbers}
                known[form.columns.point] = point
                terms.append((int(form.order[row]), substitute([bodies[key]], known)[0]))
        terms.sort(key=lambda term: term[0])
        return balanced([value for _, value in terms], minimum)

    @cached_property
    def stored(self) -> Stored:
        """The table of all rows."""
        with bound({}, 0.0):
            return Stored(self)

    def name(self, *what: Any) -> str:
        """A name for a part of the rows that are live, by all that it depends on: their content, and `what`."""
        digest = hashlib.sha256(repr((what, self.k, self.family)).encode())
        for form in self.forms:
            columns, moving = form.columns, form.moving
            expressions = [columns.field.body, *columns.sources, *([] if moving is None else [moving.point])]
            digest.update(repr((form.key[2:], form.exact, [_written(e) for e in expressions])).encode())
            balls = () if moving is None else (moving.middle, moving.radius)
            for array in (form.lower, form.upper, form.radius, form.spread, form.lipschitz, *balls):
                digest.update(np.ascontiguousarray(array).tobytes())
        return digest.hexdigest()[:12]

    @cached_property
    def field(self) -> Function:
        """The distance to all objects, which asks each of them: slow, and independent of cells."""
        return _every_row(self)


class Stored:
    """The table of rows, and how to read it.

    packings : of each form; each has one extra number for each slot of materials that vary.
    first : index of the first texel of each form, and the number of texels.
    """

    def __init__(self, rows: Rows) -> None:
        self.rows = rows
        self.packings: list[Packing] = []
        self.varying: list[list[int]] = []
        self.first = [0]
        for form in rows.forms:
            varying = [j for j in range(form.slots.shape[1]) if np.any(form.slots[:, j] != form.slots[0, j])]
            packing = Packing(form.columns.params, len(varying))
            self.varying.append(varying)
            self.packings.append(packing)
            self.first.append(self.first[-1] + packing.texels * len(form))
        self.table: Table | LiveTable = self._table()
        if rows.live:
            self.table = LiveTable(Remembered(self._table, rows.live), self.table.label, rows.name("rows"))

    def _table(self) -> Table:
        """All rows, for the bound parameters and time."""
        tables = []
        for form, packing, varying in zip(self.rows.forms, self.packings, self.varying, strict=True):
            extra = [form.slots[:, j].astype(np.float64) for j in varying]
            tables.append(packing.table([*form.columns.values, *extra], len(form)))
        return Table(np.concatenate(tables), f"{len(self.rows):,} objects")

    def read(self, form: int, entry: Expr) -> list[Expr]:
        """Columns and varying slots of the row whose first texel has the index `entry`."""
        packing = self.packings[form]
        return packing.read([fetch(self.table, entry + float(i)) for i in range(packing.texels)])

    def texel_of(self, form: int, rows: Any) -> Any:
        """Index of the first texel of some rows of a form."""
        return self.first[form] + self.packings[form].texels * rows

    def called(self, form: int, function: Function, point: Expr, entry: Expr) -> Expr:
        """A function of the point and the columns, for the row at `entry`."""
        read = self.read(form, entry)[: len(function.params) - 1]
        return function(point, *read)

    def choose(self, entry: Expr, values: Sequence[Expr]) -> Expr:
        """The value of the form to which the row at `entry` belongs."""
        result = values[-1]
        for form in reversed(range(len(values) - 1)):
            result = where(entry < float(self.first[form + 1]), values[form], result)
        return result


MOST_TURNS = 1 << 15


def _every_row(rows: Rows) -> Function:
    """The function that asks every object, with its gradient and its evaluation in NumPy."""
    p, stored = var("p", VEC3), rows.stored
    nearest: tuple[Expr, Expr] = (const(FARTHEST), const(0.0))
    for i, form in enumerate(rows.forms):
        nearest = _nearest_of(stored, i, len(form), form.columns.field, p, nearest)
    made = Function("instances_field", (p,), nearest[0])
    slopes = [stored.called(i, companion(form.columns.field), p, nearest[1]) for i, form in enumerate(rows.forms)]
    slope = state_gradient(made, stored.choose(nearest[1], slopes))
    for reading in (FLOAT64, FLOAT32):
        made.stated.programs[reading] = lambda points, t=reading.dtype: (_distances(rows, points).astype(t),)
        slope.stated.programs[reading] = lambda points, t=reading.dtype: (_gradients(rows, points).astype(t),)
    return made


def _nearest_of(
    stored: Stored, form: int, n: int, field: Function, p: Expr, first: tuple[Expr, Expr]
) -> tuple[Expr, Expr]:
    """The smallest distance to rows of a form or `first`, and where its row begins."""
    base, stride = float(stored.first[form]), float(stored.packings[form].texels)

    def step(entry: Expr, best: Expr, winner: Expr) -> tuple[Expr, Expr]:
        d = stored.called(form, field, p, entry)
        return where(d < best, d, best), where(d < best, entry, winner)

    if n <= MOST_TURNS:
        return loop(n, first, lambda i, best, winner: step(base + stride * i, best, winner))  # type: ignore[return-value]

    def block(b: Expr, best: Expr, winner: Expr) -> Sequence[Expr]:
        start = base + (stride * MOST_TURNS) * b
        return loop(
            MOST_TURNS,
            (best, winner),
            lambda i, best, winner: step(start + stride * i, best, winner),
            lambda i, *_: start + stride * i >= base + stride * n,
        )

    return loop(-(-n // MOST_TURNS), first, block)  # type: ignore[return-value]


def nearest_rows(rows: Rows, points: Array) -> tuple[Array, NDArray[np.int64]]:
    """The distance to the nearest object in float64, and its number; points (m, 3)."""
    best = np.full(len(points), np.inf)
    winner = np.zeros(len(points), np.int64)
    start = 0
    for form in rows.forms:
        n = len(form)
        width = max(1, min(n, PAIRS // max(1, min(len(points), 256))))
        for low in range(0, n, width):
            chosen = np.arange(low, min(low + width, n))
            height = max(1, PAIRS // len(chosen))
            for i in range(0, len(points), height):
                d = np.broadcast_to(
                    form.columns.distance(points[i : i + height, None, :], chosen[None]),
                    (len(points[i : i + height]), len(chosen)),
                )
                k = np.argmin(d, axis=1)
                value = np.take_along_axis(d, k[:, None], 1)[:, 0]
                nearer = value < best[i : i + height]
                best[i : i + height] = np.where(nearer, value, best[i : i + height])
                winner[i : i + height] = np.where(nearer, start + chosen[k], winner[i : i + height])
        start += n
    return best, winner


def _distances(rows: Rows, points: Any) -> Array:
    flat = np.asarray(points, np.float64).reshape(-1, 3)
    return nearest_rows(rows, flat)[0].reshape(np.shape(points)[:-1])


def _gradients(rows: Rows, points: Any) -> Array:
    flat = np.asarray(points, np.float64).reshape(-1, 3)
    _, winner = nearest_rows(rows, flat)
    found = np.empty((len(flat), 4))
    start = 0
    for form in rows.forms:
        mine = (winner >= start) & (winner < start + len(form))
        if mine.any():
            found[mine] = form.columns.gradient(flat[mine], winner[mine] - start)
        start += len(form)
    return found.reshape(*np.shape(points)[:-1], 4)


def _written(node: Expr) -> str:
    """An expression as text: equal texts have equal values."""
    number = {e: i for i, e in enumerate(topological([node]))}
    parts: list[tuple[Any, ...]] = []
    for e in number:
        data = e.data
        if e.op == "const":
            data = data.tolist()
        elif e.op == "param":
            data = data.name, data.value
        elif e.op == "call":
            data = data.name, _written(data.body)
        parts.append((e.op, str(data), *[number[a] for a in e.args]))
    return str(parts)


def _with_materials(body: Expr, own: Sequence[Any], inherited: tuple[Any, Expr]) -> Expr:
    """A marked field with materials in place of slots; None stands for the inherited material, at its point."""
    known = {}
    for mark in find([body], "mark"):
        if isinstance(mark.data, Slot):
            material = own[mark.data.index]
            args, data = (mark.args, material) if material is not None else ((mark.args[0], inherited[1]), inherited[0])
            known[mark] = make("mark", FLOAT, args, data)
    return substitute([body], known)[0] if known else body
