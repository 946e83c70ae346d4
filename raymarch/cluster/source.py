"""A scene as it is sent to workers: the content of its file and of all files that it reads, or a pickle."""

from __future__ import annotations

import hashlib
import os
import pickle
import sys
import tempfile
from collections.abc import Mapping
from contextlib import chdir, suppress
from dataclasses import dataclass, field
from pathlib import Path

from raymarch.errors import Location, RaymarchError, SceneError
from raymarch.files import may_belong, recorded
from raymarch.scene.file import load
from raymarch.scene.scene import Scene, check_scene


@dataclass(frozen=True, slots=True)
class Source:
    """A scene that can be pickled.

    name : the path of the scene file as the user gave it; "" for a pickled scene. folder : the working directory.
    files : the content of all files that the scene read, by absolute path.
    pickled : the scene, if it was not made from a file.
    """

    name: str = ""
    folder: str = ""
    files: Mapping[str, bytes] = field(default_factory=dict, repr=False)
    pickled: bytes = field(default=b"", repr=False)

    @property
    def digest(self) -> str:
        """A hash of the content."""
        made = hashlib.sha256(f"{self.name}\0{self.folder}\0".encode() + self.pickled)
        for name, content in sorted(self.files.items()):
            made.update(f"{name}\0{len(content)}\0".encode() + content)
        return made.hexdigest()[:32]

    def scene(self) -> Scene:
        """The scene. Raises SceneError with the lines of the original files."""
        if self.pickled:
            found: Scene = pickle.loads(self.pickled)
            return found
        with tempfile.TemporaryDirectory(prefix="raymarch-") as root:
            for name, content in self.files.items():
                file = _inside(root, name)
                file.parent.mkdir(parents=True, exist_ok=True)
                file.write_bytes(content)
            folder = _inside(root, self.folder)
            folder.mkdir(parents=True, exist_ok=True)
            path = _inside(root, self.name) if os.path.isabs(self.name) else Path(self.name)
            try:
                with chdir(folder):
                    return load(path)
            except RaymarchError as fault:
                where = fault.where
                if where is not None:
                    where = Location(where.file.replace(root, ""), where.line)
                raise SceneError(fault.what.replace(root, ""), legal=fault.legal, where=where) from None


def of_file(path: str | os.PathLike[str]) -> tuple[Source, Scene]:
    """The scene of a file, and all that workers need to make it again. Raises the errors of `load`."""
    with recorded() as names:
        scene = load(path)
    name = os.fspath(path)
    files = {}
    for found in {os.path.abspath(name): None, **names}:
        with suppress(OSError):
            if _is_asset(found) and os.path.isfile(found):
                files[found] = Path(found).read_bytes()
    return Source(name, os.getcwd(), files), scene


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
