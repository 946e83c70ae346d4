"""Surfaces displaced by a function of the point: noise, or one of the user's own.

With a g-Lipschitz displacement n of at most A, the field f + n is (1 + g)-Lipschitz. Divided by 1 + g, it would be
marched slowly everywhere. Far from the surface f - A is a better bound and 1-Lipschitz, so the larger of both is taken.
The surface stays the same: where f + n is 0 or less, f is at most A.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Annotated, Any

import numpy as np

from raymarch.expr.function import Function, Vec3Expr, function, sum_of
from raymarch.expr.hashing import hash
from raymarch.expr.lattice import (
    lattice_noise,
)
from raymarch.expr.node import Expr, Operand, expr
from raymarch.expr.octaves import fbm, gradient_noise, ridged, turbulence, value_noise, worley
from raymarch.expr.types import FLOAT
from raymarch.expr.vocabulary import clamp, max, sin
from raymarch.sdf.definition import Child, operator
from raymarch.sdf.domain import Domain, NonNegative, Scalar
from raymarch.sdf.limits import held, limits, refuse_jumps, traced
from raymarch.sdf.node import Node, method, solid
from raymarch.sdf.values import with_bound

__all__ = ["fbm", "gradient_noise", "hash", "ridged", "turbulence", "value_noise", "worley"]

Frequency = Annotated[Any, Domain(FLOAT, low=0.0, open=True, unit="1/length")]
Octaves = Annotated[int, Domain(None, low=1, high=16, unit="count")]
OfPoint = Annotated[Any, Domain(None, holds=Function)]


def _displaced(distance: Expr, displacement: Expr, amplitude: Scalar, slope: Scalar) -> Expr:
    value = distance + displacement
    return with_bound(value, max(value / (1.0 + slope), distance - amplitude))


def _noise_slope(amplitude: Scalar, frequency: Scalar, octaves: int) -> Expr:
    return expr(amplitude) * frequency * (math.pi * _share(octaves) * octaves)


OFFSET = (17.31, 5.77, 29.53)
"""Offset between octaves, so that their lattices have no point in common."""


def _share(octaves: int) -> float:
    """Amplitude of the first octave if each is half the previous one and all sum to 1."""
    return 1.0 / (2.0 - 2.0 ** (1 - octaves))


@operator(
    bounds=lambda child, amplitude: child.grown(amplitude),
    lipschitz=lambda child, amplitude, frequency, octaves: (
        child.lipschitz + _noise_slope(amplitude, frequency, octaves)
    ),
    spread="keep",
    called="displace_by_noise",
)
def noisy(
    p: Expr, child: Child, amplitude: NonNegative = 0.1, frequency: Frequency = 3.0, octaves: Octaves = 2
) -> Expr:
    """Displace along the normals by noise."""
    first = _share(octaves)
    layers = [
        first * 0.5**i * lattice_noise(frequency * 2.0**i * p + tuple(i * o for o in OFFSET)) for i in range(octaves)
    ]
    return _displaced(child(p), amplitude * sum_of(layers), amplitude, _noise_slope(amplitude, frequency, octaves))


@method
def displace_by_noise(node: Node, amplitude: Scalar = 0.1, frequency: Scalar = 3.0, octaves: int = 2) -> Node:
    """Displace along the normals by fractal noise. The noise is the same on every machine.

    Parameters
    ----------
    amplitude : largest displacement of the surface, a length >= 0.
    frequency : bumps per unit of length, > 0.
    octaves : number of layers, 1 to 16. Each has half the height and twice the frequency of the previous one.

    Returns
    -------
    Node

    Raises
    ------
    SceneError : arguments of another kind or outside their range.

    Notes
    -----
    A bound: near the surface divided by 1 + pi amplitude frequency (times octaves / (2 - 2^(1 - octaves)) for more than
    one layer), farther away not divided.
    """
    return noisy(node, amplitude, frequency, octaves)


@function()
def ripples(p: Vec3Expr) -> Expr:
    """The example: up to 0.05, with the Lipschitz constant 0.3 sqrt(2)."""
    return 0.025 * (sin(12.0 * p.x) + sin(12.0 * p.z))


@operator(
    bounds=lambda child, amplitude: child.grown(amplitude),
    lipschitz=lambda child, slope: child.lipschitz + slope,
    spread="keep",
    called="displace_by",
)
def displaced(
    p: Expr,
    child: Child,
    function: OfPoint = ripples,
    amplitude: NonNegative = 0.05,
    slope: Annotated[Any, Domain(FLOAT, low=0.0)] = 0.425,
) -> Expr:
    """Displace along the normals by a function of the point."""
    return _displaced(child(p), clamp(function(p), -amplitude, amplitude), amplitude, slope)


@method
def displace_by(
    node: Node, function: Callable[[Expr], Operand], amplitude: Scalar | None = None, lipschitz: Scalar | None = None
) -> Node:
    """Displace along the normals by a function of the point.

    Parameters
    ----------
    function : function from a point, a vec3 expression, to a number, of functions in `raymarch.expr.vocabulary`. It is
        added to the distance, so positive values move the surface inwards.
    amplitude : largest absolute value of the function, a length >= 0. Larger values are clamped. None derives it.
    lipschitz : Lipschitz constant of the function, >= 0. None derives it from the gradient of the function. A number is
        not checked; one that is too small makes holes.

    Returns
    -------
    Node

    Raises
    ------
    SceneError : arguments of another kind or outside their range.

    Notes
    -----
    A bound: near the surface divided by 1 + lipschitz, farther away not divided. Derived values hold over all space if
    possible (sines). Else they hold over the solid's box grown by the displacement, which needs a bounded solid. A
    function with steps (floor, mod, where) needs `lipschitz` as a number; `rm.value_noise` and `rm.noise` do not.
    """
    solid("displace_by", node)
    made = traced("displace_by", function, FLOAT)
    if amplitude is None or lipschitz is None:
        made, amplitude, lipschitz = _measured(node, made, amplitude, lipschitz)
    return displaced(node, made, amplitude, lipschitz)


def _measured(
    node: Node, function: Function, amplitude: Scalar | None, lipschitz: Scalar | None
) -> tuple[Function, Scalar, Scalar]:
    """The function with its amplitude and slope. If they hold only in a box, the function is constant outside of it."""
    if lipschitz is None:
        legal = "lipschitz = the most by which it changes a unit of length; that of rm.value_noise(p) is known"
        refuse_jumps("displace_by", function, legal)

    def over(lower: Any, upper: Any) -> tuple[Any, Any]:
        values, slopes = map(np.abs, limits(function, lower, upper))
        size, slope = float(values.max()), float(np.linalg.norm(slopes.max(axis=-1), axis=-1).max())
        return size if amplitude is None else amplitude, slope if lipschitz is None else lipschitz

    return held("displace_by", node, function, over, node.facts.undivided_spread)
