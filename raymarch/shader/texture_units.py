"""How many textures a shader may read."""

from __future__ import annotations

from collections.abc import Sequence

from raymarch.errors import PlanError
from raymarch.plan import Plan
from raymarch.shader.chunk import Chunk, Mapped

UNITS = 16
"""What any driver of OpenGL 3.3 and WebGL 2 has room for in a fragment shader."""


def refuse_too_many(plan: Plan, shared: Sequence[Mapped], mains: Sequence[Chunk]) -> None:
    """PlanError if a pass reads more textures than all drivers have room for.

    shared : the lines that all passes have. mains : what each has besides.
    """
    read = _samplers(shared) + max(_samplers(chunk.lines) for chunk in mains)
    if read > UNITS:
        names = ", ".join(data.label for data in plan.textures)
        raise PlanError(
            f"the shader reads {read} textures, of the scene {len(plan.textures)}: {names}",
            legal=f"up to {UNITS} in all; equal pictures are one texture, and so are the channels of one",
            where=next((m.where for m in plan.scene.materials if m.textured), plan.scene.where),
        )


def _samplers(lines: Sequence[Mapped]) -> int:
    return sum(line.text.startswith("uniform sampler") for line in lines)
