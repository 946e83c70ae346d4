"""What a user writes for a definition: the annotations of its parameters, and its functions of facts."""

from __future__ import annotations

import inspect
import typing
from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeAlias

from raymarch.errors import Location, SceneError

Rule: TypeAlias = Callable[..., Any]


def hints_of(source: Callable[..., Any]) -> Mapping[str, Any]:
    """The annotations of a definition; none if one of them cannot be evaluated.

    Almost all are names of the module. `typing` takes some ten times as long for each.
    """
    known = source.__globals__
    try:
        if all(isinstance(hint, str) for hint in source.__annotations__.values()):
            return {
                n: known[hint] if hint in known else eval(hint, known) for n, hint in source.__annotations__.items()
            }
        return typing.get_type_hints(source, include_extras=True)
    except (NameError, TypeError):
        return {}


OF_ALL_CHILDREN = ("exactness", "symmetry", "convex", "check", "placing")
"""Facts whose functions receive each child's facts as an argument; the others receive one list of many children."""


def children_of(arity: str, of_all: bool) -> list[str]:
    """The arguments by which a function of facts receives the children."""
    return {"none": [], "one": ["child"], "many": ["*children" if of_all else "children"]}[arity]


def of_all_parameters(what: str, rule: Rule, first: Sequence[str], names: Sequence[str], where: Location) -> Rule:
    """A function of facts that takes its first arguments and some parameters of its definition, as a function of all.

    SceneError if it cannot be called with them.
    """
    children = sum(2 if name.startswith("*") else 1 for name in first)
    if _takes(rule, children, names):  # inspecting the rules of all definitions takes longer than tracing them
        return rule
    try:
        signature = inspect.signature(rule)
    except ValueError:  # a function without a signature
        return rule
    kinds = [q.kind for q in signature.parameters.values()]
    taken = list(names) if inspect.Parameter.VAR_KEYWORD in kinds else [n for n in names if n in signature.parameters]
    try:
        signature.bind(*range(children), **dict.fromkeys(taken))
    except TypeError:
        legal = f"it receives {', '.join([*first, *names])}"
        raise SceneError(f"{what} takes {signature}", legal=legal, where=where) from None
    if len(taken) == len(names):
        return rule
    return lambda *facts, **given: rule(*facts, **{name: given[name] for name in taken})


def _takes(rule: Rule, children: int, names: Sequence[str]) -> bool:
    """True if a rule is a plain function of some children and exactly these parameters."""
    if not inspect.isfunction(rule) or hasattr(rule, "__wrapped__"):
        return False
    code = rule.__code__
    plain = not code.co_flags & (inspect.CO_VARARGS | inspect.CO_VARKEYWORDS) and not code.co_kwonlyargcount
    return plain and code.co_varnames[children : code.co_argcount] == tuple(names)


def stated(rule: Any, children: Sequence[Any], params: Mapping[str, Any]) -> Any:
    """A fact that is stated, or the value of its function."""
    return rule(*children, **params) if callable(rule) else rule
