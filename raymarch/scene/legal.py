"""Checks of values in each frame.

An illegal number is refused where it is written. A value that depends on time or a parameter may be legal in one frame
and illegal in the next. Each frame checks it in float64 on the CPU, by the rules that refuse numbers.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Protocol

import numpy as np

from raymarch.errors import Doubt, Location, SceneError, warn_of_doubts
from raymarch.expr.arrays import SMALLEST, bound, evaluator
from raymarch.expr.convert import LARGEST
from raymarch.expr.intervals import interval_of
from raymarch.expr.limits import may_overflow
from raymarch.expr.node import Expr, const
from raymarch.expr.walk import find, substitute
from raymarch.scene.parameter import Values
from raymarch.scene.scene import Scene, all_nodes
from raymarch.sdf.node import Node, children_first


class Condition(Protocol):
    """Something that must hold in each frame."""

    def broken(self, values: Values) -> Doubt | None:
        """The violation in a frame, as one sentence with the user's line; None if the condition holds."""


def conditions_of(scene: Scene) -> list[Condition]:
    """The conditions to check in each frame, because they could not be proven when the scene was built."""
    return [*_conditions_of_solid(scene.node), *(_IsWithin(marked) for marked in find(scene.expressions(), "within"))]


def violations(conditions: Sequence[Condition], values: Values) -> list[Doubt]:
    """The violations in a frame, one sentence each."""
    found = (condition.broken(values) for condition in conditions)
    return list(dict.fromkeys(sentence for sentence in found if sentence is not None))


def warn_of_values(root: Node, params: Mapping[str, Any], time: float) -> None:
    """RenderWarning for parameters of a solid that are out of range in a frame, as `render` warns of them."""
    warn_of_doubts(violations(_conditions_of_solid(root), Values(params, time)))


def _conditions_of_solid(root: Node) -> list[Condition]:
    return _conditions_of(_Itself(root))


@dataclass(frozen=True, slots=True, eq=False)
class _Itself:
    """A solid as a key that equals no other: messages name lines, and equal solids may be written at others."""

    node: Node

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Itself) and self.node is other.node

    def __hash__(self) -> int:
        return id(self.node)


@lru_cache(64)
def _conditions_of(solid: _Itself) -> list[Condition]:
    return [_NodeIsLegal(node) for node in all_nodes(solid.node) if _is_open(node)]


def _moving(node: Node) -> list[str]:
    """The parameters of a node that depend on time or a `Param`."""
    return [name for name, value in node.params.items() if isinstance(value, Expr) and not value.is_constant]


def _is_open(node: Node) -> bool:
    """True if the parameters of a node might be illegal at some time, or for some values of a `Param`.

    A `Param` is known to be legal over its whole range, but not as a direction, and not together with other parameters.
    """
    names = _moving(node)
    return bool(names) and (node.definition.check is not None or any(_is_unproven(node, name) for name in names))


def _is_unproven(node: Node, name: str) -> bool:
    domain = node.definition.domains[name]
    if domain.direction or may_overflow(node.params[name]):
        return True
    low, high = interval_of(node.params[name])
    return not np.all((low > domain.low if domain.open else low >= domain.low) & (high <= domain.high))


class _NodeIsLegal:
    """The parameters of a node, checked by its domains and its own check."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._names = _moving(node)
        self._given = [_as_given(node, name) for name in self._names]
        self._run = None if find(self._given, "cell") else evaluator(self._given, [])

    def broken(self, values: Values) -> Doubt | None:
        node, domains = self._node, self._node.definition.domains
        if self._run is not None and node.definition.check is None:
            with bound(values.params, values.time):
                inside = zip(self._names, self._run(), strict=True)
                if all(_is_inside(value, domains[n].low, domains[n].high, domains[n].direction) for n, value in inside):
                    return None
        now: dict[str, Any] = dict(node.params)
        try:
            for name, value in zip(self._names, _at_frame(self._given, values), strict=True):
                now[name] = domains[name].accept(node.name, name, _plain(value))
            node.definition.require([child.facts for child in node.children], now)
        except SceneError as fault:
            return _sentence(node.where, fault.what, _values_read(self._given, values), fault.legal)
        return None


class _IsWithin:
    """A value of a light, a material, the sky, ... that is marked with its range."""

    def __init__(self, marked: Expr) -> None:
        (self._given,), self._limit = marked.args, marked.data
        self._run = None if find([self._given], "cell") else evaluator([self._given], [])

    def broken(self, values: Values) -> Doubt | None:
        limit = self._limit
        if self._run is not None:
            with bound(values.params, values.time):
                if _is_inside(self._run()[0], limit.low, limit.high, limit.nonzero):
                    return None
        (value,) = _at_frame([self._given], values)
        if limit.holds(value):
            return None
        ends = [end.tolist() for end in interval_of(value)]
        shown = _plain(value) if value.is_constant else f"between {ends[0]} and {ends[1]}"
        return _sentence(limit.where, f"{limit.what} = {shown}", _values_read([self._given], values), limit.legal)


def _is_inside(value: Any, low: float, high: float, nonzero: bool) -> bool:
    """True if a value is certainly legal: strictly inside its range and of float32."""
    inside = np.all((value > low) & (value < high) & (np.abs(value) < LARGEST))
    return bool(inside) and (not nonzero or bool(np.any(np.abs(value) > SMALLEST)))


def _as_given(node: Node, name: str) -> Expr:
    """A parameter as the user gave it; a direction before normalisation."""
    value: Expr = node.params[name]
    normalised = node.definition.domains[name].direction and value.op == "normalize"
    return value.args[0] if normalised else value


def _at_frame(given: Sequence[Expr], values: Values) -> list[Expr]:
    """Expressions with the parameters and time of a frame substituted: constants, unless they depend on a cell."""
    known = {leaf: const(values.time) for leaf in find(given, "time")}
    known |= {leaf: const(values.params.get(leaf.data.name, leaf.data.value)) for leaf in find(given, "param")}
    return substitute(given, known)


def solid_at(root: Node, values: Values) -> Node:
    """The solid of a frame: with the parameters and time of the frame as constants."""
    made: dict[int, Node] = {}
    for node in children_first(root):
        names = _moving(node)
        children = tuple(made[id(child)] for child in node.children)
        if names or any(a is not b for a, b in zip(children, node.children, strict=True)):
            now = dict(zip(names, _at_frame([node.params[name] for name in names], values), strict=True))
            made[id(node)] = Node(node.definition, children, {**node.params, **now}, label=node.label)
        else:
            made[id(node)] = node
    return made[id(root)]


def _plain(value: Expr) -> Any:
    """A constant as plain numbers, as a user would write it; other expressions unchanged."""
    if not value.is_constant:
        return value
    numbers = np.round(value.data, 12) if np.all(np.abs(value.data) > 1e-9) else value.data
    listed = numbers.tolist()
    return tuple(listed) if isinstance(listed, list) and not value.type.is_matrix else listed


def _values_read(given: Sequence[Expr], values: Values) -> str:
    """The time and parameters that expressions read, such as "time = -50, speed = 2"."""
    read = [f"time = {values.time:g}"] if find(given, "time") else []
    for leaf in find(given, "param"):
        value = values.params.get(leaf.data.name, leaf.data.value)
        numbers = ", ".join(f"{v:g}" for v in np.atleast_1d(value))
        read.append(f"{leaf.data.name} = {f'({numbers})' if isinstance(value, tuple) else numbers}")
    return ", ".join(read)


def _sentence(where: Location | None, what: str, when: str, legal: str) -> Doubt:
    return Doubt("values", f"{what} at {when}", legal, where)
