"""Legal ranges that are checked in each frame.

A value with a legal range may be an expression of time or of a parameter. It is marked with that range; every reading
treats the mark as the expression itself.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from raymarch.errors import Location, user_location
from raymarch.expr.intervals import interval_of
from raymarch.expr.node import Expr, make
from raymarch.expr.walk import find


@dataclass(frozen=True, slots=True)
class Limit:
    """A legal range.

    what : the value's name, such as "Sun: intensity". legal : description of the range.
    low, high : bounds of each component. nonzero : at least one component must not be 0.
    where : the user's line; it is ignored in comparisons.
    """

    what: str
    legal: str
    low: float = -np.inf
    high: float = np.inf
    nonzero: bool = False
    where: Location | None = field(default=None, compare=False)

    def holds(self, value: Expr) -> bool:
        """True if an expression stays in the range for all parameters, times and cells; a constant must be finite."""
        low, high = interval_of(value)
        if value.is_constant and not np.all(np.isfinite(low)):
            return False
        if self.nonzero and not np.any((low > 0.0) | (high < 0.0)):
            return False
        return bool(np.all((low >= self.low) & (high <= self.high)))


def limited(value: Expr, limit: Limit) -> Expr:
    """Mark an expression with its range, unless it always stays in it."""
    if value.op == "within" and value.data == limit:
        return value  # already marked
    if value.is_constant or (limit.holds(value) and not may_overflow(value)):
        return value
    return make("within", value.type, (value,), replace(limit, where=user_location()))


def may_overflow(value: Expr) -> bool:
    """True if an expression contains an operation whose result may not be finite."""
    return bool(find([value], "div", "mod", "exp", "exp2", "pow", "log", "log2", "sinh", "cosh", "tan"))
