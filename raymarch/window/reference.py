"""What is computed about one shot beside the drawing, tile by tile from the centre outwards in a thread: the float64
reference."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass, replace
from queue import SimpleQueue
from typing import Any, ClassVar, TypeAlias

import numpy as np
from numpy.typing import NDArray

from raymarch.gpu.tiles import Tile, tiles_of
from raymarch.scene.parameter import Values
from raymarch.truth.rays import Rays, camera_rays
from raymarch.truth.tracer import trace
from raymarch.window.shot import Shot

EDGE = 96
"""Edge of a tile in pixels."""

Arrays: TypeAlias = tuple[NDArray[Any], ...]
Work: TypeAlias = Callable[[Tile], Arrays]


@dataclass(frozen=True, slots=True, eq=False)
class FoundTile:
    """A tile, (x, y, width, height) from the lower left, and its part of each array. `trouble` says why there is
    none."""

    number: int
    tile: Tile
    arrays: Arrays
    trouble: str = ""


class Abandoned(Exception):
    """The shot is no longer asked for."""


class Tiled:
    """Arrays of one shot, as far as they are computed.

    shot, size : what they belong to; None before the first `ask`.
    arrays : (H, W) or (H, W, ...) each. version : another number after each change of them.
    """

    name: ClassVar[str]

    def __init__(self, wake: Callable[[], None]) -> None:
        self._wake = wake
        self._found: SimpleQueue[FoundTile] = SimpleQueue()
        self._number = 0
        self.shot: Shot | None = None
        self.size, self.version = (0, 0), 0
        self.arrays = self.blank((0, 0))

    def blank(self, size: tuple[int, int]) -> Arrays:
        """The arrays of a size before anything is computed."""
        raise NotImplementedError

    def work(self, shot: Shot, values: Values, size: tuple[int, int], check: Callable[[], None]) -> Work:
        """What computes a tile. check : raises `Abandoned` if it need not go on."""
        raise NotImplementedError

    @property
    def share(self) -> float:
        """The computed fraction."""
        raise NotImplementedError

    def alike(self, shot: Shot, mine: Shot) -> bool:
        """True if two shots have the same arrays."""
        return replace(shot, view=mine.view).same(mine)

    def covers(self, shot: Shot, size: tuple[int, int]) -> bool:
        """True if the arrays are those of a shot."""
        return self.shot is not None and size == self.size and self.alike(shot, self.shot)

    def ask(self, shot: Shot, values: Values, size: tuple[int, int]) -> None:
        """Begin with a shot, if it is another one."""
        if self.covers(shot, size):
            return
        self._number += 1
        self.version += 1
        self.shot, self.size, self.arrays = shot, size, self.blank(size)
        arguments = (self._number, shot, values, size)
        threading.Thread(target=self._run, args=arguments, name=self.name, daemon=True).start()

    def stop(self) -> None:
        """Forget the shot; the thread ends soon."""
        self._number += 1
        self.shot = None

    def latest(self) -> list[FoundTile]:
        """The tiles since the last call. They are in `arrays` from then on."""
        found = []
        for made in [self._found.get() for _ in range(self._found.qsize())]:
            if made.number == self._number:
                x, y, width, height = made.tile
                rows = slice(self.size[1] - y - height, self.size[1] - y)
                for whole, part in zip(self.arrays, made.arrays, strict=bool(not made.trouble)):
                    whole[rows, x : x + width] = part
                found.append(made)
        self.version += len(found)
        return found

    def _run(self, number: int, shot: Shot, values: Values, size: tuple[int, int]) -> None:
        def check() -> None:
            if number != self._number:
                raise Abandoned

        try:
            make = self.work(shot, values, size, check)
            for tile in from_centre(size, EDGE):
                check()
                self._found.put(FoundTile(number, tile, make(tile)))
                self._wake()
        except Abandoned:
            pass
        except Exception as fault:  # of the scene, or of ours: the window goes on
            self._found.put(FoundTile(number, (0, 0, 0, 0), (), str(fault)))
            self._wake()


class Reference(Tiled):
    """The reference of one shot: depth (H, W) and linear colour (H, W, 3), NaN where they are not computed.

    The camera's lens and shutter are ignored: rays start at the centre of the lens at the shot's time.
    """

    name = "reference"

    @property
    def depth(self) -> NDArray[np.float64]:
        return self.arrays[0]

    @property
    def color(self) -> NDArray[np.float64]:
        return self.arrays[1]

    @property
    def share(self) -> float:
        """The computed fraction."""
        return float(np.mean(~np.isnan(self.depth))) if self.depth.size else 0.0

    def blank(self, size: tuple[int, int]) -> Arrays:
        return np.full(size[::-1], np.nan), np.full((*size[::-1], 3), np.nan)

    def work(self, shot: Shot, values: Values, size: tuple[int, int], check: Callable[[], None]) -> Work:
        return lambda tile: traced(shot, values, size, tile)

    def alike(self, shot: Shot, mine: Shot) -> bool:
        """The reference does not depend on the quality of the scene."""
        ours, its = mine.scene.arguments(), shot.scene.arguments()
        same = all(ours[name] is its[name] or ours[name] == its[name] for name in ours if name != "quality")
        return same and super().alike(replace(shot, scene=mine.scene), mine)


def traced(
    shot: Shot, values: Values, size: tuple[int, int], tile: Tile
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Depth and linear colour of a tile of a shot of a size, in float64."""
    (width, height), (_, _, wide, high) = size, tile
    columns, rows = pixels_of(tile, height)
    pixels = (rows * width + columns).ravel()
    every = camera_rays(shot.pose, width, height)
    origins = every.origins if len(every.origins) == 1 else every.origins[pixels]
    rays = Rays(origins, every.directions[pixels])
    found = trace(shot.scene, values, shot.pose, rays, (high, wide), shot.pose.pixel(height))
    return found.depth, found.color


def pixels_of(tile: Tile, height: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The columns (w,) and rows (h, 1) of a tile of a picture, rows from the top."""
    x, y, wide, high = tile
    return np.arange(x, x + wide), np.arange(height - y - high, height - y)[:, None]


def from_centre(size: tuple[int, int], edge: int) -> list[Tile]:
    """The tiles of a picture, those near its centre first."""
    middle = np.array(size) / 2
    return sorted(tiles_of(size, edge), key=lambda t: float(np.hypot(*(np.array(t[:2]) + edge / 2 - middle))))
