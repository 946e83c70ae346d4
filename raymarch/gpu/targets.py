"""Render targets with float textures, single or as a ping-pong pair.

OpenGL's first row is the bottom of a picture; arrays here have row 0 at the TOP. Only `Target.read` and
`Target.write` flip rows.
"""

from __future__ import annotations

import operator
from typing import Any, Protocol

import moderngl
import numpy as np
from numpy.typing import ArrayLike, NDArray

from raymarch.errors import DeviceError, SceneError
from raymarch.expr.convert import plain, short
from raymarch.expr.samples import Samples
from raymarch.expr.tables import Table
from raymarch.expr.texels import Texels
from raymarch.gpu.context import Context, Releasing

_COMPONENTS = 4


class Surface(Protocol):
    """Anything that a program can draw into: a `Target`, or the framebuffer of a window with the same interface."""

    @property
    def framebuffer(self) -> moderngl.Framebuffer: ...

    @property
    def size(self) -> tuple[int, int]: ...


class Target(Releasing):
    """A framebuffer with RGBA float textures of one size; attachment i is `layout(location = i)` of the shader.

    Sampling is nearest, clamped to the edge. The content is undefined until it is drawn, written or cleared.

    context : the context of the textures; bound here and by every method.
    size : (width, height) in pixels, integers from 1 to `context.limits.picture`.
    attachments : number of textures, from 1 to `context.limits.color_attachments`.
    dtype : "f4" (32-bit floats) or "f2" (16-bit).

    Raises DeviceError for a size, count or type outside the range above, or without enough memory on the device.
    """

    def __init__(self, context: Context, size: tuple[int, int], attachments: int = 1, dtype: str = "f4") -> None:
        self.context = context
        self.size = _checked_size(context, size)
        self.attachments = _checked("attachments", attachments, context.limits.color_attachments)
        if dtype not in ("f4", "f2"):
            raise DeviceError(f"dtype={dtype!r} of a target", legal="legal: 'f4' or 'f2'")
        self.dtype = dtype
        self.released = False
        self._textures: tuple[moderngl.Texture, ...] = ()
        self._framebuffer: moderngl.Framebuffer | None = None
        try:
            with context.bound():
                self._allocate()
        except BaseException as error:
            self.release()
            if not isinstance(error, moderngl.Error):
                raise
            raise DeviceError(f"no target of {self._describe()}: {error}", legal="a smaller size") from error

    def _allocate(self) -> None:
        gl = self.context.gl
        _ = gl.error  # reading it clears an older error, which must not count as ours
        for _ in range(self.attachments):
            texture = gl.texture(self.size, _COMPONENTS, dtype=self.dtype)
            self._textures += (texture,)
            texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
            texture.repeat_x = texture.repeat_y = False
        if gl.error == "GL_OUT_OF_MEMORY":
            raise moderngl.Error("the device is out of memory")
        self._framebuffer = gl.framebuffer(self._textures)

    def _describe(self) -> str:
        width, height = self.size
        return f"{self.attachments} x {width} x {height} RGBA texels of type {self.dtype}"

    @property
    def textures(self) -> tuple[moderngl.Texture, ...]:
        """The textures by attachment. DeviceError after release."""
        self._check_alive()
        return self._textures

    @property
    def framebuffer(self) -> moderngl.Framebuffer:
        """The framebuffer with all the textures attached. DeviceError after release."""
        self._check_alive()
        assert self._framebuffer is not None
        return self._framebuffer

    def read(self, attachment: int = 0) -> NDArray[np.float32]:
        """The texels of one attachment as float32 (height, width, 4), row 0 at the top. Waits for the device."""
        return np.ascontiguousarray(self.channels(attachment, _COMPONENTS))

    def channels(self, attachment: int, count: int) -> NDArray[np.float32]:
        """As `read`, of the first `count` channels only, and as a view of rows that lie from the bottom up."""
        width, height = self.size
        rows = np.empty((height, width, count), np.float32)
        with self.context.bound():
            self.framebuffer.read_into(rows, components=count, attachment=self._index(attachment), dtype="f4")
        return rows[::-1]

    def read_texel(self, x: int, row: int, attachment: int = 0) -> NDArray[np.float32]:
        """One texel as float32 (4,): column `x`, and `row` counted from the top. Waits for the device."""
        width, height = self.size
        if not (0 <= x < width and 0 <= row < height):
            raise IndexError(f"texel ({x}, {row}) of a target of {width} x {height}")
        with self.context.bound():
            data = self.framebuffer.read(
                (x, height - 1 - row, 1, 1), _COMPONENTS, attachment=self._index(attachment), dtype="f4"
            )
        return np.frombuffer(data, np.float32)

    def write(self, values: ArrayLike, attachment: int = 0) -> None:
        """Overwrite one attachment with `values`, shape (height, width, 4) or broadcast to it, row 0 at the top."""
        width, height = self.size
        texels = np.broadcast_to(np.asarray(values, self.dtype), (height, width, _COMPONENTS))
        with self.context.bound():
            self.read_unread()
            self.textures[self._index(attachment)].write(np.ascontiguousarray(texels[::-1]))

    def clear(self, value: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)) -> None:
        """Set every texel of every attachment to the RGBA `value`."""
        with self.context.bound():
            self.read_unread()
            # The scissor of an earlier draw would confine the clear: that of this target, or, since moderngl's clear
            # binds the framebuffer without its scissor, that of the bound framebuffer.
            confine(self.framebuffer, None)
            self.framebuffer.use()
            self.framebuffer.clear(*value)

    def release(self) -> None:
        """Free the textures. Idempotent, and safe after the context was released, which frees them."""
        if self.released:
            return
        if not self.context.released:
            self.read_unread()
        self.released = True
        if self.context.released:
            return
        # Contexts reuse the numbers of GL names: deleting these while another context is current would delete
        # textures of that context.
        with self.context.bound():
            if self._framebuffer is not None:
                gl = self.context.gl
                if gl.fbo is self._framebuffer:
                    # moderngl rebinds the framebuffer in use after it makes another one: a deleted one is a GL error.
                    gl.detect_framebuffer(0).use()
                self._framebuffer.release()
            for texture in self._textures:
                texture.release()

    def read_unread(self) -> None:
        """Read what frames still need of the content, before it changes."""
        if self.context.unread:
            for unread in [unread for unread in self.context.unread if unread.target is self]:
                unread.read_all()

    def _index(self, attachment: int) -> int:
        if not 0 <= attachment < self.attachments:
            raise IndexError(f"attachment {attachment} of a target with {self.attachments}")
        return attachment

    def _check_alive(self) -> None:
        if self.released or self.context.released:
            raise DeviceError(f"the target of {self._describe()} was released", legal="a new target")


class PingPong(Releasing):
    """Two equal targets: draw into `back` while the shader reads `front`, then `swap`.

    Parameters and errors are those of `Target`.
    """

    def __init__(self, context: Context, size: tuple[int, int], attachments: int = 1, dtype: str = "f4") -> None:
        self.front = Target(context, size, attachments, dtype)
        try:
            self.back = Target(context, size, attachments, dtype)
        except BaseException:
            self.front.release()
            raise

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) in pixels."""
        return self.front.size

    @property
    def attachments(self) -> int:
        """Number of textures of each target."""
        return self.front.attachments

    def swap(self) -> None:
        self.front, self.back = self.back, self.front

    def release(self) -> None:
        """Free both targets. Idempotent."""
        self.front.release()
        self.back.release()


def upload(context: Context, data: Samples | Table) -> moderngl.Texture | moderngl.Texture3D:
    """Upload sampled data or a table as a float32 texture for texelFetch. DeviceError if it does not fit."""
    with context.bound():
        try:
            make: Any = context.gl.texture if data.dimension == 2 else context.gl.texture3d
            texture: moderngl.Texture | moderngl.Texture3D = make(*data.texture(), alignment=1, dtype="f4")
        except moderngl.Error as fault:
            raise DeviceError(f"no texture for {data.label}, {data.size}: {fault}", legal="smaller data") from fault
        texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
    return texture


def upload_pyramid(context: Context, data: Texels) -> moderngl.Texture:
    """Upload an image as a half-float texture with all mip levels and trilinear filtering. DeviceError if it does not
    fit."""
    size, levels = data.size, data.levels
    with context.bound():
        try:
            texture = context.gl.texture(size, data.channels, levels[0].tobytes(), alignment=1, dtype="f2")
            if len(levels) > 1:
                texture.build_mipmaps(0, len(levels) - 1)  # allocates the levels, which are then overwritten
                for k, level in enumerate(levels[1:], 1):
                    texture.write(level.tobytes(), (0, 0, *level.shape[1::-1]), level=k, alignment=1)
        except moderngl.Error as fault:
            raise DeviceError(f"no texture for {data.label} of {size}: {fault}", legal="smaller pictures") from fault
        texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR if len(levels) > 1 else moderngl.LINEAR, moderngl.LINEAR)
        texture.repeat_x = texture.repeat_y = data.wrap == "repeat"
    return texture


def confine(framebuffer: Any, tile: tuple[int, int, int, int] | None) -> None:
    """Confine drawing and clearing to `tile`, (x, y, width, height) from the bottom left; None removes the limit.

    `Any`, because the stubs of moderngl 5.13 do not declare that None removes the scissor.
    """
    framebuffer.scissor = tile


def _checked_size(context: Context, size: tuple[int, int]) -> tuple[int, int]:
    try:
        width, height = size
    except (TypeError, ValueError):
        raise SceneError(f"size = {short(size)}", legal="(width, height) in pixels, such as (640, 360)") from None
    widest, highest = context.limits.picture
    return _checked("width", width, widest), _checked("height", height, highest)


def _checked(name: str, value: Any, most: int) -> int:
    try:
        number = operator.index(plain(value))  # refuses 640.0 and "640", takes numpy's integers
    except TypeError:
        number = 0
    legal = f"an integer from 1 to {most}, the limit of this driver"
    if isinstance(value, bool) or number < 1:
        raise SceneError(f"{name} = {short(value)}", legal=legal)
    if number > most:
        raise DeviceError(f"{name} = {number}", legal=legal)
    return number
