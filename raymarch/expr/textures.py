"""Textures as a function of position, filtered over the pixel footprint.

The footprint of a pixel in the texture is nearly an ellipse with two conjugate axes: the images of the axes of the
footprint on the surface. The mean over the ellipse is approximated by up to 16 samples along its longer axis, each from
the mip level whose texels are as wide as the shorter axis (McCormack et al. 1999, "Feline"). For longer ellipses
coarser levels are used: a blur, but no moire.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from raymarch.errors import SceneError
from raymarch.expr.atlas import HELPER, Atlas
from raymarch.expr.node import Expr, Operand, expr, make
from raymarch.expr.texels import Texels
from raymarch.expr.types import FLOAT, VEC2, VEC4, vector

Array = NDArray[Any]

TAPS = 16
"""Maximum number of samples along the longer axis."""

LEAST = 2.0**-10
"""Below this weight a texture is not read: it is less than the rounding of half floats."""

SLACK = 0.05
"""An ellipse that is longer than wide by less than this, in widths, counts as a circle; rounding must not double the
samples."""


def texture(data: Texels, at: Operand, duvdx: Operand, duvdy: Operand, weight: Operand = 1.0) -> Expr:
    """Mean of a texture over an ellipse, times a weight. Where the weight is below 2^-10 it is 0 without a read.

    at : vec2 (u, v), 0 to 1 from left to right and from bottom to top.
    duvdx, duvdy : vec2, the full extents of the ellipse along two conjugate axes, in the same units.
    Returns a float, vec2 or vec3, according to the channels of the data.
    """
    args = tuple(map(expr, (at, duvdx, duvdy, weight)))
    if [a.type for a in args] != [VEC2, VEC2, VEC2, FLOAT]:
        raise SceneError(f"texture of {', '.join(a.type.name for a in args)}", legal="three vec2 and a float")
    return make("texture", data.type, args, data)


def texture_in_atlas(
    atlas: Atlas, place: Operand, kind: Operand, at: Operand, duvdx: Operand, duvdy: Operand, weight: Operand
) -> Expr:
    """`texture` of a chosen picture of an atlas.

    place : vec4, the corner and the size of the picture in texels. kind : vec2, its wrap and its last level.
    """
    args = tuple(map(expr, (place, kind, at, duvdx, duvdy, weight)))
    if [a.type for a in args] != [VEC4, VEC2, VEC2, VEC2, VEC2, FLOAT]:
        what = f"texture in an atlas of {', '.join(a.type.name for a in args)}"
        raise SceneError(what, legal="a vec4, four vec2 and a float")
    return make("texture_in_atlas", vector(atlas.channels), args, atlas)


# Readings


def evaluate_in_atlas(node: Expr, place: Array, _kind: Array, *args: Array) -> Array:
    """NumPy row of "texture_in_atlas": each picture where it is chosen. A place outside the list gives 0."""
    atlas: Atlas = node.data
    tails = ((4,), (2,), (2,), (2,), ())
    lead = np.broadcast_shapes(
        *(np.shape(v)[: np.ndim(v) - len(t)] for v, t in zip((place, *args), tails, strict=True))
    )
    corners, *given = (
        np.broadcast_to(v, (*lead, *t)).reshape(-1, *t) for v, t in zip((place, *args), tails, strict=True)
    )
    total = np.zeros((len(corners), *node.type.shape), given[0].dtype)
    for picture, corner in zip(atlas.pictures, atlas.places, strict=True):
        here = (corners[:, :2] == corner).all(axis=1)
        if here.any():
            total[here] = evaluate(make("texture", node.type, node.args[2:], picture), *(v[here] for v in given))
    return total.reshape((*lead, *node.type.shape))


def evaluate(node: Expr, at: Array, duvdx: Array, duvdy: Array, weight: Array) -> Array:
    """NumPy row of "texture"."""
    data: Texels = node.data
    lead = np.broadcast_shapes(at.shape[:-1], duvdx.shape[:-1], duvdy.shape[:-1], np.shape(weight))
    weight = np.broadcast_to(weight, lead)
    parts = [np.broadcast_to(v, (*lead, 2)).reshape(-1, 2) for v in (at, duvdx, duvdy)]
    read = weight.ravel() >= LEAST
    total = np.zeros((read.size, data.channels), at.dtype)
    if read.any():
        total[read] = _mean(data, *(part[read] for part in parts)) * weight.ravel()[read, None]
    return total[:, 0].reshape(lead) if data.channels == 1 else total.reshape(*lead, data.channels)


def _mean(data: Texels, at: Array, duvdx: Array, duvdy: Array) -> Array:
    """Mean over the ellipses of N points, (N, channels)."""
    size = np.array(data.size, at.dtype)
    axis, longest, shortest = _ellipse(duvdx * size, duvdy * size)
    wide = np.maximum(shortest, np.maximum(longest / TAPS, 1))
    taps = np.clip(np.ceil(longest / wide - SLACK), 1, TAPS)
    level = np.log2(wide)
    total = np.zeros((len(at), data.channels), at.dtype)
    for i in range(int(taps.max())):
        rows = np.flatnonzero(i < taps)
        step = ((i + at.dtype.type(0.5)) / taps[rows] - at.dtype.type(0.5))[:, None]
        total[rows] += _between_levels(data, at[rows] + step * axis[rows] / size, level[rows])
    return total / taps[:, None]


def _ellipse(a: Array, b: Array) -> tuple[Array, Array, Array]:
    """The longer axis (N, 2) of the ellipse with the conjugate axes a and b, and the lengths of both axes."""
    xx, yy = a[:, 0] ** 2 + b[:, 0] ** 2, a[:, 1] ** 2 + b[:, 1] ** 2
    xy = a[:, 0] * a[:, 1] + b[:, 0] * b[:, 1]
    half = (xx - yy) / 2
    root = np.sqrt(half * half + xy * xy)
    longest = np.sqrt(np.maximum((xx + yy) / 2 + root, np.finfo(np.float32).tiny))
    shortest = np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) / longest
    axis = np.where((half > 0)[:, None], np.stack([half + root, xy], 1), np.stack([xy, root - half], 1))
    size = np.maximum(np.sqrt(np.sum(axis * axis, axis=1)), np.finfo(np.float32).tiny)
    return axis * (longest / size)[:, None], longest, shortest


def _between_levels(data: Texels, at: Array, level: Array) -> Array:
    last = len(data.levels) - 1
    level = np.clip(level, 0, last)
    low = np.minimum(np.floor(level).astype(int), max(last - 1, 0))
    total = np.zeros((len(at), data.channels), at.dtype)
    for k in np.unique(low):
        rows = np.flatnonzero(low == k)
        weight = (level[rows] - k)[:, None]
        value = _within_level(data, k, at[rows])
        if weight.any():
            value = value * (1 - weight) + _within_level(data, k + 1, at[rows]) * weight
        total[rows] = value
    return total


def _within_level(data: Texels, level: int, at: Array) -> Array:
    texels = data.levels[level]
    size = np.array(texels.shape[1::-1])
    if data.wrap == "repeat":
        at = at - np.floor(at)
    elif data.wrap == "mirror":
        at = 1 - np.abs(at - 2 * np.floor(at / 2) - 1)
    place = np.nan_to_num(at) * size.astype(at.dtype) - at.dtype.type(0.5)
    cell = np.floor(np.clip(place, -1, size)).astype(np.int64)
    w = np.clip(place - cell, 0, 1)
    total = np.zeros((len(at), data.channels), at.dtype)
    for corner in ((0, 0), (1, 0), (0, 1), (1, 1)):
        index = cell + np.array(corner)
        index = index % size if data.wrap == "repeat" else np.clip(index, 0, size - 1)
        factors = np.where(np.array(corner) == 1, w, 1 - w)
        total += (factors[:, :1] * factors[:, 1:]) * texels[index[:, 1], index[:, 0]].astype(at.dtype)
    return total


def interval(node: Expr, *_args: Any) -> tuple[Array, Array]:
    """Interval row of "texture": from the smallest to the largest value of the data, and 0, because the weight may be
    0."""
    values = node.data.levels[0].astype(np.float64)
    ends = np.minimum(values.min((0, 1)), 0.0), np.maximum(values.max((0, 1)), 0.0)
    low, high = (end if node.type.is_vector else end[0] for end in ends)
    return np.asarray(low), np.asarray(high)


def helper_of(data: Texels) -> str:
    """Name of the GLSL function that reads the texture."""
    return "filtered_mirrored" if data.wrap == "mirror" else "filtered"


def glsl_helper(data: Texels) -> str:
    """Text of the GLSL function. Coordinates are mirrored: at the edge of a mirrored texture clamping is equivalent."""
    read = f"1.0 - abs(mod({POINT}, 2.0) - 1.0)" if data.wrap == "mirror" else POINT
    return _HELPER.replace("NAME", helper_of(data)).replace("POINT", read)


def atlas_helper() -> str:
    """Text of the GLSL function that reads a picture in an atlas."""
    text = _HELPER.replace("NAME(sampler2D image, ", "filtered_in_atlas(sampler2D image, ivec4 place, ivec2 kind, ")
    text = text.replace("vec2(textureSize(image, 0))", "vec2(place.zw)")
    text = text.replace("textureLod(image, POINT, level)", f"atlas_texel(image, place, kind, {POINT}, level)")
    return f"{HELPER}\n\n{text}"


POINT = "at + ((float(i) + 0.5) / float(taps) - 0.5) * axis"
"""The centre of a sample of an ellipse."""

_HELPER = f"""vec4 NAME(sampler2D image, vec2 at, vec2 duvdx, vec2 duvdy, float weight) {{
    // the mean over an ellipse, by samples along its longer axis
    if (weight < {LEAST}) return vec4(0.0);
    vec2 size = vec2(textureSize(image, 0));
    vec2 a = duvdx * size, b = duvdy * size;
    float half_difference = 0.5 * (a.x * a.x + b.x * b.x - a.y * a.y - b.y * b.y);
    float product = a.x * a.y + b.x * b.y;
    float root = sqrt(half_difference * half_difference + product * product);
    float longest = sqrt(max(0.5 * (dot(a, a) + dot(b, b)) + root, 1.1754944e-38));
    vec2 axis = half_difference > 0.0 ? vec2(half_difference + root, product) : vec2(product, root - half_difference);
    float turned = length(axis);  // 0 for a circle, which has no longer axis
    axis *= (turned > 1.0e-30 ? longest / turned : 0.0) / size;
    float wide = max(abs(a.x * b.y - a.y * b.x) / longest, max(longest / {TAPS}.0, 1.0));
    int taps = int(clamp(ceil(longest / wide - {SLACK}), 1.0, {TAPS}.0));
    float level = log2(wide);
    vec4 total = vec4(0.0);
    for (int i = 0; i < {TAPS}; i++) {{
        if (i >= taps) break;
        total += textureLod(image, POINT, level);
    }}
    return total * (weight / float(taps));
}}"""
