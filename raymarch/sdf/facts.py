"""What a node promises: how far its distance can be trusted, how steep it is, where it lies."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

Exactness: TypeAlias = Literal["exact", "bound", "estimate"]
ORDER: tuple[Exactness, ...] = ("exact", "bound", "estimate")


@dataclass(frozen=True, slots=True, eq=False)
class Facts:
    """Facts of one node, valid for every parameter value in range and every time.

    Attributes
    ----------
    exactness : "exact" Euclidean signed distance; "bound", never larger in size than it; "estimate", no guarantee.
    lipschitz : the field never changes faster than this times the distance walked; 1 at most.
    divisor : what the definition's own value is divided by to make it so.
    lower, upper : corners of an axis-aligned box that holds the solid, each of shape (dimension,); infinite
        where it has no end.
    symmetry : axes among "xyz" along which the field is its own mirror image about the origin.
    spread : a point whose distance is m > 0 lies in the box grown by `spread` times m on each side. 1 if exact; a
        bound may rise more slowly, so that what moves its surface outwards moves it farther.
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
        return bool(np.all(np.isfinite(self.lower)) and np.all(np.isfinite(self.upper)))

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
