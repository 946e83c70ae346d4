"""A tracer of one's own: the length of a step, as a function of the state of a ray."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, Self

from raymarch.errors import Location, SceneError
from raymarch.expr.convert import called, short
from raymarch.expr.function import Function, unique_function
from raymarch.expr.node import Expr, var
from raymarch.expr.types import FLOAT
from raymarch.expr.vocabulary import vec2
from raymarch.expr.walk import find
from raymarch.sdf.domain import as_operand

LEGAL = "the length of the next step, or (length, memory), from the fields of a TracerState"


class TracerState(NamedTuple):
    """The state of a ray at its last sample, for the function of `Quality(tracer=function)`.

    Attributes
    ----------
    value : the field at the sample, above 0: a sphere of this radius is empty. 0 before the first sample.
    slope : change of the field over the last step, over the length of that step; -1 where none is known.
    undone : 1 if the last step proved too long and was undone, else 0. The step that follows is plain.
    memory : what the function returned as its memory at the sample before; 0 at the start of a ray.
    t : distance along the ray. left : how far the ray goes on from there.
    """

    value: Expr
    slope: Expr
    undone: Expr
    memory: Expr
    t: Expr
    left: Expr


STATE = TracerState(*(var(name, FLOAT) for name in TracerState._fields))


class OwnTracer(str):
    """The tracer of a function in a scene file. As a string it is the function's name.

    step : the GLSL function of the state, of type vec2: the length of the next step, and the memory.
    """

    __slots__ = ("step",)
    step: Function

    @classmethod
    def of(cls, function: Callable[[TracerState], Any]) -> Self:
        """The tracer of a function. SceneError if it returns no number of the state alone."""
        name, what = getattr(function, "__name__", "own"), "Quality: tracer"
        found = called(what, function, STATE, legal=LEGAL)
        length, memory = found if isinstance(found, tuple) and len(found) == 2 else (found, 0.0)
        made = [as_operand(f"{what}: the function gives", part, LEGAL) for part in (length, memory)]
        for part in made:
            if part.type is not FLOAT:
                raise SceneError(f"{what}: the function gives a {part.type}", legal=LEGAL)
            if find([part], "param", "time"):
                raise SceneError(f"{what}: the function reads a Param or time", legal="numbers and the state alone")
        code = getattr(function, "__code__", None)
        where = None if code is None else Location(code.co_filename, code.co_firstlineno)
        step = unique_function("own_step", tuple(STATE), vec2(*made), {}, where)
        return cls.named(name if name.isidentifier() else "own", step)

    @classmethod
    def named(cls, name: str, step: Function) -> Self:
        if not isinstance(step, Function) or step.name != "own_step":
            raise SceneError(f"Quality: tracer = {short(step)}", legal=LEGAL)
        made = cls(name)
        made.step = step
        return made

    def __eq__(self, other: object) -> bool:
        return isinstance(other, OwnTracer) and str.__eq__(self, other) and self.step is other.step

    def __ne__(self, other: object) -> bool:
        return not self == other

    def __hash__(self) -> int:
        return hash((str(self), self.step.name))

    def __repr__(self) -> str:
        return str(self)

    def __deepcopy__(self, memo: Any) -> Self:
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        return OwnTracer.named, (str(self), self.step)
