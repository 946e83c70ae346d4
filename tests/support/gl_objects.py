"""How many objects OpenGL holds in truth, whoever still knows of them: it is asked of every name that it has given."""

from __future__ import annotations

import ctypes
from typing import Any

from raymarch.gpu.context import Context
from raymarch.gpu.program import FULL_SCREEN

PLAIN = "#version 330 core\nout vec4 c;\nvoid main() { c = vec4(1.0); }\n"
KINDS = ("Texture", "Framebuffer", "Program", "VertexArray")
QUERIES = 1000
"""Names of queries that are asked about: moderngl does not tell the newest."""


def alive(context: Context) -> dict[str, int]:
    """Textures, framebuffers, programs, vertex arrays and queries that were made and not freed, on EGL."""
    with context.bound():
        return _alive(context)


def _alive(context: Context) -> dict[str, int]:
    made: list[Any] = [context.gl.texture((1, 1), 4, dtype="f4")]
    made.append(context.gl.framebuffer([made[0]]))
    made.append(context.gl.program(vertex_shader=FULL_SCREEN, fragment_shader=PLAIN))
    made.append(context.gl.vertex_array(made[2], []))
    found = {}
    for kind, newest in zip(KINDS, made, strict=True):
        is_one = _function(f"glIs{kind}")
        found[kind] = sum(bool(is_one(name)) for name in range(1, newest.glo + 64)) - 1
    is_query = _function("glIsQuery")
    found["Query"] = sum(bool(is_query(name)) for name in range(1, QUERIES))
    for each in reversed(made):
        each.release()
    return found


def _function(name: str) -> Any:
    look_up = ctypes.CDLL("libEGL.so.1").eglGetProcAddress
    look_up.restype, look_up.argtypes = ctypes.c_void_p, [ctypes.c_char_p]
    address = look_up(name.encode())
    assert address, f"the driver has no {name}"
    return ctypes.CFUNCTYPE(ctypes.c_ubyte, ctypes.c_uint)(address)
