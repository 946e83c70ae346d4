"""Errors and warnings. A message is one sentence: the fault, the value, the legal range, the user's file and line.

Every package may import this module. A `RaymarchError` is a fault that the user can mend (exit code 2). Any other
exception that leaves `raymarch` is a bug of `raymarch` (exit code 1).
"""

from __future__ import annotations

import os
import sys
import sysconfig
import warnings
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import islice
from types import FrameType
from typing import Any

__all__ = [
    "ClusterError",
    "CostError",
    "DeviceError",
    "PlanError",
    "RaymarchError",
    "RenderError",
    "RenderWarning",
    "SceneError",
    "SceneWarning",
    "ShaderError",
]

_NOT_THE_USERS = (
    os.path.dirname(os.path.abspath(__file__)) + os.sep,
    "<frozen",
    *(sysconfig.get_path(name) + os.sep for name in ("stdlib", "purelib", "platlib")),
)


def printable(text: str) -> str:
    """A text with escapes such as \\x1b in place of characters that are not printable: one line, without commands to a
    terminal."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)


@dataclass(frozen=True, slots=True)
class Location:
    """A line of a Python file: where the user made a node or another part of a scene.

    columns : first byte of the expression in its line, and the byte after its last, if they are known.
    """

    file: str
    line: int
    columns: tuple[int, int] | None = field(default=None, compare=False, repr=False)

    def __str__(self) -> str:
        return printable(f"{self.file}:{self.line}")


class Doubt(str):
    """A reason to doubt a picture, or what was asked for: one sentence, with its parts.

    stage : what knows it: "scene" (options without effect), "plan" (the field and how it is drawn), "values" (of a
        frame) or "picture". what : the doubt. cure : what to write instead, or "". where : the user's line, if known.
    """

    stage: str
    what: str
    cure: str
    where: Location | None

    def __new__(cls, stage: str, what: str, cure: str = "", where: Location | None = None) -> Doubt:
        place, ending = f"{where}: " if where else "", f" ({cure})" if cure else ""
        made = super().__new__(cls, f"{place}{what}{ending}")
        made.stage, made.what, made.cure, made.where = stage, what, cure, where
        return made

    def __getnewargs__(self) -> tuple[Any, ...]:
        return self.stage, self.what, self.cure, self.where


class RaymarchError(Exception):
    """Base class of all errors that a user can mend. `str()` is the complete message.

    Parameters
    ----------
    what : the fault. It names the parameter and its value.
    legal : the legal range or the cure, if there is one.
    where : the user's line. None finds it from the call stack.
    """

    def __init__(self, what: str, *, legal: str = "", where: Location | None = None) -> None:
        self.what = what
        self.legal = legal
        self.where = where if where is not None else user_location(exact=True)
        super().__init__(str(self))

    def __str__(self) -> str:
        place = f"{self.where}: " if self.where else ""
        cure = f" ({self.legal})" if self.legal else ""
        return printable(f"{place}{self.what}{cure}")

    def _render_traceback_(self) -> list[str]:
        """What IPython shows in place of a traceback: one line that names the cell, or the file, and its line."""
        cell = None if self.where is None else _cell(self.where.file)
        text = str(self)
        if self.where is not None and cell is not None:
            text = text.replace(f"{self.where}: ", f"{cell}, line {self.where.line}: ", 1)
        return [f"{type(self).__name__}: {text}"]


def _cell(file: str) -> str | None:
    """The name of the cell of a notebook whose code is in a file, such as "Cell In[3]"; None for other files."""
    shell: Any = sys.modules["IPython"].get_ipython() if "IPython" in sys.modules else None
    try:
        named = shell.compile.format_code_name(file)
        return " ".join(named) if named else None
    except (AttributeError, KeyError, TypeError):
        return None


class SceneError(RaymarchError, ValueError):
    """An invalid scene: a value out of range, a wrong type, a scene file without a scene."""


class UnknownNameError(SceneError, AttributeError):
    """A name that raymarch, a node or a part of a scene does not have. The message says which name is meant."""


class PlanError(RaymarchError):
    """A valid scene that cannot be planned: parameters of one name that differ, a field beyond the limits."""


class ShaderError(RaymarchError):
    """The driver refused the shader. The message names the node that made the line at fault."""


class DeviceError(RaymarchError):
    """There is no usable OpenGL context, a limit of the driver is exceeded, or the device failed."""


class CostError(RaymarchError):
    """No setting reaches the requested error or time, or a measurement cannot be made or reported as requested."""


class ClusterError(RaymarchError):
    """A cluster that cannot be used, or pictures that its workers could not draw."""


class SceneWarning(UserWarning):
    """Input that was corrected, or an operation that takes long. It may be a mistake."""


def warn(what: str, where: Location | None = None) -> None:
    """Issue a SceneWarning at a line of the user. None finds the line from the call stack."""
    where = where or user_location() or Location("raymarch", 0)
    warnings.warn_explicit(
        printable(what), SceneWarning, where.file, where.line, registry=_warned.setdefault(where.file, {})
    )


_warned: dict[str, dict[Any, Any]] = {}
"""Python's record of the warnings that were shown, by file: a line of a loop warns once."""


class RenderError(RaymarchError):
    """Raised with `strict` for a picture that may be wrong; `str()` gives the reasons."""

    def __init__(self, doubts: Sequence[Doubt]) -> None:
        super().__init__("; ".join(doubts))
        self.where = None  # the reasons name their own lines
        self.args = (str(self),)


class RenderWarning(UserWarning):
    """A picture that may be wrong, with the reason."""


def warn_of_doubts(doubts: Iterable[Doubt]) -> None:
    """Emit each doubt as a RenderWarning at the user's line; by default a repeated text appears once for each line."""
    place = user_location()
    for doubt in doubts:
        if place is None:
            warnings.warn(doubt, RenderWarning, stacklevel=3)
        else:
            warnings.warn_explicit(doubt, RenderWarning, place.file, place.line, registry=_said)


_said: dict[Any, Any] = {}


def user_location(exact: bool = False) -> Location | None:
    """The innermost line of the call stack that is neither in this package nor in an installed library, or None.

    exact : also find the columns of the call, which takes longer.
    """
    frame: FrameType | None = sys._getframe(1)
    while frame is not None:
        file = frame.f_code.co_filename
        # Methods that dataclasses generate have no file, but the globals of their module.
        if is_users(file) and not str(frame.f_globals.get("__name__")).startswith("raymarch."):
            return Location(file, frame.f_lineno, _columns(frame)) if exact else _location(file, frame.f_lineno)
        frame = frame.f_back
    return None


def _columns(frame: FrameType) -> tuple[int, int] | None:
    """The columns of the call that a frame is in; up to the end of the line if it goes on below."""
    found = next(islice(frame.f_code.co_positions(), frame.f_lasti // 2, None), None)
    return None if found is None else columns_of(frame.f_lineno, *found)


def columns_of(
    line: int, first: int | None, last: int | None, start: int | None, end: int | None
) -> tuple[int, int] | None:
    """The columns of a `Location` from first and last line, and first column and the one after the last, in bytes."""
    if start is None or end is None or first != line:
        return None
    return start, end if last == line else sys.maxsize


@lru_cache(4096)
def is_users(file: str) -> bool:
    """True if a Python file is neither in this package nor in an installed library, nor the installed command."""
    return not file.startswith(_NOT_THE_USERS) and os.path.basename(file) != "raymarch"


_location = lru_cache(4096)(Location)
"""One object for the many nodes and expressions of a line."""
