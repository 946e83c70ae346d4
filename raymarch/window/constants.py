"""Numbers of a shader that somebody edits: uniforms from their first change on, so that the next ones compile nothing.

A number of a scene is baked into the shader, which makes the program fast and an edit slow. But who edits a number once
will edit it again. So where two shaders differ in nothing but numbers, those that differ become uniforms; all others
stay baked.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from raymarch.gpu.prepare import Prepared

MOST = 64
"""Numbers that may be uniforms at once: each costs speed, and beyond this all are baked again."""

CLICKED = ("depth",)
"""The outputs that a click asks for; their shader is another."""

_NUMBER = re.compile(r"(?<![\w.])\d+\.\d+(?:e[-+]?\d+)?(?![\w.])")


@dataclass(frozen=True, slots=True)
class Text:
    """A shader as it was last: what stands between its numbers, the numbers, and which of them are uniforms."""

    between: tuple[str, ...]
    numbers: tuple[str, ...]
    free: frozenset[int] = frozenset()

    def changed(self, before: Text | None) -> Text:
        """With the numbers free that were so before or have changed since; none if more than numbers has changed."""
        if before is None or before.between != self.between:
            return self
        apart = {i for i, (a, b) in enumerate(zip(self.numbers, before.numbers, strict=True)) if a != b}
        free = before.free | apart
        fixed = _fixed(self.between)
        return self if len(free) > MOST or free & fixed else replace(self, free=free)

    def glsl(self) -> str:
        """The text with uniforms; as many lines as it had, so that messages find their line."""
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
        """The uniforms and what they are now."""
        return {_name(i): float(self.numbers[i]) for i in self.free}


class Constants:
    """The shaders that a window drew last, by pass.

    Parameters
    ----------
    known : what `as_json` of another one gave.
    """

    def __init__(self, known: Mapping[str, Any] | None = None) -> None:
        self._known = {
            name: Text(tuple(it["between"]), tuple(it["numbers"]), frozenset(it["free"]))
            for name, it in (known or {}).items()
        }

    def fit(self, ready: Prepared) -> tuple[Prepared, bool]:
        """A scene with uniforms for the numbers that are edited, and whether it needs other programs than the last."""
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
        """For another process."""
        return {
            name: {"between": text.between, "numbers": text.numbers, "free": sorted(text.free)}
            for name, text in self._known.items()
        }


def parsed(glsl: str) -> Text:
    """A shader taken apart at its numbers, none of which is a uniform."""
    return Text(tuple(_NUMBER.split(glsl)), tuple(_NUMBER.findall(glsl)))


def _fixed(between: tuple[str, ...]) -> set[int]:
    """The numbers that must be constants: outside of functions, in a `const`, in a line for the preprocessor."""
    fixed: set[int] = set()
    depth, statement, line = 0, "", ""
    for i, part in enumerate(between[:-1]):
        depth += part.count("{") - part.count("}")
        statement = re.split(r"[;{}]", statement + part)[-1]
        line = (line + part).rpartition("\n")[2]
        if depth < 1 or re.match(r"\s*(//[^\n]*\n\s*)*const\b", statement) or line.lstrip().startswith("#"):
            fixed.add(i)
    return fixed


def _name(number: int) -> str:
    return f"u_number_{number}"
