"""Domains of node parameters: type, legal range and unit.

A definition annotates its parameters with the aliases below. Editors see plain numbers and sequences.
The decorators read the `Domain` in the annotation, convert each argument, and refuse values that are not legal.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import Annotated, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from raymarch.errors import SceneError
from raymarch.expr.arrays import bound, value_of
from raymarch.expr.convert import LARGEST, belongs, holdable, instance, integer, numbers, plain, short, switch
from raymarch.expr.intervals import Interval, interval_of
from raymarch.expr.node import Expr, const, expr
from raymarch.expr.samples import Samples
from raymarch.expr.types import FLOAT, MAT3, VEC2, VEC3, VECTORS, Type
from raymarch.expr.vocabulary import normalize
from raymarch.expr.walk import find, free_variables

Kind: TypeAlias = type[Any]
"""A Python type. It has its own name because the `type` of a Domain is a GLSL type."""


AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
"""Names of directions."""


@dataclass(frozen=True, slots=True)
class Domain:
    """Legal values of one parameter.

    type : type of the expression that the definition receives. None for static values, which are passed unchanged.
    low, high : range of each component. `open` excludes `low` itself.
    unit : unit of the number, for documentation: "length", "radians", ...
    direction : True for a vector that must not be zero; the definition receives it normalised.
    stretch : True if a single number stands for a vector of equal components.
    holds : Python type of a static value; it must be hashable.
    points : for a static sequence of points, the number of coordinates of each. The definition receives a tuple of
        tuples.
    """

    type: Type | None
    low: float = -np.inf
    high: float = np.inf
    open: bool = False
    unit: str = ""
    direction: bool = False
    stretch: bool = False
    holds: Kind = int
    points: int = 0
    inner: tuple[float, float] = field(init=False, repr=False, compare=False)
    """Between these two a number is legal, and so it is after rounding to float32; see `_plain`."""

    def __post_init__(self) -> None:
        low, high = max(self.low, -LARGEST), min(self.high, LARGEST)
        object.__setattr__(self, "inner", (low + 1e-6 * max(abs(low), 1e-30), high - 1e-6 * max(abs(high), 1e-30)))

    @property
    def legal(self) -> str:
        """The legal range in words."""
        if self.points:
            return f"two points or more, each {self.points} finite numbers"
        if self.holds is bool:
            return "True or False"
        if self.holds is not int:
            return f"a {self.holds.__name__}"
        kind = "an integer" if self.type is None else "a number" if self.type is FLOAT else f"{self.type.size} numbers"
        if self.type is not None and self.type.is_matrix:
            kind = f"a {self.type.size}x{self.type.size} matrix"
        if self.direction:
            named = ", or 'x', 'y' or 'z'" if self.type is VEC3 else ""
            return f"{kind}, not all zero{named}"
        if self.low == -np.inf and self.high == np.inf:
            return f"{kind}, finite"
        bounds = []
        if self.low > -np.inf:
            bounds.append(f"{'>' if self.open else '>='} {self.low:g}")
        if self.high < np.inf:
            bounds.append(f"<= {self.high:g}")
        return f"{kind} {' and '.join(bounds)}{', in radians' if self.unit == 'radians' else ''}"

    def accept(self, node: str, name: str, value: Any) -> Any:
        """The value as the definition receives it. SceneError with the value and its legal range if it is not legal."""
        if self.type is None:
            return self._accept_static(node, name, value)
        if self.direction and self.type is VEC3 and isinstance(value, str) and value in AXES:
            value = AXES[value]
        if (known := self._plain(value)) is not None:
            return known
        try:
            given = _expression(value)
        except SceneError:
            raise SceneError(f"{node}: {name} = {short(value)}{belongs(value)}", legal=self.legal) from None
        stray = free_variables([given])
        if stray:
            what = f"{node}: {name} depends on {short(stray[0].data)}"
            raise SceneError(what, legal=f"{self.legal}, which may depend on parameters and time only")
        if self.stretch and given.type is FLOAT:
            given = expr((given,) * self.type.size)
        if given.type is not self.type:
            flat = "; a flat shape has two coordinates: extrude it first" * (self.type is VEC2 and given.type is VEC3)
            raise SceneError(f"{node}: {name} = {short(value)} is a {given.type}", legal=f"{self.legal}{flat}")
        self._check(node, name, value, given)
        return unit(given) if self.direction else given

    def _plain(self, value: Any) -> Expr | None:
        """The constant of plain numbers that are legal at first sight; None for all else. Scenes of many objects are
        made of these: looking closely takes ten times as long."""
        least, most = self.inner
        if isinstance(value, np.ndarray | np.generic) and value.dtype.kind in "fiu":
            value = value.tolist()
        if type(value) is float or type(value) is int:
            return const(float(value)) if self.type is FLOAT and least < value < most else None
        if (
            type(value) not in (tuple, list)
            or self.type is None
            or len(value) != self.type.size
            or not self.type.is_vector
        ):
            return None
        for number in value:
            if (type(number) is not float and type(number) is not int) or not least < number < most:
                return None
        return const(value) if not self.direction or sum(n * n for n in value) == 1.0 else None

    def _accept_static(self, node: str, name: str, value: Any) -> Any:
        what = f"{node}: {name}"
        if self.points:
            array = numbers(what, value, self.legal)
            if array.ndim != 2 or array.shape[1] != self.points or len(array) < 2 or not holdable(array):
                raise SceneError(f"{what} = {short(value)}", legal=self.legal)
            return tuple(map(tuple, array.tolist()))
        if self.holds is bool:
            return switch(what, value)
        if self.holds is not int:
            return instance(what, plain(value) if self.holds is str else value, self.holds, self.legal)
        return integer(what, value, self.low, self.high, self.legal)

    def _check(self, node: str, name: str, value: Any, given: Expr) -> None:
        if not given.is_constant:
            low, high = interval_of(given)
        else:
            with np.errstate(over="ignore"):  # checked in float32, the shader's precision: overflow and underflow count
                low = high = given.data.astype(np.float32)
            if not np.all(np.isfinite(low)):
                what = "infinite in float32" if np.all(np.isfinite(given.data)) else "not finite"
                raise SceneError(f"{node}: {name} = {short(value)} is {what}", legal=self.legal)
            if self.direction and not np.any(given.data):
                raise SceneError(f"{node}: {name} = {short(value)}", legal=self.legal)
        ranged = not find([given], "time")
        # The whole range of a parameter must be legal. Time has no stated range: some value of it must be legal.
        smallest, largest = (low, high) if ranged else (high, low)
        below = smallest <= self.low if self.open else smallest < self.low
        if np.any(below) or np.any(largest > self.high):
            shown = short(value) if given.is_constant else f"an expression between {low} and {high}"
            if given.is_constant and np.any((low == 0.0) & (given.data != 0.0)):
                shown += " is 0 in float32"
            raise SceneError(f"{node}: {name} = {shown}", legal=f"{self.legal}{self._cure(given)}")

    def _cure(self, given: Expr) -> str:
        """How to state the range of a parameter that has none; empty if all have one."""
        for spec in (leaf.data for leaf in find([given], "param")):
            plain = given.op == "param"
            missing = ["min"] if spec.min is None and (not plain or self.low > -np.inf) else []
            missing += ["max"] if spec.max is None and (not plain or self.high < np.inf) else []
            if missing:
                return f"; Param '{spec.name}' needs {' and '.join(f'{side}=' for side in missing)}"
        return ""


Scalar: TypeAlias = float | Expr
"""A number, or an expression of parameters and time."""

Vector: TypeAlias = Sequence[Any] | NDArray[Any] | Expr
Vec3Like: TypeAlias = Sequence[float | Expr] | NDArray[Any] | Expr
"""Three numbers as a sequence, an array of shape (3,), or a vec3 expression."""

MatrixLike: TypeAlias = Sequence[Any] | NDArray[Any]
"""The rows of a matrix as sequences, an array of shape (n, n), or vector expressions."""

ColorLike: TypeAlias = Vec3Like | str
"""Linear RGB, three numbers: 0 to 1 for reflectances, >= 0 for light. Or a string in sRGB: "#ff8800", "orange"."""

# A caller passes a number or a sequence, and the definition receives an expression. `Any` is the type of both.
Number = Annotated[Scalar, Domain(FLOAT)]
Length = Annotated[Scalar, Domain(FLOAT, unit="length")]
Positive = Annotated[Scalar, Domain(FLOAT, low=0.0, open=True, unit="length")]
NonNegative = Annotated[Scalar, Domain(FLOAT, low=0.0, unit="length")]
Power = Annotated[Scalar, Domain(FLOAT, low=2.0, high=64.0, unit="power")]
Vec4 = Annotated[Any, Domain(VECTORS[4])]
Factor = Annotated[Scalar, Domain(FLOAT, low=0.0, open=True, unit="factor")]
Fraction = Annotated[Scalar, Domain(FLOAT, low=0.0, high=1.0, unit="fraction")]
Angle = Annotated[Scalar, Domain(FLOAT, unit="radians")]
PI = float(np.float32(np.pi))  # a little more than pi, so that pi rounded to float32 is legal too
Acute = Annotated[Scalar, Domain(FLOAT, low=0.0, high=PI / 2, open=True, unit="radians")]
HalfTurn = Annotated[Scalar, Domain(FLOAT, low=0.0, high=PI, open=True, unit="radians")]
Turn = Annotated[Scalar, Domain(FLOAT, low=0.0, high=2 * PI, open=True, unit="radians")]
Vec2 = Annotated[Any, Domain(VEC2, unit="length")]
Vec3 = Annotated[Any, Domain(VEC3, unit="length")]
Size2 = Annotated[Any, Domain(VEC2, low=0.0, open=True, unit="length", stretch=True)]
Size3 = Annotated[Any, Domain(VEC3, low=0.0, open=True, unit="length", stretch=True)]
Direction = Annotated[Any, Domain(VEC3, direction=True)]
Matrix3 = Annotated[Any, Domain(MAT3)]

Data = Annotated[Any, Domain(None, holds=Samples)]
Word = Annotated[str, Domain(None, holds=str)]
Points2 = Annotated[Any, Domain(None, holds=tuple, points=2, unit="length")]
Points3 = Annotated[Any, Domain(None, holds=tuple, points=3, unit="length")]
Count = Annotated[int, Domain(None, low=1, high=65535, unit="count")]
Whole = Annotated[int, Domain(None, unit="integer")]


def as_operand(what: str, value: Any, legal: str) -> Expr:
    """Any argument as an expression. A string is none: arguments that are colours convert theirs before."""
    try:
        return _expression(value)
    except SceneError:
        raise SceneError(f"{what} = {short(value)}{belongs(value)}", legal=legal) from None


def _expression(value: Any) -> Expr:
    """The expression of a number, a vector or an expression. SceneError for a string, which `expr` takes as colour."""
    if isinstance(value, str):
        raise SceneError(f"{short(value)} is a string", legal="a number, a vector or an expression")
    if isinstance(value, np.ndarray) and value.dtype == object and value.ndim == 1:
        return expr(tuple(value))  # as of np.array([rm.sin(p.x), 0, 0])
    return expr(value)


def corners_of(what: str, bounds: Any, legal: str) -> NDArray[np.float64]:
    """Two corners of a box, lower < upper, shape (2, 3); infinite where it is unbounded."""
    given = numbers(what, bounds, legal)
    ordered = given.shape == (2, 3) and np.all(given[0] < given[1])
    if not ordered or not all(holdable(end) or np.isinf(end) for end in given.flat):
        raise SceneError(f"{what} = {short(bounds)}", legal=legal)
    return given


def as_length(what: str, value: Any, legal: str = "a number > 0, or None") -> Expr:
    """A number, or an expression of parameters and time. Its range is not checked."""
    given = as_operand(what, value, legal)
    if given.type is not FLOAT or free_variables([given]):
        raise SceneError(f"{what} = {short(value)}", legal=legal)
    return given


def unit(direction: Expr) -> Expr:
    """A direction normalised to length 1. A vector that has unit length within rounding is returned unchanged."""
    if direction.op == "normalize":
        return direction
    if direction.is_constant and np.abs(np.dot(direction.data, direction.data) - 1.0) <= 4.0 * np.finfo(float).eps:
        return direction
    return normalize(direction)


def domain_of(annotation: Any, default: Any) -> Domain:
    """The domain in an annotation. Without one: any finite value of the shape of the default."""
    for extra in getattr(annotation, "__metadata__", ()):
        if isinstance(extra, Domain):
            return extra
    if isinstance(default, tuple | list) and len(default) in VECTORS:
        return Domain(VECTORS[len(default)])
    return Domain(FLOAT)


def interval_of_value(value: Any) -> Interval:
    """The range of an accepted value, as an interval. A static integer is an interval of one number."""
    return interval_of(value if isinstance(value, Expr) else const(float(value)))


def shown(value: Expr) -> str:
    """A parameter's value for a message."""
    low, high = interval_of(value)
    return f"{low.tolist()}" if value.is_constant else f"an expression between {low.tolist()} and {high.tolist()}"


def surely(condition: Expr) -> bool:
    """True if a relation holds for all values of the parameters."""
    return bool(interval_of(condition)[0])


def require(condition: Expr, what: str, legal: str) -> None:
    """SceneError(what, legal) unless a relation between parameters holds over their whole ranges.

    Intervals cannot show it if both sides read the same `Param`; then the corners of the ranges decide.
    If the relation depends on time, which has no stated range, it only has to be possible.
    """
    always, possible = interval_of(condition)
    if not always and not (possible and (find([condition], "time") or _holds_at_corners(condition))):
        raise SceneError(what, legal=legal)


@dataclass(frozen=True, slots=True)
class Fits:
    """A check of a node's parameters that must fit each other.

    holds : the relation, a function of those parameters; see `require`. legal : it in words.
    what : their values in the message, if not all as "name = value".
    """

    holds: Callable[..., Expr]
    legal: str
    what: str = ""

    def require(self, node: str, params: Mapping[str, Any]) -> None:
        """SceneError unless the relation holds; see `require`. node : the name for the message."""
        code = self.holds.__code__
        given = {name: params[name] for name in code.co_varnames[: code.co_argcount]}
        what = self.what or ", ".join(f"{name} = {{}}" for name in given)
        require(self.holds(**given), f"{node}: {what.format(*map(shown, given.values()))}", self.legal)


def _holds_at_corners(condition: Expr) -> bool:
    specs = [leaf.data for leaf in find([condition], "param")]
    if not 0 < len(specs) <= 4 or any(s.min is None or s.max is None for s in specs):
        return False
    ends = [(s.min, s.value, s.max) for s in specs]
    for corner in product(*ends):
        with bound({s.name: v for s, v in zip(specs, corner, strict=True)}, 0.0):
            if not value_of(condition):
                return False
    return True
