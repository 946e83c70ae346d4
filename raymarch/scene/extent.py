"""Which sizes can be drawn. The shader computes in float32, which holds a length of 1e20, but not its square.

No other unit is chosen behind a user's back: patterns, functions of a point and constants in a user's own nodes are
lengths that nothing marks as such. A scene that float32 cannot hold is refused.
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

SMALLEST, LARGEST = 1e-15, 1e15
"""Lengths between which all that a scene needs is a float32: squares of a thousandth of a pixel at the one end, squares
of the distance to a horizon at the other."""

USUAL = 1e6
"""Up to this many units, and down to one over it, every node of the package keeps its digits in float32. A scene beyond
is looked at."""

LEGAL = f"from {SMALLEST:g} to {LARGEST:g} units; give all lengths, the camera's and the lights' too, in another unit"

OFF = 0.01
"""The error of a field, as a share of the way to the camera, from which a point of it counts as lost."""


def refuse_extent(scene: Scene, origin: NDArray[np.float64], field: Function) -> None:
    """PlanError for a scene that float32 cannot hold, with its parameters at their defaults.

    field : the distance, as a function of the point counted from `origin`.
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
    if away is not None and not np.isfinite(away):
        return  # by a value that is not finite now, which each frame is asked for
    varies = bool(scene.parameters)  # the box then holds the solid over their whole ranges, and may be far too large
    largest = away if varies and away is not None else max(reach or 0.0, away or 0.0)
    if largest > LARGEST or (reach is not None and reach < SMALLEST):
        raise PlanError(_said(reach if largest <= LARGEST else largest), legal=LEGAL, where=scene.node.where)
    if away is None or 1.0 / USUAL <= largest <= USUAL:
        return
    lost = _lost(field, pose, origin, 0.5 * away, max(largest, 4.0 * away), values)
    if lost:
        raise PlanError(
            f"the scene is {largest:.3g} units large and its nearest surface {away:.3g} away: {lost}",
            legal="sizes that are closer to 1, and a camera that is not so close to what is so large",
            where=scene.node.where,
        )


@dataclass(frozen=True, slots=True)
class InReach:
    """The condition on each frame that the camera is neither too close to what it looks at nor too far away."""

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
        return f"{f'{where}: ' if where else ''}{_said(reach)} at time = {values.time:g} ({LEGAL})"


def reach_of(scene: Scene, pose: Pose) -> float | None:
    """The size of what a camera sees: from it to the middle of what has an end, and the size of that."""
    subject = scene.subject
    if subject is None:
        return None
    middle = 0.5 * (subject.lower + subject.upper)
    return float(np.linalg.norm(pose.position - middle) + np.linalg.norm(subject.size))


def _said(length: float | None) -> str:
    return f"the scene is {length:.3g} units large, as its camera sees it, which float32 cannot draw"


def _lost(field: Function, pose: Pose, origin: NDArray[np.float64], near: float, far: float, values: Values) -> str:
    """What float32 makes of a field on some rays of the camera: in words, if it is another one."""
    random = np.random.default_rng(0)
    screen = random.uniform(-1.0, 1.0, (24, 2)) * pose.tan_half_fov
    directions = np.concatenate([screen, -np.ones((24, 1))], axis=1) @ pose.frame.T
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    way = np.geomspace(near, far, 12)
    points = (pose.position - origin) + (way[:, None, None] * directions).reshape(-1, 3)
    whole = companion(field)
    with bound(values.params, values.time):
        true = evaluator([whole.body], whole.params)(points)[0]
        single = evaluator([whole.body], whole.params, np.float32)(points)[0].astype(np.float64)
    off = ~(np.abs(single - true)[..., 3] <= OFF * np.repeat(way, 24))
    turned = ~(np.linalg.norm((single - true)[..., :3], axis=-1) <= 0.1)
    if np.mean(off) > 0.02:
        return f"in float32 its field is off by more than {OFF:.0%} of the way at {np.sum(off)} of {len(points)} points"
    if np.mean(turned) > 0.5:
        return f"in float32 its normals are lost at {np.sum(turned)} of {len(points)} points"
    return ""
