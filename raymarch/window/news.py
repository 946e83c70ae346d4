"""What threads report to the window: trials of scene files, and errors with their location."""

from __future__ import annotations

import linecache
import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias

from raymarch.errors import RaymarchError, SceneWarning
from raymarch.gpu.prepare import Prepared
from raymarch.scene.scene import Scene


@dataclass(frozen=True, slots=True)
class Excerpt:
    """A line of source, and the part of it that is at fault, in characters; `start == end` if that is not known."""

    number: int
    source: str
    start: int = 0
    end: int = 0

    def lines(self, columns: int) -> list[str]:
        """The line in at most so many columns, cut around its part, and below it a caret under each character of it."""
        head = f"{self.number} | "
        free = max(columns - len(head), 16)
        first = 0
        if len(self.source) > free:
            middle = (self.start + min(self.end, self.start + free)) // 2
            first = min(max(middle - free // 2, 0), len(self.source) - free)
        shown = list(self.source[first : first + free])
        if first > 0:
            shown[0] = ELLIPSIS
        if first + free < len(self.source):
            shown[-1] = ELLIPSIS
        found = [head + "".join(shown)]
        low, high = max(self.start - first, 0), min(self.end - first, len(shown))
        return found if high <= low else [*found, " " * (len(head) + low) + "^" * (high - low)]


ELLIPSIS = "\u2026"
"""What stands for the parts of a line that are cut off."""

COLUMNS = 100
"""Columns of an excerpt on a terminal."""


@dataclass(frozen=True, slots=True)
class Fault:
    """An error of a scene file, with its location; `columns` as of `raymarch.errors.Location`."""

    what: str
    legal: str = ""
    file: str | None = None
    line: int | None = None
    columns: tuple[int, int] | None = None

    @classmethod
    def of(cls, error: RaymarchError) -> Fault:
        """The fault that an error tells."""
        where = error.where
        return cls(error.what, error.legal, *((where.file, where.line, where.columns) if where else ()))

    @classmethod
    def read(cls, given: dict[str, Any]) -> Fault:
        """The fault that its fields tell, as JSON types."""
        columns = given.get("columns")
        return cls(**{**given, "columns": None if columns is None else tuple(columns)})

    @property
    def words(self) -> str:
        """Location, what is wrong, and the cure."""
        place = f"{near(self.file)}:{self.line}\n" if self.file else ""
        cure = f"\n({self.legal})" if self.legal else ""
        return f"{place}{self.what}{cure}"

    @property
    def excerpt(self) -> Excerpt | None:
        """The line of the file; None if there is none."""
        linecache.checkcache(self.file)
        full = linecache.getline(self.file or "", self.line or 0).rstrip()
        source = full.lstrip()
        if not source:
            return None
        if self.columns is not None:
            coded, indent = full.encode(), len(full) - len(source)
            start, end = (len(coded[:at].decode(errors="ignore")) - indent for at in self.columns)
        else:  # the name that the message begins with
            name = re.match(r"[A-Za-z_]\w*", self.what)
            called = re.search(rf"\b{name[0]}\b(?=\s*\()", source) if name else None
            start, end = called.span() if called else (0, 0)
        return Excerpt(self.line or 1, source, max(start, 0), min(end, len(source)))

    def text(self) -> str:
        """The text for a terminal: location, source line with carets, message."""
        place, _, words = self.words.partition("\n") if self.file else ("", "", self.words)
        lines = self.excerpt.lines(COLUMNS) if self.excerpt else []
        return "\n".join([*([place] if place else []), *lines, words])


@contextmanager
def noted() -> Iterator[list[str]]:
    """The warnings about lines of the user within a block, which are printed as well."""
    found, show = list[str](), warnings.showwarning

    def note(message: Any, category: Any, filename: str, lineno: int, file: Any = None, line: Any = None) -> None:
        if issubclass(category, SceneWarning):
            found.append(f"{near(filename)}:{lineno}: {message}")
        show(message, category, filename, lineno, file, line)

    warnings.showwarning = note
    try:
        yield found
    finally:
        warnings.showwarning = show


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
    """A scene that passed its trial and is ready to be drawn. `ms` has the time of each stage, `words` the warnings
    about lines of the user."""

    scene: Scene
    prepared: Prepared
    file: Path
    ms: dict[str, float] = field(default_factory=dict)
    words: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Failed:
    """A scene that failed its trial."""

    fault: Fault


News: TypeAlias = Started | Watching | Loaded | Failed


def near(file: str) -> str:
    """The path of a file, relative to the current folder if it is inside it."""
    path = Path(file)
    return str(path.relative_to(Path.cwd())) if path.is_relative_to(Path.cwd()) else file
