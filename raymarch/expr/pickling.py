"""Pickles of expressions: a table with one row per expression, arguments first."""

from __future__ import annotations

from typing import Any

import numpy as np

from raymarch.errors import Location, SceneError
from raymarch.expr.arrays import RULES
from raymarch.expr.convert import short
from raymarch.expr.node import Expr, called_by_expressions, make
from raymarch.expr.types import BOOL, TYPES
from raymarch.expr.walk import topological

ACCEPTED = {*RULES, "const", "var", "param", "time", "call", "loop", "item", "apply", "mark", "cell"}
"""Operations that unpickling accepts."""


@called_by_expressions
def reduced(root: Expr) -> tuple[Any, ...]:
    """What pickle makes of an expression, however deep it is."""
    numbers = {node: i for i, node in enumerate(topological([root]))}
    rows = [(n.op, n.type.name, tuple(numbers[arg] for arg in n.args), n.data, n.where) for n in numbers]
    return remade, (rows,)


def remade(rows: Any) -> Expr:
    """The expression of a table; returns the existing one if it is equal."""
    made: list[Expr] = []
    try:
        for op, name, arguments, data, where in rows:
            if op not in ACCEPTED:
                raise ValueError(f"no operation {short(op)}")
            type = next(known for known in TYPES if known.name == name)
            if op == "const":
                data = np.array(data, bool if type is BOOL else np.float64)
                data.setflags(write=False)
                if data.shape != type.shape:
                    raise ValueError(f"a constant of shape {data.shape} for a {type}")
            node = make(op, type, tuple(made[i] for i in arguments), data)
            if node.where is None and isinstance(where, Location):
                node.where = where
            made.append(node)
        return made[-1]
    except (TypeError, ValueError, IndexError, StopIteration) as fault:
        raise SceneError(f"unpickling an expression: {fault}", legal="the pickle of an expression") from fault
