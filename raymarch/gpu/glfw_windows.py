"""The single glfw of the process: windows, and the offscreen contexts of OSMesa."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from raymarch.errors import DeviceError

CURES = {
    "egl": "install the packages libegl1 libgl1 libgl1-mesa-dri, or the EGL library of your GPU's driver",
    "osmesa": "install the package libosmesa6",
    "window": "run on a desktop, or install the package xvfb and run under `xvfb-run -a`",
}
"""How to make each backend work; package names are those of Debian and Ubuntu."""


class GlfwBinding:
    """The interface that moderngl needs of a foreign context: addresses of GL functions, binding and unbinding."""

    def __init__(self, window: Any) -> None:
        self._window = window
        self._glfw = import_glfw()

    def load_opengl_function(self, name: str) -> int:
        address: int | None = self._glfw.get_proc_address(name)
        return address or 0

    load = load_opengl_function  # moderngl's older name for it

    def __enter__(self) -> None:
        self._glfw.make_context_current(self._window)

    def __exit__(self, *_: object) -> None:
        self._glfw.make_context_current(None)

    def release(self) -> None:
        """Do nothing: the window owns the context, and `Context.release` closes the window."""


class Glfw:
    """The single glfw of the process. It runs one platform at a time, so OSMesa (null platform) and a display exclude
    each other while a window of either exists."""

    def __init__(self) -> None:
        self._live: list[Any] = []
        self._started_here = False

    def open(self, *, offscreen: bool, shown: tuple[tuple[int, int], str] | None = None) -> Any:
        """Open a window with a GL 3.3 core context, of OSMesa if `offscreen`, else of the display; see `_open`."""
        with quiet_glfw() as answer:
            glfw = import_glfw()
            self._start(glfw, offscreen, answer)
            glfw.default_window_hints()
            for hint, value in _window_hints(glfw, offscreen, shown is not None):
                glfw.window_hint(hint, value)
            (width, height), title = shown or ((16, 16), "raymarch")
            window = glfw.create_window(width, height, title, None, None)
            if not window:
                backend = "osmesa" if offscreen else "window"
                raise DeviceError(answer("glfw made no window"), legal=CURES[backend])
        self._live.append(window)
        return window

    def close(self, window: Any) -> None:
        self._live.remove(window)
        with quiet_glfw():
            import_glfw().destroy_window(window)

    def _start(self, glfw: Any, offscreen: bool, answer: Callable[[str], str]) -> None:
        if glfw.get_version() < (3, 4, 0):
            what = f"glfw {'.'.join(map(str, glfw.get_version()))} is too old"
            raise DeviceError(what, legal="needs the GLFW library 3.4: pip install -U glfw")
        running = glfw.get_platform()  # 0 if glfw is not initialized
        if running and (running == glfw.PLATFORM_NULL) == offscreen:
            return
        if running:
            self._refuse_to_switch(offscreen)
            glfw.terminate()
        glfw.init_hint(glfw.PLATFORM, glfw.PLATFORM_NULL if offscreen else glfw.ANY_PLATFORM)
        self._started_here = bool(glfw.init())
        if not self._started_here:
            raise DeviceError(answer("glfw did not start"), legal=CURES["osmesa" if offscreen else "window"])

    def _refuse_to_switch(self, offscreen: bool) -> None:
        wanted, other = ("osmesa", "window") if offscreen else ("window", "osmesa")
        if self._live:
            what = f"{wanted} and {other} contexts cannot exist in one process: glfw runs one platform at a time"
            raise DeviceError(what, legal=f"release the {len(self._live)} live {other} context(s) first, or take egl")
        if not self._started_here:
            what = f"glfw was started by other code on a platform without {wanted} contexts"
            raise DeviceError(what, legal="call glfw.terminate() there first, or take egl")


GLFW = Glfw()


def _window_hints(glfw: Any, offscreen: bool, shown: bool) -> list[tuple[int, int]]:
    hints = [
        (glfw.VISIBLE, int(shown)),
        (glfw.SCALE_TO_MONITOR, int(shown)),
        (glfw.CONTEXT_VERSION_MAJOR, 3),
        (glfw.CONTEXT_VERSION_MINOR, 3),
        (glfw.OPENGL_PROFILE, glfw.OPENGL_CORE_PROFILE),
    ]
    if offscreen:  # OSMesa refuses a forward-compatible context; macOS gives a core profile to no other
        hints.append((glfw.CONTEXT_CREATION_API, glfw.OSMESA_CONTEXT_API))
    elif sys.platform == "darwin":
        hints.append((glfw.OPENGL_FORWARD_COMPAT, 1))
    return hints


@contextmanager
def quiet_glfw() -> Iterator[Callable[[str], str]]:
    """Silence glfw's warnings. Yields a function that returns glfw's last error text, or the default."""
    glfw = import_glfw()

    def answer(default: str) -> str:
        text: bytes | None = glfw.get_error()[1]
        return text.decode(errors="replace") if text else default

    before, glfw.ERROR_REPORTING = glfw.ERROR_REPORTING, "ignore"
    try:
        yield answer
    finally:
        glfw.ERROR_REPORTING = before


def import_glfw() -> Any:
    """Import glfw on demand: it loads a shared library that EGL does not need."""
    try:
        return importlib.import_module("glfw")
    except ImportError as error:
        raise DeviceError(f"glfw cannot be imported: {one_line(error)}", legal="pip install glfw") from error


def one_line(error: BaseException) -> str:
    return " ".join(str(error).split()) or type(error).__name__
