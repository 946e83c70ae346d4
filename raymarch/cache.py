"""The cache on disk: arrays by the content that they were computed from.

It is in $RAYMARCH_CACHE, else in the user's cache; an empty variable switches it off. A file that cannot be read or
written costs time, never the result.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

VARIABLE = "RAYMARCH_CACHE"
"""Environment variable with the folder of the cache; empty disables the cache."""

UNREADABLE = (OSError, EOFError, ValueError, KeyError, TypeError, AttributeError, SyntaxError)
"""What reading a damaged file raises, besides the errors of its compression."""


def folder() -> Path | None:
    """The folder of the cache; None for no cache."""
    given = os.environ.get(VARIABLE)
    if given is not None:
        return Path(given) if given.strip() else None
    base = os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA")
    try:
        return (Path(base) if base else Path.home() / ".cache") / "raymarch"
    except RuntimeError:  # there is no home directory
        return None


def load(file: Path) -> dict[str, Any] | None:
    """The arrays of a file by name; None if there is none, or it is damaged."""
    import zipfile  # takes time, and few scenes have cached arrays
    import zlib

    try:
        with file.open("rb") as stream, np.load(stream, allow_pickle=False) as stored:
            return {name: stored[name] for name in stored.files}
    except (*UNREADABLE, zipfile.BadZipFile, zlib.error):
        return None


def save(file: Path, arrays: Mapping[str, Any], compressed: bool = False, limit: float = np.inf) -> str:
    """Save arrays through a temporary file and a rename, so that nobody reads a partial file.

    limit : bytes of the files of this suffix in the folder, beyond which the files used longest ago are removed.
    Returns what prevented it, or "".
    """
    partial = None
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(prefix=f".{file.stem[:8]}.", suffix=".part", dir=file.parent)
        partial = Path(name)
        with os.fdopen(handle, "wb") as stream:
            (np.savez_compressed if compressed else np.savez)(stream, **arrays)
        partial.replace(file)
        if limit < np.inf:
            _trim(file, limit)
    except OSError as fault:
        return f"cannot write '{file.parent}': {fault.strerror or fault}"
    finally:
        if partial is not None:
            with suppress(OSError):
                partial.unlink(missing_ok=True)
    return ""


def _trim(newest: Path, limit: float) -> None:
    """Remove the files that were used longest ago, but for the newest."""
    kept = [(other.stat(), other) for other in newest.parent.glob(f"*{newest.suffix}") if other != newest]
    total = newest.stat().st_size
    for known, other in sorted(kept, key=lambda each: -each[0].st_mtime):
        total += known.st_size
        if total > limit:
            other.unlink(missing_ok=True)
