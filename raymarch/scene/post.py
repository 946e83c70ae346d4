"""Post effects: changes of the finished picture in linear light, before tone mapping."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, Final

import numpy as np
from numpy.typing import NDArray

from raymarch.expr.node import Expr
from raymarch.scene.parameter import Values, as_number
from raymarch.scene.value import Part, value
from raymarch.sdf.domain import Scalar

PICTURE: Final = -1
"""The number of the picture before the effect, in `Stage.reads`."""


@dataclass(frozen=True, slots=True)
class Stage:
    """A draw of a post effect.

    size : (width, height) of what it draws, in pixels. reads : the numbers of the earlier stages that it reads, or
    `PICTURE`, by the name of the sampler. uniforms : by name.
    """

    size: tuple[int, int]
    reads: Mapping[str, int]
    uniforms: Mapping[str, Any] = field(default_factory=dict)


class PostEffect(Part):
    """Base of the post effects.

    A subclass has the two class attributes, `stages` for the shader and `apply` for the reference. Fields that are
    expressions may read parameters and time; they are evaluated in each frame, in float64.

    Attributes
    ----------
    MODULE : the GLSL module with its `main`, which reads and writes `out_color`, linear RGB. Alpha is kept.
    LABEL : its name in `raymarch explain` and `raymarch cost`.
    """

    BELONGS: ClassVar[str] = "Scene(post=[...])"

    __slots__ = ()
    MODULE: ClassVar[str] = ""
    LABEL: ClassVar[str] = ""

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


@value
class Bloom(PostEffect):
    """Bloom: bright parts of the picture glow, as light that scatters in a lens or in the eye.

    A share of the light of each pixel is spread over its surroundings, before tone mapping. No light is added or lost,
    and no threshold is needed: only light that is much brighter than its surroundings is seen to glow.

    Parameters
    ----------
    strength : share of the light that is spread, 0 to 1. Lenses scatter a few percent.
    radius : standard deviation of the widest glow, as a fraction of the picture's height, 0 to 1. The glow is the mean
        of six blurs, each half as wide as the one before. So it looks the same at every resolution.

    Raises
    ------
    SceneError : a value outside its range.

    Notes
    -----
    A blur goes down and up a pyramid of pictures, each half as large, as in Jimenez (2014), "Next Generation Post
    Processing in Call of Duty: Advanced Warfare". The filters are those of quadratic B-splines (Chaikin 1974), with a
    third of the samples of the paper's. After k levels the variance is 0.5 (4^k - 1) square pixels on each axis;
    between two levels, their blurs are mixed to the wanted variance. At its borders, the picture is mirrored. The last
    texels of a level may cover less of the picture than the others: each texel has the weight of its cover, and the
    filter that goes down is the adjoint, under these weights, of the one that goes up. So the sum of all pixels and a
    constant picture are kept at every size. Pixels that are not finite stay as they are, and do not glow.

    It needs the whole picture: pictures that are drawn in tiles are refused, and exported shaders have none.
    """

    MODULE = "post/bloom"
    LABEL = "bloom"

    strength: Expr
    radius: Expr

    def __init__(self, strength: Scalar = 0.1, radius: Scalar = 0.05) -> None:
        self._set(
            strength=as_number("Bloom: strength", strength, 0.0, 1.0),
            radius=as_number("Bloom: radius", radius, 0.0, 1.0),
        )

    def shares(self, numbers: Mapping[str, float], height: int) -> list[float]:
        """The share of the next coarser level in each level, from the picture on, which is level 0.

        The last level has none. There is at least one level.
        """
        weights = np.zeros(LEVELS + 2)
        for octave in range(OCTAVES):
            variance = (min(max(numbers["radius"], 0.0), 1.0) * height * 0.5**octave) ** 2
            below = int(np.floor(0.5 * np.log2(2.0 * variance + 1.0)))
            share = (variance - 0.5 * (4.0**below - 1.0)) / (1.5 * 4.0**below)
            weights[below : below + 2] += np.array([1.0 - share, share]) / OCTAVES
        left = np.cumsum(weights[::-1])[::-1]  # the weight of a level and of all coarser ones
        strength = min(max(numbers["strength"], 0.0), 1.0)
        count = np.count_nonzero(left[1:])
        return [strength * float(left[1]), *(float(left[k + 1] / left[k]) for k in range(1, count))]

    def stages(self, numbers: Mapping[str, float], size: tuple[int, int]) -> list[Stage]:
        shares = self.shares(numbers, size[1])
        sizes, covers = [size], [_covers(edge, len(shares)) for edge in size]
        for _ in shares:
            sizes.append((-(-sizes[-1][0] // 2), -(-sizes[-1][1] // 2)))
        found = [
            Stage(
                smaller,
                {"u_fine": level - 1, "u_coarse": PICTURE},
                {"u_down": True, "u_last": tuple(float(cover[level][-k:][0]) for k in (1, 2) for cover in covers)},
            )
            for level, smaller in enumerate(sizes[1:])
        ]
        for level in range(len(shares) - 1, -1, -1):
            reads = {"u_fine": level - 1, "u_coarse": len(found) - 1}
            found.append(Stage(sizes[level], reads, {"u_down": False, "u_share": shares[level]}))
        return found

    def apply(self, color: NDArray[np.float64], numbers: Mapping[str, float]) -> NDArray[np.float64]:
        shares, color = self.shares(numbers, color.shape[0]), color[::-1]  # levels start at the lower left corner
        finite = np.all(np.isfinite(color), axis=-1, keepdims=True)
        levels = [np.where(finite, color, 0.0)]
        rows, columns = (_covers(edge, len(shares)) for edge in color.shape[:2])
        for k in range(len(shares)):
            cover = rows[k][:, None, None] * columns[k][:, None]
            levels.append(_down(levels[-1] * cover) / _down(cover))
        spread = levels.pop()
        for share, level in reversed(list(zip(shares, levels, strict=True))):
            spread = level + share * (_up(spread, level.shape) - level)
        return np.where(finite, spread, color)[::-1]


OCTAVES: Final = 6
"""Number of blurs of a bloom."""

LEVELS: Final = 17
"""Largest number of levels of a bloom: for a radius of 65,535 pixels."""


MASK: Final = (0.125, 0.375, 0.375, 0.125)
"""The filter between two levels, that of quadratic B-splines, from one texel before a pair of texels on."""


def _down(level: NDArray[np.float64], axes: Sequence[int] = (0, 1)) -> NDArray[np.float64]:
    """The sums of the next coarser level on some axes. Mirrored at the ends, but for half a pair at the upper one."""
    for axis in axes:
        pairs = -(-level.shape[axis] // 2)
        ends = [(0, 0)] * level.ndim
        ends[axis] = (1, 1) if level.shape[axis] % 2 == 0 else (1, 0)
        padded = np.moveaxis(np.pad(level, ends, mode="symmetric"), axis, 0)
        padded = np.concatenate([padded, np.zeros((2 * pairs + 2 - len(padded), *padded.shape[1:]))])
        parts = [weight * padded[k : k + 2 * pairs : 2] for k, weight in enumerate(MASK)]
        level = np.moveaxis(np.sum(parts, axis=0), 0, axis)
    return level


def _up(level: NDArray[np.float64], shape: tuple[int, ...]) -> NDArray[np.float64]:
    """A level at the places of the next finer one: linear between its texels, constant beyond the outer ones."""
    for axis in (0, 1):
        at = np.clip((np.arange(shape[axis]) + 0.5) / 2.0 - 0.5, 0.0, level.shape[axis] - 1.0)
        low = at.astype(np.intp)
        right = (at - low).reshape([-1 if k == axis else 1 for k in range(3)])
        high = np.minimum(low + 1, level.shape[axis] - 1)
        first = np.take(level, low, axis)
        level = first + right * (np.take(level, high, axis) - first)
    return level


def _covers(edge: int, count: int) -> list[NDArray[np.float64]]:
    """How much of an axis of the picture each texel covers, of so many levels: 1, except for the last two texels."""
    covers = [np.ones(edge)]
    for _ in range(count):
        covers.append(_down(covers[-1], (0,)))
    return covers
