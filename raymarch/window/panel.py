"""The panel: sliders, switches, editors and numbers beside the picture. Needs the extra `view`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from raymarch.gpu.views import VIEWS
from raymarch.window import commands as do
from raymarch.window import control
from raymarch.window.editors import Editors
from raymarch.window.fields import FIELD, Fields
from raymarch.window.meters import Meters
from raymarch.window.model import SAVED_SIZES, SIDES, Model
from raymarch.window.timeline import Timeline

SAVES: tuple[tuple[str, Callable[[Model], None]], ...] = (
    ("save PNG", do.save_picture),
    ("sequence", do.save_sequence),
    ("film", do.save_film),
    ("settings", do.save_settings),
)
"""Buttons, two in a line."""


class Panel:
    """Draws the panel from the model; its changes are commands.

    imgui : the module, with a current context.
    """

    def __init__(self, imgui: Any, model: Model) -> None:
        self._imgui, self._model = imgui, model
        self._fields = Fields(imgui, model)
        self._editors, self._meters = Editors(self._fields), Meters(imgui, model)
        self._told: dict[str, tuple[int, int]] = {}

    def draw(self) -> None:
        """Draw the panel in the current frame of the toolkit."""
        imgui, model = self._imgui, self._model
        display = imgui.get_io().display_size
        width = model.panel_width * display.x / max(model.size[0], 1)
        self._fields.items = {}
        imgui.set_next_window_pos((0, 0), imgui.Cond_.always)
        imgui.set_next_window_size((width, display.y), imgui.Cond_.always)
        flags = imgui.WindowFlags_
        imgui.begin("raymarch", None, flags.no_move | flags.no_resize | flags.no_collapse | flags.no_title_bar)
        imgui.push_item_width(FIELD * width)
        try:
            self._sections()
        finally:
            imgui.pop_item_width()
            imgui.end()
        if self._fields.items != self._told:
            self._told = self._fields.items
            model.say("items", at=self._told)

    def _sections(self) -> None:
        state = self._model.state
        if state.specs:
            self._section("Parameters", self._parameters, True)
        self._section("View", self._view, True)
        self._section("Camera", self._camera)
        self._section("Time", self._time, state.animated)
        self._section("Lights", self._editors.lights)
        self._section("Materials", self._editors.materials)
        self._section("Quality", self._editors.quality)
        self._section("Frame", self._meters.frame)
        self._section("Plan", self._meters.plan)

    def _section(self, name: str, fill: Any, opened: bool = False) -> None:
        imgui = self._imgui
        was = self._model.opened.get(name, opened)
        shown = imgui.collapsing_header(name, imgui.TreeNodeFlags_.default_open if was else 0)
        self._model.opened[name] = bool(shown)
        self._fields.mark(name)
        if shown:
            imgui.push_id(name)
            fill()
            imgui.pop_id()

    def _parameters(self) -> None:
        state = self._model.state
        for name, spec in state.specs.items():
            if name in state.base.parameters:  # the others belong to an edited light or material
                self._fields.param(name, spec)
        if self._fields.button("defaults"):
            do.reset_params(self._model)
        self._imgui.same_line()
        if self._fields.button("copy as Python", "copy parameters"):
            do.copy_params(self._model)

    def _view(self) -> None:
        imgui, model, fields = self._imgui, self._model, self._fields
        chosen = fields.choice("shows", list(VIEWS), model.state.view, "view")
        if chosen != model.state.view:
            do.set_view(model, chosen)
        side = fields.choice("beside", SIDES, model.compare.side)
        if side != model.compare.side:
            do.set_side(model, side)
        for what, label in (("errors", "errors against the reference"), ("proof", "proof of each hit")):
            if imgui.checkbox(label, model.compare.over == what)[0]:
                do.toggle_over(model, what)
            fields.mark(what)
        changed, budget = fields.slider("budget, ms", model.budget, 5.0, 200.0)
        if changed:
            do.set_pace(model, budget=budget)
        changed, samples = fields.whole_slider("samples", model.samples, 1, 256)
        if changed:
            do.set_pace(model, samples=samples)
        model.saved_size = fields.choice("saved size", SAVED_SIZES, model.saved_size)
        for i, (label, act) in enumerate(SAVES):
            if fields.button(label):
                act(model)
            if i % 2 == 0:
                imgui.same_line()

    def _camera(self) -> None:
        imgui, model = self._imgui, self._model
        camera = model.state.hold()
        if camera.height is None:
            changed, fov = self._fields.slider("fov", camera.fov, 5.0, 120.0)
            if changed:
                do.move(model, control.zoomed, fov)
        else:
            changed, height = imgui.drag_float("height", camera.height, 0.01 * camera.height)
            if changed and height > 0.0:
                do.move(model, control.resized, float(height))
        imgui.text_wrapped(control.as_python(camera))
        if self._fields.button("copy", "copy camera"):
            do.copy_camera(model)
        imgui.same_line()
        if self._fields.button("reset", "reset camera"):
            do.reset_camera(model)

    def _time(self) -> None:
        imgui, model, fields = self._imgui, self._model, self._fields
        line = model.state.timeline
        for label, change in (
            ("pause" if line.playing else "play", Timeline.toggle),
            ("-1", lambda line: line.step(-1)),
            ("+1", lambda line: line.step(1)),
        ):
            if fields.button(label):
                do.change_time(model, change)
            imgui.same_line()
        imgui.new_line()
        first, last = line.loop or (0.0, 10.0)
        changed, moment = fields.slider("time", line.time, first, max(last, line.time), f"{line.time:.2f}")
        if changed:
            do.scrub(model, moment)
        changed, speed = fields.slider("speed", line.speed, -4.0, 4.0)
        if changed:
            do.set_timeline(model, replace(model.state.timeline, speed=speed))
        changed, looping = imgui.checkbox("loop", line.loop is not None)
        if changed:
            do.set_timeline(model, line.looping((0.0, max(line.time, 1.0)) if looping else None))
        elif line.loop is not None:
            changed, ends = imgui.drag_float2("from, to", list(line.loop), 0.02)
            if changed and ends[0] < ends[1]:
                do.set_timeline(model, line.looping((float(ends[0]), float(ends[1]))))
