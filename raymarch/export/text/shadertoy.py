"""A scene as text for Shadertoy: the tab Image, and Buffer A where samples add up over frames."""

from __future__ import annotations

from collections.abc import Mapping

from raymarch.export.inputs import Text, declarations, inputs, planned, refuse_textures, shader_of
from raymarch.expr.glsl import TIME
from raymarch.expr.srgb import srgb_glsl
from raymarch.scene.parameter import Values
from raymarch.scene.scene import Scene

HOST: Mapping[str, str] = {
    "u_resolution": "iResolution.xy",
    TIME: "iTime",
    "u_orbit": "iMouse.x + iMouse.y < 2.0 ? vec3(0.0) : "
    "vec3(vec2(-6.2831853, -3.1415927) * (iMouse.xy / iResolution.xy - 0.5), 0.0)",
}
"""The values that Shadertoy gives: size, time, and the mouse, which orbits."""

IMAGE = """
void mainImage(out vec4 fragColor, in vec2 fragCoord) {
    vec3 light = texelFetch(iChannel0, ivec2(fragCoord), 0).rgb;
    vec3 c = clamp(toned(clamp(light, 0.0, 1.0e30)), 0.0, 1.0);
    fragColor = vec4(linear_to_srgb(c.r), linear_to_srgb(c.g), linear_to_srgb(c.b), 1.0);
}
"""
"""The tab Image where Buffer A holds the light."""

PART = "// ======== {} ========"
"""The line before the text of each tab, if there are several."""


def text_of(scene: Scene, values: Values) -> Text:
    """A shader to paste into Shadertoy. Parameters are constants at the top; the mouse orbits.

    If a still scene has several samples, the text has two parts: Buffer A adds a sample in each frame, and Image shows
    their mean. If a scene moves, each frame draws all samples.

    Raises PlanError for textures, and for lights and a sky light that change.
    """
    if scene.quality.samples > 1:
        text, moves = _drawn(scene, values, "shadertoy_buffer")
        if not moves:
            image = f"{srgb_glsl()}\n\n{scene.tone.glsl()}\n{IMAGE}"
            head = "// A scene of raymarch for Shadertoy. Paste each part into the tab of its name. Drag to orbit."
            note = "// iChannel0 of both tabs: Buffer A."
            return Text("\n".join([head, note, "", PART.format("Buffer A"), text, PART.format("Image"), image]))
    text, _ = _drawn(scene, values, "shadertoy")
    return Text(f"// A scene of raymarch for the tab Image of Shadertoy. Drag to orbit.\n{text}")


def _drawn(scene: Scene, values: Values, chosen: str) -> tuple[str, bool]:
    """The text of one tab, and whether it depends on time."""
    made = planned(scene, chosen)
    shader = shader_of(made, HOST)
    refuse_textures(made, shader, "Shadertoy")
    lines = declarations(made, shader, values)
    lines |= {name: f"{kind} {name};" for name, kind in shader.uniforms.items() if name in HOST}
    for name, kind, value, note in inputs(made, shader, values):
        if name not in HOST:
            lines[name] = f"const {kind} {name} = {value};  // {note}"
    return shader.text(version="", declarations=lines), shader.uses_time
