"""The framebuffer of a window: shows a picture of linear colour as sRGB, with layers over it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from raymarch.gpu.context import Context
from raymarch.gpu.program import FULL_SCREEN, Program
from raymarch.gpu.targets import Surface, Target, confine
from raymarch.scene.srgb import srgb_glsl
from raymarch.scene.tone import ToneMapping

_SAMPLE = """#version 330 core
uniform sampler2D picture;
uniform vec2 size;  // of the surface that is drawn, in pixels
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
    vec4 found = texture(picture, gl_FragCoord.xy / size);
    color = encode ? vec4(srgb(toned(mix(found.rgb, vec3(0.0), isnan(found.rgb)))), 1.0) : found;
}
"""

_CLIPPED = """vec3 toned(vec3 color) {
    return color;
}"""

_LAYER = """#version 330 core
uniform sampler2D picture;
uniform vec2 corner;  // lower left, in pixels
uniform vec2 size;  // of the layer, in pixels
out vec4 color;
void main() {
    vec2 at = (gl_FragCoord.xy - corner) / size;
    color = texture(picture, vec2(at.x, 1.0 - at.y));
}
"""

_MESH_VERTEX = """#version 330 core
uniform vec2 size;  // of the window, in the units of `position`
in vec2 position;  // from the top left
in vec2 place;
in vec4 tint;
out vec2 at;
out vec4 shade;
void main() {
    at = place;
    shade = tint;
    gl_Position = vec4(2.0 * position.x / size.x - 1.0, 1.0 - 2.0 * position.y / size.y, 0.0, 1.0);
}
"""

_MESH_FRAGMENT = """#version 330 core
uniform sampler2D picture;
in vec2 at;
in vec4 shade;
out vec4 color;
void main() {
    color = shade * texture(picture, at);
}
"""


@dataclass(slots=True)
class Stretch:
    """A run of `count` indices from `first` that share a texture and a clip, (left, top, right, bottom)."""

    texture: Any
    clip: tuple[float, float, float, float]
    first: int
    count: int


class Screen:
    """The framebuffer of a window and the programs that fill it. Implements `Surface`.

    Parameters
    ----------
    context : the window's; bound here and by every method.
    size : (width, height) of the framebuffer in pixels.
    """

    def __init__(self, context: Context, size: tuple[int, int]) -> None:
        self.context = context
        self.size = size
        with context.bound():
            self.framebuffer: moderngl.Framebuffer = context.gl.detect_framebuffer(0)
        self._samplers: dict[str, Program] = {}
        self._layer = Program(context, FULL_SCREEN, _LAYER, _ours, "overlay")
        self._mesh: Mesh | None = None

    def show(self, picture: Target, tone: ToneMapping | None = None) -> None:
        """Fill the window with a picture of linear colour, mapped by `tone` (None clips). A different size is filtered
        linearly."""
        self._fill(self, picture, True, None, tone)

    def clear(self, grey: float) -> None:
        """Fill the window with a grey level in sRGB."""
        with self.context.bound():
            confine(self.framebuffer, None)
            self.framebuffer.use()
            self.framebuffer.clear(grey, grey, grey, 1.0)

    def copy(self, picture: Target, into: Target, tile: tuple[int, int, int, int] | None = None) -> None:
        """Copy a picture, or a tile of it, into another target. A different size is filtered linearly."""
        self._fill(into, picture, False, tile)

    def _fill(
        self,
        surface: Surface,
        picture: Target,
        encode: bool,
        tile: tuple[int, int, int, int] | None,
        tone: ToneMapping | None = None,
    ) -> None:
        texture = picture.textures[0]
        smooth = picture.size != surface.size
        with self.context.bound():
            if smooth:
                texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
            self._sampler(tone).draw(surface, {"picture": texture, "size": surface.size, "encode": encode}, tile)
            if smooth:
                texture.filter = (moderngl.NEAREST, moderngl.NEAREST)

    def _sampler(self, tone: ToneMapping | None) -> Program:
        """The program that copies pictures, or shows them with tone mapping."""
        text = _CLIPPED if tone is None else tone.glsl()
        if text not in self._samplers:
            source = _SAMPLE.replace(_CLIPPED, text).replace("LINEAR_TO_SRGB", srgb_glsl())
            self._samplers[text] = Program(self.context, FULL_SCREEN, source, _ours, "window")
        return self._samplers[text]

    def image(self, pixels: NDArray[np.uint8]) -> moderngl.Texture:
        """A texture of an RGBA image of shape (H, W, 4), row 0 at the top; free it with `free`."""
        height, width = pixels.shape[:2]
        with self.context.bound():
            texture = self.context.gl.texture((width, height), 4, np.ascontiguousarray(pixels, np.uint8).tobytes())
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
        self._layer.draw(self, {"picture": texture, "corner": corner, "size": (width, height)}, tile, blend=True)

    def triangles(
        self, vertices: bytes, indices: bytes, size: tuple[float, float], stretches: Sequence[Stretch]
    ) -> None:
        """Draw coloured, textured triangles over the window.

        vertices : each (x, y, u, v) in float32 and RGBA in bytes. indices : uint32. size : of the window in the units
        of x and y.
        """
        if self._mesh is None:
            self._mesh = Mesh(self.context)
        self._mesh.draw(self, vertices, indices, size, stretches)

    def read(self) -> NDArray[np.uint8]:
        """The window's back buffer as sRGB bytes, (H, W, 3), row 0 at the top."""
        width, height = self.size
        with self.context.bound():
            data = self.framebuffer.read((0, 0, width, height), 3, alignment=1)
        return np.frombuffer(data, np.uint8).reshape(height, width, 3)[::-1].copy()

    def release(self) -> None:
        """Free the programs. Idempotent."""
        for owned in (*self._samplers.values(), self._layer, self._mesh):
            if owned is not None:
                owned.release()


class Mesh:
    """Draws triangles from buffers that grow on demand; see `Screen.triangles`."""

    index_size = 4
    """Bytes of an index."""

    def __init__(self, context: Context) -> None:
        self.context = context
        with context.bound():
            gl = context.gl
            self._program = gl.program(vertex_shader=_MESH_VERTEX.strip(), fragment_shader=_MESH_FRAGMENT.strip())
            self._vertices = gl.buffer(reserve=1 << 16, dynamic=True)
            self._indices = gl.buffer(reserve=1 << 15, dynamic=True)
            self._bind()

    def _bind(self) -> None:
        layout = [(self._vertices, "2f 2f 4f1", "position", "place", "tint")]
        gl: Any = self.context.gl
        self._array = gl.vertex_array(self._program, layout, self._indices, index_element_size=self.index_size)

    def draw(
        self, screen: Screen, vertices: bytes, indices: bytes, size: tuple[float, float], stretches: Sequence[Stretch]
    ) -> None:
        """Draw; see `Screen.triangles`."""
        with self.context.bound():
            self._draw(screen, vertices, indices, size, stretches)

    def _draw(
        self, screen: Screen, vertices: bytes, indices: bytes, size: tuple[float, float], stretches: Sequence[Stretch]
    ) -> None:
        gl = self.context.gl
        if len(vertices) > self._vertices.size or len(indices) > self._indices.size:
            self._array.release()
            for buffer, data in ((self._vertices, vertices), (self._indices, indices)):
                if len(data) > buffer.size:
                    buffer.orphan(2 * len(data))
            self._bind()
        self._vertices.write(vertices)
        self._indices.write(indices)
        program: Any = self._program
        program["size"].value = size
        gl.enable_only(moderngl.BLEND)
        screen.framebuffer.use()
        screen.framebuffer.viewport = (0, 0, *screen.size)
        across, upward = screen.size[0] / size[0], screen.size[1] / size[1]
        for stretch in stretches:
            left, top, right, bottom = stretch.clip
            x, y = max(round(left * across), 0), max(round(screen.size[1] - bottom * upward), 0)
            wide, high = round(right * across) - x, round(screen.size[1] - top * upward) - y
            if wide <= 0 or high <= 0:
                continue
            confine(screen.framebuffer, (x, y, wide, high))
            stretch.texture.use(0)
            self._array.render(moderngl.TRIANGLES, vertices=stretch.count, first=stretch.first)
        confine(screen.framebuffer, None)
        gl.enable_only(moderngl.NOTHING)

    def release(self) -> None:
        """Free buffers and program. Idempotent."""
        if not self.context.released:
            with self.context.bound():
                for owned in (self._array, self._vertices, self._indices, self._program):
                    owned.release()


def _ours(line: int) -> tuple[str, None]:
    return f"raymarch's window (line {line})", None
