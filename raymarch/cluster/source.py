"""A scene as it is sent to workers: the content of its file and of all files that it reads, or a pickle."""

from __future__ import annotations

import hashlib
import io
import os
import pickle
import re
import sys
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import chdir, contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from raymarch.errors import Location, RaymarchError, SceneError
from raymarch.files import may_belong, recorded
from raymarch.scene.file import load, read
from raymarch.scene.scene import Scene, check_scene

PREFIX = "raymarch-scene-"
"""Of the names of the temporary folders in which workers put the files of a scene."""


@dataclass(frozen=True, slots=True)
class Source:
    """A scene that can be pickled.

    name : the path of the scene file as the user gave it; "" for a pickled scene. folder : the working directory.
    files : the content of all files that the scene read, by absolute path without links; None of a folder.
    links : the symbolic links on the way to them, and what each leads to. stdin : what it read of the standard input.
    pickled : the scene, if it was not made from a file.
    """

    name: str = ""
    folder: str = ""
    files: Mapping[str, bytes | None] = field(default_factory=dict, repr=False)
    links: Mapping[str, str] = field(default_factory=dict, repr=False)
    stdin: bytes = field(default=b"", repr=False)
    pickled: bytes = field(default=b"", repr=False)

    @property
    def digest(self) -> str:
        """A hash of the content."""
        made = hashlib.sha256(f"{self.name}\0{self.folder}\0{sorted(self.links.items())}\0".encode() + self.pickled)
        for name, content in [*sorted(self.files.items()), ("", self.stdin)]:
            made.update(f"{name}\0{'' if content is None else len(content)}\0".encode() + (content or b""))
        return made.hexdigest()[:32]

    def scene(self) -> Scene:
        """The scene. Raises SceneError with the lines of the original files."""
        if self.pickled:
            found: Scene = pickle.loads(self.pickled)
            return found
        with tempfile.TemporaryDirectory(prefix=PREFIX) as root:
            for name, content in {**self.files, self.folder: None}.items():
                place = _inside(root, name)
                (place if content is None else place.parent).mkdir(parents=True, exist_ok=True)
                if content is not None:
                    place.write_bytes(content)
            for name, target in self.links.items():
                place = _inside(root, name)
                place.parent.mkdir(parents=True, exist_ok=True)
                place.symlink_to(_inside(root, target))
            path = _inside(root, self.name) if os.path.isabs(self.name) else Path(self.name)
            try:
                with chdir(_inside(root, self.folder)), _standard_input(io.BytesIO(self.stdin)):
                    return load(path)
            except RaymarchError as fault:
                where = fault.where and Location(without_folder(fault.where.file), fault.where.line)
                what, legal = without_folder(fault.what), without_folder(fault.legal)
                raise SceneError(what, legal=legal, where=where) from None


class _Copied(io.RawIOBase):
    """A stream of bytes that keeps what was read of it."""

    def __init__(self, stream: io.BufferedIOBase) -> None:
        self.stream, self.content = stream, b""

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        found = self.stream.read1(len(buffer))
        self.content += found
        buffer[: len(found)] = found
        return len(found)


@contextmanager
def _standard_input(stream: io.BufferedIOBase) -> Iterator[None]:
    """A context in which scene files read a stream as their standard input."""
    before = sys.stdin
    sys.stdin = io.TextIOWrapper(stream, "utf-8", "surrogateescape")
    try:
        yield
    finally:
        sys.stdin = before


def without_folder(text: str) -> str:
    """A text with the paths of the original files, in place of those in the temporary folder of a worker."""
    for folder in {tempfile.gettempdir(), os.path.realpath(tempfile.gettempdir())}:
        text = re.sub(re.escape(os.path.join(folder, PREFIX)) + r"\w+", "", text)
    return text


def of_file(path: str | os.PathLike[str]) -> tuple[Source, Scene]:
    """The scene of a file, and all that workers need to make it again. Raises the errors of `load`."""
    name, folder = os.fspath(path), os.getcwd()
    main = os.path.join(folder, name)
    content = read(path)  # once: it may be a pipe
    stdin = _Copied(getattr(sys.stdin, "buffer", None) or io.BytesIO())
    with recorded() as names, _standard_input(io.BufferedReader(stdin)):
        scene = load(path, content)
    beside = os.path.dirname(os.path.realpath(main)) + os.sep
    modules = [str(getattr(module, "__file__", None) or "") for module in [*sys.modules.values()]]
    names |= dict.fromkeys(file for file in modules if file.startswith(beside))  # imported before, by another program
    files: dict[str, bytes | None] = {}
    links: dict[str, str] = {}
    for found in filter(_is_asset, names):
        with suppress(OSError):
            place = os.path.realpath(found)
            if os.path.isfile(place):
                files[place] = Path(place).read_bytes()
            elif os.path.isdir(place):
                files[place] = None
            links |= _links(found)
    if os.path.isfile(main):
        links |= _links(main)
        main = os.path.realpath(main)
    return Source(name, folder, files | {main: content}, links, stdin.content), scene


def _links(path: str) -> dict[str, str]:
    """The symbolic links on the way to a file, each with the place to which it leads."""
    found = [str(each) for each in (Path(path), *Path(path).parents) if each.is_symlink()]
    return {
        os.path.join(os.path.realpath(os.path.dirname(each)), os.path.basename(each)): os.path.realpath(each)
        for each in found
    }


def of_scene(scene: Scene) -> Source:
    """A scene that was made in Python. SceneError if it uses definitions that workers cannot import."""
    check_scene("render_frames", scene)
    return Source(pickled=pickle.dumps(scene))


def _inside(root: str, path: str) -> Path:
    """An absolute path, moved into a folder."""
    return Path(root).joinpath(*Path(path).parts[1:])


def _is_asset(file: str) -> bool:
    """True if a file belongs to the scene, not to Python, the system or a cache."""
    return may_belong(file) and not file.startswith(sys.prefix + os.sep)
