"""The picture in the window: coarse while something moves, then refined tile by tile until it is complete.

The last picture stays on a separate canvas, so that it can be shown again whatever happens to the scene.
"""

from __future__ import annotations

import time as clock_time
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import groupby
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raymarch.expr.srgb import srgb_to_linear
from raymarch.gpu.budget import Budget
from raymarch.gpu.draw_call import DrawCall
from raymarch.gpu.frame import Frame
from raymarch.gpu.renderer import Renderer
from raymarch.gpu.scale import Scale
from raymarch.gpu.screen import Screen
from raymarch.gpu.targets import Target
from raymarch.gpu.tiles import Tile
from raymarch.gpu.unread import unread_of
from raymarch.gpu.views import VIEWS, fill, scale_of
from raymarch.gpu.views import picture as picture_of
from raymarch.scene.scene import Scene
from raymarch.window.model import Drawn
from raymarch.window.pace import Pace, scaled
from raymarch.window.reference import from_centre
from raymarch.window.shot import Shot, preview

FIRST_TILE = 256.0
"""Pixels of the first tile of a still picture, whose time is not known."""

LEAST_TILE = 64
GROWTH = 2.0
"""Least pixels of a tile, and how many times more or fewer than the last one it has."""

DEARER, LONGEST = 16.0, 3.0
"""A tile takes at most LONGEST budgets if its pixels cost DEARER times the mean of those drawn so far: a fractal may
stand beside a cheap sky."""

PATIENT = 30
"""Frames of a preview before a scene that is never still is drawn, to learn its time."""

BLOCK = 256
"""Edge of the largest tile, in pixels."""


@dataclass(slots=True)
class _Part:
    """Passes in progress, with the remaining tiles. All passes draw a tile before the next one."""

    calls: list[DrawCall]
    tiles: list[Tile]
    pixels: float = FIRST_TILE

    def next(self) -> Tile:
        """The next tile, which has about as many pixels as fit. A larger one is halved."""
        while self.tiles[0][2] * self.tiles[0][3] > max(self.pixels, LEAST_TILE):
            x, y, width, height = self.tiles.pop(0)
            if width >= height:
                half = (width + 1) // 2
                self.tiles[:0] = [(x, y, half, height), (x + half, y, width - half, height)]
            else:
                half = (height + 1) // 2
                self.tiles[:0] = [(x, y, width, half), (x, y + half, width, height - half)]
        return self.tiles.pop(0)

    def drawn(self, tile: Tile, milliseconds: float, budget: float, mean: float) -> None:
        """Choose the size of the next tile by the time of this one, and by the mean milliseconds of a pixel so far."""
        factor = min(max(0.5 * budget / max(milliseconds, 1e-3), 1.0 / GROWTH), GROWTH)
        self.pixels = min(tile[2] * tile[3] * factor, LONGEST * budget / (DEARER * max(mean, 1e-9)))


class Picture:
    """Draws shots onto a canvas within a budget of time.

    renderer : on the window's context; this class resizes it.
    screen : copies between targets.
    pace : chooses resolutions.
    samples : rays per pixel of a still picture; the scene's number if that is larger.
    """

    def __init__(self, renderer: Renderer, screen: Screen, pace: Pace, samples: int = 1) -> None:
        self.pace, self.samples = pace, samples
        self.drawn = Drawn()
        self._renderer, self._screen = renderer, screen
        self.canvas: Target | None = None
        """The picture, at the window's size; None before the first."""
        self.shot: Shot | None = None
        """The shot on the canvas."""
        self._rest: list[_Part] | None = None
        self._drawing: list[DrawCall] = []
        self._done = self._pixels = 0
        self._tile = FIRST_TILE
        self._spent = 0.0
        self._lights: tuple[int, int] | None = None
        self.scale: Scale | None = None
        """The colour scale of the view; None for views without one."""
        self.frame: float | None = None
        """Milliseconds of the last complete sample at full size; None before the first of a shot."""
        self.compiling: Scene | None = None
        """The scene whose programs another process compiles: its preview is drawn meanwhile."""
        self.preview_pace = Pace(pace.budget)
        self.longest = 0.0
        """Milliseconds of the longest tile of the last still picture."""
        self._previews: dict[int, tuple[Scene, Scene | None]] = {}
        self._at_hand: Any = None
        self._waited = 0

    @property
    def whole(self) -> bool:
        """True if the picture is fully refined."""
        return self.drawn.whole

    @property
    def resting(self) -> bool:
        """True if nothing is left to draw now."""
        return self._done > 0 if self.preview else self.drawn.whole

    @property
    def preview(self) -> bool:
        """True if the preview of a scene is shown until its programs are compiled."""
        return self.compiling is not None and self.shot is not None and self.shot.scene is not self.compiling

    def preview_of(self, scene: Scene) -> Scene | None:
        """The preview of a scene; the same one each time."""
        if id(scene) not in self._previews:
            self._previews = {id(scene): (scene, preview(scene))}
        return self._previews[id(scene)][1]

    def step(self, shot: Shot, size: tuple[int, int], still: bool) -> bool:
        """Refine the canvas towards a shot at a size, for about the time of a frame. Returns False if it was complete.

        still : True if nothing has moved for a while, so that the picture may be refined.
        Raises the errors of `Renderer.draw_calls`; the canvas then keeps its content.
        """
        if shot.scene is self.compiling:
            shot = replace(shot, scene=self.preview_of(shot.scene) or shot.scene)
        else:
            self.compiling = None
        if not shot.same(self.shot) or self.canvas is None or self.canvas.size != size:
            self._coarse(shot, size)
            return True
        if self.resting or not still:
            return False
        self._refine(shot, size)
        return True

    def _coarse(self, shot: Shot, size: tuple[int, int]) -> None:
        """Draw the complete shot at the resolution that fits the budget."""
        if self._pixels > 0 and self.shot is not None:
            self._pace(self.shot.scene).guess(self._spent, self._pixels)
        cheap = self._cheap(shot, size)
        pace = self._pace(cheap.scene)
        pace.budget, pace.fixed = self.pace.budget, self.pace.fixed
        small = scaled(size, pace.scale(size), self._scales(cheap))
        spent, compiled, draw_calls, share = self._sketch(cheap, small)
        if self._is_preview(cheap.scene):
            self._at_hand = cheap.scene.planned, shot.view
        if compiled == 0.0:  # the first draw of a program includes driver work
            pace.drawn(spent / share, small[0] * small[1])
        else:
            pace.restart()
        if self.canvas is None or self.canvas.size != size:
            fresh = Target(self._renderer.context, size)
            if self.canvas is not None:
                self.canvas.release()
            self.canvas = fresh
        self._put(shot, draw_calls, None)
        complete = small == size and cheap is shot
        self.shot, self._rest, self._pixels, self._done = shot, None, 0, 1 if complete else 0
        self.frame = spent if complete and not compiled else None
        self._say(spent, small, compiled, moving=True)

    def _cheap(self, shot: Shot, size: tuple[int, int]) -> Shot:
        """What moves in the place of a shot: a preview, if the scene is slow, or if its time is not known yet but its
        preview is at hand. The tiles of a still picture tell that time without a long frame. A scene that its own time
        moves is never still: it is tried after some frames."""
        slow = self.pace.slow(size)
        if self._is_preview(shot.scene) or (self.pace.known and not slow):
            self._waited = 0
            return shot
        scene = self.preview_of(shot.scene)
        if scene is None or not (slow or self._at_hand == (scene.planned, shot.view)):
            return shot
        alive = not self.pace.sure and self.shot is not None and shot.time != self.shot.time
        self._waited = self._waited + 1 if alive else 0
        return shot if self._waited > PATIENT else replace(shot, scene=scene)

    def _is_preview(self, scene: Scene) -> bool:
        return any(scene is made for _, made in self._previews.values())

    def _pace(self, scene: Scene) -> Pace:
        return self.preview_pace if self._is_preview(scene) else self.pace

    def _sketch(self, shot: Shot, size: tuple[int, int]) -> tuple[float, float, list[DrawCall], float]:
        """Draw a complete picture. A march or light that is split into passes stops once the budget is spent. Light
        goes on if the rest of it takes no longer than that again, because a picture that lacks some is darker.

        Returns milliseconds of drawing and of compiling, the draw calls, and the fraction of the picture that was
        drawn.
        """
        available = max(self.pace.budget - self.pace.fixed, self.pace.budget / 4)
        renderer, quality = self._renderer, shot.scene.quality
        self._fit(size)
        if quality.temporal == "accumulate":
            renderer.forget()  # if only the text of the file changed, samples would continue to accumulate
        budget, compiled = Budget(available, grace=available), 0.0
        drawn: list[DrawCall] = []
        plan = renderer.prepared(shot.scene, VIEWS[shot.view]).plan
        passes, several = plan.marching.passes, plan.marching.passes > 1 or plan.lights_split
        for call in renderer.iterate_draw_calls(
            shot.scene, shot.time, shot.params, VIEWS[shot.view], shot.pose, budget
        ):
            compiled += call.compile
            budget.add(self._clocked(call.draw, wait=several), first=call.compile > 0.0)
            drawn.append(call)
        budget.add(self._clocked(lambda: None, wait=True))
        marched = sum(call.chosen.name == "march" for call in drawn)
        light = renderer.history.light
        share = 1.0 if renderer.history.march.arrived or marched == 0 else marched / passes
        self._lights = None if light.complete else (light.added, light.count)
        return budget.spent, compiled, drawn, share if light.complete else share * max(light.added, 1) / light.count

    def _clocked(self, draw: Callable[[], None], *, wait: bool) -> float:
        """Time of a draw in milliseconds; with `wait`, until the device has finished."""
        start = clock_time.perf_counter()
        draw()
        if wait:
            self._renderer.context.finish()
        return 1e3 * (clock_time.perf_counter() - start)

    def _refine(self, shot: Shot, size: tuple[int, int]) -> None:
        """Draw tiles of the full picture from the centre outwards, then further samples, until the budget is spent."""
        compiled = 0.0
        if self._rest is None:
            self._fit(size)
            draw_calls = self._renderer.draw_calls(shot.scene, shot.time, shot.params, VIEWS[shot.view], shot.pose)
            compiled = sum(call.compile for call in draw_calls)
            self._spent = self.longest = 0.0
            self._rest, self._drawing = self._parts(draw_calls), draw_calls
            self._pixels = 0
        rest, start, spent, latest = self._rest, clock_time.perf_counter(), 0.0, 0.0
        part = rest[0]
        done: list[Tile] = []
        while part.tiles and (not done or spent + 2.0 * latest <= self.pace.budget):  # the next one will fit
            tile = part.next()
            for call in part.calls:
                call.draw(tile)
            self._renderer.context.finish()
            done.append(tile)
            self._pixels += tile[2] * tile[3] * len(part.calls)
            before, spent = spent, 1e3 * (clock_time.perf_counter() - start)
            latest = spent - before
            self.longest = max(self.longest, latest)
            part.drawn(tile, latest, self.pace.budget, (self._spent + spent) / self._pixels)
            self._tile = min(part.pixels, FIRST_TILE)
        last = len(rest) == 1
        if last and shot.view == "final" and self._done == 0:
            for tile in done:
                self._put(shot, self._drawing, tile)
        self._spent += spent
        if not part.tiles:
            rest.pop(0)
            if last and (shot.view != "final" or self._done > 0):
                self._put(shot, self._drawing, None)
            if last:
                self._rest, self._done, self.frame, self._lights = None, self._done + 1, self._spent, None
                self._pace(shot.scene).guess(self._spent, size[0] * size[1])
        self._say(spent, size, compiled, moving=False)

    def _say(self, spent: float, size: tuple[int, int], compiled: float, *, moving: bool) -> None:
        shot = self.shot
        assert shot is not None
        wanted = max(self.samples, shot.samples) if shot.view == "final" else 1
        whole = self._done >= wanted and not self.preview
        sizes = [] if self._rest is None else [call.target.size for call in self._drawing]
        sample = self._pixels / max(sum(width * height for width, height in sizes), 1) if sizes else 0.0
        share = 1.0 if whole else (self._done + sample) / wanted
        self.drawn = Drawn(spent, size, whole, moving, compiled, self._done, wanted, share, self._lights)

    def _parts(self, draw_calls: list[DrawCall]) -> list[_Part]:
        """The tiles of passes, from the centre outwards.

        Passes that add lights are drawn together, so that finished tiles are shown at once.
        """
        groups = groupby(draw_calls, key=lambda call: bool(call.chosen.lights) or id(call))
        parts = [list(group) for _, group in groups]
        return [_Part(calls, from_centre(calls[0].target.size, BLOCK), self._tile) for calls in parts]

    def _fit(self, size: tuple[int, int]) -> None:
        if self._renderer.size != size:
            self._renderer.resize(size)

    def _scales(self, shot: Shot) -> tuple[float, ...]:
        """Relative sizes of the cone pictures of a shot."""
        levels = self._renderer.prepared(shot.scene, VIEWS[shot.view]).plan.marching.schedule.levels
        return tuple(level.scale for level in levels)

    def _put(self, shot: Shot, draw_calls: list[DrawCall], tile: Tile | None) -> None:
        """Copy the result of draw calls to the canvas, as linear colour."""
        assert self.canvas is not None
        last = draw_calls[-1]
        if shot.view == "final":
            self.scale = None
            self._screen.copy(last.target, self.canvas, tile)
            return
        drawn = {call.chosen.name: (call.chosen, call.target) for call in draw_calls}
        unread = unread_of(drawn)
        size, tone = last.target.size, shot.scene.tone
        frame = Frame(size, shot.time, [], {}, _nothing, tone, pose=shot.pose, _unread=unread)
        self.scale = scale_of(frame, shot.view)
        if fill(self.canvas, frame, shot.view, self.scale):
            return
        shown = picture_of(frame, shot.view, shot.scene, self.scale).convert("RGB").resize(self.canvas.size, 0)
        self.canvas.write(np.dstack([linear(np.asarray(shown)), np.ones(shown.size[::-1], np.float32)]))

    def probe(self, shot: Shot, size: tuple[int, int], x: int, row: int) -> dict[str, NDArray[Any]]:
        """Depth, normal, counts and material of one pixel, each of shape (1, 1, ...)."""
        *before, call = self.at(size).draw_calls(shot.scene, shot.time, shot.params, ("depth",), shot.pose)
        for cone in before:
            cone.draw()
        call.draw((x, size[1] - 1 - row, 1, 1))
        texels = [call.target.read_texel(x, row, k)[None, None] for k in range(call.chosen.textures)]
        return call.chosen.unpack(texels)

    def at(self, size: tuple[int, int]) -> Renderer:
        """The renderer, resized for another picture."""
        # Resizing may free its textures and history: refinement restarts with the first sample.
        if self._rest is not None or not self.drawn.whole:
            self._rest, self._done = None, 0
        self._fit(size)
        return self._renderer

    def release(self) -> None:
        """Free the canvas. The renderer belongs to the caller."""
        if self.canvas is not None:
            self.canvas.release()
            self.canvas = None


def linear(srgb: NDArray[np.uint8]) -> NDArray[np.float32]:
    """8-bit sRGB to linear values."""
    table = srgb_to_linear(np.arange(256) / 255.0).astype(np.float32)
    return np.asarray(table[srgb], np.float32)


def _nothing(name: str) -> Any:
    raise KeyError(name)
