"""Noise of a point, and sums of its octaves, for users: see `raymarch.expr.lattice`."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np

from raymarch.errors import SceneError
from raymarch.expr import vocabulary as v
from raymarch.expr.arrays import evaluator
from raymarch.expr.calls import checked
from raymarch.expr.convert import choice, integer, real
from raymarch.expr.function import Function, sum_of
from raymarch.expr.hashing import pcg
from raymarch.expr.lattice import (
    FEATURES,
    WORLEY,
    gradient_lattice,
    gradient_lattice_in_time,
    lattice_noise,
    lattice_noise_in_time,
)
from raymarch.expr.node import Expr, Operand, const, expr, var
from raymarch.expr.types import VEC2, VEC3, VECTORS, vector

F = TypeVar("F", bound=Callable[..., Expr])

KINDS = {
    "value": (lattice_noise, lattice_noise_in_time),
    "gradient": (gradient_lattice, gradient_lattice_in_time),
}
"""The function of a point, and that of a point and time."""

REACH = 256.0
"""Offsets of seeds and octaves are below this: float32 keeps 15 bits behind the point there."""


def _point(name: str, p: Operand) -> tuple[Expr, Expr | None]:
    """A point of three coordinates, and the fourth if there is one."""
    q = expr(p)
    if q.type is VEC2:
        return v.vec3(q, 0.0), None
    if q.type is VEC3:
        return q, None
    if q.type is VECTORS[4]:
        return q.xyz, q.w
    raise SceneError(f"{name}({q.type})", legal="a point, a vec3 or a vec2, or a vec4 with time as the fourth")


def _moved(q: Expr, seed: int, octave: int = 0) -> Expr:
    """The point moved by a random offset, so that lattices of octaves and seeds have no point in common."""
    if seed == 0 and octave == 0:
        return q
    words = pcg(
        pcg(np.array([seed], np.int64).astype(np.uint32)) + np.arange(3 * octave, 3 * octave + 3, dtype=np.uint32)
    )
    return q + const(np.round(words / 2.0**32 * REACH, 3))


def _noise(
    name: str, pair: tuple[Function, Function], p: Operand, seed: Any, period: Any, octave: int = 0, factor: float = 1.0
) -> Expr:
    if isinstance(p, np.ndarray) and p.ndim == 2 and p.shape[1] in (2, 3, 4):
        at = var("p", vector(p.shape[1]))
        found = evaluator([_noise(name, pair, at, seed, period, octave, factor)], [at])(np.asarray(p, np.float64))
        return np.asarray(found[0])  # type: ignore[return-value]  # as NumPy's functions: an array of an array
    q, w = _point(name, p)
    number = integer(f"{name}: seed", seed, -(2**31), 2**31 - 1)
    turns = integer(f"{name}: period", period, 0, 65535)
    moved = _moved(q * factor if factor != 1.0 else q, number, octave)
    if w is None:
        return pair[0](moved)
    length = float(np.round(turns * factor))
    return pair[1](moved, w * (length / turns if turns else factor) if factor != 1.0 else w, length)


@checked
def value_noise(p: Operand, seed: int = 0, period: int = 0) -> Expr:
    """Smooth noise of a point, from -1 to 1: random values at the points with integer coordinates, and between them.

    Parameters
    ----------
    p : a vec3, a vec2 for the plane z = 0, or a vec4 with time as the fourth coordinate. `value_noise(p * 4)` has
        features a quarter as wide. An array (N, 2) to (N, 4) of NumPy gives an array (N,), in float64.
    seed : an integer; each gives other noise.
    period : the noise of a vec4 repeats in the fourth coordinate after so many units; 0 for never.

    Returns
    -------
    Expr

    Raises
    ------
    SceneError : arguments of another kind or outside their range.

    Notes
    -----
    No slope exceeds pi, so `node.displace_by` derives its step length from noise too.
    """
    return _noise("value_noise", KINDS["value"], p, seed, period)


@checked
def gradient_noise(p: Operand, seed: int = 0, period: int = 0) -> Expr:
    """Gradient noise of a point, from -1 to 1 (Perlin 1985, with the weights of Perlin 2002): 0 at each lattice point,
    with a random slope there. More even than `value_noise`. No slope exceeds 3.225.

    Parameters
    ----------
    p, seed, period : as of `value_noise`.

    Returns
    -------
    Expr

    Raises
    ------
    SceneError : arguments of another kind or outside their range.
    """
    return _noise("gradient_noise", KINDS["gradient"], p, seed, period)


@checked
def worley(p: Operand, feature: str = "F1", seed: int = 0, period: int = 1) -> Expr:
    """Cellular noise, from 0 to 1: the distance to the nearest of random points, one in each cell (Worley 1996).

    Parameters
    ----------
    p : a vec3, a vec2 for the plane z = 0, or a vec4 with time as the fourth coordinate, in which the points move.
    feature : "F1": the distance to the nearest point; "F2": to the second nearest; "F2-F1": 0 on the walls between
        cells. Points at a distance of 1 or more do not count: the largest value is 1.
    seed : an integer.
    period : the points of a vec4 are back after so many units of the fourth coordinate, >= 1.

    Returns
    -------
    Expr

    Raises
    ------
    SceneError : arguments of another kind or outside their range.

    Notes
    -----
    No slope exceeds 1, that of "F2-F1" 2.
    """
    kind = choice("worley: feature", feature, tuple(FEATURES), "'F1', 'F2' or 'F2-F1'")
    turns = integer("worley: period", period, 1, 65535)
    return _noise("worley", (WORLEY[kind, False], WORLEY[kind, True]), p, seed, turns)


def _octaves(
    name: str,
    shape: Callable[[Expr], Expr],
    p: Operand,
    octaves: Any,
    gain: Any,
    lacunarity: Any,
    seed: Any,
    noise: Any,
    period: Any,
) -> Expr:
    """The mean of octaves, weighted by their amplitudes."""
    count = integer(f"{name}: octaves", octaves, 1, 16)
    share = real(f"{name}: gain", gain, 0.0, 1.0, "a number from 0 to 1")
    growth = real(f"{name}: lacunarity", lacunarity, 1.0, 8.0, "a number from 1 to 8")
    pair = KINDS[choice(f"{name}: noise", noise, tuple(KINDS), "'value' or 'gradient'")]
    weights = [share**i for i in range(count)]
    whole = math.fsum(weights)
    return sum_of(
        [
            (weight / whole) * shape(_noise(name, pair, p, seed, period, i, growth**i))
            for i, weight in enumerate(weights)
            if weight > 0.0
        ]
    )


@checked
def fbm(
    p: Operand,
    octaves: int = 5,
    gain: float = 0.5,
    lacunarity: float = 2.0,
    seed: int = 0,
    noise: str = "gradient",
    period: int = 0,
) -> Expr:
    """Fractional Brownian motion, from -1 to 1: the weighted mean of octaves of noise (Musgrave 1998, "fBm").

    Parameters
    ----------
    p : a vec3, a vec2 for the plane z = 0, or a vec4 with time as the fourth coordinate.
    octaves : number of layers, 1 to 16.
    gain : amplitude of a layer, of that of the one before, 0 to 1.
    lacunarity : frequency of a layer, of that of the one before, 1 to 8.
    seed : an integer; each gives other noise.
    noise : "gradient" or "value".
    period : the noise of a vec4 repeats in the fourth coordinate after so many units; 0 for never.

    Returns
    -------
    Expr

    Raises
    ------
    SceneError : arguments of another kind or outside their range.
    """
    return _octaves("fbm", lambda n: n, p, octaves, gain, lacunarity, seed, noise, period)


def _as_fbm(like: F, name: str, shape: Callable[[Expr], Expr], doc: str) -> F:
    """A function with the parameters of `fbm`, of reshaped octaves."""
    signature = inspect.signature(like)

    def made(*args: Any, **kwargs: Any) -> Expr:
        given = signature.bind(*args, **kwargs)
        given.apply_defaults()
        return _octaves(name, shape, *given.args)

    made.__name__ = made.__qualname__ = name
    _, _, returned = (inspect.getdoc(like) or "").partition("\n\nReturns\n")
    entries = f"Parameters\n----------\n{', '.join(signature.parameters)} : as of `fbm`."
    made.__doc__ = f"{doc}\n\n{entries}\n\nReturns\n{returned}"
    made.__signature__ = signature  # type: ignore[attr-defined]
    return checked(made)  # type: ignore[return-value]


turbulence = _as_fbm(
    fbm,
    "turbulence",
    abs,
    "Turbulence, from 0 to 1: the weighted mean of the absolute values of octaves (Perlin 1985), with creases at 0.",
)
ridged = _as_fbm(
    fbm,
    "ridged",
    lambda n: v.square(1.0 - abs(n)),
    "Ridges, from 0 to 1: the weighted mean of (1 - |n|)^2 of octaves n (Musgrave 1998, offset 1, without feedback).",
)
