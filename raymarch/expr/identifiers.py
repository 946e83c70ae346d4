"""Identifiers that are legal in GLSL, in each of its versions and on each driver."""

from __future__ import annotations

import re
from collections.abc import Iterable
from functools import lru_cache

_WORDS = """
attribute const uniform varying buffer shared coherent volatile restrict readonly writeonly atomic_uint layout
centroid flat smooth noperspective patch sample break continue do for while switch case default if else subroutine
in out inout float double int void bool true false invariant precise discard return lowp mediump highp precision
struct common partition active asm class union enum typedef template this resource goto inline noinline public
static extern external interface long short half fixed unsigned superp input output filter cast namespace using
packed row_major column_major sizeof demote subpass
main texture textureLod textureSize texelFetch atan2 arc_sine arc_cosine unit radians degrees sin cos tan asin acos
atan sinh cosh tanh interpolated cell_hash pcg is_finite constant_number
constant_numbers_0 constant_numbers_1 constant_numbers_2 constant_numbers_3
filtered filtered_mirrored filtered_in_atlas atlas_level atlas_texel texel1 texel2 texel4
pow exp log exp2 log2 sqrt inversesqrt abs sign floor ceil trunc round fract mod modf min max clamp mix step
smoothstep isnan isinf length distance dot cross normalize reflect refract transpose inverse determinant any all
not lessThan greaterThan equal dFdx dFdy fwidth uint field asinh acosh atanh roundEven faceforward outerProduct
matrixCompMult lessThanEqual greaterThanEqual notEqual floatBitsToInt floatBitsToUint intBitsToFloat uintBitsToFloat
packSnorm2x16 unpackSnorm2x16 packUnorm2x16 unpackUnorm2x16 packHalf2x16 unpackHalf2x16
"""
RESERVED = frozenset(_WORDS.split())
_NUMBERED = re.compile(r"([iubdhf]?vec[234]|d?mat[234](x[234])?|noise[1-4])$")
_TYPE_LIKE = re.compile(rf"{_NUMBERED.pattern}|([iu]?(sampler|image)\w*|texture\w*)$")
_PREFIXES = ("gl_", "GL_", "webgl_")  # reserved by OpenGL, its macros, and browsers


def identifier(name: str, taken: Iterable[str], numbers: dict[str, int] | None = None) -> str:
    """A legal GLSL name close to the requested one that is not taken.

    `numbers` stores the last suffix of each name, so that thousands of equal requests stay fast.
    """
    clean = _legal(name)
    result, number = clean, (numbers or {}).get(clean, 2)
    while result in taken or result in RESERVED or _NUMBERED.match(result):
        result, number = f"{clean}{number}" if not clean[-1].isdigit() else f"{clean}_{number}", number + 1
    if numbers is not None:
        numbers[clean] = number
    return result


@lru_cache(1024)
def _legal(name: str) -> str:
    """A legal GLSL name close to the requested one."""
    clean = re.sub(r"_{2,}", "_", re.sub(r"\W", "_", name, flags=re.ASCII)).strip("_") or "value"
    if clean[0].isdigit():
        clean = f"n{clean}"
    if clean.startswith(_PREFIXES):
        clean = f"v{clean}"
    if clean in RESERVED or _TYPE_LIKE.match(clean):
        clean = f"{clean}_value"
    return clean
