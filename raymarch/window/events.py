"""Events of mouse and keyboard as plain values."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias


@dataclass(frozen=True, slots=True)
class Key:
    """A key went down, up, or repeats; `name` as in `NAMES`, or one character in lower case.

    plain : True if it is no repeat, and was pressed without Control, Alt and the system key.
    """

    name: str
    down: bool
    shift: bool
    control: bool
    code: int
    plain: bool = True


@dataclass(frozen=True, slots=True)
class Char:
    """A character was typed."""

    code: int


@dataclass(frozen=True, slots=True)
class Button:
    """A mouse button went down or up; 0 left, 1 right, 2 middle."""

    button: int
    down: bool
    shift: bool
    control: bool


@dataclass(frozen=True, slots=True)
class Move:
    """The cursor is at (x, y), in screen coordinates from the upper left of the window."""

    x: float
    y: float


@dataclass(frozen=True, slots=True)
class Scroll:
    """The wheel was turned; up and right are positive."""

    x: float
    y: float


@dataclass(frozen=True, slots=True)
class Drop:
    """Files were dropped onto the window."""

    files: tuple[Path, ...]


Event: TypeAlias = Key | Char | Button | Move | Scroll | Drop
