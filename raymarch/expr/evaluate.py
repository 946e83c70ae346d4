"""The evaluator of all readings that compute values; a table of rules defines each operation.

A rule is `rule(node, *values of the arguments) -> value`. Functions and loops are handled here, by evaluation of their
inner expressions. A reading defines only how a loop is repeated.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, Protocol, TypeAlias

from raymarch.expr.function import Function, Loop
from raymarch.expr.node import Expr
from raymarch.expr.walk import topological

Rule: TypeAlias = Callable[..., Any]
Step: TypeAlias = Callable[..., Any]
"""A rule with its node: computes a value from the values of the arguments."""


class Reading(Protocol):
    """The interface of a reading."""

    @property
    def rules(self) -> Mapping[str, Rule]:
        """The rule of each operation."""

    def leaf(self, node: Expr) -> Any:
        """Value of a constant."""

    def repeat(self, body: Loop, program: Program, first: list[Any], captured: list[Any]) -> tuple[Any, ...]:
        """Value of a loop: `program` returns the next state and, last, the exit condition if there is one."""


class Program:
    """Expressions compiled for repeated evaluation: a list of steps over numbered slots."""

    def __init__(self, roots: Sequence[Expr], inputs: Sequence[Expr], reading: Reading) -> None:
        order = topological(roots)
        slot = {node: i for i, node in enumerate(inputs)}
        last_use: dict[Expr, int] = {}
        self._start: list[Any] = [None] * len(inputs)
        self._steps: list[tuple[Step, tuple[int, ...], int, tuple[int, ...]]] = []
        rules: Mapping[str, Rule] = reading.rules
        makers: Mapping[str, Callable[[Expr], Step]] = getattr(reading, "makers", {})
        work = []
        for node in order:
            if node in slot:
                continue
            slot[node] = len(self._start)
            self._start.append(reading.leaf(node) if node.op == "const" else None)
            if node.op != "const":
                work.append(node)
        for i, node in enumerate(work):
            for arg in node.args:
                last_use[arg] = i
        keep = set(roots) | set(inputs)
        free: dict[int, list[int]] = {}
        for node, i in last_use.items():
            if node not in keep and node.op != "const":
                free.setdefault(i, []).append(slot[node])
        for i, node in enumerate(work):
            arguments = tuple(slot[arg] for arg in node.args)
            step = makers[node.op](node) if node.op in makers else partial(_rule(node, reading, rules), node)
            self._steps.append((step, arguments, slot[node], tuple(free.get(i, ()))))
        self._results = [slot[root] for root in roots]

    def __call__(self, *inputs: Any) -> tuple[Any, ...]:
        slots = self._start.copy()
        slots[: len(inputs)] = inputs
        for step, arguments, result, dead in self._steps:
            count = len(arguments)  # nearly always one or two
            if count == 2:
                slots[result] = step(slots[arguments[0]], slots[arguments[1]])
            elif count == 1:
                slots[result] = step(slots[arguments[0]])
            else:
                slots[result] = step(*[slots[i] for i in arguments])
            for i in dead:  # frees intermediate arrays; large graphs over many points would otherwise keep all
                slots[i] = None
        return tuple([slots[i] for i in self._results])


def _rule(node: Expr, reading: Reading, rules: Mapping[str, Rule]) -> Rule:
    if node.op == "call":
        return _call_rule(node.data, reading)
    if node.op == "loop":
        return _loop_rule(node.data, reading)
    if node.op == "item":
        return _item
    try:
        return rules[node.op]
    except KeyError:
        raise KeyError(f"{type(reading).__name__} has no rule for '{node.op}' ({node!r})") from None


def program_of(definition: Function, reading: Reading) -> Callable[..., Any]:
    """How a reading evaluates a function: as it is stated, or the program of its body."""
    return definition.stated.programs.get(reading) or definition.once(
        ("program", reading), lambda: Program([definition.body], definition.params, reading)
    )


def _call_rule(definition: Function, reading: Reading) -> Rule:
    program = program_of(definition, reading)
    return lambda _node, *args: program(*args)[0]


def _loop_rule(body: Loop, reading: Reading) -> Rule:
    program = Program(body.inner, (body.index, *body.state, *body.captured), reading)
    n = len(body.state)
    return lambda _node, *args: reading.repeat(body, program, list(args[:n]), list(args[n:]))


def _item(node: Expr, results: tuple[Any, ...]) -> Any:
    return results[node.data]
