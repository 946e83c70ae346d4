"""Picture files, as linear RGB or as stored: Radiance, OpenEXR, and formats that Pillow reads.

OpenEXR files need the package OpenEXR (`pip install OpenEXR`).
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, redirect_stdout
from io import StringIO
from os import PathLike, fspath
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageOps

from raymarch.errors import SceneError
from raymarch.expr.srgb import srgb_to_linear
from raymarch.files import import_optional, reading, reads

Array = NDArray[np.float32]

LARGEST = 2046
"""Maximum number of pixels along an edge. Sampled data may have 2048 texels, two of which close the circle of a sky."""


def read_image(what: str, file: str | PathLike[str]) -> Array:
    """A picture as linear RGB, float32 (H, W, 3), row 0 at the top.

    what : name of the caller, for messages. Raises SceneError for a file that is missing, broken, or larger than
    `LARGEST` pixels along an edge.
    """
    pixels, encoded = read_stored(what, file, LARGEST, np.float64)
    rgb = pixels[..., :3] if pixels.shape[2] >= 3 else np.repeat(pixels[..., :1], 3, axis=2)
    return np.ascontiguousarray(srgb_to_linear(rgb) if encoded else rgb, np.float32)


def read_stored(
    what: str, file: str | PathLike[str], largest: int, dtype: type[np.floating[Any]] = np.float32
) -> tuple[NDArray[Any], bool]:
    """The values of a picture as stored, (H, W, 1 to 4), and whether its colours are sRGB-encoded.

    Integers are divided by the largest integer of their type, to lie in [0, 1]. Raises SceneError as `read_image` does.
    """
    path = Path(fspath(file))
    ending = path.suffix.lower()
    if ending in (".hdr", ".pic", ".rgbe"):
        pixels, encoded = _read_radiance(what, path, largest), False
    elif ending == ".exr":
        pixels, encoded = _read_exr(what, path, largest), False
    else:
        pixels, encoded = _read_other(what, path, largest, dtype)
    if not np.all(np.isfinite(pixels)):
        raise SceneError(f"{what}: '{path}' holds values that are not finite", legal="finite numbers")
    return pixels, encoded


@contextmanager
def opened(what: str, file: str | PathLike[str], largest: int, least: int = 1) -> Iterator[Image.Image]:
    """A picture that Pillow reads, opened. SceneError with its name for any fault, also of the block that decodes it.

    A photo stands upright, as its EXIF orientation says. Only the header is read before the size is checked, so a
    picture whose size is refused takes neither time nor memory.
    """
    with reading(what, file, _legal(largest, least)), warnings.catch_warnings():
        warnings.simplefilter("ignore", Image.DecompressionBombWarning)  # the size is checked here
        with Image.open(file) as picture:
            _check_size(what, file, picture.size, largest, least)
            ImageOps.exif_transpose(picture, in_place=True)
            yield picture


def _legal(largest: int, least: int = 1) -> str:
    return f"a picture of {least} x {least} to {largest} x {largest} pixels: .hdr, .exr, .png, .jpg, ..."


def _check_size(what: str, file: str | PathLike[str], size: tuple[int, int], largest: int, least: int = 1) -> None:
    if not least <= min(size) <= max(size) <= largest:
        raise SceneError(f"{what}: '{file}' has {size[0]} x {size[1]} pixels", legal=_legal(largest, least))


def _read_other(what: str, path: Path, largest: int, dtype: type[np.floating[Any]]) -> tuple[NDArray[Any], bool]:
    with opened(what, path, largest) as image:
        if image.mode == "F":
            return np.asarray(image, dtype)[..., None], False
        if image.mode.startswith("I"):  # 16 bits
            pixels = np.asarray(image, dtype)
            if not 0.0 <= pixels.min() <= pixels.max() <= 65535.0:
                raise ValueError("its values take more than 16 bits")
            return pixels[..., None] / dtype(65535.0), True
        kept = image if image.mode in ("L", "RGB", "RGBA") else image.convert("L" if image.mode == "1" else "RGBA")
        pixels = np.array(kept, dtype)
        pixels /= dtype(255.0)
        return (pixels[..., None] if pixels.ndim == 2 else pixels), True


def _read_exr(what: str, path: Path, largest: int) -> NDArray[Any]:
    reads(path)
    # The library prints the faults that it passes over to Python's output, which may be a table or JSON.
    with reading(what, path, _legal(largest)), redirect_stdout(StringIO()):
        OpenEXR = import_optional(f"{what}: '{path}'", "OpenEXR", "exr")
        with OpenEXR.File(str(path), header_only=True) as opened:
            low, high = opened.header()["dataWindow"]
            _check_size(what, path, (int(high[0]) - int(low[0]) + 1, int(high[1]) - int(low[1]) + 1), largest)
        with OpenEXR.File(str(path)) as opened:
            channels = opened.channels()
            for name in ("RGB", "RGBA"):
                if name in channels:
                    return np.asarray(channels[name].pixels, np.float32)[..., :3]
            one = [np.asarray(channels[c].pixels, np.float32) for c in ("R", "G", "B") if c in channels]
            if not one and "Y" in channels:
                one = [np.asarray(channels["Y"].pixels, np.float32)] * 3
        if len(one) != 3:
            raise ValueError("no channels R, G and B")
        return np.stack(one, axis=-1)


def write_channels(
    file: str | PathLike[str],
    channels: Mapping[str, NDArray[Any]],
    attributes: Mapping[str, Any] = MappingProxyType({}),
) -> None:
    """Write arrays as the channels of a float32 OpenEXR file: (H, W), or (H, W, 3) for "RGB" and (H, W, 4) for "RGBA".

    attributes : of the header, by name: texts, numbers and float32 matrices.

    Raises SceneError without the package OpenEXR, and OSError if the file cannot be written.
    """
    OpenEXR = import_optional(f"'{file}'", "OpenEXR", "exr")
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, **attributes}
    try:
        with OpenEXR.File(header, {n: np.ascontiguousarray(a, np.float32) for n, a in channels.items()}) as made:
            made.write(fspath(file))
    except RuntimeError as fault:  # the library raises it for every fault of a file
        raise OSError(" ".join(str(fault).split())) from fault


def _read_radiance(what: str, path: Path, largest: int) -> Array:
    """Decode a Radiance picture (Ward 1991), flat or run-length encoded, top row first."""
    with reading(what, path, _legal(largest)), path.open("rb") as stream:
        head, _, rest = stream.read(1 << 16).partition(b"\n\n")
        if not head.startswith(b"#?") or b"FORMAT=32-bit_rle_rgbe" not in head:
            raise ValueError("no header of a Radiance picture in RGBE")
        size, _, body = rest.partition(b"\n")
        words = size.split()
        if len(words) != 4 or words[0] not in (b"-Y", b"+Y") or words[2] != b"+X":
            raise ValueError(f"resolution {size[:40]!r}")
        height, width = int(words[1]), int(words[3])
        _check_size(what, path, (width, height), largest)
        raw = np.frombuffer(body + stream.read((8 * width + 4) * height), np.uint8)
        rgbe = np.empty((height, width, 4), np.uint8)
        at = 0
        for row in rgbe:
            at = _scanline(raw, at, row)
        exponents = rgbe[..., 3].astype(np.int32)
        scale = np.where(exponents > 0, np.ldexp(np.float32(1.0), exponents - 136), np.float32(0.0))
        pixels = (rgbe[..., :3] + np.float32(0.5)) * scale[..., None]
        return np.asarray(pixels if words[0] == b"-Y" else pixels[::-1], np.float32)


def _scanline(raw: NDArray[np.uint8], at: int, row: NDArray[np.uint8]) -> int:
    """Decode one row; return the offset of the next one."""
    width = len(row)
    if not (8 <= width < 1 << 15 and at + 4 <= len(raw) and raw[at] == 2 and raw[at + 1] == 2 and raw[at + 2] < 128):
        flat = raw[at : at + 4 * width]
        if len(flat) < 4 * width:
            raise ValueError("it ends too early")
        row[:] = flat.reshape(width, 4)
        return at + 4 * width
    at += 4
    for channel in range(4):
        x = 0
        while x < width:
            if at >= len(raw):
                raise ValueError("it ends too early")
            count = int(raw[at])
            if count > 128:
                count -= 128
                values: Any = raw[at + 1]
                at += 2
            else:
                values = raw[at + 1 : at + 1 + count]
                at += 1 + count
            if count == 0 or x + count > width or np.size(values) not in (1, count):
                raise ValueError("a run of pixels does not fit its row")
            row[x : x + count, channel] = values
            x += count
    return at
