"""Output files: written whole, or not at all."""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from raymarch.errors import RaymarchError, SceneError


def reads(file: str | os.PathLike[str]) -> None:
    """Raise Python's audit event "open" for a file that a C library reads, which raises none of its own."""
    sys.audit("open", os.fspath(file), "rb", 0)


@contextmanager
def written(file: Path, error: type[RaymarchError] = SceneError, folder: Path | None = None) -> Iterator[Path]:
    """Write atomically: a temporary file beside `file`, or in a folder of the same disk, which is renamed at the end
    and removed after a failure.

    The old file stays until then. Raises `error` if the file cannot be written.
    """
    try:
        handle, name = tempfile.mkstemp(prefix=f".{file.name}.", dir=folder or file.parent or Path())
        os.close(handle)
    except OSError as fault:
        raise error(f"cannot write '{file}': {fault.strerror or fault}", legal="a writable folder") from None
    partial = Path(name)
    try:
        yield partial
        mask = os.umask(0)
        os.umask(mask)
        partial.chmod(0o666 & ~mask)
        partial.replace(file)
    except (OSError, ValueError) as fault:  # a ValueError is a limit of the format
        reason = getattr(fault, "strerror", None) or fault
        raise error(f"cannot write '{file}': {reason}", legal="a writable file") from None
    finally:
        partial.unlink(missing_ok=True)
