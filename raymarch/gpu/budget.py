"""The time of a frame that is split into passes, and how many samples of light fit into it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

FADE = 0.8
"""Factor of the weight of earlier passes when another one is measured."""

PRIOR = 0.02
"""Weight of the assumption that a pass has no fixed time, against passes that differ in their number of samples."""

FLATTEST = 0.1
"""Minimum time of a sample, relative to the mean time of passes divided by their mean number of samples."""

HEADROOM = 0.9
"""Fraction of the remaining time that the next pass is expected to fill."""

GROWTH = 2
"""How many times as many samples as any pass before the next one may take, because the line is not known there."""


LARGEST = 16
"""Maximum number of samples of a pass that takes several frames: the picture changes with its last row."""


@dataclass(slots=True)
class Budget:
    """The time that a frame may take. Whoever draws adds the time of each draw call before it asks for the next.

    limit : milliseconds of the frame. grace : milliseconds for which light goes on beyond them, if all of it is then
        added. interlaced : whether a march of several passes shows coarse grids of pixels first. spent : milliseconds
        so far. last : of the last draw call, or None if it includes work of the driver.
    """

    limit: float
    grace: float = 0.0
    interlaced: bool = False
    spent: float = 0.0
    last: float | None = None

    def add(self, milliseconds: float, *, first: bool = False) -> None:
        """Count a draw call. first : it was the first one of its program, in which drivers finish compilation."""
        self.spent += milliseconds
        self.last = None if first else milliseconds

    @property
    def left(self) -> float:
        """Milliseconds until the limit, below 0 beyond it."""
        return self.limit - self.spent

    @property
    def over(self) -> bool:
        """True if the limit is exceeded."""
        return self.left < 0.0


@dataclass(slots=True)
class LightPace:
    """The time of passes that add samples of light: a fixed time, and one for each sample. They are those of the line
    through the passes so far by least squares, in which recent passes count more.

    Times are milliseconds for each pixel. `after` is that of the passes that follow in a frame.
    """

    after: float = 0.0
    _most: int = 0
    _weight: float = 0.0
    _samples: float = 0.0
    _time: float = 0.0
    _squares: float = 0.0
    _products: float = 0.0

    def add(self, samples: int, time: float) -> None:
        """Count a pass."""
        self._most = max(self._most, samples)
        self._weight = FADE * self._weight + 1.0
        share = 1.0 / self._weight
        self._samples += share * (samples - self._samples)
        self._time += share * (time - self._time)
        self._squares += share * (samples**2 - self._squares)
        self._products += share * (samples * time - self._products)

    def followed(self, time: float) -> None:
        """Count the passes that follow those that add light."""
        self.after = time if not self.after else self.after + 0.3 * (time - self.after)

    @property
    def _line(self) -> tuple[float, float]:
        """The fixed time and that of a sample."""
        prior = PRIOR * self._samples**2
        variance = max(self._squares - self._samples**2, 0.0) + prior
        each = (self._products - self._samples * self._time + prior * self._time / self._samples) / variance
        mean = self._time / self._samples
        each = min(max(each, FLATTEST * mean), mean)
        return self._time - each * self._samples, each

    def time(self, samples: int) -> float:
        """The expected time of a pass; infinite before the first, and far beyond the passes so far."""
        if samples > GROWTH * self._most:
            return math.inf
        fixed, each = self._line
        return fixed + each * samples

    @property
    def worth(self) -> int:
        """The number of samples of a pass of which the fixed time is a third; 1 before the first pass. While all passes
        had equally many samples, twice as many."""
        if not self._most:
            return 1
        if self._squares - self._samples**2 < PRIOR * self._samples**2:
            return min(2 * self._most, LARGEST)
        fixed, each = self._line
        return max(1, min(math.ceil(2.0 * fixed / max(each, 1e-12)), GROWTH * self._most, LARGEST))

    def share(self, samples: int, time: float) -> float:
        """The fraction of a pass that fits into a time, 0 to 1; 1 before the first pass."""
        whole = self.time(samples)
        return min(max(HEADROOM * time / whole, 0.0), 1.0) if self._most and whole > 0.0 else 1.0

    def fitting(self, time: float) -> int:
        """The number of samples that a pass of a time adds; 0 if not one fits, and at most 1 before the first pass."""
        if not self._most:
            return int(time > 0.0)
        fixed, each = self._line
        rest = HEADROOM * time - fixed
        if rest < each:
            return 0
        return int(min(rest / max(each, 1e-12), GROWTH * self._most))


CAUTION = 0.5
"""Fraction of the remaining time that the next band of a pass is expected to fill: it may be dearer than the last."""

SCRAP = 0.08
"""Fraction of the limit for which no further band is drawn."""


@dataclass(slots=True)
class CellPace:
    """The time of bands of passes, in milliseconds: a fixed time, the least of all bands, and one for each cell of a
    pass. Of the latter there are two: that of the last band, and the mean over the picture.

    `after` is the time of the passes that follow in a frame.
    """

    after: float = 0.0
    _fixed: float = math.inf
    _last: dict[str, float] = field(default_factory=dict)
    _mean: dict[str, float] = field(default_factory=dict)
    _sums: dict[str, tuple[float, int]] = field(default_factory=dict)

    def begin(self) -> None:
        """Begin a picture."""
        self._sums.clear()

    def add(self, key: str, cells: int, time: float) -> None:
        """Count a band. key : the name of the pass."""
        self._fixed = min(self._fixed, time)
        variable, (spent, known) = time - self._fixed, self._sums.get(key, (0.0, 0))
        self._last[key] = variable / cells
        self._sums[key] = spent + variable, known + cells

    def covered(self) -> None:
        """The bands so far cover the picture evenly."""
        self._mean |= {key: spent / cells for key, (spent, cells) in self._sums.items()}

    def followed(self, time: float) -> None:
        """Count the passes that follow the bands of a frame."""
        self.after = time if not self.after else self.after + 0.3 * (time - self.after)

    def whole(self, cells: int) -> float:
        """The expected time of a picture of so many cells in one band a pass; infinite before the first one."""
        if not self._mean:
            return math.inf
        return self.after + sum(self._fixed + mean * cells for mean in self._mean.values())

    def fitting(self, key: str, rest: int, budget: Budget, *, drawn: bool) -> int:
        """The number of cells of the next band, of those that are left; 0 leaves them to the next frame.

        A pass that was never drawn begins with a few cells. No cell is expected to be cheaper than the mean: the next
        rows may be dearer than the last ones.
        drawn : whether this frame has drawn a band. The first one of a frame has at least a cell, and as many as add a
            quarter to its fixed time, which may be longer than the budget.
        """
        left = budget.left - min(self.after, 0.5 * budget.limit)
        if drawn and left < SCRAP * budget.limit:
            return 0
        if key not in self._last:
            return max(rest // 16, 1)
        each = max(self._last[key], self._mean.get(key, 0.0))
        if self._fixed + rest * each <= CAUTION * HEADROOM * left:
            return rest
        if drawn and left < self._fixed + each:
            return 0
        more = CAUTION * left - self._fixed
        more = more if drawn else max(more, 0.25 * self._fixed)
        return min(max(int(more / max(each, 1e-9)), 1), rest)
