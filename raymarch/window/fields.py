"""Fields of the panel for parameters, with readable labels."""

from __future__ import annotations

from typing import Any

import numpy as np

from raymarch.expr.srgb import linear_to_srgb, srgb_to_linear
from raymarch.scene.parameter import Spec, Value
from raymarch.window import commands as do
from raymarch.window.model import Model
from raymarch.window.theme import WARNING

FIELD = 0.55
"""Width of a field as a fraction of the panel's width."""


class Fields:
    """Draws fields; records where each is.

    items : the centres of the fields by name, in screen coordinates.
    """

    def __init__(self, imgui: Any, model: Model) -> None:
        self.imgui, self.model = imgui, model
        self.items: dict[str, tuple[int, int]] = {}

    def mark(self, name: str) -> None:
        """Record the centre of the last item."""
        low, high = self.imgui.get_item_rect_min(), self.imgui.get_item_rect_max()
        self.items[name] = (round((low.x + high.x) / 2), round((low.y + high.y) / 2))

    def button(self, label: str, name: str = "", small: bool = False) -> bool:
        """A button that is recorded as `name`."""
        pressed = (self.imgui.small_button if small else self.imgui.button)(label)
        self.mark(name or label.partition("##")[0])
        return bool(pressed)

    def label(self, text: str, number: str = "") -> str:
        """The label of the next field: beside it, or in a line above it if it does not fit there.

        number : what stands between the field and its label.
        """
        imgui = self.imgui
        free = imgui.get_content_region_avail().x - imgui.calc_item_width() - imgui.calc_text_size(number).x
        if imgui.calc_text_size(text, True).x + imgui.get_style().item_inner_spacing.x <= free:
            return text
        imgui.text(text.partition("##")[0])
        return f"##{text}"

    def numbered(self, text: str, number: str) -> str:
        """The label of the next slider with its number before it, so that the knob hides neither."""
        visible, _, ident = self.label(text, number).partition("##")
        return f"{number}{visible}###{ident or visible}"  # after ### stands what does not change

    def slider(self, label: str, value: float, low: float, high: float, words: str = "") -> tuple[bool, float]:
        """A slider with its number, or words for it, beside it. Returns whether it was moved, and the value."""
        number = f"{words or f'{value:.4g}'}  "
        changed, new = self.imgui.slider_float(self.numbered(label, number), value, low, high, "")
        self.mark(label)
        return bool(changed), float(new)

    def whole_slider(self, label: str, value: int, low: int, high: int) -> tuple[bool, int]:
        """A slider of whole numbers, like `slider`."""
        changed, new = self.imgui.slider_int(self.numbered(label, f"{value}  "), value, low, high, "")
        self.mark(label)
        return bool(changed), int(new)

    def param(self, name: str, spec: Spec, label: str = "") -> None:
        """A slider or colour field for a parameter. Before one that differs from the file, an arrow returns to it."""
        imgui, value = self.imgui, self.model.state.value(name)
        slides = not np.equal(*_ends(spec))
        if not slides or (isinstance(value, tuple) and len(value) in (3, 4) and _is_color(name, spec)):
            text = self.label(label or name)
        elif isinstance(value, tuple):  # its numbers do not fit beside it
            imgui.text(f"{(label or name).partition('##')[0]}  {', '.join(f'{v:.4g}' for v in value)}")
            text = f"##{label or name}"
        else:
            text = self.numbered(label or name, f"{value:.4g}  ")
        edge, gap = imgui.get_frame_height(), imgui.get_style().item_inner_spacing.x
        if not self.model.state.changed(name):
            imgui.dummy((edge, edge))
        else:
            imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*WARNING, 1.0))
            returned = imgui.arrow_button(f"##file {name}", imgui.Dir.left)
            imgui.pop_style_color()
            self.mark(f"file {name}")
            imgui.set_item_tooltip("return to the value of the file")
            if returned:
                do.reset_param(self.model, name)
        imgui.same_line(0.0, gap)
        imgui.set_next_item_width(imgui.calc_item_width() - edge - gap)
        changed, new = self._field(text, name, spec, value)
        self.mark(name)
        if changed:
            do.set_param(self.model, name, new)

    def swatch(self, name: str, color: Any, edge: float = 0.0) -> bool:
        """A square of a linear colour, as the picture shows it. Returns True if it was clicked."""
        imgui = self.imgui
        edge = edge or imgui.get_frame_height()
        shown = imgui.ImVec4(*linear_to_srgb(np.clip(color[:3], 0.0, 1.0)), 1.0)
        pressed = imgui.color_button(f"##swatch {name}", shown, imgui.ColorEditFlags_.no_tooltip, (edge, edge))
        self.mark(f"swatch {name}")
        return bool(pressed)

    def _color(self, label: str, name: str, value: tuple[float, ...]) -> tuple[bool, Any]:
        """The numbers of a colour, linear as in the file, and a swatch that opens a picker of colours as shown."""
        imgui, flags = self.imgui, self.imgui.ColorEditFlags_
        width = imgui.calc_item_width()
        if self.swatch(name, value):
            imgui.open_popup(f"pick {name}")
        imgui.same_line(0.0, imgui.get_style().item_inner_spacing.x)
        imgui.set_next_item_width(width - imgui.get_frame_height() - imgui.get_style().item_inner_spacing.x)
        edit = imgui.color_edit3 if len(value) == 3 else imgui.color_edit4
        plain = flags.float | flags.hdr | flags.no_small_preview | flags.no_picker | flags.no_options
        plain |= flags.no_color_markers
        changed, new = edit(label, list(value), plain)
        if imgui.begin_popup(f"pick {name}"):
            most = max(1.0, *value[:3])  # of light: the picker keeps its strength
            shown = [float(v) for v in linear_to_srgb(np.clip(np.array(value[:3]) / most, 0.0, 1.0))]
            picked, color = imgui.color_picker3("##picker", shown, flags.no_side_preview | flags.display_rgb)
            if picked:
                changed, new = True, [*(float(v) for v in most * srgb_to_linear(np.array(color))), *value[3:]]
            imgui.end_popup()
        return changed, tuple(new)

    def _field(self, label: str, name: str, spec: Spec, value: Value) -> tuple[bool, Any]:
        imgui = self.imgui
        low, high = _ends(spec)
        if isinstance(value, tuple):
            if len(value) in (3, 4) and _is_color(name, spec):
                return self._color(label, name, value)
            field = getattr(imgui, f"{'slider' if high > low else 'drag'}_float{len(value)}")
            changed, new = field(label, list(value), *((low, high, "") if high > low else (0.01,)))
            return changed, tuple(new)
        if high > low:
            return imgui.slider_float(label, value, low, high, "")
        return imgui.drag_float(label, value, max(abs(value), 1.0) * 0.01)

    def choice(self, label: str, values: Any, now: Any, name: str = "") -> Any:
        """A list of values to choose from. Returns the chosen one."""
        changed, chosen = self.imgui.combo(self.label(label), list(values).index(now), [str(v) for v in values])
        self.mark(name or label)
        return values[chosen] if changed else now


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
