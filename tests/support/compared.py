"""Compare a frame with the reference away from silhouettes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from raymarch.gpu.renderer import Renderer
from raymarch.truth import Truth, silhouettes
from raymarch.truth.edges import angle, shaped


@dataclass(frozen=True, slots=True)
class Comparison:
    """Errors of a frame against the reference.

    Errors are taken where both hit, away from silhouettes. They are nan if there is no such pixel.

    Attributes
    ----------
    pixels : number of pixels away from silhouettes. compared : number of these where both hit.
    missed_hits : number of these where the reference hits and the frame does not. false_hits : the reverse.
    depth_p50, depth_p99, depth_max : |depth - reference| / reference; median, 99th percentile, largest.
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
    """Compare depths and normals of a frame with the reference.

    Parameters
    ----------
    frame_depth : (H, W), inf where nothing was hit; NaN counts as no hit.
    frame_normal : (H, W, 3), any length but 0; None leaves the angles nan.
    truth : the reference of the same scene, size, time and parameters.
    width : width of the excluded band around silhouettes in pixels; see `silhouettes`.

    Raises ValueError for arrays of another shape.
    """
    depth = shaped("compare: frame_depth", frame_depth, truth.depth.shape)
    plain = ~silhouettes(truth, width)
    hit = np.isfinite(depth)
    both = plain & hit & truth.hit
    with np.errstate(divide="ignore", invalid="ignore"):
        wrong = np.abs(depth[both] - truth.depth[both]) / truth.depth[both]
    wrong = np.where(depth[both] == truth.depth[both], 0.0, wrong)
    if frame_normal is None:
        angles = np.empty(0)
    else:
        normal = shaped("compare: frame_normal", frame_normal, truth.normal.shape)
        angles = np.degrees(angle(normal[both], truth.normal[both]))
    return Comparison(
        int(plain.sum()),
        int(both.sum()),
        int((plain & truth.hit & ~hit).sum()),
        int((plain & ~truth.hit & hit).sum()),
        *_percentiles(wrong, 50, 99, 100),
        *_percentiles(angles, 50, 95, 99, 100),
    )


def _percentiles(values: NDArray[np.float64], *ranks: int) -> tuple[float, ...]:
    if not values.size:
        return (np.nan,) * len(ranks)
    return tuple(float(v) for v in np.percentile(values, ranks))


def same_texels(renderer: Renderer, found: NDArray[Any], known: NDArray[Any]) -> None:
    """Assert that two texts of one picture give the same bits on a software renderer. The compilers of GPUs contract
    and reorder sums by what stands beside them: there the texels may differ by a few units of the last place."""
    if renderer.context.driver.is_software:
        np.testing.assert_array_equal(found, known)
    else:
        np.testing.assert_allclose(found, known, rtol=1e-6, atol=1e-6)
