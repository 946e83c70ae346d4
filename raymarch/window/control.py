"""Camera control: pure functions from a view and a movement to the next view. Angles in radians, pixels as in glfw."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from raymarch.scene.camera import Pose, look_at

Vector = NDArray[np.float64]

POLE = np.radians(1.0)
"""Minimum angle in radians between an orbiting view and the poles, where up is undefined."""

NEAREST = 1e-4
"""Minimum distance of a dolly to its target, as a fraction of the initial distance `reach`."""


FOV = 45.0
"""Field of view of an orthographic camera's view, which does not use it."""


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """The camera under the user's control, in float64.

    position, target, up : shape (3,); up is not parallel to the view.
    fov : vertical field of view in degrees.
    reach : the initial distance to the target; the unit of speeds.
    height : of an orthographic camera, the height of the picture in scene units; else None.
    near, far, aperture, focus : as of a pose; the scene sets them.
    """

    position: Vector
    target: Vector
    up: Vector
    fov: float
    reach: float
    height: float | None = None
    near: float = 0.0
    far: float = np.inf
    aperture: float = 0.0
    focus: float = 1.0

    @property
    def tan_half_fov(self) -> float:
        """Tangent of half the vertical field of view."""
        return float(np.tan(np.radians(self.fov) / 2))

    @property
    def extent(self) -> float:
        """Height of the picture at the target, in scene units."""
        return 2 * self.tan_half_fov * self.distance if self.height is None else self.height

    @property
    def distance(self) -> float:
        """From the camera to its target."""
        return float(np.linalg.norm(self.target - self.position))

    @property
    def forward(self) -> Vector:
        return _unit(self.target - self.position)

    @property
    def right(self) -> Vector:
        """The unit vector to the right of the picture."""
        return _unit(np.cross(self.forward, self.up))

    def pose(self) -> Pose:
        half = None if self.height is None else self.height / 2
        made = look_at(self.position, self.target, self.up, self.tan_half_fov if half is None else 0.0)
        optics = {name: getattr(self, name) for name in ("near", "far", "aperture", "focus")}
        return replace(made, half_height=half, **optics)

    def ray(self, x: float, y: float, size: tuple[int, int]) -> tuple[Vector, Vector]:
        """Origin and unit direction of the ray through a point of a picture, in pixels; x to the right, y down."""
        return self.pose().rays(np.array(x - 0.5), np.array(y - 0.5), size)


def view_of(pose: Pose, target: Vector | None, up: Vector) -> View:
    """The view at a pose. Without a target it orbits a point at distance 1."""
    forward = -pose.frame[:, 2]
    distance = 1.0 if target is None else float(np.linalg.norm(target - pose.position))
    fov = FOV if pose.orthographic else float(np.degrees(2 * np.arctan(pose.tan_half_fov)))
    height = None if pose.half_height is None else 2 * pose.half_height
    optics = pose.near, pose.far, pose.aperture, pose.focus
    return View(pose.position.copy(), pose.position + distance * forward, _unit(up), fov, distance, height, *optics)


def orbit(view: View, dx: float, dy: float, height: int) -> View:
    """Orbit the target. A drag by the height of the window is half a turn; the scene follows the cursor."""
    return replace(view, position=view.target + _swung(view.position - view.target, view.up, -np.pi / height, dx, dy))


def turn(view: View, dx: float, dy: float, height: int) -> View:
    """Rotate the view about the camera; the point under the cursor stays nearly under it."""
    angle = 2 * np.arctan(0.5 * view.extent / view.distance) / height
    return replace(view, target=view.position + _swung(view.target - view.position, view.up, angle, dx, dy))


def pan(view: View, dx: float, dy: float, height: int) -> View:
    """Translate the camera parallel to the image plane; points at the target's distance stay under the cursor."""
    length = view.extent / height
    shift = length * (-dx * view.right + dy * np.cross(view.right, view.forward))
    return replace(view, position=view.position + shift, target=view.target + shift)


def dolly(view: View, steps: float) -> View:
    """Move towards the target by a tenth of the distance per step, or away from it. An orthographic camera stays, and
    its picture shows a tenth less."""
    if view.height is not None:
        return replace(view, height=max(view.height * 0.9**steps, NEAREST * view.reach))
    distance = max(view.distance * 0.9**steps, NEAREST * view.reach)
    return replace(view, position=view.target - distance * view.forward)


def fly(view: View, forward: float, right: float, upward: float, seconds: float) -> View:
    """Move forward, to the right and along `up`; speeds are in units of `reach` per second."""
    upright = np.cross(view.right, view.forward)
    shift = view.reach * seconds * (forward * view.forward + right * view.right + upward * upright)
    return replace(view, position=view.position + shift, target=view.target + shift)


def zoomed(view: View, fov: float) -> View:
    return replace(view, fov=fov)


def resized(view: View, height: float) -> View:
    """The view of an orthographic camera with another height of the picture, in scene units."""
    return replace(view, height=height)


def focus(view: View, point: Vector) -> View:
    """Make another point the target: it moves to the centre, with the same view direction and distance."""
    distance = float(np.linalg.norm(point - view.position))
    if distance == 0.0:
        return view
    return replace(view, position=point - distance * view.forward, target=np.array(point, np.float64), reach=distance)


def as_python(view: View) -> str:
    """The view as an rm.Camera(...) line for a scene file, exact to a millionth of `reach`."""
    digits = int(np.clip(6 - np.floor(np.log10(max(view.reach, 1e-300))), 0, 12))
    parts = [f"position={_tuple(view.position, digits)}", f"target={_tuple(view.target, digits)}"]
    if not np.array_equal(view.up, (0.0, 1.0, 0.0)):
        parts.append(f"up={_tuple(view.up, 6)}")
    if view.height is None:
        parts.append(f"fov={round(view.fov, 4):g}")
    else:
        parts += ["projection='orthographic'", f"height={view.height:.6g}"]
    parts += [f"{name}={end:.6g}" for name, end in (("near", view.near), ("far", view.far)) if 0.0 < end < np.inf]
    if view.aperture > 0.0:
        parts += [f"aperture={view.aperture:.6g}", f"focus={view.focus:.6g}"]
    return f"rm.Camera({', '.join(parts)})"


def _tuple(vector: Vector, digits: int) -> str:
    return f"({', '.join(repr(round(float(v), digits) + 0.0) for v in vector)})"


def _unit(vector: Vector) -> Vector:
    length = np.linalg.norm(vector)
    return np.asarray(vector / length if length > 0 else vector, np.float64)


def _angle(a: Vector, b: Vector) -> float:
    """The angle between two vectors, accurate also near 0 and pi."""
    return float(np.arctan2(np.linalg.norm(np.cross(a, b)), np.dot(a, b)))


def _swung(arm: Vector, up: Vector, angle: float, dx: float, dy: float) -> Vector:
    """An arm turned by an angle for each pixel of a drag: by dx about `up`, and by dy towards it, whatever the sign of
    the angle. It stays `POLE` away from `up`."""
    arm = _turned(arm, up, angle * dx)
    elevation = np.pi / 2 - _angle(arm, up)
    # A view that starts closer to a pole than the limit does not jump at its first movement.
    limit = max(np.pi / 2 - POLE, abs(elevation))
    rise = np.clip(elevation + abs(angle) * dy, -limit, limit) - elevation
    return _turned(arm, _unit(np.cross(arm, up)), rise)


def _turned(vector: Vector, axis: Vector, angle: float) -> Vector:
    """Rotate a vector about a unit axis (Rodrigues)."""
    c, s = np.cos(angle), np.sin(angle)
    turned: Vector = c * vector + s * np.cross(axis, vector) + (1 - c) * np.dot(axis, vector) * axis
    return turned
