"""The pictures of a film or of a large picture: their files, times and parts, and how they are joined."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any, Self, TypeAlias

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from raymarch.errors import Doubt, RaymarchError, SceneError
from raymarch.export.film import FILMS, check_film, write_film
from raymarch.export.stills import (
    FORMATS,
    NUMBERS,
    Shot,
    Shown,
    Writer,
    content_of,
    draw,
    encoder,
    is_whole,
    key_of,
    save,
    view_of,
)
from raymarch.files import UNFINISHED, import_optional, written
from raymarch.gpu.driver import Driver
from raymarch.gpu.frame import Frame
from raymarch.gpu.part import PicturePart, prepared_part
from raymarch.gpu.prepare import Prepared, assembled, drawn_for, passes_for
from raymarch.gpu.renderer import Renderer
from raymarch.gpu.tiles import split
from raymarch.plan import plan
from raymarch.plan.device import device_class
from raymarch.scene.parameter import ParamValue
from raymarch.scene.scene import Scene

if sys.platform != "win32":
    import fcntl

LARGE, LONG = 1 << 24, 1 << 14
"""Pictures with more pixels or a longer edge are drawn in tiles, each of which is a file until all are drawn."""

MOST_FRAMES = 200_000
"""Most frames of a film or of a sequence: two hours of 24 each second."""

EDGE = 1024
"""Largest edge of a tile in pixels."""

WIDEST = 1 << 16
"""Largest edge of a picture that is drawn in tiles, in pixels."""

IN_MEMORY = 1 << 28
"""Most pixels of a file that is put together in memory."""


@dataclass(frozen=True, slots=True)
class Item:
    """A picture of a sequence, or a tile of a picture.

    name : for messages, such as "frame 12". time : value of `raymarch.time`. file : where it is written.
    size : (width, height) in pixels. part : where a tile lies in its picture; None for a whole picture.
    """

    name: str
    time: float
    file: Path
    size: tuple[int, int]
    part: PicturePart | None = None


def frames_of(
    target: Path,
    numbers: Sequence[int],
    fps: float,
    size: tuple[int, int],
    option: str = "frames",
    error: type[RaymarchError] = SceneError,
) -> list[Item]:
    """The frames of a film or of a sequence. The pictures of a film are in a folder beside it until it is complete.

    option : the user's name of the frames, for messages. Raises `error` for a name or a format that cannot hold them.
    """
    suffix = target.suffix.lower()
    check_suffix(target, error)
    if len(numbers) > MOST_FRAMES:
        raise error(f"{option}: {len(numbers)} frames", legal=f"up to {MOST_FRAMES}; more in several files")
    if suffix in FILMS:
        check_film(target, size, fps)
        folder = _parts_folder(target, "frames")
        return [Item(f"frame {i}", i / fps, folder / f"frame_{i:06d}.png", size) for i in numbers]
    if suffix == ".exr":
        import_optional(f"'{target}'", "OpenEXR", "exr")
    files = [_numbered(target, i, option, error) for i in numbers]
    if len(set(files)) < len(set(numbers)):
        raise error(f"{option}: '{target}' gives several frames one name", legal="a field for the frame number: {:04d}")
    return [Item(f"frame {i}", i / fps, file, size) for i, file in zip(numbers, files, strict=True)]


def check_suffix(target: Path, error: type[RaymarchError] = SceneError) -> None:
    """Raise `error` for a file of a format that is not known."""
    known = (*FORMATS, *NUMBERS, *FILMS)
    if target.suffix.lower() not in known:
        from raymarch.export.forms import SUFFIXES  # for the message only

        other = "`raymarch export` writes it; " if target.suffix.lower() in SUFFIXES else ""
        raise error(f"cannot write '{target}'", legal=f"{other}a file ending in {', '.join(known)}")


def tiles_of(
    target: Path, time: float, size: tuple[int, int], edge: int, error: type[RaymarchError] = SceneError
) -> list[Item]:
    """The tiles of a picture, each a PNG file in a folder beside it until the picture is complete.

    Raises `error` for a picture that is too large for its file.
    """
    for name, pixels in zip(("width", "height"), size, strict=True):
        if not 1 <= pixels <= WIDEST:
            raise error(f"{name} = {pixels}", legal=f"an integer from 1 to {WIDEST}")
    if size[0] * size[1] > IN_MEMORY and target.suffix.lower() not in (".tif", ".tiff"):
        raise error(f"'{target}' of {size[0]}x{size[1]} pixels", legal=f"a .tif, or up to {IN_MEMORY} pixels")
    folder = _parts_folder(target, "tiles")
    return [
        Item(f"tile {x},{y}", time, folder / f"tile_{y:06d}_{x:06d}.png", own, PicturePart(size, (x, y)))
        for (x, y), own in split(size, edge)
    ]


def edge_of(size: tuple[int, int]) -> int:
    """The edge of the tiles for a cluster: an eighth of the picture, in steps of 16 from 64 to `EDGE`. It depends on
    the size only, so a rerun continues."""
    return min(EDGE, max(64, 16 * -(-max(size) // 128)))


def is_large(size: tuple[int, int]) -> bool:
    """True for a picture that is drawn in tiles."""
    return size[0] * size[1] > LARGE or max(size) > LONG


def _parts_folder(target: Path, what: str) -> Path:
    return target.with_name(f"{target.name}.{what}")


class Parts:
    """The folder of the frames of a film, or of the tiles of a picture, until it is complete.

    The name of a file has the hash of its content, so no file of another run or of the user is replaced or removed. In
    its context no other command uses the folder. At the end the folder is removed if it is empty.

    items : of which the first tells the folder. target : the film or the picture. Raises `error` without the folder.
    """

    def __init__(self, items: Sequence[Item], target: Path, error: type[RaymarchError] = SceneError) -> None:
        self.folder, self._target, self._error = items[0].file.parent, target, error
        self._placed: dict[str, Item] = {}
        self._passing: list[Path] = []
        self._handle = -1

    def __enter__(self) -> Self:
        try:
            self.folder.mkdir(exist_ok=True)
            if sys.platform != "win32":  # which cannot open a folder
                self._handle = os.open(self.folder, os.O_RDONLY)
                _lock(self._handle)
            for left in self.folder.glob(f"{UNFINISHED}*"):  # of a command that was killed
                left.unlink()
        except OSError as fault:
            if self._handle >= 0:
                os.close(self._handle)
            if isinstance(fault, BlockingIOError):
                raise self._error(f"another command is writing '{self._target}'", legal="another name") from None
            what = f"cannot write the parts of '{self._target}' in '{self.folder}': {fault.strerror}"
            raise self._error(what, legal="a writable folder, or another name") from None
        return self

    def __exit__(self, *_: object) -> None:
        _remove(self._passing)
        with suppress(OSError):
            self.folder.rmdir()
        if self._handle >= 0:
            os.close(self._handle)

    def placed(self, item: Item, content: str | None) -> Item:
        """An item with the file of its content; without a content hash, a file that does not outlive the context."""
        name = f"{item.file.stem}-{(content or os.urandom(8).hex())[:16]}{item.file.suffix}"
        found = self._placed[item.name] = replace(item, file=self.folder / name)
        if content is None:
            self._passing.append(found.file)
        return found

    def all(self, items: Sequence[Item]) -> list[Item]:
        """Items as they were placed."""
        return [self._placed[item.name] for item in items]

    def finish(self) -> str:
        """Remove the files of the items. Returns a sentence about other files that stay in the folder, or ""."""
        _remove(item.file for item in self._placed.values())
        others: list[str] = []
        with suppress(OSError):
            others = sorted(os.listdir(self.folder))
        if not others:
            return ""
        shown = ", ".join(f"'{name}'" for name in others[:3])
        return (
            f"'{self.folder}' keeps {len(others)} files of other runs or of yours: {shown}{' ...' * (len(others) > 3)}"
        )


def _lock(handle: int) -> None:
    """Lock a file until its handle is closed. BlockingIOError if another handle has locked it."""
    if sys.platform != "win32":
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise
        except OSError:
            pass  # a file system without locks


def _remove(files: Iterable[Path]) -> None:
    for file in files:
        with suppress(OSError):
            file.unlink()


class Contents:
    """The content hashes of the pictures of one scene; see `content_of`.

    renderer : whose plans of the scene are used, if its device is of the class for which the scene is planned without
        a device: a hash says nothing of the device. None plans it, which needs no OpenGL.
    """

    def __init__(self, scene: Scene, shot: Shot, renderer: Renderer | None = None) -> None:
        self.scene, self.shot = drawn_for(scene, shot.outputs), shot
        given = None if renderer is None else renderer.resources.device
        self.renderer = renderer if given == device_class() else None
        self.measured = "" if given is None else given.measured
        self._ready: dict[Any, Prepared] = {}

    def of(self, item: Item, params: Mapping[str, ParamValue] | None = None) -> str | None:
        """The content hash of a picture; None if it depends on earlier frames. The renderer must have its size.

        params : values of parameters in place of those of the shot.
        """
        shot = self.shot
        if self.renderer is not None:
            ready = self.renderer.prepared(self.scene, shot.outputs, item.part)
        else:
            size = item.size if item.part is None else item.part.whole
            key = size, item.part is None
            if key not in self._ready:
                make = assembled if item.part is None else prepared_part
                self._ready[key] = make(plan(self.scene, passes_for(shot.outputs), size))
            ready = self._ready[key]
        found = content_of(
            ready, self.scene, item.size, item.time, params or shot.params, shot.outputs, shot.label, item.part
        )
        return f"{found} {self.measured}" if found and self.measured else found

    def place(
        self,
        item: Item,
        drivers: Sequence[Driver],
        parts: Parts | None = None,
        params: Mapping[str, ParamValue] | None = None,
        shares: int = 1,
    ) -> Placed:
        """Where a picture is written, with its keys for some drivers. parts : name the file."""
        content = self.of(item, params)
        if content is not None and shares > 1:  # sums in another order may differ in the last bit
            content = f"{content} in {shares} shares"
        if parts is not None:
            item = parts.placed(item, content)
        return Placed(item, content, [key_of(content, driver) for driver in drivers])


@dataclass(frozen=True, slots=True)
class Placed:
    """A picture with its file, the hash of its content, and its key for each driver."""

    item: Item
    content: str | None
    keys: Sequence[str | None]

    @property
    def whole(self) -> bool:
        """True if the file holds the picture, drawn by one of the drivers."""
        return self.item.file.suffix == ".png" and is_whole(self.item.file, self.keys)


@dataclass(frozen=True, slots=True)
class Picture:
    """A picture that was drawn, ready to be written.

    doubts : reasons to doubt it. view : its image, which is made once, and lines to print.
    evaluations : (H, W), of the primary rays, if they were asked for.
    """

    milliseconds: float
    doubts: Sequence[Doubt]
    view: Shown
    writer: Writer
    evaluations: NDArray[np.float32] | None = None


Show: TypeAlias = Callable[[Renderer, Frame, str, Scene, Mapping[str, Any], Callable[[float], None] | None], Shown]
"""A function that makes a view of a frame that a renderer has just drawn."""


class Runner:
    """Draws the pictures of a shot, one after another, by a renderer of this process.

    parts : name the files, if the pictures are parts of a film or of a picture. show : makes the view. reuse : whether
    a file that holds a picture is kept. counts : whether evaluations are asked for.
    """

    def __init__(
        self,
        renderer: Renderer,
        scene: Scene,
        shot: Shot,
        parts: Parts | None = None,
        show: Show = lambda renderer, frame, view, scene, *_: view_of(frame, view, scene),
        reuse: bool = True,
        counts: bool = False,
    ) -> None:
        self._counts = counts
        self.renderer, self.scene, self.shot = renderer, scene, shot
        self._parts, self._show, self._reuse = parts, show, reuse
        self._contents = Contents(scene, shot, renderer)

    def picture(
        self,
        item: Item,
        shot: Shot | None = None,
        progress: Callable[[float], None] | None = None,
    ) -> tuple[Item, Picture | None]:
        """An item with its file, and its picture; None if the file holds it.

        shot : with the parameters of this picture, if they change. Raises the errors of `draw`.
        """
        with self.renderer.context.bound():  # once, for all that asks for it
            return self._picture(item, shot or self.shot, progress)

    def _picture(self, item: Item, shot: Shot, progress: Callable[[float], None] | None) -> tuple[Item, Picture | None]:
        if self.renderer.size != item.size:
            self.renderer.resize(item.size)
        key = None
        if shot.suffix == ".png":
            placed = self._contents.place(item, [self.renderer.context.driver], self._parts, shot.params)
            item, (key,) = placed.item, placed.keys
            if self._reuse and placed.whole:
                return item, None
        frame, doubts = draw(self.renderer, self.scene, shot, item.time, item.part, progress)
        view = self._show(self.renderer, frame, shot.view, self.scene, shot.params, progress)
        view = replace(view, image=cache(view.image))
        writer = encoder(shot, self.renderer, self.scene, frame, view, key)
        counts = frame.evaluations if self._counts else None
        return item, Picture(frame.milliseconds, doubts, view, writer, counts)


def join_film(target: Path, items: Sequence[Item], fps: float, error: type[RaymarchError] = SceneError) -> None:
    """Write a film of pictures."""
    with written(target, error) as unfinished:
        write_film(unfinished, target.suffix.lower(), (Image.open(item.file) for item in items), fps)


def join_tiles(target: Path, items: Sequence[Item], key: str | None, error: type[RaymarchError] = SceneError) -> None:
    """Write a picture of its tiles. One tile at a time is in memory.

    A large .tif is tiled (deflate); for other formats the picture is in memory, with 3 or 4 bytes a pixel.
    """
    part = items[0].part
    assert part is not None
    with written(target, error) as unfinished:
        if target.suffix.lower() in (".tif", ".tiff") and is_large(part.whole):
            write_tiled(unfinished, part.whole, items)
        else:
            canvas: Image.Image | None = None
            for item in items:
                assert item.part is not None
                with Image.open(item.file) as tile:
                    if canvas is None:
                        canvas = Image.new(tile.mode, part.whole)
                    canvas.paste(tile, item.part.corner)
            assert canvas is not None
            save(canvas, unfinished, target.suffix.lower(), key)


def write_tiled(file: Path, size: tuple[int, int], items: Sequence[Item]) -> None:
    """A tiled TIFF file with deflate compression, from tiles in the order of their rows."""
    tifffile = import_optional(f"a large '{file}'", "tifffile", "tiff")
    edge = items[0].size
    with Image.open(items[0].file) as first:
        channels = len(first.getbands())

    def tiles() -> Iterator[NDArray[np.uint8]]:
        for item in items:
            with Image.open(item.file) as opened:
                yield np.asarray(opened)

    step = 16  # edges of tiles are multiples of 16
    across, down = (-(-length // step) * step for length in edge)
    with tifffile.TiffWriter(file, bigtiff=size[0] * size[1] * channels > 2**31) as out:
        out.write(
            tiles(),
            shape=(size[1], size[0], channels),
            dtype=np.uint8,
            tile=(down, across),
            photometric="rgb",
            extrasamples=("unassalpha",) if channels == 4 else None,
            compression="zlib",
            metadata=None,
            software="raymarch",
        )


def _numbered(target: Path, number: int, option: str, error: type[RaymarchError]) -> Path:
    """The file of a frame: its name has a field of `str.format` or of `%`."""
    for form in (target.name.format, target.name.__mod__):
        with suppress(LookupError, ValueError, TypeError, AttributeError, OverflowError):
            name = form(number)
            if name != form(number + 1):  # as for {{}}, which is no field
                return target.with_name(name)
    what = f"{option} with the output '{target}'"
    raise error(what, legal="a film (.mp4, .webm, .gif), or a field for the frame number: frame-{:04d}.png")
