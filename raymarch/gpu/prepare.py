"""Preparation of a scene for rendering: plan, shader texts and uniforms. Needs no OpenGL context."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from raymarch.errors import SceneError
from raymarch.expr.arrays import bound, evaluator_of
from raymarch.expr.convert import described, short
from raymarch.expr.node import Expr
from raymarch.expr.raw import without_twin
from raymarch.gpu.budget import LightPace
from raymarch.gpu.program import FULL_SCREEN, RAYS, Elements
from raymarch.gpu.slices import Slice
from raymarch.plan import OUTPUTS, Plan, marching, plan
from raymarch.plan.hoisting import with_hoisted
from raymarch.plan.passes import DRAWN
from raymarch.scene.camera import Pose
from raymarch.scene.parameter import Values
from raymarch.scene.scene import Scene
from raymarch.shader import Shader, assemble
from raymarch.shader.assemble import assemble_effect

Wanted: TypeAlias = str | Slice
"""An output of a frame: its name, or a view with the parameters of that output."""


@dataclass(frozen=True, slots=True)
class Prepared:
    """The plan and shader of a scene.

    plan, shader : of the scene.
    texts : the fragment shader of each pass. vertex : the vertex shader of all passes.
    distance : the field in float64, a function of points relative to the plan's origin; returns a tuple of one array.
        None for a field without a CPU evaluation (raw GLSL).
    rest : the same of the field that rays outside of all solids are marched through; None if it is the whole field.
    constants : for each pass, the uniforms that replace numbers of its text, and their values.
    effects : the shader of each post effect, by the name of its pass.
    pace : the times of passes that add light.
    """

    plan: Plan
    shader: Shader
    texts: Mapping[str, str]
    vertex: str
    distance: Callable[..., tuple[Any, ...]] | None
    constants: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    rest: Callable[..., tuple[Any, ...]] | None = None
    effects: Mapping[str, Shader] = field(default_factory=dict)
    pace: LightPace = field(default_factory=LightPace, compare=False)


def prepare(scene: Scene, outputs: Sequence[Wanted] = ("color",), size: tuple[int, int] | None = None) -> Prepared:
    """Plan and assemble a scene for the passes that render `outputs`. May run in any thread.

    size : (width, height) of the picture, by which the plan estimates the gain of further passes.
    Raises SceneError for an unknown output and PlanError for a scene that cannot be planned.
    """
    return assembled(plan(scene, passes_for(outputs), size))


def assembled(made: Plan, part: bool = False) -> Prepared:
    """Assemble the shader of a plan. part : True to draw parts of a picture."""
    shader = assemble(made, part=part)
    effects = {chosen.name: assemble_effect(chosen) for chosen in made.passes if chosen.effect is not None}
    texts = {chosen.name: effects.get(chosen.name, shader).text(chosen.name) for chosen in made.passes}
    vertex = RAYS if marching.interpolated(made.scene) else FULL_SCREEN
    start = made.seen or made.field
    known = not without_twin(start.body)
    distance = evaluator_of(start) if known else None
    marched = made.analytic.rest
    rest = evaluator_of(marched) if known and marched is not None else None
    return Prepared(made, shader, texts, vertex, distance, rest=rest, effects=effects)


def name_of(output: Wanted) -> str:
    return output.output if isinstance(output, Slice) else output


def passes_for(outputs: Sequence[Wanted]) -> list[str]:
    """The names of the passes that render `outputs`."""
    if not isinstance(outputs, Iterable) or isinstance(outputs, np.ndarray | np.generic | Expr):
        raise SceneError(f"outputs = {described(outputs)}", legal=", ".join(OUTPUTS))
    names = [outputs] if isinstance(outputs, str) else [name_of(output) for output in outputs]
    for name in names:
        if not isinstance(name, str) or name not in OUTPUTS:
            raise SceneError(f"outputs: {short(name)}", legal=", ".join(OUTPUTS))
    return [name for name, drawn in DRAWN.items() if drawn.outputs.keys() & names] or ["color"]


def frame_uniforms(
    ready: Prepared, values: Values, size: tuple[int, int], pose: Pose | None = None, outputs: Sequence[Wanted] = ()
) -> dict[str, Any]:
    """The uniforms of a frame: camera, size, parameters, time. Computed in float64.

    pose : camera pose to use instead of the scene's. outputs : that are wanted, some with parameters of their own.
    """
    scene = ready.plan.scene
    values = with_hoisted(ready.plan.hoisted, values)
    given, origin = pose or ready.plan.given.pose(values, size[0] / size[1]), ready.plan.origin
    if given.orthographic != scene.camera.orthographic:
        what = f"pose: of {'an orthographic' if given.orthographic else 'a perspective'} camera"
        legal = f"of one with projection={scene.camera.projection!r}, as the scene's camera"
        raise SceneError(what, legal=legal, where=scene.camera.where)
    pose = replace(given, position=given.position - origin)
    uniforms: dict[str, Any] = {
        "u_camera_position": pose.position,
        "u_camera_frame": pose.frame,
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
    }
    uniforms |= _start(ready, values, pose.position, 1e-9 * uniforms["u_far"])
    if ready.plan.sky_light:
        uniforms["u_sky_light"] = Elements(scene.sky.harmonics(values))
    if any(Slice.output in chosen.outputs for chosen in ready.plan.passes):
        own = next((output for output in outputs if isinstance(output, Slice)), None)
        uniforms |= (own or Slice.facing(ready.plan.given, given)).uniforms(origin)
    for name, uniform in ready.shader.parameters.items():
        twin = ready.plan.twins.get(name)  # a parameter or time
        moving = twin is not None and twin.op == "time"
        uniforms[uniform] = values.time if moving else values.params[name if twin is None else twin.data.name]
    return uniforms


def _start(ready: Prepared, values: Values, position: NDArray[Any], step: float) -> dict[str, Any]:
    """The field at the camera, from which all rays start, evaluated in float64, once per frame.

    step : length of the differences that give the gradient.

    u_side is -1 inside the solid, else 1. u_start is the gradient and the value of the field, both times u_side. The
    value is rounded down, so that float32 certifies no more than float64.
    """
    if ready.distance is None:
        return {"u_side": 1.0, "u_start": (0.0, 0.0, 0.0, 0.0)}
    with bound(values.params, values.time):
        points = np.vstack([position, position + step * np.eye(3)])
        found = np.broadcast_to(ready.distance(points)[0], 4)
        side = -1.0 if found[0] < 0.0 else 1.0
        if ready.rest is not None and side > 0.0:
            found = np.broadcast_to(ready.rest(points)[0], 4)
    with np.errstate(divide="ignore", invalid="ignore"):  # an empty solid is infinitely far away
        gradient = side * (found[1:] - found[0]) / step
    if not np.all(np.isfinite([*gradient, found[0]])):
        return {"u_side": side, "u_start": (0.0, 0.0, 0.0, 0.0)}
    value = side * found[0] * (1.0 - 1e-6) - 1e-6 * np.abs(position).max()
    return {"u_side": side, "u_start": (*gradient, max(value, 0.0))}
