"""The camera: right-handed, y up, looking along -z of its own frame, with one ray through each pixel centre."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cache
from typing import Any, ClassVar, Final, Self, TypeAlias

import numpy as np
import pyrr
from numpy.typing import NDArray

from raymarch.errors import SceneError
from raymarch.expr import vocabulary as v
from raymarch.expr.arrays import evaluator
from raymarch.expr.calls import checked
from raymarch.expr.convert import choice, instance, optional, real, short
from raymarch.expr.degrees import suspect_radians
from raymarch.expr.node import Expr, Operand, expr, var
from raymarch.expr.types import FLOAT, VEC3
from raymarch.scene.framing import CUBE, VIEW, Framed, corners
from raymarch.scene.parameter import Values, as_number, as_vec3, is_zero
from raymarch.scene.value import Part, value
from raymarch.sdf.booleans import balanced
from raymarch.sdf.domain import Scalar, Vec3Like
from raymarch.sdf.facts import Facts
from raymarch.sdf.node import Node

MARGIN = 1.1
"""The picture of a camera that frames a solid is larger than what it frames by this factor."""


Corners: TypeAlias = Sequence[tuple[Expr, ...]]
"""Points from the target: to the right, upwards and towards the camera."""

PROJECTIONS: Final = ("perspective", "orthographic")


@dataclass(frozen=True, slots=True)
class Pose:
    """The camera of one frame, in float64.

    Attributes
    ----------
    position : shape (3,).
    frame : shape (3, 3); columns are the right, up and backward axes in world space.
    tan_half_fov : tangent of half the vertical field of view; 0 for an orthographic camera.
    half_height : of an orthographic camera, half the height of the picture in scene units; else None.
    near, far : distances of the clip planes.
    aperture, focus : radius of the lens, and distance of the plane in focus.
    """

    position: NDArray[np.float64]
    frame: NDArray[np.float64]
    tan_half_fov: float
    half_height: float | None = None
    near: float = 0.0
    far: float = np.inf
    aperture: float = 0.0
    focus: float = 1.0

    def same(self, other: Pose) -> bool:
        """True if another pose gives the same rays."""
        ours, theirs = ([getattr(pose, part.name) for part in fields(pose)] for pose in (self, other))
        return all(np.array_equal(a, b) for a, b in zip(ours, theirs, strict=True))

    @property
    def orthographic(self) -> bool:
        """True if all rays are parallel."""
        return self.half_height is not None

    @property
    def view(self) -> NDArray[np.float64]:
        """The unit direction in which the camera looks, (3,)."""
        return -self.frame[:, 2]

    def rays(
        self, columns: NDArray[Any], rows: NDArray[Any], size: tuple[int, int]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Origins and unit directions of the rays through the centres of some pixels of a picture of (width, height).

        columns, rows : indices of pixels, of shapes that broadcast to one shape; row 0 is the top. Fractions are points
        beside the centres. Returns two arrays of that shape and (3,).
        """
        scale = (self.tan_half_fov if self.half_height is None else self.half_height) / size[1]
        x, y = np.broadcast_arrays((2.0 * columns + 1.0 - size[0]) * scale, (size[1] - 2.0 * rows - 1.0) * scale)
        if self.orthographic:
            origins = self.position + np.stack([x, y, np.zeros(x.shape)], axis=-1) @ self.frame.T
            return origins, np.broadcast_to(self.view, origins.shape)
        inside = np.stack([x, y, -np.ones(x.shape)], axis=-1)
        directions = (inside / np.linalg.norm(inside, axis=-1, keepdims=True)) @ self.frame.T
        return np.broadcast_to(self.position, directions.shape), directions

    def directions(self, columns: NDArray[Any], rows: NDArray[Any], size: tuple[int, int]) -> NDArray[np.float64]:
        """The directions of `rays`."""
        return self.rays(columns, rows, size)[1]

    def place(self, point: NDArray[np.float64], size: tuple[int, int]) -> tuple[float, float] | None:
        """Column and row at which a picture of (width, height) shows a point, whole at the centres of pixels; the
        inverse of `rays`. None if the point is behind the camera."""
        column, row = self.places(np.asarray(point), size)
        return None if np.isnan(column) else (float(column), float(row))

    def places(self, points: NDArray[np.float64], size: tuple[int, int]) -> NDArray[np.float64]:
        """As `place`, of points of shape (..., 3): (2, ...), nan behind the camera."""
        x, y, back = np.moveaxis((points - self.position) @ self.frame, -1, 0)
        scale = (self.tan_half_fov if self.half_height is None else self.half_height) / size[1]
        away = np.ones_like(back) if self.orthographic else np.where(back < 0.0, -back, np.nan)
        return np.stack([(x / (away * scale) + size[0] - 1.0) / 2, (size[1] - 1.0 - y / (away * scale)) / 2])

    def pixel(self, height: int) -> float:
        """Width of a pixel of a picture of some height: at distance 1 along the axis, or of an orthographic camera at
        all distances."""
        return 2.0 * (self.tan_half_fov if self.half_height is None else self.half_height) / height

    def footprint(self, distance: Any, height: int) -> Any:
        """Width of a pixel at a distance along its ray."""
        return self.pixel(height) * (np.ones_like(distance) if self.orthographic else distance)


def look_at(
    position: NDArray[np.float64], target: NDArray[np.float64], up: NDArray[np.float64], tan_half_fov: float
) -> Pose:
    """The pose of a camera at `position` that looks at `target`, each of shape (3,); not checked."""
    # pyrr's view matrix is for row vectors: its first three columns are the camera's axes.
    view = pyrr.matrix44.create_look_at(position, target, up, dtype=np.float64)
    return Pose(position, np.array(view[:3, :3]), tan_half_fov)


@value
class Camera(Part):
    """A camera, perspective or orthographic.

    Parameters
    ----------
    position : (x, y, z) in scene units. None places the camera so that it sees the whole scene; `Camera.framing` places
        it for one node.
    target : the point (x, y, z) that the camera looks at. None is the centre of the scene.
    up : the direction (x, y, z) that is up in the picture. It must not be parallel to the viewing direction.
    fov : vertical field of view in degrees, between 0 and 180. All other angles of raymarch are in radians. An
        orthographic camera has none.
    projection : "perspective", or "orthographic": all rays are parallel to the view, and objects have one size at all
        distances. Rays start in the plane through `position`.
    height : of an orthographic camera, the height of the picture in scene units, > 0. None shows the whole scene.
    near, far : distances from the camera, 0 <= near < far, along the view. The picture shows what lies between the two
        planes at these distances, perpendicular to the view: a solid that the near plane cuts is open there and shows
        its inner side, and the sky is behind the far plane. Shadows and reflections are not cut. far=None is no limit.
    aperture : radius of the lens in scene units, >= 0. Points beside the plane in focus become discs: at a distance d,
        a disc of radius aperture * abs(d - focus) / d in the plane in focus (thin lens; pbrt-v4, 5.2.3). 0 is a
        pinhole, whose pictures are sharp. The rays of a pixel start at different points of the lens, so the picture
        needs `Quality(samples=...)` or several frames. Depth and normals are those of the centre of the lens.
    focus : distance from the camera to the plane in focus, along the view, > 0. None is the distance of the target.
    shutter : seconds of `rm.time` for which the shutter is open, >= 0; the frame's time is the middle. Whatever reads
        time is blurred by its motion, if `Quality(samples=...)` or several frames give samples, each at another time.
        Depth and normals are those of the frame's time.
    view_from : the direction (x, y, z) from the target to a camera without a position, any length but 0. None is
        (0.5, 0.45, 1). The camera stands so far away that the picture shows the whole scene, whatever its proportions.

    Raises
    ------
    SceneError : a degenerate camera: position equal to target, up parallel to the view, fov out of range.

    Notes
    -----
    Each value may be an expression of parameters and time. The camera then moves without a recompile.

    Examples
    --------
    >>> rm.Camera(position=(3, 2, 4), target=(0, 0, 0), fov=35).replace(fov=50)
    Camera(position=(3.0, 2.0, 4.0), target=(0.0, 0.0, 0.0), fov=50.0)
    """

    BELONGS: ClassVar[str] = "Scene(camera=...)"
    position: Expr | None
    target: Expr | None
    up: Expr
    fov: Expr
    projection: str
    height: Expr | None
    near: Expr
    far: Expr | None
    aperture: Expr
    focus: Expr | None
    shutter: Expr
    view_from: Expr | None

    def __init__(
        self,
        position: Vec3Like | None = None,
        target: Vec3Like | None = None,
        up: Vec3Like = (0.0, 1.0, 0.0),
        fov: Scalar = 45.0,
        projection: str = "perspective",
        height: Scalar | None = None,
        near: Scalar = 0.0,
        far: Scalar | None = None,
        aperture: Scalar = 0.0,
        focus: Scalar | None = None,
        shutter: Scalar = 0.0,
        view_from: Vec3Like | None = None,
    ) -> None:
        kind = choice("Camera: projection", projection, PROJECTIONS)
        if height is not None and kind != "orthographic":
            raise SceneError(
                f"Camera: height = {short(height)} with projection='perspective'",
                legal="projection='orthographic', or fov=... in place of height",
            )
        suspect_radians("Camera: fov", fov)
        if view_from is not None and position is not None:
            what = f"Camera: view_from = {short(view_from)} with a position"
            raise SceneError(what, legal="a direction from the target, or a position")
        self._set(
            position=optional(as_vec3, "Camera: position", position),
            target=optional(as_vec3, "Camera: target", target),
            up=as_vec3("Camera: up", up),
            fov=as_number("Camera: fov", fov),
            projection=kind,
            height=optional(as_number, "Camera: height", height),
            near=as_number("Camera: near", near),
            far=optional(as_number, "Camera: far", far),
            aperture=as_number("Camera: aperture", aperture),
            focus=optional(as_number, "Camera: focus", focus),
            shutter=as_number("Camera: shutter", shutter),
            view_from=optional(as_vec3, "Camera: view_from", view_from),
        )
        if self.view_from is not None and self.view_from.is_constant and not np.any(self.view_from.data):
            raise SceneError("Camera: view_from = (0, 0, 0)", legal="any length but 0")
        values = Values({})
        for name in _RANGES:
            given = getattr(self, name)
            if given is not None and given.is_constant:
                self._number(name, values)
        if self.near.is_constant and (self.far is None or self.far.is_constant):
            self._clip_planes(values)
        placed = self.view_from is not None or (self.position is not None and self.target is not None)
        if placed and all(e.is_constant for e in self.expressions):
            self.pose(values, None)

    @classmethod
    @checked
    def framing(
        cls,
        node: Node,
        view_from: Vec3Like = (0.5, 0.45, 1.0),
        up: Vec3Like = (0.0, 1.0, 0.0),
        fov: float = 45.0,
        aspect: float = 16.0 / 9.0,
        margin: float = MARGIN,
        projection: str = "perspective",
    ) -> Self:
        """The camera that looks at the centre of a node's box and sees all of the box.

        Parameters
        ----------
        node : a bounded solid.
        view_from : the direction from the solid to the camera, any length but 0.
        up, fov, projection : see `Camera`.
        aspect : width over height of the picture, > 0. A wider picture shows more at the sides, a narrower one less.
            `Camera(view_from=...)` sees the whole scene at any proportions.
        margin : size of the picture over that of the box, >= 1.

        Returns
        -------
        Self

        Raises
        ------
        SceneError : a node without a finite box, and for a value outside its range.
        """
        solid = instance("Camera.framing: node", node, Node, "a node such as sphere()")
        away, upward = (_numbers(f"Camera.framing: {n}", v) for n, v in (("view_from", view_from), ("up", up)))
        proportion = real("Camera.framing: aspect", aspect, 1e-3, 1e3)
        factor = real("Camera.framing: margin", margin, 1.0, 1e3)
        if not solid.facts.bounded or solid.facts.empty:
            what = "is empty" if solid.facts.empty else "has no finite box"
            raise SceneError(f"Camera.framing: {solid.name} {what}", legal="a part of the scene that has one")
        lower, upper = framed_box(solid.facts)
        target = (lower + upper) / 2
        made = cls(tuple(target + away), tuple(target), tuple(upward), fov, projection)  # refuses a degenerate camera
        box = Framed(corners(lower, upper))
        pose = made.replace(position=None, view_from=tuple(away)).pose(Values({}), box, proportion, factor)
        height = None if pose.half_height is None else 2.0 * pose.half_height
        return made.replace(position=tuple(pose.position.tolist()), height=height)

    @property
    def orthographic(self) -> bool:
        """True if all rays are parallel."""
        return self.projection == "orthographic"

    @property
    def automatic(self) -> bool:
        """True if neither place nor direction is given."""
        return self.position is None and self.target is None and self.view_from is None and not self.orthographic

    @property
    def cuts(self) -> bool:
        """True if there is a near plane in front of the camera."""
        return not is_zero(self.near)

    @property
    def clips(self) -> bool:
        """True if the picture is limited by a clip plane."""
        return self.cuts or self.far is not None

    @property
    def lens(self) -> bool:
        """True if rays start at points of a lens."""
        return not is_zero(self.aperture)

    @property
    def opens(self) -> bool:
        """True if the shutter is open for some time."""
        return not is_zero(self.shutter)

    def _number(self, name: str, values: Values) -> float:
        """A value in a frame. SceneError if it is out of its range."""
        number = float(values.of(getattr(self, name)))
        holds, legal = _RANGES[name]
        if not holds(number):
            raise SceneError(f"Camera: {name} = {number:g}", legal=legal, where=self.where)
        return number

    def _tan_half_fov(self, values: Values) -> float:
        return float(np.tan(np.radians(self._number("fov", values)) / 2))

    def _clip_planes(self, values: Values) -> tuple[float, float]:
        near, far = self._number("near", values), np.inf if self.far is None else float(values.of(self.far))
        if not near < far:
            raise SceneError(f"Camera: far = {far:g} with near = {near:g}", legal="near < far", where=self.where)
        return near, far

    def open_seconds(self, values: Values) -> float:
        """The seconds for which the shutter is open in a frame."""
        return self._number("shutter", values)

    def pose(self, values: Values, framed: Framed | None, aspect: float = 1.0, margin: float = MARGIN) -> Pose:
        """The camera of one frame.

        framed : what the camera frames if position or target is not given.
        aspect : width over height of the picture. A camera without a position stands so far away that the points are in
            the picture. margin : size of the picture over that of the points.
        """
        tan_half_fov = self._tan_half_fov(values)
        shown = Framed(CUBE) if framed is None else framed
        target = shown.middle if self.target is None else values.of(self.target)
        up = values.of(self.up)
        given = shown.position if self.position is None and self.automatic else None
        given = given if self.position is None else values.of(self.position)
        away = given - target if given is not None else VIEW if self.view_from is None else values.of(self.view_from)
        self._refuse_degenerate(target + away if given is None else given, target, up)
        distance, extent = 0.0, 0.0
        if given is None or self.orthographic:
            found = _framing()(shown.points - target, away, up, tan_half_fov, aspect, margin)
            distance, extent = (float(np.max(each)) for each in found)
        half = None
        if self.orthographic:
            half = extent if self.height is None else self._number("height", values) / 2
            distance = before_points(shown.diameter, half)
        position = target + away * (distance / np.linalg.norm(away)) if given is None else given
        self._refuse_degenerate(position, target, up)
        placed = look_at(position, target, up, tan_half_fov if half is None else 0.0)
        return replace(placed, half_height=half, **self.optics(values, float(np.linalg.norm(target - position))))

    def optics(self, values: Values, distance: float) -> dict[str, Any]:
        """The fields of a pose that neither its place nor its projection determine. distance : of the target."""
        near, far = self._clip_planes(values)
        focus = distance if self.focus is None else self._number("focus", values)
        return {"near": near, "far": far, "aperture": self._number("aperture", values), "focus": focus}

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
            what = f"Camera: up = {up.tolist()} is parallel to the view {view.tolist()}"
            raise SceneError(what, legal="an up direction that is not parallel to the view", where=self.where)


def framed_box(subject: Facts | None) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Corners of the box to frame: of a cube of edge 2 if there is none."""
    if subject is None or subject.empty or not subject.bounded:
        return np.full(3, -1.0), np.full(3, 1.0)
    lower, upper = np.array(subject.lower), np.array(subject.upper)
    point = not np.any(upper > lower)
    return lower - point, upper + point


def seen_at(points: Sequence[Operand], away: Operand, up: Operand) -> Corners:
    """Points relative to the target: to the right, upwards and towards a camera in the direction `away`."""
    backward = v.normalize(away)
    right = v.normalize(v.cross(up, backward))
    axes = (right, v.cross(backward, right), backward)
    return [tuple(v.dot(point, axis) for axis in axes) for point in points]


def outermost(points: Corners) -> Corners:
    """The points that decide the distance of a camera: constant ones behind and inside others are left out."""
    if not all(number.is_constant for point in points for number in point):
        return points
    given = np.abs([[float(number.data) for number in point] for point in points])
    given[:, 2] = [float(z.data) for _, _, z in points]
    kept: dict[int, None] = {}
    for axis in (0, 1):
        best = -np.inf
        for i in np.lexsort((-given[:, axis], -given[:, 2])):  # towards the camera first
            if given[i, axis] > best:
                kept[int(i)] = None
                best = given[i, axis]
    return [points[i] for i in kept]


def distance_to_see(points: Corners, tan_half_fov: Operand, aspect: Expr, margin: Operand = MARGIN) -> Expr:
    """The least distance from the target of a camera that sees all points, and a margin.

    A point at (x, y, z) from the target, right, up and towards the camera, is in the picture of a camera at distance d
    if |y| <= (d - z) tan(fov / 2), and likewise for x.
    """
    found = []
    for x, y, z in points:
        found += [z + v.max(abs(x) / aspect, abs(y)) * (margin / expr(tan_half_fov)), z * margin]
    return balanced(found, v.max)


def half_extent(points: Corners, aspect: Expr, margin: Operand = MARGIN) -> Expr:
    """Half the height of the smallest orthographic picture about the target that shows all points, and a margin."""
    return expr(margin) * balanced([v.max(abs(x) / aspect, abs(y)) for x, y, _ in points], v.max)


@cache
def _framing() -> Callable[..., tuple[Any, ...]]:
    """`distance_to_see` and `half_extent` of each point of an array: points, away, up, tan_half_fov, aspect, margin."""
    vectors = [var(name, VEC3) for name in ("point", "away", "up")]
    tan_half_fov, aspect, margin = (var(name, FLOAT) for name in ("tan_half_fov", "aspect", "margin"))
    seen = seen_at(vectors[:1], *vectors[1:])
    found = [distance_to_see(seen, tan_half_fov, aspect, margin), half_extent(seen, aspect, margin)]
    return evaluator(found, [*vectors, tan_half_fov, aspect, margin])


def before_points(size: float, half: float) -> float:
    """The distance from the target of an orthographic camera in front of what it frames, of some diameter. A floor
    under it does not reach up to the lower edge of the picture there."""
    return 2.0 * max(size, 2.0 * half)


_POSITIVE = (lambda number: 0.0 < number < np.inf, "a finite number > 0")
_NOT_NEGATIVE = (lambda number: 0.0 <= number < np.inf, "a finite number >= 0")
_RANGES: Mapping[str, tuple[Callable[[float], bool], str]] = {
    "fov": (lambda number: 0.0 < number < 180.0, "degrees between 0 and 180, ends excluded"),
    "height": _POSITIVE,
    "near": _NOT_NEGATIVE,
    "aperture": _NOT_NEGATIVE,
    "focus": _POSITIVE,
    "shutter": _NOT_NEGATIVE,
}
"""The ranges of values, checked where they are written if they are constant, else in each frame."""


def _numbers(what: str, value: Any) -> NDArray[np.float64]:
    given = as_vec3(what, value)
    if not given.is_constant:
        raise SceneError(f"{what} depends on a parameter or time", legal="3 numbers")
    return np.array(given.data)
