"""The framebuffer of a window: shows a picture of linear colour as sRGB, with layers over it."""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import NDArray

from raymarch.expr.srgb import srgb_glsl
from raymarch.gpu.context import Context
from raymarch.gpu.program import FULL_SCREEN, Program
from raymarch.gpu.targets import Surface, Target, confine
from raymarch.gpu.tiles import Tile
from raymarch.scene.tone import ToneMapping

_SAMPLE = """#version 330 core
uniform sampler2D picture;
uniform vec2 corner;  // lower left of the area that the picture fills, in pixels
uniform vec2 size;  // of the area
uniform bool encode;
out vec4 color;

vec3 toned(vec3 color) {
    return color;
}

LINEAR_TO_SRGB

// NaN becomes 0.
vec3 srgb(vec3 linear) {
    vec3 x = clamp(mix(linear, vec3(0.0), isnan(linear)), 0.0, 1.0);
    return vec3(linear_to_srgb(x.r), linear_to_srgb(x.g), linear_to_srgb(x.b));
}

void main() {
    vec4 found = texture(picture, (gl_FragCoord.xy - corner) / size);
    color = encode ? vec4(srgb(toned(mix(found.rgb, vec3(0.0), isnan(found.rgb)))), 1.0) : found;
}
"""

_CLIPPED = """vec3 toned(vec3 color) {
    return color;
}"""


class Screen:
    """The framebuffer of a window and the programs that fill it. Implements `Surface`.

    context : the window's; bound here and by every method.
    size : (width, height) of the framebuffer in pixels.
    """

    def __init__(self, context: Context, size: tuple[int, int]) -> None:
        self.context = context
        self.size = size
        with context.bound():
            self.framebuffer: moderngl.Framebuffer = context.gl.detect_framebuffer(0)
        self._samplers: dict[str, Program] = {}

    def show(
        self, picture: Target, tone: ToneMapping | None = None, area: Tile | None = None, tile: Tile | None = None
    ) -> None:
        """Show a picture of linear colour, mapped by `tone` (None clips). A different size is filtered linearly.

        area : (x, y, width, height) that the picture fills, from the lower left; None is the window. tile : the part of
        the window that is drawn.
        """
        area = area or (0, 0, *self.size)
        self._fill(self, picture, True, area, tile or area, tone)

    def clear(self, grey: float) -> None:
        """Fill the window with a grey level in sRGB."""
        with self.context.bound():
            confine(self.framebuffer, None)
            self.framebuffer.use()
            self.framebuffer.clear(grey, grey, grey, 1.0)

    def copy(self, picture: Target, into: Target, tile: Tile | None = None) -> None:
        """Copy a picture, or a tile of it, into another target. A different size is filtered linearly."""
        self._fill(into, picture, False, (0, 0, *into.size), tile)

    def _fill(
        self,
        surface: Surface,
        picture: Target,
        encode: bool,
        area: Tile,
        tile: Tile | None,
        tone: ToneMapping | None = None,
    ) -> None:
        texture = picture.textures[0]
        smooth = picture.size != area[2:]
        with self.context.bound():
            if smooth:
                texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
            given = {"picture": texture, "corner": area[:2], "size": area[2:], "encode": encode}
            self._sampler(tone).draw(surface, given, tile)
            if smooth:
                texture.filter = (moderngl.NEAREST, moderngl.NEAREST)

    def _sampler(self, tone: ToneMapping | None) -> Program:
        """The program that copies pictures, or shows them with tone mapping."""
        text = _CLIPPED if tone is None else tone.glsl()
        if text not in self._samplers:
            source = _SAMPLE.replace(_CLIPPED, text).replace("LINEAR_TO_SRGB", srgb_glsl())
            self._samplers[text] = Program(self.context, FULL_SCREEN, source, None, "window")
        return self._samplers[text]

    def image(self, pixels: NDArray[np.uint8]) -> moderngl.Texture:
        """A texture of an RGBA image of shape (H, W, 4), row 0 at the top; free it with `free`."""
        height, width = pixels.shape[:2]
        with self.context.bound():
            texture = self.context.gl.texture((width, height), 4, np.asarray(pixels[::-1], np.uint8).tobytes())
            texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
            texture.repeat_x = texture.repeat_y = False
        return texture

    def free(self, texture: moderngl.Texture) -> None:
        """Free a texture of `image`."""
        if not self.context.released:
            with self.context.bound():
                texture.release()

    def lay(self, texture: moderngl.Texture, left: int, top: int) -> None:
        """Draw an image over the window with its upper left corner at (left, top), clipped to the window."""
        width, height = texture.size
        right, bottom = min(left + width, self.size[0]), min(top + height, self.size[1])
        x, y = max(left, 0), max(top, 0)
        if right <= x or bottom <= y:
            return
        corner = (left, self.size[1] - top - height)
        tile = (x, self.size[1] - bottom, right - x, bottom - y)
        given = {"picture": texture, "corner": corner, "size": (width, height), "encode": False}
        self._sampler(None).draw(self, given, tile, blend=True)

    def use(self) -> None:
        """Bind the framebuffer, for code that draws by its own calls; inside `context.bound` only."""
        confine(self.framebuffer, None)
        self.framebuffer.use()

    def read(self) -> NDArray[np.uint8]:
        """The window's back buffer as sRGB bytes, (H, W, 3), row 0 at the top."""
        width, height = self.size
        with self.context.bound():
            data = self.framebuffer.read((0, 0, width, height), 3, alignment=1)
        return np.frombuffer(data, np.uint8).reshape(height, width, 3)[::-1].copy()

    def release(self) -> None:
        """Free the programs. Idempotent."""
        for program in self._samplers.values():
            program.release()
