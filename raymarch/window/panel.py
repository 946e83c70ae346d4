"""The panel: sliders, switches, editors and numbers beside the picture. Needs the extra `view`."""

from __future__ import annotations

import time as clock_time
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from raymarch.gpu.views import VIEWS
from raymarch.scene.parameter import Spec, Value
from raymarch.window import control, save
from raymarch.window.accuracy import nearest
from raymarch.window.editors import Editors
from raymarch.window.edits import params_as_python
from raymarch.window.meters import Meters
from raymarch.window.surface import Button, Event, Key, Move, Scroll
from raymarch.window.toolkit import Toolkit

if TYPE_CHECKING:
    from raymarch.window.viewer import Viewer

WIDTH = 300
"""Width of the panel at display scale 1, in pixels."""


class Panel:
    """Draws the panel and applies its changes to the state."""

    def __init__(self, imgui: Any, viewer: Viewer) -> None:
        self._imgui, self._viewer = imgui, viewer
        self.toolkit = Toolkit(imgui, viewer.window, viewer.screen)
        self.editors = Editors(imgui, viewer)
        self.meters = Meters(imgui, viewer)
        self.shown = True
        self.active = 2
        self._cursor = float("inf")
        self._held: frozenset[int] = frozenset()
        self._at = clock_time.perf_counter()
        self.items: dict[str, tuple[float, float]] = {}
        self._told: dict[str, tuple[int, int]] = {}

    def take(self, event: Event) -> bool:
        """Handle an event. Returns True if the panel consumed it."""
        if not self.shown:
            return False
        self.toolkit.feed(event)
        self.active = 3  # a change shows in the frame after the next
        if isinstance(event, Move):
            self._cursor = self._viewer.window.pixel(event.x, event.y)[0]
            return False  # the input tracks the cursor; it drags only what it pressed
        # The toolkit updates what is under the cursor only in its next frame.
        over = self._cursor < self.width or self.toolkit.wants_mouse
        if isinstance(event, Button) and event.down:
            self._held = self._held | {event.button} if over else self._held
            return over
        if isinstance(event, Button):
            mine = event.button in self._held
            self._held -= {event.button}
            return mine
        if isinstance(event, Key) and event.control and event.name in ("q", "s"):
            return False  # quit and save work also while a field has the focus
        return over if isinstance(event, Scroll) else self.toolkit.wants_keys

    @property
    def width(self) -> int:
        """Width of the panel in pixels; 0 while it is hidden."""
        return round(min(WIDTH * self._viewer.window.density, 0.6 * self._viewer.screen.size[0])) if self.shown else 0

    @property
    def busy(self) -> bool:
        """True if the panel must be redrawn."""
        return self.shown and self.active > 0

    def toggle(self) -> None:
        """Show or hide."""
        self.shown, self.active = not self.shown, 2
        self._viewer.window.touch()

    def draw(self) -> None:
        """Draw the panel over the picture."""
        if not self.shown:
            return
        imgui, viewer = self._imgui, self._viewer
        now = clock_time.perf_counter()
        self.toolkit.begin(now - self._at)
        self._at = now
        self.items = {}
        width = self.width
        imgui.set_next_window_pos((0, 0), imgui.Cond_.always)
        imgui.set_next_window_size((width, viewer.screen.size[1]), imgui.Cond_.always)
        imgui.set_next_window_bg_alpha(0.94)
        flags = imgui.WindowFlags_
        imgui.begin("raymarch", None, flags.no_move | flags.no_resize | flags.no_collapse | flags.no_title_bar)
        imgui.push_item_width(0.55 * width)
        try:
            self._sections()
        finally:
            imgui.pop_item_width()
            imgui.end()
            self.toolkit.end()
        self.active = max(0, self.active - 1)
        places = {name: (round(x), round(y)) for name, (x, y) in self.items.items()}
        if places != self._told:
            self._told = places
            viewer.log.say("items", at=places)

    def _sections(self) -> None:
        imgui = self._imgui
        opened = imgui.TreeNodeFlags_.default_open
        if self._viewer.state.specs:
            self._section("Parameters", self._parameters, opened)
        self._section("View", self._view, opened)
        self._section("Camera", self._camera, 0)
        self._section("Time", self._time, opened if self._viewer.state.animated else 0)
        self._section("Lights", self.editors.lights, 0)
        self._section("Materials", self.editors.materials, 0)
        self._section("Quality", self._quality, 0)
        self._section("Frame", self.meters.frame, 0)
        self._section("Plan", self.meters.plan, 0)

    def _section(self, name: str, fill: Any, flags: Any) -> None:
        opened = self._imgui.collapsing_header(name, flags)
        self.mark(name)
        if opened:
            self._imgui.push_id(name)
            fill()
            self._imgui.pop_id()

    def mark(self, name: str) -> None:
        """Record the centre of the last item in pixels, for the log."""
        low, high = self._imgui.get_item_rect_min(), self._imgui.get_item_rect_max()
        self.items[name] = ((low.x + high.x) / 2, (low.y + high.y) / 2)

    # Sections

    def _parameters(self) -> None:
        for name, spec in self._viewer.state.specs.items():
            if not self.editors.owns(name):
                self.parameter(name, spec)
        imgui, state = self._imgui, self._viewer.state
        if imgui.button("defaults"):
            state.params.clear()
        self.mark("defaults")
        imgui.same_line()
        if imgui.button("copy as Python"):
            moved = {name: value for name, value in state.params.items() if not self.editors.owns(name)}
            text = params_as_python(state.specs, moved)
            self._viewer.window.clip(text)
            self._viewer.notice(f"copied\n{text}" if text else "no parameter was changed")
        self.mark("copy parameters")

    def parameter(self, name: str, spec: Spec, label: str = "") -> None:
        """A slider or colour field for a parameter."""
        state = self._viewer.state
        value = state.value(name)
        changed, new = self._field(label or name, name, spec, value)
        self.mark(name)
        if changed:
            state.set(name, new)
            self._viewer.log.say("param", name=name, value=state.value(name))

    def _field(self, label: str, name: str, spec: Spec, value: Value) -> tuple[bool, Any]:
        imgui = self._imgui
        low, high = _ends(spec)
        if isinstance(value, tuple):
            if len(value) in (3, 4) and _is_color(name, spec):
                edit = imgui.color_edit3 if len(value) == 3 else imgui.color_edit4
                flags = imgui.ColorEditFlags_.float | imgui.ColorEditFlags_.hdr
                changed, new = edit(label, list(value), flags)
                return changed, tuple(new)
            field = getattr(imgui, f"{'slider' if high > low else 'drag'}_float{len(value)}")
            changed, new = field(label, list(value), *((low, high) if high > low else (0.01,)))
            return changed, tuple(new)
        if high > low:
            return imgui.slider_float(label, value, low, high)
        return imgui.drag_float(label, value, max(abs(value), 1.0) * 0.01)

    def _view(self) -> None:
        imgui, state = self._imgui, self._viewer.state
        names = list(VIEWS)
        changed, chosen = imgui.combo("shows", names.index(state.view), names)
        self.mark("view")
        if changed:
            state.view = names[chosen]
            self._viewer.log.say("view", name=state.view)
        pace = self._viewer.picture.pace
        changed, budget = imgui.slider_float("budget, ms", pace.budget, 5.0, 200.0)
        if changed:
            pace.budget = float(budget)
        changed, samples = imgui.slider_int("samples", self._viewer.picture.samples, 1, 256)
        if changed:
            self._viewer.picture.samples = int(samples)
        for label, act in (("save PNG", save.still), ("sequence", save.begin), ("settings", save.settings)):
            if imgui.button(label):
                act(self._viewer)
            self.mark(label)
            imgui.same_line()
        imgui.new_line()

    def _quality(self) -> None:
        self._accuracy()
        self.editors.quality()

    def _accuracy(self) -> None:
        """The slider from fast to exact, with the error that each stop promises and the time of the last frame."""
        imgui, viewer = self._imgui, self._viewer
        stops, quality = viewer.stops, viewer.state.scene.quality
        now = nearest(stops, quality)
        at = len(stops) // 2 if now is None else now
        name = "the file's own" if now is None else stops[now].name
        changed, chosen = imgui.slider_int("fast to exact", at, 0, len(stops) - 1, name)
        self.mark("accuracy")
        if changed and chosen != now:
            viewer.approach(int(chosen))
        imgui.text_wrapped(name if now is None else stops[now].words)
        frame, (width, height) = viewer.picture.frame, viewer.screen.size
        imgui.text(f"here {'...' if frame is None else f'{frame:.3g}'} ms at {width}x{height}")

    def _camera(self) -> None:
        imgui, state = self._imgui, self._viewer.state
        camera = state.hold()
        if camera.height is None:
            changed, fov = imgui.slider_float("fov", camera.fov, 5.0, 120.0)
            if changed:
                state.move(control.zoomed(camera, float(fov)))
        else:
            changed, height = imgui.drag_float("height", camera.height, 0.01 * camera.height)
            if changed and height > 0.0:
                state.move(control.resized(camera, float(height)))
        imgui.text_wrapped(control.as_python(camera))
        if imgui.button("copy"):
            self._viewer.keys.copy()
        imgui.same_line()
        if imgui.button("reset"):
            state.reset()

    def _time(self) -> None:
        imgui, state = self._imgui, self._viewer.state
        line = state.timeline
        if imgui.button("pause" if line.playing else "play"):
            state.timeline = line = line.toggle()
        imgui.same_line()
        if imgui.button("-1"):
            state.timeline = line = line.step(-1)
        imgui.same_line()
        if imgui.button("+1"):
            state.timeline = line = line.step(1)
        first, last = line.loop or (0.0, 10.0)
        changed, moment = imgui.slider_float("time", line.time, first, max(last, line.time))
        self.mark("time")
        if changed:
            state.timeline = line = line.scrub(float(moment))
            self._viewer.log.say("scrub", time=line.time)
        changed, speed = imgui.slider_float("speed", line.speed, -4.0, 4.0)
        if changed:
            state.timeline = line = replace(line, speed=float(speed))
        changed, looping = imgui.checkbox("loop", line.loop is not None)
        if changed:
            state.timeline = line = line.looping((0.0, max(line.time, 1.0)) if looping else None)
        if line.loop is not None:
            changed, ends = imgui.drag_float2("from, to", list(line.loop), 0.02)
            if changed and ends[0] < ends[1]:
                state.timeline = line.looping((float(ends[0]), float(ends[1])))

    def release(self) -> None:
        """Free the resources of the toolkit."""
        self.toolkit.release()


def _ends(spec: Spec) -> tuple[float, float]:
    """The ends of a slider; equal if the range is unbounded."""
    if spec.min is None or spec.max is None:
        return 0.0, 0.0
    return float(np.min(spec.min)), float(np.max(spec.max))


def _is_color(name: str, spec: Spec) -> bool:
    """True for a vector with minimum 0 that is named after a colour or lies in [0, 1]: it has a colour editor."""
    low, high = (None if end is None else float(np.max(end)) for end in (spec.min, spec.max))
    named = any(word in name.lower() for word in ("color", "colour", "albedo", "emission", "f0"))
    return low == 0.0 and (named or high == 1.0)
