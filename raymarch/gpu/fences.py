"""The fences of what was drawn, which Mesa's software renderer frees too early.

The threads of llvmpipe draw scene after scene: what lies between two flushes. A thread that is done counts itself in
the scene's fence, and then unlocks the fence. The thread that submits scenes reads the count without the lock, and
frees the fence once it is complete. If the system has paused the drawing thread in between, that thread later unlocks
memory that was freed. It overwrites four bytes by 0, and the process dies, mostly later and elsewhere: "free():
corrupted unsorted chunks". Mesa 22.3 does so, and the source of later versions reads the same.

A sync object of OpenGL keeps the fence of the last scene in memory. It is not needed any more once a later scene is
done, because no thread begins with that before it has left the fence.
"""

from __future__ import annotations

import ctypes
from collections import deque
from collections.abc import Callable
from typing import Any

import moderngl

_COMMANDS_COMPLETE = 0x9117
"""GL_SYNC_GPU_COMMANDS_COMPLETE."""

MOST = 256
"""Number of sync objects at which this waits for the device, to delete them."""


class Fences:
    """Waits for the device, and keeps the fences of its scenes until then.

    gl : the context, current here and in every method.
    renderer : the driver's. Only fences of llvmpipe are kept.
    """

    def __init__(self, gl: moderngl.Context, renderer: str) -> None:
        # By their addresses, because moderngl has no sync objects, and its glFinish keeps Python's lock: encoders in
        # other threads would wait for the device, too. The others are short, and keep it: it may take milliseconds to
        # get it back.
        load: Any = getattr(getattr(gl.mglo, "_context", None), "load", lambda name: 0)
        finish, make, delete = (load(name) for name in ("glFinish", "glFenceSync", "glDeleteSync"))
        self._finish: Callable[[], Any] = ctypes.CFUNCTYPE(None)(finish) if finish else gl.finish
        self._make: Callable[[int, int], int | None] | None = None
        if renderer.startswith("llvmpipe") and make and delete:
            self._make = ctypes.PYFUNCTYPE(ctypes.c_void_p, ctypes.c_uint, ctypes.c_uint)(make)
            self._delete: Callable[[int | None], None] = ctypes.PYFUNCTYPE(None, ctypes.c_void_p)(delete)
        self._kept: deque[int | None] = deque()

    def keep(self) -> None:
        """Submit what was drawn, and keep its fence."""
        if self._make is not None:
            self._kept.append(self._make(_COMMANDS_COMPLETE, 0))
            if len(self._kept) >= MOST:
                self.finish()

    def finish(self) -> None:
        """Wait until the device is idle. Other threads of Python run in the meantime."""
        if self._make is not None:
            self._kept.append(self._make(_COMMANDS_COMPLETE, 0))
        self._finish()
        while len(self._kept) > 1:  # a thread may be about to leave the last one
            self._delete(self._kept.popleft())
