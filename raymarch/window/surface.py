"""The glfw window: events as plain values, sizes, clipboard and cursor."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

from raymarch.gpu.context import Context, open_window
from raymarch.window.events import Button, Char, Drop, Event, Key, Move, Scroll


class Window:
    """A visible window with an OpenGL context.

    size : (width, height) in screen coordinates.
    title : title of the window.

    Raises DeviceError if there is no display, no glfw or no context.
    """

    def __init__(self, size: tuple[int, int], title: str) -> None:
        self.context: Context = open_window(size, title)
        self.glfw: Any = importlib.import_module("glfw")
        self.handle = self.context.window
        self._names = _key_names(self.glfw)
        self._events: list[Event] = []
        self._stale = True
        self._windowed: tuple[int, int, int, int] | None = None
        self._listen()
        with self.context.bound():
            self.glfw.swap_interval(1)

    def _listen(self) -> None:
        glfw, handle, add = self.glfw, self.handle, self._events.append

        def key(_: Any, code: int, scancode: int, action: int, mods: int) -> None:
            name = self._names.get(code) or (glfw.get_key_name(code, scancode) or "").lower()
            shift, control = bool(mods & glfw.MOD_SHIFT), bool(mods & (glfw.MOD_CONTROL | glfw.MOD_SUPER))
            plain = action == glfw.PRESS and not control and not mods & glfw.MOD_ALT
            add(Key(name, action != glfw.RELEASE, shift, control, code, plain))

        def button(_: Any, which: int, action: int, mods: int) -> None:
            add(Button(which, action == glfw.PRESS, bool(mods & glfw.MOD_SHIFT), bool(mods & glfw.MOD_CONTROL)))

        def stale(*_: Any) -> None:
            self._stale = True

        glfw.set_key_callback(handle, key)
        glfw.set_char_callback(handle, lambda _, code: add(Char(code)))
        glfw.set_mouse_button_callback(handle, button)
        glfw.set_cursor_pos_callback(handle, lambda _, x, y: add(Move(x, y)))
        glfw.set_scroll_callback(handle, lambda _, x, y: add(Scroll(x, y)))
        glfw.set_drop_callback(handle, lambda _, files: add(Drop(tuple(Path(f) for f in files))))
        glfw.set_framebuffer_size_callback(handle, stale)
        glfw.set_window_refresh_callback(handle, stale)

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) of the framebuffer in pixels; (0, 0) while the window is minimised."""
        width, height = self.glfw.get_framebuffer_size(self.handle)
        return int(width), int(height)

    @property
    def extent(self) -> tuple[int, int]:
        """(width, height) in screen coordinates, those of the cursor."""
        width, height = self.glfw.get_window_size(self.handle)
        return max(1, int(width)), max(1, int(height))

    @property
    def density(self) -> float:
        """Display scale: framebuffer pixels per pixel of text at scale 1."""
        return max(1.0, float(self.glfw.get_window_content_scale(self.handle)[1]))

    def pixel(self, x: float, y: float) -> tuple[float, float]:
        """Convert a cursor position to framebuffer pixels from the upper left."""
        (width, height), (across, down) = self.size, self.extent
        return x * width / across, y * height / down

    def held(self, name: str) -> bool:
        """True if a key is down; `name` as in glfw, without KEY_."""
        return bool(self.glfw.get_key(self.handle, self.code(name)) == self.glfw.PRESS)

    def code(self, name: str) -> int:
        """The code of a key in events; `name` as in glfw, without KEY_."""
        return int(getattr(self.glfw, f"KEY_{name.upper()}"))

    def wait(self, seconds: float) -> list[Event]:
        """The events since the last call. Waits up to `seconds` for the first one; 0 does not wait."""
        if seconds > 0:
            self.glfw.wait_events_timeout(seconds)
        else:
            self.glfw.poll_events()
        found = self._events[:]
        self._events.clear()
        return found

    def wake(self) -> None:
        """End a `wait`; may be called from any thread."""
        self.glfw.post_empty_event()

    def take_stale(self) -> bool:
        """True if the window needs a redraw since the last call."""
        stale, self._stale = self._stale, False
        return stale

    @property
    def closing(self) -> bool:
        return bool(self.glfw.window_should_close(self.handle))

    def close(self) -> None:
        """Ask the window to close; `closing` is True from then on."""
        self.glfw.set_window_should_close(self.handle, True)

    def toggle_full_screen(self) -> bool:
        """Fill the screen that the window is on, or return to where it was. Returns whether it fills the screen."""
        glfw, handle = self.glfw, self.handle
        if self._windowed is not None:
            (x, y, width, height), self._windowed = self._windowed, None
            glfw.set_window_monitor(handle, None, x, y, width, height, glfw.DONT_CARE)
            return False
        x, y = glfw.get_window_pos(handle)
        width, height = self.extent
        middle = x + width // 2, y + height // 2
        screen = glfw.get_primary_monitor()
        for monitor in glfw.get_monitors():
            (left, top), mode = glfw.get_monitor_pos(monitor), glfw.get_video_mode(monitor)
            if 0 <= middle[0] - left < mode.size.width and 0 <= middle[1] - top < mode.size.height:
                screen = monitor
        mode = glfw.get_video_mode(screen)
        self._windowed = x, y, width, height
        glfw.set_window_monitor(handle, screen, 0, 0, mode.size.width, mode.size.height, mode.refresh_rate)
        return True

    def title(self, text: str) -> None:
        self.glfw.set_window_title(self.handle, text)

    def clip(self, text: str) -> None:
        self.glfw.set_clipboard_string(self.handle, text)

    def clipped(self) -> str:
        """The text on the clipboard, empty if there is none."""
        text = self.glfw.get_clipboard_string(self.handle)
        return text.decode(errors="replace") if text else ""

    def swap(self) -> None:
        """Swap buffers; may wait for vertical sync."""
        with self.context.bound():
            self.glfw.swap_buffers(self.handle)

    def release(self) -> None:
        self.context.release()


def _key_names(glfw: Any) -> dict[int, str]:
    """Names of keys without a character, or whose position matters independently of the layout."""
    names = ("space", "escape", "enter", "tab", "left", "right", "up", "down", "home", "f1", "f2", "f5", "f11", "f12")
    return {getattr(glfw, f"KEY_{name.upper()}"): name for name in names}
