"""The expression language of fields: typed expressions, their vocabulary, and their readings."""

from raymarch.expr import simplify as _simplify  # noqa: F401  registers the simplifications, before any is asked for

# isort: split
from raymarch.expr import colors as _colors  # noqa: F401  these register what expressions call
from raymarch.expr import maths as _maths  # noqa: F401
from raymarch.expr import pickling as _pickling  # noqa: F401
from raymarch.expr.function import Function, function, loop, trace
from raymarch.expr.node import Expr, Operand, const, construct, expr, var

__all__ = ["Expr", "Function", "Operand", "const", "construct", "expr", "function", "loop", "trace", "var"]
