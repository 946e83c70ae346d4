"""What is asked of a node along a ray, and how far it is free up to its box and to the borders of its pieces.

Where the point of a child moves piece by piece (cells, folds), the child's answer holds up to the border of the piece,
and the Lipschitz constant beyond.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import reduce

import numpy as np

from raymarch.expr.curvature import Kinds, kinds_of
from raymarch.expr.function import Function
from raymarch.expr.node import Expr, const, var
from raymarch.expr.partials import ONE
from raymarch.expr.types import VEC3
from raymarch.expr.vocabulary import max, min, where
from raymarch.expr.walk import substitute
from raymarch.sdf.convexity import is_concave_fold, is_convex
from raymarch.sdf.node import Node, values_of
from raymarch.sdf.readings import Reading
from raymarch.sdf.ways import Box, Line, way_in_pieces


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


@dataclass(frozen=True, slots=True, eq=False)
class Piece:
    """What a body asks of a child: the ways to the borders and the rate of the child's point, of the body's point."""

    ask: Ask
    rate: Expr
    ways: Sequence[Expr]


@dataclass(slots=True)
class Scope:
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
        known = dict(zip(self.template.params, (point, *values_of(self.ask.node)), strict=True))
        known[var("direction", self.template.params[0].type)] = self.ask.direction
        ways, boxes = dict[Expr, None](), list[Box | None]()
        for part, piece in self.pieces.items():
            q, rate, *found = substitute([part.args[0], piece.rate, *piece.ways], known)
            ways |= dict.fromkeys(found)
            boxes.append(_box_of(replace(piece.ask, point=q, direction=rate)))
        return reduce(min, ways), [] if None in boxes else [box for box in boxes if box is not None]

    def value(self, part: Expr, negated: bool) -> Expr:
        """The value of a part, or its negative."""
        return -self.actual[part] if negated else self.actual[part]

    def still(self, part: Expr) -> bool:
        """True if a part depends on neither the point nor the children."""
        return part not in self.moving

    def rises(self, part: Expr) -> bool:
        """True if a number that does not depend on the point is known to be 0 or more."""
        return kinds_of(part, self.kinds, is_concave_fold)[0].low >= 0.0


AHEAD = 1
"""Pieces after the first one in which a ray is free up to the boxes of children. Two save 3 % more evaluations of
infinite columns in a plane, and no time."""


def in_pieces(scope: Scope, body: Expr, found: Reading) -> Reading:
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


def in_box(ask: Ask, found: Reading) -> Reading:
    """The reading of a node with a box: free up to the box."""
    box = _box_of(ask)
    if box is None:
        return found
    return Reading(found.value, found.line, lambda *at: max(found.ahead(*at), box.way(*at)))
