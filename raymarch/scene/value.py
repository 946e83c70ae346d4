"""Immutable values: the base of all parts of a scene.

The parameters of the constructor of a class are its fields. They define comparison, hash, repr, copies, pickles and
`replace`. Copies, pickles and `replace` call the constructor, so every value has passed its checks.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from copy import copy
from dataclasses import dataclass
from functools import wraps
from typing import TYPE_CHECKING, Any, ClassVar, NoReturn, Self, TypeVar, dataclass_transform

import numpy as np

from raymarch.errors import Location, RaymarchError, SceneError, user_location
from raymarch.expr.calls import checked
from raymarch.expr.convert import short
from raymarch.expr.node import Expr
from raymarch.expr.peers import unknown_attribute

T = TypeVar("T", bound="Value")


class Value:
    """Base of the parts of a scene."""

    __slots__ = ("where",)
    BELONGS: ClassVar[str] = ""
    """The argument that takes such a part, for the message where it is given to another one."""
    where: Location | None
    """The user's line that made the value, or the value that it was replaced from. It does not count for equality."""

    def _set(self, **values: Any) -> None:
        """Set fields. Only the constructor may call this."""
        for name, value in values.items():
            object.__setattr__(self, name, value)

    if not TYPE_CHECKING:  # a type checker would accept any name

        def __getattr__(self, name: str) -> Any:
            """Raise UnknownNameError, which names the field that is meant."""
            if name.startswith("_"):  # what Python and its tools look for
                raise AttributeError(f"'{type(self).__name__}' object has no attribute '{name}'")
            raise unknown_attribute(f"a {type(self).__name__}", name, parameters_of(type(self)))

    def arguments(self) -> dict[str, Any]:
        """The constructor arguments of an equal value, by name."""
        return {name: getattr(self, name) for name in parameters_of(type(self))}

    def replace(self, **changes: Any) -> Self:
        """A copy with some constructor arguments replaced. SceneError for an unknown name or an illegal value.

        Returns
        -------
        Self

        Raises
        ------
        SceneError : arguments of another kind or outside their range.
        """
        names = parameters_of(type(self))
        for name, value in changes.items():
            if name not in names:
                raise SceneError(f"{type(self).__name__}.replace: {name} = {short(value)}", legal=", ".join(names))
        made = type(self)(**{**self._unchanged(changes), **changes})
        object.__setattr__(made, "where", self.where)
        return made

    def _unchanged(self, changes: dict[str, Any]) -> dict[str, Any]:
        """The arguments that stay when some are replaced."""
        return self.arguments()

    def _identity(self) -> tuple[Any, ...]:
        """The key of equality and hash."""
        return tuple(self.arguments().values())

    def __eq__(self, other: object) -> bool:
        return self is other or (type(self) is type(other) and self._identity() == other._identity())

    def __hash__(self) -> int:
        return hash((type(self), self._identity()))

    def __copy__(self) -> Self:
        return self

    def __deepcopy__(self, memo: Any) -> Self:
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        return _remade, (type(self), self.arguments(), self.where)

    def __setstate__(self, state: Any) -> NoReturn:
        raise SceneError(f"{type(self).__name__}: a state from outside", legal="values are made by their constructors")

    def __repr__(self) -> str:
        given = self.arguments()
        try:
            own = inspect.signature(type(self)).parameters
            needed = {name: given[name] for name, p in own.items() if p.default is p.empty}
            usual = type(self)(**needed).arguments()
            given = {n: v for n, v in given.items() if n in needed or (v is not usual[n] and v != usual[n])}
        except RaymarchError:
            pass
        return f"{type(self).__name__}({', '.join(f'{name}={_shown(value)}' for name, value in given.items())})"


class Part(Value):
    """Base of the parts of a scene whose fields may be expressions."""

    __slots__ = ()

    @property
    def expressions(self) -> list[Expr]:
        """All values that may depend on parameters or time."""
        return [given for given in self.arguments().values() if isinstance(given, Expr)]


@dataclass_transform(frozen_default=True, eq_default=False)
def value(cls: type[T]) -> type[T]:
    """Decorator: a frozen dataclass with slots whose fields are the parameters of its constructor."""
    made = dataclass(frozen=True, eq=False, repr=False, slots=True, init="__init__" not in cls.__dict__)(cls)
    for name in ("__getstate__", "__setstate__", "__setattr__", "__delattr__"):
        if name in made.__dict__:
            delattr(made, name)
    made.__setattr__ = _refuse_assignment  # type: ignore[method-assign,assignment]
    made.__delattr__ = _refuse_assignment  # type: ignore[method-assign,assignment]
    made.__setstate__ = Value.__setstate__  # type: ignore[method-assign]
    names = inspect.signature(made).parameters
    fields = {name: copy(field) for name, field in vars(made)["__dataclass_fields__"].items()}
    for name in names:  # parameters that are properties
        if name not in fields:
            fields[name] = copy(next(iter(fields.values())))
            fields[name].name = name
    for name, field in fields.items():
        field.init = name in names
    made.__init__ = checked(_placed(made.__init__), made.__name__)  # type: ignore[method-assign]
    made.__dataclass_fields__ = fields  # type: ignore[attr-defined]
    return made


def _placed(construct: Callable[..., None]) -> Callable[..., None]:
    """The constructor, which first records the user's line."""

    @wraps(construct)
    def made(self: Value, *args: Any, **named: Any) -> None:
        self._set(where=user_location())
        construct(self, *args, **named)

    return made


def _refuse_assignment(self: Value, name: str, value: Any = None) -> None:
    kind = type(self).__name__
    raise SceneError(f"{kind}: {name} cannot be assigned", legal=f"another {kind}: .replace({name}=...)")


_parameters: dict[type, tuple[str, ...]] = {}


def parameters_of(cls: type[Value]) -> tuple[str, ...]:
    """The names of the constructor's parameters, in order."""
    if cls not in _parameters:
        _parameters[cls] = tuple(inspect.signature(cls).parameters)
    return _parameters[cls]


def _remade(cls: Any, arguments: Any, where: Any) -> Any:
    """A pickled value. The constructor makes it and refuses illegal arguments."""
    if not (isinstance(cls, type) and issubclass(cls, Value)) or not isinstance(arguments, dict):
        raise SceneError(f"unpickling: {short(cls)} of {short(arguments)}", legal="a part of a scene and its arguments")
    unknown = [name for name in arguments if name not in parameters_of(cls)]
    if unknown or not isinstance(where, Location | None):
        raise SceneError(f"unpickling a {cls.__name__}: {short(unknown or where)}", legal="its arguments and a line")
    try:
        made = cls(**arguments)
    except TypeError as fault:
        raise SceneError(f"unpickling a {cls.__name__}: {fault}", legal="its arguments") from fault
    object.__setattr__(made, "where", where)
    return made


def _shown(value: Any) -> str:
    """A field in a repr: a constant as its number, another long value as its kind."""
    if isinstance(value, Expr):
        if not value.is_constant:
            return value.data.name if value.op == "param" else "<expression>"
        return short(tuple(float(f"{v:.6g}") for v in value.data) if np.ndim(value.data) == 1 else float(value.data))
    if isinstance(value, tuple) and value and all(isinstance(item, float) for item in value):
        return short(tuple(float(f"{item:.6g}") for item in value))
    if isinstance(value, tuple):
        return f"[{', '.join(map(_shown, value))}]" if len(value) <= 4 else f"[{len(value)}]"
    return short(value)
