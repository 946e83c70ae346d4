"""What the passes of a frame read."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raymarch.scene.parameter import Values


@dataclass(frozen=True, slots=True)
class LightInputs:
    """The lights of a frame that are rows of a texture.

    uniforms : the textures, by name. rows : (lights, texels, 4).
    most : the largest number of lights that a surface has.
    """

    uniforms: Mapping[str, Any]
    rows: NDArray[np.float32]
    most: int


@dataclass(frozen=True, slots=True)
class FrameInputs:
    """What the passes of a frame read.

    uniforms : of all passes, by name, with data textures and those of lights.
    effects : the numbers of post effects, by the name of the pass.
    lights : the lights, if they are rows of a texture.
    opening : of a shutter that is open: the seconds, and the values at their middle; samples depend on both.
    """

    uniforms: Mapping[str, Any]
    effects: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    lights: LightInputs | None = None
    opening: tuple[float, Values] | None = None

    @property
    def light_turns(self) -> int:
        """The largest number of lights that a surface has, if they are rows; else 1."""
        return 1 if self.lights is None else self.lights.most

    def with_uniforms(self, uniforms: Mapping[str, Any]) -> FrameInputs:
        """The same with other values of some uniforms."""
        return replace(self, uniforms={**self.uniforms, **uniforms})

    def content(self, *left_out: str) -> tuple[Any, ...]:
        """All values, for comparison, except some uniforms."""
        listed = {name: value for name, value in self.uniforms.items() if name not in left_out}
        listed |= {f"{name}.{part}": v for name, numbers in self.effects.items() for part, v in numbers.items()}
        if self.lights is not None:
            listed |= {"rows of lights": self.lights.rows, "lights of a surface": self.lights.most}
        if self.opening is not None:
            seconds, values = self.opening
            listed |= {f"opening {name}": value for name, value in values.params.items()}
            listed |= {"opening": (seconds, values.time)}
        return tuple((name, content(value)) for name, value in sorted(listed.items()))


def content(value: Any) -> Any:
    """The value of a uniform, for comparison: numbers by their bits, textures by identity."""
    if isinstance(value, int | float | tuple | list | np.ndarray):
        return np.asarray(value, np.float64).tobytes()
    return id(value)
