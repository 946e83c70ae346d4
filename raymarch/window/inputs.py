"""Input: keys and gestures of the mouse become commands; the help of the keys."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from raymarch.window import commands as do
from raymarch.window import control
from raymarch.window.events import Button, Drop, Event, Key, Move, Scroll
from raymarch.window.model import FullScreen, Model

CLICK = 4.0
"""Minimum movement of a drag, in screen coordinates; a shorter one is a click."""

GRIP = 6.0
"""Distance from the divider of a split picture at which it is grasped, in screen coordinates."""

FAST = 4.0
"""Factor of the flying speed with Shift."""

MOVEMENTS = {"orbit": control.orbit, "pan": control.pan, "turn": control.turn}


@dataclass(frozen=True, slots=True)
class Binding:
    """A key, its label and help, and its command; `shift` (None: either) and `control` must match. `group` is that of
    the help."""

    key: str
    label: str
    help: str
    command: Callable[[Model], None]
    shift: bool | None = False
    control: bool = False
    group: str = "View"


def _group(name: str, *bindings: Binding) -> tuple[Binding, ...]:
    return tuple(replace(binding, group=name) for binding in bindings)


def _nudges() -> list[Binding]:
    return [
        Binding(key, "", "", partial(do.nudge_param, direction=direction, fine=fine), shift=fine)
        for key, direction in (("right", 1), ("left", -1))
        for fine in (False, True)
    ]


BINDINGS = (
    *_group(
        "Camera",
        Binding("r", "R", "reset to the scene's camera", do.reset_camera),
        Binding("c", "C", "copy the camera as Python", do.copy_camera),
    ),
    *_group(
        "View",
        Binding("v", "V", "next view: depth, normal, ...; Shift: previous", partial(do.next_view, step=1)),
        Binding("v", "", "", partial(do.next_view, step=-1), shift=True),
        Binding("x", "X", "more exact, slower; Shift: faster", partial(do.change_accuracy, step=1)),
        Binding("x", "", "", partial(do.change_accuracy, step=-1), shift=True),
        Binding("k", "K", "compare: most exact, reference, off", partial(do.next_side, step=1)),
        Binding("k", "", "", partial(do.next_side, step=-1), shift=True),
        Binding("o", "O", "errors against the reference", partial(do.toggle_over, what="errors")),
        Binding("t", "T", "proof of each hit", partial(do.toggle_over, what="proof")),
        Binding("tab", "Tab", "panel on, off; Shift: narrow, wide", do.toggle_panel),
        Binding("tab", "", "", do.toggle_width, shift=True),
        Binding("f11", "F11", "full screen", lambda m: m.request(FullScreen())),
        Binding("escape", "Esc", "close messages; stop a file without end", do.escape),
        Binding("h", "H, F1", "this help", do.toggle_help),
        Binding("f1", "", "", do.toggle_help),
    ),
    *_group(
        "Time and parameters",
        Binding("space", "Space", "play or pause", lambda m: do.change_time(m, lambda line: line.toggle())),
        Binding(".", ". ,", "one frame on, one back", lambda m: do.change_time(m, lambda line: line.step(1))),
        Binding(",", "", "", lambda m: do.change_time(m, lambda line: line.step(-1))),
        Binding("home", "Home", "time 0", lambda m: do.change_time(m, lambda line: line.scrub(0.0))),
        Binding("l", "L", "loop from 0 to now, or no loop", do.toggle_loop),
        Binding("n", "N, arrows", "next parameter; change it", partial(do.select_param, step=1)),
        Binding("n", "", "", partial(do.select_param, step=-1), shift=True),
        Binding("down", "", "", partial(do.select_param, step=1), shift=None),
        Binding("up", "", "", partial(do.select_param, step=-1), shift=None),
        *_nudges(),
        Binding("z", "Ctrl+Z", "undo values; Ctrl+Shift+Z: redo", do.undo, control=True),
        Binding("z", "", "", do.redo, shift=True, control=True),
        Binding("y", "", "", do.redo, control=True),
    ),
    *_group(
        "File",
        Binding("f2", "F2", "write changed values into the file", do.write_values),
        Binding("g", "G", "line of error or point in the editor", do.open_editor),
        Binding("f5", "F5", "reload the scene file", do.reload),
        Binding("p", "P", "save a PNG", do.save_picture),
        Binding("p", "Shift+P", "loop, or 2 seconds, as PNGs", do.save_sequence, shift=True),
        Binding("p", "Ctrl+P", "loop, or 2 seconds, as a film", do.save_film, control=True),
        Binding("s", "Ctrl+S", "settings: camera, values, time, view", do.save_settings, control=True),
        Binding("q", "Ctrl+Q", "quit", do.close, control=True),
    ),
)

MOUSE = (
    ("drag", "orbit; Shift: pan; right button: look"),
    ("wheel", "nearer, farther"),
    ("W A S D Q E", "fly; Shift: faster"),
    ("click", "inspect a point: line, normal, cost, ..."),
    ("F", "orbit the point under the cursor"),
)


def press(model: Model, event: Key) -> None:
    model.say("key", name=event.name)
    for binding in BINDINGS:
        fits = binding.key == event.name and binding.control == event.control
        if fits and binding.shift in (None, event.shift):
            binding.command(model)
            return


def help_text() -> str:
    """The help text of mouse and keys, in groups."""
    lines = []
    for group in dict.fromkeys(binding.group for binding in BINDINGS):
        rows = [*(MOUSE if group == "Camera" else ()), *((b.label, b.help) for b in BINDINGS if b.group == group)]
        lines += [group, *(f"{key}\t{text}" for key, text in rows if key), ""]
    return "\n".join(lines[:-1])


# The mouse


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
        self.plain: set[int] = set()
        """The codes of the keys that are down, and were pressed on the picture without a modifier other than Shift."""

    @property
    def pressed(self) -> bool:
        """True while a button is down that was pressed on the picture."""
        return self._press is not None

    def take(self, event: Event) -> None:
        if isinstance(event, Move):
            self._move(event.x, event.y)
        elif isinstance(event, Button):
            self._button(event)
        elif isinstance(event, Scroll):
            do.move(self._model, control.dolly, event.y)
        elif isinstance(event, Key):
            self._key(event)
        elif isinstance(event, Drop):
            do.open_files(self._model, event.files)

    def _key(self, event: Key) -> None:
        if not event.down:
            self.plain.discard(event.code)
            return
        if event.plain:
            self.plain.add(event.code)
        press(self._model, event)
        if (event.name, event.control) == ("f", False):
            do.inspect(self._model, *self._pixel(*self._at), focus=True)

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


def flying(held: Callable[[str], bool]) -> tuple[float, float, float]:
    """Speeds forward, right and up from the held keys, named as in glfw; none with Control, Alt or the system key."""
    sides = ("left", "right")
    if any(held(f"{side}_{key}") for side in sides for key in ("control", "alt", "super")):
        return 0.0, 0.0, 0.0
    speed = FAST if any(held(f"{side}_shift") for side in sides) else 1.0
    pairs = (("w", "s"), ("d", "a"), ("e", "q"))
    forward, right, up = (speed * (held(plus) - held(minus)) for plus, minus in pairs)
    return forward, right, up
