"""Functions and loops of the expression language.

A `Function` is a GLSL function: it is printed once and called by name. A `Loop` carries state from iteration to
iteration. Both are plain data of a `call` or `loop` expression.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import CodeType, MappingProxyType
from typing import Annotated, Any, TypeAlias, TypeVar, get_type_hints
from weakref import WeakValueDictionary

from raymarch.errors import Location, SceneError, is_users
from raymarch.expr.convert import short
from raymarch.expr.node import Expr, Operand, const, elementwise, expr, exprs, make, var
from raymarch.expr.types import BOOL, FLOAT, STATE, VEC2, VEC3, Type
from raymarch.expr.walk import free_variables, rewrite, substitute

T = TypeVar("T")

FloatExpr: TypeAlias = Annotated[Expr, FLOAT]
Vec2Expr: TypeAlias = Annotated[Expr, VEC2]
Vec3Expr: TypeAlias = Annotated[Expr, VEC3]
"""Expressions of a type, as annotations of the parameters of a `function`."""

Rule: TypeAlias = Callable[[Expr, tuple[Expr, ...]], Expr]
"""What replaces an expression, from its new arguments; see `rewrite`."""

_functions: WeakValueDictionary[tuple[Any, ...], Function] = WeakValueDictionary()
"""All functions by content and line, so that unpickling returns the existing object."""


@dataclass(slots=True)
class Stated:
    """What is stated of a function, in place of what follows from its body.

    gradients : the functions that return gradient and value together, by the index of the parameter; the others are
    derived by `raymarch.expr.derivative.companion`. gradient_of : the function whose gradient and value this one
    returns. programs : how readings evaluate it. programs_of_gradient : how they evaluate its gradient and value.
    limits : a `raymarch.expr.lattice.Limits`, None for no limits.
    """

    gradients: dict[int, Function] = field(default_factory=dict)
    gradient_of: Function | None = None
    programs: dict[Any, Callable[..., Any]] = field(default_factory=dict)
    programs_of_gradient: dict[Any, Callable[..., Any]] = field(default_factory=dict)
    limits: Any = None


@dataclass(eq=False, repr=False, slots=True, weakref_slot=True)
class Function:
    """A named function of typed parameters. `names` are those of some intermediate values."""

    name: str
    params: tuple[Expr, ...]
    body: Expr
    names: dict[Expr, str] = field(default_factory=dict)
    where: Location | None = None
    derived: dict[Any, Any] = field(default_factory=dict)
    """Objects that follow from the body (gradients, compiled programs), by key; see `once`."""
    stated: Stated = field(default_factory=Stated)

    def __post_init__(self) -> None:
        _functions.setdefault((self.name, self.params, self.body, self.where), self)

    def __reduce__(self) -> tuple[Any, ...]:
        return _function, (self.name, self.params, self.body, list(self.names.items()), self.where)

    def __repr__(self) -> str:
        return f"<function {self.name}({', '.join(f'{p.type} {p.data}' for p in self.params)}) -> {self.type}>"

    def __copy__(self) -> Function:
        return self

    def __deepcopy__(self, memo: Any) -> Function:
        return self

    def once(self, key: Any, make: Callable[[], T]) -> T:
        """The derived object of a key, made when it is first asked for."""
        if key not in self.derived:
            self.derived[key] = make()
        return self.derived[key]

    def known_gradient(self) -> Function | None:
        """The function that returns gradient and value, if it was stated or derived before."""
        return self.stated.gradients.get(0) or self.derived.get(("companion", 0))

    @property
    def type(self) -> Type:
        return self.body.type

    @property
    def inner(self) -> tuple[Expr, ...]:
        return (self.body,)

    def __call__(self, *args: Operand, **named: Operand) -> Expr:
        if named:
            takes = ", ".join(str(p.data) for p in self.params)
            raise SceneError(f"{self.name} has no parameter {next(iter(named))!r}", legal=f"{self.name}({takes})")
        values = exprs(args)
        if [a.type for a in values] != [p.type for p in self.params]:
            takes = ", ".join(f"{p.type} {p.data}" for p in self.params)
            gets = ", ".join(a.type.name for a in values)
            raise SceneError(f"{self.name}({takes}) was given ({gets})", legal=f"({takes})")
        return make("call", self.body.type, values, self)

    def inline(self, *args: Expr) -> Expr:
        """The body with the parameters replaced."""
        return substitute([self.body], dict(zip(self.params, args, strict=True)))[0]


def unique_function(
    name: str, params: tuple[Expr, ...], body: Expr, names: dict[Expr, str], where: Location | None
) -> Function:
    """The existing function of this content and line if there is one, else a new one."""
    found = _functions.get((name, params, body, where))
    return found if found is not None else Function(name, params, body, names, where)


def changed_inside(function: Function, rule: Rule, made: dict[Function, Function]) -> Function:
    """The function with its body rewritten; the same one if that changes nothing. made : the results so far."""
    if function not in made:
        body = rewrite([function.body], rule)[function.body]
        same = body is function.body
        made[function] = (
            function if same else Function(function.name, function.params, body, function.names, function.where)
        )
    return made[function]


def _function(name: str, params: Any, body: Any, names: Any, where: Location | None) -> Function:
    """Unpickle a function; returns the existing one if it is equal."""
    if not isinstance(name, str) or not isinstance(body, Expr) or not all(isinstance(p, Expr) for p in params):
        raise SceneError(f"unpickling a function: {short(name)}", legal="the pickle of a function")
    for deferred in list(_deferred.get(name, ())):
        deferred.trace()
    return unique_function(name, tuple(params), body, dict(names), where)


def trace(
    name: str, definition: Callable[..., Any], params: Sequence[tuple[str, Type]], code: CodeType | None = None
) -> Function:
    """Run a Python definition once on symbolic parameters; the existing function if it is equal to one.

    code : of its line; by default the definition's own.
    """
    return unique_function(name, *_trace(name, definition, params, code or definition.__code__))


def _trace(
    name: str, definition: Callable[..., Any], params: Sequence[tuple[str, Type]], code: CodeType
) -> tuple[tuple[Expr, ...], Expr, dict[Expr, str], Location]:
    """The parameters, the body, no names, and the line of a function."""
    symbols = tuple(var(param, type) for param, type in params)
    around, _loops.open = _loops.open, []
    try:
        body = definition(*symbols)
    finally:
        _loops.open = around
    where = Location(code.co_filename, code.co_firstlineno)
    try:
        body = expr(body)
    except SceneError:
        raise SceneError(f"{name} must return an expression, not {short(body)}", where=where) from None
    stray = [v.data for v in free_variables([body]) if v not in symbols]
    if stray:
        raise SceneError(f"{name} uses {stray} from outside its own parameters", where=where)
    return symbols, body, {}, where


def function(called: str = "", /, **types: Type) -> Callable[[Callable[..., Any]], Function]:
    """Decorator: define a helper as a GLSL function.

    called : the name of the GLSL function, if it is not that of the definition. types : of its parameters, by name; or
        none, and annotations such as `Vec3Expr`.

    The definition runs once on symbolic parameters: a user's at once, so that its errors are raised there, and one of
    this package when the function is first used, because together they would take most of the time of the import.
    """

    def decorate(definition: Callable[..., Any]) -> Function:
        name, code = called or definition.__name__, definition.__code__
        if is_users(code.co_filename):
            return trace(name, definition, list((types or _annotated(definition)).items()))
        return _Deferred(name, lambda: _trace(name, definition, list((types or _annotated(definition)).items()), code))

    return decorate


def _annotated(definition: Callable[..., Any]) -> dict[str, Type]:
    """The types of the parameters of a definition, by its annotations."""
    hints = get_type_hints(definition, include_extras=True)
    return {name: hint.__metadata__[0] for name, hint in hints.items() if name != "return"}


_deferred: dict[str, list[_Deferred]] = {}
"""The functions that are not traced yet, by name."""

_filling = threading.RLock()
"""Held while a deferred function is traced, which may use further ones."""


class _Deferred(Function):
    """A function that is traced when one of its attributes is first read. Until then it has its name and the derived
    objects that it was given."""

    __slots__ = ("_parts",)

    def __init__(
        self, name: str, parts: Callable[[], tuple[tuple[Expr, ...], Expr, dict[Expr, str], Location | None]]
    ) -> None:
        self.name = name
        self._parts = parts
        self.derived = {}
        self.stated = Stated()
        _deferred.setdefault(name, []).append(self)

    def trace(self) -> None:
        """Fill in the other attributes, unless another thread has done so."""
        with _filling:
            if self in _deferred.get(self.name, ()):
                super().__init__(self.name, *self._parts(), self.derived, self.stated)
                _deferred[self.name].remove(self)

    def __getattr__(self, name: str) -> Any:
        """Called for an attribute that has no value yet."""
        if name not in Function.__slots__:
            raise AttributeError(name)
        self.trace()
        return object.__getattribute__(self, name)


@dataclass(frozen=True, slots=True)
class Loop:
    """At most `count` iterations of `state = step(state)`; ends as soon as `until` holds at the start of an iteration.

    A loop is closed: `index` counts iterations from 0, `state` are the carried variables, `captured` are the outer
    variables that it reads. The arguments of the loop expression are the initial state, then the captured values.
    """

    count: int
    index: Expr
    state: tuple[Expr, ...]
    captured: tuple[Expr, ...]
    step: tuple[Expr, ...]
    until: Expr | None
    kept: bool = False
    """True for a loop that compilers must not unroll: software renderers can skip all turns of it but the first."""

    @property
    def inner(self) -> tuple[Expr, ...]:
        return (*self.step, *((self.until,) if self.until is not None else ()))

    def changed(self, rule: Rule, kept: bool = False) -> Loop:
        """The loop with its expressions rewritten. kept : it must not be unrolled."""
        inner = [rewrite([e], rule)[e] for e in self.inner]
        step, until = (inner, None) if self.until is None else (inner[:-1], inner[-1])
        return replace(self, step=tuple(step), until=until, kept=self.kept or kept)

    @property
    def is_branch(self) -> bool:
        """True for a single turn that may be left out: GLSL prints it as an `if`."""
        return self.count == 1 and self.until is not None


def loop(
    count: int,
    state: Sequence[Operand],
    step: Callable[..., Sequence[Operand]],
    until: Callable[..., Expr] | None = None,
) -> tuple[Expr, ...]:
    """Repeat `state = step(i, *state)` at most `count` times; returns the last state.

    Parameters
    ----------
    count : number of iterations, 1 to 65,535, constant in the scene.
    state : the initial values, one expression each; their types do not change.
    step : function of the index (a float expression) and the state; returns the next state.
    until : function of the same arguments; the loop ends before an iteration in which it holds.
    """
    if isinstance(count, bool) or not isinstance(count, int) or not 1 <= count <= 65535:
        raise SceneError(f"loop count {short(count)}", legal="an integer from 1 to 65535")
    first = exprs(state)
    depth = len(_loops.open)
    index = var(f"loop {depth} index", FLOAT)
    carried = tuple(var(f"loop {depth} state {k}", value.type) for k, value in enumerate(first))
    _loops.open.append(index)
    try:
        after = exprs(step(index, *carried))
        leave = until(index, *carried) if until is not None else None
    finally:
        _loops.open.pop()
    if [a.type for a in after] != [f.type for f in first]:
        what = f"a loop's step gives {[a.type.name for a in after]} for a state of {[f.type.name for f in first]}"
        raise SceneError(what, legal="as many values as the state has, of the same types")
    if leave is not None and leave.type is not BOOL:
        raise SceneError(f"a loop's until gives {leave.type}", legal="a condition such as a > b")
    return close_loop(count, index, carried, after, leave, first)


class _Loops(threading.local):
    """The indices of the loops around the present one, in the definition that this thread traces."""

    def __init__(self) -> None:
        self.open: list[Expr] = []


_loops = _Loops()


def close_loop(
    count: int,
    index: Expr,
    state: tuple[Expr, ...],
    step: tuple[Expr, ...],
    until: Expr | None,
    first: tuple[Expr, ...],
    around: Mapping[Expr, Expr] = MappingProxyType({}),
    kept: bool = False,
) -> tuple[Expr, ...]:
    """The results of a loop, one expression each.

    Outer variables that the body reads are captured. `around` maps them to their values; by default they are
    themselves.
    """
    body = (*step, until) if until is not None else step
    captured = tuple(v for v in free_variables(body) if v is not index and v not in state)
    loop_expr = make(
        "loop",
        STATE,
        first + tuple(around.get(v, v) for v in captured),
        Loop(count, index, state, captured, step, until, kept),
    )
    return tuple(make("item", value.type, (loop_expr,), k) for k, value in enumerate(first))


def sum_of(terms: Sequence[Expr]) -> Expr:
    """The sum of any number of expressions; 0 for none."""
    total = const(0.0)
    for term in terms:
        total = elementwise("add", total, term)
    return total
