"""Undo and redo of parameters and edits."""

from __future__ import annotations

import time as clock_time
from dataclasses import replace

from raymarch.window.model import Model, Remembered, Show

TOGETHER, UNDONE = 1.0, 200
"""Seconds within which changes of a value are undone together, and the largest number of changes that can be undone."""


def remember(model: Model, what: str) -> None:
    """Remember parameters and edits before a change. Changes of the same value in quick succession are one."""
    now, (last, at) = clock_time.perf_counter(), model.remembered
    if what != last or now - at > TOGETHER:
        model.undone.append(Remembered(dict(model.state.params), model.state.edits))
        del model.undone[:-UNDONE]
    model.redone.clear()
    model.remembered = what, now


def undo(model: Model) -> None:
    """Return to the parameters and edits before the last change."""
    _return(model, model.undone, model.redone, "nothing to undo")


def redo(model: Model) -> None:
    """Take back an `undo`."""
    _return(model, model.redone, model.undone, "nothing to redo")


def _return(model: Model, here: list[Remembered], there: list[Remembered], nothing: str) -> None:
    state = model.state
    if not here:
        model.notice(nothing)
        return
    found = here.pop()
    there.append(Remembered(dict(state.params), state.edits))
    model.remembered = "", 0.0
    if found.edits == state.edits:
        state.params = {name: value for name, value in found.params.items() if name in state.specs}
    else:
        made, _ = replace(state, params=found.params).with_scene(state.base, found.edits)
        model.request(Show(made))
    model.say("returned", left=len(here))
