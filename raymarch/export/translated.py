"""The text of a scene's shader as words, for languages that are nearly GLSL."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

from raymarch.export.inputs import declarations, inputs, planned, refuse_textures, shader_of
from raymarch.scene.parameter import Spec, Values
from raymarch.scene.scene import Scene

PAIRS = frozenset("-= += *= /= %= &= |= ^= == <= >= != && || ++ -- << >>".split())
"""Marks of two characters."""

PIXEL = "pixel_center"
"""The variable that has the coordinates of the pixel's centre, in place of that of GLSL; only if a part reads it."""


@dataclass(frozen=True, slots=True)
class Input:
    """A uniform of a text: its type, its initial value and meaning as texts, and the Param that it is, or None."""

    name: str
    type: str
    value: str
    note: str
    spec: Spec | None


@dataclass(frozen=True)
class Declared:
    """A part of a text outside of functions, in words: a "struct", a "function" or a "variable".

    words : all of it, with the comments and the space before it. type, name : of a function, or of a variable.
    """

    kind: str
    name: str
    type: str
    words: list[str]

    @property
    def initial(self) -> Sequence[str]:
        """The words of a variable from the sign before its initial value on."""
        return self.words[self.words.index("=") :]

    @cached_property
    def names(self) -> frozenset[str]:
        """The names that stand in it."""
        return frozenset(word for word in self.words if word.isidentifier())


@dataclass(frozen=True, slots=True)
class Translated:
    """A shader in parts, with its inputs. Its function `picture` returns the colour of a point of the picture, in sRGB;
    pixels are counted from the lower left corner."""

    parts: Sequence[Declared]
    inputs: Sequence[Input]


def translated(scene: Scene, values: Values, form: str) -> Translated:
    """The shader of a scene. form : of the file, for messages.

    Raises PlanError for textures, and for lights and a sky light that change.
    """
    made = planned(scene, "standalone")
    shader = shader_of(made)
    refuse_textures(made, shader, form)
    listed = list(inputs(made, shader, values))
    names = {shader.parameters[name]: spec for name, spec in made.parameters.items() if name in shader.parameters}
    lines = declarations(made, shader, values)
    lines |= {name: f"uniform {kind} {name};" for name, kind, _, _ in listed}
    text = shader.text(version="", declarations=lines).replace("gl_FragCoord", PIXEL)
    parts = split(without_macros(text))
    kept = [part for part in parts if part.name != "main" and part.type not in ("uniform", "out")]
    if any(PIXEL in part.names for part in kept):
        kept.insert(0, Declared("variable", PIXEL, "vec2", ["vec2", " ", PIXEL, ";"]))
    return Translated(kept, [Input(*each, names.get(each[0])) for each in listed])


def without_macros(text: str) -> str:
    """The text with what the names of its macros stand for."""
    macros, kept = dict[str, str](), list[str]()
    for line in text.split("\n"):
        word, _, rest = line.partition(" ")
        name, _, value = rest.partition(" ")
        if word != "#define":
            kept.append(line)
        elif value and name.isidentifier():
            macros[name] = value
    return "".join(macros.get(word, word) for word in words_of("\n".join(kept)))


def words_of(text: str) -> list[str]:
    """The words, marks, comments and spaces of a text, in order; together they are the text."""
    found, at = list[str](), 0
    while at < len(text):
        end = _end(text, at)
        found.append(text[at:end])
        at = end
    return found


def _end(text: str, at: int) -> int:
    """Where the word ends that begins at a place."""
    if text.startswith("//", at):
        end = text.find("\n", at)
        return len(text) if end < 0 else end
    if text[at].isspace():
        return _after(text, at, str.isspace)
    if text[at].isidentifier():
        return _after(text, at, lambda mark: mark.isalnum() or mark == "_")
    if text[at].isdigit() or (text[at] == "." and text[at + 1 : at + 2].isdigit()):
        return _end_of_number(text, at)
    three, two = text[at : at + 3], text[at : at + 2]
    return at + (3 if three in ("<<=", ">>=") else 2 if two in PAIRS else 1)


def _end_of_number(text: str, at: int) -> int:
    if text[at : at + 2] in ("0x", "0X"):
        end = _after(text, at + 2, lambda mark: mark in "0123456789abcdefABCDEF")
    else:
        end = _after(text, at, str.isdigit)
        if text[end : end + 1] == ".":
            end = _after(text, end + 1, str.isdigit)
        if text[end : end + 1] in ("e", "E"):
            first = end + 1 + (text[end + 1 : end + 2] in ("+", "-"))
            end = _after(text, first, str.isdigit) if text[first : first + 1].isdigit() else end
    return end + (text[end : end + 1] == "u")


def _after(text: str, at: int, holds: Callable[[str], bool]) -> int:
    """The first place from one on at which a mark is of another kind."""
    while at < len(text) and holds(text[at]):
        at += 1
    return at


def split(text: str) -> list[Declared]:
    """A text in its parts, in order. A comment at the end of a line belongs to the part that ends there."""
    found: list[Declared] = []
    words: list[str] = []
    depth = 0
    for word in words_of(text):
        beside = not words and found and (word.startswith("//") or (word.isspace() and "\n" not in word))
        if beside:
            found[-1].words.append(word)
            continue
        words.append(word)
        depth += (word in "({[") - (word in ")}]")
        if depth == 0 and word in ("}", ";"):
            code = [w for w in words if not w.isspace() and not w.startswith("//")]
            if code[0] == "struct" and word == ";":
                found.append(Declared("struct", code[1], "struct", words))
            elif code[0] == "layout":
                found.append(Declared("variable", code[code.index(")") + 3], "out", words))
            elif code[2] == "(" and word == "}":
                found.append(Declared("function", code[1], code[0], words))
            elif word == ";":
                at = next(i for i, w in enumerate(code) if w in ("=", ";", "["))
                qualifier = code[0] if code[0] in ("uniform", "const") else code[at - 2]
                found.append(Declared("variable", code[at - 1], qualifier, words))
            else:
                continue  # the end of a struct, before its semicolon
            words = []
    return found


def closing(words: Sequence[str], start: int) -> int:
    """The place of the bracket that closes the one at a place."""
    depth = 0
    for i in range(start, len(words)):
        depth += (words[i] in ("(", "[", "{")) - (words[i] in (")", "]", "}"))
        if depth == 0:
            return i
    raise ValueError("a bracket is not closed")
