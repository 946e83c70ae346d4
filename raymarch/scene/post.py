"""Post effects: changes of the finished picture in linear light, before tone mapping."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, Final

import numpy as np
from numpy.typing import NDArray

from raymarch.expr.node import Expr
from raymarch.scene.parameter import Values
from raymarch.scene.value import Value

PICTURE: Final = -1
"""The number of the picture before the effect, in `Stage.reads`."""


@dataclass(frozen=True, slots=True)
class Stage:
    """A draw of a post effect.

    Attributes
    ----------
    size : (width, height) of what it draws, in pixels. reads : the numbers of the earlier stages that it reads, or
        `PICTURE`, by the name of the sampler. uniforms : by name.
    """

    size: tuple[int, int]
    reads: Mapping[str, int]
    uniforms: Mapping[str, Any] = field(default_factory=dict)


class PostEffect(Value):
    """Base of the post effects.

    A subclass has the two class attributes, `stages` for the shader and `apply` for the reference. Fields that are
    expressions may read parameters and time; they are evaluated in each frame, in float64.

    Attributes
    ----------
    MODULE : the GLSL module with its `main`, which reads and writes `out_color`, linear RGB. Alpha is kept.
    LABEL : its name in `raymarch explain` and `raymarch cost`.
    """

    __slots__ = ()
    MODULE: ClassVar[str] = ""
    LABEL: ClassVar[str] = ""

    @property
    def expressions(self) -> list[Expr]:
        """Every expression in it that may read parameters or time."""
        return [part for part in self.arguments().values() if isinstance(part, Expr)]

    def numbers(self, values: Values) -> dict[str, float]:
        """The values of its expressions in a frame, by the name of the field."""
        return {name: float(values.of(part)) for name, part in self.arguments().items() if isinstance(part, Expr)}

    def stages(self, numbers: Mapping[str, float], size: tuple[int, int]) -> list[Stage]:
        """The draws of a frame in order, at least one; the last one has the size of the picture.

        numbers : as of `numbers`. size : (width, height) of the picture in pixels.
        """
        raise NotImplementedError

    def apply(self, color: NDArray[np.float64], numbers: Mapping[str, float]) -> NDArray[np.float64]:
        """The effect on a picture (H, W, 3) in float64, for the reference."""
        raise NotImplementedError
