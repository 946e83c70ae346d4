"""How large a picture the time of a frame allows. Pure: somebody else draws and measures."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import lru_cache

from raymarch.plan.schedule import Level

STEPS_PER_HALVING = 4
SMALLEST = 1 / 8
"""The least share of the window's width and height that is drawn while something moves."""

LAST_STEP = round(math.log2(1 / SMALLEST) * STEPS_PER_HALVING)

UNKNOWN = 1 / 4
"""The share for the first picture of all, from which the cost is learnt."""

HEADROOM = 0.8
"""The part of the budget that is aimed at; the rest is for what a frame costs more than the one before."""

RECOVERY = 0.15
"""How fast the estimate follows frames that were cheaper than expected. Dearer ones are believed at once."""

BELIEVED = 2.0
"""By how much one frame may raise the estimate: one that waited for something else must not spoil the next fifty."""

SEARCHED = 60
"""Sizes that are tried in place of one with unlucky edges, each smaller by a two-hundredth of it."""

BENT = 20
"""How many of those are tried before a height that is a pixel off."""


@dataclass(slots=True)
class Pace:
    """Chooses the resolution of moving pictures so that each takes no longer than a budget.

    The cost of a picture is taken to be proportional to its pixels, with a share that is fixed. Resolutions are
    steps of a ladder, so that textures are not made anew for each frame.

    Attributes
    ----------
    budget : milliseconds that a frame may take.
    fixed : milliseconds that a frame takes besides drawing the scene.
    """

    budget: float = 33.0
    fixed: float = 0.0
    _per_pixel: float | None = None
    _step: int = field(default=0)

    def scale(self, size: tuple[int, int]) -> float:
        """The share of width and height to draw now, from `SMALLEST` to 1."""
        if self._per_pixel is None:
            return UNKNOWN
        room = max(self.budget * HEADROOM - self.fixed, self.budget * 0.1)
        pixels = size[0] * size[1]
        step = self._step
        if self._cost(step, pixels) > room / HEADROOM:
            while step < LAST_STEP and self._cost(step, pixels) > room:
                step += 1
        while step > 0 and self._cost(step - 1, pixels) <= room:
            step -= 1
        self._step = step
        return _share(step)

    def drawn(self, milliseconds: float, pixels: int) -> None:
        """Learn from a picture of so many pixels."""
        cost = milliseconds / max(pixels, 1)
        if not math.isfinite(cost) or cost < 0:
            return
        known = self._per_pixel
        if known is None:
            self._per_pixel = cost
        elif cost > known:
            self._per_pixel = min(cost, BELIEVED * known)
        else:
            self._per_pixel = known + RECOVERY * (cost - known)

    def guess(self, milliseconds: float, pixels: int) -> None:
        """Take a still picture's cost for that of a moving one, where none was drawn yet."""
        if self._per_pixel is None:
            self.drawn(milliseconds, pixels)

    def pixels(self, milliseconds: float) -> float:
        """How many pixels can be drawn in a time."""
        return 4096.0 if not self._per_pixel else milliseconds / self._per_pixel

    def other(self, milliseconds: float) -> None:
        """Learn what a frame took besides drawing the scene."""
        self.fixed += 0.2 * (milliseconds - self.fixed)

    def _cost(self, step: int, pixels: int) -> float:
        assert self._per_pixel is not None
        return self._per_pixel * pixels * _share(step) ** 2


@lru_cache(256)
def scaled(size: tuple[int, int], share: float, scales: tuple[float, ...] = ()) -> tuple[int, int]:
    """A size in whole pixels, each at least 1, of the same shape to a pixel.

    scales : of the pictures of cones that are drawn first, over the size.

    Mesa's software renderer compiles programs anew for textures with an edge that is a power of two, in the middle of
    a movement and for as long as twenty frames take. So smaller sizes are such that neither they nor their cones have
    one; they may be smaller than asked for, and where all near are of that kind, as small as the next that is not.
    """
    if share >= 1.0:
        return size
    tried = sorted((k + BENT * abs(rise), k, rise) for k in range(SEARCHED) for rise in (0, 1, -1))
    near = [_rounded(size, share * (1.0 - 0.005 * k), rise) for _, k, rise in tried]
    for least in (0, 2):  # small pictures cannot do without cones of 1 or 2
        for choice in near:
            if not any(_is_power(edge, least) for edge in _edges(choice, scales)):
                return choice
    return near[0]


def _rounded(size: tuple[int, int], share: float, rise: int) -> tuple[int, int]:
    width = max(1, round(size[0] * share))
    return width, max(1, round(size[1] * width / size[0]) + rise)


def _edges(size: tuple[int, int], scales: tuple[float, ...]) -> list[int]:
    cones = (Level(scale).size(size) for scale in scales)
    return [*size, *(edge for cone in cones for edge in cone)]


def _is_power(edge: int, least: int) -> bool:
    return edge > least and edge & (edge - 1) == 0


def _share(step: int) -> float:
    return max(SMALLEST, 2.0 ** (-step / STEPS_PER_HALVING))
