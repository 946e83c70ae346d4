"""What can go wrong, said in one sentence: what, the value, the legal range, the user's file and line.

Every room may import this one. A `RaymarchError` is the user's to mend (exit code 2); any other
exception that leaves the package is a fault of ours (exit code 1).
"""

from __future__ import annotations

import os
import sys
import sysconfig
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from types import FrameType

_NOT_THE_USERS = (
    os.path.dirname(os.path.abspath(__file__)) + os.sep,
    "<frozen",
    *(sysconfig.get_path(name) + os.sep for name in ("stdlib", "purelib", "platlib")),
)


@dataclass(frozen=True, slots=True)
class Location:
    """A line of a Python file: where the user wrote what became a node."""

    file: str
    line: int

    def __str__(self) -> str:
        return f"{self.file}:{self.line}"


class RaymarchError(Exception):
    """Base of all errors that a user can mend. `str()` is one complete message.

    Parameters
    ----------
    what : the fault, naming the parameter and its value.
    legal : the legal range or the cure, if there is one.
    where : the user's own line; found from the call stack when it is not given.
    """

    def __init__(self, what: str, *, legal: str = "", where: Location | None = None) -> None:
        self.what = what
        self.legal = legal
        self.where = where if where is not None else user_location()
        super().__init__(str(self))

    def __str__(self) -> str:
        place = f"{self.where}: " if self.where else ""
        cure = f" ({self.legal})" if self.legal else ""
        return f"{place}{self.what}{cure}"


class SceneError(RaymarchError):
    """A scene that cannot be meant: a wrong parameter, a wrong type, a scene file without a scene."""


class PlanError(RaymarchError):
    """A scene that is well formed but cannot be planned: clashing parameters, a field beyond the limits."""


class ShaderError(RaymarchError):
    """The driver refused the shader; the message names the node that made the offending line."""


class DeviceError(RaymarchError):
    """No usable OpenGL context, a limit of the driver exceeded, or a device that failed."""


class CostError(RaymarchError):
    """No setting gives what was asked for, or a measurement cannot be made or reported as asked."""


class SceneWarning(UserWarning):
    """Something in a scene that was mended, or that takes long, and may not be what was meant."""


def warn(what: str, where: Location | None = None) -> None:
    """Say on a line of the user what was mended or takes long; None finds the line from the call stack."""
    where = where or user_location() or Location("raymarch", 0)
    warnings.warn_explicit(what, SceneWarning, where.file, where.line)


class RenderError(RaymarchError):
    """A picture that the engine cannot vouch for, where `strict` asks for one that it can."""

    def __init__(self, doubts: Sequence[str]) -> None:
        super().__init__("; ".join(doubts))
        self.where = None  # the reasons name their own lines
        self.args = (str(self),)


class RenderWarning(UserWarning):
    """A picture that the engine cannot vouch for, with the reason."""


def user_location() -> Location | None:
    """The innermost line of the call stack that is neither this package's nor an installed library's, if any."""
    frame: FrameType | None = sys._getframe(1)
    while frame is not None:
        file = frame.f_code.co_filename
        # Methods that dataclasses generate have no file of their own, but the names of their module.
        generated_here = str(frame.f_globals.get("__name__")).startswith("raymarch.")
        if is_users(file) and not generated_here and os.path.basename(file) != "raymarch":  # the installed command
            return Location(file, frame.f_lineno)
        frame = frame.f_back
    return None


def is_users(file: str) -> bool:
    """True if a Python file is neither this package's nor an installed library's."""
    return not file.startswith(_NOT_THE_USERS)
