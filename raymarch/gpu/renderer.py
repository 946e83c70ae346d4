"""The renderer: runs the passes of a plan and returns a frame."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, Self
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from raymarch.errors import DeviceError, Doubt, RenderError, warn_of_doubts
from raymarch.expr.arrays import bound
from raymarch.expr.calls import checked
from raymarch.expr.convert import real, switch
from raymarch.gpu import vouch
from raymarch.gpu.budget import Budget
from raymarch.gpu.clock import Clock
from raymarch.gpu.context import Context, open_context
from raymarch.gpu.draw_call import DrawCall
from raymarch.gpu.draw_calls import Drawing, count_draws
from raymarch.gpu.frame import Frame, Timing, not_rendered
from raymarch.gpu.frame_inputs import FrameInputs
from raymarch.gpu.history import History
from raymarch.gpu.part import Picture, PicturePart
from raymarch.gpu.prepare import Prepared, Wanted, frame_uniforms, name_of, refuse_lacking
from raymarch.gpu.prepared_scenes import PreparedScenes
from raymarch.gpu.program import Program, in_pass
from raymarch.gpu.resource_cache import ResourceCache
from raymarch.gpu.tiles import WHOLE, Edge, draw_in_tiles
from raymarch.gpu.unread import Unread, unread_of
from raymarch.scene.camera import Pose
from raymarch.scene.parameter import ParamValue, Values, set_values
from raymarch.scene.quality import MOST_SAMPLES, SINGLE_PASS
from raymarch.scene.scene import Scene, as_scene
from raymarch.scene.silhouette import silhouette
from raymarch.sdf.node import Node

Progress = Callable[[float], None]


class Renderer:
    """Renders scenes at one size on one OpenGL context. Use it as a context manager.

    A renderer may be shared between threads: one thread draws a frame while the others wait. The OpenGL contexts of
    other code (pygame, moderngl, glfw) stay current. A process forked from one that has used OpenGL cannot draw; start
    worker processes by "spawn".

    Parameters
    ----------
    size : (width, height) in pixels, from 1 to the driver's limit.
    backend : "egl", "osmesa", "window" (hidden), or "auto": the first of these that works.
    device : index of the EGL device, >= 0.
    context : an open context to draw on, which `close` leaves open; None opens a new one.
    strict : True raises RenderError for a frame that has `Frame.doubts`. False emits a RenderWarning for values outside
        their range.

    Attributes
    ----------
    planned_for : (width, height) of the picture for which the plan chooses its passes. None is the rendered size;
        scenes are then planned again after `resize`.

    Raises
    ------
    DeviceError : no context can be opened, or the driver cannot draw the size.
    """

    @checked
    def __init__(
        self,
        size: tuple[int, int] = (640, 360),
        backend: str = "auto",
        device: int | None = None,
        context: Context | None = None,
        strict: bool = False,
    ) -> None:
        self.strict = switch("Renderer: strict", strict)
        if context is None:
            context, self._owns_context = open_context(backend, device), True
        else:
            self._owns_context = False
        self.context: Context = context
        self.clock = Clock(self.context)
        self.resources = ResourceCache(self.context)
        self.history = History()
        self.planned_for: tuple[int, int] | None = None
        self._prepared = PreparedScenes(self.resources)
        self._is_drawing = False
        self._edges: WeakKeyDictionary[Program, Edge] = WeakKeyDictionary()
        try:
            self._size = self._target_size(size)
        except DeviceError:
            self.close()
            raise

    def __repr__(self) -> str:
        driver = "closed" if self.context.released else f"{self.context.backend}: {self.context.driver.renderer}"
        return f"<Renderer {self._size[0]}x{self._size[1]}, {driver}>"

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) in pixels."""
        self._refuse_closed()
        return self._size

    @property
    def kept(self) -> int:
        """Maximum number of compiled programs in the cache, >= 1; the least recently used one is freed first."""
        return self.resources.kept

    @kept.setter
    def kept(self, programs: int) -> None:
        self.resources.kept = programs

    @property
    def compiled(self) -> int:
        """Number of programs that the driver has compiled so far."""
        return self.resources.compiled

    def resize(self, size: tuple[int, int]) -> None:
        """Change the size of the following frames. DeviceError if the driver cannot draw it; the old size then
        stays.

        Raises
        ------
        SceneError : arguments of another kind or outside their range.
        """
        with self.context.bound():
            self._refuse_while_drawing("resize")
            self._size = self._target_size(size)
            self.resources.free_targets("color")
            self.forget()

    def _target_size(self, size: Any) -> tuple[int, int]:
        """The size, once a target of that size exists. DeviceError if the driver cannot draw it."""
        return self.resources.target("color", size.tolist() if isinstance(size, np.ndarray | np.generic) else size).size

    def forget(self) -> None:
        """Discard the history: the next frame reuses nothing of earlier frames."""
        self.history = History()

    @checked
    def render(
        self,
        scene: Scene | Node,
        time: float = 0.0,
        params: Mapping[str, ParamValue] | None = None,
        outputs: Sequence[Wanted] = ("color",),
        progress: Progress | None = None,
        pose: Pose | None = None,
        within: float | None = None,
        part: PicturePart | None = None,
    ) -> Frame:
        """Render one frame of a scene.

        Parameters
        ----------
        scene : a Scene, or a solid, which is put into a default one.
        time : value of `raymarch.time` in seconds.
        params : values of parameters by name; the others keep their defaults.
        outputs : arrays to render now, by name. "color" has a pass of its own; most others share one pass. Arrays that
            are not listed are rendered on first access. A `Slice` is the output "slice" on that plane; the name alone
            is the axis-aligned plane through the centre that faces the camera most.
        progress : called after each tile with the fraction done, 0 to 1. The picture is the same bit for bit.
        pose : camera pose to use instead of the scene's camera.
        within : time budget in milliseconds of a frame that is split into passes by Quality(steps_per_pass=...,
            lights_per_pass=...). Pixels that are not drawn by then, and light that was not added, follow in the next
            frame, which needs temporal="accumulate" and an unchanged picture; `frame.complete` tells whether nothing
            is left. None sets no budget.
        part : the part of a larger picture to render; the renderer's size is that of the part. Not with `temporal` or
            rays="interpolated".

        Returns
        -------
        Frame

        Raises
        ------
        SceneError : an unknown parameter, a value out of range, a degenerate camera, an unknown output.
        PlanError : the scene cannot be planned.
        ShaderError : the driver refuses the shader.
        DeviceError : the renderer is closed, or the driver lacks an extension that an output needs.
        RenderError : the renderer is strict, and the frame has doubts.
        """
        scene = as_scene("render", scene)
        limit = np.inf if within is None else real("within", within, 0.0, np.inf, "milliseconds >= 0, or None")
        self._refuse_closed()
        with self.context.bound():
            return self._render(self._picture(scene, params, time, outputs, pose, part), progress, limit)

    def _picture(
        self,
        scene: Scene,
        params: Mapping[str, ParamValue] | None,
        time: float,
        outputs: Sequence[Wanted],
        pose: Pose | None,
        part: PicturePart | None = None,
    ) -> Picture:
        """What a frame shows, once its values are checked."""
        scene = self._prepared.drawn_for(scene, outputs)
        ready = self.prepared(scene, outputs, part)
        values = set_values(ready.plan.parameters, params, time, scene.where)
        width, height = size = self.size if part is None else part.whole
        listed = (outputs,) if isinstance(outputs, str) else tuple(outputs)
        return Picture(scene, values, pose or ready.pose(values, width / height), listed, size, part)

    def _render(self, picture: Picture, progress: Progress | None, within: float) -> Frame:
        scene, values, pose, size = picture.scene, picture.values, picture.pose, self.size
        samples = scene.quality.samples

        def passes(picture: Picture, *limits: Any) -> tuple[dict[str, Unread], list[Timing]]:
            nonlocal samples
            own = picture.scene is scene
            found = self._passes(picture, self.history if own else History("silhouette "), *limits)
            if "color" in found[0] and own and scene.quality.temporal != "off":
                samples = min(max(samples, self.history.mean.samples), MOST_SAMPLES)
            return found

        def render_for(name: str, scene: Scene = scene, wanted: str = "") -> tuple[dict[str, Unread], list[Timing]]:
            self._refuse_closed(wanted or name)
            with self.context.bound():
                if self.size != size:
                    what = f"this renderer draws {self.size} now, the frame is {size}"
                    raise DeviceError(what, legal="access the array before `resize`")
                outputs = [output for output in picture.outputs if name_of(output) == name] or [name]
                return passes(replace(picture, scene=self._prepared.drawn_for(scene, outputs), outputs=outputs))

        unread, timings = passes(picture, progress, within)
        ready, history = self.prepared(scene, picture.outputs, picture.part), self.history
        complete = scene.quality.steps_per_pass is None or history.march.arrived
        complete = complete and (history.light.complete or "color" not in ready.texts)
        broken = ready.violations(values)

        def color_of(scene: Scene) -> NDArray[np.float32]:
            return render_for("color", scene, "alpha")[0]["color"].array("color")

        def transparency() -> tuple[NDArray[np.float32], NDArray[np.float32]]:
            seen = color_of(silhouette(scene, samples))[..., 0]
            if scene.post or (scene.fog is not None and scene.fog.covers_sky):  # spread, or dimmed in colour
                return 1.0 - seen, color_of(silhouette(scene, samples, scene.sky, scene.post))
            return 1.0 - seen, np.clip(seen, 0.0, 1.0)[..., None] * picture.sky(size)

        frame = Frame(
            size=size,
            time=values.time,
            timings=timings,
            _arrays={},
            _render=render_for,
            tone=scene.tone,
            complete=complete,
            pose=pose,
            warnings=broken,
            _doubts=partial(self._doubts, scene, ready, values),
            _transparency=transparency,
            spread=bool(scene.post),
            _of=picture.shown,
            _unread=unread,
        )
        if not self.strict:
            warn_of_doubts(broken)
        elif doubts := frame.doubts(steps=True):
            raise RenderError(doubts)
        return frame

    def _doubts(self, scene: Scene, ready: Prepared, values: Values, frame: Frame, steps: bool | None) -> list[Doubt]:
        """See `Frame.doubts`."""
        pose = frame.pose
        assert pose is not None
        known = None if steps is False else frame.drawn("done")
        if steps and known is None:
            known = self._sparse(scene, values, pose)
        return vouch.doubts_of(frame, scene, ready, values, None if known is None else known.array("done"))

    def _sparse(self, scene: Scene, values: Values, pose: Pose) -> Unread:
        """The geometry arrays of a sparse, even subset of the picture's rays, with the pixel footprint of the
        picture."""
        small = vouch.sparse_size(self.size)
        plain = scene.quality.replace(**SINGLE_PASS, samples=2, edges="samples")  # from where their pixel's cone ended
        ready, inputs = self._ready(Picture(scene.replace(quality=plain), values, pose, ("done",), self.size))
        inputs = inputs.with_uniforms({"u_resolution": small})
        draw_calls = list(_named(Drawing(self.resources, ready, inputs, small, History())))
        for call in draw_calls:
            with in_pass(call.chosen.name):
                call.draw()
        return Unread(draw_calls[-1].chosen, draw_calls[-1].target)

    def draw_calls(
        self,
        scene: Scene,
        time: float = 0.0,
        params: Mapping[str, ParamValue] | None = None,
        outputs: Sequence[Wanted] = ("color",),
        pose: Pose | None = None,
    ) -> list[DrawCall]:
        """The draw calls of a frame, into textures that stay on the device. The window uses them.

        Parameters and errors are those of `render`. A texture keeps its content until a later draw call uses the same
        target.
        """
        with self.resources.keep_textures():  # samples of an open shutter have their own
            return list(self.iterate_draw_calls(scene, time, params, outputs, pose))

    def iterate_draw_calls(
        self,
        scene: Scene,
        time: float = 0.0,
        params: Mapping[str, ParamValue] | None = None,
        outputs: Sequence[Wanted] = ("color",),
        pose: Pose | None = None,
        budget: Budget | None = None,
    ) -> Iterator[DrawCall]:
        """As `draw_calls`, one at a time: draw each one before requesting the next.

        budget : the time of a frame that is split by Quality(steps_per_pass=..., lights_per_pass=...). Add the time of
            each draw call to it. What does not fit is left to the next frame; `history.march.arrived` then tells
            whether all rays have terminated, and `history.light.complete` whether all light is added.
        """
        yield from _named(self._drawing(self._picture(scene, params, time, outputs, pose), self.history, budget))

    def _drawing(self, picture: Picture, history: History, budget: Budget | None) -> Drawing:
        ready, inputs = self._ready(picture)
        at = self._shutter(ready, picture)
        if at is not None:  # samples depend on values that may have no effect at the frame's time
            inputs = replace(inputs, opening=(ready.plan.given.camera.open_seconds(picture.values), picture.values))
        grids = partial(self.inputs, values=picture.values, pose=picture.pose, outputs=picture.outputs)
        return Drawing(self.resources, ready, inputs, self.size, history, budget, at, picture.part, grids)

    def adopt(self, scene: Scene, prepared: Prepared, outputs: Sequence[Wanted] = ("color",)) -> None:
        """Cache a scene that was prepared elsewhere, for example in another thread."""
        self._prepared.adopt(scene, outputs, self.planned_for or self._size, prepared)

    def prepared(
        self, scene: Scene, outputs: Sequence[Wanted] = ("color",), part: PicturePart | None = None
    ) -> Prepared:
        """The plan and shader of a scene, or of parts of its picture, from the cache if possible."""
        size = self.planned_for or self._size if part is None else part.whole
        return self._prepared.of(scene, outputs, size, part is not None)

    def _ready(self, picture: Picture) -> tuple[Prepared, FrameInputs]:
        """The plan of a frame and the inputs of all its passes."""
        self._refuse_closed()
        ready = self.prepared(picture.scene, picture.outputs, picture.part)
        refuse_lacking(ready, self.context)
        return ready, self.inputs(ready, picture.values, picture.pose, picture.outputs, picture.size)

    def inputs(
        self,
        ready: Prepared,
        values: Values,
        pose: Pose,
        outputs: Sequence[Wanted] = (),
        size: tuple[int, int] | None = None,
    ) -> FrameInputs:
        """The inputs of all passes of a prepared scene for one frame, including its data textures.

        size : of the whole picture; None is the renderer's.
        """
        plan, found = ready.plan, None
        uniforms = frame_uniforms(ready, values, size or self.size, pose, outputs)
        effects = {each.name: each.effect.numbers(values) for each in plan.passes if each.effect is not None}
        with in_pass(*(chosen.name for chosen in plan.passes)), bound(values.params, values.time):
            uniforms.update({name: self.resources.texture(data) for name, data in ready.shader.samples.items()})
            if ready.lights is not None:
                facts = plan.scene.node.facts
                balls = None if ready.balls is None else ready.balls()
                found = self.resources.lights(ready.lights(), balls, facts.lower, facts.upper)
                uniforms.update(found.uniforms)
        return FrameInputs(uniforms, effects, found)

    def _shutter(self, ready: Prepared, picture: Picture) -> Callable[[float], FrameInputs] | None:
        """The inputs while the shutter is open, for `Drawing`. The pose of the scene's camera moves with it."""
        scene, values, aspect = ready.plan.given, picture.values, picture.size[0] / picture.size[1]
        if not scene.motion_blur:
            return None
        seconds = scene.camera.open_seconds(values)
        follows = picture.pose.same(scene.pose(values, aspect))

        def at(share: float) -> FrameInputs:
            then = replace(values, time=values.time + share * seconds)
            pose = scene.pose(then, aspect) if follows else picture.pose
            return self.inputs(ready, then, pose, picture.outputs, picture.size)

        return at

    def _refuse_closed(self, array: str = "") -> None:
        """DeviceError if the renderer is closed. array : the array of a frame that is wanted."""
        if self.context.released:
            self.context.refuse_fork()
            if array:
                raise not_rendered("this renderer is closed", array)
            raise DeviceError("this renderer is closed", legal="another Renderer(...), or call it in the `with` block")

    def _refuse_while_drawing(self, what: str) -> None:
        """DeviceError if `progress` calls a method that would overwrite or free the textures of the frame in
        progress."""
        if self._is_drawing:
            raise DeviceError(f"{what} was called in the middle of a frame", legal="after it, or on another Renderer")

    def _passes(
        self, picture: Picture, history: History, progress: Progress | None = None, within: float = np.inf
    ) -> tuple[dict[str, Unread], list[Timing]]:
        self._refuse_while_drawing("render")
        self._is_drawing = True
        try:
            return self._drawn(picture, history, self._lent(progress), within)
        except BaseException:
            self.forget()  # the history already counts draws that were not made
            raise
        finally:
            self._is_drawing = False

    def _drawn(
        self, picture: Picture, history: History, progress: Progress | None, within: float
    ) -> tuple[dict[str, Unread], list[Timing]]:
        timings: list[Timing] = []
        shown: dict[str, tuple[Any, Any]] = {}
        finite, steps = within < np.inf, picture.scene.quality.steps_per_pass
        budget = Budget(within, interlaced=finite) if finite or steps is not None else None
        drawing = self._drawing(picture, history, budget)
        most = count_draws(drawing)
        for call in _named(drawing):
            first = self.resources.first_draw(call.program)
            with in_pass(call.chosen.name):
                drawn = self._draw(call, None if progress is None else _part(progress, len(timings), most))
            timings.append(Timing(call.chosen.name, drawn, call.compile, first))
            if budget is not None:
                budget.add(drawn, first=first)
            shown |= {call.chosen.name: (call.chosen, call.target)} if call.chosen.outputs else {}
        if progress is not None and len(timings) < most:
            progress(1.0)
        return unread_of({**drawing.kept, **shown}), timings

    def _lent(self, progress: Progress | None) -> Progress | None:
        """`progress`, called with the OpenGL context that was current before the frame."""
        if progress is None:
            return None

        def call(share: float) -> None:
            with self.context.lent():
                progress(share)

        return call

    def _draw(self, call: DrawCall, progress: Progress | None) -> float:
        """Draw a pass, at once or in tiles. Returns milliseconds."""
        width, height = call.target.size
        if call.part is not None or (progress is None and width * height <= WHOLE):
            return self.clock.time(call.draw)
        known = self._edges.setdefault(call.program, Edge())
        return draw_in_tiles(
            call.target.size,
            lambda tile: self.clock.time(lambda: call.draw(tile)),
            progress or (lambda share: None),
            known,
        )

    def close(self) -> None:
        """Free all resources. Idempotent. In a forked process it frees nothing, since the parent owns them."""
        if self.context.released:
            self.resources.release()
        else:
            with self.context.bound():
                self._refuse_while_drawing("close")
                self.resources.release()
        self._prepared.clear()
        if self._owns_context:
            self.context.release()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _named(drawing: Drawing) -> Iterator[DrawCall]:
    """The draw calls; a device error while one is made names the passes."""
    names = tuple(chosen.name for chosen in drawing.ready.plan.passes)
    calls = iter(drawing)
    while True:
        with in_pass(*names):
            call = next(calls, None)
        if call is None:
            return
        yield call


def _part(progress: Progress, i: int, n: int) -> Progress:
    return lambda share: progress(min((i + share) / n, 1.0))
