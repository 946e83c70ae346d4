"""Arithmetic of textures: a value of a material that each texture enters as a number or as a colour."""

from __future__ import annotations

import operator
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, Self, TypeAlias

from raymarch.errors import SceneError
from raymarch.expr.colors import linear_color
from raymarch.expr.node import Expr
from raymarch.expr.types import BOOL, FLOAT
from raymarch.sdf.domain import as_operand

Operator: TypeAlias = Callable[..., Any]

SYMBOLS: dict[Callable[..., Any], str] = {
    operator.add: "+",
    operator.sub: "-",
    operator.mul: "*",
    operator.truediv: "/",
    operator.pow: "**",
    operator.lt: "<",
    operator.le: "<=",
    operator.gt: ">",
    operator.ge: ">=",
}
LEGAL = "a texture, a number, a parameter or a colour"


def _both_ways(compute: Operator) -> tuple[Callable[..., MapExpression], Callable[..., MapExpression]]:
    """The methods of an operator, with the map on the left and on the right."""
    return lambda self, other: MapExpression(compute, self, other), lambda self, other: MapExpression(
        compute, other, self
    )


def _compared(compare: Operator) -> Callable[..., MapComparison]:
    """The method of a comparison."""
    return lambda self, other: MapComparison(compare, self, other)


class MapValue(ABC):
    """A value that is read at a point, as a number or as a colour; arithmetic gives another one."""

    OPERAND = True
    """For expressions, which leave operators with it to this class."""
    __slots__ = ()
    __array_ufunc__ = None  # arrays leave operators to this class, too

    @abstractmethod
    def color(self, p: Expr) -> Expr:
        """Linear RGB at a point, a vec3."""

    @abstractmethod
    def number(self, p: Expr) -> Expr:
        """The value at a point, a float."""

    def __call__(self, p: Expr) -> Expr:
        """The colour at a point."""
        return self.color(p)

    __add__, __radd__ = _both_ways(operator.add)
    __sub__, __rsub__ = _both_ways(operator.sub)
    __mul__, __rmul__ = _both_ways(operator.mul)
    __truediv__, __rtruediv__ = _both_ways(operator.truediv)
    __pow__, __rpow__ = _both_ways(operator.pow)

    __lt__, __le__, __gt__, __ge__ = map(_compared, (operator.lt, operator.le, operator.gt, operator.ge))

    @staticmethod
    def computed(function: Callable[..., Any], *given: Any) -> MapExpression:
        """A function of `raymarch` of maps, numbers and colours, such as `rm.max(picture, 0.1)`."""
        return MapExpression(function, *given)

    def __neg__(self) -> MapExpression:
        return -1.0 * self

    def __pos__(self) -> Self:
        return self

    def __abs__(self) -> MapExpression:
        return MapExpression(operator.abs, self)

    def __bool__(self) -> bool:
        raise SceneError(f"{self!r} has no truth value", legal="rm.where(texture < 0.5, a, b)")


class MapExpression(MapValue):
    """A value of a material that is computed from textures, such as `0.2 + 0.5 * planar("rough.png")`.

    For a number of the material, each texture gives a number; for a colour, its linear RGB.
    """

    __slots__ = ("_compute", "_operands")

    def __init__(self, compute: Operator, *operands: Any) -> None:
        self._compute = compute
        self._operands = tuple(given if isinstance(given, MapValue) else _constant(given) for given in operands)

    def __repr__(self) -> str:
        shown = [
            repr(given.data.tolist() if isinstance(given, Expr) and given.is_constant else given)
            for given in self._operands
        ]
        if self._compute in SYMBOLS:
            return f"({shown[0]} {SYMBOLS[self._compute]} {shown[1]})"
        return f"{self._compute.__name__}({', '.join(shown)})"

    def color(self, p: Expr) -> Expr:
        return self._of([given.color(p) if isinstance(given, MapValue) else given for given in self._operands])

    def number(self, p: Expr) -> Expr:
        for given in self._operands:
            if isinstance(given, Expr) and given.type not in (FLOAT, BOOL):
                raise SceneError(f"a texture in arithmetic with a {given.type}", legal="numbers, for one number")
        return self._of([given.number(p) if isinstance(given, MapValue) else given for given in self._operands])

    def _of(self, values: list[Expr]) -> Expr:
        made: Expr = self._compute(*values)
        return made


class MapComparison(MapExpression):
    """A comparison of the numbers of textures, for `rm.where(texture < 0.5, a, b)`."""

    __slots__ = ()

    def color(self, p: Expr) -> Expr:
        return self.number(p)


def _constant(given: Any) -> Expr:
    return as_operand("texture: arithmetic", linear_color("texture: arithmetic", given), LEGAL)
