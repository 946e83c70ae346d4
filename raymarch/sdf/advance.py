"""The reading that tells how far along a ray no surface lies.

For a point p, a direction d, a level and a growth, a node answers with its value f and an advance a >= 0: at no s in
[0, a) is f(p + s d) = level + growth s, or less. For rays the level is the rounding error of the value in float32, and
the growth that of the slope. For cones they are the radius at p and the tangent of the half angle. A transform divides
both by the factor by which it multiplies distances. It maps d by its linear part, so s stays the parameter of the ray,
and d need not be of unit length inside.

The contract of a leaf
----------------------
A `Reading` has the value, a line below the field, and a function `ahead(level, growth)`.

- `line` is a value v and a slope m with f(p + s d) >= v + m s for all s >= 0: of a convex function the tangent, of a
  function with the Lipschitz constant L its value and -L |d|.
- `ahead` is the advance, an expression; 0 where f <= level. By default it is where the line meets the level.
- A leaf whose bounds hold on a stretch of the ray only, such as those from intervals of the slope, reads `STRETCH`, a
  variable of the shader: the stretch w > 0 that is looked at. It answers with a <= w, and a = w if all of it is free.
  The loop doubles w after a step of w, and else sets it to 1.5 a. Its line is that of the Lipschitz constant, or a line
  that falls at once if there is none.

Rules
-----
Union: the least advance. Intersection: the greatest. Complement: each node answers for -f itself. f + c: the level less
c. c f: the level by c. A smooth minimum lies at most k/4 below the least operand and is concave in its operands; a
smooth maximum lies above the greatest and is convex. Where the point of a child moves piece by piece (cells, folds),
the child's answer holds up to the border of the piece, and the Lipschitz constant beyond. docs/theory.md has proofs.
"""

from __future__ import annotations

import builtins
import math
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass, field, replace
from functools import reduce
from typing import TypeAlias

import numpy as np

from raymarch.expr.curvature import Kinds, kinds_of
from raymarch.expr.derivative import directional_derivatives, opened, share_values
from raymarch.expr.function import Function
from raymarch.expr.node import Expr, const, var
from raymarch.expr.partials import ONE
from raymarch.expr.types import FLOAT, VEC3
from raymarch.expr.vocabulary import length, max, min, vec2, vec3, where
from raymarch.expr.walk import depends_on, find, rebuild, run, substitute, topological
from raymarch.sdf.blends import FAMILIES
from raymarch.sdf.convexity import hull_of, is_concave_fold, is_convex, known_parts
from raymarch.sdf.facts import FARTHEST
from raymarch.sdf.implicit_ahead import free_way
from raymarch.sdf.intersections import interval_of_ray
from raymarch.sdf.labels import flattened, rows_of
from raymarch.sdf.lower import Lowering, reading_of
from raymarch.sdf.node import Node, children_first
from raymarch.sdf.pieces import borders
from raymarch.sdf.values import BOUND
from raymarch.sdf.visibility import shown
from raymarch.sdf.ways import Box, Line, chord, way_in_pieces, way_out

STRETCH = var("stretch_ahead", FLOAT)
"""The stretch of the ray for which leaves with bounds of a stretch are asked; a variable of the shader."""

KEEPING = ("rigid", "select")
"""Placings of operators that move their child without stretching it; see `raymarch.sdf.definition.Placing`."""

EXITS = ("sphere", "box", "cylinder")
"""Convex shapes whose exit is found in closed form where they are holes. Those of others cost more than they save."""

Ahead: TypeAlias = Callable[[Expr, Expr], Expr]


@dataclass(frozen=True, slots=True, eq=False)
class Reading:
    """What a node answers along a ray; see the head of this module.

    straight : True if nothing but lines is known below the field.
    curve : for a smooth minimum, a concave function of the way s below the field, in place of the line.
    first : for that, the way to where the first of the operands' lines meets the level.
    """

    value: Expr
    line: Line
    ahead: Ahead
    straight: bool = False
    curve: Callable[[Expr], Expr] | None = None
    first: Ahead | None = None

    def below(self, s: Expr) -> Expr:
        """A concave function of the way s that is nowhere above the field."""
        return self.line.at(s) if self.curve is None else self.curve(s)

    def meets(self, level: Expr, growth: Expr) -> Expr:
        """The way to where the first line meets the level."""
        return self.line.way(level, growth) if self.first is None else self.first(level, growth)

    def shifted(self, value: Expr, offset: Expr) -> Reading:
        """The reading of the value plus a number that does not depend on the point."""
        line = Line(self.line.value + offset, self.line.slope)
        if self.straight and self.curve is None:
            return of_line(value, line)
        return Reading(
            value,
            line,
            lambda level, growth: self.ahead(level - offset, growth),
            self.straight,
            lambda s: self.below(s) + offset,
            lambda level, growth: self.meets(level - offset, growth),
        )

    def scaled(self, value: Expr, factor: Expr) -> Reading:
        """The reading of the value times a factor > 0 that does not depend on the point."""
        line = Line(self.line.value * factor, self.line.slope * factor)
        if self.straight and self.curve is None:
            return of_line(value, line)
        return Reading(
            value,
            line,
            lambda level, growth: self.ahead(level / factor, growth / factor),
            self.straight,
            lambda s: self.below(s) * factor,
            lambda level, growth: self.meets(level / factor, growth / factor),
        )

    def beside(self, line: Line) -> Reading:
        """The same, where a further line lies below the value."""
        return Reading(self.value, self.line, lambda *at: max(self.ahead(*at), line.way(*at)))


def of_line(value: Expr, line: Line) -> Reading:
    """The reading of a value of which a line is known."""
    return Reading(value, line, line.way, straight=True)


def union_of(value: Expr, a: Reading, b: Reading) -> Reading:
    """The reading of the smaller value."""
    line = Line(min(a.line.value, b.line.value), min(a.line.slope, b.line.slope))
    return Reading(value, line, lambda *at: min(a.ahead(*at), b.ahead(*at)))


def intersection_of(value: Expr, a: Reading, b: Reading) -> Reading:
    """The reading of the larger value, which lies above the lines of both."""
    slope = where(a.line.value < b.line.value, b.line.slope, a.line.slope)
    line = Line(max(a.line.value, b.line.value), slope)
    return Reading(value, line, lambda *at: max(a.ahead(*at), b.ahead(*at)))


UNIFORM = frozenset(FAMILIES[name](1).fold for name in "quadratic cubic quartic circular exponential root".split())
"""Smooth minima that lie at most k/4 below the smaller distance, whatever the distances are."""


def smooth_minimum_of(value: Expr, fold: Function, a: Reading, b: Reading, width: Expr) -> Reading:
    """The reading of a smooth minimum: concave in two distances that lie above lines, so it lies above its chord from
    here to where the first line meets the level."""

    straight = a.straight and b.straight

    def first(level: Expr, growth: Expr) -> Expr:
        return min(a.meets(level, growth), b.meets(level, growth))

    def curve(s: Expr) -> Expr:
        return fold(a.below(s), b.below(s), width)

    def ahead(level: Expr, growth: Expr) -> Expr:
        s = first(level, growth)
        found = chord(value - level, curve(s) - level - growth * s, s)
        if fold not in UNIFORM or straight:
            return found
        above = level + 0.25 * width
        return max(found, min(a.ahead(above, growth), b.ahead(above, growth)))

    slope = min(a.line.slope, b.line.slope)
    if fold not in UNIFORM:  # the partial derivatives add up to at most the root of 2
        slope = min(slope, math.sqrt(2.0) * slope)
    return Reading(value, Line(value, slope), ahead, straight, curve, first)


def smooth_maximum_of(value: Expr, fold: Function, a: Reading, b: Reading, width: Expr) -> Reading:
    """The reading of a smooth maximum, -fold(-a, -b): above both, convex in both, and falling in neither."""
    x, y = var("x", FLOAT), var("y", FLOAT)
    rates = [directional_derivatives(fold(x, y, width), one, [const(1.0)])[0] for one in (x, y)]
    rates = substitute(rates, {x: -a.line.value, y: -b.line.value})
    line = Line(value, rates[0] * a.line.slope + rates[1] * b.line.slope)
    if a.line.value is not a.value or b.line.value is not b.value:
        line = intersection_of(value, a, b).line
    return Reading(value, line, lambda *at: max(line.way(*at), max(a.ahead(*at), b.ahead(*at))))


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


@dataclass(frozen=True, slots=True)
class Ask:
    """A request for the reading of a node at a point, along a direction.

    speed : length of the direction. level, growth : those expected. undivided : of the undivided field. negated : of
    the complement.
    """

    node: Node
    point: Expr
    direction: Expr
    level: Expr
    growth: Expr
    speed: Expr = ONE
    undivided: bool = False
    negated: bool = False

    @property
    def key(self) -> tuple[object, ...]:
        return id(self.node), self.point, self.direction, self.level, self.growth, self.undivided, self.negated

    @property
    def steepest(self) -> Expr:
        """The largest slope of the field along the ray."""
        facts = self.node.facts
        return const(facts.undivided if self.undivided else facts.lipschitz) * self.speed


Work: TypeAlias = Generator[Ask, Reading, Reading]
Part: TypeAlias = Generator[Ask, Reading, "Reading | None"]


@dataclass(frozen=True, slots=True, eq=False)
class Piece:
    """What a body asks of a child: the ways to the borders and the rate of the child's point, of the body's point."""

    ask: Ask
    rate: Expr
    ways: Sequence[Expr]


@dataclass(slots=True)
class _Scope:
    """The body of a node: the expressions of the shader for its parts, and the borders of its pieces.

    whole : False if parts were left out, so that the node's Lipschitz constant may know more.
    """

    ask: Ask
    below: bool
    template: Function
    actual: dict[Expr, Expr]
    kinds: dict[Expr, Kinds]
    moving: set[Expr]
    borders: list[Expr] = field(default_factory=list)
    whole: bool = True
    pieces: dict[Expr, Piece] = field(default_factory=dict)

    def boxes(self, point: Expr) -> tuple[Expr, list[Box]]:
        """The way from a point of the ray to the next border, and the boxes of the children as they are seen there;
        no boxes if one child has none."""
        known = dict(zip(self.template.params, (point, *_values(self.ask.node)), strict=True))
        known[var("direction", self.template.params[0].type)] = self.ask.direction
        ways, boxes = dict[Expr, None](), list[Box | None]()
        for part, piece in self.pieces.items():
            q, rate, *found = substitute([part.args[0], piece.rate, *piece.ways], known)
            ways |= dict.fromkeys(found)
            boxes.append(_box_of(replace(piece.ask, point=q, direction=rate)))
        return reduce(min, ways), [] if None in boxes else [box for box in boxes if box is not None]

    def still(self, part: Expr) -> bool:
        """True if a part depends on neither the point nor the children."""
        return part not in self.moving

    def rises(self, part: Expr) -> bool:
        """True if a number that does not depend on the point is known to be 0 or more."""
        return kinds_of(part, self.kinds, is_concave_fold)[0].low >= 0.0


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

    def function(self, root: Node | None, name: str = "field_advance") -> Function:
        """`vec2 name(vec3 p, vec3 d, float level, float growth)`: the value of the field and the advance.

        root : None for empty space.
        """
        p, d, level, growth = var("p", VEC3), var("d", VEC3), var("level", FLOAT), var("growth", FLOAT)
        if root is None:
            return Function(name, (p, d, level, growth), const((FARTHEST, FARTHEST)))
        self._roots.append(root)
        found = run(Ask(root, p, d, level, growth), self._node, lambda ask: ask.key, {})
        return Function(name, (p, d, level, growth), vec2(found.value, found.ahead(level, growth)), where=root.where)

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
            found = _in_box(ask, _in_pieces(scope, body, found))
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
            pair = along(template)(ask.point, ask.direction, *_values(node))
            return self._tangent(ask, self._divided_value(ask, pair))
        if (way := _way_of_implicit(ask)) is not None:
            made = self._by_constant(ask, self._field(ask)(ask.point))
            return _in_box(ask, Reading(made.value, made.line, way).beside(made.line))
        hull = None if ask.negated else hull_of(node)
        if hull is None or self.wholly:
            return self._whole(ask)
        made = self._by_constant(ask, self._field(ask)(ask.point))
        pair = self._divided_value(ask, along(hull)(ask.point, ask.direction, *_values(node)))
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
        return _in_box(ask, self._by_constant(ask, self._field(ask)(ask.point) if value is None else value))

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

    def _scope(self, ask: Ask) -> Generator[Ask, Reading, _Scope]:
        """The parts of a node's body, with the values of its children."""
        node = ask.node
        children = flattened(node) if node.definition.associative else node.children
        template = node.definition.template(len(children), node.params)
        below = ask.undivided or node.definition.adds(len(children), node.params)
        point = template.params[0]
        parts = topological([template.body])
        moving = depends_on([template.body], [point, *[part for part in parts if part.op == "apply"]])
        scope = _Scope(ask, below, template, {}, known_parts(node.definition, template), moving)
        scope.actual |= dict(zip(template.params, (ask.point, *_values(node)), strict=True))
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

    def _child(self, scope: _Scope, part: Expr, negated: bool) -> Ask | None:
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
        node = ask.node
        children = flattened(node) if node.definition.associative else node.children
        request = replace(
            ask,
            node=children[part.data],
            point=scope.actual[part.args[0]],
            direction=moved,
            speed=ask.speed if node.placed_as in KEEPING or moved is ask.direction else length(moved),
            undivided=scope.below,
            negated=negated,
        )
        scope.pieces[part] = Piece(request, rate, ways)
        return request

    def _part(self, scope: _Scope, part: Expr, negated: bool) -> Part:
        """The reading of a part of a body, or of its negative; None if it has none."""
        value = -scope.actual[part] if negated else scope.actual[part]
        args = part.args
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

    def _choice(self, scope: _Scope, part: Expr, negated: bool) -> Part:
        """The smaller or the larger of two parts."""
        value = -scope.actual[part] if negated else scope.actual[part]
        found = []
        for arg in part.args:
            found.append((yield from self._part(scope, arg, negated)))
        both = [each for each in found if each is not None]
        if (part.op == "min") != negated:
            return union_of(value, *both) if len(both) == 2 else None
        if len(both) == 2:
            return intersection_of(value, *both)
        scope.whole = False
        return replace(both[0], value=value, straight=False) if both else None

    def _with_number(self, scope: _Scope, part: Expr, negated: bool) -> Part:
        """A part plus a number, or times one that is not negative."""
        a, b = part.args
        value = -scope.actual[part] if negated else scope.actual[part]
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


def implicit_nodes(root: Node) -> list[Node]:
    """The implicit surfaces of a tree whose functions are known along a stretch."""
    return [n for n in children_first(root) if is_implicit(n) and free_way(n.params["function"], False) is not None]


DEEPEST = 100
"""Largest number of nodes one above the other of a tree that is read: the readings of a chain are nested functions."""


def readable(root: Node) -> bool:
    """True if the field is certified, and its tree not too deep."""
    depth: dict[int, int] = {}
    for node in children_first(root):
        depth[id(node)] = 1 + builtins.max((depth[id(child)] for child in node.children), default=0)
    return root.facts.exactness != "estimate" and depth[id(root)] <= DEEPEST


def _way_of_implicit(ask: Ask) -> Ahead | None:
    """The advance of an implicit surface on the stretch that is looked at; None for other nodes."""
    if not is_implicit(ask.node):
        return None
    free = free_way(ask.node.params["function"], ask.negated)
    if free is None:
        return None
    lower, upper, *numbers = (ask.node.params[name] for name in ("lower", "upper", "level", "unit", "steepest"))
    scales = vec3(*numbers)
    return lambda *at: free(ask.point, ask.direction, lower, upper, vec2(*at), scales, STRETCH)


def _values(node: Node) -> list[Expr]:
    return [value for value in node.params.values() if isinstance(value, Expr)]


def _read(template: Function, undivided: bool) -> Expr:
    """The body of a definition, or the bound that it states in place of its divided value."""
    body = template.body
    return body.args[0 if undivided else 1] if body.data is BOUND else body


AHEAD = 1
"""Pieces after the first one in which a ray is free up to the boxes of children. Two save 3 % more evaluations of
infinite columns in a plane, and no time."""


def _in_pieces(scope: _Scope, body: Expr, found: Reading) -> Reading:
    """The reading of a node whose field is of the form read up to a border only, and Lipschitz beyond. Where the field
    is the least of convex children with boxes, the ray is free up to those of this piece, and of the next one. Others
    fill less of their boxes, which then take more time than they save."""
    ask, steepest, border = scope.ask, scope.ask.steepest, reduce(min, scope.borders)
    divided = not ask.undivided and ask.node.facts.divisor > 1.0
    tight = _is_least(body) and all(is_convex(piece.ask.node) for piece in scope.pieces.values())
    here = [] if ask.negated or divided or not tight else scope.boxes(ask.point)[1]

    def ahead(level: Expr, growth: Expr) -> Expr:
        there = found.below(border) - level - growth * border
        first = found.ahead(level, growth)
        if not here:
            return way_in_pieces(first, border, there, steepest + growth)
        first = max(first, reduce(min, [box.way(level, growth) for box in here]))
        there = max(there, reduce(min, [box.least(border) for box in here]) - level - growth * border)
        free = border + max(there, 0.0) / (steepest + growth)
        for _ in range(AHEAD):
            further, boxes = scope.boxes(ask.point + free * ask.direction)
            free = free + reduce(min, [further, *[box.way(level + growth * free, growth) for box in boxes]])
        return where(first < border, first, free)

    return Reading(found.value, Line(found.value, -steepest), ahead)


def _is_least(body: Expr) -> bool:
    """True for an expression that is above a level where all children that it asks are."""
    if body.op == "min":
        return all(map(_is_least, body.args))
    return body.op == "apply"


def _box_of(ask: Ask) -> Box | None:
    """The box of a node, if it is bounded on some side."""
    facts = ask.node.facts
    spread = facts.undivided_spread if ask.undivided else facts.spread
    known = np.isfinite([facts.lower, facts.upper]).any()
    if ask.negated or ask.point.type is not VEC3 or not known or facts.empty or not np.isfinite(spread):
        return None
    return Box(facts, float(spread), ask.point, ask.direction)


def _in_box(ask: Ask, found: Reading) -> Reading:
    """The reading of a node with a box: free up to the box."""
    box = _box_of(ask)
    if box is None:
        return found
    return Reading(found.value, found.line, lambda *at: max(found.ahead(*at), box.way(*at)))
