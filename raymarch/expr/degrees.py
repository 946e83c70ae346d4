"""Warnings of angles that look like the other unit."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from raymarch.errors import Location, user_location, warn
from raymarch.expr.convert import plain
from raymarch.expr.node import Expr

DEGREES = frozenset({30, 45, 60, 90, 120, 135, 150, 180, 225, 270, 315, 360})
"""Usual angles in degrees. None of them is a usual angle in radians, or in radians per unit of length or time."""

TURNS = DEGREES.union(range(10, 361, 5), range(36, 361, 36), range(18, 361, 36))
"""More of them, for angles that are no rate: a twist of 10 radians per unit is a rope, a turn by 10 is a mistake."""

WHOLE = range(15, 121)
"""Fields of view in whole degrees; in radians they are numbers that nobody writes as degrees."""
TENTHS = (0.6, 0.7, 0.8, 0.9, 1.2, 1.5)
"""Fields of view that are written in radians, 34 to 86 degrees, and that are rarely meant as degrees."""

_suspected: set[tuple[str, Location | None]] = set()
"""The parameters and lines that were warned of; a line of a loop warns once."""


def _number(value: Any) -> float | None:
    given: Any = plain(value)
    if isinstance(given, bool) or not isinstance(given, int | float) or not abs(given) < 1e6:
        return None
    return float(given)


def _warn_once(what: str, message: str) -> None:
    where = user_location()
    if (what, where) not in _suspected:
        _suspected.add((what, where))
        warn(message, where)


def suspect_degrees(what: str, angle: Any, unit: str = "radians") -> None:
    """A SceneWarning for a number of radians that is a usual angle in degrees.

    what : the parameter, as in "rotate: angle". unit : "radians", or "radians per unit". A multiple of `time`, such as
        90 * time, counts as radians per second.
    """
    given = _number(angle)
    if isinstance(angle, Expr) and angle.op == "mul" and {part.op for part in angle.args} == {"const", "time"}:
        factor = next(part.data for part in angle.args if part.op == "const")
        what, unit, given = f"{what} / time", "radians per second", float(factor) if np.ndim(factor) == 0 else None
    if given is not None and abs(given) in (TURNS if unit == "radians" else DEGREES):
        turns = f"{math.fabs(given) / math.tau:.1f} turns{unit.removeprefix('radians')}"
        _warn_once(what, f"{what} = {given:g} {unit} is {turns} (for degrees, math.radians({given:g}))")


def suspect_radians(what: str, angle: Any) -> None:
    """A SceneWarning for a number of degrees that is likely an angle in radians."""
    given = _number(angle)
    if given is None:
        return
    whole = round(math.degrees(given))
    if given in TENTHS or (whole in WHOLE and abs(given - math.radians(whole)) < 1e-9):
        _warn_once(what, f"{what} = {given:g} degrees sees almost nothing (for radians, math.degrees({given:g}))")
