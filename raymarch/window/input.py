"""Input of the mouse and of held keys: camera movement, picks, dropped files."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from raymarch.window import control
from raymarch.window.inspection import pick_at
from raymarch.window.surface import Button, Drop, Event, Key, Move, Scroll

if TYPE_CHECKING:
    from raymarch.window.viewer import Viewer

CLICK = 4.0
"""Minimum movement of a drag, in screen coordinates; a shorter one is a click."""

FAST = 4.0
"""Factor of the flying speed with Shift."""


class Input:
    """Converts events to camera movements, picks and commands."""

    def __init__(self, viewer: Viewer) -> None:
        self._viewer = viewer
        self._at = (0.0, 0.0)
        self._pressed_at: tuple[float, float] | None = None
        self._button: int | None = None
        self._mode = ""
        self._dragged = False

    @property
    def busy(self) -> bool:
        """True while a held key or button keeps moving the picture."""
        return any(self.flying())

    def take(self, events: Sequence[Event]) -> None:
        """Handle events in order."""
        panel = self._viewer.panel
        for event in events:
            if panel is not None and panel.take(event) and self._button is None:
                continue
            if isinstance(event, Move):
                self._move(event)
            elif isinstance(event, Button):
                self._press(event)
            elif isinstance(event, Scroll):
                state = self._viewer.state
                state.move(control.dolly(state.hold(), event.y))
            elif isinstance(event, Key) and event.down:
                self._viewer.keys.press(event)
            elif isinstance(event, Drop):
                self._drop(event)

    def _move(self, event: Move) -> None:
        dx, dy = event.x - self._at[0], event.y - self._at[1]
        self._at = (event.x, event.y)
        if self._pressed_at is None:
            return
        far = np.hypot(event.x - self._pressed_at[0], event.y - self._pressed_at[1]) > CLICK
        if not self._dragged:
            if not far:
                return
            self._dragged = True
            dx, dy = event.x - self._pressed_at[0], event.y - self._pressed_at[1]
        state, height = self._viewer.state, self._viewer.window.extent[1]
        how = {"orbit": control.orbit, "pan": control.pan, "turn": control.turn}[self._mode]
        state.move(how(state.hold(), dx, dy, height))

    def _press(self, event: Button) -> None:
        if event.down and self._button is None:
            self._button, self._pressed_at, self._dragged = event.button, self._at, False
            self._mode = {0: "pan" if event.shift else "orbit", 1: "turn", 2: "pan"}.get(event.button, "orbit")
        elif not event.down and event.button == self._button:
            clicked = not self._dragged and self._button == 0
            self._button, self._pressed_at = None, None
            if clicked:
                self._pick()

    def _pick(self) -> None:
        viewer = self._viewer
        viewer.pick = pick = pick_at(viewer, *self._at)
        if pick is not None:
            facts = {"distance": pick.distance, "material": pick.material, "evaluations": pick.evaluations}
            position = [float(v) for v in pick.position]
            viewer.log.say("pick", pixel=pick.pixel, position=position, normal=pick.normal.tolist(), **facts)

    def focus(self) -> None:
        """Make the point under the cursor the target of the camera."""
        viewer = self._viewer
        pick = pick_at(viewer, *self._at)
        if pick is None or not np.isfinite(pick.distance):
            viewer.notice("nothing is under the cursor")
            return
        viewer.state.move(control.focus(viewer.state.hold(), pick.position))
        viewer.log.say("focus", point=pick.position.tolist())

    def flying(self) -> tuple[float, float, float]:
        """Speeds forward, right and up from the held keys."""
        window = self._viewer.window
        if window.command_held:
            return 0.0, 0.0, 0.0
        fast = FAST if window.shift_held else 1.0
        pairs = (("w", "s"), ("d", "a"), ("e", "q"))
        forward, right, up = (fast * (window.held(plus) - window.held(minus)) for plus, minus in pairs)
        return forward, right, up

    def _drop(self, event: Drop) -> None:
        scenes = [file for file in event.files if file.suffix == ".py"]
        if not scenes:
            self._viewer.notice("drop a scene file: Python that defines a `scene`")
            return
        self._viewer.reloader.open(scenes[0])
        self._viewer.log.say("dropped", file=str(scenes[0]))
