"""Sample expressions for every operation of the vocabulary, each beside the same computation in plain Python.

`Sample.plain` uses the math module on floats and tuples of floats, and nothing of the package: it is what the
readings are held against. A new operation needs one line here; `test_readings` says so if it has none.
"""

from __future__ import annotations

import math
import operator
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

import raymarch.expr.vocabulary as v
from raymarch.expr import Expr, Function, expr, function, loop, trace
from raymarch.expr.atlas import Atlas
from raymarch.expr.faults import Passage
from raymarch.expr.hashing import hash
from raymarch.expr.limits import Limit
from raymarch.expr.node import make, swizzle
from raymarch.expr.raw import RawFunction, raw
from raymarch.expr.raw import slope as raw_slope
from raymarch.expr.samples import Samples, sample_bend, sample_slope
from raymarch.expr.samples import sample as interpolated
from raymarch.expr.texels import Texels
from raymarch.expr.textures import texture, texture_in_atlas
from raymarch.expr.types import FLOAT, VEC2, VEC3, Type, vector

Plain: TypeAlias = Any
SMALLEST = 1.1754943508222875e-38
PER_SAMPLE = 96


@dataclass(frozen=True, slots=True)
class Pool:
    """Where the values of one input come from: chosen edges, and a range to draw from."""

    low: float
    high: float
    edges: tuple[float, ...]
    size: int = 1

    @property
    def type(self) -> Type:
        return vector(self.size)

    def draw(self, random: np.random.Generator, count: int) -> NDArray[np.float64]:
        """Half edges, half drawn, shape (count, size); all are float32 numbers."""
        drawn = random.uniform(self.low, self.high, (count, self.size))
        chosen = random.choice(self.edges, (count, self.size))
        mixed = np.where(np.arange(count)[:, None] < count // 2, chosen, drawn)
        mixed[: min(len(self.edges), count), :] = np.asarray(self.edges)[:count, None]  # vectors of equal components
        return mixed.astype(np.float32).astype(np.float64)


REAL = Pool(-4, 4, (0.0, -0.0, 1.0, -1.0, 0.5, -0.5, 1.5, -1.5, 2.5, 2.0, -2.0, 1e-3, -1e-3))
NONZERO = Pool(0.25, 4, (1.0, -1.0, 0.5, -2.0, 0.01))
POSITIVE = Pool(0.01, 10, (1.0, 0.5, 1e-3, 100.0))
UNIT = Pool(-0.999, 0.999, (0.0, 1.0, -1.0, 0.5, -0.5))
BEYOND = Pool(-2, 2, (0.0, 1.0, -1.0, 1.0000001, -1.0000001, 3.0, -3.0))
SMALL = Pool(-8, 8, (0.0, 1.0, -1.0, 0.5))
ANGLE = Pool(-7, 7, (0.0, 1.5707964, -1.5707964, 3.1415927, -3.1415927, 6.2831855))
FRACTION = Pool(0, 1, (0.0, 1.0, 0.5, 0.25))
TILED = Pool(-4, 4, (0.0, 0.25, -0.25, 1.0, -1.0, 0.75, 1.75, -3.25))


def of(size: int, pool: Pool = REAL) -> Pool:
    """Vectors with components from a pool."""
    return Pool(pool.low, pool.high, pool.edges, size)


@dataclass(frozen=True, slots=True)
class Sample:
    """One expression of some inputs, and what is known about it.

    Attributes
    ----------
    build, plain : the expression, and the same in plain Python; both take the inputs in order.
    ulps : error allowed to a float32 reading, in units of 2**-23 of the value.
    absolute : the same in units of 2**-23, for what is lost before the last step.
    gpu : factor by which a GPU may be worse than NumPy: its elementary functions are coarser.
    period : values that differ by a multiple of it are the same (angles, what is left of a division).
    steps : the value may jump, so a float32 reading may land on the other side at drawn points.
    differentiable : inputs to take derivatives by; none of a comparison.
    """

    name: str
    build: Callable[..., Any]
    plain: Callable[..., Plain]
    pools: dict[str, Pool]
    ulps: float
    absolute: float
    gpu: float
    period: float
    differentiable: tuple[str, ...]

    @property
    def function(self) -> Function:
        return trace(f"sample_{self.name}", self.build, [(n, p.type) for n, p in self.pools.items()], _no_locals)

    def points(self) -> list[NDArray[np.float64]]:
        """Values for each input, shape (N,) or (N, n)."""
        random = np.random.default_rng(zlib.crc32(self.name.encode()))
        drawn = [pool.draw(random, PER_SAMPLE) for pool in self.pools.values()]
        for i, values in enumerate(drawn[1:], 1):  # not edge with edge in step
            half = PER_SAMPLE // 2
            drawn[i] = np.concatenate([random.permutation(values[:half]), values[half:]])
        return [d[:, 0] if d.shape[1] == 1 else d for d in drawn]

    def expected(self, points: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
        """The plain computation, point by point."""
        rows = zip(*(p.tolist() for p in points), strict=True)
        return np.array([self.plain(*(tuple(x) if isinstance(x, list) else x for x in row)) for row in rows])


_no_locals = (lambda: None).__code__

SAMPLES: list[Sample] = []


def sample(
    name: str,
    build: Callable[..., Any],
    plain: Callable[..., Plain],
    *,
    ulps: float = 1,
    absolute: float = 0,
    gpu: float = 1,
    period: float = 0,
    fixed: tuple[str, ...] = (),
    **pools: Pool,
) -> None:
    """Enter a sample; `fixed` are inputs by which it has no derivative."""
    moving = tuple(n for n in pools if n not in fixed)
    SAMPLES.append(Sample(name, build, plain, pools, ulps, absolute, gpu, period, moving))


# Plain Python


def each(compute: Callable[..., float], *values: Plain) -> Plain:
    """By component; numbers stand beside every component of tuples."""
    size = max((len(x) for x in values if isinstance(x, tuple)), default=0)
    if not size:
        return compute(*values)
    rows = zip(*(x if isinstance(x, tuple) else (x,) * size for x in values), strict=True)
    return tuple(compute(*row) for row in rows)


def by_component(compute: Callable[..., float]) -> Callable[..., Plain]:
    return lambda *values: each(compute, *values)


def p_sign(x: float) -> float:
    return 0.0 if x == 0 else math.copysign(1.0, x)


def p_mod(x: float, y: float) -> float:
    return x - y * math.floor(x / y)


def p_atan2(y: float, x: float) -> float:
    return 0.0 if x == 0 and y == 0 else math.atan2(y, x)


def p_pow(x: float, y: float) -> float:
    return max(x, SMALLEST) ** y


def p_step(edge: float, x: float) -> float:
    return 0.0 if x < edge else 1.0


def p_smoothstep(low: float, high: float, x: float) -> float:
    t = min(max((x - low) / (high - low), 0.0), 1.0)
    return t * t * (3 - 2 * t)


def p_mix(a: float, b: float, t: float) -> float:
    return a * (1 - t) + b * t


def p_clamp(x: float, low: float, high: float) -> float:
    return min(max(x, low), high)


def p_clip(x: float) -> float:
    return min(max(x, -1.0), 1.0)


def p_dot(a: Plain, b: Plain) -> float:
    return math.fsum(map(operator.mul, a, b))


def p_normalize(a: Plain) -> Plain:
    size = math.hypot(*a)
    return tuple(x / size for x in a) if size else a


def p_cross(a: Plain, b: Plain) -> Plain:
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def p_times(columns: Sequence[Plain], x: Plain) -> Plain:
    """Matrix, given by its columns, times vector."""
    return tuple(math.fsum(c[i] * x[j] for j, c in enumerate(columns)) for i in range(len(x)))


def p_rows(columns: Sequence[Plain]) -> list[Plain]:
    return [tuple(c[i] for c in columns) for i in range(len(columns))]


def number(condition: bool) -> float:
    return 1.0 if condition else 0.0


# Arithmetic

_BINARY = {"add": operator.add, "sub": operator.sub, "mul": operator.mul}
for _name, _op in _BINARY.items():
    sample(_name, _op, by_component(_op), a=REAL, b=REAL)
    sample(f"{_name}_vectors", _op, by_component(_op), a=of(3), b=of(3))
    sample(f"{_name}_scalar_first", _op, by_component(_op), a=REAL, b=of(2))
    sample(f"{_name}_scalar_last", _op, by_component(_op), a=of(4), b=REAL)
sample("div", operator.truediv, by_component(operator.truediv), ulps=2, a=REAL, b=NONZERO)
sample("div_vectors", operator.truediv, by_component(operator.truediv), ulps=2, a=of(3), b=of(3, NONZERO))
sample("div_scalar_first", operator.truediv, by_component(operator.truediv), ulps=2, a=REAL, b=of(3, NONZERO))
sample("div_scalar_last", operator.truediv, by_component(operator.truediv), ulps=2, a=of(2), b=NONZERO)
sample("number_minus", lambda a: 1.0 - a, lambda a: 1.0 - a, a=REAL)
sample("number_over", lambda a: 2.0 / a, lambda a: 2.0 / a, ulps=2, a=NONZERO)
sample("number_times", lambda a: 3 * a + 1, by_component(lambda a: 3 * a + 1), ulps=2, absolute=12, a=of(3))
sample("minus_minus", lambda a, b: a - (-b) - (b - a), lambda a, b: 2 * a, ulps=2, absolute=16, a=REAL, b=REAL)
sample("chain", lambda a, b: a - (b - (a - b)), lambda a, b: 2 * (a - b), absolute=16, a=REAL, b=REAL)
sample("quotients", lambda a, b: a / (b / a) / b, lambda a, b: a * a / b / b, ulps=4, a=NONZERO, b=NONZERO)
sample("neg", operator.neg, operator.neg, a=REAL)
sample("neg_vector", lambda a: -a, by_component(operator.neg), a=of(3))
sample("abs", abs, abs, a=REAL)
sample("abs_vector", v.abs, by_component(abs), a=of(4))
sample("sign", v.sign, p_sign, a=REAL)
sample("sign_vector", v.sign, by_component(p_sign), a=of(3))
sample("floor", v.floor, math.floor, a=REAL)
sample("floor_vector", v.floor, by_component(math.floor), a=of(2))
sample("ceil", v.ceil, math.ceil, a=REAL)
sample("round", v.round, lambda a: math.floor(a + 0.5), a=REAL)
sample("round_of_sum", lambda a, b: v.round(a - b), lambda a, b: math.floor(a - b + 0.5), a=TILED, b=TILED)
sample("round_vector", v.round, by_component(lambda a: math.floor(a + 0.5)), a=of(3, TILED))
sample("fract", v.fract, lambda a: a - math.floor(a), absolute=1, period=1, a=REAL)
sample("fract_vector", v.fract, by_component(lambda a: a - math.floor(a)), absolute=1, period=1, a=of(3))
sample("mod", v.mod, p_mod, absolute=8, period=1, a=TILED, b=Pool(1, 1, (1.0, -1.0)))
sample("mod_vector", v.mod, by_component(p_mod), absolute=8, period=0.5, a=of(3, TILED), b=Pool(0.5, 0.5, (-0.5, 1.0)))
sample("mod_scalar_first", v.mod, by_component(p_mod), absolute=8, period=1, a=TILED, b=of(2, Pool(2, 2, (-1.0, 1.0))))
sample("mod_operator", lambda a: a % 2.0, lambda a: p_mod(a, 2.0), absolute=8, period=2, a=REAL)
sample("square", v.square, by_component(lambda a: a * a), a=of(2))

# Elementary functions; a GPU computes them more coarsely than a CPU's library.

sample("sqrt", v.sqrt, lambda a: math.sqrt(max(a, 0.0)), gpu=2, a=REAL)
sample("sqrt_vector", v.sqrt, by_component(lambda a: math.sqrt(max(a, 0.0))), gpu=2, a=of(3))
sample("sqrt_square", lambda a: v.sqrt(a * a), abs, ulps=2, gpu=2, a=REAL)
sample("exp", v.exp, math.exp, ulps=4, gpu=8, a=SMALL)
sample("exp_vector", v.exp, by_component(math.exp), ulps=4, gpu=8, a=of(2, SMALL))
sample("exp2", v.exp2, lambda a: 2.0**a, ulps=4, gpu=4, a=SMALL)
sample("log", v.log, lambda a: math.log(max(a, SMALLEST)), ulps=2, absolute=2, gpu=4, a=Pool(0.01, 9, (0.0, -1.0, 1.0)))
sample("log_positive", v.log, math.log, ulps=2, absolute=2, gpu=4, a=POSITIVE)
sample("log2", v.log2, lambda a: math.log2(max(a, SMALLEST)), ulps=2, absolute=2, gpu=4, a=Pool(0.1, 9, (0.0, -1, 8)))
sample("sin", v.sin, math.sin, ulps=2, absolute=2, gpu=4, a=ANGLE)
sample("cos", v.cos, math.cos, ulps=2, absolute=2, gpu=4, a=ANGLE)
sample("sin_vector", v.sin, by_component(math.sin), ulps=2, absolute=2, gpu=4, a=of(3, ANGLE))
sample("tan", v.tan, math.tan, ulps=8, absolute=4, gpu=8, a=Pool(-1.4, 1.4, (0.0, 0.785, -0.785)))
sample("asin", v.asin, lambda a: math.asin(p_clip(a)), ulps=2, absolute=2, gpu=2, a=BEYOND)
sample("acos", v.acos, lambda a: math.acos(p_clip(a)), ulps=2, absolute=2, gpu=2, a=BEYOND)
sample("acos_vector", v.acos, by_component(lambda a: math.acos(p_clip(a))), ulps=2, absolute=2, gpu=2, a=of(2, BEYOND))
sample("atan", v.atan, math.atan, ulps=2, gpu=3, a=REAL)
sample("atan2", v.atan2, p_atan2, ulps=2, gpu=3, period=2 * math.pi, a=REAL, b=REAL)
sample("atan2_vectors", v.atan2, by_component(p_atan2), ulps=2, gpu=3, period=2 * math.pi, a=of(3), b=of(3))
sample("atan2_mixed", v.atan2, by_component(p_atan2), ulps=2, gpu=3, period=2 * math.pi, a=REAL, b=of(2))
sample("sinh", v.sinh, math.sinh, ulps=4, absolute=4, gpu=8, a=REAL)
sample("cosh", v.cosh, math.cosh, ulps=4, gpu=8, a=REAL)
sample("tanh", v.tanh, math.tanh, ulps=4, absolute=2, gpu=8, a=SMALL)
sample("pow", v.pow, p_pow, ulps=4, gpu=8, a=Pool(0.1, 4, (0.0, 1.0, -1.0, 2.0)), b=Pool(0.5, 3, (1.0, 2.0, 3.0, 0.5)))
sample("pow_vectors", v.pow, by_component(p_pow), ulps=4, gpu=8, a=of(3, POSITIVE), b=of(3, Pool(-2, 2, (0.0, 1.0))))
sample("pow_mixed", v.pow, by_component(p_pow), ulps=4, gpu=8, a=of(2, POSITIVE), b=Pool(-2, 2, (0.0, 1.0, -1.0)))
sample("pow_scalar_first", v.pow, by_component(p_pow), ulps=4, gpu=8, a=POSITIVE, b=of(3, Pool(-2, 2, (0.0, 1.0))))
sample("pow_whole", lambda a: v.pow(a, 2.0), lambda a: max(a, SMALLEST) ** 2, ulps=4, gpu=8, a=REAL)
sample("pow_zero", lambda a: v.pow(a, 0.0), lambda a: 1.0, a=REAL)
sample("pow_one", lambda a: v.pow(a, 1.0), lambda a: max(a, SMALLEST), ulps=2, gpu=8, a=REAL)

# Choosing

for _name, _f in {"min": (v.min, min), "max": (v.max, max)}.items():
    _op, _plain = _f
    sample(_name, _op, by_component(_plain), a=REAL, b=REAL)
    sample(f"{_name}_vectors", _op, by_component(_plain), a=of(3), b=of(3))
    sample(f"{_name}_scalar_first", _op, by_component(_plain), a=REAL, b=of(3))
    sample(f"{_name}_scalar_last", _op, by_component(_plain), a=of(2), b=REAL)
    sample(f"{_name}_of_four", _op, _plain, a=REAL, b=REAL, c=REAL, d=REAL)
_LOW, _HIGH = Pool(-2, -0.5, (-1.0,)), Pool(0.5, 2, (1.0,))
sample("clamp", v.clamp, p_clamp, a=REAL, b=_LOW, c=_HIGH)
sample("clamp_vector", v.clamp, by_component(p_clamp), a=of(3), b=_LOW, c=_HIGH)
sample("clamp_vectors", v.clamp, by_component(p_clamp), a=of(3), b=of(3, _LOW), c=of(3, _HIGH))
sample("clamp_mixed", v.clamp, by_component(p_clamp), a=of(2), b=_LOW, c=of(2, _HIGH))
sample("clamp_scalar_first", v.clamp, by_component(p_clamp), a=REAL, b=of(3, _LOW), c=_HIGH)
sample("mix", v.mix, p_mix, ulps=2, absolute=16, a=REAL, b=REAL, t=FRACTION)
sample("mix_vectors", v.mix, by_component(p_mix), ulps=2, absolute=16, a=of(3), b=of(3), t=of(3, FRACTION))
sample("mix_scalar_last", v.mix, by_component(p_mix), ulps=2, absolute=16, a=of(3), b=of(3), t=FRACTION)
sample("mix_scalar_first", v.mix, by_component(p_mix), ulps=2, absolute=16, a=REAL, b=of(2), t=FRACTION)
sample("mix_scalars", v.mix, by_component(p_mix), ulps=2, absolute=16, a=REAL, b=REAL, t=of(3, FRACTION))
sample("step", v.step, p_step, a=REAL, b=REAL)
sample("step_vector", v.step, by_component(p_step), a=REAL, b=of(3))
sample("step_vectors", v.step, by_component(p_step), a=of(2), b=of(2))
sample("step_scalar_last", v.step, by_component(p_step), a=of(3), b=REAL)
sample("smoothstep", lambda x: v.smoothstep(-1.0, 2.0, x), lambda x: p_smoothstep(-1, 2, x), absolute=4, x=REAL)
sample(
    "smoothstep_vector",
    v.smoothstep,
    by_component(p_smoothstep),
    absolute=16,
    a=_LOW,
    b=_HIGH,
    x=of(3),
    fixed=("a", "b"),
)
sample(
    "smoothstep_vectors",
    v.smoothstep,
    by_component(p_smoothstep),
    absolute=16,
    a=of(2, _LOW),
    b=of(2, _HIGH),
    x=of(2),
    fixed=("a", "b"),
)
sample(
    "smoothstep_mixed",
    v.smoothstep,
    by_component(p_smoothstep),
    absolute=16,
    a=_LOW,
    b=of(3, _HIGH),
    x=REAL,
    fixed=("a", "b"),
)
sample("where", lambda a, b: v.where(a < b, a, 2 * b), lambda a, b: a if a < b else 2 * b, a=REAL, b=REAL)
sample("where_vectors", lambda a, b: v.where(a.x < b.y, a, b), lambda a, b: a if a[0] < b[1] else b, a=of(3), b=of(3))
sample("where_mixed", lambda a, b: v.where(a <= 0, b, a), lambda a, b: b if a <= 0 else (a,) * 2, a=REAL, b=of(2))
sample(
    "where_nested",
    lambda a, b: v.where(a < b, v.where(a < 0, 1.0, b), v.where(b < 0, a, 2.0)) + 1.0,
    lambda a, b: ((1.0 if a < 0 else b) if a < b else (a if b < 0 else 2.0)) + 1.0,
    absolute=8,
    a=REAL,
    b=REAL,
)
sample("lt", lambda a, b: v.where(a < b, 1.0, 0.0), lambda a, b: number(a < b), a=REAL, b=REAL)
sample("le", lambda a, b: v.where(a <= b, 1.0, 0.0), lambda a, b: number(a <= b), a=REAL, b=REAL)
sample("gt", lambda a, b: v.where(a > b, 1.0, 0.0), lambda a, b: number(a > b), a=REAL, b=REAL)
sample("ge_constant", lambda a: v.where(expr(1.0) >= a, 1.0, 0.0), lambda a: number(a <= 1.0), a=REAL)
sample(
    "logic",
    lambda a, b: v.where(((a < b) & ~(a < 0.0)) | ~((a <= b) | (b < 0.5)), 1.0, 0.0),
    lambda a, b: number((a < b and not a < 0) or not (a <= b or b < 0.5)),
    a=REAL,
    b=REAL,
)
sample(
    "all_of",
    lambda a, b: v.where(v.all_of(a < b, a > -1.0, ~(b < 0.5)), 1.0, -1.0),
    lambda a, b: 1.0 if a < b and a > -1 and b >= 0.5 else -1.0,
    a=REAL,
    b=REAL,
)

# Vectors and matrices

for _n in (2, 3, 4):
    sample(f"dot{_n}", v.dot, p_dot, absolute=64, a=of(_n), b=of(_n))
    sample(f"length{_n}", v.length, lambda a: math.hypot(*a), ulps=4, a=of(_n))
    sample(f"normalize{_n}", v.normalize, p_normalize, ulps=4, a=of(_n))
    sample(
        f"matrix_times_vector{_n}",
        lambda *m: v.columns(*m[:-1]) @ m[-1],
        lambda *m: p_times(m[:-1], m[-1]),
        absolute=64,
        **{f"c{i}": of(_n) for i in range(_n)},
        a=of(_n),
    )
    sample(
        f"transposed{_n}",
        lambda *m: v.transpose(v.columns(*m[:-1])) * m[-1],
        lambda *m: p_times(p_rows(m[:-1]), m[-1]),
        absolute=64,
        **{f"c{i}": of(_n) for i in range(_n)},
        a=of(_n),
    )
sample("length_scalar", v.length, abs, a=REAL)
sample("distance", v.distance, math.dist, ulps=4, absolute=4, a=of(3), b=of(3))
sample("cross", v.cross, p_cross, absolute=64, a=of(3), b=of(3))
sample("cross_unit", lambda a: v.cross(a, (0, 1, 0)), lambda a: p_cross(a, (0, 1, 0)), a=of(3))
sample("swizzle", lambda a: a.zx - a.yx, lambda a: (a[2] - a[1], 0.0), a=of(3))
sample("swizzle_repeated", lambda a: swizzle(a, "wyyx"), lambda a: (a[3], a[1], a[1], a[0]), a=of(4))
sample("components", lambda a: a.x - a[1] + a[-1], lambda a: a[0] - a[1] + a[2], absolute=8, a=of(3))
sample("iterated", lambda a: sum(a, 0.0), lambda a: a[0] + a[1] + a[2], absolute=16, a=of(3))
sample("vec2", v.vec2, lambda a, b: (a, b), a=REAL, b=REAL)
sample("vec3_stretched", v.vec3, lambda a: (a, a, a), a=REAL)
sample("vec3_parts", lambda a, b: v.vec3(a, b.x), lambda a, b: (*a, b[0]), a=of(2), b=of(2))
sample("vec4_parts", lambda a, b: v.vec4(1, a, b), lambda a, b: (1, *a, b), a=of(2), b=REAL)
sample("tuple_as_vector", lambda a: expr((a, 1.0, a)) * 2, lambda a: (2 * a, 2.0, 2 * a), a=REAL)
sample(
    "vector_times_matrix",
    lambda a, b, c, x: x * v.columns(a, b, c),
    lambda a, b, c, x: (p_dot(x, a), p_dot(x, b), p_dot(x, c)),
    absolute=64,
    a=of(3),
    b=of(3),
    c=of(3),
    x=of(3),
)
sample(
    "matrix_product",
    lambda a, b, x: (v.columns(a, b) @ v.columns(b, a)) @ x,
    lambda a, b, x: p_times((a, b), p_times((b, a), x)),
    absolute=1024,
    a=of(2),
    b=of(2),
    x=of(2),
)
sample(
    "matrix_arithmetic",
    lambda a, b, x, s: (s * v.columns(a, b) - v.columns(b, a) / 2.0 + 1.0 * v.columns(b, b)) @ x,
    lambda a, b, x, s: tuple(
        s * m - n / 2 + o for m, n, o in zip(p_times((a, b), x), p_times((b, a), x), p_times((b, b), x), strict=True)
    ),
    absolute=1024,
    a=of(2),
    b=of(2),
    x=of(2),
    s=REAL,
)
sample(
    "constant_matrix",
    lambda x: expr(np.array([[1.0, 2.0, 0.0], [0.0, -1.0, 0.5], [3.0, 0.0, 1.0]])) @ x,
    lambda x: (x[0] + 2 * x[1], -x[1] + x[2] / 2, 3 * x[0] + x[2]),
    absolute=32,
    x=of(3),
)
sample(
    "where_matrices",
    lambda a, b, x: v.where(a.x < b.x, v.columns(a, b), v.columns(b, a)) @ x,
    lambda a, b, x: p_times((a, b) if a[0] < b[0] else (b, a), x),
    absolute=64,
    a=of(2),
    b=of(2),
    x=of(2),
)
sample(
    "rotation2",
    v.rotation2,
    lambda a, t: (math.cos(t) * a[0] - math.sin(t) * a[1], math.sin(t) * a[0] + math.cos(t) * a[1]),
    absolute=32,
    gpu=4,
    a=of(2),
    t=ANGLE,
)

# Sampled data

DATA = {
    2: Samples([[0.0, 1.0, 4.0], [2.0, -1.0, 3.0]]),
    3: Samples([[[0.0, 1.0, 2.0], [3.0, 0.5, -1.0]], [[1.0, 1.5, 0.0], [-2.0, 4.0, 0.25]]]),
}


def p_interpolated(at: Plain, values: Any = None) -> float:
    """By the last axis first: a number between two numbers, between two rows, between two slices."""
    rows = DATA[len(at)].values.tolist() if values is None else values
    if not at:
        return rows
    position = min(max(at[-1], 0.0), len(rows) - 1.0)
    cell = min(int(position), len(rows) - 2)
    low, high = (p_interpolated(at[:-1], rows[cell + k]) for k in (0, 1))
    return low + (high - low) * (position - cell)


def p_slope(at: Plain) -> Plain:
    """Exact, because the data are linear along each axis within a cell; at a texel, of the cell above it."""
    slopes = []
    for axis, n in enumerate(DATA[len(at)].size):
        position = min(max(at[axis], 0.0), n - 1.0)
        cell = min(int(position), n - 2)
        ends = [(*at[:axis], float(cell + k), *at[axis + 1 :]) for k in (0, 1)]
        slopes.append(p_interpolated(ends[1]) - p_interpolated(ends[0]))
    return tuple(slopes)


def p_bend(at: Plain) -> float:
    """How much more the values rise along x at the upper side of the cell than at the lower one."""
    x, y = (min(int(min(max(a, 0.0), n - 1.0)), n - 2) for a, n in zip(at, DATA[2].size, strict=True))
    rise = [p_interpolated((x + 1.0, y + k)) - p_interpolated((float(x), y + k)) for k in (0.0, 1.0)]
    return rise[1] - rise[0]


_TEXELS = Pool(-0.5, 2.5, (0.0, 1.0, 2.0, 0.5, 1.5, -3.0, 7.0))
for _n in (2, 3):
    sample(f"sampled{_n}d", partial(interpolated, DATA[_n]), p_interpolated, absolute=16, a=of(_n, _TEXELS))
    sample(
        f"sampled_slope{_n}d",
        lambda a: sample_slope(interpolated(DATA[a.type.size], a)),
        p_slope,
        absolute=16,
        a=of(_n, _TEXELS),
        fixed=("a",),  # within a cell the slope is taken as constant: a field is not differentiated twice
    )

sample(
    "sampled_bend2d",
    lambda a: sample_bend(interpolated(DATA[2], a)),
    p_bend,
    absolute=16,
    a=of(2, _TEXELS),
    fixed=("a",),
)

# Pictures

PICTURE = Texels([[0.0, 1.0, 0.5], [0.75, -1.0, 0.25]], "clamp")
ATLAS = Atlas([Texels(np.ones((4, 4))), PICTURE], [(0, 0), (6, 1)])


def p_pictured(at: Plain) -> float:
    """A point so much smaller than a texel is between four of them; the edge goes on outside."""
    rows = [[0.0, 1.0, 0.5], [0.75, -1.0, 0.25]]
    values: Any = rows
    for position, n in ((at[1], 2), (at[0], 3)):
        place = min(max(position * n - 0.5, 0.0), n - 1.0)
        cell = min(int(place), n - 2)
        share = place - cell
        low, high = values[cell], values[cell + 1]
        values = [a + (b - a) * share for a, b in zip(low, high, strict=True)] if n == 2 else low + (high - low) * share
    return float(values)


sample(
    "pictured",
    lambda a: texture(PICTURE, a, (1e-3, 0.0), (0.0, 1e-3)),
    p_pictured,
    absolute=32,
    gpu=1024,  # texture units round their weights to 8 bits
    a=of(2, Pool(-0.5, 1.5, (0.0, 1.0, 0.5, 0.25, 0.75))),
    fixed=("a",),  # it has no derivative: heights are read as slopes
)

sample(
    "pictured_in_atlas",
    lambda a: texture_in_atlas(ATLAS, (*ATLAS.places[1], 3.0, 2.0), (0.0, 1.0), a, (1e-3, 0.0), (0.0, 1e-3), 1.0),
    p_pictured,
    absolute=32,
    a=of(2, Pool(-0.5, 1.5, (0.0, 1.0, 0.5, 0.25, 0.75))),
    fixed=("a",),
)

# Functions


@function(p=VEC3, radius=FLOAT)
def ball(p: Expr, radius: Expr) -> Expr:
    return v.length(p) - radius


@function(p=VEC3)
def two_balls(p: Expr) -> Expr:
    moved = p - (1.0, 0.0, 0.0)
    return v.min(ball(p, expr(1.0)), ball(moved, v.abs(p.x)))


@function(q=VEC2, s=FLOAT)
def swirl(q: Expr, s: Expr) -> Expr:
    turned = v.rotation2(q, s)
    return turned + s * q.yx


def p_ball(p: Plain, radius: float) -> float:
    return math.hypot(*p) - radius


def p_two_balls(p: Plain) -> float:
    return min(p_ball(p, 1.0), p_ball((p[0] - 1, p[1], p[2]), abs(p[0])))


def p_swirl(q: Plain, s: float) -> Plain:
    c, d = math.cos(s), math.sin(s)
    return (c * q[0] - d * q[1] + s * q[1], d * q[0] + c * q[1] + s * q[0])


sample("call", lambda p, r: ball(p, r), p_ball, ulps=4, absolute=16, p=of(3), r=REAL)
sample(
    "call_in_call", lambda p: two_balls(p * 2.0), lambda p: p_two_balls(each(lambda x: 2 * x, p)), absolute=64, p=of(3)
)
sample("call_of_vector", lambda q, s: swirl(q, s), p_swirl, absolute=64, gpu=4, q=of(2), s=REAL)
sample(
    "call_twice",
    lambda p, r: v.max(ball(p, r), -two_balls(p + r)),
    lambda p, r: max(p_ball(p, r), -p_two_balls(tuple(x + r for x in p))),
    absolute=64,
    p=of(3),
    r=REAL,
)

# Loops


def p_sum(a: float) -> float:
    total = 0.0
    for i in range(5):
        total += a * i
    return total


def p_fold(p: Plain) -> Plain:
    q, s = p, 1.0
    for _ in range(4):
        if math.hypot(*q) > 3.0:
            break
        q = tuple(abs(x) * 1.5 - 0.5 for x in q)
        s = s * 1.5
    return (*q, s)


def _fold(p: Expr) -> Expr:
    q, s = loop(
        4,
        (p, 1.0),
        lambda i, q, s: (abs(q) * 1.5 - 0.5, s * 1.5),
        until=lambda i, q, s: v.length(q) > 3.0,
    )
    return v.vec4(q, s)


def p_swapped(a: float, b: float) -> Plain:
    for _ in range(5):
        a, b = b, a + b
    return (a, b)


def _nested(a: Expr, p: Expr) -> Expr:
    def outer(i: Expr, total: Expr) -> tuple[Expr]:
        def inner(j: Expr, part: Expr) -> tuple[Expr]:
            return (part * 0.5 + p.x * j - a * i,)

        (part,) = loop(3, (total + i,), inner, until=lambda j, part: part > 4.0)
        return (part + p.y,)

    return loop(4, (a,), outer)[0]


def p_nested(a: float, p: Plain) -> float:
    total = a
    for i in range(4):
        part = total + i
        for j in range(3):
            if part > 4.0:
                break
            part = part * 0.5 + p[0] * j - a * i
        total = part + p[1]
    return total


@function(a=FLOAT, b=FLOAT)
def powers(a: Expr, b: Expr) -> Expr:
    last, _ = loop(3, (1.0, b), lambda i, x, y: (x * a + y, y * 0.5))
    return last


def p_powers(a: float, b: float) -> float:
    x, y = 1.0, b
    for _ in range(3):
        x, y = x * a + y, y * 0.5
    return x


def _two_loops(a: Expr) -> Expr:
    first = loop(3, (a,), lambda i, x: (x * 0.5 + 1.0,))[0]
    second = loop(2, (first,), lambda i, x: (x + first * a,))[0]
    return second - first


def p_two_loops(a: float) -> float:
    first = a
    for _ in range(3):
        first = first * 0.5 + 1.0
    second = first
    for _ in range(2):
        second = second + first * a
    return second - first


def _counted(a: Expr) -> Expr:
    """The turn in which it was left; the count itself is a condition of leaving."""
    turns, _ = loop(6, (0.0, a), lambda i, n, x: (i + 1.0, x * 2.0), until=lambda i, n, x: (x > 5.0) | (i >= 4.0))
    return turns


def p_counted(a: float) -> float:
    turns, x = 0.0, a
    for i in range(6):
        if x > 5 or i >= 4:
            break
        turns, x = i + 1.0, x * 2
    return turns


def _left_for_good(a: Expr) -> Expr:
    """The condition holds for one turn only; a loop that was left is not entered again."""
    return loop(6, (a,), lambda i, x: (x + 1.0,), until=lambda i, x: (i > 1.5) & (i < 2.5))[0]


def _flagged(a: Expr) -> Expr:
    """A condition among the carried values."""
    found, x = loop(4, (a < -10.0, a), lambda i, found, x: (found | (x > 3.0), x + 1.0))
    return v.where(found, x, -x)


def p_flagged(a: float) -> float:
    found, x = a < -10, a
    for _ in range(4):
        found, x = found or x > 3, x + 1
    return x if found else -x


_LOOPED = Pool(-2, 2, (0.0, 1.0, -1.0, 0.5))
sample("loop", lambda a: loop(5, (0.0,), lambda i, t: (t + a * i,))[0], p_sum, absolute=64, a=REAL)
sample("loop_once", lambda a: loop(1, (a,), lambda i, t: (t * t + i,))[0], lambda a: a * a, ulps=2, a=REAL)
sample("loop_left_early", _fold, p_fold, absolute=64, p=of(3, _LOOPED))
sample(
    "loop_swap",
    lambda a, b: v.vec2(*loop(5, (a, b), lambda i, x, y: (y, x + y))),
    p_swapped,
    absolute=64,
    a=REAL,
    b=REAL,
)
sample("loop_nested", _nested, p_nested, absolute=1024, a=_LOOPED, p=of(2, _LOOPED))
sample(
    "loop_in_function",
    lambda a, b: powers(a, b) + powers(b, b),
    lambda a, b: p_powers(a, b) + p_powers(b, b),
    absolute=512,
    a=_LOOPED,
    b=_LOOPED,
)
sample("loops_in_a_row", _two_loops, p_two_loops, absolute=128, a=REAL)
sample("loop_counted", _counted, p_counted, a=Pool(0.3, 7, (0.1, 1.0, 5.0, 6.0)))
sample("loop_left_for_good", _left_for_good, lambda a: a + 2.0, absolute=8, a=TILED)
sample("loop_flagged", _flagged, p_flagged, absolute=16, a=TILED)
sample(
    "loop_calls",
    lambda p: loop(3, (p, 0.0), lambda i, q, d: (q * 0.5 + 0.5, d + two_balls(q)))[1],
    lambda p: sum(p_two_balls(tuple(x * 0.5**i + 1 - 0.5**i for x in p)) for i in range(3)),
    absolute=128,
    p=of(3),
)


def lattice_hash(cell: Plain) -> float:
    """The hash of a cell by plain integers of 32 bits."""

    def mixed(v: int) -> int:
        v = (v * 747796405 + 2891336453) & 0xFFFFFFFF
        v = (((v >> ((v >> 28) + 4)) ^ v) * 277803737) & 0xFFFFFFFF
        return (v >> 22) ^ v

    assert isinstance(cell, tuple)
    x, y, z = (math.floor(c + 0.5) & 0xFFFFFFFF for c in cell)
    bits = mixed((x + mixed((y + mixed(z)) & 0xFFFFFFFF)) & 0xFFFFFFFF)
    return (bits >> 8) * 2.0**-24


sample(
    "finite",
    lambda x, a: v.where(v.finite(v.exp(1.0e5 * x)), 1.0, 2.0) + v.where(v.finite(a), 4.0, 8.0),
    lambda x, a: 5.0 if x < 0 else 6.0,
    fixed=("x",),
    x=NONZERO,
    a=of(3),
)
sample(
    "passage",
    lambda a: make("probe", a.type, (a,), Passage("point", 1, 2)) * 2.0,
    lambda a: each(lambda x: 2 * x, a),
    a=of(3),
)
sample(
    "limited",
    lambda a: make("within", a.type, (a * 3.0,), Limit("a", "numbers", -1.0, 1.0)) * 2.0,
    lambda a: each(lambda x: 6 * x, a),
    a=of(3),
)
sample("stopped", lambda a: v.stop_gradient(a * 3.0) * 2.0, lambda a: each(lambda x: 6 * x, a), fixed=("a",), a=of(3))
sample("lattice", lambda a: hash(v.floor(a)), lambda a: lattice_hash(each(math.floor, a)), fixed=("a",), a=of(3))
sample(
    "lattice_of_large_cells",  # odd numbers above 2^23: in float32, a half added to them is a tie
    lambda a: hash(v.vec3(1.0, 2.0, 2.0**24 * hash(v.floor(a)))),
    lambda a: lattice_hash((1.0, 2.0, 2.0**24 * lattice_hash(each(math.floor, a)))),
    fixed=("a",),
    a=of(3),
)


HILL = "float hill(vec3 p) {\n    return p.x * p.y + 0.5 * p.z;\n}"
RAW = RawFunction("hill", HILL, lambda p: p[:, 0] * p[:, 1] + p.dtype.type(0.5) * p[:, 2], 1.0)
sample("written_in_glsl", lambda p: raw(RAW, p), lambda p: p[0] * p[1] + 0.5 * p[2], absolute=16, p=of(3))
sample(
    "slope_of_glsl",
    lambda p: raw_slope(raw(RAW, p)),
    lambda p: (p[1], p[0], 0.5),
    absolute=16384,  # a difference over the cube root of a unit in the last place
    fixed=("p",),
    p=of(3),
)
