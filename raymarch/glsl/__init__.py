"""Hand-written GLSL, one concern a file, and the words of GLSL: what a text defines and uses, and its numbers."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from functools import cache, cached_property, lru_cache
from importlib.resources import files
from itertools import pairwise
from typing import Any


@dataclass(frozen=True, slots=True)
class Declared:
    """What a text defines outside of functions.

    kind : "function", "struct", "uniform", "const", "in", "out" or "variable". type : of its value, "vec3[9]" for an
        array; "" for a struct.
    """

    name: str
    kind: str
    type: str = ""


@dataclass(frozen=True)
class Module:
    """One file: its name ("march/plain"), the names that it needs and gives, its first sentence, its lines.

    declares : what it defines, by name. numbers : the number of each line in the file, from 1.
    """

    name: str
    declares: Mapping[str, Declared]
    summary: str
    lines: tuple[str, ...]
    numbers: tuple[int, ...]

    @cached_property
    def gives(self) -> frozenset[str]:
        return frozenset(self.declares)

    @cached_property
    def needs(self) -> frozenset[str]:
        return used("\n".join(self.lines))


VARIANTS = frozenset(
    (
        "ADVANCE AHEAD ANALYTIC BOUNCES BOUNDED CLIP_PLANES CONES CUTS EDGES ESTIMATE FILMS GRID HALVED JOINT LENS LIT "
        "MAPPED NOTED ORTHOGRAPHIC OWN_START PART PATTERNED PUBLISHED RELIEF RISING SAMPLES SHOWS SKIPS STANDALONE "
        "STANDS STRETCH UNDIVIDED WIDE_CONE"
    ).split()
)
"""Names of conditional lines that the plan settles: `#ifdef` and `#ifndef` of these are not in the shader. Without
CONES, this includes CONE, which is defined in passes that march cones."""

PIXEL, PIXEL_OF_PART = "gl_FragCoord.xy", "(gl_FragCoord.xy + u_corner)"
PIXEL_OF_GRID = "(gl_FragCoord.xy * u_grid_stride + u_grid_corner)"
"""What stands for `PIXEL` in modules: the place in the whole picture. Texels of the drawn target are at
`gl_FragCoord.xy`, also in a part of a picture, or in some of its pixels."""


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
    pixel = PIXEL_OF_PART if "PART" in variants else PIXEL_OF_GRID if "GRID" in variants else PIXEL
    text = "\n".join(lines).replace("PIXEL", pixel)
    declares = {each.name: each for each in declarations(text)}
    if not text.startswith("// ") or not declares:
        raise ValueError(f"GLSL module '{name}' lacks a comment in its first line, or defines nothing")
    return Module(name, declares, lines[0][3:].strip(), tuple(text.split("\n")), numbers)


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


# Words of GLSL

_APART = str.maketrans({mark: f" {mark} " for mark in "(){}[];,=<>+-*/%!&|^?:~#"})

_TYPES = frozenset(
    """
    void bool int uint float vec2 vec3 vec4 bvec2 bvec3 bvec4 ivec2 ivec3 ivec4 uvec2 uvec3 uvec4 mat2 mat3 mat4
    sampler2D sampler3D
    """.split()
)

_QUALIFIERS = ("uniform", "const", "in", "out")

LANGUAGE = frozenset(
    """
    void bool int uint float vec2 vec3 vec4 ivec2 ivec3 ivec4 uvec2 uvec3 uvec4 bvec2 bvec3 bvec4 mat2 mat3 mat4
    sampler2D sampler3D struct uniform const in out inout layout location if else for while do return break continue
    discard true false highp mediump lowp precision
    radians degrees sin cos tan asin acos atan sinh cosh tanh pow exp log exp2 log2 sqrt inversesqrt abs sign floor ceil
    trunc round fract mod min max clamp mix step smoothstep isnan isinf length distance dot cross normalize reflect
    refract transpose inverse determinant texelFetch textureSize texture textureLod any all not lessThan greaterThan
    equal floatBitsToUint uintBitsToFloat gl_FragCoord greaterThanEqual ifdef ifndef else endif CONE clock2x32ARB
    """.split()
)
"""Keywords and functions of GLSL, and the preprocessor names of passes."""


def words(text: str) -> list[str]:
    """The words and marks of a text without its comments. A number, or a name with its fields, is one word."""
    return _code(text).translate(_APART).split()


_PAIRS = frozenset("+= -= *= /= == != <= >= && || ++ --".split())


@lru_cache(8192)
def placed_words(line: str) -> tuple[tuple[str, ...], tuple[int, ...]]:
    """The words and marks of a line, and the place of each; none for a comment or a line of the preprocessor. Operators
    of two characters are one word, and names, dots and fields are words of their own."""
    found: list[str] = []
    places: list[int] = []
    place = 0
    for whole in "" if line.startswith("#") else line.partition("//")[0].translate(_APART).split():
        place = line.index(whole, place)
        for word in _apart(whole):
            if found and found[-1] + word in _PAIRS and places[-1] + 1 == place:
                found[-1] += word
            else:
                found.append(word)
                places.append(place)
            place += len(word)
    return tuple(found), tuple(places)


def _apart(word: str) -> list[str]:
    """A name, dots and fields; a number and its fields as one."""
    if "." not in word or word.lstrip(".")[0].isdigit():
        return [word]
    first, *fields = word.split(".")
    return [part for part in (first, *(part for field in fields for part in (".", field))) if part]


def is_type(word: str) -> bool:
    """True for a type: names of structs begin with a capital letter."""
    return word in _TYPES or (word[0].isupper() and word.isidentifier())


@lru_cache(1024)
def declarations(text: str) -> tuple[Declared, ...]:
    """Functions, structs, uniforms, outputs, constants and variables that a text defines outside of functions."""
    found, depth, before = [], 0, ["", ""]
    listed = words(text)
    for i, (word, after) in enumerate(pairwise([*listed, ""])):
        qualifier, type = before
        if depth == 0 and type == "struct":
            found.append(Declared(word, "struct"))
        elif depth == 0 and after in ("(", ";", "=", "[") and type and is_type(type) and word.isidentifier():
            kind = "function" if after == "(" else qualifier if qualifier in _QUALIFIERS else "variable"
            size = "".join(listed[i + 1 : listed.index("]", i) + 1]) if after == "[" else ""
            found.append(Declared(word, kind, type + size))
        depth += (word in "({") - (word in ")}")
        before = [type, word]
    return tuple(found)


def defined(text: str) -> frozenset[str]:
    """The names of the declarations of a text."""
    return frozenset([each.name for each in declarations(text)])


@lru_cache(1024)
def used(text: str) -> frozenset[str]:
    """Names that a text uses, but neither has from the language nor defines, at the top or in a function."""
    listed = [word.partition(".")[0] for word in words(text)]  # without the fields of a name
    names = {word for word in listed if word.isidentifier()}
    local = {name for type, name in pairwise(listed) if type and is_type(type)}
    return frozenset(names - LANGUAGE - local - defined(text))


def numbers(text: str) -> list[tuple[int, int]]:
    """The places in a text of its numbers with a decimal point: start and end of each."""
    found, at = [], 0
    for word in text.translate(_APART).split():
        start = text.index(word, at)
        end = at = start + len(word)
        if not word[0].isdigit() or "." not in word:
            continue
        if word[-1] == "e":  # the exponent has a sign, which is a word of its own
            end += 1
            while text[end : end + 1].isdigit():
                end += 1
        whole, _, digits = word.partition(".")
        fraction, _, exponent = digits.partition("e")
        if whole.isdigit() and fraction.isdigit() and (exponent.isdigit() or not exponent):
            found.append((start, end))
    return found


def _code(text: str) -> str:
    """The text without its comments."""
    if "/*" in text:
        first, *others = text.split("/*")
        text = first + "".join(other.partition("*/")[2] for other in others)
    return "\n".join(line.partition("//")[0] for line in text.split("\n")) if "//" in text else text
