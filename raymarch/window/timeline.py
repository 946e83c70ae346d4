"""The time of a scene: play, pause, step, scrub and loop. The caller provides the elapsed time."""

from __future__ import annotations

from dataclasses import dataclass, replace


@dataclass(frozen=True, slots=True)
class Timeline:
    """The value of `raymarch.time`, in seconds.

    time : the current time.
    playing : whether time advances.
    speed : scene seconds per clock second; negative runs backwards.
    loop : (first, last), first < last, in which time repeats; or None.
    fps : frames per second, for single steps.
    """

    time: float = 0.0
    playing: bool = True
    speed: float = 1.0
    loop: tuple[float, float] | None = None
    fps: float = 30.0

    def advance(self, seconds: float) -> Timeline:
        """Advance by elapsed clock time."""
        return replace(self, time=self._wrapped(self.time + self.speed * seconds)) if self.playing else self

    def toggle(self) -> Timeline:
        return replace(self, playing=not self.playing)

    def step(self, frames: int) -> Timeline:
        """Step by a number of frames (negative: back) and pause."""
        at = round(self.time * self.fps) + frames
        return replace(self, time=self._wrapped(at / self.fps), playing=False)

    def scrub(self, time: float) -> Timeline:
        """Jump to a time; keeps playing if it did."""
        return replace(self, time=self._wrapped(time))

    def looping(self, loop: tuple[float, float] | None) -> Timeline:
        """Set or remove the loop. An empty loop counts as None."""
        if loop is not None and not loop[0] < loop[1]:
            loop = None
        there = replace(self, loop=loop)
        return replace(there, time=there._wrapped(self.time))

    def _wrapped(self, time: float) -> float:
        if self.loop is None:
            return time
        first, last = self.loop
        return first + (time - first) % (last - first)
