"""FLIP: the perceived difference of two pictures that are alternated, per pixel.

Andersson, Nilsson, Akenine-Möller, Oskarsson, Åström and Fairchild, "FLIP: A Difference Evaluator for Alternating
Images" (HPG 2020), the version for low dynamic range. The tests compare it with the authors' own evaluator.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

PIXELS_PER_DEGREE = 0.7 * (3840 / 0.7) * np.pi / 180
"""A screen of 3840 pixels over 0.7 m, viewed from 0.7 m."""

BAD = 0.2
"""FLIP above which a pixel counts as bad in the search for regions of bad pixels."""

_TO_XYZ = np.array(
    [
        [10135552 / 24577794, 8788810 / 24577794, 4435075 / 24577794],
        [2613072 / 12288897, 8788810 / 12288897, 887015 / 12288897],
        [1425312 / 73733382, 8788810 / 73733382, 70074185 / 73733382],
    ]
)
_FROM_XYZ = np.linalg.inv(_TO_XYZ)
_WHITE = _TO_XYZ.sum(axis=1)

# The eye's contrast sensitivity as sums of Gaussians (a, b) in the frequency domain: light, red-green, blue-yellow.
_SENSITIVITY = (((1.0, 0.0047),), ((1.0, 0.0053),), ((34.1, 0.04), (13.5, 0.025)))
_WIDEST = 0.04
_COLOR_POWER = 0.7
_FEATURE_POWER = 0.5
_KNEE, _KNEE_VALUE = 0.4, 0.95
_FEATURE_DEGREES = 0.082


def flip(reference: ArrayLike, picture: ArrayLike) -> Array:
    """FLIP of each pixel, 0 (no visible difference) to 1; shape (H, W).

    Parameters
    ----------
    reference, picture : (H, W, 3), linear RGB; values outside [0, 1] are clipped, as on a screen. NaN counts as 0.

    Raises ValueError for pictures of different or other shapes.
    """
    return flip_between(perceived(reference), perceived(picture))


@dataclass(frozen=True, slots=True)
class Perceived:
    """What the eye sees of a picture: colours, (H, W, 3), and how strong edges and points are, each (H, W)."""

    color: Array
    edges: Array
    points: Array


def perceived(picture: ArrayLike) -> Perceived:
    """The first half of FLIP, for a picture that is compared with several others. Parameters are those of `flip`."""
    rgb = np.clip(np.nan_to_num(np.asarray(picture, np.float64), nan=0.0), 0.0, 1.0)
    if rgb.ndim != 3 or rgb.shape[-1] != 3 or not rgb.size:
        raise ValueError(f"flip: a picture of shape {rgb.shape}; legal: (H, W, 3)")
    opponent = _opponent(rgb)
    light = (opponent[..., 0] + 16.0) / 116.0
    features = (_features(light, kind) for kind in ("edge", "point"))
    return Perceived(_hunt(_lab(_filtered(opponent))), *features)


def flip_between(a: Perceived, b: Perceived) -> Array:
    """FLIP of each pixel, (H, W), of two pictures. ValueError for different shapes."""
    if a.color.shape != b.color.shape:
        raise ValueError(
            f"flip: shapes {a.color.shape} and {b.color.shape}; legal: two pictures of one shape (H, W, 3)"
        )
    feature = np.maximum(np.abs(a.edges - b.edges), np.abs(a.points - b.points))
    result: Array = _color_difference(a, b) ** (1.0 - (feature / np.sqrt(2.0)) ** _FEATURE_POWER)
    return result


def _color_difference(a: Perceived, b: Perceived) -> Array:
    largest = _largest()
    power = _hyab(a.color, b.color) ** _COLOR_POWER
    knee = _KNEE * largest
    beyond = _KNEE_VALUE + (power - knee) / (largest - knee) * (1.0 - _KNEE_VALUE)
    return np.where(power < knee, _KNEE_VALUE / knee * power, beyond)


def _features(light: Array, kind: str) -> Array:
    along, across = _feature_kernels(kind)
    return np.hypot(_separable(light, along, across), _separable(light, across, along))


@cache
def _feature_kernels(kind: str) -> tuple[Array, Array]:
    """First or second derivative of a Gaussian, and the Gaussian. Positive and negative parts each sum to 1."""
    deviation = 0.5 * _FEATURE_DEGREES * PIXELS_PER_DEGREE
    x = _taps(int(np.ceil(3.0 * deviation)))
    gauss = np.exp(-(x**2) / (2.0 * deviation**2))
    slope = -x * gauss if kind == "edge" else (x**2 / deviation**2 - 1.0) * gauss
    slope = np.where(slope < 0.0, slope / -slope[slope < 0.0].sum(), slope / slope[slope > 0.0].sum())
    return slope, gauss / gauss.sum()


def _filtered(opponent: Array) -> Array:
    """Picture filtered by the contrast sensitivity of the eye, as linear RGB in [0, 1]."""
    filtered = np.empty_like(opponent)
    radius = int(np.ceil(3.0 * np.sqrt(_WIDEST / (2.0 * np.pi**2)) * PIXELS_PER_DEGREE))
    x = _taps(radius) / PIXELS_PER_DEGREE
    for channel, gaussians in enumerate(_SENSITIVITY):
        kernels = [np.exp(-(np.pi**2) * x**2 / b) for _, b in gaussians]
        weights = [a * np.sqrt(np.pi / b) * k.sum() ** 2 for (a, b), k in zip(gaussians, kernels, strict=True)]
        parts = [
            w / sum(weights) * _separable(opponent[..., channel], k / k.sum(), k / k.sum())
            for w, k in zip(weights, kernels, strict=True)
        ]
        filtered[..., channel] = sum(parts)
    return np.clip(_from_opponent(filtered), 0.0, 1.0)


def _taps(radius: int) -> Array:
    return np.arange(-radius, radius + 1, dtype=np.float64)


def _separable(values: Array, across: Array, down: Array) -> Array:
    """Convolution with a kernel for columns and one for rows; the border repeats the edge pixels."""
    rows = _convolved(values, across)
    return _convolved(rows.T, down).T


def _convolved(values: Array, kernel: Array) -> Array:
    radius = len(kernel) // 2
    padded = np.pad(values, ((0, 0), (radius, radius)), mode="edge")
    width = values.shape[1]
    total = np.zeros_like(values)
    for k, weight in enumerate(kernel):
        total += weight * padded[:, k : k + width]
    return total


def _opponent(rgb: Array) -> Array:
    """Linear RGB to YCxCz: light, red-green, blue-yellow."""
    x, y, z = np.moveaxis(rgb @ _TO_XYZ.T / _WHITE, -1, 0)
    return np.stack([116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)], axis=-1)


def _from_opponent(opponent: Array) -> Array:
    light, red_green, blue_yellow = np.moveaxis(opponent, -1, 0)
    y = (light + 16.0) / 116.0
    xyz = np.stack([red_green / 500.0 + y, y, y - blue_yellow / 200.0], axis=-1) * _WHITE
    return xyz @ _FROM_XYZ.T


def _lab(rgb: Array) -> Array:
    """Linear RGB to CIE L*a*b*."""
    ratio = rgb @ _TO_XYZ.T / _WHITE
    bend = 6.0 / 29.0
    f = np.where(ratio > bend**3, np.cbrt(ratio), ratio / (3.0 * bend**2) + 4.0 / 29.0)
    x, y, z = np.moveaxis(f, -1, 0)
    return np.stack([116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)], axis=-1)


def _hunt(lab: Array) -> Array:
    """Hunt adjustment: chroma is scaled by lightness."""
    light = lab[..., :1]
    return np.concatenate([light, 0.01 * light * lab[..., 1:]], axis=-1)


def _hyab(a: Array, b: Array) -> Array:
    difference = a - b
    result: Array = np.abs(difference[..., 0]) + np.hypot(difference[..., 1], difference[..., 2])
    return result


@cache
def _largest() -> float:
    """The largest colour difference: green against blue."""
    green, blue = (_hunt(_lab(np.array([c]))) for c in ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0)))
    return float(_hyab(green, blue)[0] ** _COLOR_POWER)


def largest_region(bad: NDArray[Any]) -> int:
    """Pixels of the largest connected region of a mask of shape (H, W), diagonals included; 0 if there is none.

    The mean over a picture hides a small hole that is clearly visible; this measure does not.
    """
    mask = np.asarray(bad, np.bool_)
    height, width = mask.shape
    labels = np.where(mask, np.arange(1, mask.size + 1).reshape(mask.shape), 0)
    while True:  # each turn spreads the largest label of a neighbourhood, then every label jumps to its label's label
        padded = np.pad(labels, 1)
        around = [padded[i : i + height, j : j + width] for i in range(3) for j in range(3)]
        spread = np.where(mask, np.maximum.reduce(around), 0)
        spread = np.where(mask, np.concatenate([[0], spread.ravel()])[spread], 0)
        if np.array_equal(spread, labels):
            break
        labels = spread
    return int(np.bincount(labels[mask]).max()) if mask.any() else 0
