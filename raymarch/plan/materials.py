"""How surfaces look: materials mixed by how much each part moves the field at the hit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

from raymarch.expr.function import Function
from raymarch.expr.glsl import Record
from raymarch.expr.node import Expr, const
from raymarch.expr.vocabulary import where
from raymarch.expr.walk import find, rebuild, rewrite
from raymarch.plan.shading import mapped, surfaced
from raymarch.scene.material import FIELDS, GLASS, MIXED, PHONG, PHYSICAL, RELIEF, Material
from raymarch.scene.scene import Scene
from raymarch.sdf.lower import SEEN, Lowering, look_of
from raymarch.sdf.weights import weights_of

Key = TypeVar("Key")


@dataclass(slots=True)
class Looks:
    """What is generated to know a surface by.

    model : how materials are shaded: "phong", "physical", or "mixed" where there are both.
    record : fills the struct Material. emission : light that the surface gives off. glass : fills the
    struct Glass. relief : fills the struct Relief. index : of the main material.
    The functions are None where nothing asks for them.
    """

    model: str = "phong"
    record: Record | None = None
    emission: Function | None = None
    glass: Record | None = None
    relief: Record | None = None
    index: Function | None = None


def materials_of(scene: Scene, lowering: Lowering, look: bool, index: bool) -> Looks:
    """How a surface looks, and which material it is of: mixed by how much each part moves the field at the hit.

    look, index : which of the functions are needed.
    """
    default = scene.materials[0]
    marked = lowering.again().field(scene.node, label=default)
    marks, parts = weights_of(marked)
    values = [tuple(look_of(mark)) for mark in marks] or [tuple(default.expressions)]
    weights = parts if len(set(values)) > 1 else [const(1.0)]
    chosen = [mark.data for mark in marks] or [default]
    kinds = {m.physical for m in chosen}
    made = Looks("mixed" if len(kinds) == 2 else "physical" if True in kinds else "phong")
    if look:
        fields = _mixed(values, weights)
        params = (*marked.params, *SEEN) if mapped(scene) and surfaced(scene) else marked.params

        def record(name: str, kind: str, names: Sequence[str]) -> Record:
            return Record(name, kind, params, tuple((n, fields[n]) for n in names))

        if surfaced(scene):
            names = {"phong": PHONG, "physical": PHYSICAL, "mixed": MIXED}[made.model]
            made.record = record("material_at", "Material", names)
        if surfaced(scene) and mapped(scene):
            made.relief = record("relief_at", "Relief", RELIEF)
        if (scene.path_traced or scene.whitted) and any(m.transmits for m in chosen):
            made.glass = record("glass_at", "Glass", GLASS)
        if any(m.emits for m in chosen):
            made.emission = Function("emission_at", params, fields["emission"])
    if index:
        made.index = Function("material_index", marked.params, _largest(scene.materials, chosen, weights))
    return made


def _mixed(values: Sequence[tuple[Expr, ...]], weights: Sequence[Expr]) -> dict[str, Expr]:
    """Each field of a material, mixed from all by their weights."""
    weight_of = {_read_where(look, weight): weight for look, weight in _summed(values, weights).items()}
    total = sum(weight_of.values(), const(0.0))
    total = where(total <= 0.0, 1.0, total)
    fields = {}
    for k, name in enumerate(FIELDS):
        each = [look[k] for look in weight_of]
        same = all(v is each[0] for v in each)
        mixed = sum((weight * v for weight, v in zip(weight_of.values(), each, strict=True)), const(0.0)) / total
        fields[name] = each[0] if same else mixed
    return fields


def _read_where(look: tuple[Expr, ...], share: Expr) -> tuple[Expr, ...]:
    """The look of a part, its textures read only where the part is seen."""
    if share.is_constant or not find(look, "texture"):
        return look
    shown = where(share <= 0.0, 0.0, 1.0)

    def rule(node: Expr, args: tuple[Expr, ...]) -> Expr:
        return rebuild(node, (*args[:3], shown * args[3]) if node.op == "texture" else args)

    new = rewrite(look, rule)
    return tuple(new[value] for value in look)


def _largest(materials: Sequence[Material], found: Sequence[Material], weights: Sequence[Expr]) -> Expr:
    """The index of the material with the largest share."""
    best, index = const(-1.0), const(0.0)
    for material, weight in _summed(found, weights).items():
        index = where(best < weight, float(materials.index(material)), index)
        best = where(best < weight, weight, best)
    return index


def _summed(keys: Sequence[Key], weights: Sequence[Expr]) -> dict[Key, Expr]:
    """How much of each is seen at a point of the surface."""
    sums = {key: const(0.0) for key in keys}
    for key, weight in zip(keys, weights, strict=False):  # a single weight stands for all, which are equal
        sums[key] = sums[key] + weight
    return sums
