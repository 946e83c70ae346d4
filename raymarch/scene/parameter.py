"""Values that change without a recompile: `Param`, a named parameter with a range, and `time`."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from raymarch.errors import Location, PlanError, SceneError, user_location
from raymarch.expr.arrays import bound, value_of
from raymarch.expr.calls import checked
from raymarch.expr.colors import linear_color
from raymarch.expr.convert import described, holdable, numbers, real, short
from raymarch.expr.intervals import interval_of
from raymarch.expr.limits import Limit, limited
from raymarch.expr.node import Expr, expr, make
from raymarch.expr.types import FLOAT, Type, vector
from raymarch.expr.walk import find, free_variables
from raymarch.sdf.domain import as_operand, unit

Value = float | tuple[float, ...]

ParamValue: TypeAlias = float | str | Sequence[float] | NDArray[Any]
"""A number, 2 to 4 of them as a sequence or an array, or a colour as a string."""


@dataclass(frozen=True, slots=True)
class Spec:
    """Name, default and range of a parameter."""

    name: str
    value: Value
    min: Value | None
    max: Value | None
    where: Location | None = field(default=None, compare=False)

    def __reduce__(self) -> tuple[Any, ...]:
        return _legal_spec, (self.name, self.value, self.min, self.max, self.where)

    def __repr__(self) -> str:
        ends = "".join(f", {side}={_shown(v)}" for side, v in (("min", self.min), ("max", self.max)) if v is not None)
        return f"Param({self.name!r}, {_shown(self.value)}{ends})"

    @property
    def type(self) -> Type:
        return vector(len(self.value)) if isinstance(self.value, tuple) else FLOAT

    @property
    def ends(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Least and greatest legal value, infinite without a limit."""
        low, high = -np.inf if self.min is None else self.min, np.inf if self.max is None else self.max
        return np.asarray(low, np.float64), np.asarray(high, np.float64)

    @property
    def range(self) -> str:
        """The range in words: "0 to 2", ">= 0", "<= 2" or "any value"."""
        low, high = (None if end is None else _shown(end) for end in (self.min, self.max))
        if low is not None and high is not None:
            return f"{low} to {high}"
        return f">= {low}" if low is not None else f"<= {high}" if high is not None else "any value"

    @property
    def legal(self) -> str:
        low = "" if self.min is None else f" >= {_shown(self.min)}"
        high = "" if self.max is None else f" <= {_shown(self.max)}"
        count = f"{len(self.value)} numbers" if isinstance(self.value, tuple) else "a number"
        return f"{count}{low}{' and' if low and high else ''}{high}"

    def accept(self, value: Any, where: Location | None = None) -> Value:
        """A new value, checked against type and range. SceneError if it is not legal."""
        given = _plain(value, f"parameter '{self.name}'", where)
        if np.shape(given) != np.shape(self.value):
            raise SceneError(f"parameter '{self.name}' = {short(value)}", legal=self.legal, where=where)
        low, high = self.ends
        if not np.all((low <= given) & (given <= high)):
            raise SceneError(f"parameter '{self.name}' = {_shown(given)}", legal=self.legal, where=where)
        return given


def _shown(value: Value) -> str:
    return f"({', '.join(f'{v:g}' for v in value)})" if isinstance(value, tuple) else f"{value:g}"


def _plain(value: Any, what: str, where: Location | None = None) -> Value:
    legal = "a finite number up to 3.4e38 in size, or 2 to 4 of them"
    with suppress(SceneError):  # a string that is no colour is refused below
        value = linear_color(what, value)
    try:
        array = numbers(what, value, legal)
    except SceneError as fault:
        raise SceneError(fault.what, legal=legal, where=where) from None
    if array.shape not in ((), (2,), (3,), (4,)) or not holdable(array):
        raise SceneError(f"{what} = {short(value)}", legal=legal, where=where)
    return float(array) if array.shape == () else tuple(float(v) for v in array)


@checked
def Param(
    name: str,
    value: ParamValue,
    min: ParamValue | None = None,
    max: ParamValue | None = None,
) -> Expr:
    """A named value that can change without a recompile.

    Parameters
    ----------
    name : label of the slider, and NAME in `--set NAME=VALUE`. Letters, digits, space, _ and -.
    value : default: a number, or 2 to 4 numbers for a vector or colour, or a colour as a string, such as "tomato".
    min, max : range: one number, or as many as `value` has. Facts of nodes hold over the whole range, and
        `raymarch render --set` refuses values outside it. None means no limit on that side.

    Returns
    -------
    An expression, which can be used wherever a number is expected.

    Raises
    ------
    SceneError : a value outside its range or an illegal name.

    Notes
    -----
    Two parameters of one name must be equal.

    Examples
    --------
    >>> rm.sphere(rm.Param("radius", 1, 0.5, 2)).bounds[1]
    array([2., 2., 2.])
    """
    spec = _legal_spec(name, value, min, max, user_location())
    made = make("param", spec.type, (), spec)
    made.data = spec  # of equal parameters the latest has the line that the user sees, such as after a reload
    return made


def _legal_spec(name: Any, value: Any, low: Any, high: Any, where: Location | None) -> Spec:
    """The checked content of a parameter, new or of a pickle."""
    if not isinstance(name, str) or not re.fullmatch(r"[^\W_][\w -]*", name):
        raise SceneError(
            f"Param: name = {short(name)}", legal="a letter or digit, then letters, digits, space, _ and -"
        )
    default = _plain(value, f"Param '{name}': value")
    low = None if low is None else _plain(low, f"Param '{name}': min")
    high = None if high is None else _plain(high, f"Param '{name}': max")
    for edge in (low, high):
        if isinstance(edge, tuple) and np.shape(edge) != np.shape(default):
            raise SceneError(
                f"Param '{name}': range {edge} for a value of {np.shape(default)}", legal="one number, or one each"
            )
    spec = Spec(name, default, low, high, where)
    if low is not None and high is not None and not np.all(np.asarray(low) <= np.asarray(high)):
        raise SceneError(f"Param '{name}': min = {_shown(low)} above max = {_shown(high)}", legal="min <= max")
    spec.accept(default)
    return spec


time: Expr = make("time", FLOAT)
"""Seconds since the start of the animation, an expression. Set by `--time`, `--frames` and the clock of the window."""


def specs_in(values: Iterable[Expr]) -> dict[str, Spec]:
    """The parameters that some expressions read, by name, in order of appearance."""
    found: dict[str, Spec] = {}
    for leaf in find(values, "param"):
        spec: Spec = leaf.data
        if found.setdefault(spec.name, spec) != spec:
            raise PlanError(
                f"two parameters are named '{spec.name}' but differ", legal="one Param, used twice", where=spec.where
            )
    return found


@dataclass(frozen=True, slots=True)
class Values:
    """The values of parameters and time for one frame."""

    params: Mapping[str, Value]
    time: float = 0.0

    def of(self, value: Any) -> np.ndarray[Any, np.dtype[np.float64]]:
        """A number, vector or expression of parameters and time, in float64."""
        given = expr(value)
        if given.is_constant:
            return np.asarray(given.data, np.float64)
        with bound(self.params, self.time):
            return np.asarray(value_of(given), np.float64)


def set_values(
    specs: Mapping[str, Spec],
    given: Mapping[str, ParamValue] | None = None,
    time: float = 0.0,
    where: Location | None = None,
) -> Values:
    """Default values with some replaced. SceneError for an unknown name or a value out of range.

    where : the user's line of the scene, for the message about an unknown name.
    """
    params = {name: spec.value for name, spec in specs.items()}
    given = {} if given is None else given
    if not isinstance(given, Mapping):
        raise SceneError(f"params = {described(given)}", legal="a dict of values by name", where=where)
    for name, value in given.items():
        if name not in specs:
            known = ", ".join(sorted(specs)) or "none; this scene has no Param"
            raise SceneError(f"unknown parameter '{name}' = {short(value)}", legal=f"one of: {known}", where=where)
        params[name] = specs[name].accept(value, specs[name].where)
    return Values(params, _seconds(time, where))


def _seconds(time: Any, where: Location | None) -> float:
    legal = "a finite number of seconds, up to 3.4e38"
    try:
        return real("time", time, legal=legal)
    except SceneError as fault:
        raise SceneError(fault.what, legal=legal, where=where) from None


def is_zero(value: Expr) -> bool:
    """True for the constant 0, and a vector of them."""
    return value.is_constant and not np.any(value.data)


def as_vec3(what: str, value: Any, low: float = -np.inf, high: float = np.inf, cells: bool = False) -> Expr:
    """A position, direction or colour, checked. Expressions must be vec3.

    cells : whether it may depend on the index of a cell; see `raymarch.repeat_varied`.
    """
    return _checked(what, value, 3, low, high, cells)


def as_color(what: str, value: Any, low: float = 0.0, high: float = np.inf, cells: bool = False) -> Expr:
    """A colour, checked: three numbers, an expression of a vec3 or a string. cells : see `as_vec3`."""
    return as_vec3(what, linear_color(what, value), low, high, cells)


LEAST_LENGTH, MOST_LENGTH = 1e-18, 1e18
"""Limits of the lengths of parts of a scene: beyond the sizes of scenes, and their squares are float32."""


def as_number(what: str, value: Any, low: float = -np.inf, high: float = np.inf, cells: bool = False) -> Expr:
    """A number, checked. Expressions must be scalar. cells : see `as_vec3`."""
    return _checked(what, value, 1, low, high, cells)


def _checked(what: str, value: Any, size: int, low: float, high: float, cells: bool) -> Expr:
    """The value as an expression, checked.

    An expression of parameters must be legal at their defaults. An expression of the index of a cell must be legal in
    all cells. Values that a parameter or time can move out of range are marked: see `limited`.
    """
    legal = "a finite number" if size == 1 else f"{size} finite numbers"
    if low > -np.inf:
        legal += f" >= {low:g}"
    if high < np.inf:
        legal += f"{' and' if low > -np.inf else ''} <= {high:g}"
    given = as_operand(what, value, legal)
    if given.type is not vector(size):
        raise SceneError(f"{what} = {short(value)}", legal=legal)
    if given.is_constant:
        if not _within(given.data, low, high):
            raise SceneError(f"{what} = {short(value)}", legal=legal)
        return given
    stray = free_variables([given])
    if stray:
        raise SceneError(
            f"{what} depends on {short(stray[0].data)}", legal=f"{legal}, which may depend on parameters and time only"
        )
    if find([given], "cell"):
        first, last = interval_of(given)
        rounding = 1e-6  # of ranges
        if not cells or not np.all((first >= low - rounding) & (last <= high + rounding)):
            reason = f"is between {first.tolist()} and {last.tolist()}" if cells else "depends on the index of a cell"
            raise SceneError(f"{what} {reason}", legal=legal)
    elif not find([given], "time"):
        usual = Values({}).of(given)
        if not _within(usual, low, high):
            raise SceneError(f"{what} = {usual.tolist()} with its parameters at their defaults", legal=legal)
    return limited(given, Limit(what, legal, low, high))


def _within(value: NDArray[np.float64], low: float, high: float) -> bool:
    """True if every component is finite in float32 and in a range."""
    return holdable(value) and bool(np.all((value >= low) & (value <= high)))


def as_direction(what: str, value: Any) -> Expr:
    """A direction of any length but 0, checked with parameters at their defaults, and normalised."""
    if isinstance(value, Expr) and value.op == "normalize" and value.args[0].op == "within":
        return value  # checked before, and passed by `replace`
    given, limit = as_vec3(what, value), Limit(what, "3 numbers, not all zero", nonzero=True)
    if not find([given], "time") and not np.any(Values({}).of(given)):
        shown = short(value) if given.is_constant else "0 with its parameters at their defaults"
        raise SceneError(f"{what} = {shown}", legal=limit.legal)
    return unit(limited(given, limit))
