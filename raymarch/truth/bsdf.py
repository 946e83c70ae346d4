"""BSDFs in float64: the expressions of `raymarch.scene.bsdf`, evaluated at N points."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raymarch.expr.arrays import evaluator
from raymarch.expr.function import Function
from raymarch.expr.node import expr, var
from raymarch.expr.types import FLOAT, VEC2, VEC3, Type
from raymarch.expr.vocabulary import clamp, dot
from raymarch.scene.bsdf import BSDF
from raymarch.scene.material import Material
from raymarch.scene.surfaces import pdf_lobes, sample_lobes

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
    match method:
        case "eval":
            ambient = bsdf.ambient(values)
            made = [bsdf.eval(values, normal, view, symbols["light"]), expr(0.0) if ambient is None else ambient]
        case "reflect_sky":
            mean, around, blurred = (symbols[name] for name in ("mean", "mirrored", "blurred"))
            made = [bsdf.reflect_sky(values, n_dot_v, mean, around, blurred, traced)]
        case "sample_lobes":
            made = [sample_lobes(bsdf, values, normal, view, symbols["u"], symbols["choice"])]
        case "pdf_lobes":
            made = [pdf_lobes(bsdf, values, normal, view, symbols["light"])]
        case "traced":
            made = bsdf.traced(values, n_dot_v)
        case _:
            made = [bsdf.mirrored(values, n_dot_v, traced)]
    return evaluator(made, list(symbols.values()))


@dataclass(frozen=True, slots=True)
class Reflection:
    """A BSDF at N points.

    material : values by name, (N, 3) or (N, 1). normal, view : unit vectors, (N, 3).
    """

    bsdf: BSDF
    material: Mapping[str, Array]
    normal: Array
    view: Array

    def eval(self, light: Array) -> tuple[Array, Array]:
        """The BSDF times cosine and pi, 0 for light from below, and the fraction of light that is ambient; (N, 3) each.

        light : unit vectors, (N, 3).
        """
        value, ambient = self._run("eval", light=light)
        above = np.einsum("ij,ij->i", self.normal, light)[:, None] > 0.0
        return np.where(above, value, 0.0), ambient

    def reflect_sky(self, mean: Array, mirrored: Array, blurred: Array, traced: Sequence[Array]) -> Array:
        """Reflected light of the sky, (N, 3), from its light, (N, 3) each; see `BSDF.reflect_sky`.

        traced : fraction of each lobe that rays trace, (N,).
        """
        return self._run("reflect_sky", traced, mean=mean, mirrored=mirrored, blurred=blurred)[0]

    def sample_lobes(self, random: tuple[float, float, float]) -> Array:
        """Directions of the narrow lobes, (N, 3), of the same three random numbers; see `sample_lobes`."""
        n = len(self.normal)
        return self._run("sample_lobes", u=np.broadcast_to(random[:2], (n, 2)), choice=np.full(n, random[2]))[0]

    def pdf_lobes(self, light: Array) -> Array:
        """The density of these directions, (N,); see `pdf_lobes`."""
        return self._run("pdf_lobes", light=light)[0][:, 0]

    def traced(self) -> list[Array]:
        """Fraction of each lobe that Whitted ray tracing replaces by a mirror, (N,)."""
        return [part[:, 0] for part in self._run("traced")]

    def mirrored(self, traced: Sequence[Array]) -> Array:
        """Reflectance of the traced fractions of the lobes, (N, 3)."""
        return self._run("mirrored", traced)[0]

    def _run(self, method: str, traced: Sequence[Array] = (), **read: Array) -> list[Array]:
        """The results of a method, (N, 3) or (N, 1). read : what it reads besides, (N, 3), (N, 1) or (N,), by name."""
        given = {name: self.material[name] for name in self.bsdf.fields} | {"normal": self.normal, "view": self.view}
        given |= read | {f"traced_{i}": part for i, part in enumerate(traced)}
        arrays = [np.reshape(v, -1) if _TYPES.get(name, FLOAT) is FLOAT else v for name, v in given.items()]
        n = max(len(array) for array in arrays)
        found = _compiled(self.bsdf, method, tuple(given), len(traced))(*arrays)
        wide = (part if np.ndim(part) == 2 else np.reshape(part, (-1, 1)) for part in found)
        return [np.broadcast_to(part, (n, part.shape[1])) for part in wide]


def values_of(term: Function, *arguments: Any) -> Array:
    """The values of a term, such as `fresnel_dielectric`, for arrays of N; vectors are (N, n)."""
    result: Array = evaluator([term.body], term.params)(*arguments)[0]
    return result
