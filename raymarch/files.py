"""Files: those of data, which may hold anything; which ones are read; and outputs, written whole or not at all."""

from __future__ import annotations

import importlib.util
import json
import math
import os
import shutil
import stat
import struct
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from errno import EACCES, EISDIR
from pathlib import Path
from typing import Any

from raymarch.cache import folder as cache_folder
from raymarch.errors import RaymarchError, SceneError, is_users
from raymarch.startup import interrupt_again, unfinished

UNFINISHED = ".raymarch."
"""How the names of temporary files begin, which become the outputs when they are complete."""

_read: dict[str, None] | None = None
_hooked = False
_data: dict[str, None] = {}  # files that `reading` read and this process had not written
_made: set[str] = set()  # files that `written` wrote


def reads(file: str | os.PathLike[str]) -> None:
    """Raise Python's audit event "open" for a file that a C library reads, which raises none of its own."""
    sys.audit("open", os.fspath(file), "rb", 0)


@contextmanager
def reading(
    what: str, file: str | os.PathLike[str], legal: str, error: type[RaymarchError] = SceneError
) -> Iterator[None]:
    """The block that reads or uses a file of data: whatever is raised there becomes an `error` with the file's name.

    Refuses what is no regular file first: a device or a pipe may have no end.
    """
    name = os.fspath(file)
    try:
        if not stat.S_ISREG(mode := os.stat(file).st_mode):
            raise OSError("it is a directory" if stat.S_ISDIR(mode) else "it is a device or a pipe")
        if (place := os.path.abspath(name)) not in _made:
            _data[place] = None
        yield
    except RaymarchError as fault:
        if name in fault.what:
            raise
        raise error(f"{what}: cannot use '{name}': {fault.what}", legal=fault.legal or legal) from fault
    except Exception as fault:
        reason = (isinstance(fault, OSError) and fault.strerror) or " ".join(str(fault).split())[:200]
        if isinstance(fault, MemoryError | LookupError | AttributeError | TypeError | SyntaxError | RecursionError):
            reason = f"it is broken ({type(fault).__name__}{': ' * bool(reason)}{reason})"
        raise error(f"{what}: cannot read '{name}': {reason or type(fault).__name__}", legal=legal) from fault


def read_json(what: str, file: Path, legal: str, error: type[RaymarchError] = SceneError) -> Any:
    """The content of a JSON file of finite numbers. `error` with the file's name if it is none."""

    def number(text: str) -> float:
        if not math.isfinite(value := float(text)):
            raise ValueError(f"{text} is no finite number")
        return value

    with reading(what, file, legal, error):
        return json.loads(file.read_text(encoding="utf-8"), parse_float=number, parse_constant=number)


def sources(*names: str) -> Iterator[tuple[str, bytes]]:
    """The names and contents of files of the package, and of those in its folders; it may be in a zip archive."""
    from importlib import resources  # takes time, and few commands need it

    def walk(found: Any) -> Iterator[tuple[str, bytes]]:
        if found.is_file():
            yield found.name, found.read_bytes()
            return
        for part in sorted(found.iterdir(), key=lambda part: part.name):
            if part.name.endswith((".py", ".glsl", ".html")) or part.is_dir():
                yield from walk(part)

    for name in names:
        yield from walk(resources.files("raymarch").joinpath(name))


def valid(name: str) -> str:
    """The name of a file as text that UTF-8 can encode: other bytes are escaped."""
    return name.encode("utf-8", "backslashreplace").decode()


EXTRAS = {
    "cluster": "distributed cryptography",
    "exr": "OpenEXR",
    "jupyter": "anywidget",
    "live": "python-osc mido python-rtmidi",
    "mesh": "trimesh charset-normalizer rtree scipy",
    "report": "jinja2 matplotlib",
    "tiff": "tifffile",
    "video": "av",
    "view": "imgui-bundle PyOpenGL",
}
"""The packages of each extra of pyproject.toml, for messages: an extra can only be installed from a clone."""


def install(extra: str) -> str:
    """The command that installs the packages of an extra."""
    return f"pip install {EXTRAS[extra]}"


def import_optional(what: str, name: str, extra: str, error: type[RaymarchError] = SceneError) -> Any:
    """An optional package. `error`, with what needs it and the command to install it, if it is missing."""
    try:
        found = importlib.import_module(name)
    except ImportError:
        raise error(f"{what} needs the package {name}", legal=install(extra)) from None
    interrupt_again()
    return found


def write(file: Path, writer: Callable[[Path], object], error: type[RaymarchError] = SceneError) -> None:
    """`written` with a function that writes."""
    with written(file, error) as partial:
        writer(partial)


@contextmanager
def folders_of(file: Path, error: type[RaymarchError] = SceneError) -> Iterator[list[Path]]:
    """A block that writes a file: the folders that it lacks are made, and are yielded.

    Those that are empty are removed if the block fails. Raises `error` if a folder cannot be made.
    """
    made: list[Path] = []
    try:
        for folder in reversed([file.parent, *file.parent.parents]):
            if not os.path.lexists(folder):
                folder.mkdir()
                made.append(folder)
        yield made
    except BaseException as fault:
        for each in reversed(made):
            with suppress(OSError):
                each.rmdir()
        if isinstance(fault, OSError) and fault.filename == os.fspath(folder):
            what = f"cannot write '{file}': {fault.strerror}"
            raise error(what, legal="a writable file in a writable folder") from None
        raise


@contextmanager
def recorded() -> Iterator[dict[str, None]]:
    """The absolute paths of the files that are opened to be read in the block, in order; of a compiled module, its
    source. Also those that do not exist, and folders that became the working directory. Blocks may be nested."""
    global _read, _hooked
    outer = _read
    if not _hooked:
        sys.addaudithook(_record)  # cannot be removed; does nothing outside of the block
        _hooked = True
    found = _read = {}
    try:
        yield found
    finally:
        if outer is not None:
            outer.update(found)
        _read = outer


def _record(event: str, arguments: tuple[Any, ...]) -> None:
    if _read is None or event not in ("open", "os.chdir"):
        return
    path, mode = arguments[0], arguments[1] if event == "open" else "r"
    if isinstance(path, int) or (isinstance(mode, str) and not mode.startswith("r")):
        return
    name = os.fsdecode(path)
    name = name if os.path.isabs(name) else os.path.join(os.getcwd(), name)
    if ".." not in name.split(os.sep):  # beyond a linked folder it leads elsewhere than by its letters
        name = os.path.normpath(name)
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


def check_apart(
    read: Iterable[str] | None, outputs: Iterable[Path | None], error: type[RaymarchError] = SceneError
) -> None:
    """`error` if an output would replace a file that was read, also by another name of it.

    read : as `recorded` gives it for a scene that was loaded. None: the files of data that this process has read, but
        not those that it wrote before.
    """
    reader, names = ("program", [*_data]) if read is None else ("command", read)
    inputs = {_identity(name) for name in names if may_belong(name)} - {None}
    for file in outputs if inputs else ():
        if file is not None and _identity(file) in inputs:
            raise error(f"cannot write '{file}': this {reader} reads it", legal="another name")


def _identity(file: str | os.PathLike[str]) -> tuple[int, int] | None:
    """The device and the number of a regular file; None if there is none."""
    with suppress(OSError, ValueError):
        found = os.stat(file)
        if stat.S_ISREG(found.st_mode):
            return found.st_dev, found.st_ino
    return None


@contextmanager
def written(file: Path, error: type[RaymarchError] = SceneError, folder: Path | None = None) -> Iterator[Path]:
    """Write a file whole or not at all: the block writes a temporary file, which then takes the place of `file`.

    folder : of the temporary file, if it is on the same disk. None: that of `file`.

    The old file stays until then, and its mode after it. Of a link, the file that it names is written. A pipe or a
    device gets the bytes. The temporary file is removed on every way out. Raises `error` if the file cannot be written.
    """
    partial: Path | None = None
    try:
        try:
            before = os.stat(file)
        except FileNotFoundError:
            before = None
        mode = 0o666 if before is None else before.st_mode
        if stat.S_ISDIR(mode):
            raise IsADirectoryError(EISDIR, os.strerror(EISDIR))
        if before is not None and not os.access(file, os.W_OK):
            raise PermissionError(EACCES, "it is read-only")
        streamed = before is not None and not stat.S_ISREG(mode)
        target = Path(file if streamed else os.path.realpath(file))
        beside = Path(tempfile.gettempdir()) if streamed else target.parent
        if folder is not None and not streamed and os.stat(folder).st_dev == os.stat(beside).st_dev:
            beside = folder
        partial = beside / f"{UNFINISHED}{os.urandom(6).hex()}"
        unfinished.add(str(partial))
        os.close(os.open(partial, os.O_CREAT | os.O_EXCL | os.O_WRONLY, stat.S_IMODE(mode) | stat.S_IRUSR))
        yield partial
        if streamed:
            with partial.open("rb") as made, target.open("wb") as out:
                shutil.copyfileobj(made, out)
        else:
            if before is not None:
                partial.chmod(stat.S_IMODE(mode))
            partial.replace(target)
        _made.add(os.path.abspath(file))
    except RaymarchError:  # a ValueError too: of the block, and complete
        raise
    except (OSError, ValueError, MemoryError, struct.error) as fault:  # the last three are limits of formats
        reason = getattr(fault, "strerror", None) or str(fault) or type(fault).__name__
        reason = reason.replace(str(partial), os.fspath(file))  # as some libraries name what they write
        raise error(f"cannot write '{file}': {reason}", legal="a writable file in a writable folder") from None
    finally:
        if partial is not None:
            with suppress(OSError):
                partial.unlink()
            unfinished.discard(str(partial))
