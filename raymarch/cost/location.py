"""Where in the picture the error of a setting lies."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from raymarch.cost.errors import footprints
from raymarch.cost.reference import Reference
from raymarch.cost.sweep import Point

WORST = 0.01
"""Fraction of the compared hits whose location is described."""
BANDS = (0.0, 10.0, 30.0, 90.0)
"""Ends of the bands of angles in degrees between the ray and the surface; 90 is a surface seen from the front."""
CONCENTRATED = 1.5
"""A band is named if it holds this many times its fraction of the hits."""


@dataclass(frozen=True, slots=True)
class Band:
    """Hits by the angle at which the surface is seen.

    low, high : ends of the band in degrees; 0 is seen edge-on, 90 from the front.
    hits : its fraction of the compared hits. worst : its fraction of those with the largest errors.
    p99 : 99th percentile of its errors in pixels; 0 without hits.
    """

    low: float
    high: float
    hits: float
    worst: float
    p99: float


@dataclass(frozen=True, slots=True)
class Location:
    """Where the error lies: by angle, and the pixel with the largest error.

    column, row : of that pixel, from the left and the top. largest : its error in pixels. angle : at which its surface
        is seen, in degrees.
    missed : number of missed and false hits away from silhouettes.
    """

    bands: tuple[Band, ...]
    column: int
    row: int
    largest: float
    missed: int
    angle: float = 90.0

    @property
    def worst(self) -> str:
        """The largest error and the angle of its surface, in words; "" without an error."""
        from_front = self.angle >= BANDS[2]
        seen = "from the front" if from_front else "edge-on" if self.angle < BANDS[1] else "at an angle"
        return f"{self.largest:.2g} px, on a surface seen {seen} ({self.angle:.2g}°)" if self.largest else ""

    @property
    def words(self) -> str:
        """One sentence."""
        if self.missed:
            return f"{self.missed} hits are missed or false; they are magenta in the error map."
        if not self.bands:
            return "no hit is compared."
        if not self.largest:
            return "no compared hit is off."
        band = max(self.bands, key=lambda b: b.worst / max(b.hits, 1e-9))
        if band.worst < CONCENTRATED * band.hits:
            return "the error is spread evenly over the surfaces."
        seen = {0.0: "edge-on", 10.0: "at an angle", 30.0: "from the front"}[band.low]
        return (
            f"the error lies where surfaces are seen {seen}, {band.low:g}° to {band.high:g}° between ray and surface: "
            f"{band.worst:.0%} of the worst hundredth of the errors are there, and {band.hits:.0%} of the hits."
        )


def location(point: Point) -> Location:
    """Where the error of a setting lies, among the hits that its errors compare."""
    known = point.known
    off = footprints(known, point.depth)
    compared = known.hit & np.isfinite(point.depth)
    if point.errors.apart:
        compared &= ~known.edges
    values, angles = off[compared], _angles(known)[compared]
    missed = point.errors.missed + point.errors.false
    if not values.size:
        return Location((), 0, 0, 0.0, missed)
    worst = values >= np.percentile(values, 100.0 * (1.0 - WORST))
    bands = []
    for low, high in pairwise(BANDS):
        inside = (angles >= low) & (angles < high if high < BANDS[-1] else angles <= high)
        p99 = float(np.percentile(values[inside], 99)) if inside.any() else 0.0
        bands.append(Band(low, high, float(inside.mean()), float(inside[worst].mean()), p99))
    shown = np.where(compared, off, -1.0)
    row, column = np.unravel_index(int(np.argmax(shown)), shown.shape)
    angle = float(_angles(known)[row, column])
    return Location(tuple(bands), int(column), int(row), float(values.max()), missed, angle)


def _angles(known: Reference) -> NDArray[np.float64]:
    """Degrees between each ray and the true surface."""
    cosine = np.abs(np.einsum("ijk,ijk->ij", known.normal, known.direction))
    length = np.linalg.norm(known.normal, axis=-1) * np.linalg.norm(known.direction, axis=-1)
    sine = np.divide(cosine, length, out=np.zeros_like(cosine), where=length > 0)
    return np.asarray(np.degrees(np.arcsin(np.clip(sine, 0.0, 1.0))), np.float64)
