"""Lowering: translates a node to the expression of its field.

Bodies of definitions are combined top-down, without recursion. A subtree that is evaluated at several points becomes a
function. The rest is one expression, in which equal subtrees are one object.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import reduce
from itertools import cycle
from typing import Any, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from raymarch.errors import Location, SceneError
from raymarch.expr.faults import Passage
from raymarch.expr.function import Function, sum_of
from raymarch.expr.node import Expr, const, make, var
from raymarch.expr.partials import ONE
from raymarch.expr.types import FLOAT, MAT3, VEC3, vector
from raymarch.expr.vocabulary import clamp, min, stop_gradient
from raymarch.expr.walk import find, free_variables, rebuild, rewrite, run, substitute, topological
from raymarch.sdf.booleans import balanced
from raymarch.sdf.facts import FARTHEST
from raymarch.sdf.interaction import POSITION, cells_of, depends_on_interaction
from raymarch.sdf.labels import cutting, operands_of, rows_of
from raymarch.sdf.node import Node, values_of
from raymarch.sdf.placement import turn_of
from raymarch.sdf.values import FLOOR, from_box, reading_of
from raymarch.sdf.visibility import RAY_KIND, shown
from raymarch.sdf.weights import distance_scale

Request: TypeAlias = tuple[Node, Expr, Any, bool]
"""A node, a point, a label, and whether the undivided field is asked for; see `Facts.undivided`."""
Work: TypeAlias = Generator[Request, Expr, Expr]


_PRIMES = (1.0, 127.0, 16381.0)
"""Factors that combine the indices of a cell into one number, exact in float32 for up to some hundred cells a side."""

UNMARKED = object()
"""Replaces a label if no materials are needed."""


class _Unlabelled:
    expressions: Sequence[Expr] = ()


UNLABELLED = _Unlabelled()
"""In place of a label: to find the parts that have none."""

PARTS = object()
"""Replaces a label: each shape is marked, with the point in its object space. Materials are ignored."""


@dataclass(frozen=True, eq=False, slots=True)
class Group:
    """The label of a subtree that stands at several places: its own parts have the labels.

    field : the field of the subtree. marked : the same with its labels, as `Lowering.field` returns it.
    """

    name: str
    field: Function
    marked: Function


class Objects(Protocol):
    """How objects that are rows of a table are evaluated in a field and its materials."""

    def distance(self, rows: Any) -> Function:
        """The distance to the nearest of the rows, a function of the point."""

    def label(self, rows: Any, inherited: Any) -> Any:
        """The label of a mark that stands for all rows; `inherited` is that of rows without a material."""


class Bounded(Protocol):
    """A hard union that evaluates some of its operands in their boxes only.

    operands : some children together, the others alone; each with its field. field : of the union.
    """

    @property
    def operands(self) -> list[tuple[list[Node], Function]]: ...
    @property
    def field(self) -> Function: ...


class Bounding(Protocol):
    """Chooses the operands of hard unions that are evaluated in their boxes only."""

    def applies(self, node: Node, children: Sequence[Node]) -> bool:
        """True if a node is a union that may have such operands, by the facts of its children."""

    def chosen(self, children: Sequence[Node], bodies: Sequence[Expr]) -> Sequence[int]:
        """The positions of such operands among some children with their fields; empty for none."""

    def bounded(self, node: Node, children: Sequence[Node], functions: Sequence[Function]) -> Bounded | None:
        """The union of some children with their fields; None if none is evaluated in its box only."""


@dataclass(frozen=True, eq=False, slots=True)
class BoundedParts:
    """The label of a mark that stands for a hard union with boxes.

    marked : its operands with their labels. expressions : those of all their labels.
    """

    union: Bounded
    marked: tuple[Function, ...]

    @property
    def expressions(self) -> list[Expr]:
        marks = find([function.body for function in self.marked], "mark")
        return [value for mark in marks if not isinstance(mark.data, Group) for value in mark.data.expressions]


def _turned(node: Node) -> tuple[NDArray[np.float64], Node] | None:
    """The product of a chain of three or more rotations by constants, and the node below. Two cost no more than it."""
    matrices = []
    while (matrix := turn_of(node)) is not None:
        matrices.append(matrix)
        node = node.children[0]
    return (reduce(np.matmul, matrices), node) if len(matrices) > 2 else None


@dataclass(slots=True)
class Lowering:
    """One pass over a tree of nodes.

    origins : the user's line for the expression of each node.
    shapes : the expressions of all shapes, each once, including those inside functions.
    sites : if a list is given, values and points that pass between nodes are marked as a `probe`. The list is filled
        with the nodes; the number of a node is its position in the list, from 1. See `raymarch.expr.faults.Passage`.
    """

    origins: dict[Expr, Location] = field(default_factory=dict)
    shapes: set[Expr] = field(default_factory=set)
    sites: list[Node] | None = None
    divisors: Mapping[int, Expr] = field(default_factory=dict)
    """Divisors of nodes that are not those of their facts, by the id of the node."""
    rays: str | None = "camera"
    """The kind of rays that the field is for; None for a field that reads `RAY_KIND`. See `raymarch.sdf.visibility`."""
    objects: Objects | None = None
    """How objects that are rows of a table are evaluated; None asks every row."""
    bounding: Bounding | None = None
    """Chooses the operands that are evaluated in their boxes only; None evaluates all operands everywhere."""
    distances: Callable[[Node], Callable[[Function], Function] | None] | None = None
    """For effects that read distances: how a node's field is read as one; see `raymarch.sdf.levels.over_slope`."""
    _numbers: dict[int, int] = field(default_factory=dict)
    names: dict[Expr, str] = field(default_factory=dict)
    _sites: dict[Any, int] = field(default_factory=dict)
    _done: dict[tuple[int, Expr, Any], Expr] = field(default_factory=dict)
    _functions: dict[Any, tuple[Function, list[Expr]]] = field(default_factory=dict)
    _grouping: bool = False
    _groups: dict[Any, Group | None] = field(default_factory=dict)
    _operands: dict[int, Function] = field(default_factory=dict)
    _bounded_unions: dict[int, Bounded | None] = field(default_factory=dict)
    _roots: list[Node] = field(default_factory=list)
    """Kept alive, because nodes are identified by their ids: two equal nodes of a tree are distinct."""

    def again(self) -> Lowering:
        """Another pass over the same nodes, which shares the origins, shapes and functions of this one."""
        return replace(self, _sites={}, _done={}, _grouping=False, _groups={})

    def for_camera(self) -> Lowering:
        """Another pass over the same objects, for camera rays."""
        return Lowering(self.origins, divisors=self.divisors, objects=self.objects)

    def field(
        self, root: Node, name: str = "field", label: Any = UNMARKED, groups: bool = False, undivided: bool = False
    ) -> Function:
        """The function of the root: `float name(vec3 p)`, 1-Lipschitz unless it is an estimate or `undivided`.

        With the label `PARTS`, the distance of each shape is wrapped in a `mark` with the point in the shape's object
        space. A solid made of flat shapes counts as one shape.

        With another `label`, the distance of each part with a material is wrapped in a `mark` whose data is the
        material. Parts without a material are marked with `label`. The mark also has the point in the space in
        which the material was given, and the indices of cells if the material depends on them. See
        `material_expressions`.
        """
        self._roots.append(root)
        self._count_sites(root)
        self._grouping = groups
        p = var("p", vector(root.dimension))
        q = self._handed(p, None, root)
        given = label if label is UNMARKED or label is PARTS else (label, q)
        request: Request = root, q, given, undivided and root.facts.divided
        body = run(request, lambda each: self._noted(*each), lambda each: (id(each[0]), *each[1:]), self._done)
        body = self._probed(body, q, root, None)
        if (read := self._reads(root)) is not None:
            body = read(Function(f"{name}_written", (p,), body, self.names, root.where))(p)
        if find([body], "cell"):
            what = f"{root.name} depends on the index of a cell outside of repeat_varied"
            legal = "the index only inside the function that repeat_varied calls"
            raise SceneError(what, legal=legal, where=root.where)
        return Function(name, (p,), body, self.names, root.where)

    def _count_sites(self, root: Node) -> None:
        """The number of places at which each node is evaluated, over all its parents."""
        pending, seen = [root], {self._key(root)}
        while pending:
            node = pending.pop()
            evaluations = [1] * len(node.children) if node.definition.arity == "many" else _evaluations(node)
            for child, times in zip(map(_unlabelled, node.children), evaluations, strict=True):
                key = self._key(child)
                self._sites[key] = self._sites.get(key, 0) + times
                if key not in seen:
                    seen.add(key)
                    pending.append(child)

    def _key(self, node: Node) -> Any:
        """Equal nodes are one function, except where each node has its own probe."""
        return node if self.sites is None else id(node)

    def _noted(self, node: Node, point: Expr, label: Any, undivided: bool) -> Work:
        """As `_lower`; the name of the definition and the user's line of the expression are recorded."""
        value = yield from self._lower(node, point, label, undivided)
        if label is UNMARKED and node.label is None:
            self.names.setdefault(value, node.name)
        if node.where is not None:
            self.origins.setdefault(value, node.where)
        return value

    def _lower(self, node: Node, point: Expr, label: Any, undivided: bool) -> Work:
        marking = label is not UNMARKED
        if label is PARTS and node.label is None and all(child.dimension != 3 for child in node.children):
            distance = yield from self._ask(node, point, UNMARKED, undivided)
            return make("mark", FLOAT, (distance, point), PARTS)
        if marking and label is not PARTS and not node.labelled:
            distance = yield from self._ask(node, point, UNMARKED, undivided)
            material, at = label
            return make("mark", FLOAT, (distance, at, *cells_of(material)), material)
        if node.label is not None:
            inner = (node.label, point) if marking and label is not PARTS else label
            return (yield from self._ask(node.children[0], point, inner, undivided))
        if self.sites is None and (turned := _turned(node)) is not None:
            matrix, inner = turned
            return (yield from self._ask(inner, const(matrix.T, MAT3) @ point, label))
        rows = rows_of(node)
        if rows is not None and self.objects is not None:
            distance = self.objects.distance(rows)(point)
            distance = distance * rows.divisor if undivided else distance
            self.shapes.add(distance)
            if not marking or label is PARTS:
                return distance
            return make("mark", FLOAT, (distance, point), self.objects.label(rows, label[0]))
        if rows is not None and marking and label is not PARTS:
            spelled = rows.spelled(label, point)
            return spelled * rows.divisor if undivided else spelled
        children = operands_of(node)
        if self.bounding is not None and label is not PARTS and not undivided and self.bounding.applies(node, children):
            found = yield from self._bounded(node, children, point, label)
            if found is not None:
                return found
        if marking and label is not PARTS and node.definition.cuts and len(cutting(children)) < len(children):
            # The distance is that of the cut solid. The marks are those of the operands that decide the material.
            distance = yield from self._ask(node, point, UNMARKED, undivided)
            deciding = cutting(children)
            if len(deciding) == 1:
                marked = yield from self._ask(deciding[0], point, label, undivided)
            else:
                marked = yield from self._body(node, deciding, point, label, undivided)
            return distance + (marked - stop_gradient(marked))
        return (yield from self._body(node, children, point, label, undivided))

    def _body(self, node: Node, children: Sequence[Node], point: Expr, label: Any, undivided: bool) -> Work:
        """The definition's body with the point, the parameters and the children substituted."""
        if (label is UNMARKED or not children) and node.definition.estimates(node):
            inside = clamp(point, *(np.clip(end, -FARTHEST, FARTHEST) for end in (node.facts.lower, node.facts.upper)))
            value = yield from self._substituted(node, children, inside, label, undivided)
            return from_box(value, point - inside)
        return (yield from self._substituted(node, children, point, label, undivided))

    def _substituted(self, node: Node, children: Sequence[Node], point: Expr, label: Any, undivided: bool) -> Work:
        template = node.definition.template(len(children), node.params)
        below = undivided or node.definition.adds(len(children), node.params)
        marking = label is not UNMARKED
        answers: list[Expr] = []
        params = values_of(node)
        if not children:
            value = reading_of(template, undivided)(point, *params)
            self.shapes.add(value)
        else:
            new = dict(zip(template.params, (point, *params), strict=True))
            made = set(new.values())
            for part in topological([template.body]):
                if part in new:
                    continue
                args = tuple([new[arg] for arg in part.args])
                if part.op == "apply":
                    q = self._handed(args[0], node, children[part.data])
                    value = yield from self._ask(children[part.data], q, label, below)
                    value = self._probed(value, q, children[part.data], node, below)
                    new[part] = self._in_cell(value, *args[1:]) if len(args) > 1 else value
                    answers.append(new[part])
                elif marking and part.data is FLOOR:
                    new[part] = args[0]
                else:
                    new[part] = rebuild(part, args)
                if new[part].args and node.where is not None:
                    self.origins.setdefault(new[part], node.where)
                    if new[part].op != part.op:  # simplified to other operations, which belong to the node as well
                        pending = [*new[part].args]
                        while pending:
                            inner = pending.pop()
                            if inner.args and inner not in made:
                                made.add(inner)
                                self.origins.setdefault(inner, node.where)
                                pending += inner.args
                made.add(new[part])
            value = new[reading_of(template, undivided).body]
        if marking and label is not PARTS and node.definition.arity == "one":
            scale = distance_scale(value, answers)
            if scale is not ONE:
                distance = yield from self._ask(node, point, UNMARKED, undivided)
                weight = value / stop_gradient(scale)
                return distance + (weight - stop_gradient(weight))
        value = shown(node, value, self.rays)
        if undivided:
            return value
        if id(node) in self.divisors:
            return value / self.divisors[id(node)]
        return value / node.facts.divisor if node.facts.divisor > 1.0 else value

    def _bounded(
        self, node: Node, children: Sequence[Node], point: Expr, label: Any
    ) -> Generator[Request, Expr, Expr | None]:
        """The field of a hard union with boxes; None for a union without. With a label it is one mark."""
        assert self.bounding is not None
        p = var("p", VEC3)
        if id(node) not in self._bounded_unions:
            counted = set(self.shapes)
            bodies = []
            for child in children:
                bodies.append((yield from self._ask(child, point, UNMARKED)))
            self._roots.append(node)
            if not self.bounding.chosen(children, bodies):
                self._bounded_unions[id(node)] = None
                return None
            if point is not p:
                self.shapes &= counted  # those of the functions are counted instead
            functions = []
            for child in children:
                if id(child) not in self._operands:
                    body = yield from self._ask(child, p, UNMARKED)
                    called = body.op == "call" and body.args == (p,)
                    name = f"{_unlabelled(child).name}_field"
                    made = body.data if called else Function(name, (p,), body, self.names, child.where)
                    self._operands[id(child)] = made
                functions.append(self._operands[id(child)])
            self._bounded_unions[id(node)] = self.bounding.bounded(node, children, functions)
        union = self._bounded_unions[id(node)]
        if union is None or label is UNMARKED:
            return None if union is None else union.field(point)
        material, at = label
        placed = POSITION in free_variables(material.expressions) or depends_on_interaction(material.expressions)
        if (placed and at is not point) or cells_of(material):
            return None  # parts without a label have a material of the space around
        marked = []
        for nodes, _ in union.operands:
            bodies = []
            for each in nodes:
                bodies.append((yield from self._ask(each, p, (material, p))))
            marked.append(Function("marked", (p,), balanced(bodies, min), where=node.where))
        return make("mark", FLOAT, (union.field(point), point), BoundedParts(union, tuple(marked)))

    def _ask(self, child: Node, point: Expr, label: Any, undivided: bool = False) -> Work:
        """The child at a point: its expression, or a call if it is evaluated at several places."""
        solid = _unlabelled(child)
        undivided = undivided and solid.facts.divided
        read = self._reads(solid)
        repeated = read is not None or (self._sites.get(self._key(solid), 0) > 1 and _is_large(solid))
        if label is not UNMARKED and label is not PARTS and repeated and self._grouping and child.labelled:
            key = self._key(child), undivided
            if key not in self._groups:
                self._groups[key] = yield from self._group(child, undivided)
            group = self._groups[key]
            if group is not None:
                distance = yield from self._ask(solid, point, UNMARKED, undivided)
                return make("mark", FLOAT, (distance, point), group)
        if label is not UNMARKED or not repeated:
            return (yield (child, point, label, undivided))
        key = self._key(solid), undivided
        if key not in self._functions:
            p = var("p", vector(solid.dimension))
            body = yield (solid, p, UNMARKED, undivided)
            cells = find([body], "cell")
            formal = [var(f"cell {i}", cell.type) for i, cell in enumerate(cells)]
            closed = substitute([body], dict(zip(cells, formal, strict=True)))[0] if cells else body
            name = f"{solid.name}_field"
            numbers = [
                v for v in free_variables([body]) if v is not p and v is not RAY_KIND
            ]  # of objects that are rows
            made = Function(name, (p, *formal, *numbers), closed, self.names, solid.where)
            made = made if read is None else read(made)
            self._functions[key] = (made, [*cells, *numbers])
        function, given = self._functions[key]
        return function(point, *given)

    def _reads(self, node: Node) -> Callable[[Function], Function] | None:
        return None if self.distances is None else self.distances(node)

    def _group(self, child: Node, undivided: bool) -> Generator[Request, Expr, Group | None]:
        """The group of a labelled subtree; None if one of its parts has no label of its own, or one that varies."""
        p = var("p", vector(child.dimension))
        distance = yield from self._ask(child, p, UNMARKED, undivided)
        if self.sites is not None or distance.op != "call" or find([distance], "cell", "time"):
            return None
        body = yield (child, p, (UNLABELLED, p), undivided)
        labels = [mark.data for mark in find([body], "mark")]
        varying = any(POSITION in free_variables(label.expressions) for label in labels if not isinstance(label, Group))
        if UNLABELLED in labels or varying or any(cells_of(label) for label in labels):
            return None
        return Group(
            _unlabelled(child).name, distance.data, Function(f"{child.name}_marked", (p,), body, where=child.where)
        )

    def _handed(self, point: Expr, above: Node | None, child: Node) -> Expr:
        """A point at which a node evaluates a child, as a `probe`."""
        if self.sites is None:
            return point
        return make("probe", point.type, (point,), Passage("point", self._number(above), self._number(child)))

    def _probed(self, value: Expr, point: Expr, child: Node, above: Node | None, undivided: bool = False) -> Expr:
        """The value of a child, as a `probe`, which notes the divided value."""
        if self.sites is None:
            return value
        facts = _unlabelled(child).facts
        if undivided and facts.divided:
            scale = facts.undivided / facts.lipschitz
            return self._probed(value / scale, point, child, above) * scale
        cells = find([value], "cell")
        parts = [part for cell in cells for part in (cell if cell.type.is_vector else [cell])]
        which = [sum_of([part * prime for part, prime in zip(parts, cycle(_PRIMES), strict=False)])] if cells else []
        data = Passage("value", self._number(child), self._number(above))
        return make("probe", FLOAT, (value, point, *which), data)

    def _number(self, node: Node | None) -> int:
        """The number of the node that computes the value; a label is skipped, since it computes nothing."""
        if node is None or self.sites is None:
            return 0
        node = _unlabelled(node)
        if id(node) not in self._numbers:
            self.sites.append(node)
            self._numbers[id(node)] = len(self.sites)
        return self._numbers[id(node)]

    def _in_cell(self, value: Expr, cell: Expr, index: Expr) -> Expr:
        """The field of a child that depends on the index of its cell, for one cell."""
        new = rewritten(value, lambda part, args: index if part is cell else rebuild(part, args), self.origins)
        self.shapes |= {changed for old, changed in new.items() if old in self.shapes}
        return new[value]


def rewritten(
    root: Expr, rule: Callable[[Expr, tuple[Expr, ...]], Expr], origins: dict[Expr, Location]
) -> dict[Expr, Expr]:
    """As `rewrite`, of one expression; what replaces an expression keeps the user's line, of `origins`."""
    new = rewrite([root], rule)
    for old, changed in new.items():
        if changed is not old and old in origins:
            origins.setdefault(changed, origins[old])
    return new


def _unlabelled(node: Node) -> Node:
    """The node below labels."""
    while node.label is not None:
        node = node.children[0]
    return node


def _is_large(node: Node) -> bool:
    """True if a subtree is worth a function of its own: it has several nodes besides labels and one operator."""
    size, pending = 0, [node]
    while pending and size < 3:
        each = pending.pop()
        size += each.label is None
        pending.extend(each.children)
    return size >= 3


def _evaluations(node: Node) -> list[int]:
    """The number of places in the body of a node at which it evaluates each child."""
    if not node.children:
        return []
    template = node.definition.template(len(node.children), node.params)

    def count() -> list[int]:
        asked = [part.data for part in topological([template.body]) if part.op == "apply"]
        return [asked.count(i) for i in range(len(node.children))]

    return template.once("evaluations", count)
