"""`Builder`, the function that `@shape` and `@operator` give to the user."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from types import MethodType
from typing import TYPE_CHECKING, Any

from raymarch.errors import SceneError
from raymarch.sdf.helptext import help_text

if TYPE_CHECKING:
    from raymarch.sdf.definition import Definition
    from raymarch.sdf.node import Node


class Builder:
    """A function that makes the nodes of one definition.

    It differs from a plain function in one respect: its help text, which gives facts of the node at the defaults, and
    its signature are derived when they are first read, because they take longer than everything else at import.

    Parameters
    ----------
    definition : the definition. source : the function that it was made of.
    """

    def __init__(self, definition: Definition, source: Callable[..., Any]) -> None:
        self.definition = definition
        self.__name__ = source.__name__
        self.__qualname__ = source.__qualname__
        self.__module__ = source.__module__
        self.__annotations__ = source.__annotations__
        self._operands = {"none": None, "one": "node", "many": "nodes"}[definition.arity]
        self._help: str | None = None

    def __call__(self, *args: Any, **kwargs: Any) -> Node:
        if self._operands is None:
            return self.definition.make((), args, kwargs)
        if self._operands in kwargs:
            args = (kwargs.pop(self._operands), *args)
        if not args:
            name = self.definition.called
            raise SceneError(f"{name} needs '{self._operands}'", legal=f"{name}({self._operands}, ...)")
        operands, *others = args
        children = (operands,) if self._operands == "node" else operands
        return self.definition.make(children, tuple(others), kwargs)

    def __get__(self, instance: object, owner: type | None = None) -> Any:
        """As a method, like a function. `help` also knows a function by it."""
        return self if instance is None else MethodType(self, instance)

    def __reduce__(self) -> str:
        return self.__qualname__

    def __repr__(self) -> str:
        return f"<function {self.__qualname__}>"

    @property
    def __doc__(self) -> str:  # type: ignore[override]
        """The help text."""
        if self._help is None:
            self._help = help_text(self.definition)
        return self._help

    @property
    def __signature__(self) -> inspect.Signature:
        """The parameters that a user gives: the operands in place of the point and the children."""
        signature = inspect.signature(self.definition.source)
        shown = list(signature.parameters.values())[1 if self._operands is None else 2 :]
        if self._operands is not None:
            kind = inspect.Parameter.POSITIONAL_OR_KEYWORD
            shown.insert(0, inspect.Parameter(self._operands, kind, annotation="Node"))
        return signature.replace(parameters=shown, return_annotation="Node")
