"""Edited numbers of a shader become uniforms after their first change. Editing the same number again does not
recompile.

Numbers of a scene are baked into the shader, which makes the program fast and edits slow. If two versions of a shader
differ in numbers only, the numbers that differ become uniforms; all others stay baked.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from raymarch import glsl
from raymarch.gpu.prepare import Prepared

MOST = 64
"""Maximum number of such uniforms. Each makes the shader slower; above the maximum all numbers are baked again."""

CLICKED = ("depth",)
"""The outputs that a click renders, with a shader of their own."""


@dataclass(frozen=True, slots=True)
class Text:
    """The last version of a shader: the text between its numbers, the numbers, and which of them are uniforms."""

    between: tuple[str, ...]
    numbers: tuple[str, ...]
    free: frozenset[int] = frozenset()

    def changed(self, before: Text | None) -> Text:
        """Free the numbers that were free before or have changed; none if anything except numbers changed."""
        if before is None or before.between != self.between:
            return self
        apart = {i for i, (a, b) in enumerate(zip(self.numbers, before.numbers, strict=True)) if a != b}
        free = before.free | apart
        fixed = _fixed(self.between)
        return self if len(free) > MOST or free & fixed else replace(self, free=free)

    def glsl(self) -> str:
        """The text with uniforms. It keeps its number of lines, so that messages refer to the right line."""
        parts = [self.between[0]]
        for i, number in enumerate(self.numbers):
            parts += [_name(i) if i in self.free else number, self.between[i + 1]]
        text = "".join(parts)
        if not self.free:
            return text
        lines = text.split("\n")
        at = next(i for i, line in enumerate(lines) if line.strip() and not line.lstrip().startswith("#"))
        lines[at] = f"uniform float {', '.join(_name(i) for i in sorted(self.free))}; {lines[at]}"
        return "\n".join(lines)

    @property
    def values(self) -> dict[str, float]:
        """The uniforms and their current values."""
        return {_name(i): float(self.numbers[i]) for i in self.free}


class Constants:
    """The shaders that a window drew last, by pass.

    known : the result of `as_json` of another instance.
    """

    def __init__(self, known: Mapping[str, Any] | None = None) -> None:
        self._known = {
            name: Text(tuple(it["between"]), tuple(it["numbers"]), frozenset(it["free"]))
            for name, it in (known or {}).items()
        }

    def fit(self, ready: Prepared) -> tuple[Prepared, bool]:
        """The scene with uniforms for edited numbers, and whether it needs other programs than the last one."""
        fitted = {name: parsed(text).changed(self._known.get(name)) for name, text in ready.texts.items()}
        before = {name: text.glsl() for name, text in self._known.items()}
        self._known = fitted
        texts = {name: text.glsl() for name, text in fitted.items()}
        values: dict[str, dict[str, float]] = {name: text.values for name, text in fitted.items()}
        return replace(ready, texts=texts, constants=values), texts != before

    def forget(self) -> None:
        """Bake all numbers of the next scene."""
        self._known = {}

    def as_json(self) -> dict[str, Any]:
        """The state as JSON types, for another process."""
        return {
            name: {"between": text.between, "numbers": text.numbers, "free": sorted(text.free)}
            for name, text in self._known.items()
        }


def parsed(text: str) -> Text:
    """Split a shader at its numbers; none is a uniform yet."""
    places = glsl.numbers(text)
    starts, ends = [start for start, _ in places], [end for _, end in places]
    between = [text[i:j] for i, j in zip([0, *ends], [*starts, len(text)], strict=True)]
    return Text(tuple(between), tuple(text[i:j] for i, j in places))


def _fixed(between: tuple[str, ...]) -> set[int]:
    """The numbers that must stay constants: outside functions, in a `const`, in a preprocessor line."""
    fixed: set[int] = set()
    depth, statement, line = 0, "", ""
    for i, part in enumerate(between[:-1]):
        depth += part.count("{") - part.count("}")
        statement += part
        statement = statement[1 + max(statement.rfind(mark) for mark in ";{}") :]
        line = (line + part).rpartition("\n")[2]
        if depth < 1 or glsl.words(statement)[:1] == ["const"] or line.lstrip().startswith("#"):
            fixed.add(i)
    return fixed


def _name(number: int) -> str:
    return f"u_number_{number}"
