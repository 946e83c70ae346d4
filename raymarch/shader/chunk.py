"""Parts of a shader's text."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from importlib.resources import files
from string import Template

from raymarch import glsl
from raymarch.errors import Location
from raymarch.expr.function import Function
from raymarch.expr.node import Expr
from raymarch.expr.pieces import constant
from raymarch.glsl import Declared


@dataclass(frozen=True, slots=True)
class Mapped:
    """A line of the shader: its text, a description of its origin, and the user's line if there is one.

    uniform : the uniform that it declares, if it declares one.
    given : whether it is GLSL that a user wrote, which stays as it is.
    tallied : whether it begins a function whose calls are evaluations of the field or its gradient.
    """

    text: str
    made_by: str
    where: Location | None = None
    uniform: Declared | None = None
    given: bool = False
    tallied: bool = False

    @classmethod
    def declare(cls, type: str, name: str, made_by: str, where: Location | None = None, note: str = "") -> Mapped:
        """The declaration of a uniform. type : "vec3[9]" for an array. note : a comment after it."""
        of, bracket, size = type.partition("[")
        text = f"uniform {of} {name}{bracket}{size};" + (f"  // {note}" if note else "")
        return cls(text, made_by, where, Declared(name, "uniform", type))


@dataclass(frozen=True, slots=True)
class Chunk:
    """Consecutive lines, with the names that they need and give."""

    name: str
    needs: frozenset[str]
    gives: frozenset[str]
    lines: tuple[Mapped, ...]

    @classmethod
    def of(cls, name: str, lines: Iterable[Mapped]) -> Chunk:
        """A chunk whose names are read from its lines."""
        lines = tuple(lines)
        text = "\n".join([line.text for line in lines])
        return cls(name, glsl.used(text), glsl.defined(text), lines)


@dataclass(slots=True)
class Lines:
    """A builder of lines. `made_by` and `where` describe the origin of lines that are added without their own."""

    made_by: str
    lines: list[Mapped] = field(default_factory=list)
    where: Location | None = None

    def add(self, *lines: str, by: str | None = None, where: Location | None = None) -> None:
        self.lines += [Mapped(line, by or self.made_by, where or self.where) for line in lines]

    def template(self, name: str, conditions: Mapping[str, bool], **given: object) -> None:
        """Add the lines of a file of this package.

        conditions : whether the lines between `#ifdef` and `#endif` of a name are added. given : what replaces `$name`;
            lines of which nothing remains are left out.
        """
        whole = files(__package__).joinpath(f"{name}.glsl").read_text(encoding="utf-8").split("\n")
        chosen = {condition for condition, holds in conditions.items() if holds}
        kept = "\n".join(line for _, line in glsl.settled(whole, chosen, conditions))
        self.add(*(line for line in Template(kept).substitute(given).split("\n") if line.strip()))

    def chunk(self, name: str) -> Chunk:
        return Chunk.of(name, self.lines)


class Values:
    """Values of the scene that the shader reads by name: literals if constant, else functions."""

    def __init__(self) -> None:
        self.functions: list[Function] = []
        self.variables: set[str] = set()
        """Variables of the shader that the functions read, such as uniforms."""

    def add(self, name: str, value: Expr, where: Location | None) -> None:
        if all(function.name != name for function in self.functions):  # a value may be read in several places
            self.functions.append(Function(name, (), value, where=where))

    def text(self, name: str, value: Expr, where: Location | None) -> str:
        if value.is_constant:
            return constant(value)
        self.add(name, value, where)
        return f"{name}()"
