"""Preparation of a scene for rendering: plan, shader texts and uniforms. Needs no OpenGL context."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from raymarch.errors import DeviceError, Doubt, SceneError
from raymarch.expr.arrays import Remembered, bound, bound_values, evaluator_of
from raymarch.expr.branches import UNSEEN
from raymarch.expr.convert import described, short
from raymarch.expr.node import Expr
from raymarch.expr.raw import without_twin
from raymarch.expr.walk import find
from raymarch.gpu.budget import CellPace, LightPace
from raymarch.gpu.camera_field import CameraField
from raymarch.gpu.program import FULL_SCREEN, RAYS, Elements
from raymarch.gpu.slices import Slice
from raymarch.plan import OUTPUTS, Plan, lights, plan, relit
from raymarch.plan.device import DeviceClass
from raymarch.plan.hoisting import with_hoisted
from raymarch.plan.live_lights import LiveLights
from raymarch.plan.marching import interpolated
from raymarch.plan.passes import DRAWN, TALLIES
from raymarch.scene.camera import Pose
from raymarch.scene.legal import violations
from raymarch.scene.parameter import Values
from raymarch.scene.quality import SINGLE_PASS
from raymarch.scene.scene import Scene
from raymarch.shader import Shader, assemble
from raymarch.shader.assemble import assemble_effect

if TYPE_CHECKING:
    from raymarch.gpu.context import Context

Result = TypeVar("Result")

Wanted: TypeAlias = str | Slice
"""An output of a frame: its name, or a view with the parameters of that output."""


@dataclass(frozen=True, slots=True)
class Prepared:
    """The plan and shader of a scene.

    plan, shader : of the scene.
    texts : the fragment shader of each pass. vertex : the vertex shader of all passes.
    distance : the field in float64, a function of points relative to the plan's origin; returns a tuple of one array.
        None for a field without a CPU evaluation (raw GLSL).
    at_camera : the same at the camera, for the uniforms of a frame.
    sky : the harmonics of the sky for the bound parameters and time; None if the shader does not read them.
    lights, balls : the rows of lights, and what they reach, likewise.
    constants : for each pass, the uniforms that replace numbers of its text, and their values.
    effects : the shader of each post effect, by the name of its pass.
    pace : the times of passes that add light. cells : those of passes within a budget.
    """

    plan: Plan
    shader: Shader
    texts: Mapping[str, str]
    vertex: str
    distance: Callable[..., tuple[Any, ...]] | None
    at_camera: CameraField = field(compare=False)
    sky: Remembered[Elements] | None = field(compare=False)
    lights: Remembered[NDArray[np.float32]] | None = field(compare=False)
    balls: Remembered[NDArray[np.float64]] | None = field(compare=False)
    constants: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    effects: Mapping[str, Shader] = field(default_factory=dict)
    pace: LightPace = field(default_factory=LightPace, compare=False)
    cells: CellPace = field(default_factory=CellPace, compare=False)
    _kept: dict[str, tuple[Any, Any]] = field(init=False, default_factory=dict, compare=False, repr=False)

    def violations(self, values: Values) -> list[Doubt]:
        """What values of parameters and time make illegal, one sentence each. Those of the last frame are kept."""
        key = values.time, tuple(values.params.items())
        return self.once("violations", key, lambda: violations(self.plan.conditions, values))

    def pose(self, values: Values, aspect: float) -> Pose:
        """The pose of the scene's camera; see `Scene.pose`. That of the last frame is kept."""
        scene = self.plan.given
        still = all(value.is_constant for value in scene.camera.expressions)
        key = (aspect,) if still else (aspect, values.time, tuple(values.params.items()))
        return self.once("pose", key, lambda: scene.pose(values, aspect))

    @property
    def digest(self) -> bytes:
        """A hash of the texts of all passes. Textures are named there by their content."""
        listed = (f"{name}\0{text}\0" for name, text in sorted(self.texts.items()))
        return self.once("digest", None, lambda: hashlib.sha256("".join(listed).encode()).digest())

    @property
    def in_grids(self) -> Prepared:
        """The same picture, for draws of some of its pixels that take all steps of a ray at once."""
        made = self.plan
        marching = replace(made.marching, steps_per_pass=None)
        passes = [each for each in made.passes if each.often != "steps"]
        return self.once("grids", None, lambda: assembled(replace(made, marching=marching, passes=passes), "GRID"))

    def once(self, name: str, key: Any, make: Callable[[], Result]) -> Result:
        """The last result of a name, made again if its key has changed."""
        known = self._kept.get(name)
        if known is None or known[0] != key:
            self._kept[name] = known = key, make()
        found: Result = known[1]
        return found


def prepare(
    scene: Scene,
    outputs: Sequence[Wanted] = ("color",),
    size: tuple[int, int] | None = None,
    device: DeviceClass | None = None,
    live: LiveLights | None = None,
) -> Prepared:
    """Plan and assemble a scene for the passes that render `outputs`. May run in any thread.

    size : (width, height) of the picture, by which the plan estimates the gain of further passes.
    device : the class of devices that draw it. live : how lights are drawn that come and go; see `raymarch.plan.plan`.
    Raises SceneError for an unknown output and PlanError for a scene that cannot be planned.
    """
    return assembled(plan(scene, passes_for(outputs), size, device=device, live=live))


def assembled(made: Plan, variant: str = "") -> Prepared:
    """Assemble the shader of a plan. variant : "PART" to draw parts of a picture, "GRID" to draw some of its pixels."""
    shader = assemble(made, variant=variant)
    effects = {chosen.name: assemble_effect(chosen) for chosen in made.passes if chosen.effect is not None}
    texts = {chosen.name: effects.get(chosen.name, shader).text(chosen.name) for chosen in made.passes}
    vertex = RAYS if interpolated(made.scene) else FULL_SCREEN
    start = made.seen or made.field
    distance = None if without_twin(start.body) else evaluator_of(start)
    given = made.scene
    return Prepared(
        made,
        shader,
        texts,
        vertex,
        distance,
        CameraField(made),
        _live(lambda now: Elements(given.sky.harmonics(now)), given.sky.expressions) if made.sky_light else None,
        *_lights(made),
        effects=effects,
    )


def with_lights(ready: Prepared, scene: Scene, live: LiveLights | None) -> Prepared | None:
    """A scene that differs in its lights alone from a prepared one, if its shader is the same; else None.

    live : how the lights are drawn; see `LightMemory.fit`.
    """
    made = relit(ready.plan, scene, live)
    if made is None:
        return None
    rows, balls = _lights(made)
    return replace(ready, plan=made, lights=rows, balls=balls, pace=LightPace(), cells=CellPace())


def _lights(made: Plan) -> tuple[Remembered[NDArray[np.float32]] | None, Remembered[NDArray[np.float64]] | None]:
    """The rows of the lights of a scene, and what they reach, where the shader reads them."""
    scene, count = made.scene, len(made.given.lights)
    rows, balls = None, None
    if made.lights_as_data:
        rows = _live(partial(lights.rows, scene, count=count), _last(lights.table(scene).varied))
    if made.lights_in_cells:
        balls = _live(partial(lights.balls, scene, count=count), _last(lights.table(scene).moving))
    return rows, balls


def _live(make: Callable[[Values], Result], read: Sequence[Expr]) -> Remembered[Result]:
    """A function of the parameters and time that some expressions read. make : of the values of a frame."""
    return Remembered(lambda: make(Values(*bound_values())), find(read, "param", "time"))


def _last(listed: Sequence[tuple[int, int, Expr]]) -> list[Expr]:
    return [value for _, _, value in listed]


def name_of(output: Wanted) -> str:
    return output.output if isinstance(output, Slice) else output


def passes_for(outputs: Sequence[Wanted]) -> list[str]:
    """The names of the passes that render `outputs`."""
    if not isinstance(outputs, Iterable) or isinstance(outputs, np.ndarray | np.generic | Expr):
        raise SceneError(f"outputs = {described(outputs)}", legal=", ".join(OUTPUTS))
    names = [outputs] if isinstance(outputs, str) else [name_of(output) for output in outputs]
    known = TALLIES if names and all(name in TALLIES for name in names) else OUTPUTS
    for name in names:
        if not isinstance(name, str) or name not in known:
            raise SceneError(f"outputs: {short(name)}", legal=f"{', '.join(OUTPUTS)}; alone: {', '.join(TALLIES)}")
    return [name for name, drawn in DRAWN.items() if drawn.outputs.keys() & names] or ["color"]


def drawn_for(scene: Scene, outputs: Sequence[Wanted]) -> Scene:
    """The scene that is drawn for some outputs: evaluations by all rays are those of one camera ray a pixel, without
    cones, earlier frames and post effects."""
    if passes_for(outputs) != ["tally"]:
        return scene
    quality = scene.quality.replace(**SINGLE_PASS, samples=1)
    return scene if quality == scene.quality and not scene.post else scene.replace(post=[], quality=quality)


def refuse_lacking(ready: Prepared, context: Context) -> None:
    """DeviceError if a driver lacks an extension that a pass needs."""
    for chosen in ready.plan.passes:
        if chosen.extension and chosen.extension not in context.gl.extensions:
            raise DeviceError(
                f"{chosen.name}: {context.driver.renderer} has no {chosen.extension}",
                legal=f"a driver with {chosen.extension}, such as Mesa's or NVIDIA's for most GPUs",
            )


def frame_uniforms(
    ready: Prepared, values: Values, size: tuple[int, int], pose: Pose | None = None, outputs: Sequence[Wanted] = ()
) -> dict[str, Any]:
    """The uniforms of a frame: camera, size, parameters, time. Computed in float64.

    pose : camera pose to use instead of the scene's. outputs : that are wanted, some with parameters of their own.
    """
    scene = ready.plan.scene
    values = with_hoisted(ready.plan.hoisted, values)
    given, origin = pose or ready.pose(values, size[0] / size[1]), ready.plan.origin
    if given.orthographic != scene.camera.orthographic:
        what = f"pose: of {'an orthographic' if given.orthographic else 'a perspective'} camera"
        legal = f"of one with projection={scene.camera.projection!r}, as the scene's camera"
        raise SceneError(what, legal=legal, where=scene.camera.where)
    pose = replace(given, position=given.position - origin)
    uniforms: dict[str, Any] = {
        "u_camera_position": pose.position,
        "u_camera_frame": np.array(pose.frame),  # the user's may change in place
        "u_tan_half_fov": pose.tan_half_fov,
        "u_half_height": pose.half_height or 0.0,
        "u_resolution": size,
        "u_pixel": pose.pixel(size[1]),
        "u_far": scene.far(pose, values),
        "u_near": pose.near,
        "u_clip_far": min(pose.far, 1e30),
        "u_lens": (pose.aperture, pose.focus),
        "u_time": values.time,
        "u_origin": origin,
        UNSEEN.data: 0.0,
    }
    uniforms |= ready.at_camera.uniforms(values, pose.position, 1e-9 * uniforms["u_far"])
    if ready.sky is not None:
        with bound(values.params, values.time):
            uniforms["u_sky_light"] = ready.sky()
    if any(Slice.output in chosen.outputs for chosen in ready.plan.passes):
        own = next((output for output in outputs if isinstance(output, Slice)), None)
        uniforms |= (own or Slice.facing(ready.plan.given, given)).uniforms(origin)
    for name, uniform in ready.shader.parameters.items():
        twin = ready.plan.twins.get(name)  # a parameter or time
        moving = twin is not None and twin.op == "time"
        uniforms[uniform] = values.time if moving else values.params[name if twin is None else twin.data.name]
    return uniforms
