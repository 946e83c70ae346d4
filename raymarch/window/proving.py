"""The proof of the visible picture, tile by tile, and its colours over the picture."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from raymarch.gpu.tiles import Tile
from raymarch.proof import COLORS
from raymarch.proof.reported import Reported, Solid
from raymarch.proof.search import CONTRADICTED, OPEN, PROVED
from raymarch.scene.parameter import Values
from raymarch.window.model import Verdicts
from raymarch.window.reference import Arrays, Tiled, Work, pixels_of
from raymarch.window.shot import Shot

UNKNOWN = 255
"""The state of a pixel that is not judged yet."""

OPACITY = {PROVED: 110, CONTRADICTED: 255, OPEN: 255}
"""Of the colours over the picture, from 0 to 255."""


class Proving(Tiled):
    """The verdicts about the hits of one shot, (H, W) uint8: as of `Proof.state`, or `UNKNOWN`.

    depth : the hits of the next `ask`, (H, W).
    """

    name = "proof"
    depth: NDArray[np.float64] = np.empty((0, 0))

    @property
    def state(self) -> NDArray[np.uint8]:
        return self.arrays[0]

    @property
    def share(self) -> float:
        """The judged fraction."""
        return float(np.mean(self.state != UNKNOWN)) if self.state.size else 0.0

    @property
    def verdicts(self) -> Verdicts:
        counts = np.bincount(self.state.ravel(), minlength=UNKNOWN + 1)
        proved, contradicted, open_ = (int(counts[state]) for state in (PROVED, CONTRADICTED, OPEN))
        return Verdicts(proved, contradicted, open_, self.state.size)

    def blank(self, size: tuple[int, int]) -> Arrays:
        return (np.full(size[::-1], UNKNOWN, np.uint8),)

    def work(self, shot: Shot, values: Values, size: tuple[int, int], check: Callable[[], None]) -> Work:
        solid, depth = Solid(shot.scene.node, values), self.depth

        def prove(tile: Tile) -> Arrays:
            columns, rows = pixels_of(tile, size[1])
            hit = np.asarray(depth[rows, columns], np.float64)
            reported = Reported.of(shot.scene, values, shot.pose, size, hit.ravel(), pixels=(columns, rows))
            return (reported.proved(solid, lambda _: check())[0].state.reshape(hit.shape),)

        return prove


def proof_layer(state: NDArray[np.uint8], end: int) -> NDArray[np.uint8]:
    """Verdicts as an RGBA image up to column `end`; a contradicted pixel also colours its neighbours."""
    layer = np.zeros((*state.shape, 4), np.uint8)
    wide = np.pad(state == CONTRADICTED, 1)
    beside = np.lib.stride_tricks.sliding_window_view(wide, (3, 3)).any(axis=(2, 3))
    for verdict, where in ((PROVED, state == PROVED), (OPEN, state == OPEN), (CONTRADICTED, beside)):
        layer[where] = (*COLORS[verdict], OPACITY[verdict])
    layer[:, end:] = 0
    return layer
