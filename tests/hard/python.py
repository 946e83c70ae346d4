"""A node as Python that makes it again, for the reports of the fuzzer."""

from __future__ import annotations

from typing import Any

import numpy as np

import raymarch as rm
from raymarch.expr.function import Function
from raymarch.expr.node import Expr
from tests.support.node_samples import definitions


def make(name: str, *children: rm.Node, **params: Any) -> rm.Node:
    """A node of the definition with this name."""
    return next(d for d in definitions() if d.name == name).make(children, (), params)


def as_python(node: rm.Node) -> str:
    """One expression of `make`, deep trees on several lines."""
    parts = [as_python(child) for child in node.children]
    for name, value in node.params.items():
        shown = _value(value)
        if shown is not None:
            parts.append(f"{name}={shown}")
    inline = f"make({', '.join([repr(node.definition.name), *parts])})"
    if len(inline) <= 100:
        return inline
    lines = ",\n".join([repr(node.definition.name), *parts]).replace("\n", "\n    ")
    return f"make(\n    {lines},\n)"


def _value(value: Any) -> str | None:
    """None for data, which the definition's default stands for."""
    if isinstance(value, Expr):
        return repr(np.asarray(value.data).tolist()) if value.is_constant else f"<{value!r}>"
    if isinstance(value, Function):
        return f"<{value!r} {value.body!r}>"
    return repr(value) if isinstance(value, int | float | str | tuple) else None
