"""Calls with wrong arguments: one message with the legal names, in place of Python's TypeError."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar

from raymarch.errors import SceneError
from raymarch.expr.peers import meant

F = TypeVar("F", bound=Callable[..., Any])


def checked(function: F, what: str = "") -> F:
    """A function or method whose calls with wrong arguments raise SceneError with the user's line. Others cost nothing.

    what : the name for messages: the class for a constructor. By default that of the function, or of its class.
    """
    what = what or function.__qualname__.removesuffix(".__init__").rpartition(".")[2]
    signature = inspect.signature(function)

    @functools.wraps(function)
    def call(*args: Any, **kwargs: Any) -> Any:
        try:
            return function(*args, **kwargs)
        except TypeError:
            fault = _fault(signature, what, args, kwargs)
            if fault is None:
                raise
        raise fault

    return call  # type: ignore[return-value]


def _fault(
    signature: inspect.Signature, what: str, args: Sequence[Any], kwargs: Mapping[str, Any]
) -> SceneError | None:
    """The error for arguments that do not fit a method; None if they fit, so that the TypeError has another cause."""
    try:
        signature.bind(*args, **kwargs)
    except TypeError:
        pass
    else:
        return None
    own = list(signature.parameters.values())
    if own and own[0].name in ("self", "cls"):
        own, args = own[1:], args[1:]
    several = any(q.kind is q.VAR_POSITIONAL for q in own)
    own = [q for q in own if q.kind not in (q.VAR_POSITIONAL, q.VAR_KEYWORD)]
    names = [q.name for q in own]
    legal = ", ".join(names) or "no arguments"
    for name in kwargs:
        if name not in names:
            return SceneError(f"{what} has no parameter '{name}'", legal=f"{meant(name, names, what)}legal: {legal}")
    given = () if several else args
    most_given = len([q for q in own if q.kind is not q.KEYWORD_ONLY])
    if len(given) > most_given:
        if _takes_vector(own) and len(given) in (2, 3) and all(isinstance(v, int | float) for v in given):
            shown = ", ".join(map(repr, given))
            return SceneError(f"{what} takes one vector (x, y, z)", legal=f"{what}(({shown}))")
        most = f"{most_given} argument{'s' * (most_given != 1)}"
        return SceneError(f"{what} takes up to {most}, {len(given)} were given", legal=legal)
    for name in names[: len(given)]:
        if name in kwargs:
            return SceneError(f"{what} was given '{name}' twice", legal=legal)
    missing = [q.name for q in own[len(given) :] if q.default is q.empty and q.name not in kwargs]
    return SceneError(f"{what} needs '{missing[0]}'", legal=legal) if missing else None


def _takes_vector(parameters: Sequence[inspect.Parameter]) -> bool:
    return len(parameters) > 0 and "Vec" in str(parameters[0].annotation)
