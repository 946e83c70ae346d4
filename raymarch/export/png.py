"""PNG files in less time than Pillow takes: two of the five filters, of which each row has the better one.

Over the pictures of this documentation, files have .996 of the bytes of Pillow's on average and 1.07 at most, in three
quarters of the time. Frames of a sequence have 1.05 to 1.2 times the bytes of a still picture, in half its time.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from PIL import Image

COLORS = {"L": 0, "RGB": 2, "RGBA": 6}
"""The PNG colour type of each mode of Pillow that is written here."""

SUB, UP = 1, 2
"""The filters: the difference from the pixel on the left, and from that above."""

STILL, FRAME, DRAFT = 6, 4, 1
"""How much files are compressed: a picture, the frames of a sequence, and files that are removed soon."""

EVERY = 5
"""Of so many bytes one decides between the filters. It divides no number of channels, so all channels count."""


def encode(image: Image.Image, texts: Mapping[str, str], level: int = STILL) -> bytes:
    """A picture as a PNG file with 8 bits a channel.

    texts : Latin-1 texts by name. level : one of the above. The least has one filter, and a third of the time.
    """
    pixels = np.asarray(image)
    packed = zlib.compressobj(level, zlib.DEFLATED, zlib.MAX_WBITS, zlib.DEF_MEM_LEVEL + 1)
    data = packed.compress(_filtered(pixels.reshape(*pixels.shape[:2], -1), level)) + packed.flush()
    head = struct.pack(">2I5B", *image.size, 8, COLORS[image.mode], 0, 0, 0)
    named = (_chunk(b"tEXt", f"{name}\0{text}".encode("latin-1")) for name, text in texts.items())
    return b"".join((b"\x89PNG\r\n\x1a\n", _chunk(b"IHDR", head), *named, _chunk(b"IDAT", data), _chunk(b"IEND", b"")))


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(data, zlib.crc32(kind)))


def _filtered(pixels: NDArray[np.uint8], level: int) -> bytes:
    """The rows of a picture (H, W, channels), each after the number of its filter."""
    height, _, channels = pixels.shape
    rows = pixels.reshape(height, -1)
    made = np.empty((2, height, 1 + rows.shape[1]), np.uint8)
    made[:, :, 0] = [[SUB], [UP]]
    sub, up = made[:, :, 1:]
    sub[:, :channels], up[0] = rows[:, :channels], rows[0]
    np.subtract(rows[1:], rows[:-1], out=up[1:])
    if level == DRAFT:
        return made[1].tobytes()
    np.subtract(rows[:, channels:], rows[:, :-channels], out=sub[:, channels:])
    away = np.abs(made[:, :, 1::EVERY].view(np.int8)).view(np.uint8).sum(axis=2, dtype=np.int64)
    return np.where((away[1] < away[0])[:, None], made[1], made[0]).tobytes()
