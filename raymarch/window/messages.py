"""What the window says over the picture at a moment."""

from __future__ import annotations

import time as clock_time
from typing import TYPE_CHECKING

from raymarch.gpu.views import VIEWS
from raymarch.scene.legal import violations
from raymarch.scene.parameter import Values
from raymarch.window.overlay import Card

if TYPE_CHECKING:
    from raymarch.window.viewer import Viewer

PATIENT = 0.6
"""Seconds after which a trial is mentioned."""


def messages_of(viewer: Viewer, now: float) -> list[Card]:
    """The cards to show; notices whose time is over are forgotten."""
    if viewer.help:
        return [Card(viewer.keys.help(), "note", "middle")]
    cards = []
    if viewer.fault is not None:
        cards.append(Card(viewer.fault.text(), "error", "bottom left"))
    elif viewer.picture.canvas is not None:
        cards += [Card(sentence, "busy", "bottom left") for sentence in broken(viewer)]
    since = viewer.reloader.busy_since
    if since is not None and viewer.reloading is not None and clock_time.monotonic() - since > PATIENT:
        waited = clock_time.monotonic() - since
        cards.append(
            Card(f"{viewer.reloader.file.name}: tried out for {waited:.0f} s (Esc stops it)", "busy", "bottom left")
        )
    viewer.notices = [(until, text) for until, text in viewer.notices if until > now]
    cards += [Card(text, "note", "top left") for _, text in viewer.notices]
    if viewer.state.selected is not None:
        cards.append(Card(viewer.keys.parameters(), "note", "top left"))
    if viewer.pick is not None:
        cards.append(Card(viewer.pick.text(), "note", "top right"))
    return cards


def broken(viewer: Viewer) -> list[str]:
    """What the values of the picture that is shown break, a sentence each."""
    shot = viewer.state.shot()
    conditions = viewer.renderer.prepared(shot.scene, VIEWS[shot.view]).plan.conditions
    return violations(conditions, Values(shot.params, shot.time)) if conditions else []
