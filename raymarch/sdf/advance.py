"""The reading that tells how far along a ray no surface lies.

For a point p, a direction d, a level and a growth, a node answers with its value f and an advance a >= 0: at no s in
[0, a) is f(p + s d) = level + growth s, or less. For rays the level is the rounding error of the value in float32, and
the growth that of the slope. For cones they are the radius at p and the tangent of the half angle. A transform divides
both by the factor by which it multiplies distances. It maps d by its linear part, so s stays the parameter of the ray,
and d need not be of unit length inside.

A shape is a leaf: convex, implicit, or known by its distance alone. An operator is read from its definition, part by
part; `raymarch.sdf.readings` has the rules, and `raymarch.sdf.asked` those of boxes and pieces. For a complement each
node answers for -f itself.
"""

from __future__ import annotations

import builtins
from collections.abc import Generator
from dataclasses import dataclass, field, replace
from typing import TypeAlias

from raymarch.expr.derivative import directional_derivatives, opened, share_values
from raymarch.expr.function import Function
from raymarch.expr.node import Expr, const, var
from raymarch.expr.partials import ONE
from raymarch.expr.types import FLOAT, VEC3
from raymarch.expr.vocabulary import length, max, vec2, vec3
from raymarch.expr.walk import depends_on, find, rebuild, run, substitute, topological
from raymarch.sdf.asked import Ask, Piece, Scope, in_box, in_pieces
from raymarch.sdf.convexity import hull_of, is_concave_fold, is_convex, known_parts
from raymarch.sdf.facts import FARTHEST
from raymarch.sdf.implicit import cut_by_box
from raymarch.sdf.intersections import interval_of_ray
from raymarch.sdf.labels import operands_of, rows_of
from raymarch.sdf.lower import Lowering
from raymarch.sdf.node import Node, children_first, folded, values_of
from raymarch.sdf.readings import (
    Ahead,
    Reading,
    intersection_of,
    of_line,
    smooth_maximum_of,
    smooth_minimum_of,
    union_of,
)
from raymarch.sdf.same import remembered
from raymarch.sdf.stretches import free_over, free_way
from raymarch.sdf.values import BOUND, reading_of
from raymarch.sdf.visibility import shown
from raymarch.sdf.ways import Line, borders, way_out

STRETCH = var("stretch_ahead", FLOAT)
"""The stretch of the ray for which leaves with bounds of a stretch are asked; a variable of the shader."""

KEEPING = ("rigid", "select")
"""Placings of operators that move their child without stretching it; see `raymarch.sdf.definition.Placing`."""

EXITS = ("sphere", "box", "cylinder")
"""Convex shapes whose exit is found in closed form where they are holes. Those of others cost more than they save."""


def along(definition: Function) -> Function:
    """The function that returns the value of another one at a point, and its slope along a direction."""

    def made() -> Function:
        point, *others = definition.params
        direction = var("direction", point.type)
        slope = directional_derivatives(definition.body, point, [direction])[0]
        value, slope = share_values([opened(definition.body, point), slope])
        params = (point, direction, *others)
        return Function(f"{definition.name}_along", params, vec2(value, slope), definition.names, definition.where)

    return definition.once("along", made)


Work: TypeAlias = Generator[Ask, Reading, Reading]
Part: TypeAlias = Generator[Ask, Reading, "Reading | None"]


class OnlyDistance(Exception):
    """Raised for a tree with a node of which nothing but the distance is known along a ray."""

    def __init__(self, node: Node) -> None:
        super().__init__(node.name)
        self.node = node


@dataclass(slots=True)
class Advancing:
    """The reading of a tree of nodes.

    lowering : translates the values of what has no reading of its own. wholly : True to raise `OnlyDistance` for the
    first node that has none.
    """

    lowering: Lowering
    wholly: bool = False
    _plain: dict[tuple[int, bool], Function] = field(default_factory=dict)
    _roots: list[Node] = field(default_factory=list)

    def function(self, root: Node | None, name: str = "field_advance", undivided: bool = False) -> Function:
        """`vec2 name(vec3 p, vec3 d, float level, float growth)`: the value of the field and the advance.

        root : None for empty space. undivided : of the undivided field.
        """
        p, d, level, growth = var("p", VEC3), var("d", VEC3), var("level", FLOAT), var("growth", FLOAT)
        if root is None:
            return Function(name, (p, d, level, growth), const((FARTHEST, FARTHEST)))
        self._roots.append(root)
        found = run(Ask(root, p, d, level, growth, undivided=undivided), self._node, lambda ask: ask.key, {})
        return Function(name, (p, d, level, growth), vec2(found.value, found.whole(level, growth)), where=root.where)

    # Nodes

    def _node(self, ask: Ask) -> Work:
        node = ask.node
        if node.label is not None:
            return (yield replace(ask, node=node.children[0]))
        if rows_of(node) is not None and self.lowering.objects is not None:
            return self._whole(ask)
        if not node.children:
            return self._shape(ask)
        if node.definition.name == "varied_cells" or find([ask.point], "cell"):
            return self._whole(ask)
        scope = yield from self._scope(ask)
        body = _read(scope.template, ask.undivided)
        found = yield from self._part(scope, body, ask.negated)
        if found is None and is_convex(node) and not ask.negated:
            return self._tangent(ask, along(self._field(ask))(ask.point, ask.direction))
        if found is None:
            return self._whole(ask, self._divided_value(ask, scope.actual[body]))
        found = self._divided(ask, found)
        if scope.borders:
            found = in_box(ask, in_pieces(scope, body, found))
        elif not scope.whole:
            found = found.beside(Line(found.value, -ask.steepest))
        return self._for_rays(node, found)

    def _for_rays(self, node: Node, found: Reading) -> Reading:
        """The reading for the kinds of rays that see the node."""
        value = shown(node, found.value, self.lowering.rays)
        if value is found.value:
            return found
        far = shown(node, found.line.value, self.lowering.rays)
        return Reading(
            value, Line(far, found.line.slope), lambda *at: shown(node, found.ahead(*at), self.lowering.rays)
        )

    def _shape(self, ask: Ask) -> Reading:
        node = ask.node
        if is_convex(node):
            template = reading_of(node.definition.template(0, node.params), ask.undivided)
            pair = along(template)(ask.point, ask.direction, *values_of(node))
            return self._tangent(ask, self._divided_value(ask, pair))
        far = not ask.undivided and only_united(self._roots[-1])  # whose undivided value is read as a distance
        if is_implicit(node) and (known := _on_stretch(ask, far)) is not None:
            return known.beside(Line(known.value, -ask.steepest))
        if node.definition.name == "terrain" and not ask.negated:
            made = self._by_constant(ask, self._field(ask)(ask.point))
            return in_box(ask, Reading(made.value, made.line, _over_heights(ask)).beside(made.line))
        hull = None if ask.negated else hull_of(node)
        if hull is None or self.wholly:
            return self._whole(ask)
        made = self._by_constant(ask, self._field(ask)(ask.point))
        pair = self._divided_value(ask, along(hull)(ask.point, ask.direction, *values_of(node)))
        return made.beside(Line(pair.x, pair.y))

    def _tangent(self, ask: Ask, pair: Expr) -> Reading:
        """The reading of a convex field with its value and slope; of the complement, by the exit in closed form."""
        if not ask.negated:
            return of_line(pair.x, Line(pair.x, pair.y))
        if ask.node.definition.name == "plane":
            return of_line(-pair.x, Line(-pair.x, -pair.y))
        if ask.node.definition.name not in EXITS:
            return self._whole(ask, pair.x)
        made = self._by_constant(ask, pair.x)
        unit = ask.speed is ONE
        ends = interval_of_ray(ask.node, ask.point, ask.direction if unit else ask.direction / ask.speed)
        exit = ends.y if unit else ends.y / ask.speed

        def ahead(level: Expr, growth: Expr) -> Expr:
            way = way_out(made.value, exit, level, growth)
            # a negative level is met outside of the solid
            return way if level is ask.level else max(way, made.line.way(level, growth))

        return Reading(made.value, made.line, ahead)

    def _whole(self, ask: Ask, value: Expr | None = None) -> Reading:
        """The reading of a node of which nothing but its value, its Lipschitz constant and its box are known."""
        if self.wholly:
            raise OnlyDistance(ask.node)
        return in_box(ask, self._by_constant(ask, self._field(ask)(ask.point) if value is None else value))

    def _by_constant(self, ask: Ask, value: Expr) -> Reading:
        """The reading of a value, or of its negative if that is asked, by the Lipschitz constant alone."""
        value = -value if ask.negated else value
        return of_line(value, Line(value, -ask.steepest))

    def _field(self, ask: Ask) -> Function:
        """The field of a node as a function of the point."""
        key = id(ask.node), ask.undivided
        if key not in self._plain:
            name = f"{ask.node.name}_field"
            self._plain[key] = self.lowering.again().field(ask.node, name, undivided=ask.undivided)
        return self._plain[key]

    def _divided_value(self, ask: Ask, value: Expr) -> Expr:
        divisor = ask.node.facts.divisor
        return value if ask.undivided or divisor <= 1.0 else value / divisor

    def _divided(self, ask: Ask, found: Reading) -> Reading:
        value = self._divided_value(ask, found.value)
        return found if value is found.value else found.scaled(value, const(1.0 / ask.node.facts.divisor))

    # Bodies

    def _scope(self, ask: Ask) -> Generator[Ask, Reading, Scope]:
        """The parts of a node's body, with the values of its children."""
        node = ask.node
        children = operands_of(node)
        template = node.definition.template(len(children), node.params)
        below = ask.undivided or node.definition.adds(len(children), node.params)
        point = template.params[0]
        parts = topological([template.body])
        moving = depends_on([template.body], [point, *[part for part in parts if part.op == "apply"]])
        scope = Scope(ask, below, template, {}, known_parts(node.definition, template), moving)
        scope.actual |= dict(zip(template.params, (ask.point, *values_of(node)), strict=True))
        for part in parts:
            if part in scope.actual:
                continue
            if part.op == "apply":
                request = self._child(scope, part, negated=False)
                if request is None:
                    child = replace(ask, node=children[part.data], undivided=below)
                    scope.actual[part] = self._field(child)(scope.actual[part.args[0]])
                else:
                    found = yield request
                    scope.actual[part] = found.value
            else:
                scope.actual[part] = rebuild(part, tuple([scope.actual[arg] for arg in part.args]))
        return scope

    def _child(self, scope: Scope, part: Expr, negated: bool) -> Ask | None:
        """The request for a child whose point moves in pieces; None if it does not."""
        ask, point = scope.ask, scope.template.params[0]
        if len(part.args) != 1:
            return None
        direction = var("direction", point.type)
        ways = borders(part.args[0], point, direction, scope.kinds)
        if ways is None:
            return None
        rate = directional_derivatives(part.args[0], point, [direction])[0]
        known = scope.actual | {direction: ask.direction}
        moved, *found = substitute([rate, *ways], known)
        scope.borders += [way for way in found if way not in scope.borders]
        request = replace(
            ask,
            node=operands_of(ask.node)[part.data],
            point=scope.actual[part.args[0]],
            direction=moved,
            speed=ask.speed if ask.node.placed_as in KEEPING or moved is ask.direction else length(moved),
            undivided=scope.below,
            negated=negated,
        )
        scope.pieces[part] = Piece(request, rate, ways)
        return request

    def _part(self, scope: Scope, part: Expr, negated: bool) -> Part:
        """The reading of a part of a body, or of its negative; None if it has none."""
        value, args = scope.value(part, negated), part.args
        if part.op == "apply":
            request = self._child(scope, part, negated)
            return None if request is None else (yield request)
        if part.op == "neg":
            return (yield from self._part(scope, args[0], not negated))
        if part.op == "abs":
            inner = yield from self._part(scope, args[0], False)
            other = yield from self._part(scope, args[0], True)
            if inner is None or other is None:
                return None
            return union_of(value, inner, other) if negated else intersection_of(value, inner, other)
        if part.op in ("min", "max"):
            return (yield from self._choice(scope, part, negated))
        if part.op in ("add", "sub", "mul", "div"):
            return (yield from self._with_number(scope, part, negated))
        if part.op == "call" and is_concave_fold(part.data):
            inner = yield from self._part(scope, args[0], negated)
            other = yield from self._part(scope, args[1], negated)
            if inner is None or other is None:
                return None
            if not negated:
                return smooth_minimum_of(value, part.data, inner, other, scope.actual[args[2]])
            scope.whole = False
            return smooth_maximum_of(value, part.data, inner, other, scope.actual[args[2]])
        return None

    def _choice(self, scope: Scope, part: Expr, negated: bool) -> Part:
        """The smaller or the larger of two parts."""
        value = scope.value(part, negated)
        found = []
        for arg in part.args:
            found.append((yield from self._part(scope, arg, negated)))
        both = [each for each in found if each is not None]
        if (part.op == "min") != negated:
            return union_of(value, *both) if len(both) == 2 else None
        if len(both) == 2:
            return intersection_of(value, *both)
        if both and self.wholly:  # such as a displaced solid, which is known up to its shell only
            raise OnlyDistance(scope.ask.node)
        scope.whole = False
        return replace(both[0], value=value, straight=False, signed=None) if both else None

    def _with_number(self, scope: Scope, part: Expr, negated: bool) -> Part:
        """A part plus a number, or times one that is not negative."""
        (a, b), value = part.args, scope.value(part, negated)
        inner, number, other_side = (a, b, False) if scope.still(b) else (b, a, part.op == "sub")
        if not scope.still(number) or (part.op == "div" and number is a):
            return None
        if part.op in ("mul", "div") and not scope.rises(number):
            return None
        found = yield from self._part(scope, inner, negated != other_side)
        if found is None:
            return None
        amount = scope.actual[number]
        if part.op == "mul":
            return found.scaled(value, amount)
        if part.op == "div":
            return found.scaled(value, 1.0 / amount)
        positive = (part.op == "add" or other_side) != negated
        return found.shifted(value, amount if positive else -amount)


def is_implicit(node: Node) -> bool:
    """True for an implicit surface, whose advance is not limited by its Lipschitz constant."""
    return node.definition.name == "implicit_solid"


@remembered
def implicit_nodes(root: Node) -> list[Node]:
    """The implicit surfaces of a tree whose functions are known along a stretch."""
    return [n for n in children_first(root) if is_implicit(n) and free_way(n.params["function"], False) is not None]


PLACING = ("union", "select", "rigid", "scale")
"""Placings of operators that answer along a stretch as their children do."""


@remembered
def steepest_slopes(root: Node) -> list[float]:
    """By what the fields of the height maps of a tree are divided, which the advance is not; 1 for a map that is not
    only placed and united: blended, it answers with its distance near the seam."""
    found, pending = list[float](), [(root, True)]
    visited: set[tuple[int, bool]] = set()
    while pending:
        node, placed = pending.pop()
        if (id(node), placed) in visited:
            continue
        visited.add((id(node), placed))
        if node.definition.name == "terrain":
            found.append(node.facts.divisor if placed else 1.0)
        kept = placed and (node.label is not None or node.placed_as in PLACING)
        pending += [(child, kept) for child in node.children]
    return found


@remembered
def only_united(root: Node) -> bool:
    """True for several solids that are placed and united, and nothing else: a lower bound of the field is as good as
    its value far from them. Rays are clipped to the box of a solid that is alone."""
    nodes = children_first(root)
    placed = all(not n.children or n.label is not None or n.placed_as in PLACING for n in nodes)
    return placed and sum(not n.children for n in nodes) > 1


DEEPEST = 100
"""Largest number of nodes one above the other of a tree that is read: the readings of a chain are nested functions."""


@remembered
def readable(root: Node) -> bool:
    """True if the field is certified, and its tree not too deep."""
    depth = folded(root, lambda _, below: 1 + builtins.max(below, default=0))
    return root.facts.exactness != "estimate" and depth <= DEEPEST


def _over_heights(ask: Ask) -> Ahead:
    """The advance of a height map on the stretch that is looked at."""
    params = ask.node.params
    over, unit = free_over(params["data"]), ONE if ask.undivided else const(ask.node.facts.divisor)
    size, height = params["size"], params["height"]
    return lambda *at: over(ask.point, ask.direction, vec2(*at) * unit, size, height, STRETCH)


def _on_stretch(ask: Ask, far: bool) -> Reading | None:
    """The reading of an implicit surface on the stretch that is looked at; None if nothing is known of its function.

    far : True if its value may be a lower bound of the field outside of its box.
    """
    function, lower, upper, *numbers = (ask.node.params[name] for name in IMPLICIT)
    _, unit, steepest = numbers
    if free_way(function, ask.negated) is None:
        return None
    side = -1.0 if ask.negated else 1.0

    def both(level: Expr, growth: Expr) -> Expr:
        free = free_way(function, ask.negated, _is_times(level, ask.level), far)
        assert free is not None
        return free(ask.point, ask.direction, lower, upper, vec2(level, growth), vec3(*numbers), STRETCH)

    def signed(level: Expr, growth: Expr) -> Expr:
        return side * both(level, growth).y

    def ahead(level: Expr, growth: Expr) -> Expr:
        return max(signed(level, growth), 0.0) if _is_times(level, ask.level) else both(level, growth).y

    here = both(ask.level, ask.growth).x / (unit if ask.undivided else max(unit, steepest))
    value = side * cut_by_box(ask.point, here, lower, upper)
    return Reading(value, Line(value, -ask.steepest), ahead, signed=signed)


IMPLICIT = ("function", "lower", "upper", "level", "unit", "steepest")
"""Parameters of an implicit surface."""


def _is_times(level: Expr, own: Expr) -> bool:
    """True for a level, or its product with numbers."""
    return level is own or (level.op in ("mul", "div") and any(_is_times(arg, own) for arg in level.args))


def _read(template: Function, undivided: bool) -> Expr:
    """The body of a definition, or the bound that it states in place of its divided value."""
    body = template.body
    return body.args[0 if undivided else 1] if body.data is BOUND else body
