"""The panel's editors of lights, materials and quality."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from raymarch.scene.material import Material
from raymarch.scene.quality import NORMALS, SCHEDULES, TRACERS
from raymarch.window import edits
from raymarch.window.edits import Edits, LightEdit

if TYPE_CHECKING:
    from raymarch.window.viewer import Viewer

CHOICES = {"tracer": TRACERS, "schedule": SCHEDULES, "normals": NORMALS}
"""Fields of Quality with few values."""


class Editors:
    """Draws the editors; changes go to the viewer as `Edits`."""

    def __init__(self, imgui: Any, viewer: Viewer) -> None:
        self._imgui, self._viewer = imgui, viewer

    def owns(self, parameter: str) -> bool:
        """True if a parameter belongs to an edited light or material instead of the scene file."""
        specs = self._viewer.base.parameters
        return parameter not in specs

    def lights(self) -> None:
        """The editor of all lights. The first change replaces the lights of the scene file."""
        imgui, viewer = self._imgui, self._viewer
        now: Edits = viewer.edits
        if now.lights is None:
            count = len(viewer.base.lights)
            imgui.text(f"{count} light{'' if count == 1 else 's'} from the file")
            if imgui.button("edit"):
                viewer.edit(replace(now, lights=edits.editable_lights(viewer.base)))
            viewer.mark("edit lights")
            return
        kept = list(now.lights)
        for i, light in enumerate(now.lights):
            if imgui.tree_node_ex(f"{light.number} {light.kind}", imgui.TreeNodeFlags_.default_open):
                changed = self._light(light)
                imgui.tree_pop()
                if changed is not light:
                    kept[i : i + 1] = [] if changed is None else [changed]
        for i, kind in enumerate(edits.KINDS):
            if imgui.small_button(f"+ {kind}"):
                number = max((light.number for light in now.lights), default=0) + 1
                kept.append(edits.new_light(kind, number, viewer.base))
            viewer.mark(f"add {kind}")
            if i % 2 == 0:
                imgui.same_line()
        if tuple(kept) != now.lights:
            viewer.edit(replace(now, lights=tuple(kept)))
        self._foot("lights", replace(now, lights=None))

    def _light(self, light: LightEdit) -> LightEdit | None:
        """The editor of one light. Returns the edited light; None to remove it."""
        imgui = self._imgui
        for name in light.values:
            self._value(light.name(name), name)
        changed, shadow = imgui.checkbox(f"shadow##{light.number}", light.shadow)
        self._viewer.mark(f"shadow {light.number}")
        imgui.same_line()
        if imgui.small_button(f"remove##{light.number}"):
            return None
        self._viewer.mark(f"remove {light.number}")
        if "softness" not in light.values and "softness" in edits.KINDS[light.kind][1]:
            imgui.same_line()
            if imgui.small_button(f"soften##{light.number}"):
                return light.softened()
        return replace(light, shadow=bool(shadow)) if changed else light

    def materials(self) -> None:
        """The editor of the scene's materials; edited ones have sliders."""
        imgui, viewer = self._imgui, self._viewer
        now: Edits = viewer.edits
        for index, material in enumerate(viewer.base.materials):
            self._swatch(index, material)
            imgui.same_line()
            if index not in now.materials:
                if imgui.small_button(f"edit##{index}"):
                    values = edits.editable_material(material)
                    viewer.edit(replace(now, materials={**now.materials, index: values}))
                    return
                viewer.mark(f"edit material {index}")
                imgui.same_line()
            where = material.where
            place = f"  {Path(where.file).name}:{where.line}" if where and index else ""
            imgui.text(f"{index or 'default'}{place}")
            if index not in now.materials:
                continue
            for name in now.materials[index]:
                self._value(edits.material_name(index, name), name)
        if now.materials:
            self._foot("materials", replace(now, materials={}))

    def _swatch(self, index: int, material: Material) -> None:
        """The colour of a material, if it is constant."""
        imgui = self._imgui
        color = edits.editable_material(material)["albedo" if material.physical else "color"]
        shown = color if isinstance(color, tuple) else (0.5, 0.5, 0.5)
        imgui.color_button(f"##swatch {index}", imgui.ImVec4(*shown, 1.0), imgui.ColorEditFlags_.no_tooltip, (14, 14))

    def quality(self) -> None:
        """The editor of the marching quality."""
        imgui, viewer = self._imgui, self._viewer
        now: Edits = viewer.edits
        quality = viewer.state.scene.quality
        new: dict[str, Any] = {}
        for name, choices in CHOICES.items():
            changed, chosen = imgui.combo(name, choices.index(getattr(quality, name)), list(choices))
            viewer.mark(f"quality {name}")
            if changed:
                new[name] = choices[chosen]
                if name == "tracer":
                    new["omega"] = None
        changed, steps = imgui.input_int("max_steps", quality.max_steps, 64, 512)
        if changed:
            new["max_steps"] = int(min(max(steps, 1), 60000))
        if new:
            viewer.edit(replace(now, quality={**now.quality, **new}))
        if now.quality:
            self._foot("quality", replace(now, quality={}))

    def _value(self, parameter: str, label: str) -> None:
        spec = self._viewer.state.specs.get(parameter)
        if spec is None:  # an expression in the scene file
            self._imgui.text(f"{label}: an expression")
            return
        panel = self._viewer.panel
        assert panel is not None
        self._imgui.push_id(parameter)
        panel.parameter(parameter, spec, label)
        self._imgui.pop_id()

    def _foot(self, name: str, without: Edits) -> None:
        imgui, viewer = self._imgui, self._viewer
        if imgui.button(f"copy as Python##{name}"):
            text = viewer.edits.python(viewer.base, dict(viewer.state.params))
            viewer.window.clip(text)
            viewer.notice(f"copied\n{text}")
        viewer.mark(f"copy {name}")
        imgui.same_line()
        if imgui.button(f"reset to the file##{name}"):
            viewer.edit(without)
        viewer.mark(f"drop {name}")
