"""Materials at a hit, blended by weights: the partial derivatives of the field by each part."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

from raymarch.expr.function import Function
from raymarch.expr.glsl import Record
from raymarch.expr.node import Expr, const
from raymarch.expr.vocabulary import where
from raymarch.expr.walk import find, rebuild, rewrite
from raymarch.plan.shading import mapped, needs_surface
from raymarch.scene.material import FIELDS, GLASS, MIXED, PHONG, PHYSICAL, RELIEF, Material
from raymarch.scene.scene import Scene
from raymarch.sdf.lower import SCENE_INTERACTION, Lowering, material_expressions
from raymarch.sdf.weights import weights_of

Key = TypeVar("Key")


@dataclass(slots=True)
class Evaluation:
    """The generated functions that evaluate materials. Each is None if it is not needed.

    model : how materials are shaded: "phong", "physical", or "mixed" if there are both.
    record : fills the struct Material. emission : emitted radiance. glass : fills the struct Glass.
    relief : fills the struct Relief. index : index of the material with the largest weight.
    """

    model: str = "phong"
    record: Record | None = None
    emission: Function | None = None
    glass: Record | None = None
    relief: Record | None = None
    index: Function | None = None


def materials_of(scene: Scene, lowering: Lowering, shaded: bool, index: bool) -> Evaluation:
    """The functions that evaluate materials at a hit, blended with the same weights as normals.

    shaded : True if the functions that shade are needed. index : True if the index of the material is needed.
    """
    default = scene.materials[0]
    marked = lowering.again().field(scene.node, label=default)
    marks, parts = weights_of(marked)
    values = [tuple(material_expressions(mark)) for mark in marks] or [tuple(default.expressions)]
    weights = parts if len(set(values)) > 1 else [const(1.0)]
    chosen = [mark.data for mark in marks] or [default]
    kinds = {m.physical for m in chosen}
    made = Evaluation("mixed" if len(kinds) == 2 else "physical" if True in kinds else "phong")
    if shaded:
        fields = _mixed(values, weights)
        params = (*marked.params, *SCENE_INTERACTION) if mapped(scene) and needs_surface(scene) else marked.params

        def record(name: str, kind: str, names: Sequence[str]) -> Record:
            return Record(name, kind, params, tuple((n, fields[n]) for n in names))

        if needs_surface(scene):
            names = {"phong": PHONG, "physical": PHYSICAL, "mixed": MIXED}[made.model]
            made.record = record("material_at", "Material", names)
        if needs_surface(scene) and mapped(scene):
            made.relief = record("relief_at", "Relief", RELIEF)
        if (scene.path_traced or scene.whitted) and any(m.transmits for m in chosen):
            made.glass = record("glass_at", "Glass", GLASS)
        if any(m.emits for m in chosen):
            made.emission = Function("emission_at", params, fields["emission"])
    if index:
        made.index = Function("material_index", marked.params, _largest(scene.materials, chosen, weights))
    return made


def _mixed(values: Sequence[tuple[Expr, ...]], weights: Sequence[Expr]) -> dict[str, Expr]:
    """Each field of a material: the weighted mean over all materials."""
    weight_of = {_read_where(fields_of, weight): weight for fields_of, weight in _summed(values, weights).items()}
    total = sum(weight_of.values(), const(0.0))
    total = where(total <= 0.0, 1.0, total)
    fields = {}
    for k, name in enumerate(FIELDS):
        each = [fields_of[k] for fields_of in weight_of]
        same = all(v is each[0] for v in each)
        mixed = sum((weight * v for weight, v in zip(weight_of.values(), each, strict=True)), const(0.0)) / total
        fields[name] = each[0] if same else mixed
    return fields


def _read_where(values: tuple[Expr, ...], weight: Expr) -> tuple[Expr, ...]:
    """The fields of a part's material; its textures are read only where its weight is above 0."""
    if weight.is_constant or not find(values, "texture"):
        return values
    visible = where(weight <= 0.0, 0.0, 1.0)

    def rule(node: Expr, args: tuple[Expr, ...]) -> Expr:
        return rebuild(node, (*args[:3], visible * args[3]) if node.op == "texture" else args)

    new = rewrite(values, rule)
    return tuple(new[value] for value in values)


def _largest(materials: Sequence[Material], found: Sequence[Material], weights: Sequence[Expr]) -> Expr:
    """The index of the material with the largest weight."""
    best, index = const(-1.0), const(0.0)
    for material, weight in _summed(found, weights).items():
        index = where(best < weight, float(materials.index(material)), index)
        best = where(best < weight, weight, best)
    return index


def _summed(keys: Sequence[Key], weights: Sequence[Expr]) -> dict[Key, Expr]:
    """The sum of the weights of each key."""
    sums = {key: const(0.0) for key in keys}
    for key, weight in zip(keys, weights, strict=False):  # a single weight stands for all, whose values are equal
        sums[key] = sums[key] + weight
    return sums
