"""The theme of the panel: greys, and one accent colour for controls."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

POINTS = 14.0
"""Height of the panel's text at display scale 1, in pixels."""

ACCENT = (0.36, 0.62, 0.88)
WARNING = (0.95, 0.75, 0.35)
FAINT = (0.60, 0.62, 0.65)

COLORS: dict[str, tuple[float, ...]] = {
    "text": (0.90, 0.91, 0.92, 1.0),
    "text_disabled": (*FAINT, 1.0),
    "window_bg": (0.10, 0.105, 0.115, 1.0),
    "popup_bg": (0.13, 0.135, 0.145, 0.98),
    "frame_bg": (0.20, 0.205, 0.22, 1.0),
    "frame_bg_hovered": (0.25, 0.26, 0.28, 1.0),
    "frame_bg_active": (0.29, 0.30, 0.33, 1.0),
    "header": (0.185, 0.215, 0.255, 1.0),
    "header_hovered": (0.23, 0.27, 0.32, 1.0),
    "header_active": (0.26, 0.31, 0.37, 1.0),
    "button": (0.25, 0.26, 0.285, 1.0),
    "button_hovered": (*(0.8 * c for c in ACCENT), 1.0),
    "button_active": (*ACCENT, 1.0),
    "slider_grab": (*(0.85 * c for c in ACCENT), 1.0),
    "slider_grab_active": (*ACCENT, 1.0),
    "check_mark": (*ACCENT, 1.0),
    "plot_histogram": (*(0.7 * c for c in ACCENT), 1.0),
    "separator": (0.22, 0.23, 0.25, 1.0),
    "scrollbar_bg": (0.0, 0.0, 0.0, 0.0),
    "scrollbar_grab": (0.28, 0.29, 0.32, 1.0),
}


def apply_theme(imgui: Any, density: float) -> None:
    """Set colours, sizes and font of the current context, for a display scale."""
    imgui.style_colors_dark()
    style = imgui.get_style()
    for name, color in COLORS.items():
        style.set_color_(getattr(imgui.Col_, name), imgui.ImVec4(*color))
    style.window_border_size = 0.0
    style.frame_rounding = style.grab_rounding = style.popup_rounding = 3.0
    style.frame_padding = imgui.ImVec2(7, 3)
    style.item_spacing = imgui.ImVec2(7, 4)
    style.item_inner_spacing = imgui.ImVec2(6, 4)
    style.window_padding = imgui.ImVec2(8, 8)
    style.scrollbar_size = 10.0
    style.grab_min_size = 9.0
    style.indent_spacing = 14.0
    style.scale_all_sizes(density)
    style.font_scale_dpi = density
    font = _font()
    if font is not None:
        imgui.get_io().fonts.add_font_from_file_ttf(str(font), POINTS)


def shade(imgui: Any, color: tuple[float, float, float], alpha: float = 1.0) -> int:
    """A colour in the format of draw lists."""
    return int(imgui.color_convert_float4_to_u32(imgui.ImVec4(*color, alpha)))


def _font() -> Path | None:
    """A TrueType font from the toolkit's package; None if it has none, to use its built-in font."""
    package = importlib.import_module("imgui_bundle").__file__ or ""
    font = Path(package).parent / "assets" / "fonts" / "Roboto" / "Roboto-Regular.ttf"
    return font if font.is_file() else None
