"""The GLSL reading: functions of the expression language as readable GLSL.

One text serves `#version 330 core` and `#version 300 es`. A value gets a temporary only if it is used twice, or if the
nesting would be too deep. Temporaries have the names that the function states, or one for their type.
"""

from __future__ import annotations

import math
import re
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import count
from types import MappingProxyType
from typing import NamedTuple, TypeAlias

import numpy as np

from raymarch.errors import SceneError
from raymarch.expr import hashing
from raymarch.expr.atlas import Place
from raymarch.expr.function import Function, Loop
from raymarch.expr.node import Expr, const, make, simplify, var
from raymarch.expr.raw import RawFunction, slope_text
from raymarch.expr.samples import Samples
from raymarch.expr.samples import glsl_helper as samples_helper
from raymarch.expr.tables import Table
from raymarch.expr.tables import glsl_helper as table_helper
from raymarch.expr.texels import Texels
from raymarch.expr.textures import atlas_helper, glsl_helper, helper_of
from raymarch.expr.types import BOOL, FLOAT, STATE, Type
from raymarch.expr.walk import depends_on, find, inner_order, substitute, topological

WIDTH = 118
DEPTH = 16

TURNS = 256
"""Printed bound of loops that compilers must not unroll. They end by a comparison of floats, which compilers do not
count."""

UNIFORM_PREFIX = "u_"
TIME = "u_time"

_LARGEST = float(np.finfo(np.float32).max)


class Line(NamedTuple):
    """A line of GLSL and the expression that it computes, if any."""

    text: str
    source: Expr | None


class Form(NamedTuple):
    """How a text may be broken over lines: a "call", "infix", "choice", "prefix" or "suffix", and its symbol."""

    kind: str
    head: str
    parts: tuple[Piece, ...]
    sources: tuple[Expr | None, ...]


class Piece(NamedTuple):
    """Text of a subexpression, its precedence, and its parts if it may be broken over lines."""

    text: str
    binding: int
    depth: int
    form: Form | None = None


ATOM, POSTFIX, UNARY, TIMES, PLUS, ORDER, AND, OR, CHOICE = range(9)

Template: TypeAlias = Callable[["FunctionPrinter", Expr, Sequence[Piece]], Piece]


def literal(number: float) -> str:
    """A finite float32 literal with a decimal point, the shortest one without loss of a bit."""
    if not np.isfinite(number) or abs(number) > _LARGEST:
        raise SceneError(f"{number} cannot be written in GLSL", legal="finite numbers up to 3.4e38")
    return _digits(float(number), math.copysign(1.0, number))


@lru_cache(4096)
def _digits(number: float, _sign: float) -> str:
    """The literal; the sign tells 0.0 from -0.0."""
    digits, _, exponent = repr(float(str(np.float32(number)))).partition("e")
    if exponent:
        return f"{digits if '.' in digits else digits + '.0'}e{int(exponent)}"
    return digits


def constant(node: Expr) -> str:
    """A constant of any type."""
    if node.type is BOOL:
        return "true" if bool(node.data) else "false"
    if node.type is FLOAT:
        return literal(float(node.data))
    numbers = np.asarray(node.data).T.ravel()  # GLSL lists a matrix by columns
    if node.type.is_vector and np.all(numbers == numbers[0]):
        numbers = numbers[:1]
    return f"{node.type}({', '.join(literal(float(x)) for x in numbers)})"


# Templates


def wrap(piece: Piece, binding: int) -> Piece:
    """The piece, in parentheses if it binds more loosely."""
    if piece.binding <= binding:
        return piece
    return Piece(f"({piece.text})", ATOM, piece.depth, Form("call", "", (piece,), (None,)))


def _depth(pieces: Sequence[Piece]) -> int:
    return 1 + max((p.depth for p in pieces), default=0)


def call_text(name: str, pieces: Sequence[Piece], sources: Sequence[Expr]) -> Piece:
    text = f"{name}({', '.join(p.text for p in pieces)})"
    return Piece(text, ATOM, _depth(pieces), Form("call", name, tuple(pieces), tuple(sources)))


def _call(name: str, *scalars: int) -> Template:
    """A built-in function of vectors of one size. The arguments at the positions in `scalars` may all be scalars."""

    def template(printer: FunctionPrinter, node: Expr, pieces: Sequence[Piece]) -> Piece:
        kept = scalars if all(node.args[i].type is FLOAT for i in scalars) else ()
        pairs = enumerate(zip(pieces, node.args, strict=True))
        return call_text(name, [p if i in kept else _stretched(p, a, node.type) for i, (p, a) in pairs], node.args)

    return template


def _stretched(piece: Piece, arg: Expr, wanted: Type) -> Piece:
    if arg.type is wanted or not wanted.is_vector or arg.type is not FLOAT:
        return piece
    return call_text(wanted.name, [piece], [arg])


def _commutative(name: str) -> Template:
    """min and max: GLSL takes a scalar in second place only."""

    def template(printer: FunctionPrinter, node: Expr, pieces: Sequence[Piece]) -> Piece:
        order = (1, 0) if node.args[0].type is FLOAT and node.type is not FLOAT else (0, 1)
        return call_text(name, [pieces[i] for i in order], [node.args[i] for i in order])

    return template


def _joined(symbol: str, binding: int, parts: tuple[Piece, Piece], depth: int, sources: tuple[Expr, ...]) -> Piece:
    text = f"{parts[0].text} {symbol} {parts[1].text}"
    return Piece(text, binding, depth, Form("infix", symbol, parts, sources))


def _infix(symbol: str, binding: int) -> Template:
    """A binary operator, left-associative: an equally loose right operand needs parentheses."""

    def template(printer: FunctionPrinter, node: Expr, pieces: Sequence[Piece]) -> Piece:
        parts = (wrap(pieces[0], binding), wrap(pieces[1], binding - 1))
        return _joined(symbol, binding, parts, _depth(pieces), node.args)

    return template


def _order(symbol: str, mirrored: str) -> Template:
    """A comparison; a constant is printed on the right."""

    def template(printer: FunctionPrinter, node: Expr, pieces: Sequence[Piece]) -> Piece:
        left, right = (wrap(p, PLUS) for p in pieces)
        if node.args[0].is_constant:
            return _joined(mirrored, ORDER, (right, left), _depth(pieces), node.args[::-1])
        return _joined(symbol, ORDER, (left, right), _depth(pieces), node.args)

    return template


def _prefix(symbol: str) -> Template:
    def template(printer: FunctionPrinter, node: Expr, pieces: Sequence[Piece]) -> Piece:
        product = symbol == "-" and pieces[0].binding == TIMES  # -a * b is -(a * b)
        inner = wrap(pieces[0], ATOM if pieces[0].text.startswith(symbol) else TIMES if product else POSTFIX)
        binding = max(inner.binding, UNARY)
        return Piece(symbol + inner.text, binding, _depth(pieces), Form("prefix", symbol, (inner,), node.args))

    return template


def _guarded(name: str, least: str, is_safe: Callable[[Expr], bool]) -> Template:
    """A built-in function whose first argument is at least a number, unless it is proved to be."""

    def template(printer: FunctionPrinter, node: Expr, pieces: Sequence[Piece]) -> Piece:
        first, arg = pieces[0], node.args[0]
        if not is_safe(arg):
            first = call_text("max", [first, Piece(least, ATOM, 0)], [arg, arg])
        rest = [_stretched(p, a, node.type) for p, a in zip(pieces[1:], node.args[1:], strict=True)]
        return call_text(name, [_stretched(first, arg, node.type), *rest], node.args)

    return template


def is_nonnegative(e: Expr, depth: int = 4) -> bool:
    """True if the structure of the expression, to some depth, proves that no component is negative."""
    if depth == 0:
        return False

    def shown(arg: Expr) -> bool:
        return is_nonnegative(arg, depth - 1)

    match e.op:
        case "const":
            return e.type is not BOOL and bool(np.all(e.data >= 0))
        case "abs" | "length" | "exp" | "exp2" | "sqrt" | "pow" | "step" | "fract":
            return True
        case "mul" | "dot":
            return e.args[0] is e.args[1] or (e.op == "mul" and all(map(shown, e.args)))
        case "add" | "min":
            return all(map(shown, e.args))
        case "max":
            return any(map(shown, e.args))
        case "clamp":
            return all(map(shown, e.args[1:]))
        case "within":
            return is_nonnegative(e.args[0], depth)
        case "param":
            return e.data.min is not None and bool(np.all(np.asarray(e.data.min) >= 0))
    return False


def _positive_constant(e: Expr) -> bool:
    return e.op == "const" and e.type is not BOOL and bool(np.all(e.data > 0))


def _unit(printer: FunctionPrinter, node: Expr, pieces: Sequence[Piece]) -> Piece:
    """`normalize`, which GLSL leaves undefined for the zero vector."""
    of = node.type
    printer.helpers["unit", of.name] = f"{of} unit({of} v) {{\n    return v / max(length(v), 1.0842022e-19);\n}}"
    return call_text("unit", pieces, node.args)


# GLSL does not specify the accuracy of inverse trigonometric functions. On Mesa the built-in asin and acos have errors
# up to 4e-4, which is visible once multiplied by the power of a fractal or a radius. These polynomials are minimax fits
# (Lawson's iteration): asin(s)/s on s <= 1/2 to 5e-9, atan(t)/t on t <= 1 to 1.5e-8.

_HALF_ARC_SINE = """    float a = min(abs(x), 1.0);
    bool wide = a > 0.5;
    float z = wide ? 0.5 - 0.5 * a : a * a;
    float s = wide ? sqrt(z) : a;
    float r = s + s * z * (0.16666754 + z * (0.07495242 + z * (0.0454771 + z * (0.02414759 + z * 0.04221859))));
"""

_ARC_SINE = f"""float arc_sine(float x) {{
{_HALF_ARC_SINE}    float acute = wide ? 1.5707964 - 2.0 * r : r;
    return x < 0.0 ? -acute : acute;
}}"""

_ARC_COSINE = f"""float arc_cosine(float x) {{
{_HALF_ARC_SINE}    float acute = wide ? 2.0 * r : 1.5707964 - r;
    return x < 0.0 ? 3.1415927 - acute : acute;
}}"""

_ATAN2 = """float atan2(float y, float x) {
    float u = abs(x), v = abs(y);
    float t = min(u, v) / max(max(u, v), 1.1754944e-38);
    float z = t * t;
    float high = -0.07580577 + z * (0.04355352 + z * (-0.01658117 + z * 0.00297459));
    float r = t + t * z * (-0.33333167 + z * (0.19994137 + z * (-0.14214209 + z * (0.1067894 + z * high))));
    r = v > u ? 1.5707964 - r : r;
    r = x < 0.0 ? 3.1415927 - r : r;
    return y < 0.0 ? -r : r;
}"""


def _own(name: str, text: str) -> Template:
    """A scalar helper; vectors call it by component."""

    def template(printer: FunctionPrinter, node: Expr, pieces: Sequence[Piece]) -> Piece:
        printer.helpers[name, "float"] = text
        if node.type is not FLOAT:
            inputs = "yx"[: len(pieces)]
            parts = [f"{name}({', '.join(f'{i}.{c}' for i in inputs)})" for c in "xyzw"[: node.type.size]]
            head = f"{node.type} {name}({', '.join(f'{node.type} {i}' for i in inputs)})"
            printer.helpers[name, node.type.name] = f"{head} {{\n    return {node.type}({', '.join(parts)});\n}}"
        return call_text(name, [_stretched(p, a, node.type) for p, a in zip(pieces, node.args, strict=True)], node.args)

    return template


_atan2 = _own("atan2", _ATAN2)


def _atan(printer: FunctionPrinter, node: Expr, pieces: Sequence[Piece]) -> Piece:
    """The angle of (1, x)."""
    one = const(1.0 if node.type is FLOAT else [1.0] * node.type.size)
    return _atan2(printer, make("atan2", node.type, (node.args[0], one)), [*pieces, Piece(constant(one), ATOM, 0)])


def _swizzle(printer: FunctionPrinter, node: Expr, pieces: Sequence[Piece]) -> Piece:
    inner = wrap(pieces[0], POSTFIX)
    form = Form("suffix", f".{node.data}", (inner,), node.args)
    return Piece(f"{inner.text}.{node.data}", POSTFIX, pieces[0].depth, form)


def _neighbours_joined(node: Expr, pieces: Sequence[Piece]) -> tuple[list[Piece], list[Expr]]:
    """The arguments of a constructor, with components of one vector that stand side by side as one: `v.xy`."""
    joined: list[Piece] = []
    sources: list[Expr] = []
    for arg, piece in zip(node.args, pieces, strict=True):
        last = sources[-1] if sources else None
        if (
            last is not None
            and arg.op == last.op == "swizzle"
            and arg.args[0] is last.args[0]
            and piece.text.endswith(f".{arg.data}")
        ):
            vector = last.args[0]
            picked = joined[-1].text.rpartition(".")[2] + arg.data
            base = joined[-1].text.rpartition(".")[0]
            whole = picked == "xyzw"[: vector.type.size]
            joined[-1] = Piece(base if whole else f"{base}.{picked}", POSTFIX, piece.depth)
        else:
            joined.append(piece)
            sources.append(arg)
    return joined, sources


def _construct(printer: FunctionPrinter, node: Expr, pieces: Sequence[Piece]) -> Piece:
    if all(a is node.args[0] for a in node.args) and node.args[0].type is FLOAT:
        return call_text(node.type.name, pieces[:1], node.args[:1])
    joined, sources = _neighbours_joined(node, pieces)
    if len(joined) == 1 and sources[0].op == "swizzle":
        return joined[0]
    return call_text(node.type.name, joined, sources)


_CHOSEN = """TYPE chosen(bool condition, TYPE yes, TYPE no) {
    if (condition) return yes;
    return no;
}"""
"""In place of `?:` for structures, which WebGL refuses."""


def _where(printer: FunctionPrinter, node: Expr, pieces: Sequence[Piece]) -> Piece:
    if node.type.fields and printer.text.for_web:
        printer.helpers["chosen", node.type.name] = _CHOSEN.replace("TYPE", node.type.name)
        return call_text("chosen", pieces, node.args)
    condition, yes, no = parts = tuple(wrap(p, b) for p, b in zip(pieces, (OR, OR, CHOICE), strict=True))
    text = f"{condition.text} ? {yes.text} : {no.text}"
    return Piece(text, CHOICE, _depth(pieces), Form("choice", "", parts, node.args))


def _floor_of_half(printer: FunctionPrinter, node: Expr, pieces: Sequence[Piece]) -> Piece:
    return Piece(f"floor({wrap(pieces[0], PLUS).text} + 0.5)", ATOM, _depth(pieces))


def _sample(component: str) -> Template:
    """Interpolated data: value or gradient; one helper computes both."""

    def template(printer: FunctionPrinter, node: Expr, pieces: Sequence[Piece]) -> Piece:
        dimension = node.data.dimension
        constant = node.data.name in printer.text.constants
        printer.helpers["interpolated", f"{dimension} {constant}"] = samples_helper(dimension, constant)
        printer.text.samples[node.data.name] = node.data
        call = call_text("interpolated", [Piece(node.data.name, ATOM, 0), *pieces], [node, *node.args])
        picked = "xyzw"[dimension] if component == "value" else "xyz"[:dimension]
        return Piece(f"{call.text}.{picked}", POSTFIX, call.depth)

    return template


def _texture(printer: FunctionPrinter, node: Expr, pieces: Sequence[Piece]) -> Piece:
    """Mean of a texture over an ellipse."""
    place = printer.text.places.get(node.data.name)
    if place is None:
        name, given, data = helper_of(node.data), node.data.name, node.data
        printer.helpers[name, ""] = glsl_helper(node.data)
    else:
        name, given, data = "filtered_in_atlas", place.arguments, place.atlas
        printer.helpers[name, ""] = atlas_helper()
    printer.text.samples[data.name] = data
    call = call_text(name, [Piece(given, ATOM, 0), *pieces], [node, *node.args])
    return Piece(f"{call.text}.{'xyz'[: node.data.channels]}", POSTFIX, call.depth)


def _fetch(printer: FunctionPrinter, node: Expr, pieces: Sequence[Piece]) -> Piece:
    """A texel of a table."""
    constant = node.data.name in printer.text.constants
    name, text = table_helper(node.data.channels, constant)
    printer.helpers[name, str(constant)] = text
    printer.text.samples[node.data.name] = node.data
    return call_text(name, [Piece(node.data.name, ATOM, 0), *pieces], [node, *node.args])


def _hash(printer: FunctionPrinter, node: Expr, pieces: Sequence[Piece]) -> Piece:
    for name, text in hashing.GLSL_HELPERS.items():
        printer.helpers[name, ""] = text
    return call_text("cell_hash", pieces, node.args)


def _raw(printer: FunctionPrinter, node: Expr, pieces: Sequence[Piece]) -> Piece:
    function: RawFunction = node.data
    printer.helpers[function.name, "raw"] = function.code
    if node.op == "raw":
        return call_text(function.name, pieces, node.args)
    printer.helpers[function.name, "slope"] = slope_text(function)
    return call_text(f"{function.name}_slope", pieces, node.args)


def _finite(printer: FunctionPrinter, node: Expr, pieces: Sequence[Piece]) -> Piece:
    """Test by the bits: compilers rewrite `not less` as `greater or equal`, which accepts NaN."""
    size = node.args[0].type.size
    if size == 1:
        text = "bool is_finite(float x) {\n    return (floatBitsToUint(x) & 0x7F800000u) != 0x7F800000u;\n}"
    else:
        text = f"bool is_finite(vec{size} v) {{\n    return all(lessThan(floatBitsToUint(v) & 0x7F800000u, "
        text += f"uvec{size}(0x7F800000u)));\n}}"
    printer.helpers["is_finite", node.args[0].type.name] = text
    return call_text("is_finite", pieces, node.args)


def _probe(printer: FunctionPrinter, node: Expr, pieces: Sequence[Piece]) -> Piece:
    """Pass value, point, cell and number of each node to the function `record_value` of the shader's probe."""
    if node.data.role != "value":
        return pieces[0]
    printer.text.needs.add("record_value")
    point = pieces[1] if node.args[1].type.size == 3 else Piece(f"vec3({pieces[1].text}, 0.0)", ATOM, 0)
    cell = pieces[2] if len(pieces) > 2 else Piece("0.0", ATOM, 0)
    number = Piece(str(node.data.site), ATOM, 0)
    return call_text("record_value", [pieces[0], point, cell, number], [*node.args[:2], node, node])


_OF_GLSL = "abs sign floor ceil fract exp exp2 sin cos tan sinh cosh tanh dot cross length transpose"
"""Operations that are functions of GLSL of the same name."""

TEMPLATES: Mapping[str, Template] = {
    **{op: _call(op) for op in _OF_GLSL.split()},
    "add": _infix("+", PLUS),
    "sub": _infix("-", PLUS),
    "mul": _infix("*", TIMES),
    "matmul": _infix("*", TIMES),
    "div": _infix("/", TIMES),
    "mod": _call("mod", 1),
    "neg": _prefix("-"),
    "round": _floor_of_half,
    "sqrt": _guarded("sqrt", "0.0", is_nonnegative),
    "log": _guarded("log", "1.1754944e-38", _positive_constant),
    "log2": _guarded("log2", "1.1754944e-38", _positive_constant),
    "pow": _guarded("pow", "1.1754944e-38", _positive_constant),
    "asin": _own("arc_sine", _ARC_SINE),
    "acos": _own("arc_cosine", _ARC_COSINE),
    "atan": _atan,
    "atan2": _atan2,
    "min": _commutative("min"),
    "max": _commutative("max"),
    "step": _call("step", 0),
    "clamp": _call("clamp", 1, 2),
    "mix": _call("mix", 2),
    "smoothstep": _call("smoothstep", 0, 1),
    "lt": _order("<", ">"),
    "le": _order("<=", ">="),
    "and": _infix("&&", AND),
    "or": _infix("||", OR),
    "not": _prefix("!"),
    "where": _where,
    "normalize": _unit,
    "swizzle": _swizzle,
    "field": _swizzle,
    "construct": _construct,
    "columns": _construct,
    "record": lambda _printer, node, pieces: call_text(node.type.name, pieces, node.args),
    "sample": _sample("value"),
    "sample_slope": _sample("slope"),
    "texture": _texture,
    "hash": _hash,
    "fetch": _fetch,
    "raw": _raw,
    "raw_slope": _raw,
    "finite": _finite,
    "probe": _probe,
    "within": lambda _printer, _node, pieces: pieces[0],
}

# Names

_WORDS = """
attribute const uniform varying buffer shared coherent volatile restrict readonly writeonly atomic_uint layout
centroid flat smooth noperspective patch sample break continue do for while switch case default if else subroutine
in out inout float double int void bool true false invariant precise discard return lowp mediump highp precision
struct common partition active asm class union enum typedef template this resource goto inline noinline public
static extern external interface long short half fixed unsigned superp input output filter cast namespace using
packed row_major column_major sizeof demote subpass
main texture textureLod textureSize texelFetch atan2 arc_sine arc_cosine unit radians degrees sin cos tan asin acos
atan sinh cosh tanh interpolated cell_hash pcg is_finite constant_number constant_numbers
filtered filtered_mirrored filtered_in_atlas atlas_level atlas_texel texel1 texel2 texel4
pow exp log exp2 log2 sqrt inversesqrt abs sign floor ceil trunc round fract mod modf min max clamp mix step
smoothstep isnan isinf length distance dot cross normalize reflect refract transpose inverse determinant any all
not lessThan greaterThan equal dFdx dFdy fwidth uint field asinh acosh atanh roundEven faceforward outerProduct
matrixCompMult lessThanEqual greaterThanEqual notEqual floatBitsToInt floatBitsToUint intBitsToFloat uintBitsToFloat
packSnorm2x16 unpackSnorm2x16 packUnorm2x16 unpackUnorm2x16 packHalf2x16 unpackHalf2x16
"""
RESERVED = frozenset(_WORDS.split())
_NUMBERED = re.compile(r"([iubdhf]?vec[234]|d?mat[234](x[234])?|noise[1-4])$")
_TYPE_LIKE = re.compile(rf"{_NUMBERED.pattern}|([iu]?(sampler|image)\w*|texture\w*)$")
_PREFIXES = ("gl_", "GL_", "webgl_")  # reserved by OpenGL, its macros, and browsers


def identifier(name: str, taken: Iterable[str], numbers: dict[str, int] | None = None) -> str:
    """A legal GLSL name close to the requested one that is not taken.

    `numbers` stores the last suffix of each name, so that thousands of equal requests stay fast.
    """
    clean = _legal(name)
    result, number = clean, (numbers or {}).get(clean, 2)
    while result in taken or result in RESERVED or _NUMBERED.match(result):
        result, number = f"{clean}{number}" if not clean[-1].isdigit() else f"{clean}_{number}", number + 1
    if numbers is not None:
        numbers[clean] = number
    return result


@lru_cache(1024)
def _legal(name: str) -> str:
    """A legal GLSL name close to the requested one."""
    clean = re.sub(r"_{2,}", "_", re.sub(r"\W", "_", name, flags=re.ASCII)).strip("_") or "value"
    if clean[0].isdigit():
        clean = f"n{clean}"
    if clean.startswith(_PREFIXES):
        clean = f"v{clean}"
    if clean in RESERVED or _TYPE_LIKE.match(clean):
        clean = f"{clean}_value"
    return clean


class Dialect:
    """How GLSL writes what languages of its kind write differently. Another language is a subclass.

    templates : the text of each operation.
    """

    templates: Mapping[str, Template] = TEMPLATES

    def constant(self, node: Expr) -> str:
        """A constant of any type."""
        return constant(node)

    def head(self, name: str, type: Type, params: Sequence[tuple[Type, str]]) -> str:
        """The first line of a function; its body ends with a closing brace."""
        return f"{type} {name}({', '.join(f'{of} {param}' for of, param in params)}) {{"

    def declare(self, type: Type, name: str, changes: bool = False) -> str:
        """The declaration of a variable, up to its value. changes : it is assigned later."""
        return f"{type} {name} = "

    def loop(self, counter: str, count: int) -> str:
        """The first line of a loop with an integer counter from 0."""
        return f"for (int {counter} = 0; {counter} < {count}; {counter}++) {{"

    def number(self, counter: str) -> str:
        """An integer as a float."""
        return f"float({counter})"

    leave: tuple[str, str] = ("if (", ") break;")
    """What stands around the condition under which a loop ends."""


@dataclass(slots=True)
class Text:
    """The functions of a field in order of definition, and their requirements."""

    names: dict[Function, str]
    functions: list[list[Line]]
    helpers: dict[tuple[str, str], str]
    uniforms: dict[str, Expr]
    uses_time: bool
    samples: dict[str, Samples | Texels | Table] = field(default_factory=dict)
    uniform_names: dict[Expr, str] = field(default_factory=dict)
    needs: set[str] = field(default_factory=set)
    """Functions that it calls and that the shader must define."""
    for_web: bool = False
    """True if browsers must take it, too: WebGL refuses `?:` for structures."""
    dialect: Dialect = field(default_factory=Dialect)
    constants: frozenset[str] = frozenset()
    """Names of the data that are in the constant array `constant_numbers`, in place of textures."""
    places: Mapping[str, Place] = field(default_factory=dict)
    """Pictures that are parts of an atlas, by name."""

    def lines(self) -> list[Line]:
        """Helpers and functions, with an empty line between them."""
        result: list[Line] = []
        for helper in self.helpers.values():
            result += [Line(text, None) for text in helper.split("\n")] + [Line("", None)]
        for lines in self.functions:
            result += [*lines, Line("", None)]
        return result[:-1]


def print_functions(
    roots: Sequence[Function],
    taken: Iterable[str] = (),
    for_web: bool = False,
    constants: frozenset[str] = frozenset(),
    dialect: Dialect | None = None,
    places: Mapping[str, Place] = MappingProxyType({}),
) -> Text:
    """GLSL of some functions and of all their callees, each once. for_web, constants, dialect, places : see `Text`."""
    order = _callees_first(roots)
    names: dict[Function, str] = {}
    expressions = [e for f in roots for e in f.inner]
    uniforms = _uniforms(expressions, frozenset(taken))
    occupied = {*taken, *uniforms, TIME, *_names_in_raw(expressions, {*taken, *uniforms, TIME})}
    numbers: dict[str, int] = {}
    for definition in [*roots, *order]:  # the roots keep their own names
        if definition not in names:
            wanted = definition.name
            names[definition] = wanted if definition in roots else identifier(wanted, occupied, numbers)
            occupied.add(names[definition])
    text = Text(names, [], {}, uniforms, bool(find(expressions, "time")), for_web=for_web, constants=constants)
    text.dialect, text.places = dialect or text.dialect, places
    text.uniform_names = {leaf: name for name, leaf in uniforms.items()}
    for definition in order:
        text.functions.append(FunctionPrinter(definition, text, occupied).run())
    return text


def _names_in_raw(expressions: Sequence[Expr], taken: set[str]) -> set[str]:
    """Names defined by raw GLSL functions; SceneError for duplicates."""
    givers: dict[str, RawFunction] = {}
    for node in find(expressions, "raw", "raw_slope"):
        function: RawFunction = node.data
        for name in function.defines:
            other = givers.setdefault(name, function)
            if name in taken or other.code != function.code:
                whose = "the shader" if name in taken else f"another GLSL function than {function.name}"
                raise SceneError(f"the GLSL name {name} is used by {whose}", legal="another name")
    return set(givers)


def _uniforms(expressions: Sequence[Expr], taken: frozenset[str]) -> dict[str, Expr]:
    """Parameters of some expressions, by GLSL name."""
    uniforms: dict[str, Expr] = {}
    for leaf in find(expressions, "param"):
        name = uniform_name(leaf, taken)
        other = uniforms.setdefault(name, leaf)
        if other is not leaf:
            what = f"the parameters '{other.data.name}' and '{leaf.data.name}' would both be {name} in GLSL"
            legal = "one Param, used twice, or names that differ in letters or digits"
            raise SceneError(what, legal=legal, where=leaf.data.where)
    return uniforms


def uniform_name(leaf: Expr, taken: frozenset[str] = frozenset()) -> str:
    """The GLSL name of a parameter, not among those taken, or of the time. GLSL has the letters of ASCII only."""
    if leaf.op == "time":
        return TIME
    name = "".join(c if c.isascii() else f"x{ord(c):x}" for c in leaf.data.name)
    return identifier(UNIFORM_PREFIX + name, taken | {TIME})


def _callees_first(roots: Sequence[Function]) -> list[Function]:
    order: dict[Function, None] = {}
    stack: list[tuple[Function, bool]] = [(root, False) for root in reversed(roots)]
    open_: set[Function] = set()
    while stack:
        definition, done = stack.pop()
        if done:
            order[definition] = None
        elif definition not in open_:
            open_.add(definition)
            stack.append((definition, True))
            callees = [call.data for call in _direct_calls(definition)]
            stack.extend((callee, False) for callee in reversed(callees))
    return list(order)


def _direct_calls(definition: Function) -> list[Expr]:
    calls: list[Expr] = []
    nodes = inner_order(definition)
    while nodes:
        calls += [n for n in nodes if n.op == "call"]
        nodes = topological([inner for n in nodes if n.op == "loop" for inner in n.data.inner])
    return calls


# Printing one function


@dataclass(slots=True)
class FunctionPrinter:
    """Prints one function: statements for shared values, one expression for the rest."""

    definition: Function
    text: Text
    taken_outside: set[str]
    lines: list[Line] = field(default_factory=list)
    names: dict[Expr, str] = field(default_factory=dict)
    taken: set[str] = field(default_factory=set)
    numbers: dict[str, int] = field(default_factory=dict)
    wanted: dict[Expr, str] = field(default_factory=dict)
    indent: int = 1

    @property
    def helpers(self) -> dict[tuple[str, str], str]:
        return self.text.helpers

    def run(self) -> list[Line]:
        self.taken = set(self.taken_outside)
        self.wanted = dict(self.definition.names)
        for param in self.definition.params:
            self.names[param] = self._name(param.data)
        params = [(p.type, self.names[p]) for p in self.definition.params]
        head = self.text.dialect.head(self.text.names[self.definition], self.definition.type, params)
        body = self.definition.body
        self.emit([body], lambda _i, piece: self._statement("return ", piece, ";", body))
        return [Line(head, body), *self.lines, Line("}", None)]

    def _name(self, wanted: str) -> str:
        name = identifier(wanted, self.taken, self.numbers)
        self.taken.add(name)
        return name

    def emit(self, roots: Sequence[Expr], finish: Callable[[int, Piece], None]) -> None:
        """Print statements for shared values, then call `finish(i, piece)` for each root in turn."""
        loops: dict[Expr, _OpenLoop] = {}
        uses: defaultdict[Expr, int] = defaultdict(int)
        for root in roots:
            uses[root] += 1

        def arguments(node: Expr) -> tuple[Expr, ...]:
            if node in self.names:
                return ()
            args = node.args
            if node.op == "loop":
                loops[node] = self._open(node)
                args = (*args[: len(node.data.state)], *loops[node].hoisted)
            for arg in args:
                uses[arg] += 1
            return args

        order = topological(roots, arguments)
        forced = {h for opened in loops.values() for h in opened.hoisted}
        pieces: dict[Expr, Piece] = {}
        waiting = list(enumerate(roots))
        final = set(roots)
        for node in order:
            if node.type is STATE:
                self._print_loop(node, loops[node], pieces)
                continue
            piece = self._piece(node, pieces)
            deep = piece.depth > DEPTH
            if (
                (deep or uses[node] > 1 or node in forced)
                and node not in self.names
                and not (uses[node] == 1 and node in final)  # a root that nothing else reads needs no temporary
                and (deep or not self._is_cheap(node))
            ):
                piece = self._temporary(node, piece)
            pieces[node] = piece
            while waiting and waiting[0][1] in pieces:
                i, root = waiting.pop(0)
                finish(i, pieces[root])

    def _is_cheap(self, node: Expr) -> bool:
        while node.op in ("swizzle", "field", "neg", "within") and node not in self.names:
            node = node.args[0]
        return node.op in ("const", "var", "param", "time", "item") or node in self.names

    def _piece(self, node: Expr, pieces: Mapping[Expr, Piece]) -> Piece:
        if node in self.names:
            return Piece(self.names[node], ATOM, 0)
        if node.op == "const":
            text = self.text.dialect.constant(node)
            return Piece(text, UNARY if text.startswith("-") else ATOM, 0)
        if node.op in ("param", "time"):
            return Piece(self.text.uniform_names.get(node) or uniform_name(node), ATOM, 0)
        if node.op == "var":  # a variable of the shader, or an element of an array
            self.text.needs.add(node.data.partition("[")[0])
            return Piece(node.data, ATOM, 0)
        args = [pieces[arg] for arg in node.args]
        if node.op == "call":
            return call_text(self.text.names[node.data], args, node.args)
        return self.text.dialect.templates[node.op](self, node, args)

    def _temporary(self, node: Expr, piece: Piece) -> Piece:
        name = self._name(self.wanted.get(_value_of(node)) or _default_name(node))
        self._statement(self.text.dialect.declare(node.type, name), piece, ";", node)
        self.names[node] = name
        return Piece(name, ATOM, 0)

    def _statement(self, before: str, piece: Piece, after: str, source: Expr | None) -> None:
        self.lines += _layout("    " * self.indent, before, piece, after, source)

    # Loops

    def _open(self, node: Expr) -> _OpenLoop:
        """The body of a loop over new variables, with the captured values substituted."""
        body: Loop = node.data
        n = len(body.state)
        serial = next(_serials)
        index = var(f"turn {serial}", FLOAT)
        state = tuple(var(f"state {serial} {k}", s.type) for k, s in enumerate(body.state))
        replacements = dict(
            zip((body.index, *body.state, *body.captured), (index, *state, *node.args[n:]), strict=True)
        )
        inner = substitute(body.inner, replacements)
        changing = depends_on(inner, (index, *state))
        hoisted: dict[Expr, None] = {}
        if body.is_branch:  # only captured values are computed outside
            changing = set(topological(inner))
            hoisted.update((a, None) for a in node.args[n:] if not self._is_cheap(a))
            changing -= hoisted.keys()
        for expression in topological(inner):
            if expression in changing:
                outer = [a for a in expression.args if a not in changing]
                hoisted.update((a, None) for a in outer if not self._is_cheap(a))
        hoisted.update((e, None) for e in inner if e not in changing and not self._is_cheap(e))
        for original, renamed in zip(body.state, state, strict=True):
            if original in self.wanted:
                self.wanted[renamed] = self.wanted[original]
        return _OpenLoop(index, state, inner[:n], inner[n] if body.until is not None else None, list(hoisted))

    def _print_loop(self, node: Expr, opened: _OpenLoop, pieces: Mapping[Expr, Piece]) -> None:
        for k, state in enumerate(opened.state):
            self.names[state] = self._name(self.wanted.get(state) or _default_name(state))
            declared = self.text.dialect.declare(state.type, self.names[state], changes=True)
            self._statement(declared, pieces[node.args[k]], ";", node)
            self.names[make("item", state.type, (node,), k)] = self.names[state]
        if node.data.is_branch:
            self._print_branch(node, opened)
            return
        counter = self._name("i")
        self.names[opened.index] = self.text.dialect.number(counter)
        most = node.data.count
        kept = node.data.kept and most < TURNS
        self.lines.append(Line("    " * self.indent + self.text.dialect.loop(counter, TURNS if kept else most), node))
        self.indent += 1
        if kept:
            before, after = self.text.dialect.leave
            over = f"{self.text.dialect.number(counter)} >= {literal(most)}"
            self.lines.append(Line("    " * self.indent + before + over + after, node))
        outside = dict(self.names)
        roots = ([opened.until] if opened.until is not None else []) + list(opened.step)
        news: list[Piece] = []

        def finish(i: int, piece: Piece) -> None:
            if i == 0 and opened.until is not None:
                before, after = self.text.dialect.leave
                self._statement(before, piece, after, node)
            else:
                news.append(piece)

        self.emit(roots, finish)
        self._close(opened, news, outside)

    def _print_branch(self, node: Expr, opened: _OpenLoop) -> None:
        """A loop of one turn that may end before it, as an `if`."""
        assert opened.until is not None
        self.names[opened.index] = "0.0"
        taken = simplify("not", BOOL, (opened.until,))
        self.emit([taken], lambda _i, piece: self._statement("if (", piece, ") {", node))
        self.indent += 1
        outside = dict(self.names)
        news: list[Piece] = []
        self.emit(opened.step, lambda _i, piece: news.append(piece))
        self._close(opened, news, outside)

    def _close(self, opened: _OpenLoop, news: list[Piece], outside: dict[Expr, str]) -> None:
        """Assign all state variables, each when no other value reads its old value, and end the block."""
        names = [self.names[state] for state in opened.state]
        todo = {k: p for k, p in enumerate(news) if p.text != names[k]}
        while todo:
            others = {k: [p.text for j, p in todo.items() if j != k] for k in todo}
            free = next((k for k in todo if not any(_mentions(text, names[k]) for text in others[k])), None)
            if free is not None:
                self._statement(f"{names[free]} = ", todo.pop(free), ";", opened.step[free])
                continue
            k = next(iter(todo))
            saved = self._name(f"next_{names[k]}")
            declared = self.text.dialect.declare(opened.state[k].type, saved)
            self._statement(declared, todo[k], ";", opened.step[k])
            todo[k] = Piece(saved, ATOM, 0)
        self.names = outside
        self.indent -= 1
        self.lines.append(Line("    " * self.indent + "}", None))


@dataclass(slots=True)
class _OpenLoop:
    index: Expr
    state: tuple[Expr, ...]
    step: Sequence[Expr]
    until: Expr | None
    hoisted: list[Expr]


_serials = count(1)
"""Numbers of loops that are printed, which make their variables distinct."""


def _mentions(text: str, name: str) -> bool:
    return re.search(rf"\b{re.escape(name)}\b", text) is not None


def _value_of(node: Expr) -> Expr:
    """The call of the function itself, for a call that returns its gradient too; any other expression as it is."""
    plain = node.data.derived.get("gradient of") if node.op == "call" else None
    return node if plain is None else make("call", plain.type, node.args, plain)


def _default_name(node: Expr) -> str:
    if node.type.fields:
        return node.type.name.lower()
    if node.type.is_matrix:
        return "m"
    if node.type.is_vector:
        return {2: "v", 3: "q", 4: "g"}[node.type.size]
    return "c" if node.type is BOOL else "d"


def _layout(indent: str, before: str, piece: Piece, after: str, source: Expr | None) -> list[Line]:
    """One line if it fits; otherwise one part per line where the text can be broken."""
    flat = f"{indent}{before}{piece.text}{after}"
    form = piece.form
    if len(flat) <= WIDTH or form is None:
        return [Line(flat, source)]
    inner, lines = indent + "    ", []
    if form.kind == "prefix" or (form.kind == "call" and len(form.parts) == 1):
        opened, closed = (f"{form.head}(", ")") if form.kind == "call" else (form.head, "")
        return _layout(indent, before + opened, form.parts[0], closed + after, source)
    if form.kind == "suffix":
        return _layout(indent, before, form.parts[0], form.head + after, source)
    if form.kind == "call":
        lines.append(Line(f"{indent}{before}{form.head}(", source))
        for i, (part, part_source) in enumerate(zip(form.parts, form.sources, strict=True)):
            lines += _layout(inner, "", part, f"){after}" if i == len(form.parts) - 1 else ",", part_source)
        return lines
    return [Line(text, source) for text in filled(flat, indent)]


def filled(text: str, indent: str) -> list[str]:
    """A line broken before operators and after commas: where few parentheses are open, then at the loosest operator."""
    lines = []
    while len(text) > WIDTH:
        opened, best = 0, None
        for match in _BREAKS.finditer(text, len(indent) + 8, WIDTH):
            if match[0] in "()":
                opened += 1 if match[0] == "(" else -1
                continue
            early = match.start() < WIDTH // 3
            key = (early, opened, _LOOSENESS.index(text[match.start() + 1]) if text[match.start() - 1] != "," else -1)
            if best is None or key <= best[0]:
                best = (key, match.start())
        if best is None:
            break
        lines.append(text[: best[1]])
        text = f"{indent}    {text[best[1] + 1 :]}"
    return [*lines, text]


_BREAKS = re.compile(r"[()]|(?<=,) | (?=[?:*/+-] |&& |\|\| |[<>]=? )")
"""Parentheses, and the spaces at which a line may be broken."""

_LOOSENESS = ":?|&<>+-*/"
"""First characters of operators, the loosest first."""
