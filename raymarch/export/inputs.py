"""What the texts of a scene for other programs have in common: their plan, their inputs, and their data."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from raymarch.errors import Location, PlanError
from raymarch.expr.atlas import Atlas
from raymarch.expr.glsl import TIME
from raymarch.expr.node import Expr
from raymarch.expr.pieces import literal
from raymarch.expr.samples import Samples
from raymarch.expr.tables import Table
from raymarch.expr.texels import Texels
from raymarch.expr.walk import find
from raymarch.plan import Plan, lights, plan
from raymarch.plan.gather import gather
from raymarch.prices import STANDARD
from raymarch.scene.parameter import Spec, Values
from raymarch.scene.quality import SINGLE_PASS
from raymarch.scene.reading import exact_distance
from raymarch.scene.scene import Scene, all_nodes, check_scene
from raymarch.shader import Shader, assemble
from raymarch.shader.standalone import FRAME

SIZE = (640.0, 360.0)
"""Initial value of the uniform of the size."""

SMALL = 4096
"""Sampled data, tables and lights with up to this many numbers in all are constants of a text."""

LIGHTS = "u_lights"
"""The texture of the lights."""


@dataclass(frozen=True, slots=True)
class Text:
    """A text for another program.

    arrays : what the program must put into textures, by the names of the samplers; level K of a picture is "NAME.K".
    """

    text: str
    arrays: Mapping[str, NDArray[Any]] = field(default_factory=dict)


MOST_AS_TEXT = 256
"""Objects that a form with textures holds as text: compilers take some ten seconds for them."""


def alone(scene: Scene) -> Scene:
    """The scene with a quality that draws one picture in one pass, without earlier frames."""
    return scene.replace(quality=scene.quality.replace(**SINGLE_PASS, rays="computed"))


def planned(scene: Scene, chosen: str, textures: bool = False) -> Plan:
    """A plan of one pass for a text. Objects are text, unless there are many and the form has textures for rows."""
    check_scene("export", scene)
    scene = alone(scene)
    many = textures and gather(scene.node, "auto", exact_distance(scene), live=False).data > MOST_AS_TEXT
    if scene.quality.objects == "auto" and not many:
        scene = scene.replace(quality=scene.quality.replace(objects="text"))
    return plan(scene, (chosen,), standalone=True)


def shader_of(made: Plan, host: Mapping[str, str] = MappingProxyType({})) -> Shader:
    """The shader of a plan, with its small data as constants. host : see `assemble`."""
    small: dict[str, int] = {
        data.name: int(np.size(data.values)) for data in made.textures if isinstance(data, Samples | Table)
    }
    if made.lights_as_data:
        small[LIGHTS] = 4 * lights.table(made.scene).texels * len(made.scene.lights)
    found, total = set(), 0
    for name, size in sorted(small.items(), key=lambda entry: entry[1]):
        total += size
        if total <= SMALL:
            found.add(name)
    return assemble(made, host, frozenset(found))


def declarations(made: Plan, shader: Shader, values: Values) -> dict[str, str]:
    """The lines that replace uniforms in every text: variables of a frame, and constant data."""
    declared = {line.uniform.name: line.text for line in shader.body if line.uniform}
    lines = {name: text.removeprefix("uniform ") for name, text in declared.items() if is_own(name)}
    return lines | sky_light(made) | _constants(made, shader, values)


def is_own(name: str) -> bool:
    """True if a uniform of a renderer is a variable of a standalone shader."""
    return name in FRAME or name.startswith("u_hoisted_")


def inputs(made: Plan, shader: Shader, values: Values) -> Iterator[tuple[str, str, str, str]]:
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
    """The declaration of the sky's spherical harmonics as a constant, if the shader reads them."""
    if not made.sky_light:
        return {}
    colors = ", ".join(map(number_text, harmonics(made)))
    return {"u_sky_light": f"const vec3 u_sky_light[9] = vec3[9]({colors});"}


def harmonics(made: Plan) -> list[tuple[float, ...]]:
    """The nine coefficients of the sky's spherical harmonics.

    Raises PlanError if they depend on time or a parameter.
    """
    sky = made.scene.sky
    if find(sky.expressions, "time", "param"):
        kind = f"{type(sky).__name__}(light={'True' if sky.light is True else '...'})"
        raise PlanError(
            f"{kind} depends on time or a Param, and an exported shader has its light as a constant",
            legal="a sky that does not change, or light=False",
            where=sky.where,
        )
    return [tuple(map(float, row)) for row in sky.harmonics(Values({}))]


def light_rows(made: Plan, values: Values) -> NDArray[np.float32]:
    """The lights of a scene as rows of texels, (lights, texels, 4). PlanError if one depends on time or a parameter."""
    for light in made.scene.lights:
        if find(light.expressions, "time", "param"):
            raise PlanError(
                f"{len(made.scene.lights)} lights, one of which depends on time or a Param: an export has more than "
                f"{STANDARD.lights} lights as constants",
                legal=f"lights that do not change, or up to {STANDARD.lights}",
                where=light.where,
            )
    return lights.rows(made.scene, values)


def _constants(made: Plan, shader: Shader, values: Values) -> dict[str, str]:
    """The declarations of data that is constant: one array, and where each part starts in it."""
    numbers: list[str] = []
    lines: dict[str, str] = {}
    for name in sorted(shader.constants - {LIGHTS}):
        data = shader.samples[name]
        sizes = [len(numbers), *(data.size if isinstance(data, Samples) else ())]
        kind = "int" if len(sizes) == 1 else f"ivec{len(sizes)}"
        value = str(sizes[0]) if len(sizes) == 1 else f"{kind}({', '.join(map(str, sizes))})"
        lines[name] = f"const {kind} {name} = {value};  // {data.label}"
        numbers += [literal(float(number)) for number in np.ravel(data.values)]  # type: ignore[union-attr]
    if lines:
        first = next(name for name in shader.uniforms if name in lines)
        lines[first] = f"{_numbers(numbers)}\n{lines[first]}"
    if LIGHTS in shader.constants:
        rows = [number_text(tuple(map(float, texel))) for texel in light_rows(made, values).reshape(-1, 4)]
        lines[LIGHTS] = _array("vec4", LIGHTS, rows)
    return lines


BLOCK: Final = 256  # vec4 of one array: the compiler of NVIDIA refuses constructors of some thousand numbers


def _numbers(numbers: list[str]) -> str:
    """Arrays that hold some numbers, four in a vec4 (a float alone would take the place of a vec4), and the function
    that reads one of them."""
    padded = numbers + ["0.0"] * (-len(numbers) % 4)
    rows = [f"vec4({', '.join(padded[i : i + 4])})" for i in range(0, len(padded), 4)]
    blocks = [rows[i : i + BLOCK] for i in range(0, len(rows), BLOCK)]
    arrays = [_array("vec4", f"constant_numbers_{k}", block) for k, block in enumerate(blocks)]
    last = len(blocks) - 1
    reads = [f"    if (i < {4 * BLOCK * (k + 1)}) return constant_numbers_{k}[{_row(k)}][i & 3];" for k in range(last)]
    reads.append(f"    return constant_numbers_{last}[{_row(last)}][i & 3];")
    return "\n".join([*arrays, "float constant_number(int i) {", *reads, "}"])


def _row(block: int) -> str:
    return f"(i >> 2) - {BLOCK * block}" if block else "i >> 2"


def _array(kind: str, name: str, parts: list[str]) -> str:
    """The declaration of a constant array, in lines of at most 120 characters."""
    lines, line = [], "   "
    for i, part in enumerate(parts):
        piece = f" {part}{',' if i < len(parts) - 1 else ''}"
        if len(line) + len(piece) > 118:
            lines.append(line)
            line = "   "
        line += piece
    return "\n".join([f"const {kind} {name}[{len(parts)}] = {kind}[{len(parts)}](", *lines, f"{line});"])


def textures(made: Plan, shader: Shader, values: Values) -> Iterator[tuple[str, str, list[NDArray[Any]]]]:
    """The data that a text does not hold: the name of the sampler, what it is, and its arrays, one for each level."""
    for name, data in shader.samples.items():
        if name in shader.constants:
            continue
        if isinstance(data, Texels):
            wrap = "repeat" if data.wrap == "repeat" else "clamp to edge"
            how = f"{data.channels} half floats, {len(data.levels)} levels, filtered linearly, {wrap}"
            yield name, f"{data.label}: {' x '.join(map(str, data.size))}, {how}", list(data.levels)
        else:
            extent, channels, content = data.texture()
            array = np.frombuffer(content, np.float32).reshape(*extent[::-1], channels)
            corners = ", the corners of a cell" if isinstance(data, Samples) and data.dimension == 2 else ""
            floats = f"{channels} floats{corners}" if channels > 1 else "a float each"
            yield name, f"{data.label}: {' x '.join(map(str, extent))}, {floats}, nearest texel", [array]
    if made.lights_as_data and LIGHTS not in shader.constants:
        rows = light_rows(made, values)
        yield LIGHTS, f"lights: {rows.shape[1]} x {rows.shape[0]}, 4 floats, nearest texel", [rows]


def refuse_textures(made: Plan, shader: Shader, form: str) -> None:
    """PlanError if the shader reads textures that a text cannot hold."""
    if made.lights_as_data and LIGHTS not in shader.constants:
        what = f"{len(made.scene.lights)} lights with more than {SMALL} numbers: a {form} file holds no textures"
        raise PlanError(what, legal="fewer lights, or a .html page", where=made.scene.lights[-1].where)
    for data in made.textures:
        if data.name not in shader.constants:
            what = f"{data.label}: a {form} file holds no textures, and up to {SMALL} numbers of sampled data"
            fewer = "a smaller resolution= of text, image or mesh; " if isinstance(data, Samples) else ""
            raise PlanError(what, legal=f"{fewer}a .html page, or a .glsl file", where=_place_of(made.scene, data))


def _place_of(scene: Scene, data: Any) -> Location | None:
    """The user's line of the part that reads a texture."""

    def reads(expressions: list[Expr]) -> bool:
        read = data.pictures if isinstance(data, Atlas) else (data,)
        return any(node.data in read for node in find(expressions, "texture", "sample", "sample_slope"))

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
