"""Fractals: a point is folded repeatedly, in a loop of the expression language with a bail-out.

Menger's sponge and Sierpinski's pyramid are sums of exact pieces, and bounds. The others estimate the distance from the
growth of the iteration. Nothing is proven of them, so they are marched with "plain" (`Quality(step_scale=...)` helps).
"""

from __future__ import annotations

import math

from raymarch.expr.function import loop
from raymarch.expr.node import Expr
from raymarch.expr.vocabulary import abs as absolute
from raymarch.expr.vocabulary import (
    acos,
    atan2,
    clamp,
    cos,
    dot,
    exp2,
    fract,
    length,
    log,
    max,
    min,
    mod,
    pow,
    sin,
    sqrt,
    vec3,
    vec4,
    where,
)
from raymarch.sdf.definition import EVERYWHERE, cube, shape
from raymarch.sdf.domain import Count, Factor, Number, Positive, Power, Vec4

__all__ = ["apollonian", "julia", "mandelbox", "mandelbulb", "menger", "sierpinski"]

TINY = 1e-20


@shape(exactness="bound", bounds=lambda size: cube(0.5 * size), symmetry="xyz", spread=math.sqrt(3.0))
def menger(p: Expr, size: Positive = 2.0, iterations: Count = 3) -> Expr:
    """Menger's sponge: a cube with square bars taken out, at ever smaller scales (Menger 1926).

    size : edge of the cube, > 0. iterations : how often bars are taken out, >= 1. A bound: a cell of half-width h
    that a point has in cell coordinates u, in [-1, 1], has bars max(|ui|, |uj|) < 1/3.
    """
    q = p / (0.5 * size)
    sides = absolute(q)
    outer = max(sides.x, max(sides.y, sides.z)) - 1.0

    def step(i: Expr, distance: Expr, scale: Expr) -> tuple[Expr, Expr]:
        u = absolute(mod(q * scale + 1.0, 2.0) - 1.0)
        bars = min(max(u.x, u.y), min(max(u.y, u.z), max(u.z, u.x)))
        return max(distance, (1.0 / 3.0 - bars) / scale), scale * 3.0

    distance, _ = loop(iterations, (outer, 1.0), step)
    return 0.5 * size * distance


@shape(exactness="bound", bounds=lambda size: cube(0.5 * size), spread=math.sqrt(3.0))
def sierpinski(p: Expr, size: Positive = 2.0, iterations: Count = 5) -> Expr:
    """Sierpinski's pyramid: a regular tetrahedron of four half as large, and so on.

    size : edge of the cube on whose corners the tetrahedron stands, > 0. iterations : >= 1. A bound: reflections bring
    the nearest quarter to one corner, and a tetrahedron is no farther than the farthest of its faces.
    """
    q = p / (0.5 * size)

    def step(i: Expr, z: Expr, scale: Expr) -> tuple[Expr, Expr]:
        z = where(z.x + z.y < 0.0, vec3(-z.y, -z.x, z.z), z)
        z = where(z.x + z.z < 0.0, vec3(-z.z, z.y, -z.x), z)
        z = where(z.y + z.z < 0.0, vec3(z.x, -z.z, -z.y), z)
        return 2.0 * z - 1.0, scale * 2.0

    z, scale = loop(iterations, (q, 1.0), step)
    x, y, w = z.x, z.y, z.z
    faces = max(max(-x - y - w, y + w - x), max(x + w - y, x + y - w))
    return 0.5 * size * ((faces - 1.0) * (1.0 / math.sqrt(3.0)) / scale)


def _escaped(i: Expr, z: Expr, growth: Expr) -> Expr:
    return dot(z, z) > 16.0


def _potential(z: Expr, growth: Expr) -> Expr:
    """The distance by the potential of the set: that of an orbit that has escaped."""
    r = length(z)
    return 0.5 * log(max(r, TINY)) * r / growth


@shape(exactness="estimate", bounds=lambda power: cube(exp2(1.0 / (power - 1.0))))
def mandelbulb(p: Expr, power: Power = 8.0, iterations: Count = 5) -> Expr:
    """The Mandelbulb: z -> z^power + p in spherical coordinates (White and Nylander 2009).

    power : >= 2; 8 is the usual one. iterations : >= 1. An estimate: log(r) r / (2 |dz|), dz being the growth.
    Within 2^(1 / (power - 1)) of the origin: where |p| is larger, |z^power + p| >= |z| (|z|^(power - 1) - 1) >= |z|.
    """

    def step(i: Expr, z: Expr, growth: Expr) -> tuple[Expr, Expr]:
        r = length(z)
        theta = power * acos(z.y / max(r, TINY))
        phi = power * atan2(z.z, z.x)
        turned = vec3(sin(theta) * cos(phi), cos(theta), sin(theta) * sin(phi))
        return pow(r, power) * turned + p, power * pow(r, power - 1.0) * growth + 1.0

    z, growth = loop(iterations, (p, 1.0), step, until=_escaped)
    return _potential(z, growth)


@shape(exactness="estimate", bounds=lambda c: cube(0.5 + sqrt(0.25 + length(c))))
def julia(p: Expr, c: Vec4 = (-0.2, 0.6, 0.2, 0.2), iterations: Count = 11) -> Expr:
    """A slice of a quaternion Julia set: z -> z^2 + c (Norton 1982).

    c : quaternion, real part first, no longer than 2. iterations : >= 1. An estimate: log(|z|) |z| / (2 |z'|).
    Within R = 1/2 + sqrt(1/4 + |c|) of the origin: where |z| >= R, |z^2 + c| >= R^2 - |c| = R.
    """

    def step(i: Expr, z: Expr, growth: Expr) -> tuple[Expr, Expr]:
        real = z.x * z.x - z.y * z.y - z.z * z.z - z.w * z.w
        turned = vec4(real, 2.0 * z.x * z.y, 2.0 * z.x * z.z, 2.0 * z.x * z.w) + c
        return turned, 2.0 * length(z) * growth

    z, growth = loop(iterations, (vec4(p, 0.0), 1.0), step, until=_escaped)
    return _potential(z, max(growth, TINY))


@shape(exactness="estimate", bounds=lambda: cube(6.0), symmetry="xyz")
def mandelbox(p: Expr, scale: Number = 2.0, iterations: Count = 8) -> Expr:
    """The Mandelbox: fold into a box, fold into a ball, scale by a factor, add p (Lowe 2010).

    scale : the factor, from 2 to 3, or about -1.5. iterations : >= 1. An estimate: |z| over the growth.
    """

    def step(i: Expr, z: Expr, growth: Expr) -> tuple[Expr, Expr]:
        z = 2.0 * clamp(z, -1.0, 1.0) - z
        turn = max(1.0 / max(dot(z, z), 0.25), 1.0)
        return scale * turn * z + p, absolute(scale) * turn * growth + 1.0

    z, growth = loop(iterations, (p, 1.0), step, until=lambda i, z, growth: dot(z, z) > 100.0)
    return length(z) / growth


@shape(exactness="estimate", bounds=lambda: EVERYWHERE)
def apollonian(p: Expr, scale: Factor = 1.2, iterations: Count = 6) -> Expr:
    """An unbounded Apollonian gasket: fold into a cell of edge 2, invert in a sphere, and repeat.

    scale : 1 to 1.5, the radius of the sphere squared. iterations : >= 1. An estimate.
    """

    def step(i: Expr, z: Expr, growth: Expr) -> tuple[Expr, Expr]:
        z = 2.0 * fract(0.5 * z + 0.5) - 1.0
        turn = scale / max(dot(z, z), 1e-5)  # six turns at the middle of a cell stay far below what float32 holds
        return turn * z, turn * growth

    z, growth = loop(iterations, (p, 1.0), step)
    return 0.25 * absolute(z.y) / growth
