"""The reading of expressions along stretches of rays: ranges of value and slope, rounded outwards.

A value is a `Span`. For each of N stretches it has the range of the value, its value at one point of the stretch (the
centre), and the range of its slope, the change per unit of length. Each operation has three results: the range of its
arguments' ranges, the value at the centre, and the slope by the chain rule. By the mean value theorem the range also
lies within centre + slope x (distance from the centre); the common part of both is kept. So ranges of a smooth function
are as wide as the stretch at first, and their excess shrinks with its square.

Where a value may jump (a floor, a condition, the cut of an angle), the slope is unknown, and its range counts alone.
Kinks (min, abs) have the slopes of both sides (Clarke 1983, the mean value theorem of functions with kinks).

A short stretch over a jump has two values only, such as two neighbouring cells. Each is evaluated on the whole stretch
(`sides`): both are smooth, and at each point the field is one of them. So their hull holds the field.

This reading is apart from `raymarch.expr.intervals` and from `raymarch.expr.derivative`, whose results it judges.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from raymarch.expr.arrays import FLOAT64
from raymarch.expr.evaluate import Program, Rule, program_of
from raymarch.expr.function import Function, Loop
from raymarch.expr.node import Expr
from raymarch.expr.types import BOOL
from raymarch.proof import choices, components, data, vectors
from raymarch.proof.loops import repeated
from raymarch.proof.span import Span, condition, constant, still

RULES: Mapping[str, Rule] = {
    **components.RULES,
    **vectors.RULES,
    **choices.RULES,
    **data.RULES,
    "record": lambda _node, *values: values,
    "field": lambda node, value: value[[name for name, _ in node.args[0].type.fields].index(node.data)],
    "probe": lambda _node, value, *_: value,
    "within": lambda _node, value: value,
    "stop_gradient": lambda _node, value: value,
}


SOLVED: WeakKeyDictionary[Function, float] = WeakKeyDictionary()
"""Functions of a point that solve an equation in a loop, with their Lipschitz constants, which are assumed."""


def _solved(program: Callable[..., Any], steepest: float, point: Span, *params: Span) -> Span | None:
    """The value at the centre, and a slope of at most the constant times the speed; None for parameters that vary.

    Newton's method on intervals diverges, although the root hardly moves.
    """
    if point.slope is None or any(v.slope is not None for v in params):
        return None
    at = program(still(point.at), *[still(v.at) for v in params])[0].range
    return data.limited(at, point.slope, steepest)


def _call(node: Expr) -> Rule:
    """The step of a call."""
    definition: Function = node.data
    program = program_of(definition, ENCLOSURES)

    def step(*values: Any) -> Any:
        steepest = SOLVED.get(definition)
        found = None if steepest is None else _solved(program, steepest, *values)
        return program(*values)[0] if found is None else found

    return step


class Enclosures:
    """The reading; its state is that of `stretches`. Parameters and time have the values that `bound` set."""

    makers: Mapping[str, Callable[[Expr], Rule]] = {"call": _call}

    @property
    def rules(self) -> Mapping[str, Rule]:
        return {
            **RULES,
            "param": lambda node: constant(FLOAT64._param(node)),
            "time": lambda node: constant(FLOAT64._time(node)),
        }

    def leaf(self, node: Expr) -> Span:
        if node.type is BOOL:
            return condition(np.asarray(node.data), np.asarray(node.data))
        return constant(np.asarray(node.data, np.float64))

    def repeat(self, body: Loop, program: Program, first: list[Any], captured: list[Any]) -> tuple[Any, ...]:
        return repeated(body, program, first, captured)


ENCLOSURES = Enclosures()
