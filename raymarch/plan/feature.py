"""A feature of the plan: an effect that a scene uses or not, with the reason."""

from __future__ import annotations

from dataclasses import dataclass

from raymarch.errors import Location


@dataclass(frozen=True, slots=True)
class Feature:
    """An effect, whether the scene uses it, and why.

    where : the user's line that calls for it, if there is one.
    """

    name: str
    used: bool
    reason: str
    where: Location | None = None
