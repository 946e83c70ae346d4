"""Pieces of GLSL text: names that are legal in each version of it and on each driver, constants, calls, and lines that
are broken where they are too long."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from functools import lru_cache
from operator import attrgetter
from typing import NamedTuple

import numpy as np

from raymarch.errors import SceneError
from raymarch.expr.node import Expr
from raymarch.expr.types import BOOL, FLOAT

WIDTH = 118
_LARGEST = float(np.finfo(np.float32).max)


class Line(NamedTuple):
    """A line of GLSL and the expression that it computes, if any."""

    text: str
    source: Expr | None


class Breaks(NamedTuple):
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
    form: Breaks | None = None


ATOM, POSTFIX, UNARY, TIMES, PLUS, ORDER, AND, OR, CHOICE = range(9)


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
    return f"{node.type.name}({', '.join(map(literal, numbers.tolist()))})"


def wrap(piece: Piece, binding: int) -> Piece:
    """The piece, in parentheses if it binds more loosely."""
    if piece.binding <= binding:
        return piece
    return Piece(f"({piece.text})", ATOM, piece.depth, Breaks("call", "", (piece,), (None,)))


_text, _depth = attrgetter("text"), attrgetter("depth")


def depth_of(pieces: Sequence[Piece]) -> int:
    """The nesting of a text that is made of some pieces."""
    return 1 + max(map(_depth, pieces), default=0)


def call_text(name: str, pieces: Sequence[Piece], sources: Sequence[Expr]) -> Piece:
    """A call of a function."""
    text = f"{name}({', '.join(map(_text, pieces))})"
    return Piece(text, ATOM, depth_of(pieces), Breaks("call", name, tuple(pieces), tuple(sources)))


def laid_out(indent: str, before: str, piece: Piece, after: str, source: Expr | None) -> list[Line]:
    """One line if it fits; otherwise one part per line where the text can be broken."""
    flat = f"{indent}{before}{piece.text}{after}"
    form = piece.form
    if len(flat) <= WIDTH or form is None:
        return [Line(flat, source)]
    inner, lines = indent + "    ", []
    if form.kind == "prefix" or (form.kind == "call" and len(form.parts) == 1):
        opened, closed = (f"{form.head}(", ")") if form.kind == "call" else (form.head, "")
        return laid_out(indent, before + opened, form.parts[0], closed + after, source)
    if form.kind == "suffix":
        return laid_out(indent, before, form.parts[0], form.head + after, source)
    if form.kind == "call":
        lines.append(Line(f"{indent}{before}{form.head}(", source))
        for i, (part, part_source) in enumerate(zip(form.parts, form.sources, strict=True)):
            lines += laid_out(inner, "", part, f"){after}" if i == len(form.parts) - 1 else ",", part_source)
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


# Names

_WORDS = """
attribute const uniform varying buffer shared coherent volatile restrict readonly writeonly atomic_uint layout
centroid flat smooth noperspective patch sample break continue do for while switch case default if else subroutine
in out inout float double int void bool true false invariant precise discard return lowp mediump highp precision
struct common partition active asm class union enum typedef template this resource goto inline noinline public
static extern external interface long short half fixed unsigned superp input output filter cast namespace using
packed row_major column_major sizeof demote subpass
main texture textureLod textureSize texelFetch atan2 arc_sine arc_cosine unit radians degrees sin cos tan asin acos
atan sinh cosh tanh interpolated cell_hash pcg is_finite constant_number
constant_numbers_0 constant_numbers_1 constant_numbers_2 constant_numbers_3
chosen filtered filtered_mirrored filtered_in_atlas atlas_level atlas_texel texel1 texel2 texel4
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
