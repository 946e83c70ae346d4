"""Joints of two solids, and other ways to combine them, each a function of two distances.

Where a joint measures a and b like the sides of a right triangle, it is as steep as their diagonal, sqrt(2).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from raymarch.expr.calls import checked
from raymarch.expr.node import Expr
from raymarch.expr.vocabulary import length, max, min, mix, vec2
from raymarch.sdf.booleans import balanced, first, hull, spread_of_first, widest
from raymarch.sdf.definition import EVERYWHERE, Child, ChildFacts, combination, operator
from raymarch.sdf.domain import Fraction, Positive, Scalar
from raymarch.sdf.node import Node, called_by_nodes, method

__all__ = ["engrave", "groove", "morph", "pipe", "tongue", "xor"]

DIAGONAL = math.sqrt(2.0)


def _near_both(children: Sequence[ChildFacts], radius: Expr) -> tuple[Expr, Expr]:
    corners = [child.grown(radius) for child in children[:2]]
    return balanced([lower for lower, _ in corners], max), balanced([upper for _, upper in corners], min)


@combination(bounds=_near_both, lipschitz=DIAGONAL, called="pipe")
def pipe_along(p: Expr, children: Sequence[Child], radius: Positive) -> Expr:
    """A tube along the line where two surfaces meet."""
    return length(vec2(children[0](p), children[1](p))) - radius


@combination(bounds=first, lipschitz=DIAGONAL, spread=spread_of_first, cuts=True, called="engrave")
def engraved(p: Expr, children: Sequence[Child], depth: Positive) -> Expr:
    """A V-shaped line cut into the first solid where the second surface meets it."""
    a, b = children[0](p), children[1](p)
    return max(a, math.sqrt(0.5) * (a + depth - abs(b)))


@combination(bounds=first, spread=spread_of_first, cuts=True, called="groove")
def grooved(p: Expr, children: Sequence[Child], depth: Positive, width: Positive) -> Expr:
    """A channel with upright walls cut into the first solid along the second surface."""
    a, b = children[0](p), children[1](p)
    return max(a, min(a + depth, 0.5 * width - abs(b)))


@combination(
    bounds=lambda children, height: children[0].grown(height), spread=spread_of_first, symmetry="", called="tongue"
)
def tongued(p: Expr, children: Sequence[Child], height: Positive, width: Positive) -> Expr:
    """A rib with upright walls raised on the first solid along the second surface."""
    a, b = children[0](p), children[1](p)
    return min(a, max(a - height, abs(b) - 0.5 * width))


@combination(bounds=hull, spread=widest, called="xor")
def exclusive(p: Expr, children: Sequence[Child]) -> Expr:
    """Exclusive or: the points of one of two solids but not of both."""
    a, b = children[0](p), children[1](p)
    return max(min(a, b), -max(a, b))


@combination(bounds=hull, called="morph")
def between(p: Expr, children: Sequence[Child], amount: Fraction) -> Expr:
    """The mean of two fields: where it is not positive, one of them is not."""
    return mix(children[0](p), children[1](p), amount)


@method
@operator(exactness="exact", bounds=lambda child: EVERYWHERE, symmetry="keep")
def complement(p: Expr, child: Child) -> Expr:
    """The complement: inside and outside exchanged."""
    return -child(p)


@checked
def pipe(a: Node, b: Node, radius: Scalar = 0.1) -> Node:
    """A tube of a radius > 0 along the line where the surfaces of two solids meet. A bound."""
    return pipe_along([a, b], radius)


@checked
def engrave(a: Node, b: Node, depth: Scalar = 0.1) -> Node:
    """The first solid with a V-shaped line of a depth > 0 where the second's surface meets it. A bound."""
    return engraved([a, b], depth)


@checked
def groove(a: Node, b: Node, depth: Scalar = 0.1, width: Scalar = 0.1) -> Node:
    """The first solid with a channel of a depth and full width > 0 along the second's surface. A bound."""
    return grooved([a, b], depth, width)


@checked
def tongue(a: Node, b: Node, height: Scalar = 0.1, width: Scalar = 0.1) -> Node:
    """The first solid with a rib of a height and full width > 0 along the second's surface. A bound."""
    return tongued([a, b], height, width)


@checked
@called_by_nodes
def xor(a: Node, b: Node) -> Node:
    """Exclusive or: the points of one of two solids but not of both. A bound."""
    return exclusive([a, b])


@checked
def morph(a: Node, b: Node, amount: Scalar = 0.5) -> Node:
    """A solid between two others: the first for amount 0, the second for 1. A bound."""
    return between([a, b], amount)
