"""Meters of the panel: frame times by part, progress, cost per pixel, the plan."""

from __future__ import annotations

from typing import Any

from raymarch.plan import explain
from raymarch.shader import assemble
from raymarch.window import commands as do
from raymarch.window.model import FRAMES, Model
from raymarch.window.theme import ACCENT, FAINT, WARNING, shade

HIGH = 48.0
"""Size of the graph at display scale 1, in pixels."""

PARTS = (("scene", ACCENT), ("window", FAINT), ("compile", WARNING))
"""The parts of a frame, from the bottom of its bar to the top, and their colours."""


class Meters:
    """Draws the sections of frame times and of the plan."""

    def __init__(self, imgui: Any, model: Model) -> None:
        self._imgui, self._model = imgui, model
        self._facts: tuple[Any, dict[str, Any]] | None = None

    def frame(self) -> None:
        """Draw the graph, the numbers of the last frame, and how far the picture is."""
        imgui, model, drawn = self._imgui, self._model, self._model.drawn
        self._graph(model.budget)
        for i, (name, color) in enumerate(PARTS):
            if i:
                imgui.same_line()
            imgui.text_colored(imgui.ImVec4(*color, 1.0), f"{name} {model.frames[-1][i]:.1f}")
        imgui.same_line()
        imgui.text_disabled(f"of {model.budget:g} ms")
        width, height = drawn.size
        imgui.text(f"{width} x {height}, {drawn.samples} of {drawn.wanted} sample{'' if drawn.wanted == 1 else 's'}")
        imgui.progress_bar(
            drawn.share, imgui.ImVec2(-1.0, 0.0), "complete" if drawn.whole else f"{100 * drawn.share:.0f} %"
        )
        do.measure(model)
        cost = model.evaluations
        imgui.text("evaluations a pixel: " + ("..." if cost is None else f"{cost[1]:.1f}"))
        imgui.text_disabled(f"{model.compiled} programs compiled")
        imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*FAINT, 1.0))
        imgui.text_wrapped(model.driver)
        imgui.pop_style_color()

    def _graph(self, budget: float) -> None:
        """Draw a bar for each frame, clipped at the top, and the budget as a line at half the height."""
        imgui = self._imgui
        corner, width = imgui.get_cursor_screen_pos(), imgui.get_content_region_avail().x
        high = HIGH * imgui.get_style().font_scale_dpi
        ink, at = imgui.get_window_draw_list(), imgui.ImVec2
        floor = corner.y + high
        ink.add_rect_filled(at(corner.x, corner.y), at(corner.x + width, floor), shade(imgui, (0.07, 0.07, 0.08)), 3.0)
        step = width / FRAMES
        for i, parts in enumerate(self._model.frames):
            base = floor
            for part, (_, color) in zip(parts, PARTS, strict=True):
                top = max(base - high * part / (2 * budget), corner.y)
                if top < base:
                    left = corner.x + i * step
                    ink.add_rect_filled(at(left, top), at(left + max(step - 0.5, 1.0), base), shade(imgui, color))
                base = top
        line = corner.y + high / 2
        ink.add_line(at(corner.x, line), at(corner.x + width, line), shade(imgui, (0.85, 0.35, 0.3), 0.9))
        imgui.dummy(at(width, high))

    def plan(self) -> None:
        """Draw the plan: features with reasons; unused ones are dimmed."""
        imgui = self._imgui
        plan = self._model.plan
        if plan is None:
            return
        if self._facts is None or self._facts[0] is not plan:
            self._facts = (plan, explain.as_dict(plan, assemble(plan).modules))
        facts = self._facts[1]
        field = facts["field"]
        imgui.text_wrapped(f"{field['exactness']}, {field['shapes']} shapes, {field['operations']} operations")
        for warning in facts["warnings"]:
            self._line(f"! {warning}", WARNING)
        for feature in facts["features"]:
            used = feature["used"]
            self._line(f"{'+' if used else '-'} {feature['name']}: {feature['reason']}", None if used else FAINT)
        imgui.separator()
        for module in facts["modules"]:
            self._line(f"{module['name']}: {module['reason']}", None)

    def _line(self, text: str, color: tuple[float, float, float] | None) -> None:
        imgui = self._imgui
        if color is not None:
            imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*color, 1.0))
        imgui.text_wrapped(text)
        if color is not None:
            imgui.pop_style_color()
