"""Fields of nodes as functions: evaluated in float64, and printed as GLSL."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import AbstractContextManager, nullcontext
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from raymarch.conveniences import carried_out_by
from raymarch.errors import SceneError
from raymarch.expr.arrays import bound, evaluator_of
from raymarch.expr.convert import numbers, real, short
from raymarch.expr.derivative import companion
from raymarch.expr.function import Function
from raymarch.expr.glsl import print_functions
from raymarch.expr.node import Expr
from raymarch.expr.types import vector
from raymarch.expr.walk import find
from raymarch.sdf.lower import Lowering
from raymarch.sdf.node import Node, called_by_nodes


def lower(node: Node) -> Function:
    """The field of a node as a function `float field(vec3 p)`."""
    return Lowering().field(node)


BLOCK = 1 << 14
"""Points that are evaluated at once; this limits the size of temporary arrays."""


@called_by_nodes
def distance_at(node: Node, points: ArrayLike | Expr) -> NDArray[np.float64] | Expr:
    """Distances in float64, or their expression; see `Node.distance`."""
    if isinstance(points, Expr) and points.type is vector(node.dimension):
        return field_of(node).once("distance_to", lambda: Lowering().field(node, "distance_to"))(points)
    return evaluate_distance(node, _points(node, points))


def evaluate_distance(node: Node, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distances in float64; points has shape (N, dimension) or (dimension,)."""
    return in_blocks(field_of(node), points, ()).reshape(points.shape[:-1])


def _points(node: Node, points: ArrayLike | Expr) -> NDArray[np.float64]:
    legal = f"(N, {node.dimension}) or ({node.dimension},)"
    array = numbers("points", points, legal)
    if array.ndim not in (1, 2) or array.shape[-1] != node.dimension:
        raise SceneError(f"points of shape {array.shape}", legal=legal)
    return array


@called_by_nodes
def values_bound(node: Node, time: float, params: Mapping[str, Any] | None) -> AbstractContextManager[None]:
    """Bind the time and values of parameters for an evaluation, if any are given; see `Node.distance`."""
    seconds = real("time", time)
    if not params and seconds == 0.0:
        return nullcontext()  # the defaults, or what is bound around the call
    if not params:
        carried_out_by("warn_of_values")(node, {}, seconds)
        return bound({}, seconds)
    specs = {leaf.data.name: leaf.data for leaf in find(field_of(node).inner, "param")}
    for name in params:
        if name not in specs:
            known = ", ".join(sorted(specs)) or "none; this solid has no Param"
            raise SceneError(f"unknown parameter '{name}' = {short(params[name])}", legal=f"one of: {known}")
    known_values = {name: specs[name].accept(value) for name, value in params.items()}
    carried_out_by("warn_of_values")(node, known_values, seconds)
    return bound(known_values, seconds)


def undivided_field(node: Node) -> Function:
    """The field of a node before it is divided, for evaluation."""
    if not node.facts.divided:
        return field_of(node)
    return field_of(node).once("undivided", lambda: Lowering().field(node, undivided=True))


def evaluate_undivided(node: Node, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Values of the field before it is divided, in float64; points has shape (N, dimension)."""
    return in_blocks(undivided_field(node), points, ())


def evaluate_both(field: Function, points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Values and gradients of a field, in float64: (N,) and (N, dimension)."""
    found = in_blocks(companion(field), points, (points.shape[1] + 1,))
    return found[:, -1], found[:, :-1]


@called_by_nodes
def evaluate_gradient(node: Node, points: ArrayLike) -> NDArray[np.float64]:
    """Gradients in float64; see `Node.gradient`."""
    at, size = _points(node, points), node.dimension
    return in_blocks(companion(field_of(node)), at, (size + 1,))[..., :size].reshape(at.shape)


def field_of(node: Node) -> Function:
    """The field of a node for evaluation: a node is lowered once."""
    if node._field is None:
        node._field = lower(node)
    return node._field


def in_blocks(definition: Function, points: NDArray[np.float64], shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Values of a function of a point, each of `shape`, for all points in order."""
    value = evaluator_of(definition)
    flat = points.reshape(-1, points.shape[-1])
    result = np.empty((len(flat), *shape))
    for i in range(0, len(flat), BLOCK):
        result[i : i + BLOCK] = value(flat[i : i + BLOCK])[0]
    return result


@called_by_nodes
def print_field(node: Node) -> str:
    """GLSL of the field alone; see `Node.glsl`."""
    text = print_functions([lower(node)])
    uniforms = [f"uniform {leaf.type} {name};" for name, leaf in text.uniforms.items()]
    if text.uses_time:
        uniforms.append("uniform float u_time;")
    uniforms += [f"uniform sampler{data.dimension}D {name};" for name, data in text.samples.items()]
    lines = [line.text for line in text.lines()]
    return "\n".join([*uniforms, *([""] if uniforms else []), *lines]) + "\n"
