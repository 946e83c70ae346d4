"""What the picture is compared with: the right side of a split picture, and the errors or the proof over it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raymarch.cost.errors import apart
from raymarch.cost.maps import ERROR_SCALE, WRONG
from raymarch.gpu.renderer import Renderer
from raymarch.gpu.scale import Scale
from raymarch.gpu.screen import Screen
from raymarch.gpu.targets import Target
from raymarch.scene.scene import Scene
from raymarch.window.model import Model
from raymarch.window.pace import Pace
from raymarch.window.picture import Picture
from raymarch.window.proving import Proving, proof_layer
from raymarch.window.reference import Reference, Tiled
from raymarch.window.shot import Shot, progressive

UNKNOWN = 0.015
"""Grey of a reference that is not computed yet, linear."""

DIM = 150
"""Opacity of the colour over a picture where its error is known and at the low end of the scale, from 0 to 255."""


class Comparison:
    """Draws the most exact setting and the reference beside the picture, and the errors or the proof of its hits.

    picture : the picture that is compared. screen : where it is shown. wake : ends a wait for events.
    """

    def __init__(self, picture: Picture, renderer: Renderer, screen: Screen, wake: Any) -> None:
        self._picture, self._renderer, self._screen = picture, renderer, screen
        self._exact: Picture | None = None
        self._second: Renderer | None = None
        self._scene: tuple[Scene, Scene] | None = None
        self.reference, self.proving = Reference(wake), Proving(wake)
        self._canvas: Target | None = None
        self._written: tuple[Target, int] | None = None
        self._depth: tuple[Shot, NDArray[Any]] | None = None
        self._layer: Any = None
        self._layer_of: tuple[Any, ...] = ()

    def whole(self, model: Model) -> bool:
        """True if nothing is left to draw; the reference comes by itself."""
        return model.compare.side != "exact" or (self._exact is not None and self._exact.whole)

    def step(self, model: Model, shot: Shot, still: bool) -> bool:
        """Draw what the model compares with. Returns True if the window must be shown again."""
        drew = self._step_exact(model, shot, still) if model.compare.side == "exact" else False
        drew |= self._step_tiles(self.reference, model, shot, still, wanted=model.compare.reference)
        drew |= self._step_tiles(self.proving, model, shot, still, wanted=model.compare.over == "proof")
        model.known = self.reference.share if self.reference.shot is not None else 0.0
        model.verdicts = self.proving.verdicts if self.proving.shot is not None else None
        if model.compare.side == "truth":
            self._write_truth(model.area)
        self._draw_layer(model, shot)
        return drew

    def _step_tiles(self, tiled: Tiled, model: Model, shot: Shot, still: bool, wanted: bool) -> bool:
        """Ask for a shot, and take its tiles. Returns True if there are some."""
        if not wanted:
            tiled.stop()
        elif still and self._picture.whole:
            if tiled is self.proving and not tiled.covers(shot, model.area):
                self.proving.depth = self._hits(model, shot)
            tiled.ask(shot, model.state.values, model.area)
        elif not tiled.covers(shot, model.area):
            tiled.stop()
        tiles = tiled.latest()
        for tile in tiles:
            if tile.trouble:
                model.notice(f"no {tiled.name}: {tile.trouble}")
        if tiles:
            model.say(tiled.name, share=tiled.share)
        return bool(tiles)

    def _step_exact(self, model: Model, shot: Shot, still: bool) -> bool:
        if self._exact is None:
            self._second = Renderer(model.area, context=self._renderer.context)
            self._second.planned_for, self._second.kept = self._renderer.planned_for, self._renderer.kept
            self._exact = Picture(self._second, self._screen, Pace(model.budget), model.samples)
        scene = model.state.scene
        if self._scene is None or self._scene[0] is not scene:
            changes = model.stops[-1].changes(scene.quality)
            self._scene = (scene, progressive(scene.replace(quality=scene.quality.replace(**changes))))
        self._exact.pace.budget, self._exact.samples = model.frame_budget, model.samples
        return self._exact.step(replace(shot, scene=self._scene[1]), model.area, still and self._picture.whole)

    def _write_truth(self, size: tuple[int, int]) -> None:
        if self._canvas is None or self._canvas.size != size:
            self._free_canvas()
            self._canvas = Target(self._renderer.context, size)
        if self._written == (key := (self._canvas, self.reference.version)):
            return
        self._written = key
        known = self.reference.color if self.reference.color.shape[:2] == size[::-1] else np.full((1, 1, 3), np.nan)
        color = np.broadcast_to(np.where(np.isnan(known), UNKNOWN, known), (*size[::-1], 3))
        self._canvas.write(np.dstack([color, np.ones(size[::-1])]).astype(np.float32))

    def _hits(self, model: Model, shot: Shot) -> NDArray[Any]:
        """The distances of the picture's hits, (H, W)."""
        size = model.area[::-1]
        if self._depth is None or not shot.same(self._depth[0]) or self._depth[1].shape != size:
            made = self._picture.at(model.area).render(shot.scene, shot.time, shot.params, ("depth",), pose=shot.pose)
            self._depth = (shot, made.depth)
        return self._depth[1]

    def _draw_layer(self, model: Model, shot: Shot) -> None:
        over = model.compare.over
        tiled: Tiled = self.proving if over == "proof" else self.reference
        if over == "off" or not tiled.covers(shot, model.area):
            self._free_layer()
            return
        if not self._picture.whole:
            return
        hits = self._hits(model, shot)
        end = model.divider - model.panel_width if model.compare.side != "off" else model.area[0]
        key = (over, self._depth, tiled.version, end)
        if key != self._layer_of:
            self._free_layer()
            if over == "proof":
                layer = proof_layer(self.proving.state, end)
            else:
                layer = error_layer(errors_of(hits, self.reference.depth, shot), end)
            self._layer, self._layer_of = self._screen.image(layer), key

    def show(self, model: Model) -> None:
        """Show the right side, and the errors or the proof over the picture."""
        left, (width, height), at = model.panel_width, model.area, model.divider
        canvas = self._canvas if model.compare.side == "truth" else self._exact.canvas if self._exact else None
        if model.compare.side != "off" and canvas is not None and model.size[0] - at > 0:
            toned = model.state.view == "final" or model.compare.side == "truth"
            tone = model.state.scene.tone if toned else None
            self._screen.show(canvas, tone, (left, 0, width, height), (at, 0, model.size[0] - at, height))
        if self._layer is not None and model.compare.over != "off":
            self._screen.lay(self._layer, left, 0)

    def scale(self, model: Model) -> Scale | None:
        """The colour scale of the errors, or of the view."""
        return ERROR_SCALE if model.compare.over == "errors" else self._picture.scale

    def _free_layer(self) -> None:
        if self._layer is not None:
            self._screen.free(self._layer)
        self._layer, self._layer_of = None, ()

    def _free_canvas(self) -> None:
        if self._canvas is not None:
            self._canvas.release()
            self._canvas = None

    def release(self) -> None:
        """Free everything, and end the threads."""
        self.reference.stop()
        self.proving.stop()
        self._free_layer()
        self._free_canvas()
        if self._exact is not None and self._second is not None:
            self._exact.release()
            self._second.close()


def errors_of(depth: NDArray[Any], true: NDArray[np.float64], shot: Shot) -> NDArray[np.float64]:
    """abs(depth - reference) in pixel footprints, (H, W): inf for a missed or false hit, NaN where it is not known."""
    known = np.where(np.isnan(true), np.inf, true)
    found = apart(depth, known, shot.pose.footprint(known, len(known)))
    return np.where(np.isnan(true), np.nan, found)


def error_layer(errors: NDArray[np.float64], end: int) -> NDArray[np.uint8]:
    """Errors as an RGBA image up to column `end`. Small ones dim the picture; where none is known it stays."""
    scale = ERROR_SCALE
    layer = np.zeros((*errors.shape, 4), np.uint8)
    shown = np.nan_to_num(errors, nan=0.0, posinf=scale.high)
    layer[..., :3] = np.rint(255 * scale.colored(shown))
    layer[..., 3] = np.rint(DIM + (255 - DIM) * np.sqrt(scale.normalized(shown)))  # the lowest errors are no specks
    layer[np.isinf(errors)] = (*WRONG, 255)
    layer[np.isnan(errors)] = 0
    layer[:, end:] = 0
    return layer
