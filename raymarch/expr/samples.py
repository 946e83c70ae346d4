"""Sampled data as a function of position, with linear interpolation.

Coordinates are in texels: 0 is the centre of the first one, n - 1 that of the last. Outside, coordinates are clamped.
The GLSL fetches texels and interpolates in float32, because texture units round the weights to 8 bits.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from raymarch.errors import SceneError
from raymarch.expr.data import Data, digest
from raymarch.expr.node import Expr, Operand, expr, make
from raymarch.expr.types import FLOAT, VEC2, VEC3
from raymarch.expr.vocabulary import clamp

Array = NDArray[Any]


class Samples(Data):
    """Numbers on a regular grid, float32: shape (ny, nx) or (nz, ny, nx), each side 2 to 2048.

    called : the function of the user's call that made them, by which messages name the node; "" for the node's own.
    """

    __slots__ = ("called", "values")

    kind = "samples"
    channels = 1

    def __init__(self, values: ArrayLike, called: str = "") -> None:
        array = np.ascontiguousarray(values, np.float32)
        if array.ndim not in (2, 3) or min(array.shape) < 2 or max(array.shape) > 2048:
            raise SceneError(f"samples of shape {array.shape}", legal="(ny, nx) or (nz, ny, nx), each from 2 to 2048")
        if not np.all(np.isfinite(array)):
            raise SceneError("samples hold values that are not finite", legal="finite numbers")
        array.setflags(write=False)
        self.values = array
        self.called = called
        self.key = digest(",".join(map(str, array.shape)).encode(), array.tobytes())
        self.label = f"samples of {' x '.join(map(str, self.size))}"

    @property
    def dimension(self) -> int:  # type: ignore[override]
        """2 or 3."""
        return self.values.ndim

    @property
    def nbytes(self) -> int:
        """Size of the texture in bytes."""
        return 16 * math.prod(n - 1 for n in self.size) if self.dimension == 2 else self.values.nbytes

    def texture(self) -> tuple[tuple[int, ...], int, bytes]:
        """Size, channels and content of the texture. In 2D a texel holds the four corners of a cell, so that one fetch
        finds all that is interpolated."""
        if self.dimension == 3:
            return self.size, 1, self.values.tobytes()
        v = self.values
        corners = np.stack([v[:-1, :-1], v[:-1, 1:], v[1:, :-1], v[1:, 1:]], axis=-1)
        return corners.shape[1::-1], 4, corners.tobytes()

    @property
    def size(self) -> tuple[int, ...]:
        """Texels along x, y (and z)."""
        return self.values.shape[::-1]

    @property
    def steepest(self) -> float:
        """An upper bound of the gradient's length, per texel: in each cell, the norm of the largest differences along
        the axes."""
        values = self.values.astype(np.float64)
        total = np.zeros(tuple(n - 1 for n in values.shape))
        for axis in range(values.ndim):
            step = np.abs(np.diff(values, axis=axis))
            for other in range(values.ndim):
                if other != axis:
                    low = [slice(None)] * values.ndim
                    high = [slice(None)] * values.ndim
                    low[other], high[other] = slice(None, -1), slice(1, None)
                    step = np.maximum(step[tuple(low)], step[tuple(high)])
            total += step**2
        return float(np.sqrt(total.max()))


def sample(data: Samples, at: Operand) -> Expr:
    """The data at a position in texels, with linear interpolation; clamped outside.

    data : 2D or 3D. at : vec2 (x, y) or vec3 (x, y, z).
    """
    point = expr(at)
    wanted = VEC2 if data.dimension == 2 else VEC3
    if point.type is not wanted:
        raise SceneError(f"{data.dimension}D samples at a {point.type}", legal=f"a {wanted}")
    inside = clamp(point, 0.0, tuple(float(n - 1) for n in data.size))
    return make("sample", FLOAT, (inside,), data)


def sample_slope(e: Expr) -> Expr:
    """The gradient of a `sample`, per texel."""
    return make("sample_slope", e.args[0].type, e.args, e.data)


def sample_bend(e: Expr) -> Expr:
    """The second derivative of a 2D `sample` along both axes, per texel and texel: one number for each cell."""
    return make("sample_bend", FLOAT, e.args, e.data)


# Readings


def _corners(data: Samples, at: Array) -> tuple[Array, list[tuple[tuple[int, ...], Array]]]:
    """Weights along each axis, and the values at the corners of the cell that contains a position."""
    size = np.array(data.size)
    cell = np.clip(np.nan_to_num(np.floor(at)), 0, size - 2).astype(np.int64)
    weight = at - cell.astype(at.dtype)
    corners = []
    for corner in np.ndindex(*(2,) * data.dimension):
        index = cell + np.array(corner)
        texel = data.values[tuple(index[..., k] for k in reversed(range(data.dimension)))]
        corners.append((corner, texel.astype(at.dtype)))
    return weight, corners


def evaluate(node: Expr, at: Array) -> Array:
    """NumPy row of "sample"."""
    weight, corners = _corners(node.data, at)
    total: Array = np.zeros(at.shape[:-1], at.dtype)
    for corner, value in corners:
        total = total + value * np.prod(np.where(np.array(corner) == 1, weight, 1 - weight), axis=-1)
    return total


def evaluate_slope(node: Expr, at: Array) -> Array:
    """NumPy row of "sample_slope"."""
    weight, corners = _corners(node.data, at)
    parts: list[Array] = []
    for axis in range(node.data.dimension):
        total: Array = np.zeros(at.shape[:-1], at.dtype)
        for corner, value in corners:
            factors = np.where(np.array(corner) == 1, weight, 1 - weight)
            factors[..., axis] = 1 if corner[axis] else -1
            total = total + value * np.prod(factors, axis=-1)
        parts.append(total)
    return np.stack(parts, axis=-1)


def evaluate_bend(node: Expr, at: Array) -> Array:
    """NumPy row of "sample_bend"."""
    a, b, c, d = (value for _, value in _corners(node.data, at)[1])
    return np.asarray(a - b - c + d)


def interval(node: Expr, *_at: Any) -> tuple[Array, Array]:
    """Interval row of "sample": the smallest and the largest value of the data."""
    return np.asarray(node.data.values.min(), np.float64), np.asarray(node.data.values.max(), np.float64)


def glsl_helper(dimension: int, constant: bool = False) -> str:
    """Text of the GLSL function that interpolates.

    constant : `constant_number(i)` gives the numbers, and the data are an ivec3 or ivec4: where they start,
    and their size along each axis.
    """
    if not constant and dimension == 2:
        return _in_plane("sampler2D", "textureSize(data, 0) - 1", "texelFetch(data, cell, 0)")
    if not constant:
        return _in_space("sampler3D", "textureSize(data, 0)", lambda at: f"texelFetch(data, {at}, 0).r")
    type, size, row = (
        ("ivec3", "data.yz - 2", "at.y") if dimension == 2 else ("ivec4", "data.yzw", "(at.y + data.z * at.z)")
    )
    read = f"""float constant_number({type} data, ivec{dimension} at) {{
    return constant_number(data.x + at.x + data.y * {row});
}}

"""
    if dimension == 3:
        return read + _in_space(type, size, lambda at: f"constant_number(data, {at})")
    corners = ", ".join(f"constant_number(data, cell + ivec2({x}, {y}))" for y in (0, 1) for x in (0, 1))
    return read + _in_plane(type, size, f"vec4({corners})")


def _in_plane(type: str, last: str, corners: str) -> str:
    return f"""vec4 interpolated({type} data, vec2 at) {{
    // (d/dx, d/dy, d2/dxdy, value), per texel
    ivec2 cell = ivec2(clamp(floor(at), vec2(0.0), vec2({last})));
    vec2 w = at - vec2(cell);
    vec4 h = {corners};  // x runs first, then y
    vec2 rise = mix(h.yz - h.x, h.w - h.zy, w.yx);
    vec2 rows = mix(h.xz, h.yw, w.x);
    return vec4(rise, h.x - h.y - h.z + h.w, mix(rows.x, rows.y, w.y));
}}"""


def _in_space(type: str, size: str, read: Callable[[str], str]) -> str:
    return f"""vec4 interpolated({type} data, vec3 at) {{
    // (d/dx, d/dy, d/dz, value), per texel
    ivec3 cell = ivec3(clamp(floor(at), vec3(0.0), vec3({size} - 2)));
    vec3 w = at - vec3(cell);
    vec4 low, high;  // the four corners of the near and of the far face: x runs first, then y
    for (int i = 0; i < 4; i++) {{
        ivec3 corner = cell + ivec3(i & 1, i >> 1, 0);
        low[i] = {read("corner")};
        high[i] = {read("corner + ivec3(0, 0, 1)")};
    }}
    vec4 face = mix(low, high, w.z);
    vec2 rows = mix(face.xz, face.yw, w.x);
    vec4 rise = high - low;
    vec2 rises = mix(rise.xz, rise.yw, w.x);
    return vec4(
        mix(face.y - face.x, face.w - face.z, w.y), rows.y - rows.x,
        mix(rises.x, rises.y, w.y), mix(rows.x, rows.y, w.y));
}}"""
