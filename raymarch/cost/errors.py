"""Errors of a frame against the reference."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from raymarch.cost.flip import BAD, Perceived, flip_between, largest_region, perceived
from raymarch.cost.reference import Reference
from raymarch.errors import CostError
from raymarch.scene.scene import Scene
from raymarch.truth.edges import angle, shaped

Array = NDArray[np.float64]
NAN = float("nan")

ENOUGH = 0.05
"""Least fraction of the hits away from silhouettes; below it, silhouettes are compared too."""


@dataclass(frozen=True, slots=True)
class Errors:
    """Errors of one frame. They are nan if nothing could be compared.

    Pixels at silhouettes are excluded: there the smallest offset decides which of two surfaces is hit. The exceptions
    are the two `_at_edges` and the errors of the picture. All others are taken where both the frame and the reference
    hit. Where nearly all hits are at silhouettes, as on a fractal, distances and normals are compared there too.

    pixels : number of compared pixels.
    apart : False if silhouettes had to be compared too.
    missed, false : number of hits that only the reference has, and that only the frame has.
    missed_at_edges, false_at_edges : the same at silhouettes.
    depth_rms, depth_p50, depth_p99, depth_max : abs(depth - reference), in the scene's unit of length.
    p1 : the sum of (depth - reference)^2 over all pixels where the reference hits, silhouettes too, the measure of
        Bálint and Valasek (2018). A ray without a hit counts with the distance that it reached.
    p1_apart : the same without silhouettes, where one pixel on the other surface outweighs all others.
    pixels_p50, pixels_p99, pixels_p999, pixels_max : abs(depth - reference) in footprints, a pixel's size at that
        distance; p999 is 99.9 %.
    normal_p50, normal_p99, normal_max : angle between the normals in degrees.
    flip_mean, flip_p99, flip_max : FLIP of the picture against the averaged reference, over all pixels.
    flip_region : pixels of the largest connected region where FLIP exceeds 0.2.
    """

    pixels: int
    apart: bool
    missed: int
    false: int
    missed_at_edges: int
    false_at_edges: int
    depth_rms: float = NAN
    depth_p50: float = NAN
    depth_p99: float = NAN
    depth_max: float = NAN
    p1: float = NAN
    p1_apart: float = NAN
    pixels_p50: float = NAN
    pixels_p99: float = NAN
    pixels_p999: float = NAN
    pixels_max: float = NAN
    normal_p50: float = NAN
    normal_p99: float = NAN
    normal_max: float = NAN
    flip_mean: float = NAN
    flip_p99: float = NAN
    flip_max: float = NAN
    flip_region: int = 0

    @property
    def sound(self) -> bool:
        """True if no hit is missed or false away from silhouettes."""
        return self.missed == 0 and self.false == 0

    def as_dict(self) -> dict[str, float | int | None]:
        """The numbers by name, None for nan, as JSON has it."""
        return {name: None if value != value else value for name, value in asdict(self).items()}


def measure(
    known: Reference,
    depth: ArrayLike,
    normal: ArrayLike | None = None,
    color: ArrayLike | None = None,
    reach: ArrayLike | None = None,
    difference: Array | None = None,
) -> Errors:
    """The errors of a frame's arrays.

    known : the reference.
    depth : (H, W), inf where nothing was hit.
    normal : (H, W, 3), any length but 0; None leaves the angles nan.
    color : (H, W, 3), linear RGB; None leaves the picture's errors nan.
    reach : (H, W), the distance that each ray reached; None leaves rays without a hit out of `p1`.
    difference : (H, W), the FLIP of `color` against the reference picture, if it is known already.

    Raises ValueError for arrays of another shape.
    """
    given = shaped("errors: depth", depth, known.depth.shape)
    hit = np.isfinite(given)
    inner, both = ~known.edges, hit & known.hit
    apart = bool((known.hit & inner).sum() >= ENOUGH * known.hit.sum())
    compared = inner & both if apart else both
    missed, false = known.hit & ~hit, hit & ~known.hit
    found: dict[str, Any] = {
        "pixels": int(compared.sum()),
        "apart": apart,
        "missed": int((missed & inner).sum()),
        "false": int((false & inner).sum()),
        "missed_at_edges": int((missed & known.edges).sum()),
        "false_at_edges": int((false & known.edges).sum()),
    }
    if both.any() or reach is not None:
        came = given if reach is None else np.where(hit, given, shaped("errors: reach", reach, given.shape))
        counted = both if reach is None else known.hit
        found["p1"] = float(np.sum((came[counted] - known.depth[counted]) ** 2))
        counted = counted & inner if apart else counted
        found["p1_apart"] = float(np.sum((came[counted] - known.depth[counted]) ** 2))
    off = np.abs(given[compared] - known.depth[compared])
    if off.size:
        found["depth_rms"] = float(np.sqrt(np.mean(off**2)))
        found |= _ranks("depth", off, 50, 99, 100)
        found |= _ranks("pixels", off / known.footprint()[compared], 50, 99, 99.9, 100)
        if normal is not None:
            vectors = shaped("errors: normal", normal, known.normal.shape)
            found |= _ranks("normal", np.degrees(angle(vectors[compared], known.normal[compared])), 50, 99, 100)
    if color is not None:
        picture = shaped("errors: color", color, known.picture.shape)
        found |= picture_errors(picture_difference(known, picture) if difference is None else difference)
    return Errors(**found)


def picture_difference(known: Reference, color: ArrayLike) -> Array:
    """FLIP of a picture, (H, W, 3) in linear RGB, against that of the reference: (H, W)."""
    return flip_between(_perceived(known), perceived(color))


@lru_cache(maxsize=2)  # the pictures of many settings are compared with one reference
def _perceived(known: Reference) -> Perceived:
    return perceived(known.picture)


def picture_errors(difference: Array) -> dict[str, Any]:
    """Errors of a picture from its FLIP, (H, W)."""
    ranks = _ranks("flip", difference.ravel(), 99, 100)
    return {"flip_mean": float(difference.mean()), **ranks, "flip_region": largest_region(difference > BAD)}


def check_followed(scene: Scene) -> None:
    """Raise CostError for a path-traced scene: the reference has no path tracer, so its picture is unknown."""
    if scene.path_traced:
        raise CostError(
            "FLIP against the reference: it has no path tracer, so there is no reference picture",
            legal="Quality(integrator='whitted'), or a distance in pixels such as 0.5px or pixels_p99",
            where=scene.where,
        )


def picture_doubt(known: Reference) -> float:
    """Estimate of the noise of the reference picture, as the 99th percentile of FLIP.

    It is the FLIP between the mean of all rays and the mean of half of them. This difference is as large as that
    between the mean of all rays and the mean of infinitely many. 0 for one ray per pixel: the noise is then unknown.
    """
    return float(np.percentile(picture_difference(known, known.half), 99))


def footprints(known: Reference, depth: ArrayLike) -> Array:
    """abs(depth - reference) in footprints, (H, W): inf where a hit is missed or false, 0 where neither hits."""
    return apart(depth, known.depth, known.footprint())


def apart(depth: ArrayLike, true: Array, width: Array) -> Array:
    """abs(depth - true) in footprints of pixels, whose width at the true hit is given; as `footprints`."""
    given = shaped("errors: depth", depth, true.shape)
    hit, known = np.isfinite(given), np.isfinite(true)
    found = np.where(hit == known, 0.0, np.inf)
    both = hit & known
    found[both] = np.abs(given[both] - true[both]) / width[both]
    return found


def _ranks(name: str, values: Array, *ranks: float) -> dict[str, float]:
    found = np.percentile(values, ranks)
    names = ("max" if r == 100 else f"p{r}".replace(".", "") for r in ranks)
    return {f"{name}_{rank}": float(v) for rank, v in zip(names, found, strict=True)}
