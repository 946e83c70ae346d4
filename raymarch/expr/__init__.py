"""The expression language of fields: typed expressions, their vocabulary, and their readings."""

from raymarch.expr import simplify as _rules  # noqa: F401  registers the simplifications
from raymarch.expr.function import Function, function, loop, trace
from raymarch.expr.node import Expr, Operand, const, construct, expr, var

__all__ = ["Expr", "Function", "Operand", "const", "construct", "expr", "function", "loop", "trace", "var"]
