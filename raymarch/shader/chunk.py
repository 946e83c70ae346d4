"""Pieces of a shader's text."""

from __future__ import annotations

from dataclasses import dataclass

from raymarch.errors import Location


@dataclass(frozen=True, slots=True)
class Mapped:
    """A line of the shader: its text, what made it in words, and the user's line if one did."""

    text: str
    made_by: str
    where: Location | None = None


@dataclass(frozen=True, slots=True)
class Chunk:
    """Lines that belong together, with the names that they need and give."""

    name: str
    needs: frozenset[str]
    gives: frozenset[str]
    lines: tuple[Mapped, ...]
