"""A function that a user wrote in GLSL, as an operation of the language.

It is opaque: NumPy needs a twin, its interval is unbounded, and its gradient is a central difference.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from raymarch.errors import Location, SceneError
from raymarch.expr.node import Expr, Operand, expr, make
from raymarch.expr.types import FLOAT, VEC3
from raymarch.expr.walk import find

Array: TypeAlias = NDArray[Any]
Twin: TypeAlias = Callable[[Array], Any]


def step_of(dtype: Any) -> float:
    """Step of the central differences, relative to the larger of the size of the solid and the coordinates.

    At this step the rounding error eps / h equals the truncation error h^2: 0.0049 in float32 (the gradient is accurate
    to some 2e-5), 6e-6 in float64.
    """
    return float(np.cbrt(np.finfo(dtype).eps))


@dataclass(frozen=True, slots=True)
class RawFunction:
    """A GLSL function `float name(vec3 p)`.

    name : name of the function. code : its GLSL, with its callees.
    twin : the same function in NumPy, from points (N, 3) to values (N,); None if there is none.
    size : length of the solid, which scales the step of its gradient.
    lipschitz : the largest change of its value in a unit of length; inf if the user promises none.
    where : the user's line that defined it.
    """

    name: str
    code: str
    twin: Twin | None
    size: float
    lipschitz: float = np.inf
    where: Location | None = field(default=None, compare=False)

    @property
    def defines(self) -> frozenset[str]:
        """Names of what the code defines outside of functions, macros too, and the name of the gradient."""
        return (
            frozenset({f"{self.name}_slope"})
            | frozenset(re.findall(r"^\s*#\s*define\s+(\w+)", self.code, re.M))
            | frozenset(name for statement in _outermost(self.code) for name in _declared(statement))
        )


def without_comments(code: str) -> str:
    """GLSL with spaces in place of comments."""
    return re.sub(r"//[^\n]*|/\*.*?\*/", " ", code, flags=re.S)


def _outermost(code: str) -> list[str]:
    """The statements outside of all braces, without comments and lines of the preprocessor."""
    depth, kept = 0, []
    for character in re.sub(r"^\s*#(?:.*\\\n)*.*$", "", without_comments(code), flags=re.M).replace("\n", " "):
        depth += (character == "{") - (character == "}")
        if depth == 0:
            kept.append("\n" if character in "};" else character)
    return "".join(kept).split("\n")


def _declared(statement: str) -> list[str]:
    """The names that a statement outside of all braces declares."""
    found = re.match(r"\s*(?:const\s+)?\w+(?:\s*\[\w*\])?\s+(\w+)\s*(?:$|[(=\[,])", statement)
    return [] if found is None else [found[1], *re.findall(r",\s*(\w+)", statement[found.end(1) :].partition("(")[0])]


def raw(function: RawFunction, p: Operand) -> Expr:
    """The function at a point, a vec3."""
    point = expr(p)
    if point.type is not VEC3:
        raise SceneError(f"{function.name}({point.type})", legal="a vec3")
    return make("raw", FLOAT, (point,), function)


def limit_of(function: RawFunction) -> float:
    """The Lipschitz constant of a function that has a twin, inf if none is promised or there is no twin."""
    return np.inf if function.twin is None else function.lipschitz


def slope(e: Expr) -> Expr:
    """The gradient of a `raw`: central differences along the axes."""
    return make("raw_slope", VEC3, e.args, e.data)


def without_twin(body: Expr) -> bool:
    """True if only the GPU can evaluate an expression."""
    return any(node.data.twin is None for node in find([body], "raw", "raw_slope"))


def evaluate(node: Expr, p: Array) -> Array:
    """NumPy row of "raw"."""
    function: RawFunction = node.data
    if function.twin is None:
        what = f"the GLSL function {function.name} has no NumPy twin, so only the GPU can evaluate it"
        raise SceneError(what, legal="glsl_node(..., twin=a function from points (N, 3) to distances (N,))")
    points = p.reshape(-1, 3)
    values = np.asarray(function.twin(points), p.dtype)
    if values.shape != (len(points),):
        what = f"the twin of {function.name} gives shape {values.shape} for points of shape {points.shape}"
        raise SceneError(what, legal=f"({len(points)},)")
    return values.reshape(p.shape[:-1])


def evaluate_slope(node: Expr, p: Array) -> Array:
    """NumPy row of "raw_slope"."""
    h = p.dtype.type(step_of(p.dtype)) * np.maximum(np.abs(p).max(axis=-1), p.dtype.type(node.data.size))
    sides = [h[..., None] * axis for axis in np.eye(3, dtype=p.dtype)]
    return np.stack([(evaluate(node, p + d) - evaluate(node, p - d)) / (2 * h) for d in sides], axis=-1)


def slope_text(function: RawFunction) -> str:
    """GLSL of the gradient."""
    name = function.name
    return f"""vec3 {name}_slope(vec3 p) {{
    // central differences; the step is the cube root of the precision
    vec2 h = vec2({step_of(np.float32):.5f} * max(max(abs(p.x), abs(p.y)), max(abs(p.z), {function.size:.6e})), 0.0);
    return vec3(
        {name}(p + h.xyy) - {name}(p - h.xyy),
        {name}(p + h.yxy) - {name}(p - h.yxy),
        {name}(p + h.yyx) - {name}(p - h.yyx)) / (2.0 * h.x);
}}"""
