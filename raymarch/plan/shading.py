"""What the look of a scene calls for: how materials mix, which modules shade them, and what `explain` says of it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

from raymarch.errors import Location
from raymarch.expr.derivative import sensitivities
from raymarch.expr.function import Function
from raymarch.expr.glsl import Record
from raymarch.expr.node import Expr, const
from raymarch.expr.vocabulary import where
from raymarch.expr.walk import find
from raymarch.plan.feature import Feature
from raymarch.scene.light import PointLight, Sun
from raymarch.scene.material import Material
from raymarch.scene.scene import Scene
from raymarch.sdf.lower import Lowering, look_of

Key = TypeVar("Key")


def materials(scene: Scene, lowering: Lowering, look: bool, index: bool) -> tuple[Record | None, Function | None]:
    """How a surface looks, and which material it is of: mixed by how much each part moves the field at the hit.

    look, index : which of the two functions is needed; the other is None.
    """
    materials = scene.materials
    marked = lowering.again().field(scene.node, label=materials[0])
    marks = find([marked.body], "mark")
    looks = [tuple(look_of(mark)) for mark in marks] or [tuple(materials[0].expressions)]
    shares = [abs(part) for part in sensitivities(marked.body, marks)] if len(set(looks)) > 1 else [const(1.0)]
    chosen = [mark.data for mark in marks] or [materials[0]]
    return (
        Record("material_at", "Material", marked.params, _mixed(looks, shares)) if look else None,
        Function("material_index", marked.params, _largest(materials, chosen, shares)) if index else None,
    )


def _mixed(looks: Sequence[tuple[Expr, ...]], shares: Sequence[Expr]) -> tuple[tuple[str, Expr], ...]:
    """Each field of a material, mixed from all by their shares."""
    weights = _summed(looks, shares)
    total = sum(weights.values(), const(0.0))
    total = where(total <= 0.0, 1.0, total)
    fields = []
    for k, name in enumerate(Material.FIELDS):
        values = [look[k] for look in weights]
        same = all(v is values[0] for v in values)
        mixed = sum((weight * v for weight, v in zip(weights.values(), values, strict=True)), const(0.0)) / total
        fields.append((name, values[0] if same else mixed))
    return tuple(fields)


def _largest(materials: Sequence[Material], found: Sequence[Material], shares: Sequence[Expr]) -> Expr:
    """The index of the material with the largest share."""
    best, index = const(-1.0), const(0.0)
    for material, weight in _summed(found, shares).items():
        index = where(best < weight, float(materials.index(material)), index)
        best = where(best < weight, weight, best)
    return index


def _summed(keys: Sequence[Key], shares: Sequence[Expr]) -> dict[Key, Expr]:
    """How much of each is seen at a point of the surface."""
    weights = {key: const(0.0) for key in keys}
    for key, share in zip(keys, shares, strict=False):  # a single share stands for all, which are equal
        weights[key] = weights[key] + share
    return weights


def modules(scene: Scene, shaded: bool, colored: bool) -> list[tuple[str, str]]:
    """The modules that shade, each with its reason.

    shaded : surfaces are lit. colored : a picture is drawn, lit or not.
    """
    found: list[tuple[str, str]] = []
    add = found.append
    if shaded:
        add(("material/phong", "lights shade materials"))
        add(("light/phong", "lights shade materials"))
        for kind, module in ((Sun, "light/sun"), (PointLight, "light/point")):
            first = next((light for light in scene.lights if isinstance(light, kind)), None)
            if first is not None:
                add((module, f"{kind.__name__} at {first.where}"))
        casters = [light for light in scene.lights if light.shadow]
        if casters:
            add(("light/shadow", f"{len(casters)} of {len(scene.lights)} lights cast a shadow"))
        for kind, module in ((Sun, "light/sun_shadow"), (PointLight, "light/point_shadow")):
            first = next((light for light in casters if isinstance(light, kind)), None)
            if first is not None:
                add((module, f"{kind.__name__} at {first.where} casts a shadow"))
    if colored:
        add(("sky/constant", "what is seen where nothing is hit"))
        if scene.fog is not None:
            add(("sky/fog", "Scene(fog=...)"))
    return found


def features(scene: Scene) -> list[Feature]:
    """What there is of lights, shadows, materials and fog, used or not."""
    suns = [light for light in scene.lights if isinstance(light, Sun)]
    points = [light for light in scene.lights if isinstance(light, PointLight)]
    casters = [light for light in scene.lights if light.shadow]
    others = len(scene.materials) - 1
    found: list[Feature] = []

    def feature(name: str, used: bool, yes: str, no: str, where_: Location | None = None) -> None:
        found.append(Feature(name, used, yes if used else no, where_ if used else None))

    count = f"{len(suns)} in the scene"
    feature("sun light", bool(suns), count, "no Sun in the scene", suns[0].where if suns else None)
    count = f"{len(points)} in the scene"
    feature("point lights", bool(points), count, "no PointLight in the scene", points[0].where if points else None)
    feature(
        "hard shadows",
        bool(casters),
        f"{len(casters)} of {len(scene.lights)} lights cast one",
        "no light has shadow=True",
        casters[0].where if casters else None,
    )
    feature("materials", others > 0, f"{others} besides the default", "no node has a material")
    feature("fog", scene.fog is not None, "Scene(fog=...)", "Scene has no fog")
    return found
