"""BSDFs in float64: the expressions of `raymarch.scene.bsdf`, evaluated at N points."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raymarch.expr.arrays import evaluator
from raymarch.expr.function import Function
from raymarch.expr.node import Expr, expr, var
from raymarch.expr.types import FLOAT, VEC2, VEC3, Type
from raymarch.expr.vocabulary import clamp, dot
from raymarch.scene.bsdf import BSDF, pdf_lobes, sample_lobes
from raymarch.scene.material import Material

Array = NDArray[np.float64]

_TYPES: Mapping[str, Type] = {
    **{name: value.type for name, value in Material()._fields.items()},
    **dict.fromkeys(("normal", "view", "light", "mean", "mirrored", "blurred"), VEC3),
    "u": VEC2,
}
"""Types of what the methods of a BSDF read, by name. All others are floats."""


@cache
def _compiled(bsdf: BSDF, method: str, names: tuple[str, ...], lobes: int) -> Callable[..., tuple[Array, ...]]:
    symbols = {name: var(name, _TYPES.get(name, FLOAT)) for name in names}
    values = {name: symbols[name] for name in bsdf.fields}
    normal, view = symbols["normal"], symbols["view"]
    values |= bsdf.prepare(values, normal, view)
    n_dot_v = clamp(dot(normal, view), 0.0, 1.0)
    traced = [symbols[f"traced_{i}"] for i in range(lobes)]
    if method == "eval":
        made: Sequence[Expr | None] = [bsdf.eval(values, normal, view, symbols["light"]), bsdf.ambient(values)]
    elif method == "reflect_sky":
        mean, around, blurred = (symbols[name] for name in ("mean", "mirrored", "blurred"))
        made = [bsdf.reflect_sky(values, n_dot_v, mean, around, blurred, traced)]
    elif method == "sample_lobes":
        made = [sample_lobes(bsdf, values, normal, view, symbols["u"], symbols["choice"])]
    elif method == "pdf_lobes":
        made = [pdf_lobes(bsdf, values, normal, view, symbols["light"])]
    elif method == "traced":
        made = bsdf.traced(values, n_dot_v)
    else:
        made = [bsdf.mirrored(values, n_dot_v, traced)]
    return evaluator([expr(0.0) if part is None else part for part in made], list(symbols.values()))


def _run(bsdf: BSDF, method: str, given: Mapping[str, Any], traced: Sequence[Array] = ()) -> list[Array]:
    """The results of a method, (N, 3) or (N, 1).

    given : material values, normal and view, and what the method reads besides, (N, 3), (N, 1) or (N,), by name.
    """
    given = {**given, **{f"traced_{i}": part for i, part in enumerate(traced)}}
    arrays = []
    for name, value in given.items():
        arrays.append(np.reshape(value, -1) if _TYPES.get(name, FLOAT) is FLOAT else value)
    n = max(len(array) for array in arrays)
    found = _compiled(bsdf, method, tuple(given), len(traced))(*arrays)
    wide = (part if np.ndim(part) == 2 else np.reshape(part, (-1, 1)) for part in found)
    return [np.broadcast_to(part, (n, part.shape[1])) for part in wide]


def _frame(bsdf: BSDF, material: Mapping[str, Array], normal: Array, view: Array) -> dict[str, Array]:
    return {**{name: material[name] for name in bsdf.fields}, "normal": normal, "view": view}


def reflect_light(
    bsdf: BSDF, material: Mapping[str, Array], normal: Array, view: Array, light: Array
) -> tuple[Array, Array]:
    """The BSDF times cosine and pi, 0 for light from below, and the fraction of light that is ambient; (N, 3) each.

    material : values by name, (N, 3) or (N, 1). normal, view, light : unit vectors, (N, 3).
    """
    value, ambient = _run(bsdf, "eval", {**_frame(bsdf, material, normal, view), "light": light})
    above = np.einsum("ij,ij->i", normal, light)[:, None] > 0.0
    return np.where(above, value, 0.0), ambient


def reflect_sky(
    bsdf: BSDF,
    material: Mapping[str, Array],
    normal: Array,
    view: Array,
    skies: tuple[Array, Array, Array],
    traced: Sequence[Array],
) -> Array:
    """Reflected light of the sky, (N, 3); see `BSDF.reflect_sky`.

    skies : its mean about the normal, its radiance in the mirror direction, and its mean about that, (N, 3) each.
    traced : fraction of each lobe that rays trace, (N,).
    """
    given = dict(zip(("mean", "mirrored", "blurred"), skies, strict=True))
    return _run(bsdf, "reflect_sky", {**_frame(bsdf, material, normal, view), **given}, traced)[0]


def scattered(
    bsdf: BSDF, material: Mapping[str, Array], normal: Array, view: Array, random: tuple[float, float, float]
) -> Array:
    """Directions of the narrow lobes, (N, 3), of the same three random numbers; see `sample_lobes`."""
    n = len(normal)
    given = {"u": np.broadcast_to(random[:2], (n, 2)), "choice": np.full(n, random[2])}
    return _run(bsdf, "sample_lobes", {**_frame(bsdf, material, normal, view), **given})[0]


def lobe_density(bsdf: BSDF, material: Mapping[str, Array], normal: Array, view: Array, light: Array) -> Array:
    """The density of these directions, (N,); see `pdf_lobes`."""
    return _run(bsdf, "pdf_lobes", {**_frame(bsdf, material, normal, view), "light": light})[0][:, 0]


def traced_lobes(bsdf: BSDF, material: Mapping[str, Array], normal: Array, view: Array) -> list[Array]:
    """Fraction of each lobe that Whitted ray tracing replaces by a mirror, (N,)."""
    return [part[:, 0] for part in _run(bsdf, "traced", _frame(bsdf, material, normal, view))]


def mirrored(bsdf: BSDF, material: Mapping[str, Array], normal: Array, view: Array, traced: Sequence[Array]) -> Array:
    """Reflectance of the traced fractions of the lobes, (N, 3)."""
    return _run(bsdf, "mirrored", _frame(bsdf, material, normal, view), traced)[0]


def values_of(term: Function, *arguments: Any) -> Array:
    """The values of a term, such as `fresnel_dielectric`, for arrays of N; vectors are (N, n)."""
    result: Array = evaluator([term.body], term.params)(*arguments)[0]
    return result
