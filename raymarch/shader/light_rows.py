"""The texture with the values of all lights, one row each."""

from __future__ import annotations

from raymarch.plan import Plan, lights
from raymarch.shader.chunk import Chunk, Mapped


def texel_of(plan: Plan, k: int) -> str:
    """Texel k of the row of light i."""
    return f"light_texel({k}, i)" if plan.standalone else f"texelFetch(u_lights, ivec2({k}, i), 0)"


def light_rows(plan: Plan, constant: bool = False) -> Chunk:
    """The texture with the values of all lights. constant : an array is declared in its place."""
    by = "the scene's lights"
    lines = [Mapped.declare("sampler2D", "u_lights", by, note="one row per light")]
    if plan.standalone:
        read = f"u_lights[light * {lights.table(plan.scene).texels} + texel]"
        read = read if constant else "texelFetch(u_lights, ivec2(texel, light), 0)"
        body = ["vec4 light_texel(int texel, int light) {", f"    return {read};", "}"]
        lines += [Mapped(line, by) for line in ["", *body]]
    return Chunk.of("light rows", lines)
