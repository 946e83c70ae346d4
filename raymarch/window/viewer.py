"""The loop of the window: events, news of the scene file, the next picture, what is laid over it."""

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
from raymarch.window.cards import cards_of
from raymarch.window.control import fly
from raymarch.window.edits import Edits
from raymarch.window.hands import Hands
from raymarch.window.log import Log
from raymarch.window.overlay import Card, Overlay
from raymarch.window.pace import Pace, scaled
from raymarch.window.panel import Panel
from raymarch.window.pick import Inquiry, Pick, picked, ray_through
from raymarch.window.picture import Picture, Shot
from raymarch.window.reload import Failed, Fault, Loaded, Reloader, Started, Watching
from raymarch.window.save import Sequence
from raymarch.window.state import State, opened, read_settings
from raymarch.window.surface import Window
from raymarch.window.toolkit import find as find_imgui

SETTLED = 0.12
"""Seconds without a change after which the picture is refined."""

IDLE = 0.25
"""Seconds between two looks at the world while nothing happens; events end the wait."""

SHORTEST = 1 / 120
"""Seconds that a frame takes at least."""

NOTICED = 4.0
"""Seconds that a notice stays."""


class Viewer:
    """A window that shows a scene file, and follows it.

    Parameters
    ----------
    file : the scene file; it must be good when the window opens.
    size : of the window, in screen coordinates.
    params : values of parameters by name.
    budget : milliseconds that a frame may take while something moves.
    settings : a file that the window saved, to start from.
    log : a file for lines of JSON about what happens.
    samples : rays a pixel that a still picture ends with.
    panel : whether the panel is shown at first, where its extra is installed.

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
    ) -> None:
        scene = load(file)
        self.state: State = opened(file, scene, params or {}, size[0] / size[1])
        if settings is not None:
            self.state.restore(read_settings(settings))
        ready = prepare(self.state.live, size=size)
        self.log = Log(log)
        self.window = Window(size, f"raymarch: {file.name}")
        try:
            self._open(budget, size, samples)
            self.renderer.adopt(self.state.live, ready)
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
        self._wanted: Edits | None = None
        self._evaluated: tuple[Shot, float] | None = None
        imgui = find_imgui()
        self.panel: Panel | None = None if imgui is None else Panel(imgui, self)
        self.hands = Hands(self)
        self.fault: Fault | None = None
        self.pick: Pick | None = None
        self.picks = 0
        self.frames = 0
        self.help = False
        self.sequence: Sequence | None = None
        self._idle = False
        self._rest = 0.0
        self.notices: list[tuple[float, str]] = []
        self._cards: list[Card] = []
        self._changed_at = self._at = clock_time.perf_counter()
        self.reloading: float | None = None
        self.inquiry = Inquiry(window.wake)
        self.reloader = Reloader(self.state.file, window.wake, lambda: dict(self.state.params), size)

    def _first(self) -> None:
        """The first picture, before anything else, so that a scene that cannot be drawn is refused at once."""
        self.state.aspect = self.window.size[0] / max(1, self.window.size[1])
        if not self.state.moved:
            self.state.reset()
        self.picture.step(self.state.shot(), self.window.size, False)
        driver = self.window.context.driver
        self.log.say("open", size=self.window.size, density=self.window.density, renderer=driver.renderer)

    # The loop

    def run(self, seconds: float | None = None) -> int:
        """Show the window until it is closed, or for so long. 0; 2 if the scene is broken then; 130 after Ctrl+C."""
        code = 1
        end = None if seconds is None else clock_time.perf_counter() + seconds
        self.reloader.start()
        try:
            while not self.window.closing and (end is None or clock_time.perf_counter() < end):
                self.turn()
            code = 2 if self.fault is not None else 0
        except KeyboardInterrupt:  # Ctrl+C in the shell
            code = 130
        finally:
            self.log.say("closed", code=code, frames=self.frames, compiled=self.renderer.compiled)
            self.release()
        return code

    def turn(self) -> None:
        """One turn of the loop."""
        events = self.window.wait(self._pause())
        self._idle = self._idle and not events
        self.hands.take(events)
        now = clock_time.perf_counter()
        passed, self._at = now - self._at, now
        self._hear(now)
        state = self.state
        state.timeline = state.timeline.advance(min(passed, 0.25)) if state.animated else state.timeline
        forward, right, upward = self.hands.flying()
        if forward or right or upward:
            state.move(fly(state.hold(), forward, right, upward, min(passed, 0.1)))
        if self._wanted is not None:
            self._change(self._wanted)
        if self.sequence is not None and not self.sequence.step(self):
            self.sequence = None
        if self.window.size[0] > 0 and self.window.size[1] > 0:
            self._frame(now)

    def _pause(self) -> float:
        """How long to wait for the next event."""
        busy = self.state.animated and self.state.timeline.playing
        if busy or self.hands.busy or self.sequence is not None or not self.picture.whole:
            return max(0.0, SHORTEST - (clock_time.perf_counter() - self._at))
        return IDLE

    def _frame(self, now: float) -> None:
        size = self.window.size
        resized = size != self.screen.size
        if resized:
            self.screen.size = size
            self.state.aspect = size[0] / size[1]
            self.log.say("resize", size=size)
        drew = False
        try:
            drew = self.picture.step(self.state.shot(), size, now - self._changed_at > SETTLED)
        except RaymarchError as fault:
            self._trouble(fault)
        if drew and self.picture.drawn.moving:
            self._changed_at = now
        cards = cards_of(self, now)
        live = self.panel is not None and self.panel.busy
        if not (drew or resized or live or cards != self._cards or self.window.take_stale()):
            if self.picture.whole and not self._idle:
                self.log.say("idle")
                self._idle = True
            return
        self._idle = False
        self._cards = cards
        self._present()
        if drew:
            self._tell_frame()

    def _present(self) -> None:
        start = clock_time.perf_counter()
        canvas = self.picture.canvas
        if canvas is not None:
            shown = self.state
            self.screen.show(canvas, shown.scene.tone if shown.view == "final" else None)
        self.overlay.draw(self._cards, self.window.density, 0 if self.panel is None else self.panel.width)
        if self.panel is not None:
            self._draw_panel(self.panel)
        self.window.take_stale()
        rest = 1e3 * (clock_time.perf_counter() - start)
        self.window.swap()
        self._rest = 1e3 * (clock_time.perf_counter() - start)
        self.frames += 1
        self.picture.pace.other(rest)
        if self.panel is not None:
            self.panel.note(self.picture.drawn.milliseconds, rest)

    def _draw_panel(self, panel: Panel) -> None:
        """The panel; a fault of its toolkit costs the panel, not the window."""
        try:
            panel.draw()
        except RuntimeError as fault:
            self.panel = None
            self.notice(f"the panel failed, the window goes on: {fault}")

    def _tell_frame(self) -> None:
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

    # News

    def _hear(self, now: float) -> None:
        """What threads have found out since the last turn."""
        for news in self.reloader.latest():
            if isinstance(news, Started):
                self.reloading = now
                self.log.say("reloading")
            elif isinstance(news, Watching):
                self.log.say("watching", files=news.files)
            elif isinstance(news, Failed):
                self.reloading = None
                self._fail(news.fault)
            else:
                self._swap(news, now)
        found = self.inquiry.latest()
        if found is not None and self.pick is not None and found.number == self.pick.number:
            self.pick = found
            where = found.where
            self.log.say(
                "truth",
                part=found.part,
                file=where.file if where else None,
                line=where.line if where else None,
                distance=found.true,
                trouble=found.trouble,
            )

    def _swap(self, news: Loaded, now: float) -> None:
        """Draw the new scene; only if that works it takes the place of the old one."""
        before = replace(self.state, params=dict(self.state.params))
        compiled = self.renderer.compiled
        try:
            scene = self.edits.apply(news.scene)
            told = self.state.adopt(scene, scene.parameters)
            if scene is news.scene:
                self.renderer.adopt(self.state.live, news.prepared)
            start = clock_time.perf_counter()
            self.picture.step(self.state.shot(), self.screen.size, False)
            first = 1e3 * (clock_time.perf_counter() - start)
        except RaymarchError as fault:
            self.state = before
            self._trouble(fault)
            return
        self.state.file, self.base, self.fault, self.pick = news.file, news.scene, None, None
        self.window.title(f"raymarch: {news.file.name}")
        for text in told:
            self.notice(text)
        compile_ms = self.picture.drawn.compile
        parts = {**news.ms, "compile": compile_ms, "first frame": first - compile_ms}
        total = None if self.reloading is None else 1e3 * (clock_time.perf_counter() - self.reloading)
        self._changed_at, self.reloading = now, None
        self._present()
        self.log.say("loaded", ms=parts, total=total, compiled=self.renderer.compiled - compiled)
        self._tell_frame()

    def edit(self, edits: Edits) -> None:
        """Lay other edits over the scene, in the next turn."""
        self._wanted = edits

    def _change(self, edits: Edits) -> None:
        before, self._wanted = replace(self.state, params=dict(self.state.params)), None
        try:
            scene = edits.apply(self.base)
            self.state.adopt(scene, scene.parameters)
            self.picture.step(self.state.shot(), self.screen.size, False)
        except RaymarchError as fault:
            self.state = before
            self.notice(f"not possible: {fault.what}")
            return
        self.edits, self._changed_at = edits, clock_time.perf_counter()
        lights = None if edits.lights is None else [light.kind for light in edits.lights]
        self.log.say("edited", lights=lights, materials=sorted(edits.materials), quality=edits.quality)
        if self.panel is not None:
            self.panel.active = 3
        self._present()

    def _fail(self, fault: Fault) -> None:
        self.fault = fault
        self.log.say("failed", what=fault.what, legal=fault.legal, file=fault.file, line=fault.line)

    def _trouble(self, fault: RaymarchError) -> None:
        """A scene that loads but cannot be drawn now."""
        where = fault.where
        told = Fault(fault.what, fault.legal, where.file if where else None, where.line if where else None)
        if told != self.fault:
            self._fail(told)

    # What hands and panel ask for

    def notice(self, text: str) -> None:
        """Say something for a few seconds."""
        self.notices.append((clock_time.perf_counter() + NOTICED, text))
        self.log.say("notice", text=text)

    def pick_at(self, x: float, y: float) -> Pick | None:
        """What is at a place of the cursor; its truth follows when it is known."""
        size = self.window.size
        column, row = (int(v) for v in self.window.pixel(x, y))
        if not (0 <= column < size[0] and 0 <= row < size[1]):
            return None
        try:
            shot, values = self.state.shot(), self.state.values
            texels = self.picture.probe(shot, size, column, row)
        except RaymarchError as fault:
            self._trouble(fault)
            return None
        view = self.state.hold()
        ray = ray_through(view, (column, row), size)
        self.picks += 1
        pick = picked(self.picks, (column, row), texels, view.position, ray)
        self.inquiry.ask(pick, shot, values, view.position, ray)
        return pick

    def mark(self, name: str) -> None:
        """Remember where the panel's last item is."""
        if self.panel is not None:
            self.panel.mark(name)

    def evaluations(self) -> float | None:
        """Mean evaluations of a pixel in the whole picture, from one of a quarter of its size; None while it moves."""
        if not self.picture.whole:
            return None
        shot = self.state.shot()
        if self._evaluated is None or not shot.same(self._evaluated[0]):
            renderer = self.picture.at(scaled(self.window.size, 0.25))
            made = renderer.render(shot.scene, shot.time, shot.params, ("evaluations",), pose=shot.pose)
            self._evaluated = (shot, float(made.evaluations.mean()))
        return self._evaluated[1]

    def plan(self) -> Plan:
        """The plan of what is shown."""
        return self.renderer.prepared(self.state.live).plan

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
