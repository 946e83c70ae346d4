"""Generated code around the shading of surfaces: rays that hit nothing, and fog up to the first surface."""

from __future__ import annotations

from raymarch.expr.function import Function
from raymarch.expr.pieces import literal
from raymarch.expr.walk import free_variables
from raymarch.plan import Plan
from raymarch.plan.lights import visible
from raymarch.scene.fog import COLOR, LENGTH, ORIGIN, SKY_DISTANCE
from raymarch.scene.scene import Scene
from raymarch.scene.sky import DIRECTION, MEAN
from raymarch.shader.chunk import Chunk, Lines, Mapped, Values
from raymarch.shader.lights import visible_light


def sky_functions(plan: Plan) -> list[Function]:
    """The functions of the sky, its mean and the fog."""
    scene = plan.scene
    found = [scene.sky.function(scene.where), *([MEAN] if plan.sky_light else [])]
    if scene.sky.apart and (plan.sky_light or scene.bouncing):
        found.append(scene.sky.lighting_function(scene.where))
    return found if scene.fog is None else [*found, _fog(scene)]


def sky_light() -> Chunk:
    """The coefficients of the sky's mean; see `raymarch.scene.sky.HARMONICS`."""
    return Chunk.of("sky light", [Mapped.declare("vec3[9]", "u_sky_light", "the sky's light")])


def _fog(scene: Scene) -> Function:
    assert scene.fog is not None
    made = scene.fog.applied(scene.sky, scene.lights, scene.where)
    read = free_variables([made])
    return Function(
        "apply_fog", tuple(p for p in (COLOR, ORIGIN, DIRECTION, LENGTH) if p in read), made, {}, scene.where
    )


def _applied(scene: Scene, color: str, origin: str, direction: str, length: str) -> str:
    if scene.camera.clips and scene.fog is not None and scene.fog.box is not None:
        origin, length = f"{origin} + planes.x * {direction}", f"min({length}, planes.y) - planes.x"
    texts = {COLOR: color, ORIGIN: origin, DIRECTION: direction, LENGTH: length}
    return f"apply_fog({', '.join(texts[p] for p in _fog(scene).params)})"


def begin_shade(text: Lines, plan: Plan, values: Values, bounces: bool = False, shows_sky: bool = True) -> None:
    """The beginning of `shade`. If `bounces`, `ray` is reused: what the fog reads of it is kept.

    shows_sky : whether a ray that hits nothing ends here.
    """
    scene = plan.scene
    visible_light(text, plan, values)
    sky = "sky(ray.direction)"
    if scene.fog is not None and scene.fog.covers_sky:
        sky = _applied(scene, sky, "ray.origin", "ray.direction", literal(SKY_DISTANCE))
    text.add("vec3 shade(Ray ray, Hit hit) {")
    if scene.camera.clips:  # surfaces are hit between the planes, but lights and matter may lie elsewhere
        text.add(f"    vec2 planes = between_planes(ray, {literal(SKY_DISTANCE)});")
    if visible(scene):
        seen, found = "shown.rgb", "visible_light(ray, hit, 0.0)"
        if scene.fog is not None:
            seen = _applied(scene, seen, "ray.origin", "ray.direction", "shown.w")
        if scene.camera.clips:
            text.add("    Hit last = hit;", f"    last.found = hit.found || planes.y < {literal(SKY_DISTANCE)};")
            text.add("    last.t = (hit.found ? hit.t : planes.y) - planes.x;")
            found = "visible_light(Ray(ray.origin + planes.x * ray.direction, ray.direction), last, planes.x)"
        text.add(f"    vec4 shown = {found};", "    if (shown.w >= 0.0) {")
        text.add(*["        shown.w += planes.x;"] * scene.camera.clips, f"        return {seen};", "    }")
    if shows_sky:
        text.add(f"    if (!hit.found) return {sky};")
    if bounces:
        read = _fog(scene).params if scene.fog is not None else ()
        for p, line in ((ORIGIN, "vec3 eye = ray.origin;"), (DIRECTION, "vec3 view = ray.direction;")):
            if p in read:
                text.add(f"    {line}", by="Scene(fog=...)", where=scene.where)
        text.add("    vec3 color = vec3(0.0);", "    float first = hit.t;")


def end_shade(text: Lines, scene: Scene, length: str, origin: str = "eye", direction: str = "view") -> None:
    """The end of `shade`: fog over a length along the camera ray."""
    if scene.fog is not None:
        line = f"    color = {_applied(scene, 'color', origin, direction, length)};"
        text.add(line, by="Scene(fog=...)", where=scene.where)
    text.add("    return color;", "}")
