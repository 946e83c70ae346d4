"""The plan between a scene and its shader.

It decides what is in the shader at all. What is not called for is not in the text; `explain` says why.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from dataclasses import field as default

import numpy as np

from raymarch.errors import Location, PlanError
from raymarch.expr.derivative import companion
from raymarch.expr.function import Function
from raymarch.expr.glsl import Record
from raymarch.expr.node import Expr
from raymarch.expr.walk import find, topological
from raymarch.plan import lights, shading
from raymarch.plan.feature import Feature
from raymarch.scene.parameter import Spec
from raymarch.scene.scene import Scene, all_nodes
from raymarch.sdf.lower import Lowering

OUTPUTS = ("color", "depth", "normal", "iterations", "evaluations", "residual", "material")
"""The arrays that a frame can hold."""

LARGEST = 1024
"""Shapes that a field may have as text. Beyond this, compilers take many seconds or fail."""


@dataclass(frozen=True, slots=True)
class Pass:
    """One draw of the full-screen quad: its outputs, and how many colour textures it fills."""

    name: str
    module: str
    textures: int
    reason: str


PASSES = {
    "color": Pass("color", "view/color", 1, "the picture"),
    "geometry": Pass("geometry", "view/geometry", 2, "depth, normal, material or counts were asked for"),
}


@dataclass(slots=True)
class Plan:
    """What is to be compiled and drawn for a scene."""

    scene: Scene
    field: Function
    gradient: Function | None
    material: Record | None
    material_index: Function | None
    emission: Function | None
    model: str
    origins: dict[Expr, Location]
    passes: list[Pass]
    modules: list[tuple[str, str]]
    features: list[Feature]
    parameters: dict[str, Spec]
    tracer: str
    tracer_reason: str
    shapes: int
    nodes: int
    operations: int
    warnings: list[str] = default(default_factory=list)

    @property
    def certified(self) -> bool:
        """True if the field is no larger than the distance, so that nothing is stepped over."""
        return self.scene.node.exactness != "estimate"

    @property
    def epsilon(self) -> float:
        """How near a ray comes, in pixel widths, before it looks for its hit."""
        return self.scene.quality.near(self.certified)

    @property
    def lights_as_data(self) -> bool:
        """True if the lights are rows of a texture rather than text."""
        return self.material is not None and lights.as_data(self.scene)

    @property
    def clipped(self) -> bool:
        """True if the scene's box bounds the rays on some side."""
        facts = self.scene.node.facts
        return bool(np.any(np.isfinite(facts.lower)) or np.any(np.isfinite(facts.upper)))


def plan(scene: Scene, passes: Sequence[str] = ("color",)) -> Plan:
    """Plan a scene. PlanError for clashing parameters or a field that is too large."""
    lowering = Lowering()
    definition = lowering.field(scene.node)
    shapes = len(lowering.shapes)
    if shapes > LARGEST:
        raise PlanError(
            f"the field has {shapes} shapes, too many to compile as text",
            legal=f"up to {LARGEST} distinct shapes; `repeat` makes copies of one",
            where=scene.node.where,
        )
    lit = shading.lit(scene)
    chosen = [PASSES[name] for name in passes]
    geometry = any(p.name == "geometry" for p in chosen)
    tracer, reason = _choose_tracer(scene)
    made = Plan(
        scene=scene,
        field=definition,
        gradient=None,
        material=None,
        material_index=None,
        emission=None,
        model="phong",
        origins=lowering.origins,
        passes=chosen,
        modules=[],
        features=[],
        parameters=scene.parameters,
        tracer=tracer,
        tracer_reason=reason,
        shapes=shapes,
        nodes=len(all_nodes(scene.node)),
        operations=_operations(definition),
    )
    shaded = lit and any(p.name == "color" for p in chosen)
    needs_normal = (shaded and bool(scene.lights)) or geometry
    if needs_normal and scene.quality.normals == "analytic":
        made.gradient = companion(definition)
    if shaded or geometry:
        looks = shading.looks(scene, lowering, shaded, geometry)
        made.model, made.material, made.emission = looks.model, looks.record, looks.emission
        made.material_index = looks.index
    _choose_modules(made, shaded, needs_normal)
    _describe_effects(made)
    made.warnings += _warnings(scene)
    return made


MODULES = {"relaxed_again": "relaxed"}
"""Tracers whose module has another name."""


def _choose_tracer(scene: Scene) -> tuple[str, str]:
    """The tracer and why."""
    asked = scene.quality.tracer
    if scene.node.exactness == "estimate":
        if asked not in ("auto", "plain"):
            return "plain", f"the field is an estimate, on which Quality(tracer={asked!r}) would be fooled"
        return "plain", "the field is an estimate, which proves no longer step"
    if asked == "auto":
        return "auto_relaxed", "the field is certified, so a step is as long as its spheres prove"
    return asked, f"Quality(tracer={asked!r})"


def _operations(definition: Function) -> int:
    """Arithmetic operations of one evaluation, functions counted at each call; loops count once a turn."""
    costs: dict[object, int] = {}

    def cost(roots: Sequence[Expr]) -> int:
        total = 0
        for node in topological(roots):
            if node.op == "call":
                if node.data not in costs:
                    costs[node.data] = cost(node.data.inner)
                total += costs[node.data]
            elif node.op == "loop":
                total += node.data.count * cost(node.data.inner)
            elif node.op not in ("const", "var", "param", "time", "swizzle", "item", "construct", "columns"):
                total += max(a.type.size for a in node.args) if node.args else 1
        return total

    return cost([definition.body])


def _choose_modules(made: Plan, shaded: bool, needs_normal: bool) -> None:
    scene, add = made.scene, made.modules.append
    quality = scene.quality
    add(("view/camera", "every picture has a camera"))
    add(("march/epsilon", f"a ray looks for its hit within {made.epsilon:g} pixel widths of a surface"))
    add(("march/hit", "the last step towards a surface is along the measured slope"))
    add((f"march/{MODULES.get(made.tracer, made.tracer)}", made.tracer_reason))
    if made.clipped:
        below, above = np.isfinite(scene.node.facts.upper), np.isfinite(scene.node.facts.lower)
        add(("march/below", "the scene's box ends on some side"))
        if np.any(above):
            add(("march/above", "the scene's box ends below on some axis"))
        if np.any(above & below):
            add(("march/slab", "the scene's box has two ends on some axis"))
        add(("march/clipped", "rays are marched inside the scene's box only"))
    else:
        add(("march/whole", "the scene's box has no end on any side"))
    if needs_normal:
        add((f"normal/{quality.normals}", f"Quality(normals={quality.normals!r})"))
    made.modules += shading.modules(scene, made.model if shaded else None, any(p.name == "color" for p in made.passes))
    for chosen in made.passes:
        add((chosen.module, chosen.reason))


def _describe_effects(made: Plan) -> None:
    scene = made.scene

    def feature(name: str, used: bool, yes: str, no: str) -> None:
        made.features.append(Feature(name, used, yes if used else no))

    made.features += shading.features(scene)
    feature("ray clipping", made.clipped, "the scene's box ends on some side", "the scene has no end on any side")
    animated = bool(find(scene.expressions(), "time"))
    feature("time", animated, "the scene reads time", "nothing reads time")
    feature("parameters", bool(made.parameters), f"{len(made.parameters)} uniforms", "no Param is used")
    geometry = any(p.name == "geometry" for p in made.passes)
    feature("geometry pass", geometry, "arrays beyond colour were asked for", "only the picture was asked for")
    feature("anti-aliasing", False, "", "one ray a pixel")
    feature("history textures", False, "", "nothing in this scene is accumulated over frames")
    made.features.sort(key=lambda f: not f.used)


def _warnings(scene: Scene) -> list[str]:
    """What is legal but may not be what was meant."""
    found = []
    if scene.node.facts.empty:
        found.append("the solid is empty: its operands' boxes do not meet")
    if scene.node.exactness == "estimate":
        found.append("the field is an estimate: nothing guarantees that no surface is missed")
    for node in all_nodes(scene.node):
        if node.name in ("round", "shell") and node.children[0].exactness != "exact":
            place = f" at {node.where}" if node.where else ""
            found.append(
                f"{node.name}{place} acts on a {node.children[0].exactness} field ({node.children[0].name}): "
                "the surface moves by less than was asked where that is loose"
            )
    return found
