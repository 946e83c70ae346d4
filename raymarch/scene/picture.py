"""Pixel values of textures: as stored, and converted for their use.

Colours are decoded from sRGB. Other values are used as stored. Normals and heights become slopes, because the mean of
slopes over a footprint is the slope of the visible surface.
"""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from raymarch.errors import SceneError
from raymarch.expr.convert import input_file, numbers, short
from raymarch.expr.images import read_stored
from raymarch.expr.srgb import srgb_to_linear
from raymarch.expr.texels import LARGEST, Wrap

Array = NDArray[Any]
Picture: TypeAlias = str | PathLike[str] | Array

STEEPEST = 64.0
"""Largest slope of a normal map: 89 degrees. Steeper normals carry no information."""


def values_for(stored: Array, role: str, encoded: bool, channel: int | None, downwards: bool, wrap: Wrap) -> Array:
    """The values of a picture, converted for a role, row 0 at the bottom."""
    pixels = np.asarray(stored[::-1], np.float32)
    one = pixels[..., channel or 0]
    values: Array
    if role == "color":
        values = _decoded(pixels[..., :3]) if encoded else pixels[..., :3]
    elif role == "grey":
        values = _decoded(one) if encoded and channel is None else one
    elif role == "stored":
        values = pixels[..., :3]
    elif role == "number":
        values = one
    elif role == "normals":
        normal = 2.0 * pixels - 1.0
        slope = -normal[..., :2] / np.maximum(normal[..., 2:3], 1.0 / STEEPEST)
        values = np.clip(slope * (1.0, -1.0 if downwards else 1.0), -STEEPEST, STEEPEST)
    else:
        values = _slopes(one, wrap)
    return values


def _decoded(encoded: Array) -> Array:
    """Linear values of sRGB-encoded ones (multiples of 1/255 or 1/65535), from a table: there may be millions."""
    table = np.asarray(srgb_to_linear(np.arange(65536) / 65535.0), np.float32)
    return table[np.rint(encoded * 65535.0).astype(np.uint16)]


def _slopes(heights: Array, wrap: Wrap) -> Array:
    """Slopes of heights along u and v, per picture width and height, by central differences; (h, w, 2)."""
    mode: Any = "wrap" if wrap == "repeat" else "edge"
    padded = np.pad(heights, 1, mode)
    right = 0.5 * (padded[1:-1, 2:] - padded[1:-1, :-2]) * heights.shape[1]
    up = 0.5 * (padded[2:, 1:-1] - padded[:-2, 1:-1]) * heights.shape[0]
    return np.stack([right, up], axis=-1)


class Stored(NamedTuple):
    """A picture as stored.

    pixels : (H, W, 1 to 4) float32, row 0 at the top.
    encoded : whether its colours are sRGB-encoded.
    name : name for messages.
    """

    pixels: Array
    encoded: bool
    name: str

    def __eq__(self, other: object) -> bool:
        return self is other or (
            isinstance(other, Stored) and self[1:] == other[1:] and np.array_equal(self.pixels, other.pixels)
        )

    def __hash__(self) -> int:
        return hash((self.pixels.shape, self.encoded, self.name))

    def __repr__(self) -> str:
        return f"'{self.name}'"


def stored_of(what: str, picture: Picture | Stored) -> Stored:
    """The pixels of a file or an array. SceneError for values that are not finite, and for pictures too large."""
    if isinstance(picture, Stored):
        checked = stored_of(what, picture.pixels)
        return Stored(checked.pixels, picture.encoded, str(picture.name))
    if isinstance(picture, str | PathLike):
        name = input_file(f"{what}: source", picture, "the name of a picture's file")
        stored, encoded = read_stored(what, name, LARGEST)
        _check_range(f"{what}: '{name}'", stored, "numbers in the range of half floats")
        return Stored(np.ascontiguousarray(stored, np.float32), encoded, Path(name).name)
    legal = f"a file, or an array (H, W) or (H, W, 1 to 4) of finite numbers, sides from 1 to {LARGEST}"
    numbers(f"{what}: source", picture, legal)
    array = np.asarray(picture)
    given = f"{what}: an array of shape {array.shape}, {array.dtype}"
    if array.dtype.kind not in "biuf" or array.ndim not in (2, 3) or not array.size:
        raise SceneError(given if isinstance(picture, np.ndarray) else f"{what}: {short(picture)}", legal=legal)
    encoded = array.dtype == np.uint8
    with np.errstate(over="ignore"):
        values = np.asarray(array, np.float32) / np.float32(255.0 if encoded else 1.0)
    values = values[..., None] if values.ndim == 2 else values
    if values.shape[2] > 4 or not 1 <= min(values.shape[:2]) <= np.max(values.shape[:2]) <= LARGEST:
        raise SceneError(given, legal=legal)
    _check_range(f"{what}: the array", values, legal)
    made = np.array(values, np.float32, order="C")
    made.setflags(write=False)
    return Stored(made, encoded, f"array of {' x '.join(map(str, array.shape))}")


def _check_range(named: str, values: Array, legal: str) -> None:
    if not np.all(np.abs(values) <= np.finfo(np.float16).max):
        raise SceneError(f"{named} holds numbers beyond 65504, or that are not finite", legal=legal)
