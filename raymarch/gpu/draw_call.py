"""A draw call of a pass."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from raymarch.gpu.program import Program
from raymarch.gpu.targets import Target
from raymarch.plan import Pass

CENTRE: Mapping[str, Any] = {"u_lens": (0.0, 1.0)}
"""The uniforms of a pass whose rays start at the centre of the lens."""


@dataclass(frozen=True, slots=True)
class DrawCall:
    """A pass with its program, target and uniforms. It can be drawn at once or in tiles.

    `compile` is the time in milliseconds that the driver took to compile the program; 0 if it was cached. `part` is the
    tile that it is about; None for the whole target.
    """

    chosen: Pass
    program: Program
    target: Target
    uniforms: Mapping[str, Any]
    compile: float
    part: tuple[int, int, int, int] | None = None

    def draw(self, tile: tuple[int, int, int, int] | None = None) -> None:
        """Draw without waiting for the device. tile : as in `Program.draw`; None draws `part`."""
        self.program.draw(self.target, self.uniforms, tile or self.part)
