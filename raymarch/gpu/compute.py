"""A pass as a compute shader, which writes the texels that its fragment shader would write.

GPUs of data centres run fragment shaders on few of their units and compute shaders on all of them: on an NVIDIA H200
the same text is 11 to 49 times as fast. The first program of a process decides by a trial. Software renderers, and
drivers without OpenGL 4.3, draw by fragment shaders.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Sequence
from time import perf_counter
from typing import Literal, TypeAlias

import moderngl

from raymarch.errors import DeviceError
from raymarch.expr.convert import short
from raymarch.gpu.context import Context
from raymarch.gpu.targets import Target

DRAW_VARIABLE = "RAYMARCH_DRAW_BY"
"""Environment variable that chooses "fragment" or "compute"; by default the trial does."""

GROUP = (8, 8)
"""Texels of a work group: neighbours, whose rays take similar ways."""

WORTH = 1.5
"""Compute shaders are chosen where they are this many times as fast as fragment shaders."""

REPEATS = 12
"""Draws of the trial by each kind of shader."""

Way: TypeAlias = Literal["fragment", "compute"]

_DECIDED: dict[tuple[str, str], tuple[Way, str]] = {}
"""What the trial has found in this process, by driver: all its contexts draw alike."""

_VERSION = "#version 330 core"
_OUTPUT = re.compile(r"^layout\(location = (\d)\) out vec4 (\w+);(.*)$", re.M)
_OTHER_OUTPUT = re.compile(r"^(layout\(.*\) )?out ", re.M)
_OF_FRAGMENTS = re.compile(
    r"\bdiscard\b|\bdFd[xy]\b|\bfwidth\b|\bgl_Front|^\s*(flat\s+|smooth\s+)?in\s+\w+\s+\w+;", re.M
)
_MAIN = re.compile(r"^void main\(\) \{", re.M)

_TRIAL = """#version 330 core
layout(location = 0) out vec4 color;
void main() {
    vec2 z = gl_FragCoord.xy * 0.001;
    for (int i = 0; i < 512; i++) z = fract(z * 1.37 + z.yx * 0.71 + 0.1);
    color = vec4(z, 0.0, 1.0);
}
"""
_TRIAL_VERTEX = """#version 330 core
void main() {
    gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0);
}
"""
_TRIAL_SIZE = (512, 512)


def as_compute(fragment: str) -> str | None:
    """The text of a compute shader that writes what this fragment shader writes; None if it cannot.

    Output i goes to the image `image_i`. `u_tile` is the tile of a dispatch: x, y, width and height in texels, y from
    the bottom.
    """
    text = fragment.strip()
    if not text.startswith(_VERSION) or _OF_FRAGMENTS.search(text):
        return None
    numbers = sorted({int(number) for number, _, _ in _OUTPUT.findall(text)})
    text = _OUTPUT.sub(
        r"#define STORES_\1 imageStore(image_\1, texel, \2);\nwriteonly uniform image2D image_\1;\nvec4 \2;\3", text
    )
    text, mains = _MAIN.subn("void draw_texel() {", text)
    if not numbers or not mains or _OTHER_OUTPUT.search(text):
        return None
    stores = "".join(f"#ifdef STORES_{i}\n    STORES_{i}\n#endif\n" for i in numbers)
    return f"""#version 430 core
layout(local_size_x = {GROUP[0]}, local_size_y = {GROUP[1]}) in;
uniform ivec4 u_tile;
vec4 place_of_texel;
{text[len(_VERSION) :].replace("gl_FragCoord", "place_of_texel")}
void main() {{
    ivec2 texel = u_tile.xy + ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(texel, u_tile.xy + u_tile.zw))) return;
    place_of_texel = vec4(vec2(texel) + 0.5, 0.0, 1.0);
    draw_texel();
{stores}}}
"""


class Dispatch:
    """A compute shader that draws a pass. `shader` has its uniforms."""

    def __init__(self, context: Context, text: str) -> None:
        self.context = context
        self.shader = context.gl.compute_shader(text)
        self._images = [name for name in self.shader if re.fullmatch(r"image_\d", name)]

    @property
    def uniforms(self) -> tuple[str, ...]:
        """Names of the active uniforms, without its own."""
        own = {"u_tile", *self._images}
        return tuple(
            name for name in self.shader if name not in own and isinstance(self.shader[name], moderngl.Uniform)
        )

    def run(self, textures: Sequence[moderngl.Texture], tile: tuple[int, int, int, int]) -> None:
        """Write a tile, x, y, width and height, of textures by their attachment. Returns before it is written."""
        for name in self._images:
            number = int(name.rpartition("_")[2])
            textures[number].bind_to_image(number, read=False, write=True)
            self.shader[name] = number
        if "u_tile" in self.shader:
            self.shader["u_tile"] = tile
        self.shader.run(-(-tile[2] // GROUP[0]), -(-tile[3] // GROUP[1]), 1)
        self.context.gl.memory_barrier()


def dispatch_of(context: Context, fragment: str) -> Dispatch | None:
    """The dispatch of a fragment shader; None if the context does not draw so, or the text cannot be one."""
    text = as_compute(fragment) if draws_by(context) == "compute" else None
    if text is None:
        return None
    try:
        return Dispatch(context, text)
    except moderngl.Error:
        return None  # the fragment shader's error names the right line; or only compute shaders are refused


def draws_by(context: Context) -> Way:
    """How this context draws: by RAYMARCH_DRAW_BY, else by a trial when first asked; `context.kept["draws"]` tells."""
    known = context.kept.get("draws")
    if known is None:
        known = context.kept["draws"] = _decided(context)
    way: Way = known[0]
    return way


def why_drawn_so(context: Context) -> str:
    """Why the context draws as it does, for reports."""
    draws_by(context)
    return str(context.kept["draws"][1])


def _decided(context: Context) -> tuple[Way, str]:
    asked = os.environ.get(DRAW_VARIABLE, "").strip()
    if asked not in ("", "fragment", "compute"):
        raise DeviceError(f"{DRAW_VARIABLE}={short(asked)}", legal="fragment or compute")
    if asked == "fragment":
        return "fragment", f"{DRAW_VARIABLE} says so"
    if context.gl.version_code < 430:
        return "fragment", "the driver has no OpenGL 4.3"
    if asked == "compute":
        return "compute", f"{DRAW_VARIABLE} says so"
    if context.driver.is_software:
        return "fragment", "the driver renders on the CPU"
    driver = context.driver.renderer, context.driver.version
    if driver not in _DECIDED:
        with context.bound():
            try:
                times = _trial(context)
            except moderngl.Error as error:
                return "fragment", "the driver refuses compute shaders: " + " ".join(str(error).split())[:120]
        way: Way = "compute" if times[0] / times[1] >= WORTH else "fragment"
        words = f"a trial takes {times[0]:.2f} ms by a fragment shader, {times[1]:.2f} ms by a compute shader"
        _DECIDED[driver] = way, words
    return _DECIDED[driver]


def _trial(context: Context) -> tuple[float, float]:
    """Milliseconds that a fragment shader takes, and a compute shader: the least of some draws each."""
    text = as_compute(_TRIAL)
    assert text is not None
    gl, target = context.gl, Target(context, _TRIAL_SIZE)
    program = gl.program(vertex_shader=_TRIAL_VERTEX, fragment_shader=_TRIAL)
    triangle = gl.vertex_array(program, [])
    shader = gl.compute_shader(text)

    def by_fragments() -> None:
        target.framebuffer.use()
        gl.enable_only(moderngl.NOTHING)
        triangle.render(moderngl.TRIANGLES, vertices=3)

    def by_compute() -> None:
        target.textures[0].bind_to_image(0, read=False, write=True)
        shader["image_0"], shader["u_tile"] = 0, (0, 0, *_TRIAL_SIZE)
        shader.run(-(-_TRIAL_SIZE[0] // GROUP[0]), -(-_TRIAL_SIZE[1] // GROUP[1]), 1)
        gl.memory_barrier()

    def took(draw: Callable[[], None]) -> float:
        gl.finish()
        begin = perf_counter()
        draw()
        gl.finish()
        return 1e3 * (perf_counter() - begin)

    try:
        # In turn, because clocks of a GPU rise with work; and often, because other programs may use the device.
        times = [(took(by_fragments), took(by_compute)) for _ in range(REPEATS)]
        return min(first for first, _ in times), min(second for _, second in times)
    finally:
        for made in (triangle, program, shader, target):
            made.release()
