"""A host that draws the text of an export as Shadertoy does: tabs, buffers that read themselves, time and mouse."""

from __future__ import annotations

import re
from contextlib import ExitStack
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from raymarch.gpu.context import Context
from raymarch.gpu.program import FULL_SCREEN, Program
from raymarch.gpu.targets import Target

HOST = """#version 300 es
precision highp float;
precision highp int;
uniform vec3 iResolution;
uniform float iTime;
uniform int iFrame;
uniform vec4 iMouse;
uniform sampler2D iChannel0;
out vec4 host_color;
"""
"""What Shadertoy writes before the text of a tab."""

MAIN = "void main() { mainImage(host_color, gl_FragCoord.xy); }\n"


def tabs(text: str) -> dict[str, str]:
    """The text of each tab, by its name; "Image" alone if the text names none."""
    parts = re.split(r"^// =+ (\w[\w ]*\w) =+\n", text, flags=re.MULTILINE)
    if len(parts) == 1:
        return {"Image": text}
    assert all(line.startswith("//") or not line for line in parts[0].splitlines()), "code outside of a tab"
    return dict(zip(parts[1::2], parts[2::2], strict=True))


class Shadertoy:
    """Draws frame after frame. Use it as a context manager."""

    def __init__(self, context: Context, text: str, size: tuple[int, int]) -> None:
        self._stack, self._context, self.frame = ExitStack(), context, 0
        head = HOST.replace("300 es", "330 core")
        self._programs = {
            name: self._stack.enter_context(
                Program(context, FULL_SCREEN, head + part + MAIN, lambda line: (f"line {line}", None), name)
            )
            for name, part in tabs(text).items()
        }
        assert set(self._programs) <= {"Buffer A", "Image"}
        self.resize(size)

    def resize(self, size: tuple[int, int]) -> None:
        """Change the size of the picture; buffers then hold texels of the old size."""
        self.size = size
        self._pair = [self._stack.enter_context(Target(self._context, size)) for _ in range(2)]
        self._screen = self._stack.enter_context(Target(self._context, size))
        for target in self._pair:
            target.write(np.full((size[1], size[0], 4), 7.0, np.float32))

    def draw(self, frames: int = 1, time: float = 0.0, mouse: tuple[float, ...] = (0.0,) * 4) -> NDArray[np.int64]:
        """Some frames of a time, with a mouse; the last 8-bit picture, (H, W, 3)."""
        for _ in range(frames):
            given: dict[str, Any] = {"iResolution": (*map(float, self.size), 1.0), "iTime": time, "iMouse": mouse}
            given["iFrame"] = self.frame
            if "Buffer A" in self._programs:
                self._programs["Buffer A"].draw(self._pair[1], {**given, "iChannel0": self._pair[0]})
                self._pair.reverse()
            self._programs["Image"].draw(self._screen, {**given, "iChannel0": self._pair[0]})
            self.frame += 1
        return np.rint(255 * self._screen.read()[..., :3]).astype(int)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()
