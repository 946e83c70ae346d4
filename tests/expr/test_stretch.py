"""The reading along a stretch: what it encloses, and how far a function keeps its sign."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import raymarch as rm
import raymarch.expr.vocabulary as v
from raymarch.expr import loop
from raymarch.expr.arrays import evaluator
from raymarch.expr.function import Function, function, trace
from raymarch.expr.node import Expr, const, var
from raymarch.expr.stretch import Unbounded, free_along, series_of
from raymarch.expr.types import FLOAT, VEC3
from tests.support.surfaces import SURFACES

P, D, LEVEL, W = var("p", VEC3), var("d", VEC3), var("level", FLOAT), var("w", FLOAT)


@function(p=VEC3)
def bump(p: Expr) -> Expr:
    return v.exp(-v.dot(p, p))


def folded(p: Expr) -> Any:
    (q,) = loop(4, [p], lambda i, q: [abs(q) * 1.3 - 0.4 - 0.1 * i])
    return v.length(q) - 0.2


def halved(p: Expr) -> Any:
    x, _ = loop(5, [p.x, p.y], lambda i, x, y: [x * x - y, y + 0.2 * x], until=lambda i, x, y: x * x > 4.0)
    return x + p.z


TURN = np.array([[0.6, -0.8, 0.0], [0.8, 0.6, 0.0], [0.0, 0.0, 1.0]])

FUNCTIONS: dict[str, Callable[[Expr], Any]] = {
    **{name: surface.expression for name, surface in SURFACES.items()},
    "torus": lambda p: v.length(v.vec2(v.length(p.xz) - 1.0, p.y)) - 0.3,
    "powers": lambda p: abs(p.x) ** 2.5 + abs(p.y) ** 1.5 + p.z**3 - 0.5,
    "quotient": lambda p: p.x / (1.0 + v.dot(p, p)) + p.y / (p.z + 0.3),
    "waves": lambda p: v.sin(3.0 * p.x * p.y) + v.cos(v.exp(0.5 * p.z)) - v.tan(0.4 * p.x),
    "hyperbolic": lambda p: v.tanh(2.0 * p.x) + 0.2 * v.cosh(p.y) - v.sinh(0.5 * p.z) + v.atan(p.x * p.z),
    "logarithms": lambda p: v.log(0.5 + v.dot(p, p)) + v.log2(1.5 + p.x * p.x) - v.exp2(p.y),
    "kinks": lambda p: v.max(abs(p.x) - 0.6, v.min(p.y * p.y - 0.3, abs(p.z - p.x))),
    "clamped": lambda p: v.clamp(p.x * p.y, -0.3, 0.4) + v.mix(p.x, p.y, p.z) + v.smoothstep(-0.5, 0.5, p.z),
    "cells": lambda p: v.fract(p.x) - v.mod(p.y, 0.7) + 0.1 * v.floor(p.z * 2.0) + v.sign(p.x + p.y) * 0.2,
    "chosen": lambda p: v.where((p.x < p.y) & ~(p.z > 0.3), p.x * p.x - 0.2, v.where(p.y <= 0.0, p.z, 0.4 - p.x)),
    "steps": lambda p: v.step(p.x, p.y) + v.ceil(p.z) * v.round(p.x) - 0.5,
    "vectors": lambda p: v.dot(v.normalize(p + 0.1), v.cross(p, v.vec3(1.0, p.x, 2.0))) + (const(TURN) @ p).x,
    "turned": lambda p: v.length((p * v.transpose(const(TURN))).zx) - abs((p - 1.0).y),
    "called": lambda p: bump(2.0 * p - 0.3) + bump(p.zy.x * p) - 0.4,
    "root": lambda p: v.sqrt(abs(p.x * p.y) + 0.01) - v.sqrt(v.max(p.z, 0.0)),
    "noise": lambda p: 0.4 * rm.value_noise(p) + p.y,
    "terrain": lambda p: p.y - rm.fbm(2.0 * p.xz, 4, noise="value"),
    "ridges": lambda p: p.y - 0.5 * rm.ridged(p, 3) + 0.2 * rm.turbulence(p * p.x, 2),
    "cellular": lambda p: rm.worley(2.0 * p) - 0.3 + 0.2 * rm.worley(p * p, "F2-F1"),
    "noise at a time": lambda p: p.x + 0.5 * rm.gradient_noise(v.vec4(p, 0.3), period=4),
    "loop": folded,
    "loop that ends": halved,
}
"""Every operation that the reading knows, alone and composed."""

FORMS = {"slope": {"exact": False, "smooth": False}, "curve": {"exact": False}, "exact": {}}
RAYS, PLACES = 600, 40


def traced(name: str) -> Function:
    return trace(name.replace(" ", "_"), FUNCTIONS[name], [("p", VEC3)], test_it_encloses_the_function.__code__)


def rays(name: str) -> tuple[Any, ...]:
    """Points, directions of unequal length, and stretches of all sizes."""
    random = np.random.default_rng(8)
    size = SURFACES[name].bounds if name in SURFACES else 1.5
    points = random.uniform(-size, size, (RAYS, 3))
    directions = random.normal(size=(RAYS, 3)) * random.choice([0.4, 1.0], (RAYS, 1))
    directions[::7, 1] = 0.0
    directions[::11, :2] = 0.0
    return points, directions, size * 10.0 ** random.uniform(-3, 0, RAYS)


@pytest.mark.parametrize("form", [pytest.param(f, marks=pytest.mark.long) if f == "curve" else f for f in FORMS])
@pytest.mark.parametrize("name", FUNCTIONS)
def test_it_encloses_the_function(name: str, form: str) -> None:
    definition, (points, directions, w) = traced(name), rays(name)
    reading, found = series_of(definition, P, D, W, **FORMS[form])
    value, slope, curve = reading.reduced(found), reading.change(found), reading.tail(found, 2)
    parts = [found.c[0], found.rate, *found.jump, *found.slope, *curve, *reading.range(found), *slope]
    numbers = evaluator([value.c[0], *parts], [P, D, W])(points, directions, w)
    at, rate, j0, j1, s0, s1, c0, c1, low, high, *_ = [np.broadcast_to(n, RAYS)[:, None] for n in numbers[1:]]
    s = w[:, None] * np.linspace(0.0, 1.0, PLACES)
    places = points[:, None] + s[..., None] * directions[:, None]
    actual = evaluator([definition.body], definition.params)(places.reshape(-1, 3))[0].reshape(s.shape)
    noise = 1e-9 * (1.0 + np.abs(actual) + np.abs(s * rate) + np.abs(s * s * c0))
    assert np.all(actual >= at + j0 + (rate + s0) * s + c0 * s * s - noise)
    assert np.all(actual <= at + j1 + (rate + s1) * s + c1 * s * s + noise)
    assert np.all((actual >= low - noise) & (actual <= high + noise))


@pytest.mark.parametrize("name", FUNCTIONS)
def test_the_sign_is_kept_on_the_free_stretch_and_most_of_it_is_found(name: str) -> None:
    definition, (points, directions, w) = traced(name), rays(name)
    of = evaluator([definition.body], definition.params)
    level = np.quantile(of(points)[0], 0.3) + 0.0123  # not on a plateau
    (both,) = evaluator([free_along(definition, P, D, LEVEL, W)], [P, D, LEVEL, W])(points, directions, level, w)
    value, free = both[:, 0], both[:, 1]
    assert np.all((free >= 0.0) & (free <= w))
    s = free[:, None] * np.linspace(0.0, 1.0 - 1e-7, PLACES)
    places = points[:, None] + s[..., None] * directions[:, None]
    values = of(places.reshape(-1, 3))[0].reshape(s.shape) - level
    noise = 1e-7 * np.abs(value)[:, None]
    assert np.all(values * np.sign(value)[:, None] >= -noise)
    short = w < 3e-3 * (SURFACES[name].bounds if name in SURFACES else 1.5)
    assert np.mean(free[short] > 0.9 * w[short]) > 0.9  # few short stretches meet the level


def test_exact_polynomials_have_no_range_and_others_converge() -> None:
    """All coefficients of a quartic are known: the curvature at w = 0 is that of the function, of others as w falls."""
    definition = traced("tangle")
    _, found = series_of(definition, P, D, W)
    assert found.exact
    assert len(found.c) == 5
    for name in ("waves", "torus", "hyperbolic"):
        reading, found = series_of(traced(name), P, D, W)
        low, high = evaluator(list(reading.tail(found, 2)), [P, D, W])(*rays(name)[:2], np.full(RAYS, 1e-6))
        assert np.quantile(high - low, 0.95) < 1e-3 * (1.0 + np.median(np.abs(high)))


def test_operations_without_a_rule_are_said_to_be_unbounded() -> None:
    def angle(p: Expr) -> Any:
        return v.atan2(p.x, p.y)

    with pytest.raises(Unbounded, match="atan2"):
        series_of(trace("angle", angle, [("p", VEC3)]), P, D, W)
