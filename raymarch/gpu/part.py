"""A picture, or a part of it: a rectangle of its pixels, or some of the samples of each."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from raymarch.errors import DeviceError, SceneError
from raymarch.gpu.prepare import Prepared, Wanted, assembled
from raymarch.plan import Plan
from raymarch.plan.marching import Level
from raymarch.scene.camera import Pose
from raymarch.scene.parameter import Values
from raymarch.scene.scene import Scene
from raymarch.scene.shown import Shown

Box = tuple[int, int, int, int]
"""x and y of the lower left texel, width, height."""


@dataclass(frozen=True, slots=True)
class PicturePart:
    """A part of a picture that a renderer of the part's size draws. Its pixels are those of the whole picture, bit for
    bit.

    whole : (width, height) of the whole picture in pixels.
    corner : (x, y) of the part's upper left pixel; row 0 is the top of the whole picture.
    samples : (first, end) of the samples per pixel; the colours are their mean. None is all of them.
    """

    whole: tuple[int, int]
    corner: tuple[int, int] = (0, 0)
    samples: tuple[int, int] | None = None

    def box(self, size: tuple[int, int]) -> Box:
        """The part of this size, in the whole picture. DeviceError if it does not lie in it."""
        (x, y), (width, height) = self.corner, size
        if x < 0 or y < 0 or x + width > self.whole[0] or y + height > self.whole[1]:
            what = f"a part of {width}x{height} at {self.corner} of a picture of {self.whole[0]}x{self.whole[1]}"
            raise DeviceError(what, legal="a part inside the picture")
        return x, self.whole[1] - y - height, width, height


@dataclass(frozen=True, slots=True)
class Picture:
    """What a frame shows. `size` is that of the whole picture, of which a part may be drawn."""

    scene: Scene
    values: Values
    pose: Pose
    outputs: Sequence[Wanted]
    size: tuple[int, int]
    part: PicturePart | None = None

    @property
    def shown(self) -> Shown:
        """What its depths depend on."""
        return Shown(self.scene.node, self.values, self.pose, None if self.part is None else self.part.whole)

    def sky(self, size: tuple[int, int]) -> NDArray[np.float32]:
        """The radiance of the sky in each pixel of a frame of this size, (H, W, 3)."""
        x, y = (0, 0) if self.part is None else self.part.corner
        columns, rows = np.arange(x, x + size[0]), np.arange(y, y + size[1])[:, None]
        directions = self.pose.directions(columns, rows, self.size).reshape(-1, 3)
        behind = self.scene.sky.radiance_along(directions, self.values)
        return np.asarray(behind.reshape(size[1], size[0], 3), np.float32)


def prepared_part(made: Plan) -> Prepared:
    """A planned scene whose shader draws parts. SceneError for a scene of which a part cannot be drawn alone."""
    scene, quality = made.given, made.given.quality
    if quality.temporal != "off" or quality.rays != "computed":
        what = f"a part of a picture with temporal={quality.temporal!r}, rays={quality.rays!r}"
        raise SceneError(what, legal="temporal='off' and rays='computed'", where=scene.where)
    if scene.post:
        raise SceneError(
            f"{scene.post[0].LABEL} of a part of a picture, such as a tile or a share of samples: it needs all pixels",
            legal="a picture drawn whole, up to 16777216 pixels, or post=[]",
            where=scene.post[0].where,
        )
    return assembled(made, "PART")


def covering(box: Box, whole: tuple[int, int], levels: tuple[Level, ...]) -> list[Box]:
    """The cells of each level, from coarse to fine, that the rays of a part start from.

    Each level covers the cells of the next finer one, and a margin of one cell.
    """
    found: list[Box] = []
    left, low, right, high = (float(v) for v in (box[0], box[1], box[0] + box[2], box[1] + box[3]))
    for level in reversed(levels):
        across, up = level.size(whole)
        cell = (whole[0] / across, whole[1] / up)
        first = (max(math.floor(left / cell[0]) - 1, 0), max(math.floor(low / cell[1]) - 1, 0))
        end = (min(math.ceil(right / cell[0]) + 1, across), min(math.ceil(high / cell[1]) + 1, up))
        found.append((*first, end[0] - first[0], end[1] - first[1]))
        left, low, right, high = first[0] * cell[0], first[1] * cell[1], end[0] * cell[0], end[1] * cell[1]
    return found[::-1]
