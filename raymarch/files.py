"""Files: which ones are read, and output files, which are written whole or not at all."""

from __future__ import annotations

import importlib.util
import os
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from raymarch.cache import folder as cache_folder
from raymarch.errors import RaymarchError, SceneError, is_users

_read: dict[str, None] | None = None
_hooked = False


def reads(file: str | os.PathLike[str]) -> None:
    """Raise Python's audit event "open" for a file that a C library reads, which raises none of its own."""
    sys.audit("open", os.fspath(file), "rb", 0)


def import_optional(what: str, name: str, extra: str, error: type[RaymarchError] = SceneError) -> Any:
    """An optional package. `error`, with what needs it and the command to install it, if it is missing."""
    try:
        return importlib.import_module(name)
    except ImportError:
        raise error(f"{what} needs the package {name}", legal=f"pip install 'raymarch[{extra}]'") from None


def write(file: Path, writer: Callable[[Path], object], error: type[RaymarchError] = SceneError) -> None:
    """`written` with a function that writes."""
    with written(file, error) as partial:
        writer(partial)


@contextmanager
def recorded() -> Iterator[dict[str, None]]:
    """The absolute paths of the files that are opened to be read in the block, in order; of a compiled module, its
    source. Also those that do not exist."""
    global _read, _hooked
    if not _hooked:
        sys.addaudithook(_record)  # cannot be removed; does nothing outside of the block
        _hooked = True
    found = _read = {}
    try:
        yield found
    finally:
        _read = None


def _record(event: str, arguments: tuple[Any, ...]) -> None:
    if _read is None or event != "open":
        return
    path, mode = arguments[0], arguments[1]
    if isinstance(path, int) or (isinstance(mode, str) and not mode.startswith("r")):
        return
    name = os.path.abspath(os.fsdecode(path))
    if name.endswith(".pyc"):
        with suppress(ValueError):
            name = importlib.util.source_from_cache(name)
    _read[name] = None


def may_belong(file: str) -> bool:
    """True if a file that was read may belong to a scene, not to Python, the system or a cache.

    Each use of a file of our cache touches it: a window that watched it would load its scene without end.
    """
    users = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    caches = [os.path.join(os.path.abspath(found), "") for found in (cache_folder(), users) if found]
    return is_users(file) and not file.startswith(("/proc/", "/sys/", "/dev/", *caches))


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
