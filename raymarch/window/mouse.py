"""Input of the mouse and of held keys: gestures become commands."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from raymarch.window import commands as do
from raymarch.window import control, keys
from raymarch.window.events import Button, Drop, Event, Key, Move, Scroll
from raymarch.window.model import Model

CLICK = 4.0
"""Minimum movement of a drag, in screen coordinates; a shorter one is a click."""

GRIP = 6.0
"""Distance from the divider of a split picture at which it is grasped, in screen coordinates."""

FAST = 4.0
"""Factor of the flying speed with Shift."""

MOVEMENTS = {"orbit": control.orbit, "pan": control.pan, "turn": control.turn}


@dataclass(slots=True)
class Press:
    """A pressed button: where it went down, what it does, and whether it was moved since."""

    button: int
    x: float
    y: float
    gesture: str
    dragged: bool = False


class Mouse:
    """Converts events to commands.

    Parameters
    ----------
    model : what the commands change.
    pixel : converts a cursor position from screen coordinates to pixels.
    extent : the size of the window in screen coordinates.
    """

    def __init__(
        self,
        model: Model,
        pixel: Callable[[float, float], tuple[float, float]] = lambda x, y: (x, y),
        extent: Callable[[], tuple[int, int]] | None = None,
    ) -> None:
        self._model, self._pixel = model, pixel
        self._extent = extent or (lambda: model.size)
        self._at = (0.0, 0.0)
        self._press: Press | None = None

    @property
    def pressed(self) -> bool:
        """True while a button is down that was pressed on the picture."""
        return self._press is not None

    def take(self, event: Event) -> None:
        """Handle an event."""
        if isinstance(event, Move):
            self._move(event.x, event.y)
        elif isinstance(event, Button):
            self._button(event)
        elif isinstance(event, Scroll):
            do.move(self._model, control.dolly, event.y)
        elif isinstance(event, Key) and event.down:
            keys.press(self._model, event)
            if (event.name, event.control) == ("f", False):
                do.inspect(self._model, *self._pixel(*self._at), focus=True)
        elif isinstance(event, Drop):
            do.open_files(self._model, event.files)

    def _move(self, x: float, y: float) -> None:
        press, before, self._at = self._press, self._at, (x, y)
        if press is None:
            return
        if not press.dragged:
            if np.hypot(x - press.x, y - press.y) <= CLICK:
                return
            press.dragged, before = True, (press.x, press.y)
        if press.gesture == "divide":
            do.set_divider(self._model, self._pixel(x, y)[0])
        else:
            movement = MOVEMENTS[press.gesture]
            do.move(self._model, movement, x - before[0], y - before[1], self._extent()[1])

    def _button(self, event: Button) -> None:
        press = self._press
        if event.down and press is None:
            self._press = Press(event.button, *self._at, self._gesture(event))
        elif not event.down and press is not None and event.button == press.button:
            self._press = None
            if not press.dragged and press.button == 0 and press.gesture != "divide":
                do.inspect(self._model, *self._pixel(*self._at))

    def _gesture(self, event: Button) -> str:
        model = self._model
        if event.button == 0 and model.compare.side != "off":
            near = abs(self._pixel(*self._at)[0] - model.divider)
            if near <= self._pixel(GRIP, 0.0)[0]:
                return "divide"
        return {0: "pan" if event.shift else "orbit", 1: "turn", 2: "pan"}.get(event.button, "orbit")


def flying(held: Callable[[str], bool], shift: bool, command: bool) -> tuple[float, float, float]:
    """Speeds forward, right and up from the held keys; none with Control, Alt or the system key."""
    if command:
        return 0.0, 0.0, 0.0
    pairs = (("w", "s"), ("d", "a"), ("e", "q"))
    forward, right, up = ((FAST if shift else 1.0) * (held(plus) - held(minus)) for plus, minus in pairs)
    return forward, right, up
