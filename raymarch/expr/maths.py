"""The functions of the vocabulary under their public names (`raymarch.sin`): for expressions, numbers and arrays alike.

Where an argument is an expression the result is an expression. Otherwise it is computed at once, in float64: a float
for numbers, an array for arrays and sequences. Both follow the same rules; `sqrt(-1)` is 0 in a shader and here.
"""

from __future__ import annotations

import builtins
import inspect
import math
import operator
from collections.abc import Callable, Mapping, Sequence
from functools import partial, wraps
from typing import Any, ParamSpec

import numpy as np

from raymarch.errors import SceneError
from raymarch.expr import vocabulary as v
from raymarch.expr.arrays import evaluator
from raymarch.expr.calls import checked
from raymarch.expr.colors import linear_color
from raymarch.expr.convert import numbers, short
from raymarch.expr.node import Expr, Operand, called_by_expressions, construct, expr, var
from raymarch.expr.peers import OF_SOLIDS
from raymarch.expr.types import FLOAT, vector

__all__ = ["abs", "ceil", "clamp", "floor", "fract", "max", "min", "mix", "mod", "sign", "smoothstep", "step", "where"]
__all__ += ["acos", "asin", "atan", "atan2", "cos", "cosh", "pi", "sin", "sinh", "tan", "tanh", "tau"]
__all__ += ["exp", "exp2", "log", "log2", "pow", "sqrt"]
__all__ += ["cross_product", "distance", "dot", "length", "normalize", "vec2", "vec3", "vec4"]

P = ParamSpec("P")

BROADCAST = "shapes that broadcast; of N numbers t beside colours or vectors, t[:, None]"

pi = math.pi
tau = math.tau


def _holds_expression(value: Any) -> bool:
    return isinstance(value, Expr) or (isinstance(value, tuple | list) and any(map(_holds_expression, value)))


def _number(value: Any) -> Any:
    """A constant as a float or an array."""
    array = np.array(value, np.float64)
    return float(array) if array.shape == () else array


def _arguments(signature: inspect.Signature, name: str, args: Sequence[Any], kwargs: Mapping[str, Any]) -> list[Any]:
    """All arguments of a call. SceneError if they do not fit the function."""
    try:
        signature.bind(*args, **kwargs)
    except TypeError as fault:
        raise SceneError(f"{name}: {fault}", legal=f"{name}({', '.join(signature.parameters)})") from None
    return [*args, *kwargs.values()]


def _map_among(given: Sequence[Any]) -> Any:
    """The first texture, or value computed from textures, among some arguments; None for none."""
    return next((each for each in given if hasattr(type(each), "computed")), None)


def _of_arrays(function: Callable[P, Expr], called: str, legal: str, vectors: bool) -> Callable[P, Any]:
    """The function for expressions, and for arrays of numbers, or of vectors along the last axis; both broadcast."""
    signature = inspect.signature(function)

    @wraps(function)
    def call(*args: P.args, **kwargs: P.kwargs) -> Any:
        given = _arguments(signature, called, args, kwargs)
        if not vectors and (read := _map_among(given)) is not None:
            return read.computed(function, *given)
        if builtins.any(map(_holds_expression, given)):
            return function(*args, **kwargs)
        if (solid := next((a for a in given if hasattr(a, "complement")), None)) is not None:
            raise SceneError(f"{called} of a solid ({solid.name})", legal=OF_SOLIDS.get(called, legal))
        arrays = [numbers(f"{called}: argument", linear_color(f"{called}: argument", a, legal), legal) for a in given]
        shapes = " and ".join(str(a.shape) for a in arrays)
        sizes = [a.shape[-1] if vectors and a.shape else 1 for a in arrays]
        if vectors and not builtins.all(1 <= n <= 4 and a.size for n, a in zip(sizes, arrays, strict=True)):
            raise SceneError(f"{called} of shapes {shapes}", legal=legal)
        if vectors:
            arrays = [a[..., 0] if a.shape and a.shape[-1] == 1 else a for a in arrays]
        # One number for all elements stays a constant, so that the function can check it.
        inputs = {
            var(f"argument {i}", vector(n)): a for i, (n, a) in enumerate(zip(sizes, arrays, strict=True)) if a.shape
        }
        symbols = iter(inputs)
        places = [next(symbols) if a.shape else float(a) for a in arrays]
        named = dict(zip(kwargs, places[len(args) :], strict=True))  # other types than those of P, which it takes too
        made = function(*places[: len(args)], **named)  # type: ignore[arg-type]
        if not inputs:
            return _number(made.data)
        try:
            (result,) = evaluator([made], list(inputs))(*inputs.values())
            return _number(
                result if vectors else np.broadcast_to(result, np.broadcast_shapes(*(a.shape for a in arrays)))
            )
        except ValueError:
            raise SceneError(f"{called} of shapes {shapes}", legal=BROADCAST) from None

    return call


_SECTIONS = """Parameters
----------
{} : {}, which are broadcast.

Returns
-------
Expr, float or array
    An expression if an argument is one, else a float or a float64 array.

Raises
------
SceneError : other arguments."""

_NUMBERS = "expressions, numbers, or arrays of any shape"
_VECTORS = "expressions, sequences of 2 to 4 numbers, or arrays (..., 2 to 4) of them"


_EXAMPLES = {
    "sin": "0) | 0.0",
    "cos": "0) | 1.0",
    "tan": "0) | 0.0",
    "asin": "0) | 0.0",
    "acos": "1) | 0.0",
    "atan": "0) | 0.0",
    "atan2": "0, 1) | 0.0",
    "sinh": "0) | 0.0",
    "cosh": "0) | 1.0",
    "tanh": "0) | 0.0",
    "exp": "0) | 1.0",
    "exp2": "3) | 8.0",
    "log": "1) | 0.0",
    "log2": "8) | 3.0",
    "sqrt": "9) | 3.0",
    "abs": "-2) | 2.0",
    "sign": "-2) | -1.0",
    "floor": "-1.5) | -2.0",
    "ceil": "-1.5) | -1.0",
    "fract": "-0.25) | 0.75",
    "mod": "-1, 4) | 3.0",
    "pow": "2, 3) | 8.0",
    "min": "3, 1, 2) | 1.0",
    "max": "3, 1, 2) | 3.0",
    "clamp": "3, 0, 1) | 1.0",
    "mix": "2, 4, 0.5) | 3.0",
    "step": "1, [0, 2]) | array([0., 1.])",
    "smoothstep": "0, 1, 0.5) | 0.5",
    "length": "(3, 4)) | 5.0",
    "distance": "(0, 0), (3, 4)) | 5.0",
    "dot": "(1, 2, 3), (4, 5, 6)) | 32.0",
    "cross_product": "(1, 0, 0), (0, 1, 0)) | array([0., 0., 1.])",
    "normalize": "(0, 0, 2)) | array([0., 0., 1.])",
}
"""What a call of each function gives, for its help text."""


def _documented(call: Callable[P, Any], name: str, first: str, kinds: str) -> Callable[P, Any]:
    """The function with a help text in sections."""
    names = ", ".join(inspect.signature(call).parameters)
    given, _, found = _EXAMPLES.get(name, "").partition(" | ")
    shown = f"\n\nExamples\n--------\n>>> rm.{name}({given}\n{found}" if given else ""
    call.__doc__ = f"{first}\n\n{_SECTIONS.format(names, kinds)}{shown}"
    return call


def _componentwise(function: Callable[P, Expr]) -> Callable[P, Any]:
    """A function of numbers."""
    name = function.__name__
    call = _of_arrays(function, name, "numbers, arrays of them, or expressions", False)
    return _documented(call, name, function.__doc__ or "", _NUMBERS)


def of_vectors(function: Callable[P, Expr], called: str = "") -> Callable[P, Any]:
    """A function of vectors of 2 to 4 numbers, for expressions and for arrays. called : its name in messages."""
    name = called or function.__name__
    call = _of_arrays(function, name, "vectors of 2 to 4 numbers, arrays of them, or expressions", True)
    return _documented(call, name, function.__doc__ or "", _VECTORS)


sin = _componentwise(v.sin)
cos = _componentwise(v.cos)
tan = _componentwise(v.tan)
asin = _componentwise(v.asin)
acos = _componentwise(v.acos)
atan = _componentwise(v.atan)
atan2 = _componentwise(v.atan2)
sinh = _componentwise(v.sinh)
cosh = _componentwise(v.cosh)
tanh = _componentwise(v.tanh)
exp = _componentwise(v.exp)
exp2 = _componentwise(v.exp2)
log = _componentwise(v.log)
log2 = _componentwise(v.log2)
sqrt = _componentwise(v.sqrt)
abs = _componentwise(v.abs)
sign = _componentwise(v.sign)
floor = _componentwise(v.floor)
ceil = _componentwise(v.ceil)
fract = _componentwise(v.fract)
mod = _componentwise(v.mod)
pow = _componentwise(v.pow)
min = _componentwise(v.min)
max = _componentwise(v.max)
clamp = _componentwise(v.clamp)
mix = _componentwise(v.mix)
step = _componentwise(v.step)
smoothstep = _componentwise(v.smoothstep)
length = of_vectors(v.length)
distance = of_vectors(v.distance)
dot = of_vectors(v.dot)
cross_product = of_vectors(v.cross, "cross_product")
normalize = of_vectors(v.normalize)
vec2, vec3, vec4 = checked(v.vec2), checked(v.vec3), checked(v.vec4)


@checked
def where(condition: Any, a: Operand, b: Operand) -> Any:
    """a where the condition holds, else b. Of an expression both are computed.

    Parameters
    ----------
    condition : a comparison such as `rm.time < 1`; or True, False or an array of them, with numbers or arrays.
    a, b : expressions, numbers or arrays, of one type.

    Returns
    -------
    Expr, float or array

    Raises
    ------
    SceneError : other arguments, or arrays that do not fit each other.

    Examples
    --------
    >>> rm.where(True, 1, 2)
    1.0
    """
    if (read := _map_among((condition, a, b))) is not None:
        return read.computed(v.where, condition, a, b)
    if isinstance(condition, Expr):
        return v.where(condition, a, b)
    if not isinstance(condition, bool | np.bool_) and not (
        isinstance(condition, np.ndarray) and condition.dtype == np.bool_
    ):
        raise SceneError(f"where needs a condition, not {short(condition)}", legal="a comparison such as a < b")
    if _holds_expression(a) or _holds_expression(b):
        if isinstance(condition, np.ndarray):
            raise SceneError("where of an array and an expression", legal="a condition that is an expression")
        return expr(a if condition else b)
    legal = "numbers, arrays or expressions"
    values = [linear_color("where: argument", given, legal) for given in (a, b)]
    chosen = [numbers("where: argument", given, legal) for given in values]
    try:
        return _number(np.where(condition, *chosen))
    except ValueError:
        raise SceneError("where of shapes that do not fit", legal=BROADCAST) from None


@called_by_expressions
def power(x: Operand, y: Operand) -> Expr:
    """x ** y of an expression. A whole constant power multiplies, so x may be negative; others are those of `pow`."""
    base, exponent = expr(x), expr(y)
    n = float(exponent.data) if exponent.is_constant and exponent.type is FLOAT else math.nan
    if n == 0.5:
        return v.sqrt(base)
    if n != round(n) if math.isfinite(n) else True:
        return v.pow(base, exponent)
    if builtins.abs(n) > 64:
        even = v.pow(v.abs(base), exponent)
        return even if n % 2 == 0 else v.sign(base) * even
    result: Expr | None = None
    factor, left = base, builtins.abs(int(n))
    while left:
        if left & 1:
            result = factor if result is None else result * factor
        left >>= 1
        factor = factor * factor if left else factor
    if result is None:
        return expr(1.0) if base.type is FLOAT else construct(*[1.0] * base.type.size)
    return result if n > 0 else 1.0 / result


_OPERATORS: dict[str, Callable[[Any, Any], Any]] = {
    "add": operator.add,
    "subtract": operator.sub,
    "multiply": operator.mul,
    "matmul": operator.mul,
    "divide": operator.truediv,
    "true_divide": operator.truediv,
    "floor_divide": operator.floordiv,
    "less": operator.lt,
    "less_equal": operator.le,
    "greater": operator.gt,
    "greater_equal": operator.ge,
}


def _operated(made: Callable[[Any, Any], Any], a: Operand, b: Operand) -> Any:
    """An operator of Python, with an expression on the left."""
    return made(expr(a), b)


UFUNCS: dict[str, Callable[..., Any]] = {
    "negative": lambda x: -expr(x),
    "positive": expr,
    **{name: getattr(v, name) for name in "sin cos tan sinh cosh tanh exp exp2 log log2 sqrt sign floor ceil".split()},
    "arcsin": v.asin,
    "arccos": v.acos,
    "arctan": v.atan,
    "arctan2": v.atan2,
    "rint": v.round,
    "asin": v.asin,
    "acos": v.acos,
    "atan": v.atan,
    "atan2": v.atan2,
    "log10": lambda x: v.log(x) / math.log(10.0),
    "absolute": v.abs,
    "abs": v.abs,
    "fabs": v.abs,
    "square": v.square,
    "reciprocal": lambda x: 1.0 / expr(x),
    "minimum": v.min,
    "fmin": v.min,
    "maximum": v.max,
    "fmax": v.max,
    "clip": v.clamp,
    "power": power,
    "pow": power,
    "float_power": power,
    "remainder": v.mod,
    "mod": v.mod,
    **{name: partial(_operated, made) for name, made in _OPERATORS.items()},
    "logical_and": lambda a, b: a & b,
    "logical_or": lambda a, b: a | b,
    "logical_not": lambda a: ~a,
    "equal": lambda a, b: a is b,
    "not_equal": lambda a, b: a is not b,
    "hypot": lambda x, y: v.length(v.vec2(x, y)),
    "cbrt": lambda x: v.sign(x) * v.pow(v.abs(x), 1.0 / 3.0),
    "deg2rad": lambda x: expr(x) * (math.pi / 180.0),
    "radians": lambda x: expr(x) * (math.pi / 180.0),
    "rad2deg": lambda x: expr(x) * (180.0 / math.pi),
    "degrees": lambda x: expr(x) * (180.0 / math.pi),
    "trunc": lambda x: v.sign(x) * v.floor(v.abs(x)),
}
"""NumPy's universal functions of expressions, by their names."""


@called_by_expressions
def universal(name: str, method: str, inputs: tuple[Any, ...], options: dict[str, Any]) -> Any:
    """The value of a universal function of NumPy, called with an expression."""
    if method != "__call__" or name not in UFUNCS or any(value is not None for value in options.values()):
        call = f"numpy.{name}" if method == "__call__" else f"numpy.{name}.{method}"
        legal = "raymarch's own functions, such as rm.sin, or one of numpy." + ", ".join(sorted(UFUNCS))
        raise SceneError(f"{call} of an expression{' with options' if options else ''}", legal=legal)
    return UFUNCS[name](*inputs)
