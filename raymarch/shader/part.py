"""The shader of a part of a picture: the same text, whose coordinates are those of the whole picture."""

from __future__ import annotations

import re
from dataclasses import replace

from raymarch.shader.assemble import Shader
from raymarch.shader.chunk import Mapped

DECLARATIONS = "uniform vec2 u_corner; uniform vec2 u_carried_corner; uniform vec2 u_carried_size; "
"""The lower left texel of this target in the level's whole picture; the same of the coarser level, and its size."""

CHANGES = (
    # Texels that the pass itself has drawn are in the target, so `ivec2(gl_FragCoord.xy)` stays.
    (re.compile(r"(?<!\bivec2\()gl_FragCoord\.xy"), "(gl_FragCoord.xy + u_corner)"),
    (re.compile(r"textureSize\(u_carried, 0\)"), "ivec2(u_carried_size)"),
    (
        re.compile(r"texelFetch\(u_carried, ivec2\(x, y\), 0\)"),
        "texelFetch(u_carried, ivec2(x, y) - ivec2(u_carried_corner), 0)",
    ),
)


def part_of(shader: Shader) -> Shader:
    """The shader that draws parts of a picture. Its lines correspond to those of the given one."""
    body = [replace(line, text=_changed(line.text)) for line in shader.body]
    body[0] = Mapped(DECLARATIONS + body[0].text, body[0].made_by, body[0].where)
    return replace(shader, body=tuple(body))


def _changed(text: str) -> str:
    for pattern, changed in CHANGES:
        text = pattern.sub(changed, text)
    return text
