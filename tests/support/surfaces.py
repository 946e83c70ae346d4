"""Twelve implicit surfaces, as functions of numbers that NumPy and the expression language take alike.

Of each surface the solid is the side that fills less of its box: else most rays would end on a face of the box.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

import raymarch as rm
from raymarch.expr.node import Expr

PHI = (1 + 5**0.5) / 2


def klein(x: Any, y: Any, z: Any) -> Any:
    a, b = x**2 + y**2 + z**2 + 2 * y - 1, x**2 + y**2 + z**2 - 2 * y - 1
    return a * (b**2 - 8 * z**2) + 16 * x * z * b


def tangle(x: Any, y: Any, z: Any) -> Any:
    return x**4 - 5 * x**2 + y**4 - 5 * y**2 + z**4 - 5 * z**2 + 11.8


def one_sheet(x: Any, y: Any, z: Any) -> Any:
    return x**2 + z**2 - y**2 - 0.25


def two_sheets(x: Any, y: Any, z: Any) -> Any:
    return x**2 + z**2 - y**2 + 0.25


def clebsch(x: Any, y: Any, z: Any) -> Any:
    cubes = 81 * (x**3 + y**3 + z**3) - 189 * (x**2 * (y + z) + y**2 * (z + x) + z**2 * (x + y)) + 54 * x * y * z
    return -cubes - 126 * (x * y + y * z + z * x) + 9 * (x**2 + y**2 + z**2) + 9 * (x + y + z) - 1


def cayley(x: Any, y: Any, z: Any) -> Any:
    return 5 * (x**2 * (y + z) + y**2 * (x + z) + z**2 * (x + y)) - 2 * (x * y + x * z + y * z)


def kummer(x: Any, y: Any, z: Any) -> Any:
    m, s = 1.69, 2**0.5  # m = mu^2
    planes = (1 - z - s * x) * (1 - z + s * x) * (1 + z + s * y) * (1 + z - s * y)
    return (x**2 + y**2 + z**2 - m) ** 2 - (3 * m - 1) / (3 - m) * planes


def barth(x: Any, y: Any, z: Any) -> Any:
    planes = (PHI**2 * x**2 - y**2) * (PHI**2 * y**2 - z**2) * (PHI**2 * z**2 - x**2)
    return (1 + 2 * PHI) * (x**2 + y**2 + z**2 - 1) ** 2 - 4 * planes


def _chebyshev8(x: Any) -> Any:
    q = x * x
    return 128 * q**4 - 256 * q**3 + 160 * q**2 - 32 * q + 1


def chmutov(x: Any, y: Any, z: Any) -> Any:
    return _chebyshev8(x) + _chebyshev8(y) + _chebyshev8(z) + 1


def roman(x: Any, y: Any, z: Any) -> Any:
    return x**2 * y**2 + y**2 * z**2 + z**2 * x**2 + x * y * z


def heart(x: Any, y: Any, z: Any) -> Any:
    return (x**2 + 2.25 * z**2 + y**2 - 1) ** 3 - x**2 * y**3 - 0.1125 * z**2 * y**3


def lidinoid(x: Any, y: Any, z: Any) -> Any:
    s, c = (rm.sin, rm.cos) if isinstance(x, Expr) else (np.sin, np.cos)
    turns = s(2 * x) * c(y) * s(z) + s(2 * y) * c(z) * s(x) + s(2 * z) * c(x) * s(y)
    return 0.5 * turns - 0.5 * (c(2 * x) * c(2 * y) + c(2 * y) * c(2 * z) + c(2 * z) * c(2 * x)) + 0.15


@dataclass(frozen=True)
class Surface:
    """A surface by its function of three numbers, in the cube from -bounds to bounds."""

    of: Callable[[Any, Any, Any], Any]
    bounds: float

    def expression(self, p: Any) -> Any:
        return self.of(*p)

    def function(self, xyz: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values at points, (3, ...)."""
        return self.of(*xyz)

    def node(self) -> rm.Node:
        return rm.implicit(self.expression, self.bounds)


SURFACES = {
    "klein": Surface(klein, 4.0),
    "tangle": Surface(tangle, 2.6),
    "one_sheet": Surface(one_sheet, 1.0),
    "two_sheets": Surface(two_sheets, 1.0),
    "clebsch": Surface(clebsch, 1.5),
    "cayley": Surface(cayley, 1.0),
    "kummer": Surface(kummer, 2.0),
    "barth": Surface(barth, 1.6),
    "chmutov": Surface(chmutov, 1.05),
    "roman": Surface(roman, 0.6),
    "heart": Surface(heart, 1.5),
    "lidinoid": Surface(lidinoid, 6.0),
}
