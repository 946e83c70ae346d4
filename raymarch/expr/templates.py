"""The GLSL text of each operation of the expression language."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from raymarch.expr import hashing
from raymarch.expr.alike import Rows
from raymarch.expr.node import Expr, const, make
from raymarch.expr.pieces import (
    AND,
    ATOM,
    CHOICE,
    OR,
    ORDER,
    PLUS,
    POSTFIX,
    TIMES,
    UNARY,
    Breaks,
    Piece,
    call_text,
    constant,
    depth_of,
    wrap,
)
from raymarch.expr.raw import RawFunction, slope_text
from raymarch.expr.samples import glsl_helper as samples_helper
from raymarch.expr.tables import glsl_helper as table_helper
from raymarch.expr.textures import atlas_helper, glsl_helper, helper_of
from raymarch.expr.types import BOOL, FLOAT, Type

if TYPE_CHECKING:
    from raymarch.expr.glsl import FunctionPrinter

Template: TypeAlias = Callable[["FunctionPrinter", Expr, Sequence[Piece]], Piece]


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
    return Piece(text, binding, depth, Breaks("infix", symbol, parts, sources))


def _infix(symbol: str, binding: int) -> Template:
    """A binary operator, left-associative: an equally loose right operand needs parentheses."""

    def template(printer: FunctionPrinter, node: Expr, pieces: Sequence[Piece]) -> Piece:
        parts = (wrap(pieces[0], binding), wrap(pieces[1], binding - 1))
        return _joined(symbol, binding, parts, depth_of(pieces), node.args)

    return template


def _order(symbol: str, mirrored: str) -> Template:
    """A comparison; a constant is printed on the right."""

    def template(printer: FunctionPrinter, node: Expr, pieces: Sequence[Piece]) -> Piece:
        left, right = wrap(pieces[0], PLUS), wrap(pieces[1], PLUS)
        if node.args[0].is_constant:
            return _joined(mirrored, ORDER, (right, left), depth_of(pieces), node.args[::-1])
        return _joined(symbol, ORDER, (left, right), depth_of(pieces), node.args)

    return template


def _prefix(symbol: str) -> Template:
    def template(printer: FunctionPrinter, node: Expr, pieces: Sequence[Piece]) -> Piece:
        product = symbol == "-" and pieces[0].binding == TIMES  # -a * b is -(a * b)
        inner = wrap(pieces[0], ATOM if pieces[0].text.startswith(symbol) else TIMES if product else POSTFIX)
        binding = max(inner.binding, UNARY)
        return Piece(symbol + inner.text, binding, depth_of(pieces), Breaks("prefix", symbol, (inner,), node.args))

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
        case "within" | "stop_gradient":
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
    form = Breaks("suffix", f".{node.data}", (inner,), node.args)
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
    if node.args.count(node.args[0]) == len(node.args) and node.args[0].type is FLOAT:
        return call_text(node.type.name, pieces[:1], node.args[:1])
    if node.type.is_matrix:
        return call_text(node.type.name, pieces, node.args)
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
    condition, yes, no = parts = (wrap(pieces[0], OR), wrap(pieces[1], OR), wrap(pieces[2], CHOICE))
    text = f"{condition.text} ? {yes.text} : {no.text}"
    return Piece(text, CHOICE, depth_of(pieces), Breaks("choice", "", parts, node.args))


def _floor_of_half(printer: FunctionPrinter, node: Expr, pieces: Sequence[Piece]) -> Piece:
    return Piece(f"floor({wrap(pieces[0], PLUS).text} + 0.5)", ATOM, depth_of(pieces))


def _sample(component: str) -> Template:
    """Interpolated data: value, gradient or bend; one helper computes all."""

    def template(printer: FunctionPrinter, node: Expr, pieces: Sequence[Piece]) -> Piece:
        dimension = node.data.dimension
        constant = node.data.name in printer.text.constants
        printer.helpers["interpolated", f"{dimension} {constant}"] = samples_helper(dimension, constant)
        printer.text.samples[node.data.name] = node.data
        call = call_text("interpolated", [Piece(node.data.name, ATOM, 0), *pieces], [node, *node.args])
        picked = {"value": "w", "bend": "z", "slope": "xyz"[:dimension]}[component]
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


def _texture_in_atlas(printer: FunctionPrinter, node: Expr, pieces: Sequence[Piece]) -> Piece:
    """The same of a chosen picture of an atlas."""
    printer.helpers["filtered_in_atlas", ""] = atlas_helper()
    printer.text.samples[node.data.name] = node.data
    place, kind, *rest = pieces
    whole = [call_text("ivec4", [place], node.args[:1]), call_text("ivec2", [kind], node.args[1:2])]
    call = call_text("filtered_in_atlas", [Piece(node.data.name, ATOM, 0), *whole, *rest], [node, *node.args])
    return Piece(f"{call.text}.{'xyz'[: node.data.channels]}", POSTFIX, call.depth)


def _fetch(printer: FunctionPrinter, node: Expr, pieces: Sequence[Piece]) -> Piece:
    """A texel of a table, or of an array of constants."""
    if isinstance(node.data, Rows):
        printer.helpers[node.data.name, ""] = node.data.declaration
        counter = pieces[0].text.removeprefix("float(").removesuffix(")")
        number = counter if counter.isidentifier() and counter != pieces[0].text else f"int({pieces[0].text})"
        return Piece(f"{node.data.name}[{number}]", POSTFIX, 0)
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
    "sample_bend": _sample("bend"),
    "texture": _texture,
    "texture_in_atlas": _texture_in_atlas,
    "hash": _hash,
    "fetch": _fetch,
    "raw": _raw,
    "raw_slope": _raw,
    "finite": _finite,
    "probe": _probe,
    "within": lambda _printer, _node, pieces: pieces[0],
    "stop_gradient": lambda _printer, _node, pieces: pieces[0],
}
