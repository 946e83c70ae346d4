"""Still pictures as files, and all arrays of a frame in one: NumPy's .npz, or the layers of an OpenEXR file.

Each PNG file holds a key of all that it shows, so a rerun draws only what is missing.
"""

from __future__ import annotations

import hashlib
import io
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError

import raymarch
from raymarch.errors import Doubt, RenderError
from raymarch.export import png
from raymarch.export.layers import ARRAYS, layers_of
from raymarch.expr.images import write_channels
from raymarch.files import sources
from raymarch.gpu.driver import Driver
from raymarch.gpu.frame import Frame
from raymarch.gpu.part import PicturePart
from raymarch.gpu.prepare import Prepared, Wanted, frame_uniforms
from raymarch.gpu.renderer import Renderer
from raymarch.gpu.scale import with_bar
from raymarch.gpu.views import light, picture, scale_of
from raymarch.plan import lights
from raymarch.scene.parameter import ParamValue, set_values
from raymarch.scene.scene import Scene
from raymarch.scene.value import Value

ENTRY = "raymarch"
"""The name of the text in a PNG file that holds the key."""

FORMATS = {
    ".png": "PNG",
    ".jpg": "JPEG",
    ".jpeg": "JPEG",
    ".webp": "WEBP",
    ".tif": "TIFF",
    ".tiff": "TIFF",
    ".bmp": "BMP",
}
"""Pillow's name of each suffix of 8-bit pictures."""

NUMBERS = (".exr", ".npz")
"""Suffixes of files with floating-point arrays."""


@dataclass(frozen=True, slots=True)
class Shot:
    """What the pictures of a film have in common: everything but the scene, the time and the part.

    size : (width, height) of the picture in pixels.
    suffix : of the file: one of `FORMATS` or `NUMBERS`.
    params : values of parameters by name.
    view : what is shown, and `outputs`, the arrays that it needs, see `raymarch.gpu.views.VIEWS`, or a `Slice`.
    alpha : make the sky transparent. layers : all layers, in an .exr; mattes : those of names too.
    strict : refuse a picture that has doubts.
    fps : frames per second, for motion vectors. neighbours : parameters of the frames before and after this one;
        None if they do not change.
    level : how much PNG files are compressed; see `raymarch.export.png`.
    """

    size: tuple[int, int]
    suffix: str = ".png"
    params: Mapping[str, ParamValue] = field(default_factory=dict)
    view: str = "final"
    outputs: tuple[Wanted, ...] = ("color",)
    alpha: bool = False
    layers: bool = False
    mattes: bool = False
    strict: bool = False
    fps: float = 30.0
    neighbours: tuple[Mapping[str, ParamValue], Mapping[str, ParamValue]] | None = None
    level: int = png.STILL

    @property
    def label(self) -> str:
        """The part of the key that names the view. A strict run keeps no picture that was drawn without its checks."""
        return f"{self.view} {self.alpha}{' strict' * self.strict}"


@cache
def package() -> str:
    """The version of this package, and a hash of its files."""
    made = hashlib.sha256()
    for name, content in sources(""):
        made.update(name.encode() + b"\0" + content)
    return f"{raymarch.__version__} ({made.hexdigest()[:8]})"


def content_of(
    ready: Prepared,
    scene: Scene,
    size: tuple[int, int],
    time: float,
    params: Mapping[str, ParamValue],
    outputs: Sequence[Wanted],
    label: str,
    part: PicturePart | None = None,
) -> str | None:
    """A hash of all that determines a picture, except the driver: shader, values, size, and this package. None if the
    picture also depends on earlier frames.

    size : (width, height) in pixels, of the part if one is given. label : of the view.
    """
    if scene.quality.temporal != "off":
        return None
    values = set_values(ready.plan.parameters, params, time, scene.where)
    uniforms = frame_uniforms(ready, values, size if part is None else part.whole, None, outputs)
    if ready.plan.lights_as_data:
        uniforms["u_lights"] = lights.rows(ready.plan.scene, values)
    made = hashlib.sha256()
    if scene.motion_blur:
        made.update(f"shutter {scene.camera.open_seconds(values)!r}\0".encode())
    made.update(_stated(scene.quality, scene.tone))
    for fact in (package(), label, size, *([] if part is None else [part])):
        made.update(repr(fact).encode() + b"\0")
    made.update(ready.digest)
    for name, value in sorted(uniforms.items()):
        made.update(name.encode() + b"\0" + np.asarray(getattr(value, "values", value), np.float64).tobytes())
    return made.hexdigest()


@lru_cache(8)
def _stated(*values: Value) -> bytes:
    """Values as text. To make it takes longer than to encode a small picture."""
    return "".join(f"{value!r}\0" for value in values).encode()


def key_of(content: str | None, driver: Driver) -> str | None:
    """The key of a picture: a hash of its content and of the driver that draws it."""
    if content is None:
        return None
    return hashlib.sha256(f"{content}\0{driver.renderer}\0{driver.version}".encode()).hexdigest()


def is_whole(file: Path, keys: Collection[str | None]) -> bool:
    """True if a file holds a picture with one of these keys, and all of it."""
    if not file.is_file():  # to read a pipe would wait
        return False
    try:
        with Image.open(file) as found:
            found.load()
            key = getattr(found, "text", {}).get(ENTRY)
            return key is not None and key in keys
    except (OSError, ValueError, SyntaxError, UnidentifiedImageError):
        return False


def save(image: Image.Image, file: Path, suffix: str, key: str | None) -> None:
    """Write an 8-bit picture in the format of a suffix, whatever the name of the file; a PNG file with its key."""
    file.write_bytes(encoded(image, suffix, key))


def encoded(image: Image.Image, suffix: str, key: str | None, level: int = png.STILL) -> bytes:
    """The bytes of an 8-bit picture; see `save`. level : of a PNG file."""
    if suffix == ".png":
        return png.encode(image, {} if key is None else {ENTRY: key}, level)
    made = io.BytesIO()  # Pillow's encoders in C do not notice a disk that takes a part only
    image.save(made, FORMATS[suffix])
    return made.getvalue()


def draw(
    renderer: Renderer,
    scene: Scene,
    shot: Shot,
    time: float,
    part: PicturePart | None = None,
    progress: Callable[[float], None] | None = None,
) -> tuple[Frame, list[Doubt]]:
    """A frame and the reasons to doubt it. A part is doubted only for values out of their range.

    Raises RenderError for doubts if the shot is strict, and the errors of `Renderer.render`.
    """
    frame = renderer.render(scene, time, shot.params, shot.outputs, progress, part=part)
    doubts = frame.doubts(steps=True) if shot.view == "final" and part is None else list(frame.warnings)
    if shot.strict and doubts:
        raise RenderError(doubts)
    return frame, doubts


def write_npz(file: Path, frame: Frame) -> None:
    """A compressed .npz with all arrays by name, the time, and the pose of the camera."""
    arrays: dict[str, NDArray[np.generic]] = {name: frame.array(name) for name in ARRAYS}
    arrays["time"] = np.float64(frame.time)  # type: ignore[assignment]
    if frame.pose is not None:
        arrays |= {"camera_position": frame.pose.position, "camera_frame": frame.pose.frame}
        half = frame.pose.half_height
        name, size = ("tan_half_fov", frame.pose.tan_half_fov) if half is None else ("half_height", half)
        arrays[f"camera_{name}"] = np.float64(size)  # type: ignore[assignment]
    with file.open("wb") as out:
        np.savez_compressed(out, **arrays)  # type: ignore[arg-type]


@dataclass(frozen=True, slots=True)
class Writer:
    """A function that writes a picture to a file. before : what of it needs no file, for another thread; or None."""

    write: Callable[[Path], object]
    before: Callable[[], object] | None = None

    def __call__(self, file: Path) -> None:
        self.write(file)


@dataclass(frozen=True, slots=True)
class Shown:
    """A view ready to be written: an image, its numbers, and lines to print."""

    image: Callable[[], Image.Image]
    numbers: Callable[[], NDArray[np.float32]]
    lines: Sequence[str] = ()


def view_of(frame: Frame, view: str, scene: Scene) -> Shown:
    """A view of the GPU."""
    return Shown(lambda: drawn(frame, view, scene), lambda: light(frame, view, scene))


def encoder(shot: Shot, renderer: Renderer, scene: Scene, frame: Frame, view: Shown, key: str | None) -> Writer:
    """What writes a frame to a file in the format of the shot's suffix, whatever the name of the file.

    All that it needs of the device is read now, so that it may run in another thread while the next frame is drawn.
    """
    if shot.suffix == ".npz":
        for name in ARRAYS:
            frame.array(name)
        return Writer(lambda file: write_npz(file, frame))
    if shot.suffix == ".exr" and (shot.layers or shot.mattes):
        step, (before, after) = 1.0 / shot.fps, shot.neighbours or (shot.params, shot.params)
        moments = (frame.time, shot.params), (frame.time - step, before), (frame.time + step, after)
        channels, header = layers_of(renderer).of(frame, scene, *moments, shot.alpha, shot.layers, shot.mattes)
        return Writer(lambda file: write_channels(file, channels, header))
    if shot.suffix == ".exr":
        values = {"RGBA": frame.premultiplied()} if shot.alpha else {"RGB": view.numbers()}
        return Writer(lambda file: write_channels(file, values))
    made = frame.image(alpha=True) if shot.alpha else view.image()
    data = cache(lambda: encoded(made, shot.suffix, key, shot.level))
    return Writer(lambda file: file.write_bytes(data()), data)


def drawn(frame: Frame, view: str, scene: Scene) -> Image.Image:
    """A view as an image, with a colour bar below it if the view has a scale."""
    scale = scale_of(frame, view)
    shown = picture(frame, view, scene, scale)
    return shown if scale is None else with_bar(shown, scale)
