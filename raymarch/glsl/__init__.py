"""Hand-written GLSL, one concern a file. What a module defines and uses is read from its code."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from functools import cache, cached_property, lru_cache
from importlib.resources import files
from typing import Any


@dataclass(frozen=True)
class Module:
    """One file: its name ("march/plain"), the names that it needs and gives, its first sentence, its lines.

    numbers : the number of each line in the file, from 1.
    """

    name: str
    gives: frozenset[str]
    summary: str
    lines: tuple[str, ...]
    numbers: tuple[int, ...]

    @cached_property
    def needs(self) -> frozenset[str]:
        return used("\n".join(self.lines))


VARIANTS = frozenset(
    (
        "ANALYTIC BOUNCES CLIP_PLANES CONES CUTS ESTIMATE LENS LIT ORTHOGRAPHIC OWN_START SAMPLES SHOWS STANDALONE "
        "UNCOUNTED UNDIVIDED WIDE_CONE"
    ).split()
)
"""Names of conditional lines that the plan settles: `#ifdef` and `#ifndef` of these are not in the shader. Without
CONES, this includes CONE, which is defined in passes that march cones."""


@cache
def load(name: str, variants: frozenset[str] = frozenset()) -> Module:
    """A module by name; KeyError if there is none, ValueError if it has no first sentence or defines nothing.

    variants : names of `VARIANTS` whose conditional lines are kept; those of the others are left out.
    """
    try:
        whole = _folder().joinpath(f"{name}.glsl").read_text(encoding="utf-8").rstrip("\n").split("\n")
    except FileNotFoundError:
        raise KeyError(f"no GLSL module '{name}'") from None
    numbers, lines = zip(
        *settled(whole, variants, VARIANTS if "CONES" in variants else VARIANTS | {"CONE"}), strict=True
    )
    text = "\n".join(lines)
    gives = defined(text)
    if not lines[0].startswith("// ") or not gives:
        raise ValueError(f"GLSL module '{name}' lacks a comment in its first line, or defines nothing")
    return Module(name, gives, lines[0][3:].strip(), lines, numbers)


def settled(lines: list[str], variants: Collection[str], names: Collection[str]) -> Iterator[tuple[int, str]]:
    """The lines that remain when conditions on some names are settled, each with its number.

    variants : those of the names whose lines are kept.
    """
    kept: list[bool | None] = []  # of each open condition; None for one that the driver decides
    for number, line in enumerate(lines, 1):
        word, _, name = line.partition(" ")
        if word in ("#ifdef", "#ifndef"):
            kept.append((name in variants) == (word == "#ifdef") if name in names else None)
        elif word == "#else" and kept[-1] is not None:
            kept[-1] = not kept[-1]
        elif word == "#endif" and kept.pop() is not None:
            continue
        if False in kept or (word in ("#ifdef", "#ifndef", "#else") and kept[-1] is not None):
            continue
        yield number, line


@cache
def _folder() -> Any:
    """The folder of the modules."""
    return files(__name__)


@cache
def givers() -> Mapping[str, tuple[str, ...]]:
    """The modules that define each name. If there are several, they are alternatives."""
    found: dict[str, tuple[str, ...]] = {}
    for name in sorted(_names(_folder())):
        for given in load(name).gives:
            found[given] = (*found.get(given, ()), name)
    return found


def _names(folder: Any, before: str = "") -> list[str]:
    found: list[str] = []
    for entry in folder.iterdir():
        if entry.is_dir():
            found += _names(entry, f"{before}{entry.name}/")
        elif entry.name.endswith(".glsl"):
            found.append(before + entry.name.removesuffix(".glsl"))
    return found


# Names in GLSL

_TYPE = r"(?:void|bool|int|uint|float|[biu]?vec[234]|mat[234]|sampler[23]D|[A-Z]\w*)"
_LINE_COMMENT = re.compile(r"//[^\n]*")
_BLOCK_COMMENT = re.compile(r"/\*.*?\*/", re.DOTALL)
_FUNCTION = re.compile(rf"\b{_TYPE}\s+(\w+)\s*\(")
_STRUCT = re.compile(r"\bstruct\s+(\w+)")
_VARIABLE = re.compile(rf"(?m)^(?:layout\(.*?\) )?(?:(?:uniform|const|out|in)\s+)?{_TYPE}\s+(\w+) *[;=\[]")
_NAME = re.compile(r"(?<![\w.])[A-Za-z_]\w*")
_LOCAL = re.compile(rf"\b{_TYPE}\s+(\w+)")

LANGUAGE = frozenset(
    """
    void bool int uint float vec2 vec3 vec4 ivec2 ivec3 ivec4 uvec2 uvec3 uvec4 bvec2 bvec3 bvec4 mat2 mat3 mat4
    sampler2D sampler3D struct uniform const in out inout layout location if else for while do return break continue
    discard true false highp mediump lowp precision
    radians degrees sin cos tan asin acos atan sinh cosh tanh pow exp log exp2 log2 sqrt inversesqrt abs sign floor ceil
    trunc round fract mod min max clamp mix step smoothstep isnan isinf length distance dot cross normalize reflect
    refract transpose inverse determinant texelFetch textureSize texture any all not lessThan greaterThan equal
    floatBitsToUint uintBitsToFloat gl_FragCoord greaterThanEqual ifdef ifndef else endif CONE clock2x32ARB
    """.split()
)
"""Keywords and functions of GLSL, and the preprocessor names of passes."""


@lru_cache(1024)
def defined(text: str) -> frozenset[str]:
    """Functions, structs, uniforms, outputs, constants and variables that a text defines outside of functions."""
    top = _outside(_code(text))
    return frozenset([*_FUNCTION.findall(top), *_STRUCT.findall(top), *_VARIABLE.findall(top)])


@lru_cache(1024)
def used(text: str) -> frozenset[str]:
    """Names that a text uses, but neither has from the language nor defines, at the top or in a function."""
    code = _code(text)
    return frozenset(_NAME.findall(code)) - LANGUAGE - frozenset(_LOCAL.findall(code)) - defined(text)


def _code(text: str) -> str:
    return _BLOCK_COMMENT.sub("", _LINE_COMMENT.sub("", text))


def _outside(code: str) -> str:
    """The code outside of all braces and parentheses, with the braces and parentheses themselves."""
    found, depth, start = [], 0, 0
    for match in re.finditer(r"[(){}]", code):
        if match[0] in "({":
            if depth == 0:
                found.append(code[start : match.end()])
            depth += 1
        else:
            depth -= 1
            start = match.start() if depth == 0 else start
    found.append(code[start:])
    return "".join(found)
