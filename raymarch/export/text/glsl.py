"""A scene as the text of one fragment shader: GLSL 330 core.

The shader draws the picture for the screen in one pass: all samples, tone mapped and encoded in sRGB. It computes the
camera itself.
"""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

from raymarch.export.inputs import Text, declarations, inputs, planned, shader_of, textures
from raymarch.scene.parameter import Values
from raymarch.scene.scene import Scene
from raymarch.shader.assemble import HEADERS


def text_of(scene: Scene, values: Values) -> Text:
    """The shader. Its uniforms have the given values initially; textures are samplers.

    Raises PlanError if the sky's light, or more lights than the text unrolls, change.
    """
    made = planned(scene, "standalone", textures=True)
    shader = shader_of(made)
    lines = declarations(made, shader, values)
    comment: list[str] = []
    arrays: dict[str, NDArray[Any]] = {}
    for name, kind, value, note in inputs(made, shader, values):
        lines[name] = f"uniform {kind} {name} = {value};"
        comment.append(f"//   {kind} {name} = {value}: {note}")
    for name, note, levels in textures(made, shader, values):
        kind = shader.uniforms[name]
        lines[name] = f"uniform {kind} {name};  // {note}"
        comment.append(f"//   {kind} {name}: {note}")
        arrays |= {name if len(levels) == 1 else f"{name}.{i}": level for i, level in enumerate(levels)}
    head = [
        "// A scene of raymarch as one fragment shader. Draw it on a full screen; it writes sRGB.",
        "// Uniforms, with the values that they have initially:",
        *comment,
    ]
    if arrays:
        head.append("// The textures are arrays of the .npz file beside this one, the bottom row first.")
    body = shader.text(version="", declarations=lines)
    return Text("\n".join([*HEADERS["330 core"], *head, body]), arrays)
