"""The generated part of shading: the colour of a hit from the scene's lights and fog."""

from __future__ import annotations

from raymarch.errors import Location
from raymarch.expr.function import Function
from raymarch.expr.glsl import constant
from raymarch.expr.node import Expr
from raymarch.plan import Plan
from raymarch.scene.light import Light, PointLight, Sun
from raymarch.shader.chunk import Chunk, Mapped


class Values:
    """Values of the scene that the shader asks for by name: literals where they are constant, else functions."""

    def __init__(self) -> None:
        self.functions: list[Function] = []

    def add(self, name: str, value: Expr, where: Location | None) -> None:
        self.functions.append(Function(name, (), value, where=where))

    def text(self, name: str, value: Expr, where: Location | None) -> str:
        if value.is_constant:
            return constant(value)
        self.add(name, value, where)
        return f"{name}()"


def shading(plan: Plan, values: Values) -> Chunk:
    """The colour of a hit: each light in turn, a shadow only where it casts one, then fog.

    What it reads of the scene by name goes into `values`.
    """
    needs = {"Ray", "Hit"}
    lines = [Mapped("vec3 shade(Ray ray, Hit hit) {", "the scene's lights")]
    lit = plan.material is not None and bool(plan.scene.lights)
    if lit:
        needs |= {"surface_normal", "material_at", "u_side"}
        for text in (
            "    vec3 p = ray.origin + hit.t * ray.direction;",
            "    vec3 normal = u_side * surface_normal(p, ray.direction);",
            "    Material material = material_at(p);",
        ):
            lines.append(Mapped(text, "the scene's lights"))
    lines.append(Mapped("    vec3 color = vec3(0.0);", "the scene's lights"))
    for i, light in enumerate(plan.scene.lights if lit else ()):
        call, used = _light_call(i, light, values)
        needs |= used
        lines.append(Mapped(f"    color += {call};", f"{type(light).__name__}", light.where))
    if plan.scene.fog is not None:
        needs.add("through_fog")
        lines.append(Mapped("    color = through_fog(color, hit.t);", "Scene(fog=...)", plan.scene.where))
    lines += [Mapped("    return color;", "the scene's lights"), Mapped("}", "the scene's lights")]
    values.add("sky_color", plan.scene.sky.color, plan.scene.where)
    if plan.scene.fog is not None:
        values.add("fog_color", plan.scene.fog.color, plan.scene.where)
        values.add("fog_density", plan.scene.fog.density, plan.scene.where)
    return Chunk("shade", frozenset(needs), frozenset({"shade"}), tuple(lines))


def _light_call(i: int, light: Light, values: Values) -> tuple[str, set[str]]:
    radiance = values.text(f"light_{i}_radiance", light.radiance, light.where)
    if isinstance(light, Sun):
        kind, place = "sun", values.text(f"light_{i}_direction", light.direction, light.where)
        before = "material, normal, -ray.direction"
    else:
        assert isinstance(light, PointLight)
        kind, place = "point", values.text(f"light_{i}_position", light.position, light.where)
        before = "material, p, normal, -ray.direction"
    used = {f"{kind}_light"}
    visibility = "1.0"
    if light.shadow:
        visibility = f"{kind}_shadow(p, normal, hit.t, {place})"
        used.add(f"{kind}_shadow")
    return f"{kind}_light({before}, {place}, {radiance}, {visibility})", used
