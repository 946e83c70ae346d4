"""Facts of a node: exactness, Lipschitz bound, bounding box, symmetry."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

FARTHEST = 1e30
"""Beyond every distance: stands for infinity where float32 must hold the number and its differences."""

Exactness: TypeAlias = Literal["exact", "bound", "estimate"]
ORDER: tuple[Exactness, ...] = ("exact", "bound", "estimate")


@dataclass(frozen=True, slots=True, eq=False)
class Facts:
    """Facts of one node, valid for every parameter value in range and every time.

    Attributes
    ----------
    exactness : "exact": signed Euclidean distance. "bound": its absolute value never exceeds that distance. "estimate":
        no guarantee.
    lipschitz : Lipschitz constant of the field, at most 1.
    divisor : number by which the value of the definition is divided to reach that constant.
    lower, upper : corners of an axis-aligned box around the solid, each of shape (dimension,); infinite where it is
        unbounded.
    symmetry : axes among "xyz" along which the field is mirror-symmetric about the origin.
    spread : a point with field value m > 0 lies in the box grown by `spread` * m on each side. 1 if exact. A bound may
        rise more slowly; an offset then moves its surface farther.
    convex : True if the solid is known to be convex.
    undivided, undivided_spread : Lipschitz constant and spread of the field as it is written: with no division, of the
        node or below it. Operators that compare or add distances, such as blends, offsets and shells, act on it.
    radii : shape (4,): of the cylinders about the lines through the centre of the box along x, y and z, and of the ball
        about the centre, that contain the solid; None for those that contain the box.
    swell, undivided_swell : a point with field value m > 0 lies in these cylinders and this ball with radii larger by
        `swell` * m; the same for the undivided field.
    far : a distance from the origin within which the solid lies, with the same swell, where one is known.
    placed : the solid at the end of a chain of rigid motions by constants; None without one.
    """

    exactness: Exactness
    lipschitz: float
    lower: NDArray[np.float64]
    upper: NDArray[np.float64]
    symmetry: str = ""
    divisor: float = 1.0
    spread: float = float("inf")
    convex: bool = False
    undivided: float = 1.0
    undivided_spread: float = float("inf")
    radii: NDArray[np.float64] | None = None
    swell: float = float("inf")
    undivided_swell: float = float("inf")
    placed: Placed | None = None
    far: float = float("inf")

    @property
    def farthest(self) -> float:
        """A distance from the origin within which the solid lies."""
        return float(np.fmin(self.far, np.linalg.norm(0.5 * (self.lower + self.upper)) + self.reach[3]))

    @property
    def reach(self) -> NDArray[np.float64]:
        """The radii; those of the box if none are known."""
        return radial(0.5 * self.size) if self.radii is None else self.radii

    @property
    def bounded(self) -> bool:
        """True if the box is finite on every side."""
        return bool(np.isfinite(self.lower).all() and np.isfinite(self.upper).all())

    @property
    def divided(self) -> bool:
        """True if the field is divided, at the node or below it."""
        return self.undivided != self.lipschitz

    @property
    def empty(self) -> bool:
        """True if the box shows that the solid has no point at all."""
        return bool(np.any(self.lower > self.upper))

    @property
    def size(self) -> NDArray[Any]:
        """Edges of the box."""
        return self.upper - self.lower


@dataclass(frozen=True, slots=True, eq=False)
class Placed:
    """A solid of these facts, moved by x -> linear x + offset: a rotation times one factor, and a translation."""

    facts: Facts
    linear: NDArray[np.float64]
    offset: NDArray[np.float64]


def radial(v: NDArray[Any]) -> NDArray[np.float64]:
    """Distances of points, (..., 2) or (..., 3), from the x, y and z axes and from the origin, (..., 4)."""
    x, y, z = v[..., 0], v[..., 1], v[..., 2] if v.shape[-1] > 2 else np.zeros(v.shape[:-1])
    return np.stack([np.hypot(y, z), np.hypot(x, z), np.hypot(x, y), np.hypot(np.hypot(x, y), z)], axis=-1)


def lattice(axes: Sequence[NDArray[Any]]) -> NDArray[Any]:
    """The points of a grid, (N, d), by the coordinates along each axis."""
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))


def worst(*levels: Exactness) -> Exactness:
    """The weakest of some promises."""
    return max(levels, key=ORDER.index)


def disjoint(a: Facts, b: Facts) -> bool:
    """True if the two boxes do not overlap."""
    return bool(np.any(a.upper < b.lower) or np.any(b.upper < a.lower))


def around(boxes: Sequence[Facts]) -> Facts:
    """The box around one box or several."""
    lower, upper = [box.lower for box in boxes], [box.upper for box in boxes]
    return Facts("bound", 1.0, np.minimum.reduce(lower), np.maximum.reduce(upper))


def beyond(
    lower: NDArray[np.float64],
    upper: NDArray[np.float64],
    low: NDArray[np.float64],
    high: NDArray[np.float64] | None = None,
) -> NDArray[np.float64]:
    """How far boxes are apart along each axis, 0 where they overlap; without `high` a box is the point `low`."""
    return np.maximum(np.maximum(lower - (low if high is None else high), low - upper), 0.0)
