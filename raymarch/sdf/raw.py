"""User-written GLSL fields, with facts that the user states."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from raymarch.errors import SceneError, user_location
from raymarch.expr.calls import checked
from raymarch.expr.convert import choice, real, short
from raymarch.expr.node import Expr, const
from raymarch.expr.pieces import identifier
from raymarch.expr.raw import RawFunction, Twin, raw, without_comments
from raymarch.sdf.definition import shape
from raymarch.sdf.domain import Domain, corners_of
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
    return y - 0.2 * np.sin(2.0 * x) * np.cos(1.5 * z)


STEEPEST = float(np.sqrt(1.0 + 0.4**2))

WAVES = RawField(
    RawFunction(
        "raw_waves",
        "float raw_waves(vec3 p) {\n    return p.y - 0.2 * sin(2.0 * p.x) * cos(1.5 * p.z);\n}",
        _waves,
        1.0,
        STEEPEST,
    ),
    "bound",
    STEEPEST,
    (-np.inf, -np.inf, -np.inf),
    (np.inf, 0.2, np.inf),
)
"""The specimen."""


@shape(
    exactness=lambda field: field.exactness,
    bounds=lambda field: (const(field.lower), const(field.upper)),
    lipschitz=lambda field: field.lipschitz,
    called="glsl_node",
)
def raw_field(p: Expr, field: Annotated[Any, Domain(None, holds=RawField)] = WAVES) -> Expr:
    """A field written in GLSL."""
    return raw(field.function, p)


@checked
def glsl_node(
    code: str,
    name: str,
    exactness: Exactness = "estimate",
    lipschitz: float = 1.0,
    bounds: tuple[Sequence[float], Sequence[float]] | None = None,
    twin: Twin | None = None,
) -> Node:
    """A solid whose field is a GLSL function. You state its facts; with `twin`, samples check bounds and exactness.

    Parameters
    ----------
    code : GLSL of `float name(vec3 p)`, the signed distance, and of all functions that it calls. It must be valid in
        GLSL 3.30 and ES 3.00, so every float needs a decimal point.
    name : name of the function. It must not be a name of GLSL or of the shader.
    exactness : "exact", "bound" or "estimate", for the value divided by `lipschitz`.
    lipschitz : Lipschitz constant of the function, > 0. If it is above 1, the value is divided by it.
    bounds : corners (lower, upper) of a box around the solid, three numbers each; infinite where it is unbounded. None
        for an unbounded solid.
    twin : the same function in NumPy, from points (N, 3) to values (N,). Without it the solid is drawn, but
        `distance`, `gradient` and the reference tracer raise SceneError, and the camera is assumed to be outside.

    Returns
    -------
    Node

    Raises
    ------
    SceneError : arguments of another kind or outside their range.

    Notes
    -----
    The gradient is a central difference of the function: six calls, with a step of 0.0049 of the solid's size (or of
    the coordinates, if they are larger). Its error is about 2e-5 in float32 where the field is smooth.
    """
    plain = without_comments(code) if isinstance(code, str) else ""
    if not isinstance(name, str) or len(name) > 64 or identifier(name, ()) != name:
        what = f"glsl_node: name = {short(name)}"
        raise SceneError(what, legal="a name that is free in GLSL: letters, digits, single _")
    if not re.search(rf"\bfloat\s+{name}\s*\(\s*(const\s+)?(in\s+)?(highp\s+)?vec3\s+\w+\s*\)\s*\{{", plain):
        what = f"glsl_node: the code has no function float {name}(vec3 p)"
        raise SceneError(what, legal=f"float {name}(vec3 p) {{...}}")
    if re.search(r"\bvoid\s+main\b|#\s*version", plain) or plain.count("{") != plain.count("}"):
        raise SceneError("glsl_node: the code is a whole shader, or has open braces", legal="functions only")
    choice("glsl_node: exactness", exactness, ORDER, "'exact', 'bound' or 'estimate'")
    lipschitz = real("glsl_node: lipschitz", lipschitz, float(np.finfo(np.float32).tiny), legal="a number > 0")
    if twin is not None and not callable(twin):
        raise SceneError(f"glsl_node: twin = {short(twin)}", legal="a function from points (N, 3) to (N,), or None")
    legal = "two corners of three numbers each, lower < upper"
    everywhere = (-np.inf,) * 3, (np.inf,) * 3
    lower, upper = corners_of("glsl_node: bounds", everywhere if bounds is None else bounds, legal)
    edges = upper - lower
    size = float(np.max(edges[np.isfinite(edges)], initial=0.0)) or 1.0
    steepest = np.inf if exactness == "estimate" else float(lipschitz)
    function = RawFunction(name, code.strip("\n"), twin, size, steepest, user_location())
    return raw_field(RawField(function, exactness, float(lipschitz), tuple(lower.tolist()), tuple(upper.tolist())))
