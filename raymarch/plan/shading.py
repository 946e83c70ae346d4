"""What the look of a scene calls for: how materials mix, which modules shade them, and what `explain` says of it."""

from __future__ import annotations

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
from raymarch.sdf.lower import Lowering


def materials(scene: Scene, lowering: Lowering, look: bool, index: bool) -> tuple[Record | None, Function | None]:
    """How a surface looks, and which material it is of: mixed by how much each part moves the field at the hit.

    look, index : which of the two functions is needed; the other is None.
    """
    materials = scene.materials
    looks, chosen = None, None
    marked = lowering.again().field(scene.node, label=materials[0])
    marks = find([marked.body], "mark")
    used = list(dict.fromkeys(mark.data for mark in marks))
    if len(used) > 1:
        weights = _weights(marked, marks, used)
        total = sum(weights.values(), const(0.0))
        total = where(total <= 0.0, 1.0, total)
        fields = []
        for k, name in enumerate(Material.FIELDS):
            values = [m.expressions[k] for m in used]
            same = all(v is values[0] for v in values)
            mixed = sum((weights[m] * v for m, v in zip(used, values, strict=True)), const(0.0)) / total
            fields.append((name, values[0] if same else mixed))
    else:
        only = used[0] if used else materials[0]
        fields = list(zip(Material.FIELDS, only.expressions, strict=True))
        weights = {only: const(1.0)}
    if look:
        looks = Record("material_at", "Material", marked.params, tuple(fields))
    if index:
        best, found = const(-1.0), const(0.0)
        for m, weight in weights.items():
            found = where(best < weight, float(materials.index(m)), found)
            best = where(best < weight, weight, best)
        chosen = Function("material_index", marked.params, found)
    return looks, chosen


def _weights(marked: Function, marks: list[Expr], used: list[Material]) -> dict[Material, Expr]:
    """How much of each material is seen at a point of the surface."""
    parts = sensitivities(marked.body, marks)
    weights = {m: const(0.0) for m in used}
    for mark, part in zip(marks, parts, strict=True):
        weights[mark.data] = weights[mark.data] + abs(part)
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
