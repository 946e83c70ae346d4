"""The OpenGL context that is current in this thread, queried from the platform's libraries each time.

Any code of the process may make another context current at any time. EGL, GLX and OSMesa each keep their own record; on
Mesa they share one dispatch table, and a library does not bind a context again that it still records as current. This
module therefore unbinds the current context through its own library before it binds another one.
"""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

_EGL_DRAW, _EGL_READ = 0x3059, 0x305A
_OSMESA_TYPE = 0x23


class Api:
    """A library that makes contexts current. `asks` are its query functions, with their arguments; their results are
    the arguments of `make`, and the last of them returns the context."""

    def __init__(self, files: tuple[str, ...], make: str, *asks: tuple[Any, ...]) -> None:
        self._files, self._make_name, self._asks_names = files, make, asks
        self._make: Any = None
        self._asks: list[tuple[Any, tuple[int, ...]]] = []
        self._missing_at: int | None = None  # the result of `_count_loads` when the library was missing

    def _loaded(self) -> bool:
        """True if the library is in the process's memory. Does not load it."""
        if self._make is None:
            loads = _count_loads()
            if loads is None or loads != self._missing_at:
                library = next(filter(None, map(_loaded, self._files)), None)
                if library is not None:
                    self._find(library)
                self._missing_at = loads
        return self._make is not None

    def _find(self, library: Any) -> None:
        for name, *arguments in self._asks_names:
            ask = getattr(library, name)
            ask.restype, ask.argtypes = ctypes.c_void_p, [ctypes.c_int] * len(arguments)
            self._asks.append((ask, tuple(arguments)))
        make = getattr(library, self._make_name)
        make.argtypes = [ctypes.c_void_p] * len(self._asks)
        self._make = make

    def current(self) -> tuple[int, ...] | None:
        """The arguments for `bind` to restore the current context; None if there is none."""
        if self.context() is None:
            return None
        values = tuple(ask(*arguments) or 0 for ask, arguments in self._asks)
        return values if values[-1] else None

    def context(self) -> int | None:
        """The address of the current context."""
        if not self._loaded():
            return None
        ask, arguments = self._asks[-1]
        address: int | None = ask(*arguments)
        return address

    def bind(self, values: tuple[int, ...]) -> None:
        """Make a context current."""
        self._make(*values)

    def unbind(self, values: tuple[int, ...]) -> None:
        """Unbind the current context, which `values` describe."""
        self._make(*(values[:1] if len(values) > 1 else ()), *[0] * (len(values) - min(1, len(values) - 1)))


OSMESA_FILES = (
    ("libOSMesa.so.8", "libOSMesa.so.6", "libOSMesa.8.dylib") if sys.platform != "win32" else ("libOSMesa", "OSMesa")
)
"""File names under which glfw looks for the library."""


class OSMesa(Api):
    """OSMesa: binds a context together with a memory buffer."""

    def __init__(self) -> None:
        super().__init__(OSMESA_FILES, "OSMesaMakeCurrent", ("OSMesaGetCurrentContext",))

    def _find(self, library: Any) -> None:
        super()._find(library)
        self._buffer, self._integer = library.OSMesaGetColorBuffer, library.OSMesaGetIntegerv
        self._buffer.argtypes = [ctypes.c_void_p] * 5
        self._integer.argtypes = [ctypes.c_int, ctypes.c_void_p]
        self._make.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_uint, ctypes.c_int, ctypes.c_int]

    def current(self) -> tuple[int, ...] | None:
        found = super().current()
        if found is None:
            return None
        kind, width, height, layout = (ctypes.c_int() for _ in range(4))
        memory = ctypes.c_void_p()
        self._integer(_OSMESA_TYPE, ctypes.byref(kind))
        self._buffer(*found, *(ctypes.addressof(value) for value in (width, height, layout, memory)))
        return memory.value or 0, kind.value, width.value, height.value, *found

    def bind(self, values: tuple[int, ...]) -> None:
        memory, kind, width, height, context = values
        self._make(context, memory, kind, width, height)

    def unbind(self, values: tuple[int, ...]) -> None:
        self._make(None, None, 0, 0, 0)


EGL = Api(
    (os.environ.get("GLCONTEXT_LINUX_LIBEGL", ""), "libEGL.so.1", "libEGL.so"),
    "eglMakeCurrent",
    ("eglGetCurrentDisplay",),
    ("eglGetCurrentSurface", _EGL_DRAW),
    ("eglGetCurrentSurface", _EGL_READ),
    ("eglGetCurrentContext",),
)
GLX = Api(
    (os.environ.get("GLCONTEXT_LINUX_LIBGL", ""), "libGLX.so.0", "libGL.so.1"),
    "glXMakeContextCurrent",
    ("glXGetCurrentDisplay",),
    ("glXGetCurrentDrawable",),
    ("glXGetCurrentReadDrawable",),
    ("glXGetCurrentContext",),
)
WGL = Api(("opengl32",), "wglMakeCurrent", ("wglGetCurrentDC",), ("wglGetCurrentContext",))
CGL = Api(("/System/Library/Frameworks/OpenGL.framework/OpenGL",), "CGLSetCurrentContext", ("CGLGetCurrentContext",))

_APIS: tuple[Api, ...] = {"win32": (WGL,), "darwin": (CGL,)}.get(sys.platform, (EGL, GLX))
_LAST = OSMesa()


class Binding(NamedTuple):
    """A context that is current in an API, and the arguments to bind it again."""

    api: Api
    values: tuple[int, ...]


Current = tuple[Binding, ...]
"""The current contexts of a thread: at most one, unless other code left several APIs in conflict."""


def current() -> Current:
    """The current contexts of this thread."""
    found = tuple(Binding(api, values) for api in _APIS if (values := api.current()) is not None)
    if not found and (values := _LAST.current()) is not None:  # OSMesa reports any context of Mesa as its own
        found = (Binding(_LAST, values),)
    return found


def is_current(binding: Binding) -> bool:
    """True if this context, and no other, is current in this thread."""
    for api in _APIS:
        if api.context() != (binding.values[-1] if api is binding.api else None):
            return False
    return binding.api is not _LAST or _LAST.context() == binding.values[-1]


def unbind() -> None:
    """Make no context current in this thread."""
    for _ in range(2):  # OSMesa reports correctly once the others are unbound
        for binding in current():
            binding.api.unbind(binding.values)


def bind(wanted: Current) -> None:
    """Restore the result of an earlier `current()`."""
    if current() != wanted:
        unbind()
        for binding in wanted:
            binding.api.bind(binding.values)


@contextmanager
def kept() -> Iterator[None]:
    """Unbind the current context for the block, then restore it."""
    before = current()
    unbind()
    try:
        yield
    finally:
        unbind()
        bind(before)


DRIVERS = ("_dri.so", "libgallium", "libOSMesa", "libEGL_mesa", "libGLX_mesa", "libEGL_nvidia", "libGLX_nvidia")
"""Parts of the file names of drivers, which are loaded with the first display or context."""


def has_driver() -> bool:
    """True if an OpenGL driver is in the process's memory. False if the system cannot tell."""
    try:
        with open("/proc/self/maps", encoding="utf-8", errors="replace") as maps:
            return any(name in line for line in maps for name in DRIVERS)
    except OSError:
        return False


def _loaded(file: str) -> Any:
    """A library that is already in memory, or None."""
    handle = _in_memory(file) if file else None
    return ctypes.CDLL(file, handle=handle) if handle else None


def _asker() -> Any:
    """A function that returns the handle of a loaded library by its file name."""
    if sys.platform == "win32":
        find = ctypes.WinDLL("kernel32").GetModuleHandleW
        find.restype, find.argtypes = ctypes.c_void_p, [ctypes.c_wchar_p]
    else:
        opener = ctypes.CDLL(None).dlopen
        opener.restype, opener.argtypes = ctypes.c_void_p, [ctypes.c_char_p, ctypes.c_int]

        def find(file: str) -> Any:
            return opener(file.encode(), os.RTLD_NOLOAD | os.RTLD_LAZY)

    return find


_in_memory = _asker()


class _Loaded(ctypes.Structure):
    """The beginning of `dl_phdr_info`, which describes a loaded library."""

    _fields_ = (
        ("addr", ctypes.c_void_p),
        ("name", ctypes.c_char_p),
        ("headers", ctypes.c_void_p),
        ("count", ctypes.c_uint16),
        ("loads", ctypes.c_ulonglong),
    )


def _load_counter() -> Callable[[], int | None]:
    """A function that returns how many libraries the process has loaded so far; None if the system does not tell.

    A search for a library that is not loaded opens files, and takes 0.1 ms. This number is there in a microsecond. The
    calls keep Python's lock: a thread that loads a library may wait for that lock.
    """
    try:
        iterate = ctypes.PyDLL(None).dl_iterate_phdr
    except (AttributeError, OSError, TypeError):
        return lambda: None
    found: list[int | None] = [None]

    def first(library: Any, size: int, _: Any) -> int:
        found[0] = int(library.contents.loads) if size >= ctypes.sizeof(_Loaded) else None
        return 1  # no further libraries

    callback = ctypes.PYFUNCTYPE(ctypes.c_int, ctypes.POINTER(_Loaded), ctypes.c_size_t, ctypes.c_void_p)(first)

    def count() -> int | None:
        iterate(callback, None)
        return found[0]

    return count


_count_loads = _load_counter()
