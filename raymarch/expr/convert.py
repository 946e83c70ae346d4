"""Conversion and checks of arguments. Errors name the argument, its value and the legal range.

Every public function and class converts its numbers, switches, names and arrays here, so that illegal values fail in
one way. Numbers must be finite in float32, the type in which they reach the shader.
"""

from __future__ import annotations

import os
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from types import FunctionType
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from raymarch.errors import Location, RaymarchError, SceneError, is_users, user_location
from raymarch.expr.peers import meant_among

T = TypeVar("T")

LARGEST = float(np.finfo(np.float32).max)
"""The largest legal number: values reach the shader as float32."""

LONGEST = 80
"""Maximum number of characters of a value in a message."""


def short(value: Any) -> str:
    """Describe a value for a message: by its repr if that is short, else by its beginning, shape or type."""
    if isinstance(value, np.ndarray) and value.size > 8:
        return f"an array of shape {value.shape}, {value.dtype}"
    if isinstance(value, int) and not isinstance(value, bool) and value.bit_length() > 256:
        return f"an integer of {value.bit_length()} bits"
    if isinstance(value, tuple | list | dict | set | frozenset | str | bytes) and len(value) > 64:
        return f"a {type(value).__name__} of {len(value)}"
    if isinstance(value, FunctionType):
        return f"the function {value.__name__}"
    try:
        text = " ".join(repr(value).split())
    except Exception:
        return f"a {type(value).__name__}"
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 3]}..."


def belongs(value: Any) -> str:
    """The argument that takes a part of a scene which was given elsewhere, for a message; empty for other values.

    Classes name it in `BELONGS`. Of a list, the first element decides.
    """
    first = value[0] if isinstance(value, list | tuple) and value else value
    place = getattr(type(first), "BELONGS", "")
    name = type(first).__name__
    return f": {'an' if name[0] in 'AEIO' else 'a'} {name} belongs to {place}" if place else ""


def described(value: Any) -> str:
    """A value of a wrong type for a message: the value, its type, and where a part of a scene belongs."""
    return f"{short(value)} ({type(value).__name__}){belongs(value)}"


def plain(value: Any) -> Any:
    """Convert NumPy scalars and 0-d arrays to Python's own types; return other values unchanged."""
    if isinstance(value, np.generic) or (isinstance(value, np.ndarray) and value.ndim == 0):
        return value.item()
    return value


def holdable(value: Any) -> bool:
    """True if every component is finite in float32."""
    return bool(np.all(np.abs(value) <= LARGEST))


def integer(what: str, value: Any, low: float = -LARGEST, high: float = LARGEST, legal: str = "") -> int:
    """Convert to an integer within a range."""
    given = plain(value)
    if isinstance(given, bool) or not isinstance(given, int) or not low <= given <= high:
        legal = legal or ("an integer" if high == LARGEST else f"an integer from {low:g} to {high:g}")
        raise SceneError(f"{what} = {short(value)}", legal=legal)
    return given


def real(what: str, value: Any, low: float = -LARGEST, high: float = LARGEST, legal: str = "") -> float:
    """Convert to a number within a closed range."""
    given = plain(value)
    if isinstance(given, int) and abs(given) > LARGEST:
        given = None
    if isinstance(given, bool) or not isinstance(given, int | float) or not low <= given <= high:
        legal = legal or ("a finite number" if high == LARGEST else f"a number from {low:g} to {high:g}")
        raise SceneError(f"{what} = {short(value)}", legal=legal)
    return float(given)


def switch(what: str, value: Any) -> bool:
    """Convert to True or False."""
    given = plain(value)
    if not isinstance(given, bool):
        raise SceneError(f"{what} = {short(value)}", legal="True or False")
    return given


def choice(what: str, value: Any, among: Sequence[str], legal: str = "") -> str:
    """Check that a value is one of some names."""
    given = plain(value)
    if not isinstance(given, str) or given not in among:
        legal = meant_among(given, among) + (legal or ", ".join(map(repr, among)))
        raise SceneError(f"{what} = {short(value)}", legal=legal)
    return str(given)


def instance(what: str, value: Any, kind: Any, legal: str) -> Any:
    """Check that a value is an instance of a class."""
    if not isinstance(value, kind):
        raise SceneError(f"{what} = {described(value)}", legal=legal)
    return value


def optional(convert: Callable[..., T], what: str, value: Any, *more: Any) -> T | None:
    """Convert a value, except None."""
    return None if value is None else convert(what, value, *more)


def refuse_masked(what: str, value: Any) -> None:
    """SceneError for a masked array with masked values, which would count as numbers."""
    if not isinstance(value, np.ndarray) or type(value) is np.ndarray:
        return
    if np.any(getattr(value, "mask", False)):
        lost = int(np.count_nonzero(value.mask))  # type: ignore[attr-defined]
        raise SceneError(f"{what} is a masked array with {lost} masked values", legal="array.filled(number)")


def numbers(what: str, value: Any, legal: str) -> NDArray[np.float64]:
    """Convert to a float64 array of any shape. NaN and infinity are allowed."""
    refuse_masked(what, value)
    try:
        array = np.asarray(value)
        if array.dtype.kind in "biuf" or (array.dtype.kind == "O" and array.ndim and _holds_integers(array)):
            with np.errstate(over="ignore"):
                return np.asarray(array, np.float64)
    except RaymarchError as fault:
        raise SceneError(f"{what} = {short(value)}", legal=legal) from fault
    except (TypeError, ValueError, OverflowError, MemoryError):
        pass
    raise SceneError(f"{what} = {short(value)}", legal=legal)


def numbers_or_missing(what: str, value: Any, legal: str) -> NDArray[np.float64]:
    """Convert to a float64 array, in which masked elements are NaN."""
    if np.ma.isMaskedArray(value):
        return np.ma.filled(value.astype(np.float64), np.nan)
    return numbers(what, value, legal)


def _holds_integers(array: NDArray[Any]) -> bool:
    """True for integers that exceed NumPy's types."""
    return all(isinstance(item, int) and not isinstance(item, bool) for item in array.flat)


def file_path(what: str, value: Any, legal: str) -> str:
    """Convert to the name of a file."""
    try:
        path = os.fspath(value)
    except TypeError:
        path = None
    if not isinstance(path, str) or not path or "\0" in path or max(map(len, path.split(os.sep))) > 255:
        raise SceneError(f"{what} = {short(value)}", legal=legal)
    return path


_started = ""
"""The working directory in which the present scene file was started; "" for the current one."""


@contextmanager
def working_directory_kept() -> Iterator[None]:
    """A context whose code may change the working directory, as a scene file may."""
    global _started
    before, _started = _started, _here()
    try:
        yield
    finally:
        if _started and _started != _here():
            os.chdir(_started)
        _started = before


def _here() -> str:
    """The working directory; "" if it was removed."""
    try:
        return os.getcwd()
    except OSError:
        return ""


def places_of(path: str) -> list[str]:
    """Where a file of a relative name may be: beside the scene file or the user's module, in the working directory."""
    where = user_location()
    folders = [""]
    if where is not None:
        file = where.file if _started == _here() else os.path.join(_started, where.file)
        files = [file, os.path.realpath(file)] if os.path.islink(file) else [file]
        folders = [*map(os.path.dirname, files), ""]
    return [os.path.normpath(os.path.join(folder, path)) for folder in dict.fromkeys(folders)]


def input_file(what: str, value: Any, legal: str) -> str:
    """Convert to the name of a file to read. A relative name is that of a file beside the scene file or the user's
    module, or else in the working directory. SceneError if it is in neither."""
    path = file_path(what, value, legal)
    if os.path.isabs(path):
        return path
    tried = places_of(path)
    found = [name for name in tried if os.path.exists(name)]
    if not found and len({os.path.realpath(name) for name in tried}) > 1:
        raise SceneError(f"{what}: no file '{short(path)[1:-1]}'", legal=f"tried: {', '.join(tried)}")
    return found[0] if found else path


def called(what: str, function: Callable[..., T], *args: Any, legal: str) -> T:
    """Call a user's function. Its exceptions become SceneErrors with the line of the function."""
    try:
        return function(*args)
    except RaymarchError:
        raise
    except Exception as fault:
        where = [
            Location(code.co_filename, line)
            for code, line in ((frame.f_code, line) for frame, line in traceback.walk_tb(fault.__traceback__))
            if is_users(code.co_filename)
        ]
        raise SceneError(
            f"{what}: the function fails: {short_fault(fault)}", legal=legal, where=where[-1] if where else None
        ) from fault


def short_fault(fault: BaseException) -> str:
    """A Python exception as one line of a message."""
    text = " ".join(str(fault).split())
    text = text.replace("'Node' object is not callable", "a solid is no function; its distance is node.distance(p)")
    text = text if len(text) <= LONGEST else f"{text[: LONGEST - 3]}..."
    return text if isinstance(fault, TypeError) else f"{type(fault).__name__}: {text}"
