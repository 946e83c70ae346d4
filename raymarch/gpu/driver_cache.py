"""The driver's own cache of compiled shaders on disk, which hides what a first frame costs."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

SWITCHES = {"MESA_SHADER_CACHE_DISABLE": "true", "MESA_GLSL_CACHE_DISABLE": "true", "__GL_SHADER_DISK_CACHE": "0"}
"""Environment variables that switch it off: of Mesa, of Mesa before 21.3, and of NVIDIA."""

_first: list[bool] = []
"""Whether it was off when the first context of this process was opened. Drivers read the variables there and then."""


@contextmanager
def without_driver_cache() -> Iterator[None]:
    """Contexts that are opened inside of the block, before all others of this process, have no cache on disk."""
    before = {name: os.environ.get(name) for name in SWITCHES}
    os.environ.update(SWITCHES)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def note_opening() -> None:
    """Called where a context is opened."""
    if not _first:
        _first.append(all(os.environ.get(name) == value for name, value in SWITCHES.items()))


def is_off() -> bool:
    """True if the contexts of this process certainly have no cache on disk."""
    return _first == [True]
