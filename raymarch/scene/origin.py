"""What float32 holds of a scene: the origin of the shader's coordinates, and limits of size.

The origin usually is that of the scene; for a scene far away it is nearby. Camera, solids and lights are moved to it in
float64, before they reach the shader. The shader then holds small numbers only, and the picture is that of the same
scene at the origin.

float32 holds a length of 1e20, but not its square. A scene that float32 cannot hold is refused. It is not rescaled
automatically: patterns, functions of a point and constants in a user's own nodes contain lengths that are not marked as
lengths.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from raymarch.errors import Doubt, PlanError, SceneError
from raymarch.expr.arrays import bound, evaluator, evaluator_of
from raymarch.expr.derivative import companion
from raymarch.expr.function import Function
from raymarch.expr.node import const
from raymarch.expr.raw import without_twin
from raymarch.scene.camera import Pose
from raymarch.scene.light import Light
from raymarch.scene.parameter import Values, set_values
from raymarch.scene.scene import Scene
from raymarch.sdf.evaluation import lower
from raymarch.sdf.levels import has_levels
from raymarch.sdf.shifted import shifted
from raymarch.sdf.visibility import FAR_AWAY, hiding_nodes

FAR = 64.0
"""Ratio of distance from the origin to scene size above which another origin is chosen. At this ratio 6 of the 24 bits
of float32 are lost."""

ULP = 2.0**-23


@dataclass(frozen=True, slots=True)
class DefaultView:
    """A scene with its parameters at their defaults. pose : of its camera; None if it is degenerate with these values.
    reach : see `reach_of`."""

    scene: Scene
    values: Values
    pose: Pose | None
    reach: float | None


def default_view(scene: Scene) -> DefaultView:
    """The scene with its parameters at their defaults."""
    values = set_values(scene.parameters)
    pose = default_pose(scene, values)
    return DefaultView(scene, values, pose, None if pose is None else reach_of(scene, pose))


def origin_of(view: DefaultView) -> NDArray[np.float64]:
    """The origin of coordinates near the camera, shape (3,), float64; 0 if the scene is not far away.

    It is rounded to multiples of a power of two above the size of the scene. So a scene moved by a round number gives
    the same shader text.
    """
    pose, reach = view.pose, view.reach
    if pose is None:
        return np.zeros(3)
    if reach is None:
        reach = _nearest(lower(view.scene.node), pose.position, view.values)
    reach = reach or 1.0
    if np.max(np.abs(pose.position)) <= FAR * reach:
        return np.zeros(3)
    grid = 2.0 ** np.ceil(np.log2(reach))
    origin: NDArray[np.float64] = grid * np.rint(pose.position / grid)
    return origin


def default_pose(scene: Scene, values: Values) -> Pose | None:
    """The pose of the camera; None if it is degenerate as long as parameters have these values, their defaults."""
    try:
        return scene.pose(values)
    except SceneError:
        return None


def reach_of(scene: Scene, pose: Pose) -> float | None:
    """The size of a scene as seen by a camera: the distance to the centre of its bounded part plus the size of that."""
    subject = scene.subject
    if subject is None:
        return None
    middle = 0.5 * (subject.lower + subject.upper)
    return float(np.linalg.norm(pose.position - middle) + np.linalg.norm(subject.size))


def _nearest(field: Function, position: NDArray[np.float64], values: Values) -> float | None:
    """Lower bound of the distance from the camera to the nearest surface.

    None if only the GPU can evaluate the field, or if the surface touches the camera.
    """
    if without_twin(field.body):
        return None
    with bound(values.params, values.time):
        distance = evaluator_of(field)(position)[0]
    return abs(float(distance)) or None


def seen_from(scene: Scene, origin: NDArray[np.float64]) -> Scene:
    """The scene with its solids, lights and fog moved to an origin. The camera is unchanged."""
    if not np.any(origin):
        return scene
    return scene.replace(
        node=shifted(scene.node, origin),
        lights=tuple(_light_from(light, origin) for light in scene.lights),
        fog=None if scene.fog is None else scene.fog.moved(origin),
    )


def _light_from(light: Light, origin: NDArray[np.float64]) -> Light:
    if not light.has_position:
        return light
    return light.replace(position=light.arguments()["position"] - const(origin))


def range_doubts(view: DefaultView, origin: NDArray[np.float64], field: Function) -> list[Doubt]:
    """A doubt if float32 cannot hold the epsilon of the quality, at default parameters and 1080 rows.

    field : the distance, as a function of the point relative to `origin`.

    Each of several sums rounds a point by half a unit in the last place of its largest coordinate, 2 ulp in total.
    If that exceeds epsilon, the error of hits is that of the rounding, not that of the quality.
    """
    scene, pose = view.scene, view.pose
    away = None if pose is None else _nearest(field, pose.position - origin, view.values)
    if pose is None or away is None:
        return []
    largest = float(np.max(np.abs(pose.position - origin))) + away
    rounding = 2.0 * ULP * largest
    if rounding <= scene.quality.near(has_levels(scene.node)) * pose.footprint(away, 1080):
        return []
    pixels = rounding / pose.footprint(away, 1080)
    what = (
        f"coordinates reach {largest:.3g} and the nearest surface is {away:.3g} away: in float32 hits are within "
        f"{rounding:.2g}, {pixels:.2g} pixel widths, whatever the quality"
    )
    return [Doubt("plan", what)]


SMALLEST, LARGEST = 1e-15, 1e15
"""Range of lengths in which every intermediate value of a scene is a float32: squares of a thousandth of a pixel at the
low end, squares of the distance to the horizon at the high end."""

USUAL = 1e6
"""Every node of the package is accurate in float32 at sizes from 1 / USUAL to USUAL. The field of a scene outside this
range is checked."""

LEGAL = f"from {SMALLEST:g} to {LARGEST:g} units; give all lengths, the camera's and the lights' too, in another unit"

OFF = 0.01
"""Relative error of the field, over the distance to the camera, above which a sample counts as lost."""


def refuse_extent(view: DefaultView, origin: NDArray[np.float64], field: Function) -> None:
    """PlanError for a scene that float32 cannot hold, with its parameters at their defaults.

    field : the distance, as a function of the point relative to `origin`.
    """
    scene, values, pose, reach = view.scene, view.values, view.pose, view.reach
    if pose is None or scene.node.facts.empty:
        return
    _refuse_far_box(scene)
    if reach is not None and 1.0 / USUAL <= reach <= USUAL:
        return
    away = _nearest(field, pose.position - origin, values)
    if away is not None and away > 1e-3 * FAR_AWAY and hiding_nodes(scene.node):
        away = None  # the camera sees none of the solids
    if away is not None and not np.isfinite(away):
        return  # a value is not finite at the defaults; each frame checks that
    varies = bool(scene.parameters)  # the box then bounds the solid over their whole ranges, and may be far too large
    largest = away if varies and away is not None else max(reach or 0.0, away or 0.0)
    if largest > LARGEST or (reach is not None and reach < SMALLEST):
        raise PlanError(_message(reach if largest <= LARGEST else largest), legal=LEGAL, where=scene.node.where)
    if away is None or 1.0 / USUAL <= largest <= USUAL:
        return
    lost = _lost(field, pose, origin, 0.5 * away, max(largest, 4.0 * away), values)
    if lost:
        what = f"the scene is {largest:.3g} units large and its nearest surface {away:.3g} away: {lost}"
        legal = "sizes closer to 1, or a camera farther from the large surface"
        raise PlanError(what, legal=legal, where=scene.node.where)


def _refuse_far_box(scene: Scene) -> None:
    """PlanError where float64 does not hold the place of the solids to a hundredth of their size."""
    subject = scene.subject
    if subject is None:
        return
    corner, size = float(np.max(np.abs([subject.lower, subject.upper]))), float(np.max(subject.size))
    place = float(np.spacing(corner))
    if np.isfinite(corner) and place > OFF * size > 0.0:
        what = f"solids of size {size:.3g} are {corner:.3g} units from the origin, where numbers are {place:.2g} apart"
        raise PlanError(what, legal=f"up to {OFF * size / np.finfo(float).eps:.2g} units", where=scene.node.where)


@dataclass(frozen=True, slots=True)
class InReach:
    """The condition on each frame that the camera is neither too close to the subject nor too far from it."""

    scene: Scene

    def broken(self, values: Values) -> Doubt | None:
        """See `raymarch.scene.legal.Condition`."""
        pose = default_pose(self.scene, values)  # a degenerate camera is refused where it draws
        reach = None if pose is None else reach_of(self.scene, pose)
        if reach is None or SMALLEST <= reach <= LARGEST:
            return None
        return Doubt("values", f"{_message(reach)} at time = {values.time:g}", LEGAL, self.scene.camera.where)


def _message(length: float | None) -> str:
    return f"the scene is {length:.3g} units large, as its camera sees it, which float32 cannot draw"


def _lost(field: Function, pose: Pose, origin: NDArray[np.float64], near: float, far: float, values: Values) -> str:
    """Compare the field in float32 and float64 on some camera rays: a message if they differ, else ""."""
    random = np.random.default_rng(0)
    x, y = random.uniform(-1.0, 1.0, (24, 2)).T
    origins, directions = pose.rays(0.5 * x, -0.5 * y, (1, 1))
    distances = np.geomspace(near, far, 12)
    points = (origins - origin + distances[:, None, None] * directions).reshape(-1, 3)
    with_gradient = companion(field)
    with bound(values.params, values.time):
        double = evaluator_of(with_gradient)(points)[0]
        single = evaluator([with_gradient.body], with_gradient.params, np.float32)(points)[0].astype(np.float64)
    wrong_values = ~(np.abs(single - double)[..., 3] <= OFF * np.repeat(distances, 24))
    wrong_normals = ~(np.linalg.norm((single - double)[..., :3], axis=-1) <= 0.1)
    if np.mean(wrong_values) > 0.02:
        count = f"{np.sum(wrong_values)} of {len(points)} points"
        return f"in float32 its field is off by more than {OFF:.0%} of the distance at {count}"
    if np.mean(wrong_normals) > 0.5:
        return f"in float32 its normals are lost at {np.sum(wrong_normals)} of {len(points)} points"
    return ""
