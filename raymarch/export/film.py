"""Films: MP4 and WebM by PyAV, GIF by Pillow, with one picture in memory. The same pictures give the same bytes."""

from __future__ import annotations

import io
import struct
from collections.abc import Iterable, Iterator, Mapping
from fractions import Fraction
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from raymarch.errors import SceneError
from raymarch.export.palette import Palette, packed
from raymarch.files import install

CODECS: Mapping[str, tuple[str, str, Mapping[str, str]]] = {
    ".mp4": ("mp4", "libx264", {"crf": "16", "preset": "medium", "threads": "1"}),
    ".webm": ("webm", "libvpx-vp9", {"crf": "22", "b:v": "0", "row-mt": "0", "threads": "1"}),
}
"""Container, codec and options of each suffix. One thread, so that the bytes do not depend on the machine's cores."""

OPTIONS = {"mp4": {"fflags": "+bitexact", "movflags": "+faststart"}, "webm": {"fflags": "+bitexact"}}
"""Options of containers: no random identifiers, and a player may start before it has the whole film."""

FILMS = (*CODECS, ".gif")

RATES = {".gif": (0.002, 50.0), ".mp4": (0.001, 1000.0), ".webm": (0.001, 1000.0)}
"""The least and the most frames per second. The delays of a GIF are whole hundredths of a second;
browsers show a frame of one hundredth for ten."""


def check_film(file: Path, size: tuple[int, int], fps: float) -> None:
    """SceneError if a film of this size cannot be written: a package or codec is missing, or the format has no such
    size or rate."""
    suffix = file.suffix.lower()
    least, most = RATES[suffix]
    if not least <= fps <= most:
        cure = f"from {least:g} to {most:g}"
        cure += (
            ": viewers slow shorter frames down; .webm and .mp4 have more" if suffix == ".gif" and fps > most else ""
        )
        raise SceneError(f"fps = {fps:g} for a {suffix}", legal=cure)
    if suffix == ".gif":
        if max(size) > 0xFFFF:
            raise SceneError(f"{size[0]}x{size[1]} for a .gif", legal="edges up to 65535 pixels")
        return
    try:
        import av
    except ImportError:
        raise SceneError(f"'{file}' needs the package av", legal=f"{install('video')}, or .gif") from None
    if size[0] % 2 or size[1] % 2:
        raise SceneError(f"{size[0]}x{size[1]} for a {suffix} film", legal="even width and height, or .gif")
    if CODECS[suffix][1] not in av.codecs_available:
        raise SceneError(f"the package av has no codec {CODECS[suffix][1]}", legal="another build of av, or .gif")


def write_film(file: Path, suffix: str, pictures: Iterable[Image.Image], fps: float) -> None:
    """Write pictures of one size as a film. `suffix` selects the format, whatever the name of the file."""
    if suffix == ".gif":
        _write_gif(file, iter(pictures), fps)
    else:
        _write_video(file, suffix, pictures, fps)


def _write_gif(file: Path, pictures: Iterator[Image.Image], fps: float) -> None:
    """Pictures of 256 colours, not dithered, each as the box of pixels that changed.

    Delays are rounded so that their sum is right. A picture equal to the last one prolongs its delay.
    """
    with file.open("wb") as out:
        palette: Palette | None = None
        shown: NDArray[np.uint8] | None = None
        block, start, number = b"", 0, 0
        for number, picture in enumerate(pictures):
            if palette is None:
                out.write(b"GIF89a" + struct.pack("<2H3x", *picture.size) + b"!\xff\x0bNETSCAPE2.0\x03\x01\0\0\0")
            pixels = packed(picture)
            new = None if palette is None else palette.indices(pixels)
            if palette is None or new is None:
                palette, shown = Palette(picture), None
                new = palette.indices(pixels)
                assert new is not None
            box = (0, 0, *picture.size) if shown is None else _box(new != shown)
            if box is None:
                continue
            start = _show(out, block, start, round(100 * number / fps))
            shown, block = new, _gif_block(palette.image(new).crop(box), box[:2])
        _show(out, block, start, round(100 * (number + 1) / fps))
        out.write(b";")


def _box(changed: NDArray[np.bool_]) -> tuple[int, int, int, int] | None:
    """The box of the pixels that changed: left, top, right and bottom; None if none did."""
    rows, columns = (np.flatnonzero(changed.any(axis=axis)) for axis in (1, 0))
    return (int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1) if len(rows) else None


def _gif_block(picture: Image.Image, corner: tuple[int, int]) -> bytes:
    """A picture as a block of a GIF with colours of its own: Pillow's file of it, without its header."""
    buffer = io.BytesIO()
    picture.save(buffer, "GIF", interlace=False, optimize=False)
    made = buffer.getvalue()
    table = made[10] & 7
    end = at = 13 + 3 * (2 << table)
    while made[at] == ord("!"):  # extensions
        at += 2
        while made[at]:
            at += made[at] + 1
        at += 1
    return struct.pack("<c4HB", b",", *corner, *picture.size, 0x80 | table) + made[13:end] + made[at + 10 : -1]


def _show(out: BinaryIO, block: bytes, start: int, end: int) -> int:
    """Write a block that is shown from `start` to `end`, in hundredths of a second, and return the end."""
    while block and end > start:
        delay = min(end - start, 0xFFFF)
        out.write(b"!\xf9\x04\x04" + struct.pack("<Hxx", delay) + block)
        start += delay
    return end


def _write_video(file: Path, suffix: str, pictures: Iterable[Image.Image], fps: float) -> None:
    """Colours as ITU-R BT.709 in its limited range, with a quarter of the chroma samples, which every player reads."""
    import av
    from av.video.reformatter import Colorspace

    container, codec, options = CODECS[suffix]
    try:
        with av.open(str(file), "w", format=container, options=dict(OPTIONS[container])) as out:
            stream: Any = None
            for picture in pictures:
                if stream is None:
                    stream = out.add_stream(codec, rate=Fraction(fps).limit_denominator(100_000), options=dict(options))
                    stream.width, stream.height = picture.size
                    stream.pix_fmt = "yuv420p"
                    stream.codec_context.color_range = 1  # limited
                    stream.codec_context.colorspace = 1  # BT.709, as the next two
                    stream.codec_context.color_primaries = 1
                    stream.codec_context.color_trc = 1
                frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(picture.convert("RGB")), format="rgb24")
                out.mux(stream.encode(frame.reformat(format="yuv420p", dst_colorspace=Colorspace.ITU709)))
            out.mux(stream.encode())
    except av.FFmpegError as fault:
        raise OSError(fault.errno, fault.strerror) from fault
