"""What of a field depends on time alone is worked out in float64, once a frame.

A day after the start one unit in the last place of float32 is .0078 s: an angle of `time` would turn in jerks. Sines,
angles and offsets of time reach the shader as uniforms instead, which is also less work for every evaluation.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from raymarch.errors import Location
from raymarch.expr.function import Function
from raymarch.expr.node import Expr, make
from raymarch.expr.types import Type
from raymarch.expr.walk import find, rebuild, rewrite, topological
from raymarch.scene.parameter import Spec, Value, Values

HELD = {"var", "apply", "cell", "loop", "item", "mark", "sample", "sample_slope", "texture", "raw", "raw_slope"}
"""Operations that depend on the point, or that only the shader can do."""


def by_moment(field: Function, origins: dict[Expr, Location]) -> tuple[Function, dict[str, Expr]]:
    """The field with new parameters in place of what depends on time alone, and the expression of each parameter.

    `origins`, the user's line of each expression, is continued for the new ones.
    """
    leaves: dict[Expr, Expr] = {}
    moments: dict[str, Expr] = {}
    for node in _largest(field.body):
        name = f"moment {len(moments)}"
        moments[name] = node
        leaves[node] = make(
            "param", node.type, (), Spec(name, _plain(Values({}).of(node)), None, None, origins.get(node))
        )
    if not moments:
        return field, moments
    new = rewrite([field.body], lambda node, args: leaves[node] if node in leaves else rebuild(node, args))
    for old, changed in new.items():
        if changed is not old and old in origins:
            origins.setdefault(changed, origins[old])
    return Function(field.name, field.params, new[field.body], where=field.where), moments


def at_moment(moments: Mapping[str, Expr], values: Values) -> Values:
    """The values of a frame, with those of the new parameters."""
    if not moments:
        return values
    known = {name: _plain(values.of(node)) for name, node in moments.items()}
    return Values({**values.params, **known}, values.time)


def _largest(body: Expr) -> list[Expr]:
    """The expressions of time that something other uses, but not time itself: float32 holds that as well as can be."""
    still: set[Expr] = set()
    moving: set[Expr] = set()
    found: dict[Expr, None] = {}
    for node in topological([body]):
        if node.op in HELD or not all(arg in still for arg in node.args):
            found.update((arg, None) for arg in node.args if arg in moving)
            continue
        if _has_leaf(node.type):
            still.add(node)
            if (
                node.op == "time"
                or any(arg in moving for arg in node.args)
                or (node.op == "call" and find([node], "time"))
            ):
                moving.add(node)
        else:  # no parameter can be a matrix or a truth: its parts are
            found.update((arg, None) for arg in node.args if arg in moving)
    if body in moving:
        found[body] = None
    return [node for node in found if node.op != "time"]


def _has_leaf(type: Type) -> bool:
    return not type.is_matrix and type.name in ("float", "vec2", "vec3", "vec4")


def _plain(value: np.ndarray) -> Value:
    return float(value) if value.shape == () else tuple(float(v) for v in value)
