"""A scene as the text of a fragment shader for other programs: GLSL 330 core, or Shadertoy.

The shader draws the picture for the screen in one pass: all samples, tone mapped and encoded in sRGB. It computes the
camera itself.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from raymarch.errors import Location, PlanError
from raymarch.expr.glsl import TIME, literal
from raymarch.expr.node import Expr
from raymarch.expr.walk import find
from raymarch.plan import Plan, plan
from raymarch.scene.parameter import Spec, Values
from raymarch.scene.scene import Scene, all_nodes, check_scene
from raymarch.shader import Shader, assemble
from raymarch.shader.assemble import HEADERS
from raymarch.shader.standalone import FRAME

SIZE = (640.0, 360.0)
"""Initial value of the uniform of the size."""

SHADERTOY: Mapping[str, str] = {
    "u_resolution": "iResolution.xy",
    TIME: "iTime",
    "u_orbit": "iMouse.x + iMouse.y < 2.0 ? vec3(0.0) : "
    "vec3(vec2(-6.2831853, -3.1415927) * (iMouse.xy / iResolution.xy - 0.5), 0.0)",
}
"""The values that Shadertoy gives: size, time, and the mouse, which orbits."""


def alone(scene: Scene) -> Scene:
    """The scene with a quality that draws one picture in one pass, without earlier frames."""
    single = {"schedule": "single", "steps_per_pass": None, "temporal": "off", "rays": "computed"}
    return scene.replace(quality=scene.quality.replace(**single))


def glsl_text(scene: Scene, values: Values) -> str:
    """A fragment shader in GLSL 330 core, whose uniforms have the given values initially.

    Raises PlanError for a scene that reads textures or whose sky light changes.
    """
    made = _planned(scene, "standalone", ".glsl")
    shader = assemble(made)
    lines = {name: f"{kind.partition('[')[0]} {name};" for name, kind in shader.uniforms.items() if is_own(name)}
    comment = []
    for name, kind, value, note in _inputs(made, shader, values):
        lines[name] = f"uniform {kind} {name} = {value};"
        comment.append(f"//   {kind} {name} = {value}: {note}")
    lines |= sky_light(made)
    head = [
        "// A scene of raymarch as one fragment shader. Draw it on a full screen; it writes sRGB.",
        "// Uniforms, with the values that they have initially:",
        *comment,
    ]
    body = shader.text(version="", declarations=lines)
    return "\n".join([*HEADERS["330 core"], *head, body])


def shadertoy_text(scene: Scene, values: Values) -> str:
    """A shader to paste into the tab "Image" of Shadertoy. Parameters are constants at the top; the mouse orbits.

    Raises PlanError as `glsl_text` does.
    """
    made = _planned(scene, "shadertoy", "Shadertoy")
    shader = assemble(made, SHADERTOY)
    lines = {}
    for name, kind in shader.uniforms.items():
        if is_own(name) or name in SHADERTOY:
            lines[name] = f"{kind} {name};"
    for name, kind, value, note in _inputs(made, shader, values):
        if name not in SHADERTOY:
            lines[name] = f"const {kind} {name} = {value};  // {note}"
    lines |= sky_light(made)
    head = "// A scene of raymarch for the tab Image of Shadertoy. Drag to orbit."
    return "\n".join([head, shader.text(version="", declarations=lines)])


def _planned(scene: Scene, chosen: str, form: str) -> Plan:
    check_scene("export", scene)
    scene = alone(scene)
    if scene.quality.objects == "auto":  # a text holds no rows of a texture
        scene = scene.replace(quality=scene.quality.replace(objects="text"))
    made = plan(scene, (chosen,), standalone=True)
    refuse_textures(made, form)
    return made


def is_own(name: str) -> bool:
    """True if a uniform of a renderer is a variable of a standalone shader."""
    return name in FRAME or name.startswith("u_hoisted_")


def _inputs(made: Plan, shader: Shader, values: Values) -> Iterator[tuple[str, str, str, str]]:
    """The inputs of a standalone shader: name, type, initial value as text, meaning."""
    uniforms = shader.uniforms
    own = {
        "u_resolution": (SIZE, "size of the picture in pixels"),
        TIME: (values.time, "time in seconds"),
        "u_orbit": ((0.0,) * 3, "turns the camera: to the side, upwards (radians), away (logarithm of a factor)"),
        "u_pan": ((0.0,) * 2, "moves the camera to the right and upwards, relative to the distance of the target"),
    }
    for name, (value, note) in own.items():
        if name in uniforms:
            yield name, uniforms[name], number_text(value), note
    for parameter, spec in made.parameters.items():
        name = shader.parameters.get(parameter, "")
        if name in uniforms:
            yield name, uniforms[name], number_text(values.params[parameter]), f"parameter '{parameter}'{_range(spec)}"


def _range(spec: Spec) -> str:
    ends = (f"{word} {number_text(end)}" for word, end in (("from", spec.min), ("to", spec.max)) if end is not None)
    return "".join(f" {end}" for end in ends)


def number_text(value: Any) -> str:
    """A number or vector as GLSL."""
    if isinstance(value, tuple):
        return f"vec{len(value)}({', '.join(literal(v) for v in value)})"
    return literal(value)


def sky_light(made: Plan) -> dict[str, str]:
    """The declaration of the sky's spherical harmonics as a constant, if the shader reads them.

    Raises PlanError if they depend on time or a parameter.
    """
    if not made.sky_light:
        return {}
    sky = made.scene.sky
    if find(sky.expressions, "time", "param"):
        raise PlanError(
            f"{type(sky).__name__}(light=True) depends on time or a Param, and an exported shader has its light as a "
            "constant",
            legal="a sky that does not change, or light=False",
            where=sky.where,
        )
    colors = ", ".join(number_text(tuple(map(float, row))) for row in sky.harmonics(Values({})))
    return {"u_sky_light": f"const vec3 u_sky_light[9] = vec3[9]({colors});"}


def refuse_textures(made: Plan, form: str) -> None:
    """PlanError if the shader reads textures: a text cannot hold them."""
    if made.lights_as_data:
        raise PlanError(
            f"{len(made.scene.lights)} lights, which are rows of a texture: a {form} file holds no textures",
            legal="up to 8 lights, or a .html page",
            where=made.scene.lights[-1].where,
        )
    for data in made.textures:
        raise PlanError(
            f"{data.label}: a {form} file holds no textures", legal="a .html page", where=_place_of(made.scene, data)
        )


def _place_of(scene: Scene, data: Any) -> Location | None:
    """The user's line of the part that reads a texture."""

    def reads(expressions: list[Expr]) -> bool:
        return any(node.data == data for node in find(expressions, "texture", "sample", "sample_slope"))

    for material in scene.materials:
        if reads(list(material.expressions)):
            return material.where
    if reads(scene.sky.expressions):
        return scene.sky.where
    for node in all_nodes(scene.node):
        given = [v for v in node.params.values() if isinstance(v, Expr)]
        if reads(given) or (
            node.definition.arity != "many" and reads([node.definition.template(len(node.children), node.params).body])
        ):
            return node.where
    return scene.node.where
