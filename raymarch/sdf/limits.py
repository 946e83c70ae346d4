"""Functions of the point that users give to operators: how far their values and slopes reach."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raymarch.errors import SceneError
from raymarch.expr.convert import called, short
from raymarch.expr.derivative import companion
from raymarch.expr.evaluate import Program
from raymarch.expr.function import Function, trace
from raymarch.expr.intervals import INTERVALS, interval_of
from raymarch.expr.lattice import (
    WORLEY,
    gradient_lattice,
    gradient_lattice_in_time,
    lattice_noise,
    lattice_noise_in_time,
)
from raymarch.expr.node import Expr, expr
from raymarch.expr.types import FLOAT, VEC3, Type
from raymarch.expr.vocabulary import clamp
from raymarch.expr.walk import find
from raymarch.sdf.domain import as_operand
from raymarch.sdf.facts import lattice
from raymarch.sdf.node import Node

LIMITED = (lattice_noise, lattice_noise_in_time, gradient_lattice, gradient_lattice_in_time, *WORLEY.values())
"""Functions whose slopes are known, whatever operations they have."""

JUMPS = ("sign", "floor", "ceil", "round", "fract", "mod", "step", "where", "loop", "hash", "raw")
"""Operations that may be discontinuous, or whose slopes intervals cannot bound."""

LARGEST = 2.0**23
"""A field divided by more than this has no precision left in float32."""

GIVES = {FLOAT: "a number", VEC3: "a vec3"}


def traced(name: str, source: Any, gives: Type) -> Function:
    """The function of an operator as an expression of the point. SceneError if it is none, or gives another type."""
    if not callable(source):
        raise SceneError(f"{name}: function = {short(source)}", legal="a function of a point")
    made = source if isinstance(source, Function) else _traced(name, source, GIVES[gives])
    if made.type is not gives:
        raise SceneError(f"{name}: function gives a {made.type}", legal=GIVES[gives], where=made.where)
    return made


def _traced(name: str, source: Callable[[Any], Any], gives: str) -> Function:
    def of_point(p: Expr) -> Any:
        legal = f"a function from a point to {gives}"
        given = called(f"{name}: function", source, p, legal=legal)
        return as_operand(f"{name}: the function gives", given, legal)

    code = getattr(source, "__code__", of_point.__code__)
    return trace(getattr(source, "__name__", name).strip("<>"), of_point, [("p", VEC3)], code)


def refuse_jumps(name: str, function: Function, legal: str) -> None:
    """SceneError if the function may jump, so that its slope cannot be derived."""
    if jumps := find([function.body], *JUMPS, outside=LIMITED):
        what = f"{name}: the function uses '{jumps[0].op}', so its Lipschitz constant cannot be derived"
        raise SceneError(what, legal=legal)


CUTS = 12
"""A bounded box is cut into so many cells along each axis. The ranges of a cell are sharper than those of the box."""


def limits(function: Function, lower: Any, upper: Any) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Ranges of a function of k components over the cells of a box, and of its slopes, by intervals.

    The shapes are (cells, k, 2) and (cells, k, 3, 2).
    """
    low, high = _cells(np.asarray(lower, np.float64), np.asarray(upper, np.float64))
    size = function.type.size
    parts = [function] if size == 1 else [_component(function, i) for i in range(size)]
    ranges = np.stack([_ranges(companion(part), low, high) for part in parts], axis=1)
    return ranges[:, :, 3], ranges[:, :, :3]


def _cells(lower: NDArray[np.float64], upper: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    if not np.isfinite(upper - lower).all():
        return lower[None], upper[None]
    ends = np.linspace(lower, upper, CUTS + 1)
    return lattice([*ends[:-1].T]), lattice([*ends[1:].T])


def _component(function: Function, index: int) -> Function:
    return trace(f"{function.name}_{'xyz'[index]}", lambda p: function(p)[index], [("p", VEC3)])


def _ranges(function: Function, lower: Any, upper: Any) -> NDArray[np.float64]:
    """The least and largest value of each component over boxes, (boxes, k, 2); infinite where unknown."""
    with np.errstate(all="ignore"):
        (both,) = Program([function.body], function.params, INTERVALS)((lower, upper))
    low, high = (np.broadcast_to(end, (len(lower), function.type.size)) for end in both)
    return np.stack([np.where(np.isnan(low), -np.inf, low), np.where(np.isnan(high), np.inf, high)], axis=-1)


@np.errstate(over="ignore", invalid="ignore")
def held(
    name: str, node: Node, function: Function, over: Callable[[Any, Any], tuple[Any, Any]], rise: float
) -> tuple[Function, Any, Any]:
    """A function with the size of its values and its slope where the operator asks for it.

    They hold over all space if they are finite there. Else they hold over the solid's box grown by `rise` times the
    size, and the function is constant beyond that. SceneError if the solid is unbounded, or nothing limits them.

    over : function from the corners of a box to the size and the slope over it.
    """

    def finite(pair: tuple[Any, Any]) -> bool:
        return all(isinstance(value, Expr) or value < most for value, most in zip(pair, (np.inf, LARGEST), strict=True))

    def grown_by(size: Any) -> float:
        return rise * float(interval_of(expr(size))[1])

    everywhere = np.full(3, np.inf)
    if finite(found := over(-everywhere, everywhere)):
        return function, *found
    if not node.facts.bounded:
        what = f"{name}: {node.name} is unbounded, so the function has no limit over it"
        raise SceneError(what, legal="a bounded solid, as `node & box(...)`; or amplitude and lipschitz as numbers")
    for margin in (1.0, 2.0, 4.0):
        reach = margin * grown_by(over(*node.bounds)[0])
        lower, upper = node.bounds[0] - reach, node.bounds[1] + reach
        found = over(lower, upper)
        if finite(found) and grown_by(found[0]) <= reach:
            return held_outside(function, lower, upper), *found
    what = f"{name}: amplitude and slope of the function over {node.name} have no limit"
    raise SceneError(what, legal="amplitude and lipschitz as numbers")


def held_outside(function: Function, lower: Any, upper: Any) -> Function:
    """The function evaluated at the nearest point of a box."""
    return trace(f"{function.name}_held", lambda p: function(clamp(p, lower, upper)), [("p", VEC3)])
