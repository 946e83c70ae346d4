"""The resolution that fits the time budget of a frame. No drawing or measuring happens here."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import lru_cache

from raymarch.plan.marching import Level

STEPS_PER_HALVING = 4
SMALLEST = 1 / 8
"""Minimum scale of the window's width and height while something moves."""

LAST_STEP = round(math.log2(1 / SMALLEST) * STEPS_PER_HALVING)

SLOW = 3.0
"""A picture is slow if its smallest size takes longer than this many times the budget."""

APART = 1.5
"""Least factor between the pixels of two pictures whose times tell the fixed part from the part a pixel."""

HEADROOM = 0.8
"""Target fraction of the budget; the rest is a margin for frames that cost more than the last one."""

RECOVERY = 0.15
"""Weight by which the estimate follows cheaper frames. More expensive frames count fully."""

BELIEVED = 2.0
"""A frame that takes more than this many times as long as expected, or as short, counts only if the next one does too:
one frame that had to wait does not affect those after it."""

CLOSE = 0.1
"""Part of the budget by which each frame may miss what was expected: times of fast devices are uneven."""

SMALL = 2.0**-1.5
"""Scale of a picture up to which a larger one is tried, to learn how the time grows with size."""

PATIENCE = 4
"""Number of pictures over the budget before the second such try. Each later try waits twice as long as the last one."""

SURE = 2
"""Number of moving pictures whose times count more than that of a still one."""

SEARCHED = 60
"""Number of smaller sizes to try if an edge is a power of two, in steps of 1/200."""

BENT = 20
"""Number of those to try before a height that is one pixel off."""


@dataclass(slots=True)
class Pace:
    """Chooses the resolution of moving pictures so that each takes no longer than a budget.

    The time of a picture is a part that all sizes take, and a part a pixel. Both are learned from pictures of different
    sizes; the first is of the smallest size. Where the former takes most of the budget, smaller pictures are hardly
    faster: the pixels may then take as long again. Resolutions are quantized, so that textures are not recreated for
    each frame.

    budget : milliseconds that a frame may take.
    fixed : milliseconds of a frame without drawing the scene.
    """

    budget: float = 33.0
    fixed: float = 0.0
    _base: float = 0.0
    _per_pixel: float | None = None
    _step: int = field(default=LAST_STEP)
    _last: tuple[float, int] | None = None
    _count: int = 0
    _since: int = 0
    _patience: int = 0
    _odd: bool = False
    _still: bool = False

    def scale(self, size: tuple[int, int]) -> float:
        """The scale of width and height to draw now, from `SMALLEST` to 1."""
        if self._per_pixel is None:
            return SMALLEST
        available = max(self.budget * HEADROOM - self.fixed, self.budget * 0.1, 2.0 * self._base)
        pixels, step = size[0] * size[1], self._step
        if self._cost(step, pixels) > available / HEADROOM:
            while step < LAST_STEP and self._cost(step, pixels) > available:
                step += 1
        while step > 0 and self._cost(step - 1, pixels) <= available:
            step -= 1
        self._step = step
        return _share(step - STEPS_PER_HALVING // 2 if self._wanting(step, pixels, available) else step)

    def _wanting(self, step: int, pixels: int, available: float) -> bool:
        """True if a larger picture should tell how the time grows with size: none has yet, or also the smallest is over
        the budget, and pictures of this size are drawn."""
        if self._last is None or self._last[1] > APART * pixels * _share(step) ** 2 or self._since < self._patience:
            return False
        cost = self._cost(step, pixels)
        unknown = self._patience == 0 and self._small
        return (unknown or cost > available / HEADROOM) and cost <= SLOW * self.budget

    def drawn(self, milliseconds: float, pixels: int) -> None:
        """Update the estimate from a picture of so many pixels."""
        pixels = max(pixels, 1)
        if not math.isfinite(milliseconds) or milliseconds < 0 or not self._believed(milliseconds, pixels):
            return
        self._count, self._since = self._count + 1, self._since + 1
        learned = self._compare(milliseconds, pixels)
        cost, known = max(milliseconds - self._base, 0.02 * milliseconds) / pixels, self._per_pixel
        cheaper = known is not None and cost < known and not learned
        self._per_pixel = known + RECOVERY * (cost - known) if known is not None and cheaper else cost

    def _believed(self, milliseconds: float, pixels: int) -> bool:
        """False for one frame of an odd time. The second one in succession begins the estimate anew."""
        if self._per_pixel is None:
            return True
        expected = self._base + self._per_pixel * pixels
        near = expected / BELIEVED <= milliseconds <= BELIEVED * expected
        self._odd, odd = not (near or abs(milliseconds - expected) <= CLOSE * self.budget), self._odd
        if self._odd and odd:
            self.restart()
            return True
        return not self._odd

    def _compare(self, milliseconds: float, pixels: int) -> bool:
        """Learn the part of the time that all sizes take, if the last picture had another size. Returns True if what
        was known of it is replaced: at first, and where the picture is small, maybe because that was wrong."""
        before, other = self._last or (milliseconds, pixels)
        if max(pixels, other) <= APART * min(pixels, other):
            self._last = before + RECOVERY * (milliseconds - before), pixels
            return False
        base = min(max((milliseconds * other - before * pixels) / (other - pixels), 0.0), milliseconds, before)
        replaced = self._patience == 0 or self._small
        self._base += (1.0 if replaced else 0.5) * (base - self._base)
        self._last, self._since = (milliseconds, pixels), 0
        self._patience = max(PATIENCE, 2 * self._patience if self._small else 0)
        return replaced

    def restart(self) -> None:
        """Another program is drawn: what was learned of the times of the last one is forgotten."""
        self._base, self._per_pixel, self._last, self._step = 0.0, None, None, LAST_STEP
        self._count = self._since = self._patience = 0
        self._odd = self._still = False

    @property
    def known(self) -> bool:
        """True if the time of a picture is known."""
        return self._per_pixel is not None

    @property
    def sure(self) -> bool:
        """True if it is known from more than one moving picture."""
        return self._still or self._count >= SURE

    def slow(self, size: tuple[int, int]) -> bool:
        """True if also the smallest picture of a size takes much longer than the budget."""
        return self._per_pixel is not None and self._cost(LAST_STEP, size[0] * size[1]) > SLOW * self.budget

    def guess(self, milliseconds: float, pixels: int) -> None:
        """Estimate the cost of a moving picture from a still one, unless enough moving ones were drawn."""
        if self._count < SURE:
            self.restart()
            self.drawn(milliseconds, pixels)
            self._count, self._still = 0, True

    @property
    def _small(self) -> bool:
        return _share(self._step) <= SMALL

    def other(self, milliseconds: float) -> None:
        """Update the fixed cost: the time of a frame without drawing the scene."""
        self.fixed += 0.2 * (milliseconds - self.fixed)

    def _cost(self, step: int, pixels: int) -> float:
        assert self._per_pixel is not None
        return self._base + self._per_pixel * pixels * _share(step) ** 2


@lru_cache(256)
def scaled(size: tuple[int, int], share: float, scales: tuple[float, ...] = ()) -> tuple[int, int]:
    """A scaled size in integer pixels, each at least 1, of the same aspect ratio to a pixel.

    scales : sizes of the cone pictures, relative to the size.

    Mesa's software renderer recompiles programs for textures with an edge that is a power of two, which interrupts a
    movement for as long as twenty frames. Scaled sizes therefore avoid such edges, also for cones. The result may be
    smaller than requested: it is the next smaller size without such edges.
    """
    if share >= 1.0:
        return size
    tried = sorted((k + BENT * abs(rise), k, rise) for k in range(SEARCHED) for rise in (0, 1, -1))
    near = [_rounded(size, share * (1.0 - 0.005 * k), rise) for _, k, rise in tried]
    for least in (0, 2):  # small pictures need cones of 1 or 2 pixels
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
