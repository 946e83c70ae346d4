"""BSDFs at single directions about the normal z: in float64, and on the device."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from raymarch.expr.arrays import evaluator
from raymarch.expr.function import Function
from raymarch.expr.node import const, expr, var
from raymarch.expr.types import VEC3
from raymarch.expr.vocabulary import dot, get, where
from raymarch.gpu.context import Context
from raymarch.scene.bsdf import BSDF, Microfacets
from raymarch.scene.reflectance import RANDOM, Random
from raymarch.truth.bsdf import Reflection
from tests.support.glsl_harness import evaluate

Z = const((0.0, 0.0, 1.0))
VIEW, LIGHT = var("view", VEC3), var("direction", VEC3)


def microfacets(
    normal: Any,
    view: Any,
    light: Any,
    color: Any,
    metalness: Any,
    roughness: Any,
    f0: Any,
    masking: str,
    several: bool = True,
) -> NDArray[np.float64]:
    """`Microfacets.eval` in float64, (N, 3); numbers and directions broadcast."""
    shape = np.broadcast_shapes(*(np.shape(x) for x in (normal, view, light)))
    wide = [np.broadcast_to(np.asarray(x, np.float64), shape) for x in (normal, view, light, color, f0)]
    one = [np.broadcast_to(np.asarray(x, np.float64), (len(wide[0]), 3))[:, :1] for x in (metalness, roughness)]
    values = {"color": wide[3], "metalness": one[0], "roughness": one[1], "f0": wide[4]}
    return Reflection(Microfacets(masking, several), values, *wide[:2]).eval(wide[2])[0]


def material(**values: ArrayLike) -> dict[str, Any]:
    """Material values as constants, f0 = 0.04 unless given."""
    return {name: expr(value) for name, value in {"f0": (0.04, 0.04, 0.04), **values}.items()}  # type: ignore[arg-type]


def prepared(bsdf: BSDF, values: Mapping[str, Any]) -> dict[str, Any]:
    return {**values, **bsdf.prepare(values, Z, VIEW)}


def evaluated(
    egl: Context | None, bsdf: BSDF, values: Mapping[str, Any], lights: ArrayLike, views: ArrayLike
) -> NDArray[Any]:
    """`eval`, 0 below the surface, (N, 3): on the device, or in float64 without one."""
    value = bsdf.eval(prepared(bsdf, values), Z, VIEW, LIGHT)
    made = Function("reflected", (LIGHT, VIEW), where(dot(Z, LIGHT) <= 0.0, 0.0, value))
    if egl is not None:
        return evaluate(egl, made, [lights, views])
    return np.asarray(evaluator([made.body], made.params)(lights, views)[0])


def density(bsdf: BSDF, values: Mapping[str, Any], lights: ArrayLike, view: ArrayLike) -> NDArray[np.float64]:
    """`pdf` in float64, (N,)."""
    found = evaluator([bsdf.pdf(values, Z, VIEW, LIGHT)], [LIGHT, VIEW])
    return np.asarray(
        np.broadcast_to(found(lights, np.broadcast_to(view, np.shape(lights)))[0], len(np.asarray(lights)))
    )


def sampled(
    egl: Context | None, bsdf: BSDF, values: Mapping[str, Any], views: ArrayLike, u: Mapping[str, ArrayLike]
) -> tuple[NDArray[Any], NDArray[Any]]:
    """Directions and weights of `sample`, (N, 3) each; `u` holds random numbers by the names of `Random`."""
    found = bsdf.sample(
        values, Z, VIEW, Random(*(p if n in u else expr(0.0) for n, p in zip(Random._fields, RANDOM, strict=True)))
    )
    params = (VIEW, *(p for n, p in zip(Random._fields, RANDOM, strict=True) if n in u))
    given = [views, *(u[n] for n in Random._fields if n in u)]
    parts = [get(found, name) for name in ("direction", "weight")]
    if egl is None:
        n = len(np.asarray(views))
        return tuple(np.broadcast_to(x, (n, 3)) for x in evaluator(parts, params)(*given))  # type: ignore[return-value]
    made = (evaluate(egl, Function("sampled", params, part), given) for part in parts)
    return tuple(made)  # type: ignore[return-value]


def even(n: int, *names: str) -> dict[str, NDArray[np.float64]]:
    """Points that fill a cube evenly, as random numbers by name; "direction" takes two."""
    steps = (0.8191725134, 0.6710436067, 0.5497004779, 0.4503599627, 0.3688925)
    drawn = (np.arange(n)[:, None] * steps + 0.5) % 1.0
    drawn = np.minimum(drawn, 1 - 2.0**-24)
    found, at = {}, 0
    for name in names:
        size = 2 if name == "direction" else 1
        found[name] = drawn[:, at : at + size] if size == 2 else drawn[:, at]
        at += size
    return found
