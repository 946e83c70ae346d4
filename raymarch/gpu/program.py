"""Shader programs that fill a surface. Compile errors are mapped to the line that generated the code."""

from __future__ import annotations

import math
import re
import struct
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Final, Literal, NamedTuple, TypeAlias, cast

import moderngl
import numpy as np
from numpy.typing import NDArray

from raymarch.errors import DeviceError, Location, ShaderError
from raymarch.gpu.compute import dispatch_of
from raymarch.gpu.context import Context, Releasing
from raymarch.gpu.signals import deferred
from raymarch.gpu.targets import Surface, Target, confine

FULL_SCREEN = """#version 330 core
// One triangle that covers the surface, from gl_VertexID alone: no vertex buffer, and no diagonal
// along which two triangles would shade the same pixel quads twice.
void main() {
    gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0);
}
"""
"""The vertex shader of every pass: three vertices without attributes, (-1, -1), (3, -1), (-1, 3)."""

RAYS = """#version 330 core
// As above, with the unnormalized ray direction at each corner, which is linear over the picture.
uniform mat3 u_camera_frame;
uniform float u_tan_half_fov;
uniform vec2 u_resolution;
uniform vec2 u_jitter;
out vec3 ray_direction;

void main() {
    vec2 corner = vec2(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0);
    vec2 screen = corner * vec2(u_resolution.x / u_resolution.y, 1.0) + 2.0 * u_jitter / u_resolution.y;
    ray_direction = u_camera_frame * vec3(screen * u_tan_half_fov, -1.0);
    gl_Position = vec4(corner, 0.0, 1.0);
}
"""
"""The vertex shader of passes that interpolate rays between the corners of the picture."""

_COLOR_LOGIC_OP = 0x0BF2
"""GL_COLOR_LOGIC_OP. Its operation is GL_COPY, which writes the colour as it is."""

Locate: TypeAlias = Callable[[int], tuple[str, Location | None]]
"""Maps a line of the fragment shader, from 1, to a description of its origin and to the user's line, if any."""

Severity: TypeAlias = Literal["error", "warning", "note"]

_SEVERITY = r"(?P<severity>error|warning|note)"
# NVIDIA: "Fragment info", a line of dashes, and then what the linker says.
_HEADING = re.compile(r"[-=]{3,}$|(vertex|fragment|compute|link) info$", re.I)
_MESSAGE_FORMS = tuple(
    re.compile(form, re.IGNORECASE)
    for form in (
        # Mesa: 0:12(5): error: `foo' undeclared
        r"^\d+:(?P<line>\d+)\((?P<column>\d+)\)\s*:\s*(?:preprocessor )?" + _SEVERITY + r"\s*:\s*(?P<text>.+)",
        # NVIDIA: 0(12) : error C1008: undefined variable "foo"
        r"^\d+\((?P<line>\d+)\)\s*:\s*" + _SEVERITY + r"\s*(?P<text>\S.*)",
        # ANGLE, Apple and Intel: ERROR: 0:12: 'foo' : undeclared identifier; AMD puts error(#143) before the text
        r"^" + _SEVERITY + r"\s*:\s*\d+:(?P<line>\d+)\s*:\s*(?P<text>.+)",
    )
)


@dataclass(frozen=True, slots=True)
class Message:
    """One message of a driver's log: line of the shader, from 1, column if the driver reports it, text."""

    line: int
    column: int | None
    text: str
    severity: Severity = "error"


def parse_messages(text: str) -> list[Message]:
    """The messages with a line number in a driver's compile log, in order; other lines are ignored.

    Supports the formats of Mesa, NVIDIA, ANGLE, Apple, Intel and AMD.
    """
    messages: list[Message] = []
    for entry in text.splitlines():
        match = next(filter(None, (form.match(entry.strip()) for form in _MESSAGE_FORMS)), None)
        if match:
            groups = match.groupdict()
            column = groups.get("column")
            severity = cast(Severity, groups["severity"].lower())
            messages.append(
                Message(int(groups["line"]), int(column) if column else None, groups["text"].strip(), severity)
            )
    return messages


class Elements(NamedTuple):
    """The value of an array uniform. Compilers may remove unused elements at the end; the remaining ones are set."""

    values: NDArray[Any]


class Program(Releasing):
    """A linked program: a pass that fills a surface, or a tile of it.

    Where the context draws by compute shaders (see `raymarch.gpu.compute`), what goes to a `Target` without blending is
    dispatched; the fragment shader is then compiled for other surfaces only.

    context : the context of the program; bound here and by every method.
    vertex : a vertex shader without attributes that makes a triangle of gl_VertexID 0, 1, 2, such as `FULL_SCREEN`.
    fragment : the fragment shader, `#version 330 core`.
    locate : see `Locate`; called only if the driver refuses the shader. None for a text of the package itself.
    name : the pass, for messages.

    Raises ShaderError if the driver refuses the shader. The message has the pass, the driver's first error and the
    origin of the line; `.where` is the user's line.
    """

    def __init__(self, context: Context, vertex: str, fragment: str, locate: Locate | None, name: str) -> None:
        self.context = context
        self.name = name
        self.released = False
        self._texts = vertex, fragment
        self._locate = locate
        self._members: dict[int, dict[str, _Member]] = {}
        self._fragment: tuple[moderngl.Program, moderngl.VertexArray] | None = None
        with context.bound(), deferred():
            self._dispatch = dispatch_of(context, fragment)
            if self._dispatch is None:
                self._linked()

    def _linked(self) -> tuple[moderngl.Program, moderngl.VertexArray]:
        """The fragment shader and its triangle; compiled at the first call."""
        if self._fragment is None:
            vertex, fragment = self._texts
            gl = self.context.gl
            try:
                # Some versions of moderngl strip the text, which shifts its lines; strip it here for all versions.
                program = gl.program(vertex_shader=vertex.strip(), fragment_shader=fragment.strip())
            except moderngl.Error as error:
                raise _refusal(self.name, str(error), fragment, self._locate) from error
            try:
                self._fragment = program, gl.vertex_array(program, [])
            except moderngl.Error as error:
                program.release()
                raise DeviceError(f"pass {self.name}: the device failed: {error}", legal="a new Renderer") from error
        return self._fragment

    @property
    def uniforms(self) -> tuple[str, ...]:
        """Names of the active uniforms; the driver removes those without effect."""
        if self._dispatch is not None:
            return self._dispatch.uniforms
        program, _ = self._linked()
        return tuple(name for name in program if isinstance(program[name], moderngl.Uniform))

    def draw(
        self,
        target: Surface,
        uniforms: Mapping[str, Any] | None = None,
        tile: tuple[int, int, int, int] | None = None,
        blend: bool = False,
    ) -> None:
        """Draw into all attachments of `target`. Returns before the device has finished.

        uniforms : by name; unknown names are ignored. Numbers and vectors as numbers, sequences or arrays; a matrix as
            an array (rows, columns) that multiplies column vectors, as in `m @ v`; an array of n uniforms with n along
            the first axis; a sampler as a `Target` (its attachment 0), as (target, attachment) or as a moderngl
            texture.
        tile : (x, y, width, height) in pixels of gl_FragCoord, so y counts from the BOTTOM row; texels outside
            keep their values and cost nothing. gl_FragCoord is that of the whole surface. None draws everything.
        blend : blend the colour over the target by its alpha (not premultiplied).

        Raises ValueError for a value that does not fit its uniform, a tile outside the surface, or a texture that is
        both read and written.
        """
        width, height = target.size
        if tile is not None:
            _check_tile(tile, width, height)
        with self.context.bound():
            if isinstance(target, Target):
                target.read_unread()
            gl = self.context.gl
            if self._dispatch is not None and isinstance(target, Target) and not blend:
                self._set(self._dispatch.shader, uniforms or {}, target)
                self._dispatch.run(target.textures, tile or (0, 0, width, height))
                return
            if self._fragment is None:
                with deferred():
                    self._linked()
            program, triangle = self._linked()
            self._set(program, uniforms or {}, target)
            gl.enable_only(moderngl.BLEND if blend else moderngl.NOTHING)
            framebuffer = target.framebuffer
            framebuffer.use()
            framebuffer.viewport = (0, 0, width, height)
            confine(framebuffer, tile)
            if blend or not self.context.driver.compiles_opaque_twice:
                triangle.render(moderngl.TRIANGLES, vertices=3)
                return
            gl.enable_direct(_COLOR_LOGIC_OP)
            try:
                triangle.render(moderngl.TRIANGLES, vertices=3)
            finally:
                gl.disable_direct(_COLOR_LOGIC_OP)

    def release(self) -> None:
        """Free the program. Idempotent, and safe after the context was released, which frees it."""
        if self.released:
            return
        self.released = True
        if not self.context.released:
            with self.context.bound():  # see Target.release: contexts reuse GL names
                if self._fragment is not None:
                    program, triangle = self._fragment
                    triangle.release()
                    program.release()
                if self._dispatch is not None:
                    self._dispatch.shader.release()

    def _set(
        self, shader: moderngl.Program | moderngl.ComputeShader, uniforms: Mapping[str, Any], target: Surface
    ) -> None:
        members = self._members.get(id(shader))
        if members is None:
            found = {name: shader[name] for name in shader}
            members = {name: _Member(each) for name, each in found.items() if isinstance(each, moderngl.Uniform)}
            self._members[id(shader)] = members
        unit = 0
        written = target.textures if isinstance(target, Target) else ()
        given = uniforms.get
        for name, member in members.items():
            value = given(name, member)
            if value is member or value is member.last:
                continue
            kind = type(value)
            if kind is float or kind is int or isinstance(value, float | int):
                if value != member.number or not value:
                    member.send_number(self.name, value)
                continue
            texture = _as_texture(value)
            if texture is None:
                member.send(self.name, value)
                continue
            if texture in written:
                raise ValueError(f"{self.name}: the texture of {name} is read and written at once; use a PingPong")
            texture.use(unit)
            if member.number != unit:
                member.send_number(self.name, unit)
            unit += 1


class _Member:
    """A uniform of a program, with what was sent to it last. It is sent again only if it changes.

    Arrays among the uniforms of a frame are not changed later, so the same object has the same content.
    """

    __slots__ = ("data", "last", "number", "uniform")

    def __init__(self, uniform: moderngl.Uniform) -> None:
        self.uniform = uniform
        self.number: float | None = None
        self.last: Any = self
        self.data: bytes | None = None

    def send_number(self, program: str, value: float) -> None:
        """Send a number. 0 and -0 are equal, so they are compared by their bytes."""
        if value != self.number or (not value and math.copysign(1.0, value) != math.copysign(1.0, self.number)):
            self.send(program, value)
            self.number, self.last = value, self

    def send(self, program: str, value: Any) -> None:
        """Send a value."""
        data = _uniform_bytes(program, self.uniform, value)
        self.number, self.last = None, value
        if data != self.data:
            self.uniform.write(data)
            self.data = data


def _refusal(name: str, log: str, fragment: str, locate: Locate | None) -> ShaderError:
    """A ShaderError for the driver's log that names the origin of the line."""
    heading, _, body = log.partition("=\n")
    in_fragment = "fragment_shader" in heading
    errors = [message for message in parse_messages(body) if message.severity == "error"]
    if not errors or not in_fragment:
        # Link errors have no line, and the vertex shader is never the user's.
        stage = "the fragment shader" if in_fragment else "the vertex shader" if "vertex" in heading else "linking"
        lines = [line for line in map(str.strip, body.splitlines()) if line and not _HEADING.match(line)]
        first = errors[0].text if errors else next(iter(lines), log.strip())
        return ShaderError(f"pass {name}: the driver refused {stage}: {first}")
    first_error = errors[0]
    # The driver got the stripped text, so its line 1 is the first line that is not blank.
    blank = fragment[: len(fragment) - len(fragment.lstrip())].count("\n")
    line = first_error.line + blank
    what, where = locate(line) if locate else ("raymarch itself", None)
    place = f"line {line}" if first_error.column is None else f"line {line}, column {first_error.column}"
    return ShaderError(
        f"pass {name}: the driver refused the fragment shader, {place}, made by {what}: {first_error.text}", where=where
    )


def _as_texture(value: Any) -> moderngl.Texture | moderngl.Texture3D | None:
    """The texture for a sampler, or None if `value` is a number."""
    match value:
        case moderngl.Texture() | moderngl.Texture3D():
            return value
        case Target():
            return value.textures[0]
        case (Target() as target, int(attachment)):
            return target.textures[attachment]
    return None


_KINDS: Final[dict[str, type[np.generic]]] = {"f": np.float32, "i": np.int32, "I": np.uint32, "d": np.float64}


def _uniform_bytes(program: str, uniform: Any, value: Any) -> bytes:
    """`value` as bytes in the layout of the uniform. OpenGL stores matrices by column, NumPy by row."""
    kind = _KINDS[uniform.fmt[-1]]
    single = type(value) is tuple and kind is np.float32 and not uniform.matrix and uniform.array_length == 1
    if single and len(value) == uniform.dimension:
        with suppress(struct.error, OverflowError):  # which the rest describes, or rounds to infinity
            return struct.pack(f"{len(value)}f", *value)
    values = value.values[: uniform.array_length] if isinstance(value, Elements) else np.asarray(value)
    if values.dtype.kind not in "fiub" or (values.dtype.kind == "f" and kind in (np.int32, np.uint32)):
        raise ValueError(f"{program}: {uniform.name} holds {kind.__name__}, not {value!r}")
    if values.size != uniform.dimension * uniform.array_length:
        wanted = f"{uniform.dimension} numbers" + (f" x {uniform.array_length}" if uniform.array_length > 1 else "")
        raise ValueError(f"{program}: {uniform.name} takes {wanted}, not shape {values.shape}")
    if uniform.matrix:
        if values.ndim < 2:
            raise ValueError(f"{program}: {uniform.name} takes (rows, columns), not shape {values.shape}")
        values = values.swapaxes(-1, -2)
    return np.ascontiguousarray(values, kind).tobytes()


def _check_tile(tile: tuple[int, int, int, int], width: int, height: int) -> None:
    x, y, across, up = tile
    if x < 0 or y < 0 or across < 1 or up < 1 or x + across > width or y + up > height:
        raise ValueError(f"tile={tile!r} lies outside the surface of {width} x {height} pixels")


class in_pass:
    """Convert a failure of the driver (out of memory, a lost context) to a DeviceError that names the passes.

    A DeviceError that the driver caused and that names no pass yet gets the names; invalid input of the user does not.
    """

    __slots__ = ("names",)

    def __init__(self, *names: str) -> None:
        self.names = names

    def __enter__(self) -> None:
        pass

    def __exit__(self, _type: Any, error: BaseException | None, _traceback: Any) -> None:
        if error is None:
            return
        what = f"pass {' and '.join(self.names)}"
        if isinstance(error, moderngl.Error):
            raise DeviceError(f"{what}: the device failed: {error}", legal="less memory, or a new Renderer") from error
        by_driver = isinstance(error, DeviceError) and isinstance(error.__cause__, moderngl.Error)
        if isinstance(error, DeviceError) and by_driver and not error.what.startswith("pass "):
            raise DeviceError(f"{what}: {error.what}", legal=error.legal, where=error.where) from error.__cause__
