"""Colours that are computed on the device, from textures to 8-bit pictures or to another texture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from raymarch.expr.function import Function
from raymarch.expr.glsl import print_functions
from raymarch.expr.node import Expr, const, var
from raymarch.expr.srgb import srgb_glsl
from raymarch.expr.types import FLOAT, VEC3
from raymarch.expr.vocabulary import all_of, finite, vec3, where
from raymarch.gpu.context import Context
from raymarch.gpu.program import FULL_SCREEN, Program
from raymarch.gpu.targets import Surface, Target, upload
from raymarch.plan.passes import Output
from raymarch.scene.tone import ToneMapping

VALUE, VECTOR = var("value", FLOAT), var("value", VEC3)
"""The number or the vector of a pixel: what a colour is a function of."""
HIT = var("hit", FLOAT)
"""1, or 0 where the ray hit nothing."""
LOW, HIGH = var("low", VEC3), var("high", VEC3)
"""The ends of the range of values in the picture. Those of a number are in x."""

FEW = 1 << 19
"""Pictures with fewer pixels are coloured by NumPy if the driver renders on the CPU: it compiles a program in the time
in which NumPy colours them."""

KEPT = 16
"""Maximum number of programs that are kept, those that were used last. Each exposure has its own."""

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
    color = vec4(SHOWN, view_alpha(texel.VALUE));
}
"""


def display_of(context: Context) -> Display:
    """The display of a context; it lives as long as the context."""
    found: Display = context.kept.setdefault("display", Display(context))
    return found


def is_worth(target: Target) -> bool:
    """True if the device colours a picture in less time than NumPy."""
    return not target.context.driver.is_software or target.size[0] * target.size[1] >= FEW


NOT_FINITE, ABOVE_ONE = 1, 2
"""The alpha of a picture of light: of pixels with a channel that is not finite, and of others with all channels above
1."""

_OPAQUE: Expr = const(1.0)
_MARKED = (
    where(
        all_of(finite(VECTOR.x), finite(VECTOR.y), finite(VECTOR.z)),
        where(all_of(VECTOR.x > 1.0, VECTOR.y > 1.0, VECTOR.z > 1.0), float(ABOVE_ONE), 0.0),
        float(NOT_FINITE),
    )
    / 255.0
)


@lru_cache(KEPT)
def _encoded(tone: ToneMapping) -> Expr | None:
    """The colour of light by a tone curve, if the device computes the bytes of NumPy."""
    if tone.steps is None:
        return None
    code = tone.steps.function()
    return vec3(code(VECTOR.x), code(VECTOR.y), code(VECTOR.z)) / 255.0


def image_of(pixels: NDArray[np.uint8]) -> Image.Image:
    """The picture of RGBA pixels, (H, W, 4), row 0 at the bottom. Alpha is left out."""
    size = pixels.shape[1::-1]
    return Image.frombytes("RGB", size, pixels.tobytes(), "raw", "RGBX", 0, -1)


class _Bytes:
    """A surface of 8-bit RGBA pixels."""

    def __init__(self, context: Context, size: tuple[int, int]) -> None:
        self.size = size
        self.texture = context.gl.texture(size, 4)
        self.framebuffer: moderngl.Framebuffer = context.gl.framebuffer([self.texture])

    def read(self) -> NDArray[np.uint8]:
        pixels = np.empty((self.size[1], self.size[0], 4), np.uint8)
        self.framebuffer.read_into(pixels, components=4)
        return pixels

    def release(self) -> None:
        self.framebuffer.release()
        self.texture.release()


class Display:
    """The programs that colour pictures on one context, and an 8-bit surface of the size that was used last."""

    def __init__(self, context: Context) -> None:
        self._context = context
        self._programs: dict[Any, tuple[Program, Mapping[str, Any]]] = {}  # the last that was used is the last
        self._bytes: _Bytes | None = None

    def image(self, target: Target, output: Output, color: Expr, ends: Sequence[Any]) -> Image.Image:
        """An array of a target as an 8-bit picture.

        color : sRGB from 0 to 1, a function of `VALUE` or `VECTOR`, `HIT`, `LOW` and `HIGH`. ends : the last two.
        """
        return image_of(self._pixels(target, output, color, ends, _OPAQUE))

    def light(self, target: Target, output: Output, tone: ToneMapping) -> NDArray[np.uint8] | None:
        """Linear light as 8-bit sRGB, (H, W, 4), row 0 at the bottom, with the bytes of `ToneMapping.image`.

        Alpha holds `NOT_FINITE` and `ABOVE_ONE`. None for a tone whose bytes the device would not match.
        """
        color = _encoded(tone)
        return None if color is None else self._pixels(target, output, color, (0.0, 1.0), _MARKED)

    def _pixels(
        self, target: Target, output: Output, color: Expr, ends: Sequence[Any], alpha: Expr
    ) -> NDArray[np.uint8]:
        with self._context.bound():
            if self._bytes is None or self._bytes.size != target.size:
                if self._bytes is not None:
                    self._bytes.release()
                self._bytes = _Bytes(self._context, target.size)
            self._draw(self._bytes, target, output, color, ends, "c", alpha)
            return self._bytes.read()

    def fill(self, surface: Surface, target: Target, output: Output, color: Expr, ends: Sequence[Any]) -> None:
        """Fill a surface of any size with the colours of an array, decoded to linear light. The nearest texel is
        taken."""
        self._draw(surface, target, output, color, ends, "vec3(to_linear(c.r), to_linear(c.g), to_linear(c.b))")

    def _draw(
        self,
        surface: Surface,
        target: Target,
        output: Output,
        color: Expr,
        ends: Sequence[Any],
        shown: str,
        alpha: Expr = _OPAQUE,
    ) -> None:
        key = repr(output), color, shown, alpha
        if key in self._programs:
            self._programs[key] = self._programs.pop(key)  # the last that was used
        else:
            text, tables = _text(output, color, shown, alpha)
            program = Program(self._context, FULL_SCREEN, text, None, "view")
            self._programs[key] = program, {name: upload(self._context, data) for name, data in tables.items()}
            if len(self._programs) > KEPT:
                oldest, textures = self._programs.pop(next(iter(self._programs)))
                for old in (oldest, *textures.values()):
                    old.release()
        program, tables = self._programs[key]
        low, high = (np.broadcast_to(np.asarray(end, np.float64), 3) for end in ends)
        ratio = tuple(n / m for n, m in zip(target.size, surface.size, strict=True))
        texels = (target, output.texture)
        program.draw(surface, {"u_texels": texels, "u_ratio": ratio, "u_low": low, "u_high": high, **tables})


def _text(output: Output, color: Expr, shown: str, alpha: Expr) -> tuple[str, Mapping[str, Any]]:
    """The fragment shader that colours an array, and its tables."""
    value = VECTOR if isinstance(output.channels, slice) else VALUE
    colored = Function("view_color", (value, HIT, LOW, HIGH), color)
    printed = print_functions([colored, Function("view_alpha", (value,), alpha)])
    lines = [*(f"uniform sampler2D {name};" for name in printed.samples), *(line.text for line in printed.lines())]
    if "to_linear" in shown:
        lines.append(srgb_glsl(decode=True))
    channels = "xyz" if isinstance(output.channels, slice) else "xyzw"[output.channels]
    at = f"texel.{'xyzw'[output.hit]}"
    hit = "1.0" if output.miss is None else f"{at} >= 0.0 && {at} <= 3.402823e38 ? 1.0 : 0.0"
    main = _MAIN.replace("texel.VALUE", f"texel.{channels}").replace("HIT", hit).replace("SHOWN", shown)
    return main.replace("FUNCTIONS", "\n".join(lines)), printed.samples
