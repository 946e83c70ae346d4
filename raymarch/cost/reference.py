"""The float64 reference of a scene, with edges and an averaged picture, cached on disk."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raymarch import cache
from raymarch.cost.content import content_key
from raymarch.scene.camera import Pose
from raymarch.scene.parameter import Values, set_values
from raymarch.scene.scene import Scene, check_scene
from raymarch.truth import Truth, silhouettes, truth
from raymarch.truth.floor import floor_evaluations
from raymarch.truth.near_edges import silhouettes_within
from raymarch.truth.rays import Rays, camera_rays, lens_rays
from raymarch.truth.tracer import finished, lens_points, trace

EDGE_WIDTHS = (0.25, 0.0625)
"""Edge distances in pixels that are tried where nearly every pixel has an edge."""
MOST_AT_EDGES = 0.5
"""Fraction of the hits that may be silhouettes before a smaller edge distance is tried."""

AT_ONCE = 1 << 16
"""Rays of the picture that are traced together; this bounds the memory, and how long nothing is said."""

Progress = Callable[[str], None]


@dataclass(frozen=True, eq=False, slots=True)
class Reference:
    """The reference of a scene, of H rows and W columns, computed on the CPU alone.

    depth, hit, normal, material, color, direction : as in `raymarch.truth`: through the centres of the pixels.
    edges : (H, W) bool, pixels with an edge within `edge_width` pixels of their centre.
    edge_width : 1, by `raymarch.truth.silhouettes`. Less, by `raymarch.truth.near_edges`, where most hits would be at
        edges and nothing would be left to compare.
    picture : (H, W, 3), linear RGB averaged over each pixel's square, by `samples` rays in a regular grid.
    spread : (H, W), standard error of `picture`, maximum over the channels, for as many independent random rays. That
        of a grid is smaller.
    half : (H, W, 3), the mean of every other one of these rays. Its difference from `picture` is as large as that of
        `picture` from the mean of infinitely many rays: half the difference of the two halves' means has the standard
        error of the whole.
    samples : rays per pixel of the picture.
    pixel : size of a pixel at distance 1, or of an orthographic camera at all distances; see `footprint`.
    parallel : True for an orthographic camera.
    origin : start of the rays, (H, W, 3), or (1, 1, 3) if all rays have one.
    floor : (H, W), N* of `raymarch.truth.floor`; -1 where the field is only an estimate.
    """

    depth: NDArray[np.float64]
    hit: NDArray[np.bool_]
    normal: NDArray[np.float64]
    material: NDArray[np.int64]
    color: NDArray[np.float64]
    direction: NDArray[np.float64]
    edges: NDArray[np.bool_]
    edge_width: float
    picture: NDArray[np.float64]
    spread: NDArray[np.float64]
    half: NDArray[np.float64]
    samples: int
    pixel: float
    parallel: bool
    origin: NDArray[np.float64]
    floor: NDArray[np.int64]

    @property
    def size(self) -> tuple[int, int]:
        """(width, height)."""
        return self.depth.shape[1], self.depth.shape[0]

    def footprint(self, depth: NDArray[np.float64] | None = None) -> NDArray[np.float64]:
        """Width of a pixel at some distances along its ray; without them, at the true hits."""
        t = self.depth if depth is None else depth
        return np.full(t.shape, self.pixel) if self.parallel else self.pixel * t


def reference(
    scene: Scene,
    size: tuple[int, int],
    time: float = 0.0,
    params: Mapping[str, Any] | None = None,
    samples: int = 1,
    progress: Progress | None = None,
) -> Reference:
    """The reference of a scene, from the cache if it was computed before.

    scene, size, time, params : as `raymarch.truth` takes them.
    samples : rays per pixel of the averaged picture, a square number from 1 to 256. 1 is the centre alone. 0 skips the
        colours (then 0) and N* (then -1), which take the longest.
    progress : called with a description of the current step.

    The cache is keyed by the content of the scene and the code that computes the reference. A cache file that cannot be
    read or written costs time, never the result.
    Raises ValueError for another number of samples, SceneError as `raymarch.truth` does.
    """
    check_scene("reference", scene)
    edge = round(max(samples, 0) ** 0.5)
    if edge * edge != samples or not 0 <= samples <= 256:
        raise ValueError(f"reference: samples = {samples} (a square number up to 256)")
    values = set_values(scene.parameters, params, time)
    near = scene.quality.near(refined=True) if samples else None  # N* alone depends on it
    key = content_key(scene, tuple(size), time, dict(values.params), samples, near)
    file = None if (folder := cache_folder()) is None else folder / f"{key}.npz"
    found = None if file is None else _load(file)
    if found is None:
        found = _compute(scene, size, values, edge, progress or (lambda _: None))
        if file is not None:
            _save(file, found)
    return found


def cache_folder() -> Path | None:
    """The cache folder: $RAYMARCH_CACHE, else in the user's cache; None if the variable is empty."""
    found = cache.folder()
    return None if found is None else found / "truth"


def _compute(scene: Scene, size: Any, values: Values, edge: int, progress: Progress) -> Reference:
    progress("reference: depth, normals, colour")
    time, params = values.time, values.params
    known = truth(scene.replace(quality=scene.quality.replace(samples=1)), size, time, params, ("normal", "material"))
    width, height = known.depth.shape[1], known.depth.shape[0]
    pose = scene.pose(values, width / height)
    color = known.color if edge else np.zeros((height, width, 3))
    picture, spread, half = color, np.zeros(known.depth.shape), color
    if edge > 1:
        what = f"reference: the picture from {edge * edge} rays per pixel"
        progress(what)
        picture, spread, half = _averaged(
            scene, pose, values, (width, height), edge, lambda share: progress(f"{what}, {share:.0%}")
        )
    edges, edge_width = _edges(scene, known, time, params, progress)
    floor = np.full(known.depth.shape, -1, np.int64)
    if edge and scene.node.exactness != "estimate":
        progress("floor: the fewest evaluations")
        floor = floor_evaluations(scene, (width, height), time, params)
    return Reference(
        **{name: getattr(known, name) for name in ("depth", "hit", "normal", "material", "direction")},
        color=color,
        edges=edges,
        edge_width=edge_width,
        picture=picture,
        spread=spread,
        half=half,
        samples=edge * edge,
        pixel=pose.pixel(height),
        parallel=pose.orthographic,
        origin=known.origin if pose.orthographic else pose.position[None, None, :],
        floor=floor,
    )


def _edges(scene: Scene, known: Truth, time: float, params: Any, progress: Progress) -> tuple[NDArray[np.bool_], float]:
    """The pixels at silhouettes, and the edge distance that defines them.

    Where most hits have an edge within a pixel, as on a fine lattice, they cannot all be excluded. The edge distance is
    then reduced until the excluded hits are the smaller part. An estimate keeps 1.
    """
    edges, width = silhouettes(known), 1.0
    if scene.node.exactness == "estimate":
        return edges, width
    for edge_width in EDGE_WIDTHS:
        if (edges & known.hit).sum() <= MOST_AT_EDGES * known.hit.sum():
            break
        progress(f"reference: edges within {edge_width:g} pixels")
        edges, width = silhouettes_within(scene, edges, edge_width, time, params), edge_width
    return edges, width


def _averaged(
    scene: Scene, pose: Pose, values: Values, size: tuple[int, int], edge: int, done: Callable[[float], None]
) -> tuple[Any, Any, Any]:
    """Mean, standard error, and mean of one half, over a grid of `edge` x `edge` rays in each pixel.

    The half is every other ray, as on a chessboard; the larger half of an odd number.
    """
    width, height = size
    if pose.aperture > 0.0 or scene.motion_blur:
        return _averaged_over_lens_and_time(scene, values, size, edge * edge, done)
    black = np.indices((edge, edge)).sum(axis=0).ravel() % 2 == 0
    picture, half, spread = np.empty((height, width, 3)), np.empty((height, width, 3)), np.empty((height, width))
    band = max(1, AT_ONCE // (width * edge * edge))
    for top in range(0, height, band):
        rows = range(top * edge, min(top + band, height) * edge)
        rays = camera_rays(pose, width * edge, height * edge, rows)
        fine = trace(scene, values, pose, rays, (len(rows), width * edge), pose.pixel(height * edge)).color
        cells = fine.reshape(-1, edge, width, edge, 3).swapaxes(1, 2).reshape(-1, width, edge * edge, 3)
        part = slice(top, top + band)
        picture[part], half[part] = cells.mean(axis=2), cells[:, :, black].mean(axis=2)
        spread[part] = cells.std(axis=2, ddof=1).max(axis=-1) / edge
        done(min(top + band, height) / height)
    return finished(scene, values, picture), spread, finished(scene, values, half)


def _averaged_over_lens_and_time(
    scene: Scene, values: Values, size: tuple[int, int], count: int, done: Callable[[float], None]
) -> tuple[Any, ...]:
    """As `_averaged`, where each ray of a pixel has a point of the pixel, of the lens, and of the open shutter.

    Each of the three is stratified. Every pixel turns the points of the lens by an angle of its own: else all pixels
    would show the same few points of the lens.
    """
    width, height = size
    chance = np.random.default_rng(0)
    edge = round(count**0.5)
    black = np.indices((edge, edge)).sum(axis=0).ravel() % 2 == 0
    square = (np.stack(np.divmod(np.arange(count), edge), axis=1) + 0.5) / edge - 0.5
    angle = chance.uniform(0.0, 2.0 * np.pi, width * height)
    turn = np.stack([np.cos(angle), np.sin(angle), -np.sin(angle), np.cos(angle)], axis=1).reshape(-1, 2, 2)
    points, moments = lens_points(count)[chance.permutation(count)], chance.permutation(count)
    opened = scene.camera.open_seconds(values) if scene.motion_blur else 0.0
    row, column = (v.ravel() for v in np.indices((height, width)))
    total, first, squares = (np.zeros((height * width, 3)) for _ in range(3))
    for k in range(count):
        then = replace(values, time=values.time + opened * ((moments[k] + 0.5) / count - 0.5))
        pose = scene.pose(then, width / height)
        origins, directions = pose.rays(column + square[k, 1], row + square[k, 0], size)
        rays = Rays(origins, directions)
        if pose.aperture > 0.0:
            rays = lens_rays(pose, rays, turn @ points[k])
        color = np.empty((height * width, 3))
        for start in range(0, len(color), AT_ONCE):
            part = slice(start, start + AT_ONCE)
            some = Rays(rays.origins[part], rays.directions[part])
            shape = (1, len(some.directions))
            color[part] = trace(scene, then, pose, some, shape, pose.pixel(height) / edge).color[0]
        total, squares = total + color, squares + color**2
        if black[k]:
            first += color
        done((k + 1) / count)
    variance = np.maximum(squares - total**2 / count, 0.0) / (count - 1)
    pictures = (finished(scene, values, v.reshape(height, width, 3)) for v in (total / count, first / black.sum()))
    return next(pictures), np.sqrt(variance / count).max(axis=1).reshape(height, width), next(pictures)


def _load(file: Path) -> Reference | None:
    stored = cache.load(file)
    if stored is None or not {f.name for f in fields(Reference)} <= stored.keys():
        return None
    numbers = ("samples", "pixel", "parallel", "edge_width")
    return Reference(**stored | {name: stored[name].item() for name in numbers})


def _save(file: Path, made: Reference) -> None:
    cache.save(file, {f.name: np.asarray(getattr(made, f.name)) for f in fields(Reference)})
