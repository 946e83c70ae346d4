"""The main loop of the window: events, reloads, the next picture, panel and messages."""

from __future__ import annotations

import time as clock_time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from raymarch.errors import RaymarchError
from raymarch.gpu.prepare import prepare
from raymarch.gpu.renderer import Renderer
from raymarch.gpu.screen import Screen
from raymarch.plan import Plan
from raymarch.scene.file import load
from raymarch.scene.scene import Scene
from raymarch.window.accuracy import Stop, preset_stops
from raymarch.window.changes import change, take_news, titled, trouble
from raymarch.window.constants import Constants
from raymarch.window.control import fly
from raymarch.window.edits import Edits
from raymarch.window.input import Input
from raymarch.window.interrupt import Interrupt
from raymarch.window.keys import Keys
from raymarch.window.log import Log
from raymarch.window.messages import messages_of
from raymarch.window.overlay import Message, Overlay
from raymarch.window.pace import Pace
from raymarch.window.panel import Panel
from raymarch.window.pick import Inquiry, Pick
from raymarch.window.picture import Picture, Shot
from raymarch.window.reload import Fault, Reloader
from raymarch.window.save import Sequence
from raymarch.window.state import State, opened, read_settings
from raymarch.window.surface import Window
from raymarch.window.toolkit import find as find_imgui

SETTLED = 0.12
"""Seconds without a change before the picture is refined."""

IDLE = 0.25
"""Maximum wait for events in seconds while nothing happens."""

SHORTEST = 1 / 120
"""Minimum duration of a frame in seconds."""

NOTICED = 4.0
"""Duration of a notice in seconds."""


class Viewer:
    """A window that shows a scene file and reloads it on changes.

    Parameters
    ----------
    file : the scene file; it must be valid when the window opens.
    size : of the window, in screen coordinates.
    params : values of parameters by name.
    budget : maximum frame time in milliseconds while something moves.
    settings : a file of saved settings to start with.
    log : a file for events as lines of JSON.
    samples : rays per pixel of a still picture.
    panel : whether the panel is visible at the start, if its extra is installed.
    stops : the settings between fast and exact; none are the presets.

    Raises SceneError, PlanError, ShaderError for a scene that cannot be shown, DeviceError without a display.
    """

    def __init__(
        self,
        file: Path,
        size: tuple[int, int] = (960, 540),
        params: Mapping[str, Any] | None = None,
        budget: float = 33.0,
        settings: Path | None = None,
        log: Path | None = None,
        samples: int = 16,
        panel: bool = True,
        stops: tuple[Stop, ...] = (),
    ) -> None:
        scene = load(file)
        self.stops = stops or preset_stops()
        self.state: State = opened(file, scene, params or {}, size[0] / size[1])
        if settings is not None:
            self.state.restore(read_settings(settings))
        self.constants, self.clicks, self.overlaid = Constants(), Constants(), Constants()
        ready, _ = self.constants.fit(prepare(self.state.progressive, size=size))
        self.log = Log(log)
        self.window = Window(size, titled(file))
        try:
            self._open(budget, size, samples)
            self.renderer.adopt(self.state.progressive, ready)
            if self.panel is not None:
                self.panel.shown = panel
            self._first()
        except BaseException:
            self.window.release()
            raise

    def _open(self, budget: float, size: tuple[int, int], samples: int) -> None:
        window = self.window
        self.screen = Screen(window.context, window.size)
        self.renderer = Renderer(window.size, context=window.context)
        self.renderer.planned_for = size
        self.picture = Picture(self.renderer, self.screen, Pace(budget), samples)
        self.overlay = Overlay(self.screen)
        self.base: Scene = self.state.scene
        self.edits = Edits()
        self.wanted: Edits | None = None
        self.evaluated: tuple[Shot, float] | None = None
        imgui = find_imgui()
        self.panel: Panel | None = None if imgui is None else Panel(imgui, self)
        self.keys = Keys(self)
        self.input = Input(self)
        self.fault: Fault | None = None
        self.pick: Pick | None = None
        self.picks = 0
        self.clicked: Scene | None = None
        self.frames = 0
        self.help = False
        self.sequence: Sequence | None = None
        self._idle = False
        self._unshown = 1  # frames that must be shown, whatever they hold
        self._rest = 0.0
        self.notices: list[tuple[float, str]] = []
        self._messages: list[Message] = []
        self.changed_at = self._at = clock_time.perf_counter()
        self.reloading: float | None = None
        self.inquiry = Inquiry(window.wake)
        self.reloader = Reloader(
            self.state.file, window.wake, lambda: dict(self.state.params), size, self.constants, self.clicks
        )

    def _first(self) -> None:
        """Draw the first picture, so that a scene that cannot be drawn fails at once."""
        self.state.aspect = self.window.size[0] / max(1, self.window.size[1])
        if not self.state.moved:
            self.state.reset()
        self.screen.clear(0.12)  # a driver may compile for seconds
        self.overlay.draw([Message(f"{self.state.file.name}: compiling", "note", "middle")], self.window.density)
        self.window.swap()
        self.picture.step(self.state.shot(), self.window.size, False)
        driver = self.window.context.driver
        self.log.say("open", size=self.window.size, density=self.window.density, renderer=driver.renderer)

    # The loop

    def run(self, seconds: float | None = None) -> int:
        """Run until the window is closed, or for `seconds`. Returns 0; 2 if the scene has an error then; 130 after
        Ctrl+C."""
        code = 1
        end = None if seconds is None else clock_time.perf_counter() + seconds
        self.reloader.start()
        try:
            with Interrupt() as interrupt:
                while not (self.window.closing or interrupt.asked or (end and clock_time.perf_counter() >= end)):
                    self.turn()
            code = 130 if interrupt.asked else 2 if self.fault is not None else 0
        except KeyboardInterrupt:
            code = 130
        finally:
            self.log.say("closed", code=code, frames=self.frames, compiled=self.renderer.compiled)
            self.release()
        return code

    def turn(self) -> None:
        """One turn of the loop."""
        events = self.window.wait(self._pause())
        self._idle = self._idle and not events
        self.input.take(events)
        now = clock_time.perf_counter()
        passed, self._at = now - self._at, now
        take_news(self, now)
        state = self.state
        state.timeline = state.timeline.advance(min(passed, 0.25)) if state.animated else state.timeline
        forward, right, upward = self.input.flying()
        if forward or right or upward:
            state.move(fly(state.hold(), forward, right, upward, min(passed, 0.1)))
        if self.wanted is not None:
            change(self, self.wanted)
        if self.sequence is not None and not self.sequence.step(self):
            self.sequence = None
        if self.window.size[0] > 0 and self.window.size[1] > 0:
            with self.window.context.bound():
                self._frame(now)

    def _pause(self) -> float:
        """How long to wait for the next event."""
        busy = self.state.animated and self.state.timeline.playing
        if busy or self.input.busy or self.sequence is not None or not self.picture.whole:
            return max(0.0, SHORTEST - (clock_time.perf_counter() - self._at))
        return IDLE

    def _frame(self, now: float) -> None:
        size = self.window.size
        resized = size != self.screen.size
        if resized:
            self.screen.size = size
            self.state.aspect = size[0] / size[1]
            self.log.say("resize", size=size)
            self._unshown = 2  # drivers give the window's buffers their new size with the next swap
        drew = False
        try:
            drew = self.picture.step(self.state.shot(), size, now - self.changed_at > SETTLED)
        except RaymarchError as fault:
            trouble(self, fault)
        if drew and self.picture.drawn.moving:
            self.changed_at = now
        messages = messages_of(self, now)
        live = self.panel is not None and self.panel.busy
        if not (drew or self._unshown or live or messages != self._messages or self.window.take_stale()):
            if self.picture.whole and not self._idle:
                self.log.say("idle")
                self._idle = True
            return
        self._idle = False
        self._messages = messages
        self.present()
        if drew:
            self.tell_frame()

    def present(self) -> None:
        """Show the canvas with panel and messages."""
        start = clock_time.perf_counter()
        self._lay(self._messages)
        if self.panel is not None:
            self._draw_panel(self.panel)
        self.window.take_stale()
        rest = 1e3 * (clock_time.perf_counter() - start)
        self.window.swap()
        self._unshown = max(self._unshown - 1, 0)
        self._rest = 1e3 * (clock_time.perf_counter() - start)
        self.frames += 1
        self.picture.pace.other(rest)
        if self.panel is not None:
            self.panel.meters.note(self.picture.drawn.milliseconds, rest, self.picture.drawn.compile)

    def announce(self, message: Message) -> None:
        """Show a message at once, before a long operation; the panel is not updated and takes no events."""
        self._lay([*self._messages, message])
        if self.panel is not None and self.panel.shown:
            self.panel.toolkit.paint()
        self.window.swap()

    def _lay(self, messages: list[Message]) -> None:
        canvas = self.picture.canvas
        if canvas is not None:
            shown = self.state
            self.screen.show(canvas, shown.scene.tone if shown.view == "final" else None)
        self.overlay.draw(messages, self.window.density, 0 if self.panel is None else self.panel.width)

    def _draw_panel(self, panel: Panel) -> None:
        """Draw the panel; an error of its toolkit disables the panel, not the window."""
        try:
            panel.draw()
        except RuntimeError as fault:
            self.panel = None
            self.notice(f"the panel failed, the window goes on: {fault}")

    def tell_frame(self) -> None:
        """Log the frame."""
        drawn = self.picture.drawn
        facts = {
            "size": drawn.size,
            "whole": drawn.whole,
            "moving": drawn.moving,
            "samples": drawn.samples,
            "ms": round(drawn.milliseconds, 2),
            "rest": round(self._rest, 2),
        }
        self.log.say("frame", n=self.frames, compiled=self.renderer.compiled, **facts)

    def edit(self, edits: Edits) -> None:
        """Apply edits to the scene, in the next turn."""
        self.wanted = edits

    def approach(self, number: int) -> None:
        """Change to one of the stops between fast and exact."""
        stop = self.stops[number]
        self.edit(replace(self.edits, quality=stop.changes(self.base.quality)))
        self.log.say("stop", name=stop.name, error=stop.error)

    def notice(self, text: str) -> None:
        """Show a notice for a few seconds."""
        self.notices.append((clock_time.perf_counter() + NOTICED, text))
        self.log.say("notice", text=text)

    def mark(self, name: str) -> None:
        """Record the position of the panel's last item."""
        if self.panel is not None:
            self.panel.mark(name)

    def plan(self) -> Plan:
        """The plan of the visible scene."""
        return self.renderer.prepared(self.state.progressive).plan

    def release(self) -> None:
        """Close everything."""
        self.reloader.stop()
        self.inquiry.stop()
        if self.panel is not None:
            self.panel.release()
        self.overlay.release()
        self.picture.release()
        self.renderer.close()
        self.screen.release()
        self.window.release()
        self.log.close()
