"""Find the objects of a scene that can be rows of a table: operands of unions that have one form.

Two trees have the same form if they differ in numbers and materials only.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from dataclasses import replace as changed
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from raymarch.errors import PlanError
from raymarch.expr.node import Expr, var
from raymarch.expr.operations import operations_of
from raymarch.expr.types import BOOL, FLOAT
from raymarch.expr.walk import find, rebuild, topological
from raymarch.plan.groups import groups
from raymarch.plan.hoisting import NEVER_HOISTED
from raymarch.prices import LISTED, OBJECT, STANDARD, Prices
from raymarch.scene.scene import all_nodes
from raymarch.sdf.booleans import Blend, blend_of, union
from raymarch.sdf.derivation import divisor_of
from raymarch.sdf.instancing import instanced
from raymarch.sdf.labels import rows_of
from raymarch.sdf.lower import Lowering
from raymarch.sdf.node import Node, at_line_of, children_first, replaced
from raymarch.sdf.placing import with_label
from raymarch.sdf.rows import Form, Moving, Rows, Slot
from raymarch.sdf.solids import sphere
from raymarch.sdf.visibility import hidden_from

DEEPEST = 200
"""Maximum number of operators above a union that becomes data."""

CHANGING = frozenset(("param", "time"))
"""Operations whose values change without a new plan."""

SHORT = 200
"""Maximum number of operations in a parameter of an object that is a row."""

Signature: TypeAlias = tuple[int, tuple[float, ...], tuple[Any, ...]]
"""The form of a tree, its numbers, and the materials of its slots."""


@dataclass(slots=True)
class Gathered:
    """A tree whose objects are rows.

    node : the tree. rows : the rows in it, and the distance up to which the field of each must be exact.
    text, data : number of objects that are text, and that are rows. reason : why.
    """

    node: Node
    rows: dict[Rows, float] = field(default_factory=dict)
    text: int = 0
    reason: str = ""

    @property
    def data(self) -> int:
        """Number of objects that are rows."""
        return sum(map(len, self.rows))


def gather(root: Node, choice: str, exact: float, live: bool = True, prices: Prices = STANDARD) -> Gathered:
    """The tree with its objects as rows; see `Gatherer`."""
    return Gatherer(choice, exact, live, prices).gather(root)


class Gatherer:
    """Chooses the objects of trees that are rows. Forms that were read once are known to further choices.

    choice : "auto", "text" or "data", see `Quality.objects`. exact : distance up to which the field must be exact; if
        infinite, all objects are text. live : False for text for objects that depend on parameters or time.
    prices : of the device.
    """

    def __init__(self, choice: str, exact: float, live: bool = True, prices: Prices = STANDARD) -> None:
        self.choice, self.exact, self.allowed, self.prices = choice, exact, live, prices
        self.blended = False  # rows below a blend need one divisor, because blends act on undivided fields
        self.live: set[int] = set()  # forms that depend on parameters or time
        self.forms: dict[Any, int] = {}
        self.known: dict[int, Signature | None] = {}
        self.plain: dict[Any, set[str]] = {}  # operations of bodies that not every row may have
        self.materials: dict[int, bool] = {}
        self.kept: list[Node] = []  # alive, because they are identified by their ids

    def gather(self, root: Node, why: str = "") -> Gathered:
        """The tree with its objects as rows.

        why : why fewer objects than usual are worth rows, the reason that is given; empty if they are not.
        """
        self.made = Gathered(root)
        _ = root.facts  # of all nodes at once: what is known of an equal solid is not asked of this one again
        data, prices = self.choice == "data", self.prices
        self.least = 2 if data else prices.fewer_objects if why else prices.objects
        self.weighed = prices.by_operations and not data and not why
        self.alike = 1 if data else prices.fewer_alike if why else prices.alike
        look_up = f"cells take {prices.nanoseconds(prices.look_up)}, and each small object {prices.nanoseconds(OBJECT)}"
        unlimited = not math.isfinite(self.exact)
        node = root if self.choice == "text" or unlimited else self.visit(root, self.exact, 0)
        if self.made.rows and data:
            reason = "Quality(objects='data')"
        elif self.made.rows:
            reason = why or f"{prices.objects} or more objects of few forms; {look_up}"
        elif unlimited:
            reason = "ambient occlusion reads the field at distances without a limit"
        elif self.choice == "text":
            reason = "Quality(objects='text')"
        else:
            largest = max((len(n.children) for n in all_nodes(root) if n.definition.arity == "many"), default=0)
            reason = f"no union of {prices.objects} or more objects of few forms; the largest has {largest}; {look_up}"
        return changed(self.made, node=node, reason=reason)

    def _divisor(self, members: Sequence[Node]) -> float | None:
        """The number by which the fields of some solids are divided; None if these differ."""
        found = {divisor_of(member) for member in members}
        return found.pop() if len(found) == 1 else None

    def visit(self, node: Node, exact: float, depth: int) -> Node:
        """The tree with objects as rows; `exact` as for `gather`, in the units of this tree."""
        if (rows := rows_of(node)) is not None:
            parts = self._keep(rows, exact)
            return node if len(parts) == 1 else self._joined(node, parts)
        if node.placed_as == "union":
            return self._union(node, exact, depth)
        if (blend := blend_of(node)) is not None and blend.width.is_constant:
            rows = self._blend(node, blend)
            if rows is not None:
                return self._joined(node, self._keep(rows, exact))
            outer, self.blended = self.blended, True
            made = self._below(node, exact + _margin(blend, len(node.children)), depth)
            self.blended = outer
            return made
        if node.label is not None and node.children[0].labelled and not self._is_constant(node.label):
            # Some objects have materials of their own, the others inherit one that is no row of numbers.
            child = node.children[0]
            if child.placed_as == "union":
                return self._union(child, exact, depth, node)
            if not any(rows_of(each) is not None for each in all_nodes(child)):
                return node
        if node.placed_as in ("rigid", "select"):
            return self._below(node, exact, depth)
        if node.placed_as in ("scale", "stretch") and (factor := _factor(node)) is not None:
            return self._below(node, exact / factor, depth)
        self._refuse_instances(node)
        return node

    def _keep(self, rows: Rows, exact: float) -> list[Rows]:
        """Note rows, divided into groups far apart, which are returned."""
        parts = groups(rows, exact, self.prices.group)
        for part in parts:
            self.made.rows[part] = max(exact, self.made.rows.get(part, 0.0))
        return parts

    def _joined(self, node: Node, parts: Sequence[Rows]) -> Node:
        """The union of the groups of a node."""
        made = [at_line_of(node, instanced(part)) for part in parts]
        return made[0] if len(made) == 1 else at_line_of(node, union(*made))

    def _below(self, node: Node, exact: float, depth: int) -> Node:
        if depth > DEEPEST or not node.children:
            self._refuse_instances(node)
            return node
        children = tuple(self.visit(child, exact, depth + 1) for child in node.children)
        if all(a is b for a, b in zip(children, node.children, strict=True)):
            return node
        return replaced(node, children)

    def _refuse_instances(self, node: Node) -> None:
        if any(rows_of(each) is not None for each in all_nodes(node)[1:]):
            legal = "unions, intersections, differences, blends that end at a distance, and rigid transforms"
            raise PlanError(f"{node.name} of instances", legal=legal, where=node.where)

    # Unions

    def _union(self, node: Node, exact: float, depth: int, above: Node | None = None) -> Node:
        """A hard union. above : the node above, whose material is that of operands that have none."""
        operands = self._operands(node, None if above is None else above.label)
        given = [rows for operand in operands if (rows := rows_of(operand)) is not None]
        groups: dict[int, list[int]] = {}
        for i, operand in enumerate(operands):
            if rows_of(operand) is None and operand.facts.bounded and not operand.facts.empty:
                signature = self.signature(operand)
                if signature is not None:
                    groups.setdefault(signature[0], []).append(i)
        counts = {form: self._count([operands[i] for i in members]) for form, members in groups.items()}
        groups = {form: members for form, members in groups.items() if counts[form] >= self.alike}
        if self.blended:
            divisors = {form: self._divisor([operands[i] for i in members]) for form, members in groups.items()}
            same = max(divisors.values(), key=list(divisors.values()).count, default=None)
            groups = {form: members for form, members in groups.items() if divisors[form] == same is not None}
        moving = {form: groups.pop(form) for form in self.live & groups.keys()}
        if sum(counts[form] for form in moving) < self.least:
            moving = {}
        count = sum(counts[form] for form in groups)
        if count + sum(map(len, given)) < self.least or (count < self.least and not given):
            groups = {}
        if not groups and not given and not moving:
            made = self._below(node, exact, depth)
            if above is None:
                return made
            return above if made is node else at_line_of(above, self._labelled(made, above.label))
        chosen = {i for some in (groups, moving) for members in some.values() for i in members}
        rest = [i for i, operand in enumerate(operands) if i not in chosen and rows_of(operand) is None]
        children = [self.visit(operands[i], exact, depth + 1) for i in rest]
        self.made.text += len(rest)
        for some, instances in ((groups, given), (moving, ())):
            if some or instances:
                forms = [self._form([operands[i] for i in members], members) for members in some.values()]
                rows = self._rows(forms, instances, len(operands))
                children += [at_line_of(node, instanced(part)) for part in self._keep(rows, exact)]
        if len(children) == 1:
            return children[0]
        return replaced(node, tuple(children))

    def _count(self, members: Sequence[Node]) -> float:
        """For how many small objects those of one form count: by their operations, if the prices are of such. Those in
        the cell of a point are evaluated anyway."""
        n = len(members)
        if not self.weighed or n <= LISTED:
            return n
        return max(n, (n - LISTED) * operations_of(Lowering().field(members[0])) / OBJECT)

    def _labelled(self, node: Node, label: Any) -> Node:
        made = with_label(node, label)
        self.kept.append(made)
        return at_line_of(node, made)

    def _operands(self, node: Node, given: Any) -> list[Node]:
        """The operands of nested hard unions; the label of a union becomes that of its operands."""
        found: list[Node] = []
        pending: list[tuple[Node, Any]] = [(node, given)]
        while pending:
            each, label = pending.pop()
            if each.placed_as == "union":
                pending.extend((child, label) for child in reversed(each.children))
            elif each.label is not None and each.children[0].placed_as == "union":
                pending.append((each.children[0], each.label))
            elif label is not None and each.label is None:
                found.append(self._labelled(each, label))
            else:
                found.append(each)
        return found

    def _blend(self, node: Node, blend: Blend) -> Rows | None:
        """A smooth union as rows, if all its operands can be."""
        groups: dict[int, list[int]] = {}
        for i, child in enumerate(node.children):
            signature = self.signature(child) if rows_of(child) is None else None
            if signature is None:
                return None
            groups.setdefault(signature[0], []).append(i)
        alike = sum(len(members) for members in groups.values() if len(members) >= self.alike)
        if self.live & groups.keys() and not all(child.facts.bounded for child in node.children):
            return None
        if (
            alike < self.least
            or len(groups) > self.prices.blended_forms
            or not any(c.facts.bounded for c in node.children)
        ):
            return None
        divisor = self._divisor(node.children)
        if divisor is None:
            return None
        forms = [self._form([node.children[i] for i in members], members) for members in groups.values()]
        made = self._rows(forms, [], len(node.children))
        return changed(made, k=_width(blend) / divisor, family=blend.family)  # of fields that are divided

    def _rows(self, forms: list[tuple[Form, list[tuple[Any, ...]]]], given: Sequence[Rows], first: int) -> Rows:
        """The rows of some forms, and of instances that stand in the same union."""
        materials: dict[Any, int] = {None: 0}
        made = []
        for form, slots in forms:
            known = {id(m): materials.setdefault(m, len(materials)) for row in slots for m in row}
            indices = [[0, *(known[id(m)] for m in row)] for row in slots]
            made.append(changed(form, slots=np.array(indices, np.int64)))
        for rows in given:
            index = np.array([materials.setdefault(m, len(materials)) for m in rows.materials])
            for form in rows.forms:
                made.append(changed(form, slots=index[form.slots], order=form.order + first))
            first += len(rows)
        return Rows(tuple(made), tuple(materials))

    # Forms

    def signature(self, node: Node) -> Signature | None:
        """The form of a tree; None if it cannot be a row: without a spread nothing bounds it outside of the cells."""
        if node.facts.bounded and not math.isfinite(node.facts.spread):
            return None
        for each in () if id(node) in self.known else children_first(node):
            if id(each) not in self.known:
                self.known[id(each)] = self._signature(each)
        return self.known[id(node)]

    def _signature(self, node: Node) -> Signature | None:
        below = [s for child in node.children if (s := self.known[id(child)]) is not None]
        if len(below) < len(node.children) or node.facts.exactness == "estimate" or rows_of(node) is not None:
            return None
        if hidden_from(node):  # the rows of a table are visible to all rays
            return None
        statics: list[Any] = []
        own: list[float] = []
        for value in node.params.values():
            if not isinstance(value, Expr):
                statics.append(value)
            elif value.op != "const":
                written = _written(value) if self.allowed else None
                if written is None:
                    return None
                statics.append(written[0])
                own += written[1]
            else:
                statics.append(value.type.name)
                data = value.data
                own += [float(data)] if data.ndim == 0 else data.ravel().tolist()
        key = (node.definition, len(node.children), tuple(statics))
        if key not in self.plain:
            body = node.definition.template(len(node.children), node.params).body
            self.plain[key] = {e.op for e in find([body], *CHANGING, "cell", "raw", "raw_slope")}
        changes = not self.plain[key].isdisjoint(CHANGING)  # as functions of users that read time do
        if not self.plain[key] <= CHANGING or (changes and not self.allowed):
            return None
        steep = node.facts.divisor > 1.0
        if steep:
            own.append(node.facts.divisor)
        slots: tuple[Any, ...] = ()
        label: Any = None
        if node.label is not None:
            label = "slot" if self._is_constant(node.label) else node.label
            slots = (node.label,) if label == "slot" else ()
        form = (key, steep, label, tuple(s[0] for s in below))
        number = self.forms.setdefault(form, len(self.forms))
        constant = all(v.is_constant for v in node.params.values() if isinstance(v, Expr))
        if changes or not constant or any(s[0] in self.live for s in below):
            self.live.add(number)
        return number, sum((s[1] for s in below), tuple(own)), sum((s[2] for s in below), slots)

    def _is_constant(self, material: Any) -> bool:
        if id(material) not in self.materials:
            self.materials[id(material)] = all(value.is_constant for value in material.expressions)
        return self.materials[id(material)]

    def _form(self, members: Sequence[Node], order: Sequence[int]) -> tuple[Form, list[tuple[Any, ...]]]:
        """The form of some trees, and the materials of its slots for each."""
        signatures = [s for member in members if (s := self.known[id(member)]) is not None]
        values = np.array([s[1] for s in signatures], np.float64).reshape(len(members), -1)
        leaves: list[Expr] = []
        numbers: list[NDArray[np.float64]] = []
        divisors: dict[int, Expr] = {}
        used = [0, 0]

        def leaf(value: Any) -> Expr:
            if isinstance(value, Expr) and value.op != "const":
                return _rewritten(value, leaf)
            size = int(np.size(value.data)) if isinstance(value, Expr) else 1
            type = value.type if isinstance(value, Expr) else FLOAT
            column = values[:, used[0] : used[0] + size].reshape(len(members), *type.shape)
            used[0] += size
            if np.all(column == column[:1]) and isinstance(value, Expr):
                return value
            made = var(f"number {len(leaves)}", type)
            leaves.append(made)
            numbers.append(column)
            return made

        def symbolic(node: Node) -> Node:
            params = {n: leaf(v) if isinstance(v, Expr) else v for n, v in node.params.items()}
            divisor = leaf(node.facts.divisor) if node.facts.divisor > 1.0 else None
            label = node.label
            if label is not None and self._is_constant(label):
                used[1] += 1
                label = Slot(used[1])
            children = tuple(symbolic(child) for child in node.children)
            made = replaced(node, children, params, label=label)
            if divisor is not None:
                divisors[id(made)] = divisor
            return made

        template = symbolic(members[0])
        moves = signatures[0][0] in self.live
        facts = [member.facts for member in members]
        form = Form(
            template,
            tuple(leaves),
            divisors,
            tuple(numbers),
            np.zeros((len(members), 1), np.int64),
            np.array(order, np.int64),
            np.array([f.lower for f in facts]),
            np.array([f.upper for f in facts]),
            np.array([0.0 if moves else _radius(member) for member in members]),
            np.array([f.spread for f in facts]),
            np.array([f.lipschitz for f in facts]),
            all(f.exactness == "exact" for f in facts),
            self._divisor(members) or 1.0,
        )
        if moves:
            form = changed(form, moving=_moving(template, members))
        return form, [s[2] for s in signatures]


def _constants(node: Expr) -> list[bool]:
    """For each argument, whether it is a number that may differ from object to object."""
    return [arg.op == "const" and arg.type is not BOOL for arg in node.args]


def _written(value: Expr) -> tuple[Any, list[float]] | None:
    """An expression of parameters and time: what it is but for its constants, hashable, and these. None if it is long,
    or reads anything else."""
    order = [e for e in topological([value]) if e.op != "const" or e.type is BOOL]
    if len(order) > SHORT or any(e.op in NEVER_HOISTED for e in order):
        return None
    number = {e: i for i, e in enumerate(order)}
    form: list[Any] = []
    numbers: list[float] = []
    for e in order:
        own = _constants(e)
        form.append((e.op, e.type.name, e.data if e.op != "const" else e.data.tolist()))
        form += [a.type.name if c else number[a] for a, c in zip(e.args, own, strict=True)]
        numbers += [x for a, c in zip(e.args, own, strict=True) if c for x in np.ravel(a.data).tolist()]
    return tuple(form), numbers


def _rewritten(value: Expr, leaf: Callable[[Expr], Expr]) -> Expr:
    """The expression with `leaf` of each of the constants that `_written` lists, in that order."""
    made: dict[Expr, Expr] = {}
    for e in topological([value]):
        args = [leaf(a) if c else made[a] for a, c in zip(e.args, _constants(e), strict=True)]
        made[e] = rebuild(e, tuple(args))
    return made[value]


def _factor(node: Node) -> float | None:
    """The factor by which a placed node multiplies its child's value; None if it changes."""
    factor = node.definition.placement(node.params)[2]
    given = 1.0 if factor is None else float(factor.data) if factor.is_constant else None
    return None if given is None else given / node.facts.divisor


def _inner(node: Node) -> list[Node]:
    """A node and the nodes below it, as far as these are moved and scaled only."""
    found = [node]
    while found[-1].placed_as in ("rigid", "scale"):
        found.append(found[-1].children[0])
    return found


def _moving(template: Node, members: Sequence[Node]) -> Moving:
    """Where the objects of a form are, from the boxes of their parts that are moved and scaled."""
    *chain, _ = _inner(template)
    inside = Slot(-1)
    made = with_label(sphere(), inside)
    for node in reversed(chain):
        if node.label is None:
            made = Node(node.definition, (made,), node.params, node.facts)
    (mark,) = find([Lowering().field(made, label=inside).body], "mark")
    facts = [_inner(member)[-1].facts for member in members]
    middle = np.array([0.5 * (f.lower + f.upper) for f in facts])
    return Moving(mark.args[1], middle, np.array([0.5 * float(np.linalg.norm(f.size)) for f in facts]))


def _radius(node: Node) -> float:
    """Radius of a sphere about the centre of the node's box that holds the solid: smaller than that of the box where
    the solid is rotated."""
    *chain, inner = _inner(node)
    factor = 1.0
    for each in chain:
        if each.placed_as == "scale":
            factor *= _factor(each) or 1.0
    return factor * 0.5 * float(np.linalg.norm(inner.facts.size))


def _width(blend: Blend) -> float:
    return float(blend.width.data)


def _margin(blend: Blend, n: int) -> float:
    """Distance beyond a surface up to which operands of a blend must be exact."""
    return _width(blend) * (blend.reach + 0.25 * math.ceil(math.log2(max(n, 2))))
