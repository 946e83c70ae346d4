"""Colours that are computed on the device, from textures to 8-bit pictures or to another texture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import moderngl
import numpy as np
from PIL import Image

from raymarch.expr.function import Function
from raymarch.expr.glsl import print_functions
from raymarch.expr.node import Expr, var
from raymarch.expr.types import FLOAT, VEC3
from raymarch.gpu.context import Context
from raymarch.gpu.program import FULL_SCREEN, Program
from raymarch.gpu.targets import Surface, Target, upload
from raymarch.plan.passes import Output
from raymarch.scene.srgb import srgb_glsl

VALUE, VECTOR = var("value", FLOAT), var("value", VEC3)
"""The number or the vector of a pixel: what a colour is a function of."""
HIT = var("hit", FLOAT)
"""1, or 0 where the ray hit nothing."""
LOW, HIGH = var("low", VEC3), var("high", VEC3)
"""The ends of the range of values in the picture. Those of a number are in x."""

FEW = 1 << 19
"""Pictures with fewer pixels are coloured by NumPy if the driver renders on the CPU: it compiles a program in the time
in which NumPy colours them."""

_MAIN = """#version 330 core
uniform sampler2D u_texels;
uniform vec2 u_ratio;  // texels of a pixel
uniform vec3 u_low;
uniform vec3 u_high;
out vec4 color;

FUNCTIONS

void main() {
    vec4 texel = texelFetch(u_texels, ivec2(gl_FragCoord.xy * u_ratio), 0);
    vec3 c = clamp(view_color(texel.VALUE, HIT, u_low, u_high), 0.0, 1.0);
    color = vec4(SHOWN, 1.0);
}
"""


def display_of(context: Context) -> Display:
    """The display of a context; it lives as long as the context."""
    found: Display = context.kept.setdefault("display", Display(context))
    return found


def is_worth(target: Target) -> bool:
    """True if the device colours a picture in less time than NumPy."""
    return not target.context.driver.is_software or target.size[0] * target.size[1] >= FEW


class _Bytes:
    """A surface of 8-bit RGBA pixels."""

    def __init__(self, context: Context, size: tuple[int, int]) -> None:
        self.size = size
        self.texture = context.gl.texture(size, 4)
        self.framebuffer: moderngl.Framebuffer = context.gl.framebuffer([self.texture])

    def image(self) -> Image.Image:
        pixels = np.empty((self.size[1], self.size[0], 4), np.uint8)
        self.framebuffer.read_into(pixels, components=4)
        return Image.frombytes("RGB", self.size, pixels.tobytes(), "raw", "RGBX", 0, -1)  # the first row is the lowest

    def release(self) -> None:
        self.framebuffer.release()
        self.texture.release()


class Display:
    """The programs that colour pictures on one context, and an 8-bit surface of the size that was used last."""

    def __init__(self, context: Context) -> None:
        self._context = context
        self._programs: dict[Any, tuple[Program, Mapping[str, Any]]] = {}
        self._bytes: _Bytes | None = None

    def image(self, target: Target, output: Output, color: Expr, ends: Sequence[Any]) -> Image.Image:
        """An array of a target as an 8-bit picture.

        color : sRGB from 0 to 1, a function of `VALUE` or `VECTOR`, `HIT`, `LOW` and `HIGH`. ends : the last two.
        """
        with self._context.bound():
            if self._bytes is None or self._bytes.size != target.size:
                if self._bytes is not None:
                    self._bytes.release()
                self._bytes = _Bytes(self._context, target.size)
            self._draw(self._bytes, target, output, color, ends, "c")
            return self._bytes.image()

    def fill(self, surface: Surface, target: Target, output: Output, color: Expr, ends: Sequence[Any]) -> None:
        """Fill a surface of any size with the colours of an array, decoded to linear light. The nearest texel is
        taken."""
        self._draw(surface, target, output, color, ends, "vec3(to_linear(c.r), to_linear(c.g), to_linear(c.b))")

    def _draw(
        self, surface: Surface, target: Target, output: Output, color: Expr, ends: Sequence[Any], shown: str
    ) -> None:
        key = (output, color, shown)
        if key not in self._programs:
            text, tables = _text(output, color, shown)
            program = Program(self._context, FULL_SCREEN, text, lambda line: (f"a view (line {line})", None), "view")
            self._programs[key] = program, {name: upload(self._context, data) for name, data in tables.items()}
        program, tables = self._programs[key]
        low, high = (np.broadcast_to(np.asarray(end, np.float64), 3) for end in ends)
        ratio = tuple(n / m for n, m in zip(target.size, surface.size, strict=True))
        texels = (target, output.texture)
        program.draw(surface, {"u_texels": texels, "u_ratio": ratio, "u_low": low, "u_high": high, **tables})


def _text(output: Output, color: Expr, shown: str) -> tuple[str, Mapping[str, Any]]:
    """The fragment shader that colours an array, and its tables."""
    several = isinstance(output.channels, slice)
    printed = print_functions([Function("view_color", (VECTOR if several else VALUE, HIT, LOW, HIGH), color)])
    lines = [*(f"uniform sampler2D {name};" for name in printed.samples), *(line.text for line in printed.lines())]
    if "to_linear" in shown:
        lines.append(srgb_glsl(decode=True))
    value = "xyz" if isinstance(output.channels, slice) else "xyzw"[output.channels]
    at = f"texel.{'xyzw'[output.hit]}"
    hit = "1.0" if output.miss is None else f"{at} >= 0.0 && {at} <= 3.402823e38 ? 1.0 : 0.0"
    main = _MAIN.replace("texel.VALUE", f"texel.{value}").replace("HIT", hit).replace("SHOWN", shown)
    return main.replace("FUNCTIONS", "\n".join(lines)), printed.samples
