"""Running the passes of a plan: scene in, frame out."""

from __future__ import annotations

import time as clock_time
from collections import OrderedDict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import TracebackType
from typing import Any, Self

import moderngl
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from raymarch.errors import DeviceError, SceneError
from raymarch.expr.samples import Samples
from raymarch.gpu.clock import Clock
from raymarch.gpu.context import Context, open_context
from raymarch.gpu.frame import Frame, Timing, unpack
from raymarch.gpu.prepare import Prepared, frame_uniforms, passes_for, prepare
from raymarch.gpu.program import FULL_SCREEN, Program
from raymarch.gpu.targets import Target, upload
from raymarch.plan import Pass, lights
from raymarch.scene.camera import Pose
from raymarch.scene.parameter import Values, set_values
from raymarch.scene.scene import Scene

Progress = Callable[[float], None]

KEPT = 32
"""Compiled programs that a renderer keeps at first; the one used longest ago is freed first."""

PLANNED = 8
"""Scenes whose plan and shader a renderer keeps."""

TILE = 128
"""Edge of the tiles in which a picture is drawn when somebody watches its progress, in pixels."""


@dataclass(frozen=True, slots=True)
class Draft:
    """A pass with its program, target and uniforms, ready to be drawn, whole or tile by tile.

    `compile` is what the driver took to compile the program for it, in milliseconds; 0 if it had been.
    """

    chosen: Pass
    program: Program
    target: Target
    uniforms: Mapping[str, Any]
    compile: float

    def draw(self, tile: tuple[int, int, int, int] | None = None) -> None:
        """Draw without waiting for the device; `tile` as in `Program.draw`."""
        self.program.draw(self.target, self.uniforms, tile)


class Renderer:
    """Draws scenes of one size on one OpenGL context; use it with `with`.

    Parameters
    ----------
    size : (width, height) in pixels, from 1 to the driver's limit.
    backend : "auto" takes the first that works of "egl", "osmesa" and "window" (a hidden one).
    device : index of the EGL device.
    context : an open context to draw on, which is left open by `close`; None opens one.

    `compiled` counts the programs that the driver compiled so far.

    Attributes
    ----------
    kept : how many compiled programs are kept, >= 1; who draws more in turn raises it.

    Raises DeviceError if there is no context, or for a size that the driver cannot draw.
    """

    def __init__(
        self,
        size: tuple[int, int] = (640, 360),
        backend: str = "auto",
        device: int | None = None,
        context: Context | None = None,
    ) -> None:
        self.context: Context = open_context(backend, device) if context is None else context
        self._owns_context = context is None
        self.compiled = 0
        self.clock = Clock(self.context)
        self._programs: OrderedDict[tuple[str, str], Program] = OrderedDict()
        self._drawn: set[Program] = set()
        self._targets: dict[int, Target] = {}
        self._prepared: OrderedDict[tuple[Any, ...], Prepared] = OrderedDict()
        self._textures: OrderedDict[str, moderngl.Texture | moderngl.Texture3D] = OrderedDict()
        self._light_rows: moderngl.Texture | None = None
        self.kept = KEPT
        self._size = size
        try:
            self._target(1)
        except DeviceError:
            self.close()
            raise

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) in pixels."""
        return self._target(1).size

    def resize(self, size: tuple[int, int]) -> None:
        """Draw at another size from now on; DeviceError, and the old size stays, if it is not possible."""
        fresh = Target(self.context, size, 1)
        for target in self._targets.values():
            target.release()
        self._targets = {1: fresh}
        self._size = fresh.size

    def render(
        self,
        scene: Scene,
        time: float = 0.0,
        params: Mapping[str, Any] | None = None,
        outputs: Sequence[str] = ("color",),
        progress: Progress | None = None,
        pose: Pose | None = None,
    ) -> Frame:
        """A frame of a scene.

        Parameters
        ----------
        time : seconds, what `raymarch.time` stands for.
        params : new values of parameters, by name.
        outputs : arrays to make now; "color" is a pass of its own, all others share one. The rest is made on access.
        progress : called with the share done, 0 to 1, after each tile; the picture is the same bit for bit.
        pose : a camera in place of the scene's.

        Raises
        ------
        SceneError : an unknown parameter, a value out of range, a degenerate camera, an unknown output.
        PlanError : the scene cannot be planned. ShaderError : the driver refuses its shader.
        DeviceError : the renderer is closed.
        """
        if not isinstance(scene, Scene):
            raise SceneError(f"render of {scene!r} ({type(scene).__name__})", legal="a Scene")
        values = self._values(scene, params, time, outputs)
        size = self.size

        def render_for(name: str) -> tuple[dict[str, NDArray[Any]], list[Timing]]:
            if self.size != size:
                raise DeviceError(
                    f"this renderer draws {self.size} now, the frame is {size}", legal="access what you need before"
                )
            return self._render_passes(scene, values, [name], None, pose)

        arrays, timings = self._render_passes(scene, values, outputs, progress, pose)
        return Frame(self.size, values.time, timings, arrays, render_for)

    def drafts(
        self,
        scene: Scene,
        time: float = 0.0,
        params: Mapping[str, Any] | None = None,
        outputs: Sequence[str] = ("color",),
        pose: Pose | None = None,
    ) -> list[Draft]:
        """The passes of a frame, ready to be drawn into textures that stay on the device: for a window.

        Parameters and errors are those of `render`; `pose` is a camera in place of the scene's. The textures hold what
        was drawn until the next draft of as many textures is drawn.
        """
        return self._drafts(scene, self._values(scene, params, time, outputs), outputs, pose)

    def adopt(self, scene: Scene, prepared: Prepared, outputs: Sequence[str] = ("color",)) -> None:
        """Take over a scene that was prepared elsewhere, such as in another thread."""
        self._prepared[_key(scene, outputs)] = prepared
        while len(self._prepared) > PLANNED:
            self._prepared.popitem(last=False)

    def _values(self, scene: Scene, params: Mapping[str, Any] | None, time: float, outputs: Sequence[str]) -> Values:
        return set_values(self._prepare(scene, outputs).plan.parameters, params or {}, time, scene.where)

    def _prepare(self, scene: Scene, outputs: Sequence[str]) -> Prepared:
        found = self._prepared.get(_key(scene, outputs))
        if found is None:
            found = prepare(scene, outputs)
            self.adopt(scene, found, outputs)
        return found

    def _drafts(self, scene: Scene, values: Values, outputs: Sequence[str], pose: Pose | None) -> list[Draft]:
        if self.context.released:
            raise DeviceError("this renderer is closed", legal="access what you need inside its `with` block")
        ready = self._prepare(scene, outputs)
        uniforms = frame_uniforms(ready, values, self.size, pose)
        uniforms.update({name: self._texture(data) for name, data in ready.shader.samples.items()})
        if ready.plan.lights_as_data:
            uniforms["u_lights"] = self._lights(lights.rows(scene, values))
        return [self._draft(ready, chosen, uniforms) for chosen in ready.plan.passes]

    def _draft(self, ready: Prepared, chosen: Pass, uniforms: Mapping[str, Any]) -> Draft:
        program, compiling = self._program(ready, chosen.name)
        return Draft(chosen, program, self._target(chosen.textures), uniforms, compiling)

    def _render_passes(
        self, scene: Scene, values: Values, outputs: Sequence[str], progress: Progress | None, pose: Pose | None
    ) -> tuple[dict[str, NDArray[Any]], list[Timing]]:
        arrays: dict[str, NDArray[Any]] = {}
        timings = []
        drafts = self._drafts(scene, values, outputs, pose)
        for i, draft in enumerate(drafts):
            first = draft.program not in self._drawn
            self._drawn.add(draft.program)
            part = None if progress is None else _part(progress, i, len(drafts))
            chosen = draft.chosen
            drawn = self._draw(draft, part)
            timings.append(Timing(chosen.name, drawn, draft.compile, first))
            arrays.update(unpack(chosen.name, [draft.target.read(k) for k in range(chosen.textures)]))
        return arrays, timings

    def _draw(self, draft: Draft, progress: Progress | None) -> float:
        """Milliseconds of a pass, whole or tile by tile."""
        if progress is None:
            return self.clock.time(draft.draw)
        spent = 0.0
        tiles = list(tiles_of(draft.target.size))
        for i, tile in enumerate(tiles, 1):
            spent += self.clock.time(lambda tile=tile: draft.draw(tile))  # type: ignore[misc]
            progress(i / len(tiles))
        return spent

    def _program(self, ready: Prepared, chosen: str) -> tuple[Program, float]:
        """A pass ready to draw, and the milliseconds that the driver took to compile it now."""
        text = ready.texts[chosen]
        found = self._programs.get((chosen, text))
        if found is not None:
            self._programs.move_to_end((chosen, text))
            return found, 0.0
        start = clock_time.perf_counter()
        program = Program(self.context, FULL_SCREEN, text, ready.shader.locate, chosen)
        spent = 1e3 * (clock_time.perf_counter() - start)
        self.compiled += 1
        self._programs[chosen, text] = program
        while len(self._programs) > self.kept:
            _, oldest = self._programs.popitem(last=False)
            self._drawn.discard(oldest)
            oldest.release()
        return program, spent

    def _target(self, textures: int) -> Target:
        if textures not in self._targets:
            self._targets[textures] = Target(self.context, self._size, textures)
        return self._targets[textures]

    def _texture(self, data: Samples) -> moderngl.Texture | moderngl.Texture3D:
        """Sampled data on the device; those used longest ago are freed."""
        if data.key not in self._textures:
            self._textures[data.key] = upload(self.context, data)
            while len(self._textures) > KEPT:
                self._textures.popitem(last=False)[1].release()
        self._textures.move_to_end(data.key)
        return self._textures[data.key]

    def _lights(self, rows: NDArray[np.float32]) -> moderngl.Texture:
        """The texture of many lights, with the rows of this frame."""
        if self._light_rows is None or self._light_rows.size != rows.shape[1::-1]:
            if self._light_rows is not None:
                self._light_rows.release()
            self._light_rows = self.context.gl.texture(rows.shape[1::-1], 4, dtype="f4")
            self._light_rows.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._light_rows.write(rows.tobytes())
        return self._light_rows

    def close(self) -> None:
        """Free everything. Idempotent."""
        for target in self._targets.values():
            target.release()
        for program in self._programs.values():
            program.release()
        if not self.context.released:
            self.context.make_current()
            for texture in self._textures.values():
                texture.release()
            if self._light_rows is not None:
                self._light_rows.release()
        self._textures.clear()
        self._targets.clear()
        self._programs.clear()
        self._drawn.clear()
        self._prepared.clear()
        if self._owns_context:
            self.context.release()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def _key(scene: Scene, outputs: Sequence[str]) -> tuple[Any, ...]:
    """What a plan depends on. The parts, not the scene: somebody may give the same scene another camera."""
    parts = (scene.node, scene.camera, scene.lights, scene.sky, scene.fog, scene.quality)
    return (*parts, tuple(passes_for(outputs)))


def _part(progress: Progress, i: int, n: int) -> Progress:
    return lambda share: progress((i + share) / n)


def tiles_of(size: tuple[int, int]) -> Iterator[tuple[int, int, int, int]]:
    """The picture in tiles, its top rows first."""
    width, height = size
    for top in range(height, 0, -TILE):
        bottom = max(top - TILE, 0)
        for x in range(0, width, TILE):
            yield x, bottom, min(TILE, width - x), top - bottom


def render(
    scene: Scene,
    size: tuple[int, int] = (640, 360),
    time: float = 0.0,
    params: Mapping[str, Any] | None = None,
    backend: str = "auto",
) -> Image.Image:
    """A picture of a scene; see `Renderer` and `Renderer.render`, which is quicker for many frames."""
    with Renderer(size, backend) as renderer:
        return renderer.render(scene, time, params).image()
