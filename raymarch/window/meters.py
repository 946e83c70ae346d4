"""Meters of the panel: frame times by part, cost per pixel, the plan."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, Any

from raymarch.plan import explain
from raymarch.shader import assemble
from raymarch.window.inspection import evaluations
from raymarch.window.theme import ACCENT, FAINT, WARNING, shade

if TYPE_CHECKING:
    from raymarch.window.viewer import Viewer

SHOWN = 120
"""Number of frames in the graph."""

HIGH = 48.0
"""Size of the graph at display scale 1, in pixels."""

PARTS = (("scene", ACCENT), ("window", FAINT), ("compile", WARNING))
"""The parts of a frame, from the bottom of its bar to the top, and their colours."""


class Meters:
    """Collects frame times, and draws the sections for them and for the plan."""

    def __init__(self, imgui: Any, viewer: Viewer) -> None:
        self._imgui, self._viewer = imgui, viewer
        self._frames: deque[tuple[float, ...]] = deque([(0.0, 0.0, 0.0)] * SHOWN, SHOWN)
        self._facts: tuple[Any, dict[str, Any]] | None = None

    def note(self, scene: float, window: float, compile: float) -> None:
        """Record a frame in milliseconds: drawing the scene, everything else, compiling."""
        self._frames.append((scene, window, compile))

    def frame(self) -> None:
        """Draw the graph and the numbers of the last frame."""
        imgui, viewer, drawn = self._imgui, self._viewer, self._viewer.picture.drawn
        self._graph(viewer.picture.pace.budget)
        for i, (name, color) in enumerate(PARTS):
            if i:
                imgui.same_line()
            imgui.text_colored(imgui.ImVec4(*color, 1.0), f"{name} {self._frames[-1][i]:.1f}")
        imgui.same_line()
        imgui.text_disabled(f"of {viewer.picture.pace.budget:g} ms")
        width, height = drawn.size
        samples = f"{drawn.samples} sample{'' if drawn.samples == 1 else 's'} per pixel"
        imgui.text(f"{width} x {height}, {samples}{'' if drawn.whole else ', refining'}")
        cost = evaluations(viewer)
        imgui.text("evaluations a pixel: " + ("..." if cost is None else f"{cost:.1f}"))
        imgui.text_disabled(f"{viewer.renderer.compiled} programs compiled")
        imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*FAINT, 1.0))
        imgui.text_wrapped(viewer.window.context.driver.renderer)
        imgui.pop_style_color()

    def _graph(self, budget: float) -> None:
        """Draw a bar for each frame, clipped at the top, and the budget as a line at half the height."""
        imgui = self._imgui
        corner, width = imgui.get_cursor_screen_pos(), imgui.get_content_region_avail().x
        high = HIGH * self._viewer.window.density
        ink, at = imgui.get_window_draw_list(), imgui.ImVec2
        floor = corner.y + high
        ink.add_rect_filled(at(corner.x, corner.y), at(corner.x + width, floor), shade(imgui, (0.07, 0.07, 0.08)), 3.0)
        step = width / SHOWN
        for i, parts in enumerate(self._frames):
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
        plan = self._viewer.plan()
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
