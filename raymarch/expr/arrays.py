"""The NumPy reading: float64 is the reference, float32 is the twin of the GPU's computation.

There is one value for each of N points: scalars are arrays (N,), vectors (N, n), matrices (N, n, n). A value that is
the same for all points may lack the first axis.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from operator import itemgetter
from typing import Any, ClassVar, Generic, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from raymarch.expr import hashing, raw, samples, tables, textures
from raymarch.expr.evaluate import Program, Rule, Step
from raymarch.expr.function import Function, Loop
from raymarch.expr.node import Expr, called_by_expressions
from raymarch.expr.types import BOOL, FLOAT, Type
from raymarch.expr.walk import find, free_variables

Array: TypeAlias = Any
"""A NumPy array of any shape and precision."""

Result = TypeVar("Result")

KEPT = 4
"""Number of results of a function of parameters and time that are kept: those of the frames of a moment."""

SMALLEST = float(np.finfo(np.float32).tiny)
"""Smallest normal float32: the lower bound of divisors and of the arguments of logarithms and powers in all
readings."""

SHORTEST = float(np.sqrt(SMALLEST))
"""Shortest length whose square is a normal float32. If it were shorter, `normalize` could return a vector longer than 1
for a shorter vector, whose length underflows to 0."""


def lift(value: Array, own: Type, wanted: Type) -> Array:
    """Broadcast a scalar over the components of a vector or matrix."""
    if own.shape == wanted.shape or own.shape:
        return value
    return np.asarray(value)[(..., *(None,) * len(wanted.shape))]


Maker: TypeAlias = Callable[[Expr], Step]
"""The step of a node: what the node decides is decided once."""


def each(compute: Callable[..., Array]) -> Maker:
    """An operation that works on each component."""

    def make(node: Expr) -> Step:
        lifted = [bool(node.type.shape) and not a.type.shape for a in node.args]
        if not any(lifted):
            return compute
        axes = (..., *(None,) * len(node.type.shape))
        if lifted == [True, False]:
            return lambda a, b: compute(np.asarray(a)[axes], b)
        if lifted == [False, True]:
            return lambda a, b: compute(a, np.asarray(b)[axes])
        return lambda *values: compute(
            *[np.asarray(v)[axes] if scalar else v for v, scalar in zip(values, lifted, strict=True)]
        )

    return make


def _swizzle(node: Expr) -> Step:
    picks = ["xyzw".index(c) for c in node.data]
    return itemgetter((..., picks[0] if len(picks) == 1 else picks))


def _construct(node: Expr) -> Step:
    scalar = [a.type is FLOAT for a in node.args]

    def compute(*parts: Array) -> Array:
        columns = [p if one else np.moveaxis(p, -1, 0) for p, one in zip(map(np.asarray, parts), scalar, strict=True)]
        numbers = [n for column, one in zip(columns, scalar, strict=True) for n in ([column] if one else column)]
        made = np.empty((*np.broadcast_shapes(*(n.shape for n in numbers)), len(numbers)), np.result_type(*numbers))
        for i, number in enumerate(numbers):
            made[..., i] = number
        return made

    return compute


def _smoothstep(low: Array, high: Array, x: Array) -> Array:
    t = np.clip((x - low) / (high - low), 0, 1)
    return t * t * (3 - 2 * t)


def _dot(a: Array, b: Array) -> Array:
    """The sum of the products of all components, first to last: np.einsum takes up to six times as long."""
    products = a * b
    total = products[..., 0]
    for i in range(1, products.shape[-1]):
        total = total + products[..., i]
    return total


def _length(v: Array) -> Array:
    return np.sqrt(_dot(v, v))


def _atan2(y: Array, x: Array) -> Array:
    return np.where((x == 0) & (y == 0), x.dtype.type(0), np.arctan2(y, x))  # arctan2(0, -0) would be pi


def _cross(_node: Expr, a: Array, b: Array) -> Array:
    (ax, ay, az), (bx, by, bz) = np.moveaxis(a, -1, 0), np.moveaxis(b, -1, 0)
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=-1)


def _where(node: Expr, condition: Array, a: Array, b: Array) -> Array:
    if node.type.fields:
        pairs = zip(node.type.fields, a, b, strict=True)
        return tuple(np.where(lift(condition, BOOL, type), one, other) for (_, type), one, other in pairs)
    return np.where(lift(condition, BOOL, node.type), a, b)


MAKERS: Mapping[str, Maker] = {
    **{op: each(getattr(np, op)) for op in "sign floor ceil exp exp2 sin cos tan sinh cosh tanh".split()},
    "add": each(np.add),
    "sub": each(np.subtract),
    "mul": each(np.multiply),
    "div": each(np.divide),
    "mod": each(lambda x, y: x - y * np.floor(x / y)),
    "neg": each(np.negative),
    "abs": each(np.abs),
    "round": each(lambda x: np.floor(x + x.dtype.type(0.5))),
    "fract": each(lambda x: x - np.floor(x)),
    "sqrt": each(lambda x: np.sqrt(np.maximum(x, 0))),
    "log": each(lambda x: np.log(np.maximum(x, x.dtype.type(SMALLEST)))),
    "log2": each(lambda x: np.log2(np.maximum(x, x.dtype.type(SMALLEST)))),
    "asin": each(lambda x: np.arcsin(np.clip(x, -1, 1))),
    "acos": each(lambda x: np.arccos(np.clip(x, -1, 1))),
    "atan": each(np.arctan),
    "atan2": each(_atan2),
    "pow": each(lambda x, y: np.power(np.maximum(x, x.dtype.type(SMALLEST)), y)),
    "min": each(np.minimum),
    "max": each(np.maximum),
    "step": each(lambda edge, x: np.where(x < edge, 0, 1).astype(x.dtype)),
    "clamp": each(lambda x, low, high: np.minimum(np.maximum(x, low), high)),
    "mix": each(lambda a, b, t: a * (1 - t) + b * t),
    "smoothstep": each(_smoothstep),
    "lt": each(np.less),
    "le": each(np.less_equal),
    "and": each(np.logical_and),
    "or": each(np.logical_or),
    "not": each(np.logical_not),
    "swizzle": _swizzle,
    "construct": _construct,
}

RULES: Mapping[str, Rule] = {
    **{op: lambda node, *values, maker=maker: maker(node)(*values) for op, maker in MAKERS.items()},
    "where": _where,
    "dot": lambda _node, a, b: _dot(a, b),
    "cross": _cross,
    "length": lambda _node, v: _length(v),
    "normalize": lambda _node, v: v / np.maximum(_length(v), v.dtype.type(SHORTEST))[..., None],
    "columns": lambda _node, *columns: np.stack(np.broadcast_arrays(*columns), axis=-1),
    "matmul": lambda node, a, b: np.einsum("...ij,...j->...i", a, b) if node.type.is_vector else np.matmul(a, b),
    "transpose": lambda _node, m: np.swapaxes(m, -1, -2),
    "sample": samples.evaluate,
    "sample_slope": samples.evaluate_slope,
    "sample_bend": samples.evaluate_bend,
    "texture": textures.evaluate,
    "texture_in_atlas": textures.evaluate_in_atlas,
    "fetch": tables.evaluate,
    "hash": hashing.evaluate,
    "record": lambda _node, *values: values,
    "field": lambda node, value: value[[name for name, _ in node.args[0].type.fields].index(node.data)],
    "finite": lambda node, x: np.isfinite(x).all(axis=-1) if node.args[0].type.shape else np.isfinite(x),
    "probe": lambda _node, value, *_: value,
    "within": lambda _node, value: value,
    "stop_gradient": lambda _node, value: value,
    "raw": raw.evaluate,
    "raw_slope": raw.evaluate_slope,
}


@dataclass(frozen=True, slots=True)
class Arrays:
    """The reading at one precision."""

    dtype: type[np.floating[Any]]

    makers: ClassVar[Mapping[str, Maker]] = MAKERS

    @property
    def rules(self) -> Mapping[str, Rule]:
        return {**RULES, "param": self._param, "time": self._time}

    def leaf(self, node: Expr) -> Array:
        return node.data if node.type is BOOL else node.data.astype(self.dtype)

    def _param(self, node: Expr) -> Array:
        return np.asarray(_bound.stack[-1][0].get(node.data.name, node.data.value), self.dtype)

    def _time(self, _node: Expr) -> Array:
        return np.asarray(_bound.stack[-1][1], self.dtype)

    def repeat(self, body: Loop, program: Program, first: list[Any], captured: list[Any]) -> tuple[Any, ...]:
        state, alive = first, np.asarray(True)
        n = len(first)
        for turn in range(body.count):
            after = program(np.asarray(turn, self.dtype), *state, *captured)
            if body.until is not None:
                alive = alive & ~after[n]
                if not alive.any():
                    break
            state = [
                np.where(lift(alive, BOOL, v.type), new, old)
                for v, new, old in zip(body.state, after[:n], state, strict=True)
            ]
        return tuple(state)


FLOAT64 = Arrays(np.float64)
FLOAT32 = Arrays(np.float32)


class _Bound(threading.local):
    """Stack of bound values, the innermost last; each thread has its own."""

    def __init__(self) -> None:
        self.stack: list[tuple[Mapping[str, Any], float]] = [({}, 0.0)]


_bound = _Bound()


@contextmanager
def bound(params: Mapping[str, Any], time: float) -> Iterator[None]:
    """Bind values to parameters and time inside the block; other parameters keep their defaults."""
    _bound.stack.append((params, time))
    try:
        yield
    finally:
        _bound.stack.pop()


def bound_values() -> tuple[Mapping[str, Any], float]:
    """The values of parameters and the time that are bound."""
    return _bound.stack[-1]


def evaluator(
    roots: Sequence[Expr], inputs: Sequence[Expr], dtype: type[np.floating[Any]] = np.float64
) -> Callable[..., tuple[Array, ...]]:
    """Compile expressions to a function from one array per input to one array per root."""
    reading = FLOAT64 if dtype is np.float64 else FLOAT32
    program = Program(roots, inputs, reading)

    def run(*values: Any) -> tuple[Array, ...]:
        with np.errstate(all="ignore"):
            return program(*[np.asarray(v, dtype) for v in values])

    return run


def evaluator_of(definition: Function) -> Callable[..., tuple[Array, ...]]:
    """The float64 evaluator of a function, which remembers it."""
    return definition.once("evaluator", lambda: evaluator([definition.body], definition.params))


class Remembered(Generic[Result]):
    """A function of the bound parameters and time: its last results are kept.

    make : the function. leaves : the parameters and time that it reads.
    """

    def __init__(self, make: Callable[[], Result], leaves: Sequence[Expr]) -> None:
        self.make, self.leaves = make, leaves
        self._known: dict[tuple[bytes, ...], Result] = {}

    def __call__(self) -> Result:
        now = tuple((FLOAT64._param if e.op == "param" else FLOAT64._time)(e).tobytes() for e in self.leaves)
        if now not in self._known:
            result = self.make()
            for old in list(self._known)[: -KEPT + 1]:
                self._known.pop(old, None)
            self._known[now] = result
            return result
        return self._known[now]


@called_by_expressions
def number_of(node: Expr) -> float | None:
    """The number of an expression of constants alone, such as a noise of a point; None for any other."""
    if free_variables([node]) or find([node], "param", "time", "raw", "raw_slope"):
        return None
    return float(value_of(node))


def value_of(node: Expr) -> Array:
    """The float64 value of an expression without variables, for the bound parameters and time."""
    if node.op == "const":
        return np.asarray(node.data)
    return evaluator([node], [])()[0]


BLOCK = 1 << 15
"""Numbers of a block of rows: several such arrays stay in the cache of the processor."""


def row_blocks(values: NDArray[Any]) -> Iterator[slice]:
    """Slices of the first axis, each with about `BLOCK` numbers."""
    rows = max(1, BLOCK * len(values) // max(values.size, 1))
    for first in range(0, len(values), rows):
        yield slice(first, min(first + rows, len(values)))
