"""The main loop of the window: events become commands, views draw the model, requests are carried out."""

from __future__ import annotations

import time as clock_time
from collections import deque
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from raymarch.errors import RaymarchError, SceneError
from raymarch.files import read_json, reading, recorded, written
from raymarch.gpu.prepare import prepare
from raymarch.gpu.renderer import Renderer
from raymarch.gpu.screen import Screen
from raymarch.gpu.views import VIEWS
from raymarch.gpu.views import picture as picture_of
from raymarch.scene.file import load
from raymarch.scene.studio import staged
from raymarch.window import commands as do
from raymarch.window import control, editor, toolkit
from raymarch.window.accuracy import Stop, preset_stops
from raymarch.window.comparison import Comparison
from raymarch.window.constants import CLICKED, Constants
from raymarch.window.edits import Edits
from raymarch.window.events import Button, Drop, Event, Key
from raymarch.window.filming import filmed
from raymarch.window.inputs import Mouse, flying
from raymarch.window.interruption import Interruption
from raymarch.window.memory import recall, remember
from raymarch.window.messages import Message, messages_of, status
from raymarch.window.model import (
    Close,
    Copy,
    Edit,
    FullScreen,
    Inspect,
    Interrupt,
    Log,
    Measure,
    Model,
    Open,
    Request,
    SavePicture,
    Show,
    WriteFilm,
)
from raymarch.window.news import Fault, noted
from raymarch.window.outside import Outside
from raymarch.window.overlay import Bar, Item, Mark, Overlay
from raymarch.window.pace import Pace, scaled
from raymarch.window.panel import Panel
from raymarch.window.pick import Inquiry, picked
from raymarch.window.picture import Picture
from raymarch.window.reload import Reloader
from raymarch.window.shot import preview
from raymarch.window.state import SAVED_SETTINGS, opened
from raymarch.window.surface import Window

SETTLED = 0.12
"""Seconds without a change before the picture is refined."""

IDLE = 0.25
"""Maximum wait for events in seconds while nothing happens."""

SHORTEST = 1 / 120
"""Minimum duration of a frame in seconds."""

HINTED = 10.0
"""Seconds for which the window says how to get help, unless something is pressed."""

TITLED = 0.25
"""Seconds between two changes of the title while pictures change."""


class Viewer:
    """A window that shows a scene file and reloads it on changes.

    file : the scene file; it must be valid when the window opens.
    size : of the window, in screen coordinates.
    params : values of parameters by name.
    budget : maximum frame time in milliseconds while something moves.
    settings : a file of saved settings to start with.
    log : a file for events as lines of JSON.
    samples : rays per pixel of a still picture.
    panel : whether the panel is visible at the start, if its extra is installed.
    stops : the settings between fast and exact; none are the presets.
    time : of the scene at the start, in seconds; None is that of the settings, or 0.
    outside : where values of parameters come from.
    quality : a preset, in place of the scene's quality.

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
        time: float | None = None,
        outside: Outside | None = None,
        quality: str | None = None,
    ) -> None:
        with recorded() as self._read, noted() as words:
            scene = staged(load(file))
        chosen = [stop.changes(scene.quality) for stop in preset_stops() if stop.name == quality]
        edits = Edits(quality=chosen[0]) if chosen else None
        state = opened(file, scene, params or {}, size[0] / size[1], edits)
        if settings is not None:
            saved = read_json("--settings", settings, SAVED_SETTINGS)
            with reading("--settings", settings, SAVED_SETTINGS):
                state.restore(saved)
        if time is not None:
            state.timeline = state.timeline.scrub(time)
        self._outside = outside
        self.model = Model(state, budget, samples, stops or preset_stops(), size=size)
        self._constants, self._clicks, self._edited = Constants(), Constants(), Constants()
        self.model.log = Log(log)
        do.warn(self.model, words)
        rough = preview(state.progressive)
        self.window = Window(size, _title(file))
        try:
            self._open(size, panel)
            device = self.renderer.resources.device
            ready = prepare(rough or state.progressive, size=size, device=device)
            if rough is None:
                ready, _ = self._constants.fit(ready)
            else:  # a trial compiles the scene itself
                self.picture.compiling, rough = state.progressive, self.picture.preview_of(state.progressive)
            self.renderer.adopt(rough or state.progressive, ready)
            self._first()
        except BaseException:
            self.window.release()
            raise

    def _open(self, size: tuple[int, int], panel: bool) -> None:
        window, model = self.window, self.model
        model.size, model.density = window.size, window.density
        model.driver = window.context.driver.renderer
        self.screen = Screen(window.context, window.size)
        self.renderer = Renderer(window.size, context=window.context)
        self.renderer.planned_for = size
        self.picture = Picture(self.renderer, self.screen, Pace(model.budget), model.samples)
        self._comparison = Comparison(self.picture, self.renderer, self.screen, window.wake)
        self._overlay = Overlay(self.screen)
        self._toolkit: toolkit.Toolkit | None = None
        self._panel: Panel | None = None
        if toolkit.installed():
            model.panel = panel
            model.narrow, model.opened = recall()
        if self._outside is not None:
            self._outside.wake = window.wake
        self._mouse = Mouse(model, window.pixel, lambda: window.extent)
        self._clicked: Any = None
        self._picks = self._frames = 0
        self._live = 2  # frames in which the panel must be drawn: a change shows in the frame after the next
        self._unshown = 1  # frames that must be shown, whatever they hold
        self._idle = False
        self._messages: list[Item] = []
        self._ends: deque[float] = deque(maxlen=16)
        self._titled = 0.0
        self._at = clock_time.perf_counter()
        self._inquiry = Inquiry(window.wake)
        self.reloader = Reloader(
            model.state.file,
            window.wake,
            lambda: dict(model.state.params),
            size,
            self._constants,
            self._clicks,
            window.context.driver.device_class,
        )

    def _first(self) -> None:
        """Show the first picture, so that a scene that cannot be drawn fails at once. The panel follows, whose toolkit
        takes long to import."""
        model = self.model
        self._measure_window()
        if not model.state.moved:
            model.state.reset()
        self.screen.clear(0.12)  # a driver may compile for seconds
        self._announce(f"{model.state.file.name}: compiling", "note", "middle")
        self.picture.step(model.state.shot(), model.area, False)
        model.hint = clock_time.perf_counter() + HINTED
        model.say("open", size=self.window.size, density=self.window.density, renderer=model.driver)
        self._report()
        self._present()
        self._tell_frame()
        self._open_panel()

    def _open_panel(self) -> None:
        found = None if self.model.panel is None else toolkit.find()
        if found is None:
            self.model.panel = None
        else:
            self._toolkit = toolkit.Toolkit(found, self.window, self.screen)
            self._panel, self._live = Panel(found.imgui, self.model), 2

    def run(self, seconds: float | None = None) -> int:
        """Run until the window is closed, or for `seconds`. Returns 0; 2 if the scene has an error then; 130 after
        Ctrl+C."""
        code = 1
        end = None if seconds is None else clock_time.perf_counter() + seconds
        self.reloader.start(self.model.state.base, self._read, compile=self.picture.compiling is not None)
        try:
            with Interruption() as interrupt:
                while not (self.window.closing or interrupt.asked or (end and clock_time.perf_counter() >= end)):
                    self.turn()
            code = 130 if interrupt.asked else 2 if self.model.fault is not None else 0
        except KeyboardInterrupt:
            code = 130
        finally:
            self.model.say("closed", code=code, frames=self._frames, compiled=self.renderer.compiled)
            self.release()
        return code

    def turn(self) -> None:
        """One turn of the loop."""
        model, events = self.model, self.window.wait(self._pause())
        self._idle = self._idle and not events
        for event in events:
            self._take(event)
            self._carry_out_all()
        now = clock_time.perf_counter()
        passed, self._at = now - self._at, now
        for news in self.reloader.latest():
            do.take_news(model, news)
        for found in self._inquiry.latest():
            do.take_truth(model, found)
        if self._outside is not None:
            self._outside.take(model)
        do.advance(model, min(passed, 0.25))
        if any(speeds := self._speeds()):
            do.move(model, control.fly, *speeds, min(passed, 0.1))
        do.continue_sequence(model)
        self._carry_out_all()
        if self.window.size[0] > 0 and self.window.size[1] > 0:
            with self.window.context.bound():
                self._frame(now)

    def _take(self, event: Event) -> None:
        self._live = 3
        if isinstance(event, Key | Button) and event.down:
            self.model.hint = 0.0
        taken = self._toolkit is not None and not isinstance(event, Drop) and self._toolkit.take(event, self.model)
        if not taken or self._mouse.pressed:
            self._mouse.take(event)

    def _speeds(self) -> tuple[float, float, float]:
        """The speeds of the flight by the keys that were pressed for it: not in a field of text, nor with Control."""
        window, plain = self.window, self._mouse.plain
        return flying(lambda name: window.held(name) and (len(name) > 1 or window.code(name) in plain))

    def _pause(self) -> float:
        """How long to wait for the next event."""
        model, line = self.model, self.model.state.timeline
        busy = (model.state.animated and line.playing) or model.sequence is not None or bool(model.requests)
        busy = busy or (bool(model.panel) and self._live > 0 and self.window.size[0] > 0)
        busy = busy or not self.picture.resting or not self._comparison.whole(model) or any(self._speeds())
        return max(0.0, SHORTEST - (clock_time.perf_counter() - self._at)) if busy else IDLE

    def _measure_window(self) -> None:
        """Note the size of the window and of what the panel leaves free."""
        model, size = self.model, self.window.size
        model.density = self.window.density
        if size != model.size or size != self.screen.size:
            model.size = self.screen.size = size
            model.say("resize", size=size)
            self._unshown = 2  # drivers give the window's buffers their new size with the next swap
        model.state.aspect = model.area[0] / model.area[1]

    def _frame(self, now: float) -> None:
        model = self.model
        self._measure_window()
        self.picture.pace.budget, self.picture.samples = model.frame_budget, model.samples
        drew = False
        try:
            shot, still = model.state.shot(), now - model.changed_at > SETTLED
            drew = self.picture.step(shot, model.area, still)
            also = self._comparison.step(model, shot, still)
        except RaymarchError as fault:
            do.report(model, Fault.of(fault))
            also = False
        if drew and self.picture.drawn.moving:
            model.changed_at = now
        self._report()
        messages = self._over(now)
        live = bool(model.panel) and self._live > 0
        if not (drew or also or self._unshown or live or messages != self._messages or self.window.take_stale()):
            if self.picture.whole and self._comparison.whole(model) and not self._idle:
                model.say("idle")
                self._idle = True
            return
        self._idle = False
        self._messages = messages
        self._present()
        if drew:
            self._tell_frame()

    def _over(self, now: float) -> list[Item]:
        """What is shown over the picture: messages, the bar of colours, the mark of the picked point."""
        model, scale = self.model, self._comparison.scale(self.model)
        found: list[Item] = list(messages_of(model, now))
        if model.help:
            return found
        place = None if model.pick is None else model.pick.place(model.state.shot().pose, model.area)
        return [*([] if place is None else [Mark(*place)]), *found, *([] if scale is None else [Bar(scale)])]

    def _report(self) -> None:
        """Note in the model what was drawn."""
        model, shot = self.model, self.model.state.shot()
        model.drawn, model.frame, model.compiled = self.picture.drawn, self.picture.frame, self.renderer.compiled
        model.preview = self.picture.preview
        if not model.preview:
            model.plan = self.renderer.prepared(shot.scene, VIEWS[shot.view]).plan

    def _present(self) -> None:
        """Show the picture with panel and messages."""
        start = clock_time.perf_counter()
        self._lay(self._messages)
        self.window.take_stale()
        rest = 1e3 * (clock_time.perf_counter() - start)
        self.window.swap()
        self._unshown, self._live = max(self._unshown - 1, 0), max(self._live - 1, 0)
        self._rest = 1e3 * (clock_time.perf_counter() - start)
        self._frames += 1
        self._ends.append(clock_time.perf_counter())
        self.model.rate = (len(self._ends) - 1) / max(self._ends[-1] - self._ends[0], 1e-3)
        self._tell_title()
        self.picture.pace.other(rest)
        self.model.frames.append((self.picture.drawn.milliseconds, rest, self.picture.drawn.compile))

    def _tell_title(self) -> None:
        """Show the frame rate, or how far the picture is refined, in the title."""
        drawn, now = self.picture.drawn, clock_time.perf_counter()
        if drawn.whole or now - self._titled > TITLED:
            self._titled = now
            self.window.title(f"{_title(self.model.state.file)} - {status(self.model)}")

    def _announce(self, text: str, kind: str = "busy", corner: str = "bottom left") -> None:
        """Show a message at once, before a long operation."""
        self._lay([*self._messages, Message(text, kind, corner)])
        self.window.swap()

    def _lay(self, messages: list[Item]) -> None:
        model, canvas = self.model, self.picture.canvas
        left, (width, height) = model.panel_width, model.area
        if canvas is not None:
            tone = model.state.scene.tone if model.state.view == "final" else None
            self.screen.show(canvas, tone, (left, 0, width, height))
            self._comparison.show(model)
        self._overlay.draw(messages, model.density, left, model.divider if model.compare.side != "off" else None)
        if self._toolkit is not None and self._panel is not None and model.panel:
            try:
                self._toolkit.begin()
                self._panel.draw()
                self._live = 3 if self._toolkit.end() else self._live
            except RuntimeError as fault:  # an error of the toolkit disables the panel, not the window
                self._panel, model.panel = None, None
                model.notice(f"the panel failed, the window goes on: {fault}")

    def _tell_frame(self) -> None:
        drawn = self.picture.drawn
        facts = {"size": drawn.size, "whole": drawn.whole, "moving": drawn.moving, "samples": drawn.samples}
        facts |= {"preview": self.picture.preview, "tile": round(self.picture.longest, 2)}
        times = {"ms": round(drawn.milliseconds, 2), "rest": round(self._rest, 2)}
        self.model.say("frame", n=self._frames, compiled=self.renderer.compiled, **facts, **times)

    def _carry_out_all(self) -> None:
        with self.window.context.bound():
            while self.model.requests:
                self._carry_out(self.model.requests.popleft())

    def _carry_out(self, request: Request) -> None:
        model = self.model
        match request:
            case Show():
                self._show(request)
            case Inspect(x, y, focus):
                try:
                    do.take_pick(model, self._pick(x, y), focus)
                except RaymarchError as fault:
                    do.report(model, Fault.of(fault))
            case SavePicture(file, time, pixels, word):
                self._save(file, time, pixels or model.area, word)
            case WriteFilm(folder, file, fps):
                self._announce(f"writing {file}")
                do.saved(model, file, filmed(folder, file, fps))
            case Copy(text):
                self.window.clip(text)
            case Open(file):
                self.reloader.reload() if file is None else self.reloader.open(file)
            case Edit(file, line):
                model.notice(editor.opened(file, line))
            case FullScreen():
                model.full_screen = self.window.toggle_full_screen()
            case Interrupt():
                self.reloader.interrupt()
            case Measure():
                self._measure()
            case Close():
                self.window.close()

    def _show(self, show: Show) -> None:
        """Draw another content, and replace the visible one if that succeeds."""
        model, compiled, start = self.model, self.renderer.compiled, clock_time.perf_counter()
        state, since = show.state, model.trial
        try:
            if show.prepared is not None:
                self.renderer.adopt(state.progressive, show.prepared)
            elif not state.edits.empty:
                self._prepare_edited(state.progressive)
            self.picture.step(state.shot(), model.area, False)
        except RaymarchError as fault:
            do.refuse(model, show, fault)
            return
        first = 1e3 * (clock_time.perf_counter() - start)
        do.accept(model, show)
        self._live = 3
        self._report()
        self._messages = self._over(clock_time.perf_counter())
        if show.loaded is not None:
            self.window.title(_title(show.loaded.file))
        self._present()
        if show.loaded is not None:
            compiling = self.picture.drawn.compile
            parts = {**show.loaded.ms, "compile": compiling, "first frame": first - compiling}
            total = None if since is None else 1e3 * (clock_time.perf_counter() - since[1])
            model.say("loaded", ms=parts, total=total, compiled=self.renderer.compiled - compiled)
            self._tell_frame()

    def _prepare_edited(self, scene: Any) -> None:
        """Prepare a scene with edits. It had no trial, so it is compiled here."""
        ready, _ = self._edited.fit(self.renderer.prepared(scene))
        self.renderer.adopt(scene, ready)
        if not self.renderer.resources.knows(ready):
            self._announce("compiling")

    def _pick(self, x: float, y: float) -> Any:
        """The pick at a position in pixels of the window; its reference values follow later."""
        model, size = self.model, self.model.area
        column, row = int(x - model.panel_width), int(y)
        if not (0 <= column < size[0] and 0 <= row < size[1]):
            return None
        shot, values, view = model.state.shot(), model.state.values, model.state.hold()
        if shot.scene is not self._clicked:  # with the uniforms that its trial compiled
            ready, _ = self._clicks.fit(self.renderer.prepared(shot.scene, CLICKED))
            self.renderer.adopt(shot.scene, ready, CLICKED)
            self._clicked = shot.scene
        texels = self.picture.probe(shot, size, column, row)
        origin, ray = view.ray(column + 0.5, row + 0.5, size)
        self._picks += 1
        pick = picked(self._picks, (column, row), texels, origin, ray, model.state.named_material)
        self._inquiry.ask(pick, shot, values, origin, ray)
        return pick

    def _save(self, file: Path, time: float, size: tuple[int, int], word: str) -> None:
        """Save the complete picture at a time, as `raymarch render` would draw it with this camera."""
        state = self.model.state
        made = self.picture.at(size).render(state.scene, time, state.params, VIEWS[state.view], pose=state.pose())
        try:
            with written(file) as partial:
                picture_of(made, state.view, state.scene).save(partial, "PNG")
        except SceneError as fault:
            do.saved(self.model, file, fault)
            return
        do.saved(self.model, file, word=word)

    def _measure(self) -> None:
        """Measure the mean evaluations per pixel from a picture of a quarter of the size."""
        shot = self.model.state.shot()
        renderer = self.picture.at(scaled(self.model.area, 0.25))
        made = renderer.render(shot.scene, shot.time, shot.params, ("evaluations",), pose=shot.pose)
        self.model.evaluations, self._live = (shot, float(made.evaluations.mean())), 3

    def release(self) -> None:
        if self._panel is not None:
            remember(self.model.narrow, self.model.opened)
        self.reloader.stop()
        if self._outside is not None:
            self._outside.close()
        if self._toolkit is not None:
            self._toolkit.release()
        self._overlay.release()
        self._comparison.release()
        self.picture.release()
        self.renderer.close()
        self.screen.release()
        self.window.release()
        self.model.log.close()


def _title(file: Path) -> str:
    return f"raymarch: {file.name} (H: help)"
