"""The clock of a scene: plays, pauses, steps, scrubs and loops. Pure: somebody else tells how much time has passed."""

from __future__ import annotations

from dataclasses import dataclass, replace


@dataclass(frozen=True, slots=True)
class Timeline:
    """What `raymarch.time` stands for, in seconds.

    Attributes
    ----------
    time : the moment that is shown.
    playing : whether it goes on by itself.
    speed : seconds of the scene in a second of the clock; negative runs backwards.
    loop : (first, last) between which it runs round and round, or None; first < last.
    fps : frames a second, for single steps.
    """

    time: float = 0.0
    playing: bool = True
    speed: float = 1.0
    loop: tuple[float, float] | None = None
    fps: float = 30.0

    def advance(self, seconds: float) -> Timeline:
        """After so much time of the clock."""
        return replace(self, time=self._wrapped(self.time + self.speed * seconds)) if self.playing else self

    def toggle(self) -> Timeline:
        """Play or pause."""
        return replace(self, playing=not self.playing)

    def step(self, frames: int) -> Timeline:
        """So many whole frames on (or back), and pause there."""
        at = round(self.time * self.fps) + frames
        return replace(self, time=self._wrapped(at / self.fps), playing=False)

    def scrub(self, time: float) -> Timeline:
        """To a moment; playing goes on if it did."""
        return replace(self, time=self._wrapped(time))

    def looping(self, loop: tuple[float, float] | None) -> Timeline:
        """Within a loop from now on, or without one. An empty loop is none."""
        if loop is not None and not loop[0] < loop[1]:
            loop = None
        there = replace(self, loop=loop)
        return replace(there, time=there._wrapped(self.time))

    def _wrapped(self, time: float) -> float:
        if self.loop is None:
            return time
        first, last = self.loop
        return first + (time - first) % (last - first)
