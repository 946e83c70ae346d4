"""Legal ranges that only a frame can decide: an expression of time, or of a parameter, that was given for a value with
a range. It is marked with that range, wherever it goes; every reading takes the mark for the expression itself.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from raymarch.errors import Location, user_location
from raymarch.expr.intervals import interval_of
from raymarch.expr.node import Expr, make
from raymarch.expr.walk import find


@dataclass(frozen=True, slots=True)
class Limit:
    """A legal range.

    Attributes
    ----------
    what : the value's name, such as "Sun: intensity". legal : the range in words.
    low, high : each component lies between them. nonzero : not all of them may be 0.
    where : the user's line; it does not count for equality.
    """

    what: str
    legal: str
    low: float = -np.inf
    high: float = np.inf
    nonzero: bool = False
    where: Location | None = field(default=None, compare=False)

    def holds(self, value: Expr) -> bool:
        """True if no parameter, time or cell takes an expression out of the range, and a constant is finite."""
        low, high = interval_of(value)
        if value.is_constant and not np.all(np.isfinite(low)):
            return False
        if self.nonzero and not np.any((low > 0.0) | (high < 0.0)):
            return False
        return bool(np.all((low >= self.low) & (high <= self.high)))


def limited(value: Expr, limit: Limit) -> Expr:
    """The expression, marked with its range unless nothing can take it out of that."""
    if value.op == "within" and value.data == limit:
        return value  # of a value that exists already
    if value.is_constant or (limit.holds(value) and not may_overflow(value)):
        return value
    marked = Limit(limit.what, limit.legal, limit.low, limit.high, limit.nonzero, user_location())
    return make("within", value.type, (value,), marked)


def may_overflow(value: Expr) -> bool:
    """True if an expression of time or parameters has an operation whose result may be no finite number."""
    return bool(find([value], "div", "mod", "exp", "exp2", "pow", "log", "log2", "sinh", "cosh", "tan"))
