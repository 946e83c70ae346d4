"""Dear ImGui (`imgui-bundle`) on the window's context and events.

Its buffers are drawn as plain triangles by `Screen`, so it makes no OpenGL calls of its own.
"""

from __future__ import annotations

import ctypes
import importlib
from typing import Any

import numpy as np

from raymarch.gpu.screen import Screen, Stretch
from raymarch.window.surface import Button, Char, Event, Key, Move, Scroll, Window
from raymarch.window.theme import apply_theme

HINT = "pip install 'raymarch[view]' for the panel with sliders and editors"


def find() -> Any:
    """The imgui module, or None if the extra is not installed."""
    try:
        return importlib.import_module("imgui_bundle").imgui
    except ImportError:
        return None


class Toolkit:
    """One ImGui context for one window.

    Parameters
    ----------
    imgui : the module.
    window : source of events and clipboard.
    screen : where it draws.
    """

    def __init__(self, imgui: Any, window: Window, screen: Screen) -> None:
        self._imgui, self._window, self._screen = imgui, window, screen
        self._context = imgui.create_context()
        self._io = io = imgui.get_io()
        io.set_ini_filename("")  # write no file into the user's folder
        io.backend_flags |= imgui.BackendFlags_.renderer_has_textures | imgui.BackendFlags_.renderer_has_vtx_offset
        self._textures: dict[int, Any] = {}
        self._keys = _keys(imgui, window.glfw)
        apply_theme(imgui, window.density)
        platform = imgui.get_platform_io()
        platform.platform_get_clipboard_text_fn = lambda _: window.clipped()
        platform.platform_set_clipboard_text_fn = lambda _, text: window.clip(text)

    @property
    def wants_mouse(self) -> bool:
        """True if the cursor is over an item of the toolkit or drags one."""
        return bool(self._io.want_capture_mouse)

    @property
    def wants_keys(self) -> bool:
        """True if a text field has the focus."""
        return bool(self._io.want_text_input)

    def feed(self, event: Event) -> None:
        """Pass an event on."""
        io, imgui = self._io, self._imgui
        if isinstance(event, Move):
            io.add_mouse_pos_event(*self._window.pixel(event.x, event.y))
        elif isinstance(event, Button) and event.button < 3:
            io.add_mouse_button_event(event.button, event.down)
        elif isinstance(event, Scroll):
            io.add_mouse_wheel_event(event.x, event.y)
        elif isinstance(event, Char):
            io.add_input_character(event.code)
        elif isinstance(event, Key):
            io.add_key_event(imgui.Key.mod_ctrl, event.control)
            io.add_key_event(imgui.Key.mod_shift, event.shift)
            key = self._keys.get(event.code)
            if key is not None:
                io.add_key_event(key, event.down)

    def begin(self, seconds: float) -> None:
        """Start a frame; `seconds` have passed since the last one."""
        self._io.display_size = self._imgui.ImVec2(*self._screen.size)
        self._io.delta_time = max(seconds, 1e-4)
        self._imgui.new_frame()

    def end(self) -> None:
        """End a frame and draw it over the screen."""
        self._imgui.render()
        for texture in self._imgui.get_platform_io().textures:
            self._update(texture)
        self.paint()

    def paint(self) -> None:
        """Draw the last frame over the screen once more."""
        data = self._imgui.get_draw_data()
        size = (float(self._screen.size[0]), float(self._screen.size[1]))
        for commands in data.cmd_lists:
            vertices = _bytes(commands.vtx_buffer, self._imgui.VERTEX_SIZE)
            indices = self._indices(commands)
            stretches = [
                Stretch(
                    self._textures[command.tex_ref.get_tex_id()],
                    tuple(command.clip_rect),
                    command.idx_offset,
                    command.elem_count,
                )
                for command in commands.cmd_buffer
                if command.elem_count
            ]
            self._screen.triangles(vertices, indices, size, stretches)

    def _indices(self, commands: Any) -> bytes:
        """Indices of 32 bits, each with the vertex offset of its command."""
        kind = np.uint16 if self._imgui.INDEX_SIZE == 2 else np.uint32
        given = np.frombuffer(_bytes(commands.idx_buffer, self._imgui.INDEX_SIZE), kind).astype(np.uint32)
        for command in commands.cmd_buffer:
            if command.vtx_offset:
                given[command.idx_offset : command.idx_offset + command.elem_count] += command.vtx_offset
        return given.tobytes()

    def _update(self, texture: Any) -> None:
        """Create, update or free a texture on ImGui's request."""
        status = self._imgui.ImTextureStatus
        if texture.status in (status.want_create, status.want_updates):
            pixels = np.asarray(texture.get_pixels_array(), np.uint8).reshape(texture.height, texture.width, -1)
            number = texture.tex_id if texture.status == status.want_updates else 0
            if number:
                self._screen.free(self._textures.pop(number))
            else:
                number = max(self._textures, default=0) + 1
                texture.set_tex_id(number)
            self._textures[number] = self._screen.image(pixels)
            texture.status = status.ok
        elif texture.status == status.want_destroy:
            found = self._textures.pop(texture.tex_id, None)
            if found is not None:
                self._screen.free(found)
            texture.set_tex_id(0)
            texture.status = status.destroyed

    def release(self) -> None:
        """Free textures and context."""
        for texture in self._imgui.get_platform_io().textures:
            if texture.tex_id:
                texture.status = self._imgui.ImTextureStatus.want_destroy
                self._update(texture)
        self._io.backend_flags &= ~self._imgui.BackendFlags_.renderer_has_textures
        self._imgui.destroy_context(self._context)


def _bytes(buffer: Any, size: int) -> bytes:
    count = buffer.size()
    return ctypes.string_at(buffer.data_address(), count * size) if count else b""


def _keys(imgui: Any, glfw: Any) -> dict[int, Any]:
    """ImGui's keys by those of glfw: what its fields need."""
    names = {
        "TAB": "tab",
        "LEFT": "left_arrow",
        "RIGHT": "right_arrow",
        "UP": "up_arrow",
        "DOWN": "down_arrow",
        "HOME": "home",
        "END": "end",
        "DELETE": "delete",
        "BACKSPACE": "backspace",
        "ENTER": "enter",
        "KP_ENTER": "keypad_enter",
        "ESCAPE": "escape",
        **{letter.upper(): letter for letter in "acvxyz"},
    }
    return {getattr(glfw, f"KEY_{there}"): getattr(imgui.Key, here) for there, here in names.items()}
