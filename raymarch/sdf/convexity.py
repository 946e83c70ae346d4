"""Which fields are convex functions of the point.

Along a ray such a field lies above each of its tangents, so Newton's step cannot pass the surface. The exact distance
to a convex solid is convex, outside and inside. Of other definitions the rules of `raymarch.expr.curvature` tell it.
"""

from __future__ import annotations

from collections.abc import Sequence

from raymarch.expr.curvature import AFFINE, UNKNOWN, Kind, Kinds, convex_minorant, kinds_of, still
from raymarch.expr.function import Function
from raymarch.expr.node import Expr
from raymarch.expr.walk import find
from raymarch.sdf.blends import FAMILIES
from raymarch.sdf.definition import Definition
from raymarch.sdf.node import Node, folded
from raymarch.sdf.same import remembered
from raymarch.sdf.values import BOUND

CONVEX = Kind(convex=True)

_CONCAVE = frozenset(made.fold for made in (family(1) for family in FAMILIES.values()) if made.concave)


def is_concave_fold(function: Function) -> bool:
    """True for a smooth minimum that is concave and nondecreasing in both distances."""
    return function in _CONCAVE


@remembered
def is_convex(node: Node) -> bool:
    """True if the field of a node is known to be a convex function of the point."""
    return folded(node, _convex)


def _convex(node: Node, below: Sequence[bool]) -> bool:
    if node.label is not None:
        return below[0]
    if node.facts.exactness == "exact" and node.facts.convex:
        return True
    if node.facts.exactness == "estimate" or "rows" in node.params:
        return False
    template = node.definition.template(len(node.children), node.params)
    key = ("convex", *below)
    return template.once(key, lambda: _kind_of_body(node.definition, template, below).convex)


def _kind_of_body(definition: Definition, template: Function, below: Sequence[bool]) -> Kind:
    if template.body.data is BOUND:
        return UNKNOWN
    return kinds_of(template.body, known_parts(definition, template, below), is_concave_fold)[0]


def known_parts(definition: Definition, template: Function, below: Sequence[bool] = ()) -> dict[Expr, Kinds]:
    """The kinds of the point, of the parameters over their domains, and of the children's values, in a template.

    below : whether the field of each child is convex.
    """
    point, *symbols = template.params
    found: dict[Expr, Kinds] = {point: (AFFINE,) * point.type.size}
    domains = [domain for domain in definition.domains.values() if domain.type is not None]
    for symbol, domain in zip(symbols, domains, strict=True):
        size = symbol.type.size if symbol.type.is_vector else 1
        found[symbol] = (still(domain.low, domain.high),) * size
    for part in find([template.body], "apply"):
        affine = len(part.args) == 1 and all(kind.affine for kind in kinds_of(part.args[0], found, is_concave_fold))
        found[part] = (CONVEX if affine and below and below[part.data] else UNKNOWN,)
    return found


def hull_of(node: Node) -> Function | None:
    """A convex function below the field of a shape, of the point and the parameters; None if the rules find none."""
    template = node.definition.template(0, node.params)

    def make() -> Function | None:
        body = convex_minorant(template.body, known_parts(node.definition, template), is_concave_fold)
        if body is None or body is template.body:
            return None
        return Function(f"{template.name}_hull", template.params, body, where=template.where)

    return template.once("hull", make)
