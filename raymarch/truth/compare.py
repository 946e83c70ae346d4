"""A frame held against the truth, away from silhouettes, where a hair decides between two surfaces."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from raymarch.truth.tracer import Truth

JUMP = 0.25
"""Distance from each other's tangent plane, in pixels at that depth, that no curvature need explain."""
CREASE = 3.0
"""How many times more the normal turns across a crease than beside it."""
TURN = np.radians(1.0)
"""Turns of the normal up to this are no crease, whatever is beside them: half a step of an 8-bit colour."""
CORNER = np.radians(30.0)
"""Turns from one pixel to the next beyond this are a crease in any case: a ball of two pixels' radius."""


@dataclass(frozen=True, slots=True)
class Comparison:
    """How far a frame is from the truth. Errors are taken where both hit, away from silhouettes; nan if nowhere.

    Attributes
    ----------
    pixels : number of pixels away from silhouettes. compared : those of them where both hit.
    missed_hits : pixels among them where the truth hits and the frame does not. false_hits : the reverse.
    depth_p50, depth_p99, depth_max : |depth - truth| / truth; median, 99th percentile, largest.
    normal_p50, normal_p95, normal_p99, normal_max : angle between the normals, in degrees.
    """

    pixels: int
    compared: int
    missed_hits: int
    false_hits: int
    depth_p50: float
    depth_p99: float
    depth_max: float
    normal_p50: float
    normal_p95: float
    normal_p99: float
    normal_max: float


def compare(frame_depth: ArrayLike, frame_normal: ArrayLike | None, truth: Truth, width: int = 1) -> Comparison:
    """Hold depths and normals of a frame against the truth.

    Parameters
    ----------
    frame_depth : (H, W), inf where nothing was hit (NaN counts as that too).
    frame_normal : (H, W, 3), any length but 0; None leaves the angles nan.
    truth : of the same scene, size, time and parameters.
    width : pixels around silhouettes that are left out; see `silhouettes`.

    Raises ValueError for arrays of another shape.
    """
    depth = _shaped("frame_depth", frame_depth, truth.depth.shape)
    plain = ~silhouettes(truth, width)
    hit = np.isfinite(depth)
    both = plain & hit & truth.hit
    with np.errstate(divide="ignore", invalid="ignore"):
        wrong = np.abs(depth[both] - truth.depth[both]) / truth.depth[both]
    wrong = np.where(depth[both] == truth.depth[both], 0.0, wrong)
    if frame_normal is None:
        angles = np.empty(0)
    else:
        normal = _shaped("frame_normal", frame_normal, truth.normal.shape)
        angles = np.degrees(_angle(normal[both], truth.normal[both]))
    return Comparison(
        int(plain.sum()),
        int(both.sum()),
        int((plain & truth.hit & ~hit).sum()),
        int((plain & ~truth.hit & hit).sum()),
        *_percentiles(wrong, 50, 99, 100),
        *_percentiles(angles, 50, 95, 99, 100),
    )


def silhouettes(truth: Truth, width: int = 1) -> NDArray[np.bool_]:
    """The pixels within `width` pixels of an edge in the picture; bools of shape (H, W).

    An edge runs between two of eight neighbours where one hits and the other does not, the material changes, the
    normal has a crease, or the depth jumps: neither point lies near the tangent plane of the other. `width` 1 gives
    the pixels on both sides of an edge, each one more another ring around them. 0 gives none.

    Raises ValueError for a negative width.
    """
    if width < 0:
        raise ValueError(f"silhouettes: width = {width} (an integer >= 0)")
    mask = np.zeros(truth.hit.shape, np.bool_)
    if width == 0:
        return mask
    for a, b, before, after in _neighbours(truth.hit.shape):
        border = truth.material[a] != truth.material[b]  # that of a miss is -1
        turn = _turn(truth, a, b)
        beside = np.maximum(_turn(truth, before, a), _turn(truth, b, after))
        crease = (turn > CORNER) | (turn > TURN + CREASE * beside)
        edge = border | crease | _jump(truth, a, b, turn)
        mask[a] |= edge
        mask[b] |= edge
    for _ in range(width - 1):
        grown = mask.copy()
        for a, b, _before, _after in _neighbours(mask.shape):
            grown[a] |= mask[b]
            grown[b] |= mask[a]
        mask = grown
    return mask


Window = tuple[NDArray[Any], NDArray[Any]]
STEPS = ((0, 1), (1, 0), (1, 1), (1, -1))


def _neighbours(shape: tuple[int, ...]) -> Iterator[tuple[Window, Window, Window, Window]]:
    """Indices of all pairs of neighbours (a, b), and of the pixels before a and after b on the same line.

    Beyond the border the pixels before and after are a and b themselves.
    """
    rows, columns = np.indices(shape)
    for down, right in STEPS:
        fits = (rows + down < shape[0]) & (columns + right >= 0) & (columns + right < shape[1])
        i, j = rows[fits], columns[fits]

        def moved(k: int, i: Any = i, j: Any = j, down: int = down, right: int = right) -> Window:
            y, x = i + k * down, j + k * right
            there = (y >= 0) & (y < shape[0]) & (x >= 0) & (x < shape[1])
            home = max(0, min(k, 1))
            return np.where(there, y, i + home * down), np.where(there, x, j + home * right)

        yield moved(0), moved(1), moved(-1), moved(2)


def _jump(truth: Truth, a: Window, b: Window, turn: Any) -> NDArray[np.bool_]:
    """Neither point is as near to the tangent plane of the other as one surface can make it.

    If the normal turns by `turn` over a pixel of width w, seen at an angle of cosine c, the surface leaves the
    tangent plane by turn w / (2 c^2) along the ray; twice that is allowed for.
    """
    both = truth.hit[a] & truth.hit[b]
    depth_a, depth_b = np.where(both, truth.depth[a], 1.0), np.where(both, truth.depth[b], 1.0)
    along = [np.einsum("ij,ij->i", truth.direction[i], truth.normal[i]) for i in (a, b)]
    apart = np.minimum(_off_plane(truth, a, depth_a, b, depth_b), _off_plane(truth, b, depth_b, a, depth_a))
    pixel = np.linalg.norm(truth.direction[a] - truth.direction[b], axis=-1) * np.minimum(depth_a, depth_b)
    with np.errstate(divide="ignore", invalid="ignore"):
        bend = turn / np.minimum(*np.square(along))
    result: NDArray[np.bool_] = both & (apart > pixel * (JUMP + np.where(turn > 0.0, bend, 0.0)))
    return result


def _off_plane(truth: Truth, a: Window, depth_a: Any, b: Window, depth_b: Any) -> NDArray[np.float64]:
    """How far along its ray b lies from the tangent plane of a."""
    normal = truth.normal[a]
    along_a = np.einsum("ij,ij->i", truth.direction[a], normal)
    along_b = np.einsum("ij,ij->i", truth.direction[b], normal)
    with np.errstate(divide="ignore", invalid="ignore"):
        expected = depth_a * along_a / along_b
    return np.where(along_a * along_b > 0.0, np.abs(depth_b - expected), np.inf)


def _turn(truth: Truth, a: Window, b: Window) -> NDArray[np.float64]:
    """Angle between the normals of pixels that both hit, else 0."""
    return np.where(truth.hit[a] & truth.hit[b], _angle(truth.normal[a], truth.normal[b]), 0.0)


def _angle(a: NDArray[Any], b: NDArray[Any]) -> NDArray[np.float64]:
    """Angle between vectors of any length, in radians, exact for small ones too."""
    result: NDArray[np.float64] = np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), np.einsum("ij,ij->i", a, b))
    return result


def _percentiles(values: NDArray[np.float64], *ranks: int) -> tuple[float, ...]:
    if not values.size:
        return (np.nan,) * len(ranks)
    return tuple(float(v) for v in np.percentile(values, ranks))


def _shaped(name: str, values: ArrayLike, shape: tuple[int, ...]) -> NDArray[np.float64]:
    array = np.asarray(values, np.float64)
    if array.shape != shape:
        raise ValueError(f"compare: {name} has shape {array.shape}, the truth {shape}")
    return array
