"""Dear ImGui on the window: its own Python backend (`imgui_bundle.python_backends.glfw_backend`) with our events.

The backend draws by PyOpenGL, into whatever context is current, and restores the state that it changes.
"""

from __future__ import annotations

import importlib
import importlib.util
from types import SimpleNamespace
from typing import Any

from raymarch.gpu.screen import Screen
from raymarch.window.events import Button, Char, Event, Key, Move, Scroll
from raymarch.window.model import Model
from raymarch.window.surface import Window
from raymarch.window.theme import apply_theme


def installed() -> bool:
    """True if the extra is installed, as far as can be told without importing it, which takes long."""
    return importlib.util.find_spec("imgui_bundle") is not None


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
        if isinstance(event, Key) and event.name == "tab":
            self.imgui.internal.clear_active_id()  # of a field of text, which would take all keys
            return False  # the toolkit would turn a slider into such a field
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

    def end(self) -> bool:
        """End a frame and draw it over the screen. Returns whether events wait for the next one: a frame does not take
        a press and its release together."""
        self.imgui.render()
        with self._window.context.bound():
            self._screen.use()
            self._backend.render(self.imgui.get_draw_data())
        return len(self._context.input_events_queue) > 0

    def release(self) -> None:
        with self._window.context.bound():
            self._backend.shutdown()
        self._io.backend_flags &= ~self.imgui.BackendFlags_.renderer_has_textures
        self.imgui.destroy_context(self._context)
