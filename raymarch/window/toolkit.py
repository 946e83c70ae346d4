"""Dear ImGui on the window: its own Python backend (`imgui_bundle.python_backends.glfw_backend`) with our events.

The backend draws by PyOpenGL, into whatever context is current, and restores the state that it changes.
"""

from __future__ import annotations

import importlib
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from raymarch.gpu.screen import Screen
from raymarch.window.events import Button, Char, Event, Key, Move, Scroll
from raymarch.window.model import Model
from raymarch.window.surface import Window

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


def find() -> Any:
    """The module `imgui` and the class of the backend; None if the extra is not installed."""
    try:
        # A call of moderngl may leave an error that PyOpenGL would report as its own.
        setattr(importlib.import_module("OpenGL"), "ERROR_CHECKING", False)  # noqa: B010
        imgui = importlib.import_module("imgui_bundle").imgui
        backend = importlib.import_module("imgui_bundle.python_backends.glfw_backend").GlfwRenderer
        return SimpleNamespace(imgui=imgui, backend=backend)
    except ImportError:
        return None


class Toolkit:
    """One ImGui context for one window.

    found : the result of `find`.
    window, screen : source of events and clipboard, and where it draws.
    """

    def __init__(self, found: Any, window: Window, screen: Screen) -> None:
        self.imgui = imgui = found.imgui
        self._window, self._screen = window, screen
        self._context = imgui.create_context()
        with window.context.bound():
            self._backend = found.backend(window.handle, attach_callbacks=False)
        self._io = io = imgui.get_io()
        io.set_ini_filename("")  # write no file into the user's folder
        apply_theme(imgui, window.density * window.extent[1] / max(window.size[1], 1))
        platform = imgui.get_platform_io()  # the backend's own function fails for an empty clipboard
        platform.platform_get_clipboard_text_fn = lambda _: window.clipped()
        self._cursor = float("inf")
        self._held: frozenset[int] = frozenset()

    def take(self, event: Event, model: Model) -> bool:
        """Handle an event. Returns True if the panel consumed it."""
        if not model.panel:
            return False
        self._feed(event)
        if isinstance(event, Move):
            self._cursor = self._window.pixel(event.x, event.y)[0]
            return False  # the picture's gestures follow the cursor, too; they drag only what they pressed
        # `want_capture_mouse` is about the last frame's cursor; a list or colour picker may reach over the picture.
        over = self._cursor < model.panel_width or self.imgui.is_popup_open("", self.imgui.PopupFlags_.any_popup)
        if isinstance(event, Button) and event.down:
            self._held = self._held | {event.button} if over else self._held
            return over
        if isinstance(event, Button):
            mine = event.button in self._held
            self._held -= {event.button}
            return mine
        if isinstance(event, Key) and event.control and event.name in ("q", "s"):
            return False  # quit and save work also while a field has the focus
        return over if isinstance(event, Scroll) else bool(self._io.want_text_input)

    def _feed(self, event: Event) -> None:
        io, glfw = self._io, self._window.glfw
        if isinstance(event, Move):
            io.add_mouse_pos_event(event.x, event.y)
        elif isinstance(event, Button) and event.button < 3:
            io.add_mouse_button_event(event.button, event.down)
        elif isinstance(event, Scroll):
            io.add_mouse_wheel_event(event.x, event.y)
        elif isinstance(event, Char):
            io.add_input_character(event.code)
        elif isinstance(event, Key):
            self._backend.keyboard_callback(None, event.code, 0, glfw.PRESS if event.down else glfw.RELEASE, 0)

    def begin(self) -> None:
        self._backend.process_inputs()
        self.imgui.new_frame()

    def end(self) -> None:
        """End a frame and draw it over the screen."""
        self.imgui.render()
        with self._window.context.bound():
            self._screen.use()
            self._backend.render(self.imgui.get_draw_data())

    def release(self) -> None:
        with self._window.context.bound():
            self._backend.shutdown()
        self._io.backend_flags &= ~self.imgui.BackendFlags_.renderer_has_textures
        self.imgui.destroy_context(self._context)


# The theme: greys, and one accent colour for controls


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
