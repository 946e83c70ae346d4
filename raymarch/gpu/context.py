"""OpenGL contexts: headless (EGL, OSMesa) or on a window, hidden or visible. Several may exist in one process.

Every OpenGL call happens inside `Context.bound`, which queries the platform for the current context, makes this one
current for the block, and restores the previous one. Outside these blocks the context is current in no thread, so any
thread may use it, one at a time, and the contexts of other code are not disturbed. A forked process may not use it.
"""

from __future__ import annotations

import atexit
import ctypes
import os
import sys
import threading
import weakref
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import Any, Self, TypeAlias

import moderngl

from raymarch.errors import DeviceError, user_location
from raymarch.expr.convert import plain, short
from raymarch.gpu import current
from raymarch.gpu.driver import driver_of, limits_of
from raymarch.gpu.driver_cache import note_opening
from raymarch.gpu.fences import Fences
from raymarch.gpu.glfw_windows import CURES, GLFW, GlfwBinding, import_glfw, one_line
from raymarch.gpu.signals import deferred
from raymarch.plan.device import DeviceClass

BACKENDS = ("egl", "osmesa", "window")
"""The backends, in the order in which `auto` tries them."""

EGL_DEVICE_VARIABLE = "RAYMARCH_EGL_DEVICE"
"""Environment variable with the EGL device to use if `open_context` is called without one."""

_GL_VERSION, _GL_WITH_COMPUTE = 330, 430
"""The second is asked for first, where it may be had: some drivers give exactly the version that is asked for."""


class Releasing:
    """What is released at the end of a `with` block."""

    def release(self) -> None:
        """Free the resources. Idempotent."""
        raise NotImplementedError

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.release()


class _Bound:
    """The block of `Context.bound`. Each draw call enters several, so an inner one costs a lock, and with llvmpipe the
    fence of what it drew."""

    __slots__ = ("_context", "_idle", "_outermost")

    def __init__(self, context: Context, idle: bool) -> None:
        self._context = context
        self._idle = idle  # at the end of the block
        self._outermost: AbstractContextManager[None] | None = None

    def __enter__(self) -> Context:
        context = self._context
        context.check()  # before the lock, which stays locked for ever if another thread held it at the fork
        context._lock.acquire()
        if context._held:  # by a block of this thread around this one; other code runs inside `lent` only
            return context
        try:
            self._outermost = context._made_current()
            self._outermost.__enter__()
        except BaseException:
            context._lock.release()
            raise
        return context

    def __exit__(self, *error: Any) -> None:
        context = self._context
        try:
            if not (self._idle or context.released):
                context._fences.keep()
        finally:
            try:
                if self._outermost is not None:
                    self._outermost.__exit__(*error)
            finally:
                context._lock.release()


class Context(Releasing):
    """One OpenGL 3.3 core context, made by `open_context`. It is current only inside `with context.bound():`.

    gl : the moderngl context. Use it and its objects inside `bound` only; never enter it with `with`.
    backend : "egl", "osmesa" or "window".
    driver, limits : identification and limits of the driver.
    why : why this backend was chosen, and the errors of backends that `auto` tried before.
    window : the glfw window of a "window" or "osmesa" context, else None. Hidden, unless made by `open_window`.
    device : for which new renderers plan scenes; None for `driver.device_class`.
    kept : objects of other modules that live as long as the context.
    unread : what frames have not read yet (`raymarch.gpu.unread.Unread`). It is read before its texture changes, before
        the context is released, and before a fork of the process.
    """

    def __init__(self, gl: moderngl.Context, backend: str, why: str, window: Any = None) -> None:
        self.gl = gl
        self.backend = backend
        self.why = why
        self.window = window
        self.driver = driver_of(gl.info)
        self.limits = limits_of(gl.info)
        found = current.current()
        if len(found) != 1:
            raise DeviceError(f"{len(found)} platform libraries report the new context as current, not 1")
        (self._binding,) = found
        self._process = os.getpid()
        self._opened = f"thread {threading.current_thread().name}, {user_location() or 'no file'}"
        self._lock = threading.RLock()
        self._callers: list[tuple[Any, current.Current]] = []
        self._held = False  # known to be current: inside `bound`, but not inside `lent`
        self._released = False
        self._fences = Fences(gl, self.driver.renderer)
        self.kept: dict[str, Any] = {}
        self.unread: weakref.WeakSet[Any] = weakref.WeakSet()
        self.device: DeviceClass | None = None
        _CONTEXTS.add(self)

    @property
    def released(self) -> bool:
        """True after `release`, and in a process forked from the one that opened the context, which can neither use nor
        free it."""
        return self._released or self._process != _here

    def check(self) -> None:
        """DeviceError if the context was released, or was opened before a fork of the process."""
        self.refuse_fork()
        if self._released:
            raise DeviceError(f"the {self.backend} context was released", legal="open a new one with open_context")

    def refuse_fork(self) -> None:
        """DeviceError in a process that was forked from the one that opened the context."""
        if self._process != _here:
            raise _forked(f"the {self.backend} context was opened before the fork ({self._opened})")

    def bound(self) -> _Bound:
        """Make this context current for the block, then restore the previous one.

        Blocks may be nested. A thread waits while another thread is inside a block of the same context.
        Raises DeviceError if the context was released, was opened before a fork, or cannot be made current.
        """
        return _Bound(self, False)

    def bound_until_idle(self) -> _Bound:
        """As `bound`, for a block whose last call is `finish`."""
        return _Bound(self, True)

    @contextmanager
    def _made_current(self) -> Iterator[None]:
        """The outermost of nested blocks, inside the lock."""
        self.check()
        if current.is_current(self._binding):
            with self._holding(True):
                yield
            return
        self._callers.append(self._caller())
        try:
            self._bind()
            with self._holding(True):
                yield
        finally:
            self._give_back(self._callers.pop())

    @contextmanager
    def lent(self) -> Iterator[None]:
        """Inside `bound`, restore the previous context for the block, to call other code."""
        if not self._held:
            yield
            return
        own = not self._callers  # the context was current before `bound`
        if not own:
            self._give_back(self._callers[-1])
        try:
            with self._holding(False):
                yield
        finally:
            if not self.released:
                if not own:
                    self._callers[-1] = self._caller()
                if not current.is_current(self._binding):
                    self._bind()

    @contextmanager
    def _holding(self, held: bool) -> Iterator[None]:
        before, self._held = self._held, held
        try:
            yield
        finally:
            self._held = before

    def finish(self) -> None:
        """Wait until the device is idle. Other threads of Python run in the meantime."""
        with self.bound_until_idle():
            self._fences.finish()

    def _bind(self) -> None:
        current.unbind()
        if self.window is None:
            current.bind((self._binding,))
        else:
            import_glfw().make_context_current(self.window)
        if not current.is_current(self._binding):
            raise DeviceError(
                f"the {self.backend} context ({self._opened}) cannot be made current in thread "
                f"{threading.current_thread().name}",
                legal="release it where other code made it current, or open another context",
            )

    def _caller(self) -> tuple[Any, current.Current]:
        """The current context: glfw's own record of a window, if glfw is used here, and the platform's."""
        noted = None if self.window is None else import_glfw().get_current_context()
        return noted or None, current.current()

    def _give_back(self, caller: tuple[Any, current.Current]) -> None:
        if self._process != _here:
            return  # forked inside the block: the current context belongs to the parent
        noted, before = caller
        if noted is not None or self.window is not None:
            import_glfw().make_context_current(noted)
        current.bind(before)

    def release(self) -> None:
        """Destroy the context and its objects. Another current context stays current. Idempotent."""
        if self.released:
            return
        with self._lock:
            if self._released:
                return
            self.read_unread()
            with _OPENING, deferred(), current.kept():
                self._released = True
                self.gl.release()
                if self.window is not None:
                    GLFW.close(self.window)
                    self.window = None

    def read_unread(self) -> None:
        """Read what frames still need of all textures."""
        if self.unread:
            with self._lock:
                for unread in list(self.unread):
                    unread.read_all()

    def __enter__(self) -> Self:
        self.check()
        return self

    def __repr__(self) -> str:
        state = "released" if self.released else self.driver.renderer
        return f"<Context {self.backend}: {state}>"


_CONTEXTS: weakref.WeakSet[Context] = weakref.WeakSet()
_OPENING = threading.RLock()  # glfw keeps its windows in unlocked lists
_process, _opened = os.getpid(), False
_here = os.getpid()  # to ask the system takes longer than all else that a block of `bound` does
_idle: tuple[Any, Context] | None = None  # of `kept_context`


def _forked(what: str) -> DeviceError:
    return DeviceError(
        f"{what}, and drivers of OpenGL do not survive a fork",
        legal='start processes by "spawn" or "forkserver", as in multiprocessing.get_context("spawn").Pool()',
    )


def _refuse_after_fork() -> None:
    """DeviceError in a forked process whose parent has used OpenGL: the driver's threads do not exist there, and a call
    that waits for them never returns."""
    global _process
    if _process != os.getpid():
        if _opened or current.has_driver():
            raise _forked("this process was forked from one that had used OpenGL")
        _process = os.getpid()


def _read_all_unread() -> None:
    """Before a fork: the new process cannot read textures."""
    for context in list(_CONTEXTS):
        if not context.released:
            context.read_unread()


def _leave_to_parent() -> None:
    """After a fork, prevent the garbage collector and the driver's exit handlers from destroying the parent's objects.

    The exit handler of Mesa's OSMesa waits for ever for threads that the fork did not copy; a hardware driver may free
    objects that both processes share. glibc's `on_exit` runs its functions in reverse order, so the process ends first.
    """
    global _here
    _here = os.getpid()
    for context in _CONTEXTS:
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(context.gl))
    if _opened and sys.platform == "linux":
        libc = ctypes.CDLL(None)
        if hasattr(libc, "on_exit"):
            atexit.register(libc.fflush, None)
            libc.on_exit(libc._exit, None)


if hasattr(os, "register_at_fork"):
    os.register_at_fork(before=_read_all_unread, after_in_child=_leave_to_parent)


def open_context(backend: str = "auto", device: int | None = None) -> Context:
    """Open an OpenGL 3.3 core context. It does not become current: use it inside `with context.bound():`.

    Parameters
    ----------
    backend : "egl" (headless, any GPU), "osmesa" (headless, rendered on the CPU), "window" (a hidden window, needs a
        display), or "auto": the first of these that works.
    device : index of the EGL device, >= 0. None uses the environment variable RAYMARCH_EGL_DEVICE, else 0. With "auto",
        an index from either source restricts the choice to egl.

    Raises
    ------
    DeviceError : unknown backend, invalid device number, or no context; the message has the error of each backend and
        the packages to install. Also in a process forked from one that has used OpenGL, which drivers do not support.
    """
    if not isinstance(backend, str) or backend not in ("auto", *BACKENDS):
        raise DeviceError(f"unknown backend {short(backend)}", legal=f"auto, {', '.join(BACKENDS)}")
    if device is not None and backend not in ("auto", "egl"):
        what = f"device={short(device)} given for the backend {backend}"
        raise DeviceError(what, legal="only egl has devices to choose")
    number = _egl_device(device)
    if backend == "auto" and (device is not None or os.environ.get(EGL_DEVICE_VARIABLE, "").strip()):
        backend = "egl"  # only egl has devices
    _refuse_after_fork()
    with _opening():
        return _open_auto(number) if backend == "auto" else _open(backend, number, f"{backend} was asked for")


@contextmanager
def kept_context(backend: str = "auto") -> Iterator[Context]:
    """A context for the block, which the next such block of the process uses again if it asks for the same.

    To open one takes milliseconds, on a GPU tens of them, and moderngl 5.13 never frees 39 kB of each. An error in the
    block, and the end of the process, release it. Parameters and errors are those of `open_context`.
    """
    asked = (backend, *(os.environ.get(name) for name in (EGL_DEVICE_VARIABLE, "RAYMARCH_DRAW_BY")))
    taken = _exchange_idle(None)
    if taken is not None and taken[0] == asked and not taken[1].released:
        context = taken[1]
    else:
        _release(taken)
        context = open_context(backend)
    try:
        yield context
    except BaseException:
        context.release()
        raise
    _release(_exchange_idle((asked, context)) if context.window is None else (asked, context))


_Idle: TypeAlias = "tuple[Any, Context] | None"
"""What a context was asked for, and the context."""


def _exchange_idle(new: _Idle) -> _Idle:
    global _idle
    with _OPENING:
        old, _idle = _idle, new
    return old


def _release(idle: _Idle) -> None:
    if idle is not None:
        idle[1].release()


atexit.register(lambda: _release(_exchange_idle(None)))


def open_window(size: tuple[int, int], title: str) -> Context:
    """Open a visible, resizable window with an OpenGL 3.3 core context.

    size : (width, height) in screen coordinates, each >= 1; a window manager may give another.

    The framebuffer takes colours that are already sRGB. Raises DeviceError, with the driver's message and a remedy, if
    there is no display, no glfw or no context.
    """
    _refuse_after_fork()
    with _opening():
        return _open("window", 0, "a window was asked for", (size, title))


@contextmanager
def _opening() -> Iterator[None]:
    """Restore the current context, and the result of `moderngl.get_context` for other code, after the block."""
    store: Any = getattr(moderngl, "_store", None)
    default = getattr(store, "default_context", None)
    note_opening()
    with _OPENING, deferred(), current.kept():
        try:
            yield
        finally:
            if store is not None:
                store.default_context = default


def _open_auto(device: int) -> Context:
    answers: list[str] = []
    for backend in BACKENDS:
        try:
            why = f"auto: the first that works of {', '.join(BACKENDS)}"
            return _open(backend, device, "; ".join([why, *answers]))
        except DeviceError as error:
            answers.append(f"{backend}: {error.what}")
    cures = "; or ".join(CURES[backend] for backend in BACKENDS)
    raise DeviceError(f"no OpenGL context: {'; '.join(answers)}", legal=f"any one will do: {cures}")


def _open(backend: str, device: int, why: str, shown: tuple[tuple[int, int], str] | None = None) -> Context:
    """Open this backend. A DeviceError has the driver's message as `what` and a remedy as `legal`.

    shown : size and title of a visible window; None for a hidden one.
    """
    global _opened
    window: Any = None
    try:
        if backend == "egl":
            context = Context(_create_egl(device), backend, why)
        else:
            window = GLFW.open(offscreen=backend == "osmesa", shown=shown)
            with _kept_note():
                context = Context(_create_on_glfw(window), backend, why, window)
    except DeviceError:
        raise
    except Exception as error:  # moderngl and glcontext raise bare Exception and ValueError
        if window is not None:
            GLFW.close(window)
        other = f"choose another EGL device, also by {EGL_DEVICE_VARIABLE}, 0 is the first; or " if device else ""
        raise DeviceError(one_line(error), legal=other + CURES[backend]) from error
    _opened = True
    return context


@contextmanager
def _kept_note() -> Iterator[None]:
    """Restore glfw's record of its current window after the block."""
    glfw = import_glfw()
    noted = glfw.get_current_context() or None
    try:
        yield
    finally:
        glfw.make_context_current(noted)


def _egl_device(device: int | None) -> int:
    number, given = plain(device), f"device={short(device)}"
    if device is None:
        text = os.environ.get(EGL_DEVICE_VARIABLE, "").strip() or "0"
        number, given = int(text) if text.isascii() and text.isdigit() else None, f"{EGL_DEVICE_VARIABLE}={text!r}"
    if isinstance(number, bool) or not isinstance(number, int) or not 0 <= number < 1 << 31:
        raise DeviceError(f"{given} is no device number", legal="an integer >= 0")
    return number


def _create_egl(device: int) -> moderngl.Context:
    settings: dict[str, Any] = {"backend": "egl", "device_index": device}  # to moderngl's stubs each setting is a dict
    try:
        return moderngl.create_context(require=_GL_WITH_COMPUTE, standalone=True, **settings)
    except Exception:  # moderngl raises it bare; what else is wrong is told by the second try
        return moderngl.create_context(require=_GL_VERSION, standalone=True, **settings)


def _create_on_glfw(window: Any) -> moderngl.Context:
    binding = GlfwBinding(window)
    binding.__enter__()
    settings: dict[str, Any] = {"context": binding}
    try:
        return moderngl.create_context(require=_GL_VERSION, **settings)
    except Exception:
        binding.__exit__()
        raise
