"""The transfer function of sRGB (IEC 61966-2-1), written once as expressions: for NumPy and for GLSL."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from raymarch.expr.arrays import evaluator
from raymarch.expr.function import Function
from raymarch.expr.glsl import print_functions
from raymarch.expr.node import Expr, var
from raymarch.expr.types import FLOAT
from raymarch.expr.vocabulary import pow, where

X = var("x", FLOAT)

_ENCODED: Expr = where(X <= 0.0031308, 12.92 * X, 1.055 * pow(X, 1.0 / 2.4) - 0.055)
_LINEAR: Expr = where(X <= 0.04045, X / 12.92, pow((X + 0.055) / 1.055, 2.4))

ENCODE = Function("linear_to_srgb", (X,), _ENCODED)
"""The encoding of one component from 0 to 1."""
DECODE = Function("to_linear", (X,), _LINEAR)
"""The inverse of `ENCODE`."""

_encode, _decode = evaluator([_ENCODED], [X]), evaluator([_LINEAR], [X])


def srgb_to_linear(encoded: NDArray[Any]) -> NDArray[np.float64]:
    """Linear values of sRGB-encoded values from 0 to 1, of any shape, in float64."""
    return np.asarray(_decode(np.asarray(encoded, np.float64))[0])


def linear_to_srgb(linear: NDArray[Any]) -> NDArray[np.float64]:
    """sRGB-encoded values of linear values from 0 to 1, of any shape, in float64."""
    return np.asarray(_encode(np.asarray(linear, np.float64))[0])


def srgb_glsl(decode: bool = False) -> str:
    """The encoding as GLSL text, `float linear_to_srgb(float x)`, or its inverse, `float to_linear(float x)`."""
    return "\n".join(line.text for line in print_functions([DECODE if decode else ENCODE]).lines())
