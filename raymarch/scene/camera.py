"""The pinhole camera: right-handed, y up, looking along -z of its own frame, with one ray through each pixel centre."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pyrr
from numpy.typing import NDArray

from raymarch.errors import SceneError
from raymarch.expr.node import Expr
from raymarch.scene.parameter import Values, as_number, as_vec3
from raymarch.scene.value import Value, value
from raymarch.sdf.domain import Scalar, Vec3Like
from raymarch.sdf.facts import Facts

VIEW = np.array([0.5, 0.45, 1.0])
"""The direction from the target to a camera without a `position`."""


@dataclass(frozen=True, slots=True)
class Pose:
    """The camera of one frame, in float64.

    Attributes
    ----------
    position : shape (3,).
    frame : shape (3, 3); columns are the right, up and backward axes in world space.
    tan_half_fov : tangent of half the vertical field of view.
    """

    position: NDArray[np.float64]
    frame: NDArray[np.float64]
    tan_half_fov: float

    def pixel(self, height: int) -> float:
        """Width of a pixel at distance 1 along the axis: the diameter of the pixel cone over its length."""
        return 2.0 * self.tan_half_fov / height


def look_at(
    position: NDArray[np.float64], target: NDArray[np.float64], up: NDArray[np.float64], tan_half_fov: float
) -> Pose:
    """The pose of a camera at `position` that looks at `target`, each of shape (3,); not checked."""
    # pyrr's view matrix is for row vectors: its first three columns are the camera's axes.
    view = pyrr.matrix44.create_look_at(position, target, up, dtype=np.float64)
    return Pose(position, np.array(view[:3, :3]), tan_half_fov)


@value
class Camera(Value):
    """A perspective camera.

    Parameters
    ----------
    position : (x, y, z) in scene units. None places the camera so that it sees the whole scene.
    target : the point (x, y, z) that the camera looks at. None is the centre of the scene.
    up : the direction (x, y, z) that is up in the picture. It must not be parallel to the viewing direction.
    fov : vertical field of view in degrees, between 0 and 180. All other angles of raymarch are in radians.

    Notes
    -----
    Each value may be an expression of parameters and time. The camera then moves without a recompile.
    Raises SceneError for a degenerate camera: position equal to target, up parallel to the view, fov out of range.
    """

    position: Expr | None
    target: Expr | None
    up: Expr
    fov: Expr

    def __init__(
        self,
        position: Vec3Like | None = None,
        target: Vec3Like | None = None,
        up: Vec3Like = (0.0, 1.0, 0.0),
        fov: Scalar = 45.0,
    ) -> None:
        self._begin()
        self._set(
            position=None if position is None else as_vec3("Camera: position", position),
            target=None if target is None else as_vec3("Camera: target", target),
            up=as_vec3("Camera: up", up),
            fov=as_number("Camera: fov", fov),
        )
        values = Values({})
        if self.fov.is_constant:
            self._tan_half_fov(values)
        if self.position is not None and self.target is not None and self._constant:
            self.pose(values, None)

    @property
    def _constant(self) -> bool:
        return all(e.is_constant for e in (self.position, self.target, self.up, self.fov) if e is not None)

    @property
    def expressions(self) -> list[Expr]:
        """All values that may depend on parameters or time."""
        return [e for e in (self.position, self.target, self.up, self.fov) if e is not None]

    def _tan_half_fov(self, values: Values) -> float:
        fov = float(values.of(self.fov))
        if not 0.0 < fov < 180.0:
            raise SceneError(
                f"Camera: fov = {fov:g}", legal="degrees between 0 and 180, ends excluded", where=self.where
            )
        return float(np.tan(np.radians(fov) / 2))

    def pose(self, values: Values, subject: Facts | None, aspect: float = 1.0) -> Pose:
        """The camera of one frame.

        subject : the box that the camera frames if position or target is not given.
        aspect : width over height of the picture. A camera without a position stands farther away for a narrow picture.
        """
        tan_half_fov = self._tan_half_fov(values)
        centre, radius = _sphere_around(subject)
        target = centre if self.target is None else values.of(self.target)
        if self.position is None:
            away = VIEW / np.linalg.norm(VIEW)
            reach = radius + float(np.linalg.norm(centre - target))
            position = target + away * reach * 1.1 * np.hypot(1.0, 1.0 / (tan_half_fov * min(aspect, 1.0)))
        else:
            position = values.of(self.position)
        up = values.of(self.up)
        self._refuse_degenerate(position, target, up)
        return look_at(position, target, up, tan_half_fov)

    def _refuse_degenerate(self, position: Any, target: Any, up: Any) -> None:
        if not all(np.all(np.isfinite(v)) for v in (position, target, up)):
            raise SceneError(f"Camera: position {position}, target {target}, up {up}", legal="finite", where=self.where)
        view = target - position
        if not np.any(view):
            raise SceneError(
                f"Camera: position = target = {position.tolist()}", legal="two different points", where=self.where
            )
        across = np.linalg.norm(np.cross(view, up))
        if across <= 1e-9 * np.linalg.norm(view) * np.linalg.norm(up):
            raise SceneError(
                f"Camera: up = {up.tolist()} is parallel to the view {view.tolist()}",
                legal="an up direction that is not parallel to the view",
                where=self.where,
            )


def _sphere_around(subject: Facts | None) -> tuple[NDArray[np.float64], float]:
    if subject is None or subject.empty or not subject.bounded:
        return np.zeros(3), 1.5
    radius = float(np.linalg.norm(subject.size)) / 2
    return (subject.lower + subject.upper) / 2, radius if radius > 0 else 1.0
