"""A draw of each pass of a group."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from raymarch.plan import Pass


@dataclass(frozen=True, slots=True)
class Turn:
    """A draw of each pass of a group.

    uniforms : of this turn. size : of the target; None for that of the picture. target : its name; "" for the pass's.
    before : all uniforms of the last picture, if the scene changed since. kept : use what was drawn earlier.
    still : whether the picture is the one that the history shows.
    rows : the first row that is drawn, and the one after the last; None for all. A pass with a history reads the
        earlier one until its last row is drawn.
    light_turns : the largest number of lights of a surface; None if it is that of the frame.
    """

    uniforms: Mapping[str, Any]
    size: tuple[int, int] | None = None
    target: str = ""
    before: Mapping[str, Any] | None = None
    kept: bool = False
    rows: tuple[int, int] | None = None
    light_turns: int | None = None
    still: bool = False

    def draws(self, chosen: Pass) -> bool:
        """Whether a pass is drawn; see `Pass.when`."""
        when = {"": True, "changed": self.before is not None, "still": self.still, "moving": not self.still}
        return not self.kept and when[chosen.when]
