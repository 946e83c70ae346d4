"""What identifies the driver of a context, and its limits."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from raymarch.gpu.measured_prices import of_driver
from raymarch.plan.device import DeviceClass, device_class

_SOFTWARE_RENDERERS = ("llvmpipe", "softpipe", "swrast", "software", "swiftshader", "basic render", "gdi generic")


@dataclass(frozen=True, slots=True)
class Driver:
    """The three identification strings of the driver, and whether it renders on the CPU."""

    renderer: str
    vendor: str
    version: str
    is_software: bool

    @property
    def class_alone(self) -> DeviceClass:
        """The class of the driver, whatever was measured on it."""
        return device_class(self.is_software)

    @property
    def device_class(self) -> DeviceClass:
        """The class for which scenes are planned, with the prices that were measured on this driver."""
        return of_driver(self.renderer, self.version, self.class_alone)

    @property
    def compiles_opaque_twice(self) -> bool:
        """True for llvmpipe, which compiles a fragment shader with one opaque output twice: for blocks of pixels that
        the triangle covers in part, and for others. With a logical operation it compiles once."""
        return self.renderer.startswith("llvmpipe")


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits of the driver: sizes in pixels, uniforms in 32-bit components and in vec4."""

    texture_size: int
    viewport: tuple[int, int]
    renderbuffer_size: int
    fragment_uniform_components: int
    fragment_uniform_vectors: int
    texture_units: int
    color_attachments: int

    @property
    def picture(self) -> tuple[int, int]:
        """The largest (width, height) of a render target."""
        return min(self.texture_size, self.viewport[0]), min(self.texture_size, self.viewport[1])


def driver_of(info: dict[str, Any]) -> Driver:
    """The driver of a context, from what moderngl tells of it."""
    renderer = str(info["GL_RENDERER"])
    is_software = any(word in renderer.lower() for word in _SOFTWARE_RENDERERS)
    return Driver(renderer, str(info["GL_VENDOR"]), str(info["GL_VERSION"]), is_software)


def limits_of(info: dict[str, Any]) -> Limits:
    """The limits of a context, from what moderngl tells of it."""
    width, height = info["GL_MAX_VIEWPORT_DIMS"]
    components = int(info["GL_MAX_FRAGMENT_UNIFORM_COMPONENTS"])
    return Limits(
        texture_size=int(info["GL_MAX_TEXTURE_SIZE"]),
        viewport=(int(width), int(height)),
        renderbuffer_size=int(info["GL_MAX_RENDERBUFFER_SIZE"]),
        fragment_uniform_components=components,
        # The count in vec4 exists since OpenGL 4.1; a 3.3 driver may not report it.
        fragment_uniform_vectors=int(info.get("GL_MAX_FRAGMENT_UNIFORM_VECTORS") or components // 4),
        texture_units=int(info["GL_MAX_TEXTURE_IMAGE_UNITS"]),
        color_attachments=min(int(info["GL_MAX_COLOR_ATTACHMENTS"]), int(info["GL_MAX_DRAW_BUFFERS"])),
    )
