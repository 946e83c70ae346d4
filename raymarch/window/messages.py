"""The messages over the picture."""

from __future__ import annotations

import time as clock_time
from typing import TYPE_CHECKING

from raymarch.gpu.views import VIEWS
from raymarch.scene.legal import violations
from raymarch.scene.parameter import Values
from raymarch.window.overlay import Message

if TYPE_CHECKING:
    from raymarch.window.viewer import Viewer

PATIENT = 0.6
"""Seconds after which a running trial is shown."""


def messages_of(viewer: Viewer, now: float) -> list[Message]:
    """The messages to show now. Removes expired notices."""
    if viewer.help:
        return [Message(viewer.keys.help(), "note", "middle")]
    messages = []
    if viewer.fault is not None:
        messages.append(Message(viewer.fault.text(), "error", "bottom left"))
    elif viewer.picture.canvas is not None:
        messages += [Message(sentence, "busy", "bottom left") for sentence in broken(viewer)]
    since = viewer.reloader.busy_since
    if since is not None and viewer.reloading is not None and clock_time.monotonic() - since > PATIENT:
        waited = clock_time.monotonic() - since
        messages.append(
            Message(f"{viewer.reloader.file.name}: testing for {waited:.0f} s (Esc stops it)", "busy", "bottom left")
        )
    viewer.notices = [(until, text) for until, text in viewer.notices if until > now]
    messages += [Message(text, "note", "top left") for _, text in viewer.notices]
    if viewer.state.selected is not None:
        messages.append(Message(viewer.keys.parameters(), "note", "top left"))
    if viewer.pick is not None:
        messages.append(Message(viewer.pick.text(), "note", "top right"))
    return messages


def broken(viewer: Viewer) -> list[str]:
    """One sentence for each condition that the current values violate."""
    shot = viewer.state.shot()
    conditions = viewer.renderer.prepared(shot.scene, VIEWS[shot.view]).plan.conditions
    return violations(conditions, Values(shot.params, shot.time)) if conditions else []
