"""Pieces of GLSL text: constants, calls, and lines that are broken where they are too long."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from functools import lru_cache
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
    return f"{node.type}({', '.join(literal(float(x)) for x in numbers)})"


def wrap(piece: Piece, binding: int) -> Piece:
    """The piece, in parentheses if it binds more loosely."""
    if piece.binding <= binding:
        return piece
    return Piece(f"({piece.text})", ATOM, piece.depth, Breaks("call", "", (piece,), (None,)))


def depth_of(pieces: Sequence[Piece]) -> int:
    """The nesting of a text that is made of some pieces."""
    return 1 + max([p.depth for p in pieces], default=0)


def call_text(name: str, pieces: Sequence[Piece], sources: Sequence[Expr]) -> Piece:
    """A call of a function."""
    text = f"{name}({', '.join([p.text for p in pieces])})"
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
