"""Functions and loops of the expression language.

A `Function` is a definition in its own right: it is written once in the GLSL and called by name.
A `Loop` carries state from turn to turn. Both are plain data of one `call` or `loop` expression.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from types import CodeType, MappingProxyType
from typing import Any
from weakref import WeakValueDictionary

from raymarch.errors import Location, SceneError
from raymarch.expr.convert import short
from raymarch.expr.node import Expr, Operand, const, elementwise, expr, make, var
from raymarch.expr.types import BOOL, FLOAT, STATE, Type
from raymarch.expr.walk import free_variables, substitute

_functions: WeakValueDictionary[tuple[Any, ...], Function] = WeakValueDictionary()
"""By what they say, so that one that comes back from another process is the one that is here."""


@dataclass(eq=False, slots=True, weakref_slot=True)
class Function:
    """A named function of typed parameters. `names` keeps the author's own names for intermediate values."""

    name: str
    params: tuple[Expr, ...]
    body: Expr
    names: dict[Expr, str] = field(default_factory=dict)
    where: Location | None = None
    derived: dict[Any, Any] = field(default_factory=dict)
    """What was made from this one (its gradients, its ready programs), by the key under which it was made."""

    def __post_init__(self) -> None:
        _functions.setdefault((self.name, self.params, self.body), self)

    def __reduce__(self) -> tuple[Any, ...]:
        return _function, (self.name, self.params, self.body, list(self.names.items()), self.where)

    def __copy__(self) -> Function:
        return self

    def __deepcopy__(self, memo: Any) -> Function:
        return self

    @property
    def type(self) -> Type:
        return self.body.type

    @property
    def inner(self) -> tuple[Expr, ...]:
        return (self.body,)

    def __call__(self, *args: Operand) -> Expr:
        values = tuple(map(expr, args))
        if [a.type for a in values] != [p.type for p in self.params]:
            takes = ", ".join(f"{p.type} {p.data}" for p in self.params)
            gets = ", ".join(a.type.name for a in values)
            raise SceneError(f"{self.name}({takes}) was given ({gets})", legal=f"({takes})")
        return make("call", self.type, values, self)

    def inline(self, *args: Expr) -> Expr:
        """The body itself, with the parameters replaced."""
        return substitute([self.body], dict(zip(self.params, args, strict=True)))[0]


def _function(name: str, params: Any, body: Any, names: Any, where: Location | None) -> Function:
    """The function of a pickle, or the one that says the same and is here."""
    if not isinstance(name, str) or not isinstance(body, Expr) or not all(isinstance(p, Expr) for p in params):
        raise SceneError(f"unpickling a function: {short(name)}", legal="what pickle made of one")
    found = _functions.get((name, tuple(params), body))
    return found if found is not None else Function(name, tuple(params), body, dict(names), where)


def trace(
    name: str,
    definition: Callable[..., Any],
    params: Sequence[tuple[str, Type]],
    code: CodeType | None = None,
) -> Function:
    """Run a Python definition once on symbolic parameters.

    The local variables of `code` (by default the definition's own) name temporaries in the generated GLSL.
    """
    symbols = tuple(var(param, type) for param, type in params)
    names: dict[Expr, str] = {}

    def keep_locals(frame: Any, event: str, _arg: Any) -> None:
        if event == "return" and frame.f_code in family:
            for local, value in frame.f_locals.items():
                if isinstance(value, Expr):
                    names.setdefault(value, local)

    code = code or definition.__code__
    family = _code_family(code)
    previous = sys.getprofile()
    sys.setprofile(keep_locals)
    try:
        body = definition(*symbols)
    finally:
        _resume(previous)
    where = Location(code.co_filename, code.co_firstlineno)
    try:
        body = expr(body)
    except SceneError:
        raise SceneError(f"{name} must return an expression, not {short(body)}", where=where) from None
    stray = [v.data for v in free_variables([body]) if v not in symbols]
    if stray:
        raise SceneError(f"{name} uses {stray} from outside its own parameters", where=where)
    return Function(name, symbols, body, names, where)


def _resume(profiler: Any) -> None:
    """Give the profiler back its place. That of cProfile is an object that switches itself on, and cannot be called."""
    sys.setprofile(None if hasattr(profiler, "enable") else profiler)
    if hasattr(profiler, "enable"):
        profiler.enable()


def _code_family(code: CodeType) -> set[CodeType]:
    """A function's code and that of the functions written inside it, such as the step of a loop."""
    return {code}.union(*(_code_family(c) for c in code.co_consts if isinstance(c, CodeType)))


def function(**types: Type) -> Callable[[Callable[..., Any]], Function]:
    """Decorator: a helper that is a GLSL function of its own, with the types of its parameters given by name.

    The definition runs once, at import, on symbolic parameters.
    """

    def decorate(definition: Callable[..., Any]) -> Function:
        traced = trace(definition.__name__, definition, list(types.items()))
        traced.where = Location(definition.__code__.co_filename, definition.__code__.co_firstlineno)
        return traced

    return decorate


@dataclass(frozen=True, slots=True)
class Loop:
    """`count` turns at most of `state = step(state)`, left as soon as `until` holds at the start of a turn.

    A loop is closed: `index` counts turns from 0, `state` is what is carried, `captured` are the variables
    around it that it reads. The loop expression's arguments are the first state, then the captured values.
    """

    count: int
    index: Expr
    state: tuple[Expr, ...]
    captured: tuple[Expr, ...]
    step: tuple[Expr, ...]
    until: Expr | None

    @property
    def inner(self) -> tuple[Expr, ...]:
        return (*self.step, *((self.until,) if self.until is not None else ()))


def loop(
    count: int,
    state: Sequence[Operand],
    step: Callable[..., Sequence[Operand]],
    until: Callable[..., Expr] | None = None,
) -> tuple[Expr, ...]:
    """Repeat `state = step(i, *state)` at most `count` times; returns the last state.

    Parameters
    ----------
    count : number of turns, 1 to 65,535, known when the scene is built.
    state : the first values, one expression each; their types stay.
    step : function of the turn's index (a float expression) and the state, giving the next state.
    until : function of the same arguments; the loop ends before a turn in which it holds.
    """
    if isinstance(count, bool) or not isinstance(count, int) or not 1 <= count <= 65535:
        raise SceneError(f"loop count {short(count)}", legal="an integer from 1 to 65535")
    first = tuple(map(expr, state))
    depth = len(_open_loops)
    index = var(f"loop {depth} index", FLOAT)
    carried = tuple(var(f"loop {depth} state {k}", value.type) for k, value in enumerate(first))
    _open_loops.append(index)
    try:
        after = tuple(map(expr, step(index, *carried)))
        leave = until(index, *carried) if until is not None else None
    finally:
        _open_loops.pop()
    if [a.type for a in after] != [f.type for f in first]:
        raise SceneError(
            f"a loop's step gives {[a.type.name for a in after]} for a state of {[f.type.name for f in first]}",
            legal="as many values as the state has, of the same types",
        )
    if leave is not None and leave.type is not BOOL:
        raise SceneError(f"a loop's until gives {leave.type}", legal="a condition such as a > b")
    return close_loop(count, index, carried, after, leave, first)


_open_loops: list[Expr] = []


def close_loop(
    count: int,
    index: Expr,
    state: tuple[Expr, ...],
    step: tuple[Expr, ...],
    until: Expr | None,
    first: tuple[Expr, ...],
    around: Mapping[Expr, Expr] = MappingProxyType({}),
) -> tuple[Expr, ...]:
    """The results of a loop, one expression each. The variables that its body reads from around it are captured;
    `around` gives their values where they are not themselves."""
    body = (*step, until) if until is not None else step
    captured = tuple(v for v in free_variables(body) if v is not index and v not in state)
    whole = make(
        "loop",
        STATE,
        first + tuple(around.get(v, v) for v in captured),
        Loop(count, index, state, captured, step, until),
    )
    return tuple(make("item", value.type, (whole,), k) for k, value in enumerate(first))


def sum_of(terms: Sequence[Expr]) -> Expr:
    """The sum of any number of expressions; 0 for none."""
    total = const(0.0)
    for term in terms:
        total = elementwise("add", total, term)
    return total
