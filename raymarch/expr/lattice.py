"""Noise: random values, directions and points on an integer lattice, and smooth functions of a point made of them.

Each function has `Limits`, bounds that hold everywhere and are sharper than what readings derive from its formula,
because they take its corners as independent. They are found by maximizing over the values of the corners (the noise is
linear in them), the place in the cell and the direction.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from raymarch.expr import vocabulary as v
from raymarch.expr.evaluate import Program
from raymarch.expr.function import Function, function, loop
from raymarch.expr.hashing import hash
from raymarch.expr.intervals import INTERVALS, Interval
from raymarch.expr.node import Expr, const, construct
from raymarch.expr.types import FLOAT, VEC3


@dataclass(frozen=True, slots=True)
class Limits:
    """Bounds of a function of a point. steepest, bend : the largest first and second derivative along a unit direction;
    bend is infinite for a function with kinks."""

    low: float
    high: float
    steepest: float
    bend: float = math.inf


def _limited(limits: Limits) -> Callable[[Function], Function]:
    """Decorator: state the limits of a function. Its interval reading, and that of its gradient, keep them."""

    def state(definition: Function) -> Function:
        definition.stated.limits = limits

        def within(*args: Interval) -> tuple[Interval]:
            program = definition.once("range", lambda: Program([definition.body], definition.params, INTERVALS))
            ((low, high),) = program(*args)
            if low is high:
                return ((low, low),)
            return ((np.fmax(low, limits.low), np.fmin(high, limits.high)),)

        ends = np.array([limits.steepest] * 3 + [limits.high])
        gradient = np.array([-limits.steepest] * 3 + [limits.low]), ends
        definition.stated.programs[INTERVALS] = within
        definition.stated.programs_of_gradient[INTERVALS] = lambda *_args: (gradient,)
        if (known := definition.known_gradient()) is not None:
            known.stated.programs.update(definition.stated.programs_of_gradient)
        return definition

    return state


# Values and directions at lattice points


@_limited(Limits(-1.0, 1.0, math.pi, math.pi**2))
@function("value_noise", q=VEC3)
def lattice_noise(q: Expr) -> Expr:
    """Value noise: random values from -1 to 1 at integer lattice points, interpolated by cosines; pi-Lipschitz.

    The constant: with the weights w = (1 - cos(pi t)) / 2 along each axis, the noise is the mean of a function v of the
    eight corners under a product of probabilities w and 1 - w. The coefficients c of v along the axes have a sum of
    squares of at most the mean of v^2, hence at most 1 (Parseval), and the slopes are c w' / sqrt(w (1 - w)) = pi c.
    """
    cell = v.floor(q)
    weight = 0.5 - 0.5 * v.cos(math.pi * (q - cell))
    return 2.0 * _interpolated(weight, lambda *corner: hash(cell + v.vec3(*corner))) - 1.0


@_limited(Limits(-1.0, 1.0, math.pi, math.pi**2))
@function("value_noise_in_time", q=VEC3, w=FLOAT, period=FLOAT)
def lattice_noise_in_time(q: Expr, w: Expr, period: Expr) -> Expr:
    """The same on the lattice of four dimensions, of which the fourth is repeated with a period, if that is above 0."""
    cell, t, time = v.floor(q), v.fract(w), v.floor(w)
    weight = 0.5 - 0.5 * v.cos(math.pi * (q - cell))

    def at(moment: Expr) -> Expr:
        return _interpolated(weight, lambda *corner: _hash(cell + v.vec3(*corner), _repeated(moment, period)))

    return 2.0 * v.mix(at(time), at(time + 1.0), 0.5 - 0.5 * v.cos(math.pi * t)) - 1.0


def _interpolated(weight: Expr, corner: Callable[..., Expr]) -> Expr:
    def along_x(y: float, z: float) -> Expr:
        return v.mix(corner(0.0, y, z), corner(1.0, y, z), weight.x)

    low, high = (v.mix(along_x(0.0, z), along_x(1.0, z), weight.y) for z in (0.0, 1.0))
    return v.mix(low, high, weight.z)


def _repeated(moment: Expr, period: Expr) -> Expr:
    return v.where(period > 0.0, v.mod(moment, v.max(period, 1.0)), moment)


def _hash(cell: Expr, time: Expr) -> Expr:
    """The hash of a cell of four dimensions: that of z and time in place of z."""
    return hash(v.vec3(cell.x, cell.y, 2.0**24 * hash(v.vec3(cell.z, time, 0.0))))


def _direction(number: Expr) -> Expr:
    """A random unit vector, from the bits of a number in [0, 1)."""
    return v.normalize(2.0 * v.vec3(number, v.fract(256.0 * number), v.fract(65536.0 * number)) - 1.0)


def _faded(t: Expr) -> Expr:
    """The quintic of Perlin 2002, with first and second derivatives of 0 at both ends."""
    return t * t * t * (t * (t * 6.0 - 15.0) + 10.0)


SCALE = 2.0 / math.sqrt(3.0)


@_limited(Limits(-1.0, 1.0, 3.225, 12.29))
@function("gradient_noise", q=VEC3)
def gradient_lattice(q: Expr) -> Expr:
    """Gradient noise (Perlin 1985, weights of 2002): random unit slopes at integer lattice points, times 2 /
    sqrt(3), so that it fills -1 to 1. It is 0 at lattice points."""
    cell = v.floor(q)
    t = q - cell

    def corner(*at: float) -> Expr:
        return v.dot(_direction(hash(cell + v.vec3(*at))), t - v.vec3(*at))

    return SCALE * _interpolated(_faded(t), corner)


@_limited(Limits(-1.0, 1.0, 3.225, 12.29))
@function("gradient_noise_in_time", q=VEC3, w=FLOAT, period=FLOAT)
def gradient_lattice_in_time(q: Expr, w: Expr, period: Expr) -> Expr:
    """The same, whose slopes change with the fourth coordinate: a smooth blend of two noises of three dimensions."""
    cell, time = v.floor(q), v.floor(w)
    t = q - cell

    def at(moment: Expr) -> Expr:
        def corner(*place: float) -> Expr:
            number = _hash(cell + v.vec3(*place), _repeated(moment, period))
            return v.dot(_direction(number), t - v.vec3(*place))

        return _interpolated(_faded(t), corner)

    return SCALE * v.mix(at(time), at(time + 1.0), _faded(w - time))


# The distance to random points


def _nearest(q: Expr, time: Expr | None) -> tuple[Expr, Expr]:
    """The ways to the nearest and to the second nearest of the points in the cells around (Worley 1996)."""
    cell = v.floor(q)
    far = const([1.0, 0.0, 0.0])

    def step(i: Expr, first: Expr, second: Expr) -> Sequence[Expr]:
        other = cell + v.vec3(v.mod(i, 3.0), v.mod(v.floor(i / 3.0), 3.0), v.floor(i / 9.0)) - 1.0
        number = hash(other)
        place = v.vec3(number, v.fract(256.0 * number), v.fract(65536.0 * number))
        way = other + (place if time is None else 0.5 + 0.5 * v.sin(math.tau * (place + time))) - q
        a, b, c = v.dot(way, way), v.dot(first, first), v.dot(second, second)
        return [v.where(a < b, way, first), v.where(a < b, first, v.where(a < c, way, second))]

    first, second = loop(27, [far, far], step)
    return first, second


def _length_and_slope(way: Expr) -> tuple[Expr, Expr]:
    """A distance, and its slope: 0 where no point is nearer than 1."""
    distance = v.length(way)
    return distance, v.where(distance < 1.0, -v.normalize(way), v.vec3(0.0))


FEATURES: Mapping[str, tuple[float, float]] = {"F1": (1.0, 0.0), "F2": (0.0, 1.0), "F2-F1": (-1.0, 1.0)}
"""The factors of the distances to the nearest and to the second nearest point."""


def _distances(feature: str, in_time: bool) -> Function:
    """The function of a feature, with its gradient. A point at a distance of 1 or more does not count, so the search
    in the 27 cells around is complete, and the distances are continuous."""
    name = f"worley_{feature.lower().replace('-', '_')}" + "_in_time" * in_time
    types = {"q": VEC3, **({"w": FLOAT, "period": FLOAT} if in_time else {})}
    one, two = FEATURES[feature]

    def both(q: Expr, *w: Expr) -> tuple[Expr, Expr]:
        pairs = [_length_and_slope(way) for way in _nearest(q, w[0] / v.max(w[1], 1e-3) if w else None)]
        (a, slope), (b, other) = pairs
        return one * a + two * b, one * slope + two * other

    # not traced before they are used
    value = function(name, **types)(lambda q, *w: both(q, *w)[0])
    gradient = function(f"{name}_gradient", **types)(lambda q, *w: construct(*both(q, *w)[::-1]))
    gradient.stated.gradient_of = value
    value.stated.gradients[0] = gradient
    return _limited(Limits(0.0, 1.0, 1.0 if feature != "F2-F1" else 2.0))(value)


WORLEY = {(feature, in_time): _distances(feature, in_time) for feature in FEATURES for in_time in (False, True)}
"""By the feature, and whether the points move."""
