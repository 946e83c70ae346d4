"""Space that is warped by a function of the point.

The field at a point p is the solid's at p + o(p). With a map that stretches space by at most s, the field is at most s
times as steep as the solid's, so it is divided by s. The surface lies where the map meets the solid's, so each point of
it is one of the solid less a value of o.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Annotated, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from raymarch.errors import SceneError
from raymarch.expr.convert import short
from raymarch.expr.function import Function, Vec3Expr, function, trace
from raymarch.expr.intervals import interval_of
from raymarch.expr.node import Expr, Operand
from raymarch.expr.types import FLOAT, VEC3
from raymarch.expr.vocabulary import clamp, sin
from raymarch.sdf.definition import Child, operator
from raymarch.sdf.domain import Domain, Scalar, Vec3, as_length
from raymarch.sdf.facts import FARTHEST
from raymarch.sdf.limits import LARGEST, held_outside, limits, refuse_jumps, traced
from raymarch.sdf.node import Node, method, solid
from raymarch.sdf.noise import OfPoint


@function()
def waves(p: Vec3Expr) -> Expr:
    """The example: up to 0.05 along each axis, which stretches space by at most 1.2."""
    return 0.05 * sin(4.0 * p.yzx)


@operator(
    bounds=lambda child, low, high: (child.lower - high, child.upper - low),
    lipschitz=lambda child, stretch: child.lipschitz * stretch,
    spread="keep",
    placing="deform",
    called="warp",
)
def warped(
    p: Expr,
    child: Child,
    function: OfPoint = waves,
    low: Vec3 = (-0.05, -0.05, -0.05),
    high: Vec3 = (0.05, 0.05, 0.05),
    stretch: Annotated[Any, Domain(FLOAT, low=0.0, open=True)] = 1.2,
) -> Expr:
    """Warp space: at p the solid is evaluated at p + function(p)."""
    return child(p + function(p))


@method
def warp(
    node: Node, function: Callable[[Expr], Operand], amplitude: Scalar | None = None, lipschitz: Scalar | None = None
) -> Node:
    """Warp space: at a point p the solid is evaluated at p + function(p), so its surface moves by -function(p).

    Parameters
    ----------
    function : function from a point, a vec3 expression, to a vec3, of functions in `raymarch.expr.vocabulary`.
    amplitude : largest absolute value of each component, a length >= 0. Larger values are clamped. None derives it.
    lipschitz : largest factor by which the map from p to p + function(p) stretches space, > 0. None derives it from the
        function's derivatives. A number is not checked; one that is too small makes holes.

    Returns
    -------
    Node

    Raises
    ------
    SceneError : arguments of another kind or outside their range.

    Notes
    -----
    A bound: divided by `lipschitz`. Derived values hold over all space if possible (sines). Else, or where that is
    sharper, they hold over a box that contains the warped solid, which must be bounded. Beyond that box the function
    has its value at the nearest point of it. A function with steps (floor, mod, where) needs `lipschitz` as a number.
    """
    solid("warp", node)
    made = traced("warp", function, VEC3)
    if lipschitz is None:
        refuse_jumps("warp", made, "lipschitz = the largest factor by which p + function(p) stretches space")
    if amplitude is not None:
        made = _clamped(made, amplitude)
    box, inner = _whole_box(node, made), _held_box(node, made)
    free: Scalar = _steepest(made) if lipschitz is None else lipschitz
    within: Scalar = lipschitz if lipschitz is not None else np.inf if inner is None else _steepest(made, inner)
    if box is not None and (lipschitz is not None or free <= SHARPER * within):
        return warped(node, made, *_between(made, box), free)
    if inner is not None and (lipschitz is not None or within < LARGEST):
        held = held_outside(made, *inner)
        return warped(node, held, *_between(made, inner), within)
    what = f"warp: what the function moves {node.name} by, or how it stretches space, has no limit"
    cure = "amplitude and lipschitz as numbers"
    raise SceneError(what, legal=cure if node.facts.bounded else f"a bounded solid, as `node & box(...)`; or {cure}")


Box: TypeAlias = "tuple[NDArray[np.float64], NDArray[np.float64]]"

SPACE: Box = (np.full(3, -np.inf), np.full(3, np.inf))

SHARPER = 1.1
"""A function is held beyond a box if it stretches space so many times less there than it may over all space. That costs
six operations."""


def _clamped(function: Function, amplitude: Scalar) -> Function:
    legal = "a length >= 0, or None"
    most = as_length("warp: amplitude", amplitude, legal)
    low, high = map(float, interval_of(most))
    if not 0.0 <= low <= high <= FARTHEST:
        raise SceneError(f"warp: amplitude = {short(amplitude)}", legal=legal)
    return trace(f"{function.name}_clamped", lambda p: clamp(function(p), -most, most), [("p", VEC3)])


def _between(function: Function, box: Box) -> Box:
    """The least and largest value of each component over a box."""
    values, _ = limits(function, *box)
    return values[..., 0].min(axis=0), values[..., 1].max(axis=0)


def _moved(node: Node, between: Box, times: float = 1.0) -> Box:
    """The box of the solid less the values of the function, or values so many times as large."""
    low, high = between
    return node.bounds[0] - times * high, node.bounds[1] - times * low


def _whole_box(node: Node, function: Function) -> Box | None:
    """A box that contains the warped solid, if the function is limited over all space."""
    box = _moved(node, _between(function, SPACE))
    if np.isnan(box).any() or np.isinf(_between(function, SPACE)).any():
        return None
    return _moved(node, _between(function, box))


def _held_box(node: Node, function: Function) -> Box | None:
    """A box that contains the warped solid, if the function is that at the box's nearest point beyond it."""
    if not node.facts.bounded:
        return None
    start = _between(function, node.bounds)
    for times in (1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 16.0):
        lower, upper = box = _moved(node, (np.minimum(start[0], 0.0), np.maximum(start[1], 0.0)), times)
        needed = _moved(node, _between(function, box))
        if np.all(lower <= needed[0]) and np.all(needed[1] <= upper) and np.isfinite(needed).all():
            return box
    return None


def _steepest(function: Function, box: Box | None = None) -> float:
    """How much the map stretches space at most; with a box, where the function is held beyond it.

    A held function does not change along the axes along which the point lies beyond the box.
    """
    _, slopes = limits(function, *(SPACE if box is None else box))
    moves = itertools.product((0.0, 1.0), repeat=3) if box is not None else [(1.0,) * 3]
    return max(_stretch(slopes * np.reshape(along, (3, 1))) for along in moves)


def _stretch(slopes: NDArray[np.float64]) -> float:
    """An upper bound of the spectral norm of 1 + D for all matrices D within ranges, (cells, 3, 3, 2).

    Each is the centre of its ranges plus a matrix whose entries are at most the radii, and the norm of a sum is at most
    the sum of the norms.
    """
    if not np.isfinite(slopes).all():
        return np.inf
    centre, radius = np.eye(3) + slopes.mean(axis=-1), 0.5 * np.ptp(slopes, axis=-1)
    return float((np.linalg.norm(centre, 2, axis=(1, 2)) + np.linalg.norm(radius, 2, axis=(1, 2))).max())
