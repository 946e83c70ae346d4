"""One line of the plan: something that a scene may call for, and why it does or does not."""

from __future__ import annotations

from dataclasses import dataclass

from raymarch.errors import Location


@dataclass(frozen=True, slots=True)
class Feature:
    """Something that a scene may call for: whether it does, and because of what."""

    name: str
    used: bool
    reason: str
    where: Location | None = None
