"""OpenGL contexts: without a screen (EGL, OSMesa) or on a window, hidden or shown. Several may live in one process.

EGL, OSMesa and GLX each keep their own note of which context is current, and on Mesa all three share
one dispatch table. A context that its own library still believes current is not bound again, so the calls
meant for it land in another context, without an error. Hence one rule, kept here: the context that was
current is unbound by its own library before the next one is bound, and all switching goes through
`Context.make_current`.
"""

from __future__ import annotations

import importlib
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import TracebackType
from typing import Any, Self

import moderngl

from raymarch.errors import DeviceError

BACKENDS = ("egl", "osmesa", "window")
"""The backends, in the order in which `auto` tries them."""

EGL_DEVICE_VARIABLE = "RAYMARCH_EGL_DEVICE"
"""Environment variable that selects the EGL device where `open_context` is given none."""

CURES = {
    "egl": "install the packages libegl1 libgl1 libgl1-mesa-dri, or the EGL library of your GPU's driver",
    "osmesa": "install the package libosmesa6",
    "window": "run on a desktop, or install the package xvfb and run under `xvfb-run -a`",
}
"""What to do where a backend does not work, by the names of the Debian and Ubuntu packages."""

_GL_VERSION = 330
_SOFTWARE_RENDERERS = ("llvmpipe", "softpipe", "swrast", "software", "swiftshader", "basic render", "gdi generic")


@dataclass(frozen=True, slots=True)
class Driver:
    """Who draws: the three strings of the driver, and whether the CPU does the work."""

    renderer: str
    vendor: str
    version: str
    is_software: bool


@dataclass(frozen=True, slots=True)
class Limits:
    """What the driver allows: sizes in pixels, uniforms in 32-bit components and in vec4."""

    texture_size: int
    viewport: tuple[int, int]
    renderbuffer_size: int
    fragment_uniform_components: int
    fragment_uniform_vectors: int
    texture_units: int
    color_attachments: int

    @property
    def picture(self) -> tuple[int, int]:
        """The largest (width, height) that can be drawn into a texture."""
        return min(self.texture_size, self.viewport[0]), min(self.texture_size, self.viewport[1])


class Context:
    """One OpenGL 3.3 core context; made by `open_context`, current until another is opened or made current.

    Attributes
    ----------
    gl : the moderngl context. Never enter it with `with`: switch by `make_current`, which keeps count.
    backend : "egl", "osmesa" or "window".
    driver, limits : who draws, and what the driver allows.
    why : why this backend was taken, and what the earlier ones of `auto` answered.
    window : the glfw window of a "window" or "osmesa" context, else None; hidden, but for `open_window`.
    """

    def __init__(self, gl: moderngl.Context, backend: str, why: str, window: Any = None) -> None:
        self.gl = gl
        self.backend = backend
        self.why = why
        self.window = window
        self.driver = _driver(gl.info)
        self.limits = _limits(gl.info)
        self.released = False

    def make_current(self) -> None:
        """Send the calls of this thread to this context. Costs nothing where it is current already.

        Raises DeviceError if the context was released.
        """
        global _current
        if self.released:
            raise DeviceError(f"the {self.backend} context was released", legal="open a new one with open_context")
        if _current is self:
            return
        _unbind_current()
        _enter(self.gl)
        _current = self

    def release(self) -> None:
        """Destroy the context and all that was made in it; another context that is current stays so. Idempotent."""
        if self.released:
            return
        if _current is self:
            _unbind_current()
        self.released = True
        self.gl.release()
        if self.window is not None:
            _GLFW.close(self.window)
            self.window = None

    def __enter__(self) -> Self:
        self.make_current()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.release()

    def __repr__(self) -> str:
        state = "released" if self.released else self.driver.renderer
        return f"<Context {self.backend}: {state}>"


# OpenGL's own idea of a current context is one for each thread; this package draws from one thread.
_current: Context | None = None


def open_context(backend: str = "auto", device: int | None = None) -> Context:
    """Open an OpenGL 3.3 core context and make it current.

    Parameters
    ----------
    backend : "egl" (no screen, any GPU), "osmesa" (no screen, drawn by the CPU), "window" (a hidden window,
        needs a display), or "auto": the first of these that works.
    device : which EGL device, 0 or more. Where None, the environment variable RAYMARCH_EGL_DEVICE, else 0. With "auto",
        one that is given, here or there, means egl and nothing else.

    Raises
    ------
    DeviceError : unknown backend, unusable device number, or no context: with what each backend answered
        and which packages to install.
    """
    if backend != "auto" and backend not in BACKENDS:
        raise DeviceError(f"unknown backend {backend!r}", legal=f"legal: auto, {', '.join(BACKENDS)}")
    if device is not None and backend not in ("auto", "egl"):
        raise DeviceError(f"device={device!r} given for the backend {backend}", legal="only egl has devices to choose")
    number = _egl_device(device)
    if backend == "auto" and (device is not None or os.environ.get(EGL_DEVICE_VARIABLE, "").strip()):
        backend = "egl"  # who names a device wants no other, and only egl has them
    previous = _current
    _unbind_current()
    try:
        return _open_auto(number) if backend == "auto" else _open(backend, number, f"{backend} was asked for")
    except DeviceError:
        if previous is not None:
            previous.make_current()
        raise


def open_window(size: tuple[int, int], title: str) -> Context:
    """Open a window that is shown and can be resized, with an OpenGL 3.3 core context, and make that current.

    Parameters
    ----------
    size : (width, height) in screen coordinates, each >= 1; a window manager may give another.
    title : what its frame says.

    The colours that are drawn into it are taken as sRGB already. Raises DeviceError if there is no display, no glfw or
    no context, with the driver's answer and the cure.
    """
    previous = _current
    _unbind_current()
    try:
        return _open("window", 0, "a window was asked for", (size, title))
    except DeviceError:
        if previous is not None:
            previous.make_current()
        raise


def _open_auto(device: int) -> Context:
    answers: list[str] = []
    for backend in BACKENDS:
        try:
            why = f"auto: the first that works of {', '.join(BACKENDS)}"
            return _open(backend, device, "; ".join([why, *answers]))
        except DeviceError as error:
            answers.append(f"{backend} answered: {error.what}")
    raise DeviceError(
        "no OpenGL context: " + "; ".join(answers), legal="any one will do: " + "; or ".join(CURES[b] for b in BACKENDS)
    )


def _open(backend: str, device: int, why: str, shown: tuple[tuple[int, int], str] | None = None) -> Context:
    """Open this very backend; a DeviceError carries the driver's answer as `what` and the cure as `legal`.

    shown : size and title of a window to be seen; None is a hidden one.
    """
    global _current
    window: Any = None
    try:
        if backend == "egl":
            gl = _create_egl(device)
        else:
            window = _GLFW.open(offscreen=backend == "osmesa", shown=shown)
            gl = _create_on_glfw(window)
        _current = Context(gl, backend, why, window)
    except DeviceError:
        raise
    except Exception as error:  # moderngl and glcontext raise bare Exception and ValueError
        if window is not None:
            _GLFW.close(window)
        other = f"choose another EGL device, also by {EGL_DEVICE_VARIABLE}, 0 is the first; or " if device else ""
        raise DeviceError(_one_line(error), legal=other + CURES[backend]) from error
    return _current


def _egl_device(device: int | None) -> int:
    if device is None:
        text = os.environ.get(EGL_DEVICE_VARIABLE, "").strip() or "0"
        if not (text.isascii() and text.isdigit()):
            raise DeviceError(f"{EGL_DEVICE_VARIABLE}={text!r} is no device number", legal="legal: an integer >= 0")
        return int(text)
    if isinstance(device, bool) or not isinstance(device, int) or device < 0:
        raise DeviceError(f"device={device!r} is no device number", legal="legal: an integer >= 0")
    return device


def _create_egl(device: int) -> moderngl.Context:
    # The stubs of moderngl 5.13 declare every extra setting to be a dict.
    settings: dict[str, Any] = {"backend": "egl", "device_index": device}
    return moderngl.create_context(require=_GL_VERSION, standalone=True, **settings)


def _create_on_glfw(window: Any) -> moderngl.Context:
    binding = _GlfwBinding(window)
    binding.__enter__()
    settings: dict[str, Any] = {"context": binding}
    try:
        return moderngl.create_context(require=_GL_VERSION, **settings)
    except Exception:
        binding.__exit__()
        raise


def _unbind_current() -> None:
    global _current
    if _current is not None:
        _exit(_current.gl)
        _current = None


def _enter(gl: Any) -> None:
    """Bind; `Any`, because moderngl's stubs leave entering and leaving untyped."""
    gl.__enter__()


def _exit(gl: Any) -> None:
    gl.__exit__(None, None, None)


class _GlfwBinding:
    """What moderngl asks of a foreign context: the addresses of GL functions, binding and unbinding."""

    def __init__(self, window: Any) -> None:
        self._window = window
        self._glfw = _import_glfw()

    def load_opengl_function(self, name: str) -> int:
        address: int | None = self._glfw.get_proc_address(name)
        return address or 0

    load = load_opengl_function  # moderngl's older name for it

    def __enter__(self) -> None:
        self._glfw.make_context_current(self._window)

    def __exit__(self, *_: object) -> None:
        self._glfw.make_context_current(None)

    def release(self) -> None:
        """Nothing: the window owns the context, and `Context.release` closes the window."""


class _Glfw:
    """The process's one glfw: it runs one platform at a time, so OSMesa (null platform) and a screen exclude
    each other while a window of either lives."""

    def __init__(self) -> None:
        self._live: list[Any] = []
        self._started_here = False

    def open(self, *, offscreen: bool, shown: tuple[tuple[int, int], str] | None = None) -> Any:
        """A window with a GL 3.3 core context: of OSMesa where `offscreen`, else of the display; see `_open`."""
        with _quiet_glfw() as answer:
            glfw = _import_glfw()
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
        with _quiet_glfw():
            _import_glfw().destroy_window(window)

    def _start(self, glfw: Any, offscreen: bool, answer: Callable[[str], str]) -> None:
        if glfw.get_version() < (3, 4, 0):
            raise DeviceError(
                f"glfw {'.'.join(map(str, glfw.get_version()))} is too old",
                legal="needs the GLFW library 3.4: pip install -U glfw",
            )
        running = glfw.get_platform()  # 0 where glfw is not initialised
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
            raise DeviceError(
                f"{wanted} and {other} contexts cannot live in one process: glfw runs one platform at a time",
                legal=f"release the {len(self._live)} live {other} context(s) first, or take egl",
            )
        if not self._started_here:
            raise DeviceError(
                f"glfw was started by other code on a platform without {wanted} contexts",
                legal="call glfw.terminate() there first, or take egl",
            )


_GLFW = _Glfw()


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
def _quiet_glfw() -> Iterator[Callable[[str], str]]:
    """glfw without its warnings; gives a function that yields glfw's last error text, or the default."""
    glfw = _import_glfw()

    def answer(default: str) -> str:
        text: bytes | None = glfw.get_error()[1]
        return text.decode(errors="replace") if text else default

    before, glfw.ERROR_REPORTING = glfw.ERROR_REPORTING, "ignore"
    try:
        yield answer
    finally:
        glfw.ERROR_REPORTING = before


def _import_glfw() -> Any:
    """glfw, only when it is needed: importing it loads a shared library, which EGL does without."""
    try:
        return importlib.import_module("glfw")
    except ImportError as error:
        raise DeviceError(f"glfw cannot be imported: {_one_line(error)}", legal="pip install glfw") from error


def _one_line(error: BaseException) -> str:
    return " ".join(str(error).split()) or type(error).__name__


def _driver(info: dict[str, Any]) -> Driver:
    renderer = str(info["GL_RENDERER"])
    is_software = any(word in renderer.lower() for word in _SOFTWARE_RENDERERS)
    return Driver(renderer, str(info["GL_VENDOR"]), str(info["GL_VERSION"]), is_software)


def _limits(info: dict[str, Any]) -> Limits:
    width, height = info["GL_MAX_VIEWPORT_DIMS"]
    components = int(info["GL_MAX_FRAGMENT_UNIFORM_COMPONENTS"])
    return Limits(
        texture_size=int(info["GL_MAX_TEXTURE_SIZE"]),
        viewport=(int(width), int(height)),
        renderbuffer_size=int(info["GL_MAX_RENDERBUFFER_SIZE"]),
        fragment_uniform_components=components,
        # The count in vec4 came with OpenGL 4.1; a 3.3 driver may not answer.
        fragment_uniform_vectors=int(info.get("GL_MAX_FRAGMENT_UNIFORM_VECTORS") or components // 4),
        texture_units=int(info["GL_MAX_TEXTURE_IMAGE_UNITS"]),
        color_attachments=min(int(info["GL_MAX_COLOR_ATTACHMENTS"]), int(info["GL_MAX_DRAW_BUFFERS"])),
    )
