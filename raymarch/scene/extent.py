"""Limits of the size of a scene. The shader computes in float32, which holds a length of 1e20, but not its square.

A scene that float32 cannot hold is refused. It is not rescaled automatically: patterns, functions of a point and
constants in a user's own nodes contain lengths that are not marked as lengths.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from raymarch.errors import PlanError, SceneError
from raymarch.expr.arrays import bound, evaluator
from raymarch.expr.derivative import companion
from raymarch.expr.function import Function
from raymarch.expr.raw import without_twin
from raymarch.scene.camera import Pose
from raymarch.scene.parameter import Values, set_values
from raymarch.scene.scene import Scene
from raymarch.sdf.visibility import FAR_AWAY, hiding_nodes

SMALLEST, LARGEST = 1e-15, 1e15
"""Range of lengths in which every intermediate value of a scene is a float32: squares of a thousandth of a pixel at the
low end, squares of the distance to the horizon at the high end."""

USUAL = 1e6
"""Every node of the package is accurate in float32 at sizes from 1 / USUAL to USUAL. The field of a scene outside this
range is checked."""

LEGAL = f"from {SMALLEST:g} to {LARGEST:g} units; give all lengths, the camera's and the lights' too, in another unit"

OFF = 0.01
"""Relative error of the field, over the distance to the camera, above which a sample counts as lost."""


def refuse_extent(scene: Scene, origin: NDArray[np.float64], field: Function) -> None:
    """PlanError for a scene that float32 cannot hold, with its parameters at their defaults.

    field : the distance, as a function of the point relative to `origin`.
    """
    values = set_values(scene.parameters, {})
    try:
        pose = scene.pose(values)
    except SceneError:
        return  # degenerate as long as parameters have their defaults
    if scene.node.facts.empty:
        return
    reach, away = reach_of(scene, pose), None
    if reach is not None and 1.0 / USUAL <= reach <= USUAL:
        return
    if not without_twin(field.body):
        with bound(values.params, values.time):
            away = abs(float(evaluator([field.body], field.params)(pose.position - origin)[0])) or None
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
        raise PlanError(
            f"the scene is {largest:.3g} units large and its nearest surface {away:.3g} away: {lost}",
            legal="sizes closer to 1, or a camera farther from the large surface",
            where=scene.node.where,
        )


@dataclass(frozen=True, slots=True)
class InReach:
    """The condition on each frame that the camera is neither too close to the subject nor too far from it."""

    scene: Scene

    def broken(self, values: Values) -> str | None:
        """See `raymarch.scene.legal.Condition`."""
        try:
            reach = reach_of(self.scene, self.scene.pose(values))
        except SceneError:  # a degenerate camera is refused where it draws
            return None
        if reach is None or SMALLEST <= reach <= LARGEST:
            return None
        where = self.scene.camera.where
        return f"{f'{where}: ' if where else ''}{_message(reach)} at time = {values.time:g} ({LEGAL})"


def reach_of(scene: Scene, pose: Pose) -> float | None:
    """The size of a scene as seen by a camera: the distance to the centre of its bounded part plus the size of that."""
    subject = scene.subject
    if subject is None:
        return None
    middle = 0.5 * (subject.lower + subject.upper)
    return float(np.linalg.norm(pose.position - middle) + np.linalg.norm(subject.size))


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
        double = evaluator([with_gradient.body], with_gradient.params)(points)[0]
        single = evaluator([with_gradient.body], with_gradient.params, np.float32)(points)[0].astype(np.float64)
    wrong_values = ~(np.abs(single - double)[..., 3] <= OFF * np.repeat(distances, 24))
    wrong_normals = ~(np.linalg.norm((single - double)[..., :3], axis=-1) <= 0.1)
    if np.mean(wrong_values) > 0.02:
        count = f"{np.sum(wrong_values)} of {len(points)} points"
        return f"in float32 its field is off by more than {OFF:.0%} of the distance at {count}"
    if np.mean(wrong_normals) > 0.5:
        return f"in float32 its normals are lost at {np.sum(wrong_normals)} of {len(points)} points"
    return ""
