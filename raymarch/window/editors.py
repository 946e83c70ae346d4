"""The panel's editors of lights, materials and quality."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from raymarch.scene.quality import NORMALS, SCHEDULES, TRACERS
from raymarch.window import commands as do
from raymarch.window import edits
from raymarch.window.accuracy import nearest
from raymarch.window.edits import LightEdit
from raymarch.window.fields import Fields

CHOICES = {"tracer": TRACERS, "schedule": SCHEDULES, "normals": NORMALS}
"""Fields of Quality with few values."""


class Editors:
    """Draws the editors; changes become commands."""

    def __init__(self, fields: Fields) -> None:
        self._fields, self._imgui, self._model = fields, fields.imgui, fields.model

    def lights(self) -> None:
        """The editor of all lights. The first change replaces the lights of the scene file."""
        imgui, state = self._imgui, self._model.state
        now = state.edits
        if now.lights is None:
            count = len(state.base.lights)
            imgui.text(f"{count} light{'' if count == 1 else 's'} from the file")
            if self._fields.button("edit", "edit lights"):
                do.edit(self._model, replace(now, lights=edits.editable_lights(state.base)))
            return
        kept = list(now.lights)
        for i, light in enumerate(now.lights):
            if imgui.tree_node_ex(f"{light.number} {light.kind}", imgui.TreeNodeFlags_.default_open):
                changed = self._light(light)
                imgui.tree_pop()
                if changed is not light:
                    kept[i : i + 1] = [] if changed is None else [changed]
        for i, kind in enumerate(edits.KINDS):
            if self._fields.button(f"+ {kind}", f"add {kind}", small=True):
                number = max((light.number for light in now.lights), default=0) + 1
                kept.append(edits.new_light(kind, number, state.base))
            if i % 2 == 0:
                imgui.same_line()
        imgui.new_line()
        if tuple(kept) != now.lights:
            do.edit(self._model, replace(now, lights=tuple(kept)))
        self._foot("lights", lights=None)

    def _light(self, light: LightEdit) -> LightEdit | None:
        """The editor of one light. Returns the edited light; None to remove it."""
        fields = self._fields
        changed = light
        for name in light.moved:
            self._value(light.name(name), name)
        for name, values in edits.OPTIONS.items():
            if name in light.values:
                now = light.values[name]
                if isinstance(now, bool):
                    chosen = self._imgui.checkbox(f"{name}##{light.number}", now)[1]
                    fields.mark(f"{name} {light.number}")
                else:
                    chosen = fields.choice(f"{name}##{light.number}", values, now, f"{name} {light.number}")
                changed = changed if chosen == now else changed.with_value(name, chosen)
        for name in light.unset:
            if fields.button(f"+ {name}##{light.number}", f"set {name} {light.number}", small=True):
                changed = changed.with_value(name, edits.UNSET[name])
        removed = fields.button(f"remove##{light.number}", f"remove {light.number}", small=True)
        return None if removed else changed

    def materials(self) -> None:
        """The editor of the scene's materials; edited ones have sliders."""
        imgui, state = self._imgui, self._model.state
        now = state.edits
        for index, material in enumerate(state.base.materials):
            values = now.materials.get(index)
            color = state.material_color(index) or (0.2, 0.2, 0.2)
            self._fields.swatch(f"material {index}", color, imgui.get_font_size())
            imgui.same_line()
            if values is None:
                if self._fields.button(f"edit##{index}", f"edit material {index}", small=True):
                    values = edits.editable_material(material)
                    do.edit(self._model, replace(now, materials={**now.materials, index: values}))
                    return
                imgui.same_line()
            where = material.where
            place = f"  {Path(where.file).name}:{where.line}" if where and index else ""
            imgui.text(f"{index or 'default'}{place}")
            if values is None:
                continue
            for name in values:
                self._value(edits.material_name(index, name), name)
            for name, start in edits.unset_values(material, values).items():
                if self._fields.button(f"+ {name}##{index}", f"set material {index} {name}", small=True):
                    new = {**now.materials, index: {**values, name: start}}
                    do.edit(self._model, replace(now, materials=new))
        if now.materials:
            self._foot("materials", materials={})

    def quality(self) -> None:
        """The slider from fast to exact, and the editor of the marching quality."""
        imgui, model = self._imgui, self._model
        self._accuracy()
        now, quality = model.state.edits, model.state.scene.quality
        new: dict[str, Any] = {}
        for name, choices in CHOICES.items():
            if getattr(quality, name) not in choices:
                choices = (*choices, getattr(quality, name))  # a tracer of the scene's own
            chosen = self._fields.choice(name, choices, getattr(quality, name), f"quality {name}")
            if chosen != getattr(quality, name):
                new |= {name: chosen, **({"omega": None} if name == "tracer" else {})}
        changed, steps = imgui.input_int(self._fields.label("max_steps"), quality.max_steps, 64, 512)
        if changed:
            new["max_steps"] = int(min(max(steps, 1), 60000))
        if new:
            do.edit(model, replace(now, quality={**now.quality, **new}))
        if now.quality:
            self._foot("quality", quality={})

    def _accuracy(self) -> None:
        """The slider from fast to exact, with the error that each stop promises and the time of the last frame."""
        imgui, model = self._imgui, self._model
        stops = model.stops
        now = nearest(stops, model.state.scene.quality)
        at = len(stops) // 2 if now is None else now
        name = "the file's own" if now is None else stops[now].name
        changed, chosen = imgui.slider_int(self._fields.label("fast to exact"), at, 0, len(stops) - 1, "")
        self._fields.mark("accuracy")
        if changed and chosen != now:
            do.approach(model, int(chosen))
        imgui.text_wrapped(name if now is None else stops[now].words)
        frame, (width, height) = model.frame, model.area
        imgui.text(f"here {'...' if frame is None else f'{frame:.3g}'} ms at {width}x{height}")

    def _value(self, parameter: str, label: str) -> None:
        spec = self._model.state.specs.get(parameter)
        if spec is None:  # an expression in the scene file
            self._imgui.text(f"{label}: an expression")
            return
        self._imgui.push_id(parameter)
        self._fields.param(parameter, spec, label)
        self._imgui.pop_id()

    def _foot(self, name: str, **without: Any) -> None:
        if self._fields.button(f"copy as Python##{name}", f"copy {name}"):
            do.copy_edits(self._model)
        self._imgui.same_line()
        if self._fields.button(f"reset to the file##{name}", f"drop {name}"):
            do.edit(self._model, replace(self._model.state.edits, **without))
