"""A scene as a shader of Godot 4: a canvas_item shader for a ColorRect over the screen.

Godot has no variables outside of functions, so those of the shader are a struct, which its functions pass on.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from raymarch.export.inputs import Text
from raymarch.export.translated import PIXEL, Declared, Input, Translated, closing, translated
from raymarch.expr.glsl import TIME
from raymarch.scene.parameter import Values
from raymarch.scene.scene import Scene

STATE = "state"
"""The parameter of functions that read or write the variables of the shader."""

HEAD = """shader_type canvas_item;
// A scene of raymarch for Godot 4.4 or later: the material of a ColorRect that fills the screen.
// It draws the picture in sRGB; a viewport with HDR 2D needs `in_linear`.

uniform bool in_linear = false;
"""

SIZE = """// Size of the rectangle in pixels; (0, 0) is that of the screen.
uniform vec2 rect_size = vec2(0.0, 0.0);
"""

MAIN = """
vec3 decoded(vec3 c) {
    return mix(pow((c + 0.055) / 1.055, vec3(2.4)), c / 12.92, lessThan(c, vec3(0.04045)));
}

void fragment() {
    State state;
SET
    vec3 color = picture(state, pixel);
    COLOR = vec4(in_linear ? decoded(color) : color, 1.0);
}
"""


def text_of(scene: Scene, values: Values) -> Text:
    """The shader. Its uniforms have the given values initially.

    Raises PlanError for textures, and for lights and a sky light that change.
    """
    made = translated(scene, values, ".gdshader")
    variables = [part for part in made.parts if part.kind == "variable" and part.type != "const"]
    own = {part.name: part.type for part in variables}
    own |= {each.name: each.type for each in made.inputs if each.name in ("u_resolution", TIME)}
    passing = _passing(made.parts, own)
    lines = [HEAD, *map(_uniform, made.inputs), SIZE]
    structs = [part for part in made.parts if part.kind == "struct"]
    lines += ["".join(part.words).strip() + "\n" for part in structs]
    lines += ["struct State {", *(f"    {kind} {name};" for name, kind in own.items()), "};\n"]
    for part in made.parts:
        if part.kind != "struct" and part not in variables:
            lines.append("".join(_threaded(part, own, passing)).strip("\n") + "\n")
    return Text("\n".join(lines) + _main(made, variables))


def _uniform(given: Input) -> str:
    if given.name == "u_resolution":
        return ""
    if given.name == TIME:
        start = f"// Seconds at the start, and whether time goes on.\nuniform float start = {given.value};"
        return f"{start}\nuniform bool playing = true;\n"
    spec, hint = given.spec, ""
    if spec is not None and isinstance(spec.min, float | int) and isinstance(spec.max, float | int):
        low, high = float(spec.min), float(spec.max)
        hint = f" : hint_range({low!r}, {high!r}, {(high - low) / 1000!r})" if given.type == "float" else ""
    return f"// {given.note[0].upper()}{given.note[1:]}.\nuniform {given.type} {given.name}{hint} = {given.value};\n"


def _passing(parts: Sequence[Declared], own: Mapping[str, str]) -> set[str]:
    """The functions that read or write the variables, themselves or by what they call."""
    functions = [part for part in parts if part.kind == "function"]
    found: set[str] = set()
    while True:
        more = {part.name for part in functions if part.names & (own.keys() | found)} - found
        if not more:
            return found
        found |= more


def _threaded(part: Declared, own: Mapping[str, str], passing: set[str]) -> list[str]:
    """The words of a part in which the variables are fields, and calls pass the struct on."""
    words, made, defined = list(part.words), [], False
    for i, word in enumerate(words):
        before = words[i - 1] if i else ""
        if word in own and before != ".":
            made.append(f"{STATE}.{word}")
        elif word in passing and before != "." and words[i + 1] == "(":
            given = f"inout State {STATE}" if not defined and part.name == word else STATE
            empty = closing(words, i + 1) == i + 2
            words[i + 1] = f"({given}" if empty else f"({given}, "
            made.append(word)
        else:
            made.append(word)
        defined = defined or word == part.name
    return made


def _main(made: Translated, variables: Sequence[Declared]) -> str:
    lines = [f"{STATE}.{part.name} {''.join(part.initial).strip()}" for part in variables if "=" in part.words]
    lines.append(f"{STATE}.u_resolution = rect_size.x > 0.0 ? rect_size : 1.0 / SCREEN_PIXEL_SIZE;")
    lines.append(f"vec2 pixel = vec2(UV.x, 1.0 - UV.y) * {STATE}.u_resolution;")
    lines += [f"{STATE}.{PIXEL} = pixel;"] if any(part.name == PIXEL for part in variables) else []
    if any(each.name == TIME for each in made.inputs):
        lines.append(f"{STATE}.{TIME} = start + (playing ? TIME : 0.0);")
    return MAIN.replace("SET", "\n".join(f"    {line}" for line in lines))
