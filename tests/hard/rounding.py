"""What float32 may lose in a field: a running bound of the rounding errors, beside the float64 values.

Another reading of the same expressions. A value is a pair: what float64 gives, and the most that a device may be off,
to first order (Higham, Accuracy and Stability of Numerical Algorithms, 3.3). Errors that come in are handed on by the
slope of an operation, and each operation adds its own: half an ulp where IEEE rounds, else what GLSL and Vulkan allow.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

import raymarch as rm
from raymarch.expr import arrays
from raymarch.expr.evaluate import Program
from raymarch.expr.node import Expr
from raymarch.expr.types import BOOL
from raymarch.sdf.evaluation import lower
from tests.support.analytic import ULP

Array: TypeAlias = Any


class Near(NamedTuple):
    """A value and its error; for a condition, whether it might be the other way round."""

    value: Array
    error: Array


Rule: TypeAlias = Callable[..., Near]


def _monotone(own: float) -> Callable[..., Rule]:
    """A function that only rises or only falls errs by its difference at the ends, and by `own` ulp of the result."""

    def make(name: str) -> Rule:
        compute = arrays.RULES[name]

        def rule(node: Expr, x: Near) -> Near:
            value = compute(node, x.value)
            apart = [np.abs(compute(node, x.value + sign * x.error) - value) for sign in (-1, 1)]
            return Near(value, np.maximum(*apart) + own * ULP * np.abs(value))

        return rule

    return make


def _gentle(own: float) -> Callable[[str], Rule]:
    """Functions of slope 1 at most, whose own error is absolute."""

    def make(name: str) -> Rule:
        compute = arrays.RULES[name]

        def rule(node: Expr, *values: Near) -> Near:
            error = np.zeros(node.type.shape)
            for x, arg in zip(values, node.args, strict=True):
                error = np.maximum(error, arrays.lift(x.error, arg.type, node.type))
            return Near(compute(node, *[x.value for x in values]), error + own * ULP)

        return rule

    return make


def _each(rule: Callable[..., Near]) -> Rule:
    """A rule for components: scalars stretch over vectors."""

    def lifted(node: Expr, *values: Near) -> Near:
        return rule(
            *[
                Near(*(arrays.lift(part, arg.type, node.type) for part in x))
                for x, arg in zip(values, node.args, strict=True)
            ]
        )

    return lifted


def _sum(sign: float) -> Rule:
    def rule(a: Near, b: Near) -> Near:
        value = a.value + sign * b.value
        return Near(value, a.error + b.error + 0.5 * ULP * np.abs(value))

    return _each(rule)


def _times(a: Near, b: Near) -> Near:
    value = a.value * b.value
    return Near(
        value,
        np.abs(a.value) * b.error + np.abs(b.value) * a.error + a.error * b.error + 0.5 * ULP * np.abs(value),
    )


def _over(a: Near, b: Near) -> Near:
    value = a.value / b.value
    least = np.maximum(np.abs(b.value) - b.error, arrays.SMALLEST)
    return Near(value, (a.error + np.abs(value) * b.error) / least + 2.5 * ULP * np.abs(value))


def _mod(x: Near, y: Near) -> Near:
    whole = np.floor(x.value / y.value)
    turns = np.abs(whole) + 1
    value = x.value - y.value * whole
    unsure = np.abs(np.floor((x.value + x.error) / y.value) - np.floor((x.value - x.error) / y.value))
    return Near(value, x.error + turns * y.error + ((0.5 * turns + 1) * ULP + unsure) * np.abs(y.value))


def _mix(a: Near, b: Near, t: Near) -> Near:
    one = Near(np.ones(()), np.zeros(()))
    rest = Near(1 - t.value, t.error + 0.5 * ULP * np.abs(one.value - t.value))
    left, right = _times(a, rest), _times(b, t)
    value = left.value + right.value
    return Near(value, left.error + right.error + 0.5 * ULP * np.abs(value))


def _smoothstep(low: Near, high: Near, x: Near) -> Near:
    span = high.value - low.value
    t = np.clip((x.value - low.value) / span, 0, 1)
    error = (x.error + low.error + high.error) / np.abs(span) + 4 * ULP
    return Near(t * t * (3 - 2 * t), 1.5 * error + 2 * ULP)


def _pow(x: Near, y: Near) -> Near:
    """exp2(y log2 x): Vulkan allows 3 ulp of a logarithm, or 2^-21 near 1, and 3 + 2 |x| ulp of a power of 2."""
    base = np.maximum(x.value, arrays.SMALLEST)
    value = np.power(base, y.value)
    log = np.log2(base)
    exponent = np.abs(y.value) * (1.45 * x.error / base + np.maximum(3 * np.abs(log), 4) * ULP) + np.abs(log) * y.error
    exponent = exponent + 0.5 * ULP * np.abs(log * y.value)
    lost = np.abs(value) * (0.7 * exponent + (3 + 2 * np.abs(log * y.value)) * ULP)
    underflow = np.abs(np.power(base + x.error, y.value) - value)
    return Near(value, np.maximum(lost, underflow))


def _along(a: Near, b: Near) -> Near:
    value = np.sum(a.value * b.value, axis=-1)
    size = np.sum(np.abs(a.value * b.value), axis=-1)
    error = np.sum(np.abs(a.value) * b.error + np.abs(b.value) * a.error + a.error * b.error, axis=-1)
    return Near(value, error + 0.5 * ULP * np.shape(a.value)[-1] * size)


def _dot(_node: Expr, a: Near, b: Near) -> Near:
    a, b = (Near(*np.broadcast_arrays(x.value, x.error)) for x in (a, b))
    return _along(a, b)


def _length(_node: Expr, v: Near) -> Near:
    value = np.linalg.norm(v.value, axis=-1)
    return Near(value, np.linalg.norm(np.broadcast_to(v.error, np.shape(v.value)), axis=-1) + 4 * ULP * value)


def _normalize(node: Expr, v: Near) -> Near:
    length = np.maximum(_length(node, v).value, arrays.SHORTEST)[..., None]
    return Near(v.value / length, np.minimum(2 * v.error.max(axis=-1, keepdims=True) / length, 2) + 4 * ULP)


def _cross(_node: Expr, a: Near, b: Near) -> Near:
    size = _abs_cross(np.abs(a.value), np.abs(b.value))
    handed = _abs_cross(np.abs(a.value), b.error) + _abs_cross(a.error, np.abs(b.value))
    return Near(np.cross(a.value, b.value), handed + ULP * size)


def _abs_cross(a: Array, b: Array) -> Array:
    (ax, ay, az), (bx, by, bz) = (np.moveaxis(np.asarray(x), -1, 0) for x in (a, b))
    return np.stack([ay * bz + az * by, az * bx + ax * bz, ax * by + ay * bx], axis=-1)


def _matmul(node: Expr, a: Near, b: Near) -> Near:
    form = "...ij,...j->...i" if node.type.is_vector else "...ij,...jk->...ik"

    def product(x: Array, y: Array) -> Array:
        return np.einsum(form, np.asarray(x), np.asarray(y))

    size = product(np.abs(a.value), np.abs(b.value))
    handed = product(np.abs(a.value), b.error) + product(a.error, np.abs(b.value))
    return Near(product(a.value, b.value), handed + 0.5 * ULP * np.shape(a.value)[-1] * size)


def _compare(name: str) -> Rule:
    def rule(node: Expr, a: Near, b: Near) -> Near:
        unsure = np.abs(a.value - b.value) <= a.error + b.error
        return Near(arrays.RULES[name](node, a.value, b.value), unsure)

    return rule


def _logic(name: str) -> Rule:
    def rule(node: Expr, *values: Near) -> Near:
        unsure: Array = False
        for x in values:
            unsure = unsure | np.asarray(x.error, bool)
        return Near(arrays.RULES[name](node, *[x.value for x in values]), unsure)

    return rule


def _where(node: Expr, condition: Near, a: Near, b: Near) -> Near:
    """Either branch, where the condition is not sure."""
    chosen, unsure = (arrays.lift(np.asarray(part, bool), BOOL, node.type) for part in condition)
    error = np.where(chosen, a.error, b.error)
    either = np.maximum(a.error, b.error) + np.abs(a.value - b.value)
    return Near(np.where(chosen, a.value, b.value), np.where(unsure, either, error))


def _jump(name: str) -> Rule:
    compute = arrays.RULES[name]

    def rule(node: Expr, *values: Near) -> Near:
        last = values[-1]
        before, after = (
            compute(node, *[x.value for x in values[:-1]], last.value + sign * last.error) for sign in (-1, 1)
        )
        return Near(compute(node, *[x.value for x in values]), np.abs(after - before))

    return rule


def _fract(node: Expr, x: Near) -> Near:
    unsure = np.floor(x.value + x.error) - np.floor(x.value - x.error)
    return Near(arrays.RULES["fract"](node, x.value), x.error + 0.5 * ULP + unsure)


def _picked(name: str) -> Rule:
    """What only moves components about."""

    def rule(node: Expr, *parts: Near) -> Near:
        spread = [np.broadcast_arrays(*np.broadcast_arrays(p.value, p.error)) for p in parts]
        value, error = (arrays.RULES[name](node, *[s[i] for s in spread]) for i in (0, 1))
        return Near(value, error)

    return rule


def _sample(node: Expr, at: Near) -> Near:
    slope = np.abs(arrays.RULES["sample_slope"](node, at.value))
    value = arrays.RULES["sample"](node, at.value)
    largest = float(np.max(np.abs(node.data.values)))
    steepest = np.maximum(np.sum(slope * at.error, axis=-1), node.data.steepest * np.max(at.error, axis=-1))
    return Near(value, steepest + 8 * ULP * largest)


def _raw(node: Expr, p: Near) -> Near:
    """A function given as text: its twin beside the point, along each axis. It may lose some ulp of its argument."""
    twin = arrays.RULES["raw"]
    value = twin(node, p.value)
    beside = [np.abs(twin(node, p.value + p.error * axis) - value) for axis in np.eye(3)]
    return Near(value, sum(beside) + 8 * ULP * (np.abs(value) + np.max(np.abs(p.value), axis=-1)))


def _exact(name: str) -> Rule:
    return lambda node, *values: Near(arrays.RULES[name](node, *[x.value for x in values]), np.zeros(node.type.shape))


_GENTLE = {"min": 0, "max": 0, "abs": 0, "neg": 0, "clamp": 0, "sin": 4, "cos": 4, "atan": 4, "tanh": 8}
_MONOTONE = {"sqrt": 3, "asin": 8, "acos": 8, "tan": 8, "sinh": 16, "cosh": 16}


def _exponential(name: str) -> Rule:
    """Vulkan allows 3 + 2 |x| ulp of a power of 2."""

    def rule(node: Expr, x: Near) -> Near:
        handed = _monotone(0)(name)(node, x)
        return Near(handed.value, handed.error + (4 + 3 * np.abs(x.value)) * ULP * np.abs(handed.value))

    return rule


def _logarithm(name: str) -> Rule:
    def rule(node: Expr, x: Near) -> Near:
        handed = _monotone(4)(name)(node, x)
        return Near(handed.value, handed.error + 4 * ULP)

    return rule


def _angle(node: Expr, y: Near, x: Near) -> Near:
    value = arrays.RULES["atan2"](node, y.value, x.value)
    radius = np.maximum(np.hypot(x.value, y.value), arrays.SMALLEST)
    turn = np.minimum((x.error + y.error) / radius, np.pi)
    cut = (x.value < 0) & (np.abs(y.value) <= y.error)
    return Near(value, np.where(cut, 2 * np.pi, turn) + 4 * ULP)


def _filled(rule: Rule) -> Rule:
    """With an error for each component."""

    def filled(node: Expr, *values: Near) -> Near:
        value, error = rule(node, *values)
        return Near(value, np.broadcast_to(error, np.broadcast_shapes(np.shape(value), np.shape(error))))

    return filled


RULES: Mapping[str, Rule] = {
    "add": _sum(1),
    "sub": _sum(-1),
    "mul": _each(_times),
    "div": _each(_over),
    "mod": _each(_mod),
    "mix": _each(_mix),
    "smoothstep": _each(_smoothstep),
    "pow": _each(_pow),
    **{name: _gentle(own)(name) for name, own in _GENTLE.items()},
    **{name: _monotone(own)(name) for name, own in _MONOTONE.items()},
    **{name: _exponential(name) for name in ("exp", "exp2")},
    **{name: _logarithm(name) for name in ("log", "log2")},
    **{name: _jump(name) for name in ("sign", "floor", "ceil", "round", "step")},
    **{name: _compare(name) for name in ("lt", "le")},
    **{name: _logic(name) for name in ("and", "or", "not")},
    **{name: _picked(name) for name in ("swizzle", "construct", "columns", "transpose")},
    **{name: _exact(name) for name in ("hash", "sample_slope", "sample_bend", "fetch")},
    "atan2": _angle,
    "fract": _fract,
    "where": _where,
    "dot": _dot,
    "cross": _cross,
    "length": _length,
    "normalize": _normalize,
    "matmul": _matmul,
    "stop_gradient": lambda _node, x: x,
    "sample": _sample,
    "raw": _raw,
}
"""The edge of a step, the slope of sampled data, a texel and a hash are taken as exact."""


@dataclass(frozen=True, slots=True)
class Rounding:
    """The reading: a constant is off by what float32 makes of it."""

    @property
    def rules(self) -> Mapping[str, Rule]:
        return {name: _filled(rule) for name, rule in {**RULES, "param": self._param, "time": self._param}.items()}

    def leaf(self, node: Expr) -> Near:
        if node.type is BOOL:
            return Near(node.data, False)
        return Near(node.data, np.abs(node.data - node.data.astype(np.float32)))

    def _param(self, node: Expr) -> Near:
        value = arrays.value_of(node)
        return Near(value, np.abs(value - value.astype(np.float32)))

    def repeat(self, body: Any, program: Program, first: list[Near], captured: list[Near]) -> tuple[Near, ...]:
        state, alive, n = first, np.asarray(True), len(first)
        for turn in range(body.count):
            after = program(Near(np.asarray(float(turn)), np.zeros(())), *state, *captured)
            if body.until is not None:
                alive = alive & ~after[n].value
                if not alive.any():
                    break
            state = [
                Near(*(np.where(arrays.lift(alive, BOOL, v.type), *both) for both in zip(new, old, strict=True)))
                for v, new, old in zip(body.state, after[:n], state, strict=True)
            ]
        return tuple(state)


ROUNDING = Rounding()
STEP = 1 << 14
"""Points at once."""


def rounding_of(node: rm.Node, points: NDArray[Any], error: NDArray[Any]) -> NDArray[np.float64]:
    """The most that float32 may be off the field's value, where each coordinate is off by up to `error`.

    points : (N, 3). error : (N,), in units of length. Returns (N,); inf where a function is at its pole.
    """
    whole = lower(node)
    program = Program([whole.body], [whole.params[0]], ROUNDING)
    found = np.empty(len(points))
    with np.errstate(all="ignore"):
        for i in range(0, len(points), STEP):
            part = points[i : i + STEP]
            lost = program(Near(part, np.broadcast_to(error[i : i + STEP, None], part.shape)))[0].error
            found[i : i + STEP] = np.broadcast_to(lost, len(part))
    return np.where(np.isfinite(found), found, np.inf)
