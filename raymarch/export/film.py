"""Films: MP4 and WebM by PyAV, GIF by Pillow. The same pictures give the same bytes."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from raymarch.errors import SceneError

CODECS: Mapping[str, tuple[str, str, Mapping[str, str]]] = {
    ".mp4": ("mp4", "libx264", {"crf": "16", "preset": "medium", "threads": "1"}),
    ".webm": ("webm", "libvpx-vp9", {"crf": "22", "b:v": "0", "row-mt": "0", "threads": "1"}),
}
"""Container, codec and options of each suffix. One thread, so that the bytes do not depend on the machine's cores."""

OPTIONS = {"fflags": "+bitexact", "movflags": "+faststart"}
"""Options of containers: no random identifiers, and a player may start before it has the whole film."""

FILMS = (*CODECS, ".gif")

FASTEST_GIF = 100.0
"""The most frames per second of a GIF, whose delays are whole hundredths of a second."""


def check_film(file: Path, size: tuple[int, int], fps: float) -> None:
    """SceneError if a film of this size cannot be written: a package or codec is missing, or the format has no such
    size or rate."""
    suffix = file.suffix.lower()
    if suffix == ".gif":
        if fps > FASTEST_GIF:
            raise SceneError(f"fps = {fps:g} for a .gif", legal=f"up to {FASTEST_GIF:g}, or .mp4")
        return
    try:
        import av
    except ImportError:
        raise SceneError(f"'{file}' needs the package av", legal="pip install 'raymarch[video]', or .gif") from None
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
    """Each picture has its own 256 colours. Delays are rounded so that their sum is right."""
    first, *rest = [picture.convert("RGB").quantize(dither=Image.Dither.FLOYDSTEINBERG) for picture in pictures]
    ends = [round(100 * (i + 1) / fps) for i in range(len(rest) + 1)]
    delays = [10 * (end - start) for start, end in zip([0, *ends], ends, strict=False)]
    first.save(file, "GIF", save_all=True, append_images=rest, duration=delays, loop=0, optimize=False)


def _write_video(file: Path, suffix: str, pictures: Iterable[Image.Image], fps: float) -> None:
    """Colours as ITU-R BT.709 in its limited range, with a quarter of the chroma samples, which every player reads."""
    import av
    from av.video.reformatter import Colorspace

    container, codec, options = CODECS[suffix]
    try:
        with av.open(str(file), "w", format=container, options=dict(OPTIONS)) as out:
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
