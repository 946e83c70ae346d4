"""A field that a user wrote in GLSL, with the facts that it promises."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from raymarch.errors import SceneError, user_location
from raymarch.expr.convert import choice, numbers, real, short
from raymarch.expr.glsl import identifier
from raymarch.expr.node import Expr, const
from raymarch.expr.raw import RawFunction, Twin, raw, without_comments
from raymarch.sdf.definition import shape
from raymarch.sdf.domain import Domain
from raymarch.sdf.facts import ORDER, Exactness
from raymarch.sdf.node import Node

__all__ = ["glsl_node"]


@dataclass(frozen=True, slots=True)
class RawField:
    """A GLSL function and what it promises; see `glsl_node`."""

    function: RawFunction
    exactness: Exactness
    lipschitz: float
    lower: tuple[float, ...]
    upper: tuple[float, ...]

    @property
    def functions(self) -> tuple[Any, ...]:
        """What is Python's in it, and therefore pickled by name."""
        return () if self.function.twin is None else (self.function.twin,)


def _waves(points: NDArray[Any]) -> NDArray[Any]:
    x, y, z = points.T
    heights: NDArray[Any] = y - 0.2 * np.sin(2.0 * x) * np.cos(1.5 * z)
    return heights


WAVES = RawField(
    RawFunction(
        "raw_waves",
        "float raw_waves(vec3 p) {\n    return p.y - 0.2 * sin(2.0 * p.x) * cos(1.5 * p.z);\n}",
        _waves,
        1.0,
    ),
    "bound",
    float(np.sqrt(1.0 + 0.4**2)),
    (-np.inf, -np.inf, -np.inf),
    (np.inf, 0.2, np.inf),
)
"""The specimen."""


@shape(
    exactness=lambda field: field.exactness,
    bounds=lambda field: (const(field.lower), const(field.upper)),
    lipschitz=lambda field: field.lipschitz,
)
def raw_field(p: Expr, field: Annotated[Any, Domain(None, holds=RawField)] = WAVES) -> Expr:
    """A field written in GLSL."""
    return raw(field.function, p)


def glsl_node(
    code: str,
    name: str,
    exactness: Exactness = "estimate",
    lipschitz: float = 1.0,
    bounds: tuple[Sequence[float], Sequence[float]] | None = None,
    twin: Twin | None = None,
) -> Node:
    """A solid whose field is a function in GLSL. Its facts are taken on trust.

    Parameters
    ----------
    code : GLSL of `float name(vec3 p)`, signed distance, and of all that it calls; for GLSL 3.30 and ES 3.00 alike, so
        with a decimal point in every float.
    name : of the function; no name that GLSL or the shader has.
    exactness : "exact", "bound" or "estimate": what the value, once it is divided by `lipschitz`, is to the distance.
    lipschitz : how steep the function is at most, > 0. A steeper one than 1 is divided by it.
    bounds : corners (lower, upper) of a box around the solid, three numbers each; infinite where it has no end. None
        for no end at all.
    twin : the same function in NumPy, from points (N, 3) to values (N,). Without it the solid is drawn, but
        `distance`, `gradient` and the reference tracer raise SceneError, and a camera is taken to be outside.

    The gradient is a central difference of the function, six calls, 0.0049 of the solid's size (or of the coordinates,
    where they are larger) to each side: good to about 2e-5 in float32 where the field is smooth.
    """
    plain = without_comments(code) if isinstance(code, str) else ""
    if not isinstance(name, str) or len(name) > 64 or identifier(name, ()) != name:
        raise SceneError(
            f"glsl_node: name = {short(name)}", legal="a name that is free in GLSL: letters, digits, single _"
        )
    if not re.search(rf"\bfloat\s+{name}\s*\(\s*(const\s+)?(in\s+)?(highp\s+)?vec3\s+\w+\s*\)\s*\{{", plain):
        raise SceneError(
            f"glsl_node: the code has no function float {name}(vec3 p)", legal=f"float {name}(vec3 p) {{...}}"
        )
    if re.search(r"\bvoid\s+main\b|#\s*version", plain) or plain.count("{") != plain.count("}"):
        raise SceneError("glsl_node: the code is a whole shader, or has open braces", legal="functions only")
    choice("glsl_node: exactness", exactness, ORDER, "'exact', 'bound' or 'estimate'")
    lipschitz = real("glsl_node: lipschitz", lipschitz, float(np.finfo(np.float32).tiny), legal="a number > 0")
    if twin is not None and not callable(twin):
        raise SceneError(
            f"glsl_node: twin = {short(twin)}", legal="a function from points (N, 3) to values (N,), or None"
        )
    lower, upper = _corners(bounds)
    edges = upper - lower
    size = float(np.max(edges[np.isfinite(edges)], initial=0.0)) or 1.0
    function = RawFunction(name, code.strip("\n"), twin, size, user_location())
    return raw_field(RawField(function, exactness, float(lipschitz), tuple(lower.tolist()), tuple(upper.tolist())))


def _corners(bounds: ArrayLike | None) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    if bounds is None:
        return np.full(3, -np.inf), np.full(3, np.inf)
    corners = numbers("glsl_node: bounds", bounds, "two corners of three numbers each, lower < upper")
    if corners.shape != (2, 3) or not np.all(corners[0] < corners[1]):
        raise SceneError(
            f"glsl_node: bounds = {short(bounds)}", legal="two corners of three numbers each, lower < upper"
        )
    return corners[0], corners[1]
