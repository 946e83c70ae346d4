"""The float64 reference of a picture, computed tile by tile from the centre outwards in its own thread."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass, replace
from queue import SimpleQueue

import numpy as np
from numpy.typing import NDArray

from raymarch.gpu.tiles import Tile, tiles_of
from raymarch.scene.parameter import Values
from raymarch.truth.rays import Rays, camera_rays
from raymarch.truth.tracer import trace
from raymarch.window.shot import Shot

EDGE = 96
"""Edge of a tile in pixels."""


@dataclass(frozen=True, slots=True, eq=False)
class TracedTile:
    """A tile of the reference, (x, y, width, height) from the lower left: depth (h, w) and linear colour (h, w, 3).
    `trouble` says why there is none."""

    number: int
    tile: Tile
    depth: NDArray[np.float64]
    color: NDArray[np.float64]
    trouble: str = ""


class Reference:
    """The reference of one shot, as far as it is computed.

    The camera's lens and shutter are ignored: rays start at the centre of the lens at the shot's time.

    shot, size : what it is the reference of; None before the first `ask`.
    depth, color : (H, W) and (H, W, 3), NaN where it is not computed.
    """

    def __init__(self, wake: Callable[[], None]) -> None:
        self._wake = wake
        self._found: SimpleQueue[TracedTile] = SimpleQueue()
        self._number = 0
        self.shot: Shot | None = None
        self.size = (0, 0)
        self.depth, self.color = np.empty((0, 0)), np.empty((0, 0, 3))

    @property
    def share(self) -> float:
        """The computed fraction."""
        return float(np.mean(~np.isnan(self.depth))) if self.depth.size else 0.0

    def covers(self, shot: Shot, size: tuple[int, int]) -> bool:
        """True if this is the reference of a shot, which does not depend on the quality of its scene."""
        mine = self.shot
        if mine is None or size != self.size:
            return False
        ours, its = mine.scene.arguments(), shot.scene.arguments()
        alike = all(ours[name] is its[name] or ours[name] == its[name] for name in ours if name != "quality")
        return alike and replace(shot, scene=mine.scene, view=mine.view).same(mine)

    def ask(self, shot: Shot, values: Values, size: tuple[int, int]) -> None:
        """Begin with a shot, if it is another one."""
        if self.covers(shot, size):
            return
        self._number += 1
        self.shot, self.size = shot, size
        self.depth, self.color = np.full(size[::-1], np.nan), np.full((*size[::-1], 3), np.nan)
        arguments = (self._number, shot, values, size)
        threading.Thread(target=self._work, args=arguments, name="reference", daemon=True).start()

    def stop(self) -> None:
        """Forget the shot; the thread ends after its tile."""
        self._number += 1
        self.shot = None

    def latest(self) -> list[TracedTile]:
        """The tiles since the last call. They are in `depth` and `color` from then on."""
        found = []
        for made in [self._found.get() for _ in range(self._found.qsize())]:
            if made.number == self._number:
                x, y, width, height = made.tile
                rows = slice(self.size[1] - y - height, self.size[1] - y)
                if not made.trouble:
                    self.depth[rows, x : x + width], self.color[rows, x : x + width] = made.depth, made.color
                found.append(made)
        return found

    def _work(self, number: int, shot: Shot, values: Values, size: tuple[int, int]) -> None:
        nothing = np.empty(0)
        try:
            for tile in from_centre(size, EDGE):
                if number != self._number:
                    return
                depth, color = traced(shot, values, size, tile)
                self._found.put(TracedTile(number, tile, depth, color))
                self._wake()
        except Exception as fault:  # of the scene, or of ours: the window goes on
            self._found.put(TracedTile(number, (0, 0, 0, 0), nothing, nothing, str(fault)))
            self._wake()


def traced(
    shot: Shot, values: Values, size: tuple[int, int], tile: Tile
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Depth and linear colour of a tile of a shot of a size, in float64."""
    (width, height), (x, y, wide, high) = size, tile
    rows = np.arange(height - y - high, height - y)
    pixels = (rows[:, None] * width + np.arange(x, x + wide)).ravel()
    every = camera_rays(shot.pose, width, height)
    origins = every.origins if len(every.origins) == 1 else every.origins[pixels]
    rays = Rays(origins, every.directions[pixels])
    found = trace(shot.scene, values, shot.pose, rays, (high, wide), shot.pose.pixel(height))
    return found.depth, found.color


def from_centre(size: tuple[int, int], edge: int) -> list[Tile]:
    """The tiles of a picture, those near its centre first."""
    middle = np.array(size) / 2
    return sorted(tiles_of(size, edge), key=lambda t: float(np.hypot(*(np.array(t[:2]) + edge / 2 - middle))))
