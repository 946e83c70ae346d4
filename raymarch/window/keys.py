"""Key bindings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from raymarch.gpu.views import VIEWS
from raymarch.window import control, save
from raymarch.window.accuracy import next_stop
from raymarch.window.state import shown
from raymarch.window.surface import Key
from raymarch.window.toolkit import HINT

if TYPE_CHECKING:
    from raymarch.window.viewer import Viewer

STEP = 0.02
"""Step of an arrow key as a fraction of the parameter's range; a tenth of it with Shift."""


@dataclass(frozen=True, slots=True)
class Binding:
    """A key, its label and help, and its action; `shift` and `control` must match."""

    key: str
    label: str
    help: str
    act: Callable[[], None]
    shift: bool | None = False
    control: bool = False


class Keys:
    """Converts keys to commands and parameter changes."""

    def __init__(self, viewer: Viewer) -> None:
        self._viewer = viewer
        self._bindings = self._all()

    def press(self, event: Key) -> None:
        """Run the action of a pressed key."""
        self._viewer.log.say("key", name=event.name)
        for binding in self._bindings:
            fits = binding.key == event.name and binding.control == event.control
            if fits and binding.shift in (None, event.shift):
                binding.act()
                return
        if event.name in ("left", "right", "up", "down"):
            self._arrow(event)

    def _all(self) -> list[Binding]:
        v = self._viewer
        return [
            Binding("f", "F", "orbit the point under the cursor", lambda: v.input.focus()),
            Binding("r", "R", "reset to the scene's camera", self._reset),
            Binding("c", "C", "copy the camera as Python", self.copy),
            Binding("v", "V", "next view: final, depth, normal, ...", lambda: self._view(1)),
            Binding("v", "Shift+V", "previous view", lambda: self._view(-1), shift=True),
            Binding("x", "X", "more exact, slower", lambda: self._approach(1)),
            Binding("x", "Shift+X", "less exact, faster", lambda: self._approach(-1), shift=True),
            Binding("space", "Space", "play or pause", self._toggle),
            Binding(".", ". ,", "one frame on, one back", lambda: self._step(1)),
            Binding(",", "", "", lambda: self._step(-1)),
            Binding("home", "Home", "time 0", lambda: self._scrub(0.0)),
            Binding("l", "L", "loop from 0 to the current time; again: no loop", self._loop),
            Binding("n", "N, arrows", "next parameter; change it", lambda: self._select(1)),
            Binding("n", "", "", lambda: self._select(-1), shift=True),
            Binding("p", "P", "save a PNG", lambda: save.still(v)),
            Binding(
                "p", "Shift+P", "save the loop (or 2 seconds) as a sequence of PNGs", lambda: save.begin(v), shift=True
            ),
            Binding("s", "Ctrl+S", "save camera, parameters, time and view", lambda: save.settings(v), control=True),
            Binding("f5", "F5", "reload the scene file", lambda: v.reloader.reload()),
            Binding("escape", "Esc", "stop a scene file that does not end; close messages", self._escape),
            Binding("tab", "Tab", "the panel, on and off", self._panel),
            Binding("h", "H, F1", "this help", self._help),
            Binding("f1", "", "", self._help),
            Binding("q", "Ctrl+Q", "quit", lambda: v.window.close(), control=True),
        ]

    def help(self) -> str:
        """The help text of all keys."""
        rows = [
            ("drag", "orbit; Shift or the middle button: pan; the right button: rotate the view"),
            ("wheel", "nearer, farther"),
            ("W A S D Q E", "fly; Shift: faster"),
            ("click", "inspect a point: line, position, normal, distance, cost, reference"),
            *((b.label, b.help) for b in self._bindings if b.label),
        ]
        return "\n".join(f"{key}\t{text}" for key, text in rows)

    def parameters(self) -> str:
        """The parameters with values and ranges; the selected one is marked."""
        state = self._viewer.state
        lines = []
        for name, spec in state.specs.items():
            mark = ">" if name == state.selected else " "
            lines.append(f"{mark} {name} = {shown(state.value(name))}  ({spec.legal})")
        return "\n".join(lines)

    def _reset(self) -> None:
        self._viewer.state.reset()

    def copy(self) -> None:
        """Copy the camera as a line of Python to the clipboard."""
        line = control.as_python(self._viewer.state.hold())
        self._viewer.window.clip(line)
        self._viewer.notice(f"copied {line}")

    def _view(self, step: int) -> None:
        state, names = self._viewer.state, list(VIEWS)
        state.view = names[(names.index(state.view) + step) % len(names)]
        self._viewer.notice(f"view: {state.view}")

    def _approach(self, step: int) -> None:
        viewer = self._viewer
        number = next_stop(viewer.stops, viewer.state.scene.quality, step)
        viewer.approach(number)
        viewer.notice(viewer.stops[number].words)

    def _toggle(self) -> None:
        state = self._viewer.state
        state.timeline = state.timeline.toggle()
        self._show_time()

    def _step(self, frames: int) -> None:
        state = self._viewer.state
        state.timeline = state.timeline.step(frames)
        self._show_time()

    def _scrub(self, time: float) -> None:
        state = self._viewer.state
        state.timeline = state.timeline.scrub(time)
        self._show_time()

    def _loop(self) -> None:
        state = self._viewer.state
        now = state.timeline.time
        loop = None if state.timeline.loop is not None or now <= 0 else (0.0, now)
        state.timeline = state.timeline.looping(loop)
        self._viewer.notice("no loop" if loop is None else f"loop: 0 to {now:.3g} s")

    def _show_time(self) -> None:
        timeline = self._viewer.state.timeline
        self._viewer.log.say("time", time=timeline.time, playing=timeline.playing)
        if not self._viewer.state.animated:
            self._viewer.notice("this scene does not depend on time")

    def _select(self, step: int) -> None:
        state = self._viewer.state
        names = list(state.specs)
        if not names:
            self._viewer.notice("this scene has no Param")
            return
        at = -1 if state.selected is None else names.index(state.selected)
        at = at + step if state.selected is not None or step > 0 else len(names) - 1
        state.selected = names[at] if 0 <= at < len(names) else None

    def _arrow(self, event: Key) -> None:
        state = self._viewer.state
        if event.name in ("up", "down"):
            self._select(1 if event.name == "down" else -1)
            return
        if state.selected is None:
            return
        spec, value = state.specs[state.selected], np.asarray(state.value(state.selected), np.float64)
        low, high = (np.nan if end is None else np.asarray(end, np.float64) for end in (spec.min, spec.max))
        span = np.where(np.isfinite(high - low), high - low, np.maximum(np.abs(value), 1.0))
        share = STEP * (0.1 if event.shift else 1.0) * (1 if event.name == "right" else -1)
        moved = value + share * span
        state.set(state.selected, float(moved) if moved.shape == () else tuple(float(v) for v in moved))
        self._viewer.log.say("param", name=state.selected, value=state.value(state.selected))

    def _escape(self) -> None:
        viewer = self._viewer
        if viewer.reloader.busy_since is not None:
            viewer.reloader.interrupt()
        if viewer.sequence is not None:
            viewer.notice(f"stopped after {viewer.sequence.done} pictures")
            viewer.sequence = None
        viewer.pick, viewer.help, viewer.state.selected = None, False, None

    def _panel(self) -> None:
        panel = self._viewer.panel
        if panel is None:
            self._viewer.notice(HINT)
        else:
            panel.toggle()
            self._viewer.log.say("panel", shown=panel.shown)

    def _help(self) -> None:
        self._viewer.help = not self._viewer.help
