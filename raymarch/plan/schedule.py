"""Schedules: coarse levels of cones that are marched first, so that rays start where their cones ended."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True, slots=True)
class Level:
    """A level of cones.

    Attributes
    ----------
    scale : width and height relative to the final picture, above 0 and up to 1.
    share : fraction of the steps that its cones may take; 1 marches them until they stop.
    """

    scale: float
    share: float = 1.0

    def size(self, picture: tuple[int, int]) -> tuple[int, int]:
        """(width, height) of the level in cells."""
        return max(1, round(picture[0] * self.scale)), max(1, round(picture[1] * self.scale))


@dataclass(frozen=True, slots=True)
class Schedule:
    """Levels from coarse to fine, and the fraction of the steps that remains for the rays."""

    levels: tuple[Level, ...] = ()
    share: float = 1.0


def _published(scales: tuple[float, ...]) -> Schedule:
    """Bálint and Valasek 2018: an eighth of the steps for each level, the rest for the rays.

    Their table for six resolutions leaves 3/8 after four eighths. It omits one of the five levels.
    """
    return Schedule(tuple(Level(scale, 1 / 8) for scale in scales), 1 - len(scales) / 8)


SINGLE: Final = Schedule()

SCHEDULES: Final = {
    "single": SINGLE,
    "two": _published((1 / 2,)),
    "four": _published((1 / 4, 1 / 2, 3 / 4)),
    "six": _published((1 / 6, 1 / 3, 1 / 2, 2 / 3, 5 / 6)),
    "cone": Schedule((Level(1 / 4),)),
    "cones": Schedule((Level(1 / 16), Level(1 / 4), Level(1 / 2))),
}
"""Schedules by their names in `Quality`."""

PIXEL: Final = Level(1.0)
"""One cone around each whole pixel; all samples of the pixel start where it ended."""
