"""Tone mapping: from unbounded linear light to the range of a screen.

Curves are written in the expression language. `Frame.image` evaluates them with NumPy, the window as GLSL.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from raymarch.expr.arrays import evaluator, row_blocks
from raymarch.expr.convert import choice, real, switch
from raymarch.expr.function import Function
from raymarch.expr.glsl import print_functions
from raymarch.expr.hashing import pcg
from raymarch.expr.node import Expr, expr, var
from raymarch.expr.srgb import linear_to_srgb
from raymarch.expr.tables import Table, fetch
from raymarch.expr.types import FLOAT, VEC3
from raymarch.expr.vocabulary import clamp, dot, floor, log2, max, min, pow, vec3, where
from raymarch.scene.value import Value, value

COLOR = var("color", VEC3)

LUMINANCE = (0.2126, 0.7152, 0.0722)


def _matrix(rows: tuple[tuple[float, float, float], ...], c: Expr) -> Expr:
    return vec3(*(dot(row, c) for row in rows))


def _linear(c: Expr) -> Expr:
    """Clipped at 1."""
    return c


def _reinhard(c: Expr) -> Expr:
    """L / (1 + L) of the luminance L; the hue is kept (Reinhard et al. 2002)."""
    return c / (1.0 + dot(LUMINANCE, c))


def _aces(c: Expr) -> Expr:
    """Hill's fit of the reference and output transforms of ACES 1.0 (2015)."""
    v = _matrix(((0.59719, 0.35458, 0.04823), (0.076, 0.90834, 0.01566), (0.0284, 0.13383, 0.83777)), c)
    v = (v * (v + 0.0245786) - 0.000090537) / (v * (0.983729 * v + 0.4329510) + 0.238081)
    return _matrix(((1.60475, -0.53108, -0.07367), (-0.10208, 1.10813, -0.00605), (-0.00327, -0.07276, 1.07602)), v)


def _agx(c: Expr) -> Expr:
    """AgX (Sobotka 2022) with a polynomial curve (Wrensch 2023): 16.5 stops, bright colours turn towards white."""
    inset = (
        (0.842479062253094, 0.0784335999999992, 0.0792237451477643),
        (0.0423282422610123, 0.878468636469772, 0.0791661274605434),
        (0.0423756549057051, 0.0784336, 0.879142973793104),
    )
    outset = (
        (1.19687900512017, -0.0980208811401368, -0.0990297440797205),
        (-0.0528968517574562, 1.15190312990417, -0.0989611768448433),
        (-0.0529716355144438, -0.0980434501171241, 1.15107367264116),
    )
    v = clamp((log2(max(_matrix(inset, c), 1e-10)) + 12.47393) / 16.5, 0.0, 1.0)
    x = v * v
    q = x * x
    curve = 15.5 * q * x - 40.14 * q * v + 31.96 * q - 6.868 * x * v + 0.4298 * x + 0.1191 * v - 0.00232
    return pow(max(_matrix(outset, curve), 0.0), 2.2)


CURVES: Mapping[str, Callable[[Expr], Expr]] = {"linear": _linear, "reinhard": _reinhard, "aces": _aces, "agx": _agx}


@value
class ToneMapping(Value):
    """Tone mapping from linear light to an 8-bit picture.

    Parameters
    ----------
    curve : "linear" clips values above 1. "reinhard" compresses all luminance below 1. "aces" and "agx" are film-like
        curves; "agx" turns bright colours towards white.
    exposure : stops, from -30 to 30. The light is first multiplied by 2**exposure.
    dither : round to 8 bits up or down by a hash of the pixel, so that gradients show no bands. The same picture gives
        the same bytes.

    Raises
    ------
    SceneError : a value outside its range.
    """

    BELONGS: ClassVar[str] = "Scene(tone=...)"
    curve: str
    exposure: float
    dither: bool

    def __init__(self, curve: str = "linear", exposure: float = 0.0, dither: bool = False) -> None:
        self._set(
            curve=choice("ToneMapping: curve", curve, tuple(CURVES)),
            exposure=real("ToneMapping: exposure", exposure, -30, 30, "a number of stops from -30 to 30"),
            dither=switch("ToneMapping: dither", dither),
        )

    def apply(self, color: NDArray[Any]) -> NDArray[np.float64]:
        """Linear light (..., 3) as linear values for the screen, from 0 to 1, in float64; NaN becomes 0."""
        light = np.fmin(np.fmax(np.asarray(color, np.float64), 0.0), 1e30)  # of NaN and 0 it takes 0
        made = evaluator([self.function.body], [COLOR])(light)[0]
        return np.clip(np.broadcast_to(made, light.shape), 0.0, 1.0)

    def image(self, color: NDArray[Any]) -> NDArray[np.uint8]:
        """Linear light (H, W, 3) as 8-bit sRGB (IEC 61966-2-1)."""
        made = np.empty(np.shape(color), np.uint8)
        steps = self.steps if np.asarray(color).dtype == np.float32 else None
        for rows in row_blocks(made):
            if steps is not None:
                made[rows] = steps.codes(color[rows])
            else:
                made[rows] = encode(self.apply(color[rows]), self.dither, rows.start * made[0].size)
        return made

    @property
    def steps(self) -> Steps | None:
        """The light at which the 8-bit code of a channel changes; None if the code depends on more than that light."""
        return _exposed(self.exposure) if self.curve == "linear" and not self.dither else None

    def glsl(self) -> str:
        """The tone curve as GLSL text: `vec3 toned(vec3 color)`."""
        return "\n".join(line.text for line in print_functions([self.function]).lines())

    @property
    def function(self) -> Function:
        """The tone curve as a function of the linear colour: `toned`."""
        return _toned(self.curve, self.exposure)


@cache
def _toned(curve: str, exposure: float) -> Function:
    return Function("toned", (COLOR,), CURVES[curve](COLOR * expr(2.0**exposure)))


def encode(linear: NDArray[Any], dither: bool = False, first: int = 0) -> NDArray[np.uint8]:
    """Linear values from 0 to 1 as 8-bit sRGB, (H, W, 3), rounded to nearest or dithered by a hash of the pixel.

    first : number of values of the picture before these.
    """
    x = np.asarray(linear, np.float64)
    if not dither:
        codes, edges = _steps()
        interval = (x * INTERVALS).astype(np.intp)
        return np.asarray(codes[interval] + (x >= edges[interval]), np.uint8)
    bits = pcg(np.arange(first, first + x.size, dtype=np.uint32)).reshape(x.shape)
    return np.asarray(np.minimum(np.floor(255.0 * linear_to_srgb(x) + bits * 2.0**-32), 255.0), np.uint8)


@dataclass(frozen=True, slots=True)
class Steps:
    """The 8-bit code of each float32 value of light, exactly as by `ToneMapping.apply` and `encode`, in less time.

    With i = floor(4096 min(scale c, 1)), the code of a value c is `first[i]`, plus 1 if c >= `light[i]`, which
    is NaN for the last code.

    Of all values with the same upper 16 bits i, the code is `last[i]`, less 1 if c <= `below[i]`.
    """

    scale: np.float32
    first: NDArray[np.uint8]
    light: NDArray[np.float32]
    last: NDArray[np.uint8]
    below: NDArray[np.float32]

    def function(self) -> Function:
        """The code of a value as a function for the device: `code`."""
        table = Table(np.stack([self.first, np.nan_to_num(self.light, nan=np.inf)], axis=-1), "codes of light")
        given = var("light", FLOAT)
        share = where(given > 0.0, min(given * float(self.scale), 1.0), 0.0)  # of NaN: 0
        found = fetch(table, floor(share * float(INTERVALS)))
        return Function("code", (given,), min(found.x + where(given >= found.y, 1.0, 0.0), 255.0))

    def codes(self, light: NDArray[np.float32]) -> NDArray[np.uint8]:
        """The codes of float32 values of any shape; NaN as 0."""
        bits = np.right_shift(light.view(np.uint32), 16, dtype=np.intp)
        return np.asarray(self.last.take(bits) - (light <= self.below.take(bits)))


@cache
def _exposed(exposure: float) -> Steps:
    """The steps after an exposure. Of neighbouring float32 values, the first one that reaches the next code."""
    first, edges = _steps()
    scale = 2.0**exposure
    light = np.nextafter((edges / scale).astype(np.float32), np.float32(0.0))
    with np.errstate(over="ignore"):
        for _ in range(3):
            light = np.where(light.astype(np.float64) * scale >= edges, light, np.nextafter(light, np.float32(np.inf)))
    light = np.where(np.isfinite(light), light, np.float32(np.nan))
    reached = light[light <= FLOATS_END]  # in ascending order, with repetitions
    return Steps(np.float32(scale), first, light, *_by_upper_bits(reached[np.diff(reached, prepend=0.0) > 0.0]))


FLOATS_END = np.finfo(np.float32).max
INFINITE = 0x7F80
"""The upper 16 bits of infinity, and of some NaN."""


def _by_upper_bits(edges: NDArray[np.float32]) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
    """The tables of `Steps` by the upper 16 bits of a value. edges : the light from which on each code is reached.

    The values of an entry differ by 1/128, in which the transfer function rises by 0.9 codes at most. Negative values
    and NaN have the code 0. That of infinity is 0 - 1, which is 255 in 8 bits.
    """
    ends = (np.arange(INFINITE + 1, dtype=np.uint32) << 16).view(np.float32)
    last, below = np.zeros(1 << 16, np.uint8), np.full(1 << 16, np.nan, np.float32)
    codes = np.searchsorted(edges, ends)  # of the value before
    last[:INFINITE] = codes[1:]
    some = np.flatnonzero(np.diff(codes))
    below[some] = np.nextafter(edges[codes[some]], np.float32(0.0))
    below[INFINITE] = np.inf
    return last, below


INTERVALS = 4096
"""Intervals of [0, 1] in which the 8-bit code changes once at most: the transfer function is at most 3295 steep."""


@cache
def _steps() -> tuple[NDArray[np.uint8], NDArray[np.float64]]:
    """For each interval: the code at its lower end, and the value from which on the code is larger by one.

    Two look-ups for each pixel take a third of the time of the power.
    """
    codes = np.arange(1, 256)
    low, high = np.zeros(255), np.ones(255)
    for _ in range(80):  # until they are neighbours in float64
        middle = 0.5 * (low + high)
        reached = np.rint(255.0 * linear_to_srgb(middle)) >= codes
        low, high = np.where(reached, low, middle), np.where(reached, middle, high)
    first = np.searchsorted(high, np.arange(INTERVALS + 1) / INTERVALS, side="right")
    return first.astype(np.uint8), np.append(high, np.inf)[first]
