"""Layers of an OpenEXR file for compositing: depth, normals, albedo, motion vectors, mattes, and the camera."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

import raymarch
from raymarch.export.mattes import Mattes
from raymarch.expr.arrays import bound, evaluator
from raymarch.expr.function import Function
from raymarch.gpu.frame import Frame
from raymarch.gpu.renderer import Renderer
from raymarch.plan import OUTPUTS
from raymarch.plan.motion import changes, motion_of
from raymarch.scene.camera import Pose
from raymarch.scene.material import Material
from raymarch.scene.parameter import ParamValue, Values, set_values
from raymarch.scene.quality import SINGLE_PASS
from raymarch.scene.scene import Scene
from raymarch.scene.sky import Sky
from raymarch.sdf.evaluation import evaluate_both, field_of
from raymarch.sdf.labels import relabelled
from raymarch.sdf.lower import Lowering
from raymarch.sdf.placing import with_label

ARRAYS = tuple(name for name in OUTPUTS if name not in ("slice", "cycles"))
"""The arrays of a frame that every driver can draw, and that have no parameter."""

BEYOND = 1e10
"""Z where nothing was hit, as in Blender: programs multiply it, and the product with inf may be no number."""

BLOCK = 1 << 16
"""Points that are moved together."""

Channels = dict[str, NDArray[np.float32]]
Moment = tuple[float, Mapping[str, ParamValue]]
"""The time of a frame, and the values of its parameters by name."""


_OF: WeakKeyDictionary[Renderer, Layers] = WeakKeyDictionary()


def layers_of(renderer: Renderer) -> Layers:
    """The layers that belong to a renderer, kept as long as it is."""
    if renderer not in _OF:
        _OF[renderer] = Layers(renderer)
    return _OF[renderer]


class Layers:
    """Makes the layers of frames, by renderers that keep their programs from frame to frame.

    renderer : whose context they use.
    """

    def __init__(self, renderer: Renderer) -> None:
        self._albedo, mattes = (Renderer(renderer.size, context=renderer.context) for _ in range(2))
        self._mattes = Mattes(mattes)
        self._known: dict[str, Any] = {}

    def of(
        self,
        frame: Frame,
        scene: Scene,
        now: Moment,
        before: Moment,
        after: Moment,
        alpha: bool,
        layers: bool,
        mattes: bool,
    ) -> tuple[Channels, dict[str, Any]]:
        """The channels of a frame by name, each (H, W), and the attributes of the header.

        before, after : the neighbouring frames, for motion vectors. alpha : the sky is transparent.
        layers : all arrays. mattes : of objects and materials.
        """
        assert frame.pose is not None
        color = frame.premultiplied() if alpha else frame.color
        channels = dict(zip("RGBA", np.moveaxis(color, -1, 0), strict=False))
        if layers:
            channels |= arrays_of(frame)
            channels |= split("albedo", self._albedo_of(scene, frame, now), "RGB")
            channels |= split("vector", self._vectors(scene, frame, now, before, after), "XYZW")
        header: dict[str, Any] = {**camera_header(frame.pose, frame.size)}
        header |= {"software": f"raymarch {raymarch.__version__}", "raymarchTime": frame.time}
        if mattes:
            found, described = self._mattes.channels(scene, frame.size, *now)
            channels, header = channels | found, header | described
        return channels, header

    def _once(self, name: str, scene: Scene, make: Callable[[], Any]) -> Any:
        """What a scene determines, made when its first frame needs it."""
        if name not in self._known or self._known[name][0] is not scene:
            self._known[name] = scene, make()
        return self._known[name][1]

    def _albedo_of(self, scene: Scene, frame: Frame, now: Moment) -> NDArray[np.float32]:
        if self._albedo.size != frame.size:
            self._albedo.resize(frame.size)
        shown = self._once("albedo", scene, lambda: albedo_scene(scene))
        return self._albedo.render(shown, *now, pose=frame.pose).color

    def _vectors(self, scene: Scene, frame: Frame, now: Moment, before: Moment, after: Moment) -> NDArray[np.float32]:
        """(H, W, 4): from the pixel to where its point was, and to the pixel from where its point will be."""
        motion = self._once("motion", scene, lambda: Motion(scene)).between
        here, hit = frame.array("position").astype(np.float64), np.isfinite(frame.depth)
        values = [set_values(scene.parameters, params, time, scene.where) for time, params in (now, before, after)]
        past, future = (motion(here, hit, frame, values[0], then) for then in values[1:])
        return np.concatenate([past, -future], axis=-1).astype(np.float32)


def arrays_of(frame: Frame) -> Channels:
    """The arrays of a frame as channels, but its colour. Vectors are 0 where nothing was hit."""
    assert frame.pose is not None
    columns, rows = np.arange(frame.size[0]), np.arange(frame.size[1])[:, None]
    along = frame.pose.directions(columns, rows, frame.size) @ frame.pose.view
    hit = np.isfinite(frame.depth)
    channels = {"Z": np.where(hit, np.where(hit, frame.depth, 0.0) * along, BEYOND).astype(np.float32)}
    for name in ARRAYS:
        values = np.asarray(frame.array(name), np.float32)
        if name != "color":
            flat = values.ndim == 2
            channels |= {f"{name}.Y": values} if flat else split(name, np.nan_to_num(values, nan=0.0), "XYZ")
    return channels


def split(name: str, values: NDArray[np.float32], letters: str) -> Channels:
    """The channels of an array of (H, W, n)."""
    return {f"{name}.{letter}": values[..., k] for k, letter in enumerate(letters)}


def albedo_scene(scene: Scene) -> Scene:
    """The scene in the colours of its materials, without light: `color`, of metals too, before any coat."""
    node = with_label(relabelled(scene.node, unlit), unlit(scene.materials[0]))
    quality = scene.quality.replace(**SINGLE_PASS)
    return scene.replace(
        node=node, lights=[], sky=Sky((0, 0, 0)), fog=None, occlusion=None, bounces=0, post=(), quality=quality
    )


def unlit(material: Material) -> Material:
    """A material that shows the colour of another one in every light."""
    return Material.unlit(material.color)


class Motion:
    """Where the visible points of a frame are in another frame."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._place: Function | None = None
        if changes(scene):
            self._place, self._twins = motion_of(scene.node, Lowering())
            self._moved = evaluator([self._place.body], self._place.params)

    def between(
        self, points: NDArray[np.float64], hit: NDArray[np.bool_], frame: Frame, now: Values, then: Values
    ) -> NDArray[np.float64]:
        """The way of each pixel's point in the picture, in pixels to the right and upwards, (H, W, 2).

        points : (H, W, 3). hit : where they are; elsewhere the sky is seen, at infinity.
        """
        assert frame.pose is not None
        (width, height), pose = frame.size, self._scene.pose(then, frame.size[0] / frame.size[1])
        columns, rows = np.meshgrid(np.arange(width), np.arange(height))
        found = np.zeros((2, height, width))
        if np.any(hit):
            before, after = points[hit], self._then(points[hit], now, then)
            found[:, hit] = pose.places(after, frame.size) - frame.pose.places(before, frame.size)
        if not pose.orthographic:
            away = frame.pose.directions(columns[~hit], rows[~hit], frame.size)
            there, here = (each.places(each.position + away, frame.size) for each in (pose, frame.pose))
            found[:, ~hit] = there - here
        return np.nan_to_num(np.stack([found[0], -found[1]], axis=-1))

    def _then(self, points: NDArray[np.float64], now: Values, then: Values) -> NDArray[np.float64]:
        if self._place is None:
            return points
        twins = {twin: _plain(now.of(leaf)) for twin, leaf in self._twins.items()}
        field = field_of(self._scene.node)
        moved = np.array(points)
        for first in range(0, len(points), BLOCK):
            part = points[first : first + BLOCK]
            with bound({**then.params, **twins}, then.time):
                p = np.broadcast_to(self._moved(part)[0], part.shape)
                for _ in range(3):  # the shape itself may have changed: to its surface, along the gradient
                    value, slope = evaluate_both(field, p)
                    p = p - (value / np.maximum(np.sum(slope * slope, axis=1), 1e-12))[:, None] * slope
            moved[first : first + BLOCK] = np.where(np.isfinite(p), p, part)
        return moved


def camera_header(pose: Pose, size: tuple[int, int]) -> dict[str, NDArray[np.float32]]:
    """The standard attributes worldToCamera and worldToNDC of OpenEXR: 4x4, for row vectors.

    Camera space is left-handed: x to the right, y up, z along the view. NDC is (0, 0) in the upper left corner of the
    picture, and (1, 1) in the lower right one.
    """
    axes = pose.frame * (1.0, 1.0, -1.0)
    to_camera = np.eye(4)
    to_camera[:3, :3], to_camera[3, :3] = axes, -pose.position @ axes
    half = pose.tan_half_fov if pose.half_height is None else pose.half_height
    last = 3 if pose.orthographic else 2  # the coordinate that is the divisor
    lens = np.zeros((4, 4))
    lens[0, 0], lens[1, 1], lens[2, 2] = 0.5 * size[1] / (half * size[0]), -0.5 / half, 1.0
    lens[last, :2], lens[last, 3] = 0.5, 1.0
    made = {"worldToCamera": to_camera, "worldToNDC": to_camera @ lens}
    return {name: matrix.astype(np.float32) for name, matrix in made.items()}


def _plain(value: NDArray[Any]) -> Any:
    return float(value) if value.shape == () else tuple(float(v) for v in value)
