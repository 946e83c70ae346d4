"""The functions of the expression language, with GLSL's names. All take expressions or numbers and return expressions.

Results that GLSL leaves undefined are defined: `sqrt` of a negative number is 0, the base of `pow` and the argument of
`log` are clamped to the smallest normal float32, `asin` and `acos` clamp to [-1, 1], `atan2(0, 0)` is 0 and
`normalize(0)` is 0.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial, reduce

import numpy as np

from raymarch.errors import SceneError
from raymarch.expr.node import Expr, Operand, construct, elementwise, expr, exprs, simplify
from raymarch.expr.types import BOOL, FLOAT, MATRICES, VEC3, Type

Vec = Operand


def _unary(op: str, doc: str | None = None) -> Callable[[Operand], Expr]:
    """A function of each component."""

    def function(x: Operand) -> Expr:
        return elementwise(op, x)

    function.__name__ = function.__qualname__ = op
    function.__doc__ = doc
    return function


sign = _unary("sign", "-1, 0 or 1.")
floor = _unary("floor", "The largest integer that is not above x.")
ceil = _unary("ceil", "The least integer that is not below x.")
round = _unary("round", "Nearest integer; halves round up, on every driver.")
fract = _unary("fract", "x - floor(x), in [0, 1).")
abs = _unary("abs", "|x|; Python's own abs() does the same.")
sqrt = _unary("sqrt", "Square root; 0 for negative x.")
exp = _unary("exp", "e to the power of x.")
exp2 = _unary("exp2", "2 to the power of x.")
log = _unary("log", "Natural logarithm of max(x, 1.1754944e-38).")
log2 = _unary("log2", "Logarithm to base 2 of max(x, 1.1754944e-38).")
sin = _unary("sin", "Sine of an angle in radians.")
cos = _unary("cos", "Cosine of an angle in radians.")
tan = _unary("tan", "Tangent of an angle in radians.")
asin = _unary("asin", "Arc sine of x clamped to [-1, 1].")
acos = _unary("acos", "Arc cosine of x clamped to [-1, 1].")
atan = _unary("atan", "Arc tangent in radians, from -pi/2 to pi/2.")
sinh = _unary("sinh", "Hyperbolic sine.")
cosh = _unary("cosh", "Hyperbolic cosine.")
tanh = _unary("tanh", "Hyperbolic tangent.")


def atan2(y: Operand, x: Operand) -> Expr:
    """Angle of (x, y), from -pi to pi; 0 at the origin."""
    return elementwise("atan2", y, x)


def pow(x: Operand, y: Operand) -> Expr:
    """max(x, 1.1754944e-38) to the power of y, so x**0 is 1 everywhere. For powers of signed numbers, multiply."""
    return elementwise("pow", x, y)


def square(x: Operand) -> Expr:
    value = expr(x)
    return value * value


def mod(x: Operand, y: Operand) -> Expr:
    """x - y * floor(x / y): the result has the sign of y."""
    return elementwise("mod", x, y)


def min(a: Operand, b: Operand, *more: Operand) -> Expr:
    """The least of two values or more."""
    return reduce(partial(elementwise, "min"), more, elementwise("min", a, b))


def max(a: Operand, b: Operand, *more: Operand) -> Expr:
    """The largest of two values or more."""
    return reduce(partial(elementwise, "max"), more, elementwise("max", a, b))


def clamp(x: Operand, low: Operand, high: Operand) -> Expr:
    """min(max(x, low), high)."""
    return elementwise("clamp", x, low, high)


def mix(a: Operand, b: Operand, t: Operand) -> Expr:
    """a (1 - t) + b t."""
    return elementwise("mix", a, b, t)


def step(edge: Operand, x: Operand) -> Expr:
    """0 where x < edge, else 1."""
    return elementwise("step", edge, x)


def smoothstep(low: Operand, high: Operand, x: Operand) -> Expr:
    """Hermite step from 0 at `low` to 1 at `high`; low < high."""
    first, last = expr(low), expr(high)
    if first is last or (first.is_constant and last.is_constant and not np.all(first.data < last.data)):
        raise SceneError(f"smoothstep with the edges {low!r} and {high!r}", legal="low < high")
    return elementwise("smoothstep", first, last, x)


def where(condition: Expr, a: Operand, b: Operand) -> Expr:
    """a where the condition holds, else b. Both are computed."""
    yes, no = exprs((a, b))
    if not isinstance(condition, Expr) or condition.type is not BOOL:
        raise SceneError(f"where needs a condition, not {condition!r}", legal="a comparison such as a < b")
    if yes.type is FLOAT and no.type.is_vector:
        yes = construct(*[yes] * no.type.size)
    if no.type is FLOAT and yes.type.is_vector:
        no = construct(*[no] * yes.type.size)
    if yes.type is not no.type:
        raise SceneError(f"where(condition, {yes.type}, {no.type})", legal="two values of one type")
    return simplify("where", yes.type, (condition, yes, no))


def record(type: Type, *values: Operand) -> Expr:
    """A value of a struct type, from its fields in order."""
    args = exprs(values)
    if [a.type for a in args] != [t for _, t in type.fields]:
        what = f"{type}({', '.join(a.type.name for a in args)})"
        raise SceneError(what, legal=", ".join(t.name for _, t in type.fields))
    return simplify("record", type, args)


def get(value: Expr, name: str) -> Expr:
    """A field of a struct, by name."""
    return simplify("field", dict(value.type.fields)[name], (value,), name)


def parts_of(value: Expr) -> list[Expr]:
    """The fields of a struct in order; any other value as it is."""
    return [part for name, _ in value.type.fields for part in parts_of(get(value, name))] or [value]


def finite(x: Operand) -> Expr:
    """True where no component is NaN or infinite."""
    return simplify("finite", BOOL, (expr(x),))


def _vectors(name: str, *values: Operand) -> tuple[Expr, ...]:
    args = exprs(values)
    if not args[0].type.is_vector or len({a.type for a in args}) > 1:
        raise SceneError(f"{name}({', '.join(a.type.name for a in args)})", legal="vectors of one size")
    return args


def dot(a: Vec, b: Vec) -> Expr:
    """The dot product of two vectors: the sum of the products of their components."""
    return simplify("dot", FLOAT, _vectors("dot", a, b))


def length(v: Vec) -> Expr:
    """Euclidean norm of a vector; |x| of a scalar."""
    value = expr(v)
    return elementwise("abs", value) if value.type is FLOAT else simplify("length", FLOAT, _vectors("length", value))


def distance(a: Vec, b: Vec) -> Expr:
    """The distance of two points, `length(a - b)`."""
    return length(expr(a) - b)


def normalize(v: Vec) -> Expr:
    """v / |v|; the zero vector stays zero. Vectors shorter than 1.1e-19 do not reach length 1."""
    args = _vectors("normalize", v)
    return simplify("normalize", args[0].type, args)


def cross(a: Vec, b: Vec) -> Expr:
    """The cross product of two vectors of 3 numbers: at right angles to both, by the right hand."""
    args = _vectors("cross", a, b)
    if args[0].type is not VEC3:
        raise SceneError(f"cross({args[0].type}, {args[1].type})", legal="two vec3")
    return simplify("cross", VEC3, args)


def vec2(*parts: Operand) -> Expr:
    """A vector of 2 components, as in GLSL.

    Parameters
    ----------
    parts : numbers, vectors or expressions with 2 components together, or one number for all.

    Returns
    -------
    Expr

    Raises
    ------
    SceneError : another number of components.
    """
    return _of_size(2, parts)


def vec3(*parts: Operand) -> Expr:
    """A vector of 3 components, as in GLSL.

    Parameters
    ----------
    parts : numbers, vectors or expressions with 3 components together, or one number for all.

    Returns
    -------
    Expr

    Raises
    ------
    SceneError : another number of components.
    """
    return _of_size(3, parts)


def vec4(*parts: Operand) -> Expr:
    """A vector of 4 components, as in GLSL.

    Parameters
    ----------
    parts : numbers, vectors or expressions with 4 components together, or one number for all.

    Returns
    -------
    Expr

    Raises
    ------
    SceneError : another number of components.
    """
    return _of_size(4, parts)


def _of_size(size: int, parts: tuple[Operand, ...]) -> Expr:
    value = construct(*(parts * size if len(parts) == 1 and expr(parts[0]).type is FLOAT else parts))
    if value.type.size != size:
        raise SceneError(f"vec{size} of {value.type.size} numbers", legal=f"{size} numbers in all")
    return value


def columns(*vectors: Operand) -> Expr:
    """The matrix with these columns, as in GLSL's mat2, mat3 and mat4 constructors."""
    args = _vectors("columns", *vectors)
    if len(args) != args[0].type.size:
        raise SceneError(f"a matrix of {len(args)} columns of {args[0].type}", legal="as many columns as rows")
    return simplify("columns", MATRICES[len(args)], args)


def transpose(m: Operand) -> Expr:
    value = expr(m)
    if not value.type.is_matrix:
        raise SceneError(f"transpose({value.type})", legal="a matrix")
    return simplify("transpose", value.type, (value,))


def rotation2(v: Operand, angle: Operand) -> Expr:
    """Rotate a vec2 by an angle in radians, counter-clockwise."""
    value, c, s = expr(v), cos(angle), sin(angle)
    return vec2(c * value.x - s * value.y, s * value.x + c * value.y)


def all_of(first: Expr, *conditions: Expr) -> Expr:
    """True where every condition holds."""
    for other in conditions:
        first = first & other
    return first


def stop_gradient(x: Operand) -> Expr:
    """x as a constant for derivatives, for a distance that is stationary in x: its derivative by x is 0."""
    value = expr(x)
    return value if value.is_constant else simplify("stop_gradient", value.type, (value,))
