"""Parts of a shader's text."""

from __future__ import annotations

from dataclasses import dataclass, field

from raymarch.errors import Location
from raymarch.expr.function import Function
from raymarch.expr.glsl import constant
from raymarch.expr.node import Expr


@dataclass(frozen=True, slots=True)
class Mapped:
    """A line of the shader: its text, a description of its origin, and the user's line if there is one."""

    text: str
    made_by: str
    where: Location | None = None


@dataclass(frozen=True, slots=True)
class Chunk:
    """Consecutive lines, with the names that they need and give."""

    name: str
    needs: frozenset[str]
    gives: frozenset[str]
    lines: tuple[Mapped, ...]


@dataclass(slots=True)
class Lines:
    """A builder of lines, and of the names that they need."""

    made_by: str
    lines: list[Mapped] = field(default_factory=list)
    needs: set[str] = field(default_factory=set)

    def add(self, line: str, *needs: str, by: str | None = None, where: Location | None = None) -> None:
        self.lines.append(Mapped(line, by or self.made_by, where))
        self.needs |= set(needs)


class Values:
    """Values of the scene that the shader reads by name: literals if constant, else functions."""

    def __init__(self) -> None:
        self.functions: list[Function] = []

    def add(self, name: str, value: Expr, where: Location | None) -> None:
        self.functions.append(Function(name, (), value, where=where))

    def text(self, name: str, value: Expr, where: Location | None) -> str:
        if value.is_constant:
            return constant(value)
        self.add(name, value, where)
        return f"{name}()"
