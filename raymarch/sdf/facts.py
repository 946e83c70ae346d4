"""Facts of a node: exactness, Lipschitz bound, bounding box, symmetry."""

from __future__ import annotations

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
    """

    exactness: Exactness
    lipschitz: float
    lower: NDArray[np.float64]
    upper: NDArray[np.float64]
    symmetry: str = ""
    divisor: float = 1.0
    spread: float = float("inf")
    convex: bool = False

    @property
    def bounded(self) -> bool:
        """True if the box is finite on every side."""
        return bool(np.isfinite(self.lower).all() and np.isfinite(self.upper).all())

    @property
    def empty(self) -> bool:
        """True if the box shows that the solid has no point at all."""
        return bool(np.any(self.lower > self.upper))

    @property
    def size(self) -> NDArray[Any]:
        """Edges of the box."""
        return self.upper - self.lower


def worst(*levels: Exactness) -> Exactness:
    """The weakest of some promises."""
    return max(levels, key=ORDER.index)


def disjoint(a: Facts, b: Facts) -> bool:
    """True if the two boxes do not overlap."""
    return bool(np.any(a.upper < b.lower) or np.any(b.upper < a.lower))
