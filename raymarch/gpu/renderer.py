"""Running the passes of a plan: scene in, frame out."""

from __future__ import annotations

import time as clock_time
from collections import OrderedDict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from types import TracebackType
from typing import Any, Self

import moderngl
from numpy.typing import NDArray
from PIL import Image

from raymarch.errors import DeviceError, SceneError
from raymarch.expr.arrays import bound, evaluator
from raymarch.expr.samples import Samples
from raymarch.gpu.clock import Clock
from raymarch.gpu.context import Context, open_context
from raymarch.gpu.frame import Frame, Timing, unpack
from raymarch.gpu.program import FULL_SCREEN, Program
from raymarch.gpu.targets import Target, upload
from raymarch.plan import OUTPUTS, Plan, plan
from raymarch.scene.parameter import Values, set_values
from raymarch.scene.scene import Scene
from raymarch.shader import Shader, assemble

Progress = Callable[[float], None]

KEPT = 32
"""Compiled programs that a renderer keeps; the one used longest ago is freed first."""

TILE = 128
"""Edge of the tiles in which a picture is drawn when somebody watches its progress, in pixels."""


class Renderer:
    """Draws scenes of one size on one OpenGL context; use it with `with`.

    Parameters
    ----------
    size : (width, height) in pixels, from 1 to the driver's limit.
    backend : "auto" takes the first that works of "egl", "osmesa" and "window" (a hidden one).
    device : index of the EGL device.

    Raises DeviceError if there is no context, or for a size that the driver cannot draw.
    """

    def __init__(self, size: tuple[int, int] = (640, 360), backend: str = "auto", device: int | None = None) -> None:
        self.context: Context = open_context(backend, device)
        self.clock = Clock(self.context)
        self._programs: OrderedDict[tuple[str, str], Program] = OrderedDict()
        self._drawn: set[Program] = set()
        self._targets: dict[int, Target] = {}
        self._textures: OrderedDict[str, moderngl.Texture | moderngl.Texture3D] = OrderedDict()
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
    ) -> Frame:
        """A frame of a scene.

        Parameters
        ----------
        time : seconds, what `raymarch.time` stands for.
        params : new values of parameters, by name.
        outputs : arrays to make now; "color" is a pass of its own, all others share one. The rest is made on access.
        progress : called with the share done, 0 to 1, after each tile; the picture is the same bit for bit.

        Raises
        ------
        SceneError : an unknown parameter, a value out of range, a degenerate camera, an unknown output.
        PlanError : the scene cannot be planned. ShaderError : the driver refuses its shader.
        DeviceError : the renderer is closed.
        """
        if not isinstance(scene, Scene):
            raise SceneError(f"render of {scene!r} ({type(scene).__name__})", legal="a Scene")
        values = set_values(scene.parameters, params or {}, time, scene.where)
        size = self.size

        def render_for(name: str) -> tuple[dict[str, NDArray[Any]], list[Timing]]:
            if self.size != size:
                raise DeviceError(
                    f"this renderer draws {self.size} now, the frame is {size}", legal="access what you need before"
                )
            return self._render_passes(scene, values, _passes_for([name]), None)

        arrays, timings = self._render_passes(scene, values, _passes_for(outputs), progress)
        return Frame(self.size, values.time, timings, arrays, render_for)

    def _render_passes(
        self, scene: Scene, values: Values, passes: Sequence[str], progress: Progress | None
    ) -> tuple[dict[str, NDArray[Any]], list[Timing]]:
        if self.context.released:
            raise DeviceError("this renderer is closed", legal="access what you need inside its `with` block")
        made = plan(scene, passes)
        shader = assemble(made)
        uniforms = frame_uniforms(made, shader, values, self.size)
        uniforms.update({name: self._texture(data) for name, data in shader.samples.items()})
        arrays: dict[str, NDArray[Any]] = {}
        timings = []
        for i, chosen in enumerate(made.passes):
            program, compiling = self._program(shader, chosen.name)
            target = self._target(chosen.textures)
            first = program not in self._drawn
            self._drawn.add(program)
            part = None if progress is None else _part(progress, i, len(made.passes))
            drawn = self._draw(program, target, uniforms, part)
            timings.append(Timing(chosen.name, drawn, compiling, first))
            arrays.update(unpack(chosen.name, [target.read(k) for k in range(chosen.textures)]))
        return arrays, timings

    def _draw(self, program: Program, target: Target, uniforms: Mapping[str, Any], progress: Progress | None) -> float:
        """Milliseconds of a pass, whole or tile by tile."""
        if progress is None:
            return self.clock.time(lambda: program.draw(target, uniforms))
        spent = 0.0
        tiles = list(_tiles(target.size))
        for i, tile in enumerate(tiles, 1):
            spent += self.clock.time(lambda tile=tile: program.draw(target, uniforms, tile))  # type: ignore[misc]
            progress(i / len(tiles))
        return spent

    def _program(self, shader: Shader, chosen: str) -> tuple[Program, float]:
        """A pass ready to draw, and the milliseconds that the driver took to compile it now."""
        text = shader.text(chosen)
        found = self._programs.get((chosen, text))
        if found is not None:
            self._programs.move_to_end((chosen, text))
            return found, 0.0
        start = clock_time.perf_counter()
        program = Program(self.context, FULL_SCREEN, text, shader.locate, chosen)
        spent = 1e3 * (clock_time.perf_counter() - start)
        self._programs[chosen, text] = program
        while len(self._programs) > KEPT:
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

    def close(self) -> None:
        """Free everything. Idempotent."""
        for target in self._targets.values():
            target.release()
        for program in self._programs.values():
            program.release()
        if self._textures and not self.context.released:
            self.context.make_current()
            for texture in self._textures.values():
                texture.release()
        self._textures.clear()
        self._targets.clear()
        self._programs.clear()
        self._drawn.clear()
        self.context.release()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def _passes_for(outputs: Sequence[str]) -> list[str]:
    """The passes that yield some outputs."""
    if not isinstance(outputs, Iterable):
        raise SceneError(f"outputs = {outputs!r} ({type(outputs).__name__})", legal=", ".join(OUTPUTS))
    names = [outputs] if isinstance(outputs, str) else list(outputs)
    for name in names:
        if name not in OUTPUTS:
            raise SceneError(f"outputs: {name!r}", legal=", ".join(OUTPUTS))
    wanted = ["color"] if "color" in names else []
    if any(name != "color" for name in names):
        wanted.append("geometry")
    return wanted or ["color"]


def _part(progress: Progress, i: int, n: int) -> Progress:
    return lambda share: progress((i + share) / n)


def _tiles(size: tuple[int, int]) -> Iterator[tuple[int, int, int, int]]:
    """The picture in tiles, its top rows first."""
    width, height = size
    for top in range(height, 0, -TILE):
        bottom = max(top - TILE, 0)
        for x in range(0, width, TILE):
            yield x, bottom, min(TILE, width - x), top - bottom


def frame_uniforms(made: Plan, shader: Shader, values: Values, size: tuple[int, int]) -> dict[str, Any]:
    """What changes without a recompile: camera, size, parameters, time. Worked out in float64."""
    pose = made.scene.pose(values, size[0] / size[1])
    uniforms: dict[str, Any] = {
        "u_camera_position": pose.position,
        "u_camera_frame": pose.frame,
        "u_camera_slope": pose.slope,
        "u_resolution": size,
        "u_pixel": pose.pixel(size[1]),
        "u_far": made.scene.far(pose),
        "u_time": values.time,
        "u_side": side_of(made, values, pose.position),
    }
    for name, uniform in shader.parameters.items():
        uniforms[uniform] = values.params[name]
    return uniforms


def side_of(made: Plan, values: Values, position: NDArray[Any]) -> float:
    """-1 if a position is inside a solid, else 1; in float64, once a frame."""
    with bound(values.params, values.time):
        distance = evaluator([made.field.body], made.field.params)(position)[0]
    return -1.0 if distance < 0.0 else 1.0


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
