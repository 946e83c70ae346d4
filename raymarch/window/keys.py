"""Key bindings: the commands of keys, and their help."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from raymarch.window import commands as do
from raymarch.window.events import Key
from raymarch.window.model import Model


@dataclass(frozen=True, slots=True)
class Binding:
    """A key, its label and help, and its command; `shift` (None: either) and `control` must match."""

    key: str
    label: str
    help: str
    command: Callable[[Model], None]
    shift: bool | None = False
    control: bool = False


def _scrub_to_start(model: Model) -> None:
    do.change_time(model, lambda line: line.scrub(0.0))


BINDINGS = (
    Binding("r", "R", "reset to the scene's camera", do.reset_camera),
    Binding("c", "C", "copy the camera as Python", do.copy_camera),
    Binding("v", "V", "next view: final, depth, normal, ...", partial(do.next_view, step=1)),
    Binding("v", "Shift+V", "previous view", partial(do.next_view, step=-1), shift=True),
    Binding("x", "X", "more exact, slower", partial(do.change_accuracy, step=1)),
    Binding("x", "Shift+X", "less exact, faster", partial(do.change_accuracy, step=-1), shift=True),
    Binding(
        "k", "K", "split the picture: beside the most exact, beside the reference, off", partial(do.next_side, step=1)
    ),
    Binding("k", "", "", partial(do.next_side, step=-1), shift=True),
    Binding("o", "O", "errors against the reference over the picture", do.toggle_errors),
    Binding("space", "Space", "play or pause", lambda m: do.change_time(m, lambda line: line.toggle())),
    Binding(".", ". ,", "one frame on, one back", lambda m: do.change_time(m, lambda line: line.step(1))),
    Binding(",", "", "", lambda m: do.change_time(m, lambda line: line.step(-1))),
    Binding("home", "Home", "time 0", _scrub_to_start),
    Binding("l", "L", "loop from 0 to the current time; again: no loop", do.toggle_loop),
    Binding("n", "N, arrows", "next parameter; change it", partial(do.select_param, step=1)),
    Binding("n", "", "", partial(do.select_param, step=-1), shift=True),
    Binding("down", "", "", partial(do.select_param, step=1), shift=None),
    Binding("up", "", "", partial(do.select_param, step=-1), shift=None),
    *(
        Binding(key, "", "", partial(do.nudge_param, direction=direction, fine=fine), shift=fine)
        for key, direction in (("right", 1), ("left", -1))
        for fine in (False, True)
    ),
    Binding("p", "P", "save a PNG", do.save_picture),
    Binding("p", "Shift+P", "save the loop (or 2 seconds) as a sequence of PNGs", do.save_sequence, shift=True),
    Binding("s", "Ctrl+S", "save camera, parameters, time and view", do.save_settings, control=True),
    Binding("f5", "F5", "reload the scene file", do.reload),
    Binding("escape", "Esc", "stop a scene file that does not end; close messages", do.escape),
    Binding("tab", "Tab", "the panel, on and off", do.toggle_panel),
    Binding("h", "H, F1", "this help", do.toggle_help),
    Binding("f1", "", "", do.toggle_help),
    Binding("q", "Ctrl+Q", "quit", do.close, control=True),
)


def press(model: Model, event: Key) -> None:
    """Run the command of a pressed key."""
    model.say("key", name=event.name)
    for binding in BINDINGS:
        fits = binding.key == event.name and binding.control == event.control
        if fits and binding.shift in (None, event.shift):
            binding.command(model)
            return


def help_text() -> str:
    """The help text of mouse and keys."""
    rows = [
        ("drag", "orbit; Shift or the middle button: pan; the right button: rotate the view"),
        ("wheel", "nearer, farther"),
        ("W A S D Q E", "fly; Shift: faster"),
        ("click", "inspect a point: line, position, normal, distance, cost, reference"),
        ("F", "orbit the point under the cursor"),
        *((b.label, b.help) for b in BINDINGS if b.label),
    ]
    return "\n".join(f"{key}\t{text}" for key, text in rows)
