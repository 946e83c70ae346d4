"""Values that a frame takes out of their legal range.

A number is refused where it is written. What depends on time, or on a parameter, may be legal at one moment and not at
the next: it is asked at each frame, in float64 on the CPU, by the rules that refuse numbers.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from raymarch.errors import Location, SceneError
from raymarch.expr.intervals import interval_of
from raymarch.expr.node import Expr, const
from raymarch.expr.walk import find, substitute
from raymarch.scene.parameter import Values
from raymarch.scene.scene import Scene, all_nodes
from raymarch.sdf.node import Node


class Condition(Protocol):
    """Something that must hold in each frame."""

    def broken(self, values: Values) -> str | None:
        """What is wrong with the values of a frame, in one sentence with the user's line; None if nothing is."""


def conditions_of(scene: Scene) -> list[Condition]:
    """What must hold in each frame of a scene, because it could not be shown when the scene was built."""
    nodes = [_NodeIsLegal(node) for node in all_nodes(scene.node) if _is_open(node)]
    return [*nodes, *(_IsWithin(marked) for marked in find(scene.expressions(), "within"))]


def violations(conditions: Sequence[Condition], values: Values) -> list[str]:
    """What is wrong with the values of a frame, a sentence each."""
    found = (condition.broken(values) for condition in conditions)
    return list(dict.fromkeys(sentence for sentence in found if sentence is not None))


def _is_open(node: Node) -> bool:
    """True if a node's parameters are legal at some times, or for some values of parameters, and might not be at others:
    a `Param` is legal over its whole range, but as a direction, or beside another parameter."""
    moving = {n: v for n, v in node.params.items() if isinstance(v, Expr) and not v.is_constant}
    if not moving:
        return False
    domains = node.definition.domains
    at_all_times = not find(moving.values(), "time")
    return not at_all_times or node.definition.check is not None or any(domains[n].direction for n in moving)


@dataclass(frozen=True, slots=True)
class _NodeIsLegal:
    node: Node

    def broken(self, values: Values) -> str | None:
        node = self.node
        moving = [n for n, v in node.params.items() if isinstance(v, Expr) and not v.is_constant]
        given = _at_frame([_as_given(node, n) for n in moving], values)
        when = _moment([node.params[n] for n in moving], values)
        now: dict[str, Any] = dict(node.params)
        try:
            for name, value in zip(moving, given, strict=True):
                now[name] = node.definition.domains[name].accept(node.name, name, _plain(value))
            if node.definition.check is not None:
                node.definition.check(*[child.facts for child in node.children], **now)
        except SceneError as fault:
            return _sentence(node.where, fault.what, when, fault.legal)
        return None


@dataclass(frozen=True, slots=True)
class _IsWithin:
    marked: Expr

    def broken(self, values: Values) -> str | None:
        (given,), limit = self.marked.args, self.marked.data
        (value,) = _at_frame([given], values)
        if limit.holds(value):
            return None
        shown = _plain(value) if value.is_constant else "between {} and {}".format(*(e.tolist() for e in interval_of(value)))
        return _sentence(limit.where, f"{limit.what} = {shown}", _moment([given], values), limit.legal)


def _as_given(node: Node, name: str) -> Expr:
    """A parameter as the user gave it: a direction before it was normalised."""
    value: Expr = node.params[name]
    normalised = node.definition.domains[name].direction and value.op == "normalize"
    return value.args[0] if normalised else value


def _at_frame(given: Sequence[Expr], values: Values) -> list[Expr]:
    """Expressions with the numbers of a frame for parameters and time: constants, unless they depend on a cell."""
    known = {leaf: const(values.time) for leaf in find(given, "time")}
    known |= {leaf: const(values.params.get(leaf.data.name, leaf.data.value)) for leaf in find(given, "param")}
    return substitute(given, known)


def _plain(value: Expr) -> Any:
    """A constant as plain numbers, as a user would write it; anything else as it is."""
    if not value.is_constant:
        return value
    numbers = np.round(value.data, 12) if np.all(np.abs(value.data) > 1e-9) else value.data
    listed = numbers.tolist()
    return tuple(listed) if isinstance(listed, list) and not value.type.is_matrix else listed


def _moment(given: Sequence[Expr], values: Values) -> str:
    """The values that some expressions read: "time = -50, speed = 2"."""
    read = ["time = {:g}".format(values.time)] if find(given, "time") else []
    for leaf in find(given, "param"):
        value = values.params.get(leaf.data.name, leaf.data.value)
        numbers = ", ".join(f"{v:g}" for v in np.atleast_1d(value))
        read.append(f"{leaf.data.name} = {f'({numbers})' if isinstance(value, tuple) else numbers}")
    return ", ".join(read)


def _sentence(where: Location | None, what: str, when: str, legal: str) -> str:
    return f"{f'{where}: ' if where else ''}{what} at {when}{f' ({legal})' if legal else ''}"
