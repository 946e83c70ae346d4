"""The limit on the number of textures of a shader."""

from __future__ import annotations

from collections.abc import Sequence

from raymarch.errors import PlanError
from raymarch.plan import Plan
from raymarch.shader.chunk import Chunk, Mapped

UNITS = 16
"""Texture units that every OpenGL 3.3 and WebGL 2 driver has in a fragment shader."""


def refuse_too_many(plan: Plan, shared: Sequence[Mapped], mains: Sequence[Chunk]) -> None:
    """Raise PlanError if a pass reads more textures than every driver supports.

    shared : the lines of all passes. mains : the further lines of each pass.
    """
    read = _samplers(shared) + max(_samplers(chunk.lines) for chunk in mains)
    if read > UNITS:
        names = ", ".join(data.label for data in plan.textures)
        raise PlanError(
            f"the shader reads {read} textures, {len(plan.textures)} of them from the scene: {names}",
            legal=f"up to {UNITS} in all; equal pictures share one texture, as do the channels of a picture",
            where=next((m.where for m in plan.scene.materials if m.textured), plan.scene.where),
        )


def _samplers(lines: Sequence[Mapped]) -> int:
    return sum(line.text.startswith("uniform sampler") for line in lines)
