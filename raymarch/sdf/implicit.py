"""Implicit surfaces: where a function of the point is 0, such as an algebraic surface.

No fact is stated by the user. The gradient and the interval reading of the function give the steepest slope over the
box, hence a bound on the distance; samples give the usual slope at the surface, the unit in which the function is a
distance nearly, for blends and offsets.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raymarch.errors import SceneError
from raymarch.expr.arrays import evaluator
from raymarch.expr.calls import checked
from raymarch.expr.convert import called, described, plain, real, short
from raymarch.expr.derivative import companion
from raymarch.expr.evaluate import Program
from raymarch.expr.function import Function, trace, unique_function
from raymarch.expr.intervals import INTERVALS, interval_of
from raymarch.expr.node import Expr, Operand, construct
from raymarch.expr.types import FLOAT, VEC3
from raymarch.expr.vocabulary import clamp, dot, length, max, min
from raymarch.expr.walk import rebuild, rewrite, topological
from raymarch.sdf.definition import shape
from raymarch.sdf.domain import Domain, Positive, Scalar, Vec3, Vector, as_operand, corners_of
from raymarch.sdf.facts import lattice
from raymarch.sdf.node import Node
from raymarch.sdf.values import with_bound

__all__ = ["implicit"]

OfPoint = Annotated[Any, Domain(None, holds=Function)]
Number = Annotated[Any, Domain(FLOAT)]
Certain = Annotated[bool, Domain(None, holds=bool)]


def _ball(p: Expr) -> Expr:
    return dot(p, p) - 1.0


BALL = trace("quadric", _ball, [("p", VEC3)])
"""The example: a ball as a quadric, with slope 2 at its surface."""


@shape(
    exactness=lambda certain: "bound" if certain else "estimate",
    bounds=lambda lower, upper: (lower, upper),
    lipschitz=lambda unit, steepest: max(steepest / unit, 1.0),
    spread=1.0,
    called="implicit",
)
def implicit_solid(
    p: Expr,
    function: OfPoint = BALL,
    lower: Vec3 = (-1.0, -1.0, -1.0),
    upper: Vec3 = (1.0, 1.0, 1.0),
    level: Number = 0.0,
    unit: Positive = 2.0,
    steepest: Positive = 3.4641016151377544,
    certain: Certain = True,
) -> Expr:
    """Solid where a function of the point is below a level, cut by a box."""
    value = function(clamp(p, lower, upper)) - level
    unit_value, bound = (cut_by_box(p, value / scale, lower, upper) for scale in (unit, max(unit, steepest)))
    return with_bound(unit_value, bound)


def cut_by_box(p: Expr, value: Expr, lower: Operand, upper: Operand) -> Expr:
    """The field of the part in a box of a solid whose field is `value` at the point of the box that is nearest to p."""
    beyond = max(lower - p, p - upper)
    nearest = max(beyond, 0.0)
    box = length(nearest) + min(max(beyond.x, max(beyond.y, beyond.z)), 0.0)
    return max(value, box)


LEGAL = "a function from a point to a number, negative inside, of functions of raymarch, such as rm.sin(p.x) + p.y"
BOUNDS = "a number b for the cube from -b to b, two corners (lower, upper), or a bounded solid"
LARGEST = 2.0**23
"""A field divided by more than this has no precision left in float32."""
SAMPLES, CELLS = 48, 16
"""Points and cells along each axis at which the function is looked at."""


@checked
def implicit(function: Callable[[Any], Operand], bounds: Scalar | Vector | Node, level: Scalar = 0.0) -> Node:
    """Solid where a function of the point is below a level, such as an algebraic surface. No fact is needed.

    Parameters
    ----------
    function : function from a point, a vec3 expression, to a number: negative inside, of any scale and slope.
    bounds : where the solid is cut, and closed: a number b for the cube from -b to b, two corners (lower, upper), or a
        bounded solid.
    level : the solid is where the function is below it: a number, or an expression of a `Param` with min and max.

    Returns
    -------
    Node

    Raises
    ------
    SceneError : the function is nowhere or everywhere negative in the box, or NaN at a point of it.

    Notes
    -----
    `rm.implicit(lambda p: p.x**4 + p.y**4 + p.z**4 - 1, 1.1)` is a rounded cube.

    A bound: the values are divided by the steepest slope over the box, by intervals of the gradient. Blends, offsets
    and shells act on the function divided by its usual slope at the surface: nearly a distance, except near singular
    points. Where no bound of the slope is known, as of a square root at 0, twice the steepest slope of samples stands
    for it, and the solid is an estimate.
    """
    made = _traced(function)
    cut = bounds if isinstance(bounds, Node) else None
    lower, upper = _corners(bounds)
    at = Domain(FLOAT).accept("implicit", "level", level)
    seen = _looked_at(made, at, lower, upper)
    solid: Node = implicit_solid(made, seen.lower, seen.upper, at, seen.unit, seen.steepest, seen.certain)
    return solid if cut is None else solid & cut


def _traced(source: Any) -> Function:
    if isinstance(source, Function):
        return source
    if not callable(source):
        raise SceneError(f"implicit: function = {described(source)}", legal=LEGAL)

    def of_point(p: Expr) -> Any:
        given = called("implicit: function", source, p, legal=LEGAL)
        if given is None:
            raise SceneError("implicit: the function gives None", legal=LEGAL)
        return as_operand("implicit: the value of the function", given, LEGAL)

    code = getattr(source, "__code__", of_point.__code__)
    name = getattr(source, "__name__", "surface").strip("<>")
    made = trace("surface" if name == "lambda" else name, of_point, [("p", VEC3)], code)
    where = made.where if hasattr(source, "__code__") else None  # else that of the call is the user's
    made = unique_function(made.name, made.params, _with_norms(made.body), {}, where)
    if made.type is not FLOAT:
        raise SceneError(f"implicit: the function gives a {made.type}", legal=LEGAL, where=made.where)
    if made.params[0] not in topological([made.body]):
        raise SceneError("implicit: the function does not depend on the point", legal=LEGAL, where=made.where)
    return made


def _with_norms(root: Expr) -> Expr:
    """The expression with roots of sums of squares as lengths, whose slopes are bounded at 0, too."""

    def rule(node: Expr, args: tuple[Expr, ...]) -> Expr:
        if node.op == "sqrt" and node.type is FLOAT:
            (inner,) = args
            if inner.op == "dot" and inner.args[0] is inner.args[1]:
                return length(inner.args[0])
            terms = _terms(inner)
            if 2 <= len(terms) <= 4 and all(t.op == "mul" and t.args[0] is t.args[1] for t in terms):
                return length(construct(*[term.args[0] for term in terms]))
        return rebuild(node, args)

    return rewrite([root], rule)[root]


def _terms(total: Expr) -> list[Expr]:
    return [t for arg in total.args for t in _terms(arg)] if total.op == "add" else [total]


def _corners(bounds: Any) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    if isinstance(bounds, Node):
        if bounds.dimension != 3 or not bounds.facts.bounded:
            raise SceneError(f"implicit: bounds = {described(bounds)}, which is not bounded", legal=BOUNDS)
        return bounds.bounds
    if isinstance(plain(bounds), int | float) and not isinstance(bounds, bool):
        half = real("implicit: bounds", bounds, legal=BOUNDS)
        bounds = half if half <= 0.0 else ((-half,) * 3, (half,) * 3)
    lower, upper = corners_of("implicit: bounds", bounds, BOUNDS)
    if not np.all(np.isfinite([lower, upper])):
        raise SceneError(f"implicit: bounds = {short(bounds)}, which is not bounded", legal=BOUNDS)
    return lower, upper


class _Seen(NamedTuple):
    """What is known of a function in a box: the box of what is below the level, its usual slope at the surface, and its
    steepest slope in that box: a bound if it is certain."""

    lower: NDArray[np.float64]
    upper: NDArray[np.float64]
    unit: float
    steepest: float
    certain: bool


def _looked_at(function: Function, level: Expr, lower: NDArray[np.float64], upper: NDArray[np.float64]) -> _Seen:
    whole = companion(function)
    axes = [np.linspace(a, b, SAMPLES) for a, b in zip(lower, upper, strict=True)]
    points = lattice(axes)
    values = evaluator([function.body - level], function.params)(points)[0].reshape((SAMPLES,) * 3)
    _refuse(function, values, points)
    inner, ranges = _cells(whole, level, lower, upper)
    if not inner.any():  # samples below the level lie in cells whose range reaches below it
        inner[:] = True
    edges = [np.linspace(a, b, CELLS + 1) for a, b in zip(lower, upper, strict=True)]
    some = [np.flatnonzero(inner.any(axis=tuple({0, 1, 2} - {axis}))) for axis in range(3)]
    low = np.array([edges[axis][s[0]] for axis, s in enumerate(some)])
    high = np.array([edges[axis][s[-1] + 1] for axis, s in enumerate(some)])
    part = ranges[tuple(slice(s[0], s[-1] + 1) for s in some)]
    slopes = np.linalg.norm(evaluator([whole.body], whole.params)(points)[0][:, :3], axis=1)
    known = np.isfinite(slopes) & (slopes > 0.0)
    at_surface = known & _at_surface(values).ravel()
    usual = float(np.median(slopes[at_surface if at_surface.any() else known])) if known.any() else 1.0
    bound = float(part.max())
    if bound < usual * LARGEST:
        return _Seen(low, high, usual, float(np.maximum(bound, usual)), True)
    return _Seen(low, high, usual, 2.0 * float(np.max(slopes, where=known, initial=usual)), False)


def _refuse(function: Function, values: NDArray[np.float64], points: NDArray[np.float64]) -> None:
    """SceneError for values less the level, on a grid, of which no solid can be made."""
    flat = values.ravel()
    if not np.isfinite(flat).all():
        first = np.flatnonzero(~np.isfinite(flat))[0]
        legal = "a number at each point of the box: rm.max(x, 0) under roots, divisors that are not 0, or other bounds"
        raise SceneError(
            f"implicit: {function.name} is {flat[first]} at {points[first].tolist()}", legal=legal, where=function.where
        )
    if flat.min() >= 0.0:
        at, least = points[flat.argmin()].round(4).tolist(), flat.min()
        what = f"implicit: {function.name} is nowhere below its level in the box: {least:g} above it at least, at {at}"
        raise SceneError(what, legal="values below the level inside: another level or box, or -f")
    if flat.max() <= 0.0:
        what = f"implicit: {function.name} is below its level everywhere in the box, by {-flat.max():g} at least"
        raise SceneError(f"{what}: the solid is the box", legal="values above the level outside: another level or box")


def _cells(
    whole: Function, level: Expr, lower: NDArray[np.float64], upper: NDArray[np.float64]
) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
    """By intervals, for each cell of a grid: whether the function may be below its level, and its steepest slope."""
    index = lattice(3 * [np.arange(CELLS)])
    step = (upper - lower) / CELLS
    with np.errstate(all="ignore"):
        ((low, high),) = Program([whole.body], whole.params, INTERVALS)(
            (lower + index * step, lower + (index + 1) * step)
        )
    low, high = (np.broadcast_to(end, (len(index), 4)) for end in (low, high))
    slopes = np.linalg.norm(np.maximum(np.abs(low[:, :3]), np.abs(high[:, :3])), axis=1)
    slopes = np.where(np.isnan(slopes), np.inf, slopes)
    below = ~(low[:, 3] > interval_of(level)[1])
    return below.reshape((CELLS,) * 3), slopes.reshape((CELLS,) * 3)


def _at_surface(values: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Points of a grid beside which the sign changes."""
    inside = values < 0.0
    found = np.zeros(values.shape, bool)
    for axis in range(3):
        changes = np.moveaxis(np.diff(inside, axis=axis), axis, 0)
        along = np.moveaxis(found, axis, 0)
        along[1:] |= changes
        along[:-1] |= changes
    return found
