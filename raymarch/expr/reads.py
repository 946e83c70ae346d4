"""Look-ups of pictures on exclusive sides of a choice, as one look-up.

Drivers inline the look-up of each picture, with its loop, and the time that they take to compile grows faster than the
number of look-ups. `where(c, read(a), read(b))` is one read in an atlas that holds both pictures, at a chosen place.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

from raymarch.expr.atlas import Atlas, Place, shelved
from raymarch.expr.choices import changed_inside_out, fold_choices, if_both, sides, where_each
from raymarch.expr.node import Expr, const
from raymarch.expr.textures import texture_in_atlas
from raymarch.expr.vocabulary import vec2, vec4, where
from raymarch.expr.walk import find, rebuild, substitute, topological

FEW = 8
"""Up to this number of pictures, each keeps its own texture: texture units filter it in hardware, and a look-up of each
takes the drivers less than 0.2 s to compile."""


def merge_reads(roots: Sequence[Expr]) -> list[Expr]:
    """The roots, with look-ups of many pictures on exclusive sides of a choice merged into one for each atlas."""
    pictures = dict.fromkeys(node.data for node in find(roots, "texture"))
    places = shelved(pictures) if len(pictures) > FEW else {}
    if not places:
        return list(roots)
    return changed_inside_out(
        roots, lambda node: node.op == "texture" and node.data.name in places, lambda tree: _merged(tree, places)
    )


def _merged(tree: Expr, places: Mapping[str, Place]) -> Expr:
    """A tree of choices with as many look-ups in an atlas as the leaf that has the most."""
    order = topological([tree], sides)
    leaves = [node for node in order if node.op != "where"]
    slots: dict[tuple[Atlas, int], dict[Expr, Expr]] = {}
    for leaf in leaves:
        counts: Counter[Atlas] = Counter()
        for node in topological([leaf], _without_conditions):
            if node.op == "texture" and node.data.name in places:
                atlas = places[node.data.name].atlas
                slots.setdefault((atlas, counts[atlas]), {})[leaf] = node
                counts[atlas] += 1
    new: dict[Expr, dict[Expr, Expr]] = {leaf: {} for leaf in leaves}
    for (atlas, _), by_leaf in slots.items():
        if len({read.data for read in by_leaf.values()}) > 1:
            read = _one_read(order, atlas, by_leaf, places)
            for leaf, old in by_leaf.items():
                new[leaf][old] = read
    made = {leaf: substitute([leaf], new[leaf])[0] if new[leaf] else leaf for leaf in leaves}
    return fold_choices(order, made.__getitem__, where)


def _one_read(order: Sequence[Expr], atlas: Atlas, by_leaf: Mapping[Expr, Expr], places: Mapping[str, Place]) -> Expr:
    """The look-up that stands for one of each leaf. It has the weight 0 at the leaves that have none."""

    def args(leaf: Expr) -> tuple[Expr, ...] | None:
        if leaf not in by_leaf:
            return None
        place, given = places[by_leaf[leaf].data.name], by_leaf[leaf].args[:3]
        return vec4(*place.corner, *place.picture.size), vec2(*place.kind), *given

    def weight(leaf: Expr) -> Expr:
        return by_leaf[leaf].args[3] if leaf in by_leaf else const(0.0)

    def weighed(condition: Expr, yes: Expr, no: Expr) -> Expr:
        return where(condition, _where_known(yes, condition, True), _where_known(no, condition, False))

    found = fold_choices(order, args, if_both(where_each))
    assert found is not None
    place, kind, at, duvdx, duvdy = found
    return texture_in_atlas(atlas, place, kind, at, duvdx, duvdy, fold_choices(order, weight, weighed))


def _without_conditions(node: Expr) -> tuple[Expr, ...]:
    return sides(node) or node.args


def _where_known(value: Expr, condition: Expr, holds: bool) -> Expr:
    """A value where a condition is known: a weight that says which part is seen becomes 1."""
    new: dict[Expr, Expr] = {}
    for node in topological([value], _without_conditions):
        if node.op == "where":
            if node.args[0] is condition:
                new[node] = new[node.args[1 if holds else 2]]
            else:
                new[node] = where(node.args[0], *(new[side] for side in sides(node)))
        else:
            new[node] = rebuild(node, tuple(new[arg] for arg in node.args))
    return new[value]
