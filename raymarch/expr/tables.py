"""Tables: numbers in rows of texels, fetched by index."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from raymarch.errors import SceneError
from raymarch.expr.data import Data, digest
from raymarch.expr.node import Expr, Operand, expr, make
from raymarch.expr.types import FLOAT, vector

Array = NDArray[Any]

WIDTH = 4096
"""Texels in a line of a table's texture; a power of two."""

MOST = 1 << 24
"""Maximum number of texels: float32 holds every index up to here."""


class Table(Data):
    """Texels of 1, 2 or 4 float32 numbers, addressed by one index.

    values : shape (texels, channels).
    label : name in messages; it is ignored in comparisons.
    """

    __slots__ = ("values",)

    kind = "table"

    def __init__(self, values: ArrayLike, label: str) -> None:
        array = np.ascontiguousarray(values, np.float32)
        if array.ndim != 2 or array.shape[1] not in (1, 2, 4) or not 1 <= len(array) <= MOST:
            raise SceneError(f"a table of shape {array.shape}", legal=f"(1 to {MOST:,}, 1, 2 or 4)")
        array.setflags(write=False)
        self.values = array
        self.label = label
        self.key = digest(f"{array.shape}".encode(), array.tobytes())

    @property
    def channels(self) -> int:  # type: ignore[override]
        """1, 2 or 4."""
        return int(self.values.shape[1])

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the texture in texels; the last line may be filled up."""
        return min(WIDTH, len(self.values)), -(-len(self.values) // WIDTH)

    @property
    def nbytes(self) -> int:
        """Size of the texture in bytes."""
        width, height = self.size
        return 4 * self.channels * width * height

    def texture(self) -> tuple[tuple[int, ...], int, bytes]:
        """Size, channels and content of the texture, line by line."""
        return self.size, self.channels, self.values.tobytes() + bytes(self.nbytes - self.values.nbytes)


class LiveTable(Data):
    """A table that depends on parameters and time.

    make : a function that returns the table for the bound parameters and time. All have as many channels.
    label : name in messages.
    key : names the function: live tables with equal keys are equal.
    """

    __slots__ = ("channels", "make")

    kind = "table"

    def __init__(self, make: Callable[[], Table], label: str, key: str) -> None:
        self.make, self.label, self.key = make, label, key
        self.channels = make().channels

    @property
    def values(self) -> Array:
        """The numbers for the bound parameters and time."""
        return self.make().values

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the texture, for the bound parameters and time."""
        return self.make().size

    @property
    def nbytes(self) -> int:
        """Size of the texture in bytes, for the bound parameters and time."""
        return self.make().nbytes


def fetch(data: Table | LiveTable, index: Operand) -> Expr:
    """The texel of an index, a number that is rounded down; an index outside reads any texel."""
    given = expr(index)
    if given.type is not FLOAT:
        raise SceneError(f"fetch at a {given.type}", legal="one number")
    return make("fetch", data.type, (given,), data)


def evaluate(node: Expr, index: Array) -> Array:
    """NumPy row of "fetch"."""
    values = node.data.values
    found = values[np.clip(np.nan_to_num(index), 0, len(values) - 1).astype(np.int64)].astype(index.dtype)
    return found[..., 0] if node.type is FLOAT else found


def interval(node: Expr, index: tuple[Array, Array]) -> tuple[Array, Array]:
    """Interval row of "fetch": the smallest and the largest number of each channel, among the rows in the range."""
    if isinstance(node.data, LiveTable):
        return np.full(node.type.shape, -np.inf), np.full(node.type.shape, np.inf)
    values = np.asarray(node.data.values, np.float64)
    last = len(values) - 1
    inside = (index[0] >= 0) & (index[1] <= last)
    first, end = np.where(inside, index[0], 0).astype(np.int64), np.where(inside, index[1], last).astype(np.int64)
    pairs = np.stack([first, end + 1], axis=-1).reshape(-1)
    rows = np.concatenate([values, values[-1:]])
    low, high = (fold.reduceat(rows, pairs, axis=0)[::2].reshape(*first.shape, -1) for fold in (np.minimum, np.maximum))
    return (low[..., 0], high[..., 0]) if node.type is FLOAT else (low, high)


def glsl_helper(channels: int, constant: bool = False) -> tuple[str, str]:
    """Name and text of the GLSL function that fetches a texel.

    constant : `constant_number(i)` gives the numbers, and the table is an int, where they start.
    """
    type, picked = vector(channels), "xyzw"[:channels]
    name = f"texel{channels}"
    if constant:
        parts = ", ".join(f"constant_number(i{f' + {k}' if k else ''})" for k in range(channels))
        return name, (
            f"{type} {name}(int data, float index) {{\n"
            f"    int i = data + {channels} * int(index);\n"
            f"    return {parts if channels == 1 else f'{type}({parts})'};\n}}"
        )
    suffix = "" if channels == 4 else f".{picked}"
    return name, (
        f"{type} {name}(sampler2D data, float index) {{\n"
        f"    int i = int(index);\n"
        f"    return texelFetch(data, ivec2(i & {WIDTH - 1}, i >> {WIDTH.bit_length() - 1}), 0){suffix};\n}}"
    )
