"""Calls with wrong arguments: one message with the legal names, in place of Python's TypeError."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any, TypeVar

from raymarch.errors import SceneError
from raymarch.expr.convert import described, short
from raymarch.expr.peers import NEEDED, meant

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
    most = len([q for q in own if q.kind is not q.KEYWORD_ONLY])
    needed = [q.name for q in own if q.default is q.empty]
    vector = len(own) > 0 and "Vec" in str(own[0].annotation) and len(args) in (2, 3)
    return bad_call(what, [q.name for q in own], needed, () if several else args, kwargs, most, vector)


def bad_call(
    what: str,
    names: Sequence[str],
    needed: Collection[str],
    args: Sequence[Any],
    kwargs: Mapping[str, Any],
    most: int,
    vector: bool,
    usage: str = "",
) -> SceneError | None:
    """The error for arguments that do not fit some parameters; None if they fit.

    names : of the parameters, of which those `needed` have no default. most : number of those given by position.
    vector : True if the first parameter is a vector of as many components as there are `args`.
    usage : the call in the message; by default the names.
    """
    legal = usage or ", ".join(names) or "no arguments"
    for name in kwargs:
        if name not in names:
            known = usage or f"legal: {legal}"
            return SceneError(f"{what} has no parameter '{name}'", legal=f"{meant(name, names)}{known}")
    if len(args) > most:
        if vector and all(isinstance(v, int | float) for v in args):
            return SceneError(f"{what} takes one vector", legal=f"{what}(({', '.join(map(repr, args))}))")
        taken = f"{most} argument{'s' * (most != 1)}"
        return SceneError(f"{what} takes up to {taken}, {len(args)} were given", legal=legal)
    for name in names[: len(args)]:
        if name in kwargs:
            first, second = described(args[names.index(name)]), short(kwargs[name])
            twice = f"{what} was given '{name}' twice: by position {first}, by name {second}"
            return SceneError(twice, legal=f"its parameters are {legal}")
    missing = [name for name in names[len(args) :] if name in needed and name not in kwargs]
    return SceneError(f"{what} needs '{missing[0]}'", legal=NEEDED.get(what, legal)) if missing else None
