"""What threads report to the window: trials of scene files, and errors with their location."""

from __future__ import annotations

import linecache
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeAlias

from raymarch.errors import RaymarchError
from raymarch.gpu.prepare import Prepared
from raymarch.scene.scene import Scene


@dataclass(frozen=True, slots=True)
class Fault:
    """An error of a scene file, with its location."""

    what: str
    legal: str = ""
    file: str | None = None
    line: int | None = None

    @classmethod
    def of(cls, error: RaymarchError) -> Fault:
        """The fault that an error tells."""
        where = error.where
        return cls(error.what, error.legal, *((where.file, where.line) if where else (None, None)))

    def text(self) -> str:
        """The text for the overlay: location, source line, message."""
        place = f"{near(self.file)}:{self.line}\n" if self.file else ""
        linecache.checkcache(self.file)
        line = linecache.getline(self.file or "", self.line or 0).strip()
        source = f"{self.line} | {line}\n" if line else ""
        cure = f"\n({self.legal})" if self.legal else ""
        return f"{place}{source}{self.what}{cure}"


@dataclass(frozen=True, slots=True)
class Started:
    """A file changed; the trial of the scene file runs."""

    file: Path


@dataclass(frozen=True, slots=True)
class Watching:
    """The trial of the visible scene ended: the files that it reads are known and watched."""

    files: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Loaded:
    """A scene that passed its trial and is ready to be drawn. `ms` has the time of each stage."""

    scene: Scene
    prepared: Prepared
    file: Path
    ms: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Failed:
    """A scene that failed its trial."""

    fault: Fault


News: TypeAlias = Started | Watching | Loaded | Failed


def near(file: str) -> str:
    """The path of a file, relative to the current folder if it is inside it."""
    path = Path(file)
    return str(path.relative_to(Path.cwd())) if path.is_relative_to(Path.cwd()) else file
