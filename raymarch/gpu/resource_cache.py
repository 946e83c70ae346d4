"""The resource cache of a renderer: compiled programs, render targets and data textures."""

from __future__ import annotations

import os
import time as clock_time
from collections import OrderedDict
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

import moderngl
import numpy as np
from numpy.typing import NDArray

from raymarch.errors import PlanError, SceneError, warn
from raymarch.expr.samples import Samples
from raymarch.expr.tables import LiveTable, Table
from raymarch.expr.texels import Texels
from raymarch.gpu.context import Context
from raymarch.gpu.frame_inputs import LightInputs
from raymarch.gpu.prepare import Prepared
from raymarch.gpu.program import FULL_SCREEN, Program, in_pass
from raymarch.gpu.targets import PingPong, Target, upload, upload_pyramid
from raymarch.plan import light_cells, lights
from raymarch.scene.scene import Scene

KEPT = 32
"""Maximum number of data textures, and initially of programs; the least recently used one is freed first."""
HELD, UNITS = 512 * 2**20, 16
"""Bytes of data above which the oldest texture is freed, and the number of textures that always stay: those that one
frame may read."""


_COUNT_ACTIVE = """#version 330 core
// Passes the fragments of active rays, for an occlusion query to count.
uniform sampler2D u_march;
out vec4 color;
void main() {
    float flags = texelFetch(u_march, ivec2(gl_FragCoord.xy), 0).w;
    if (mod(floor(flags / 32.0), 2.0) == 0.0) discard;
    color = vec4(0.0);
}
"""


LONG = 10.0
"""Estimated compile time in seconds above which a warning is emitted."""
LONGEST = 600.0
"""Estimated compile time in seconds above which a scene is refused; RAYMARCH_COMPILE_LIMIT overrides it."""


def check_compile_time(seconds: float, operations: int, shapes: int, scene: Scene, renderer: str) -> str:
    """What to warn of if a driver takes long to compile a field, else ""; PlanError above the limit.

    The estimate is that of llvmpipe. NVIDIA's compiler takes about as long: 15 s where 12 s are estimated.
    """
    if seconds < LONG:
        return ""
    given = os.environ.get("RAYMARCH_COMPILE_LIMIT", "")
    try:
        limit = float(given or LONGEST)
    except ValueError:
        raise SceneError(f"RAYMARCH_COMPILE_LIMIT = {given!r}", legal="a number of seconds") from None
    what = (
        f"the field has {operations:,} operations in {shapes:,} shapes: "
        f"compiling takes about {seconds:.0f} s on {renderer}"
    )
    cure = "`repeat` and `repeat_varied` compile one copy; `grid` and `image` sample a shape once"
    if seconds > limit:
        legal = f"up to {limit:g} s, or a higher RAYMARCH_COMPILE_LIMIT in the environment; {cure}"
        raise PlanError(what, legal=legal, where=scene.node.where or scene.where)
    return f"{what}; {cure}"


Kind = TypeVar("Kind", Target, PingPong)


def _free_lights(lights: LightInputs) -> None:
    for texture in lights.uniforms.values():
        texture.release()


class ResourceCache:
    """Programs by their text, targets by their name, data textures by their content.

    compiled : number of programs that the driver has compiled so far.
    kept : maximum number of cached programs.
    live_lights : whether lights that come and go become rows, so that no program is compiled for them.
    device : the class of devices for which scenes are planned, with prices.
    """

    def __init__(self, context: Context) -> None:
        self.context = context
        self.compiled = 0
        self.kept = KEPT
        self.live_lights = True
        self.device = context.device or context.driver.device_class
        self._programs: OrderedDict[tuple[str, str], Program] = OrderedDict()
        self._drawn: set[Program] = set()
        self._targets: dict[str, Target | PingPong] = {}
        self._textures: OrderedDict[str, moderngl.Texture | moderngl.Texture3D] = OrderedDict()
        self._bytes: dict[str, int] = {}
        self._utilities: dict[str, Program] = {}
        self._lights: list[tuple[Any, LightInputs]] = []
        self._all_kept = False

    @contextmanager
    def scenes_apart(self) -> Iterator[None]:
        """Inside, each scene is drawn as in a new renderer: no lights become rows because others were drawn before."""
        known, self.live_lights = self.live_lights, False
        try:
            yield
        finally:
            self.live_lights = known

    @contextmanager
    def keep_textures(self) -> Iterator[None]:
        """Inside, textures are added and none is freed: for the draw calls of a frame that are drawn later."""
        self._all_kept = True
        try:
            yield
        finally:
            self._all_kept = False

    def program(self, ready: Prepared, chosen: str) -> tuple[Program, float]:
        """The program of a pass, and the time that the driver took to compile it in milliseconds; 0 if cached."""
        key = (ready.vertex, ready.texts[chosen])
        found = self._programs.get(key)
        if found is not None:
            self._programs.move_to_end(key)
            return found, 0.0
        plan, scene = ready.plan, ready.plan.given
        field = plan.compile_seconds, plan.operations, plan.shapes
        if slow := check_compile_time(*field, scene, self.context.driver.renderer):
            warn(slow, scene.node.where or scene.where)
        start = clock_time.perf_counter()
        program = Program(self.context, *key, ready.effects.get(chosen, ready.shader).locate, chosen)
        spent = 1e3 * (clock_time.perf_counter() - start)
        self.compiled += 1
        self._programs[key] = program
        while len(self._programs) > self.kept:
            _, oldest = self._programs.popitem(last=False)
            self._drawn.discard(oldest)
            oldest.release()
        return program, spent

    def knows(self, ready: Prepared) -> bool:
        """True if all programs of a scene are compiled."""
        return all((ready.vertex, text) in self._programs for text in ready.texts.values())

    def first_draw(self, program: Program) -> bool:
        """True at the first call for each program: drivers finish compilation in its first draw."""
        first = program not in self._drawn
        self._drawn.add(program)
        return first

    def target(self, name: str, size: tuple[int, int], textures: int = 1) -> Target:
        """The target with a name; replaced if its size or number of textures changed."""
        return self._target(Target, name, size, textures)

    def pair(self, name: str, size: tuple[int, int], textures: int = 1) -> PingPong:
        """The pair of targets with a name; replaced if its size or number of textures changed."""
        return self._target(PingPong, name, size, textures)

    def _target(self, kind: type[Kind], name: str, size: tuple[int, int], textures: int) -> Kind:
        found = self._targets.get(name)
        if not isinstance(found, kind) or (found.size, found.attachments) != (size, textures):
            with in_pass(name):
                fresh = kind(self.context, size, textures)
            if found is not None:
                found.release()
            self._targets[name] = found = fresh
        return found

    def utility(self, text: str, name: str) -> Program:
        """A program of the package itself, by its fragment shader; it stays until the cache is released."""
        if text not in self._utilities:
            self._utilities[text] = Program(self.context, FULL_SCREEN, text, None, name)
        return self._utilities[text]

    def count_active(self, name: str) -> int:
        """Number of rays of a march that have not terminated. Waits for the device and overwrites the pair's back
        target.

        name : of its pair of targets.
        """
        march = self._targets[name]
        assert isinstance(march, PingPong)
        counter = self.utility(_COUNT_ACTIVE, "count of rays")
        with self.context.bound():
            kept = self.context.kept  # moderngl cannot free a query
            query = kept["count of rays"] = kept.get("count of rays") or self.context.gl.query(samples=True)
            with query:
                counter.draw(march.back, {"u_march": (march.front, 0)})
            return int(query.samples)

    def texture(self, data: Samples | Texels | Table | LiveTable) -> moderngl.Texture | moderngl.Texture3D:
        """The texture of sampled data or of an image; uploaded if it is not cached. That of a live table is for the
        bound parameters and time."""
        if isinstance(data, LiveTable):
            data = data.make()
        if data.key not in self._textures:
            made = upload_pyramid(self.context, data) if isinstance(data, Texels) else upload(self.context, data)
            self._textures[data.key] = made
            self._bytes[data.key] = data.nbytes
        self._textures.move_to_end(data.key)
        while not self._all_kept and (
            len(self._textures) > KEPT or (len(self._textures) > UNITS and sum(self._bytes.values()) > HELD)
        ):
            key, oldest = self._textures.popitem(last=False)
            del self._bytes[key]
            with self.context.bound():
                oldest.release()
        return self._textures[data.key]

    def lights(
        self, rows: NDArray[np.float32], balls: NDArray[np.float64] | None, lower: Any, upper: Any
    ) -> LightInputs:
        """The lights of this frame as textures. The textures of the frame before stay valid.

        balls : for a grid of cells, see `light_cells.build`; None for no grid. lower, upper : the box of all surfaces.
        """
        content = (rows.shape, rows.tobytes(), b"" if balls is None else balls.tobytes())
        found = next((made for known, made in self._lights if known == content), None)
        others = [kept for kept in self._lights if kept[1] is not found]
        with self.context.bound():
            if found is None:
                textures, most = {"u_lights": self._texels(lights.padded(rows))}, len(rows)
                if balls is not None:
                    cells = light_cells.build(balls, np.asarray(lower), np.asarray(upper))
                    textures["u_light_cells"], most = self._texels(cells.texels), cells.most
                found = LightInputs(textures, rows, most)
            while len(others) > 1 and not self._all_kept:
                _free_lights(others.pop(0)[1])
        self._lights = [*others, (content, found)]
        return found

    def _texels(self, rows: NDArray[np.float32]) -> moderngl.Texture:
        made = self.context.gl.texture(rows.shape[1::-1], 4, rows.tobytes(), dtype="f4")
        made.filter = (moderngl.NEAREST, moderngl.NEAREST)
        return made

    def has_lights(self, texture: object) -> bool:
        """True if a texture of lights is still cached."""
        return any(kept.uniforms["u_lights"] is texture for _, kept in self._lights)

    def free_targets(self, *keep: str) -> None:
        """Free all targets except those named in `keep`; they are recreated on demand."""
        for name in set(self._targets) - set(keep):
            self._targets.pop(name).release()

    @property
    def objects(self) -> dict[str, int]:
        """Numbers of live programs, target textures, and data textures."""
        targets = [(1 + isinstance(target, PingPong)) * target.attachments for target in self._targets.values()]
        return {
            "programs": len(self._programs),
            "targets": sum(targets),
            "data": len(self._textures) + sum(len(made.uniforms) for _, made in self._lights),
        }

    def release(self) -> None:
        """Free all resources. Idempotent."""
        self.free_targets()
        for program in self._programs.values():
            program.release()
        if not self.context.released:
            with self.context.bound():
                for texture in self._textures.values():
                    texture.release()
                for _, made in self._lights:
                    _free_lights(made)
        self._lights.clear()
        self._textures.clear()
        self._bytes.clear()
        for utility in self._utilities.values():
            utility.release()
        self._utilities.clear()
        self._programs.clear()
        self._drawn.clear()
