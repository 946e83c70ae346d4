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
from typing import Any, BinaryIO

import numpy as np

VARIABLE = "RAYMARCH_CACHE"
"""Environment variable with the folder of the cache; empty disables the cache."""

DIGEST = 32
"""Bytes of the digest at the end of a file, as the comment of its ZIP archive."""


def folder() -> Path | None:
    """The folder of the cache; None for no cache."""
    given = os.environ.get(VARIABLE)
    base = os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA")
    try:
        if given is not None:
            return Path(given).expanduser() if given.strip() else None
        return (Path(base) if base else Path.home() / ".cache") / "raymarch"
    except RuntimeError:  # there is no home directory
        return None


def load(file: Path) -> dict[str, Any] | None:
    """The arrays of a file by name; None if there is none, or it is not as `save` wrote it under this name."""
    try:
        with file.open("rb") as stream:
            if not _is_intact(stream, file.name):
                return None
            stream.seek(0)
            with np.load(stream, allow_pickle=False) as stored:
                return {name: stored[name] for name in stored.files}
    except (OSError, ValueError):  # another version of NumPy may have written it
        return None


def _digest(stream: BinaryIO, size: int, name: str) -> bytes:
    """The digest of the first bytes of a file, and of its name."""
    import hashlib  # takes time, and few scenes have cached arrays

    made = hashlib.blake2b(name.encode(), digest_size=DIGEST)
    stream.seek(0)
    while size > 0 and (block := stream.read(min(size, 1 << 20))):
        made.update(block)
        size -= len(block)
    return made.digest()


def _is_intact(stream: BinaryIO, name: str) -> bool:
    size = stream.seek(0, os.SEEK_END) - DIGEST
    return size > 0 and _digest(stream, size, name) == stream.read(DIGEST)


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
        with os.fdopen(handle, "w+b") as stream:
            (np.savez_compressed if compressed else np.savez)(stream, **arrays)
            end = stream.seek(0, os.SEEK_END)
            stream.seek(end - 2)  # the length of the archive's comment
            stream.write(DIGEST.to_bytes(2, "little"))
            made = _digest(stream, end, file.name)
            stream.seek(end)
            stream.write(made)
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
