"""Textures: pictures projected onto surfaces, as values of a material.

A texture is filtered at a point of the space in which the material is given, over the pixel footprint in that space.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np

from raymarch.errors import SceneError
from raymarch.expr.calls import checked
from raymarch.expr.convert import choice, instance, optional, short
from raymarch.expr.degrees import suspect_degrees
from raymarch.expr.derivative import directional_derivatives
from raymarch.expr.function import sum_of
from raymarch.expr.node import Expr, expr
from raymarch.expr.texels import WRAPS, Texels, Wrap
from raymarch.expr.textures import texture
from raymarch.expr.vocabulary import abs, cos, max, pow, sin, vec2, vec3, where
from raymarch.scene.map_arithmetic import MapValue
from raymarch.scene.parameter import LEAST_LENGTH, MOST_LENGTH, as_number
from raymarch.scene.picture import Array, Picture, Stored, stored_of, values_for
from raymarch.scene.value import Value, value
from raymarch.sdf.domain import Scalar
from raymarch.sdf.interaction import DPDX, DPDY, NORMAL, POSITION

FACES = {"x": ((2, -1.0), (1, 1.0)), "y": ((0, 1.0), (2, -1.0)), "z": ((0, 1.0), (1, 1.0))}
"""For each projection axis, the axes across and up the picture, with signs. The picture is upright as seen from the
positive end of the projection axis."""


@value
class Layout(Value):
    """Projection of a picture into space.

    axis : projection axis; None for all three, weighted by the normal.
    extents : lengths of one picture along u and v.
    shift : offset of its centre, two lengths.
    turn : rotation of the picture, counter-clockwise, in radians.
    hardness : exponent of the weights of the three projections.
    what : name of the caller, for messages.
    """

    axis: str | None
    extents: tuple[Expr, Expr]
    shift: tuple[Expr, Expr]
    turn: Expr
    hardness: Expr
    what: str

    def __init__(
        self,
        axis: str | None,
        extents: Any = (1.0, 1.0),
        shift: Any = (0.0, 0.0),
        turn: Any = 0.0,
        hardness: Any = 1.0,
        what: str = "texture",
    ) -> None:
        what = instance("Layout: what", what, str, "the name of the caller, for messages")
        suspect_degrees(f"{what}: rotation", turn)
        self._set(
            axis=optional(choice, f"{what}: axis", axis, tuple(FACES)),
            extents=_pair(f"{what}: size", extents, "a length > 0, or two", LEAST_LENGTH),
            shift=_pair(f"{what}: offset", shift, "two lengths", -MOST_LENGTH),
            turn=as_number(f"{what}: rotation", turn, -1e6, 1e6, cells=True),
            hardness=as_number(f"{what}: hardness", hardness, 1.0, 64.0),
            what=what,
        )

    def _identity(self) -> tuple[Any, ...]:
        return self.axis, self.extents, self.shift, self.turn, self.hardness


@value
class Texture(Value, MapValue):
    """A picture with its projection, made by `planar` and `triplanar`.

    It may be any value of a `Material`, and so may its arithmetic with numbers, parameters, colours and other textures,
    such as `0.2 + 0.5 * planar("rough.png")`: a number of the material takes the stored value, a colour linear RGB. In
    a function of the point, `texture(p)` and `texture.color(p)` give the colour at p, `texture.number(p)` the stored
    value.

    Parameters
    ----------
    what : the name in messages, "planar" or "triplanar".
    picture : the picture as stored.
    layout : its projection.
    wrap, channel, green : see `planar`.

    Raises
    ------
    SceneError : as `planar` does.
    """

    BELONGS: ClassVar[str] = "a value of a Material"
    what: str
    picture: Stored
    layout: Layout
    wrap: Wrap
    channel: str | None
    green: str
    _made: dict[str, Texels]

    def __init__(
        self,
        what: str,
        picture: Picture | Stored,
        layout: Layout,
        wrap: Wrap = "repeat",
        channel: str | None = None,
        green: str = "up",
    ) -> None:
        given = stored_of(what, picture)
        channels = "rgba"[: given.pixels.shape[2]]
        legal = f"{', '.join(map(repr, channels))} or None"
        self._set(
            what=what,
            picture=given,
            layout=instance(f"{what}: layout", layout, Layout, "a Layout"),
            wrap=choice(f"{what}: wrap", wrap, WRAPS),
            channel=optional(choice, f"{what} of '{given.name}': channel", channel, tuple(channels), legal),
            green=choice(f"{what}: green", green, ("up", "down"), "'up' (OpenGL) or 'down' (Direct3D)"),
            _made={},
        )

    @property
    def pixels(self) -> Array:
        """Values as stored, (H, W, channels), row 0 at the top."""
        return self.picture.pixels

    @property
    def file(self) -> str:
        """Name of the file, or "array of" and the shape."""
        return self.picture.name

    def __repr__(self) -> str:
        return f"Texture({self.file!r}, {self.size[0]} x {self.size[1]})"

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) in pixels."""
        return self.pixels.shape[1], self.pixels.shape[0]

    def color(self, p: Expr) -> Expr:
        """Linear RGB at a point, a vec3. Grey pictures and single channels give grey."""
        if self.channel is not None or self.pixels.shape[2] < 3:
            value = self._sampled(self._texels("grey"), p)
            return vec3(value)
        return self._sampled(self._texels("color"), p)

    def number(self, p: Expr) -> Expr:
        """The value at a point, a float, as stored (not decoded from sRGB)."""
        channels = self.pixels.shape[2]
        if self.channel is not None and channels >= 3 and self.channel != "a":
            return self._sampled(self._texels("stored"), p)["rgb".index(self.channel)]  # one texture for all channels
        if self.channel is None and channels >= 3 and np.ptp(self.pixels[..., :3], axis=2).max() > 1.5 / 255.0:
            what = f"'{self.file}' has {channels} channels where one number is wanted"
            raise SceneError(what, legal="a grey picture, or channel='r', 'g' or 'b'")
        return self._sampled(self._texels("number"), p)

    def normal_map_gradient(self, p: Expr) -> Expr:
        """The slopes of a normal map as the gradient in space of a height over the surface, a vec3."""
        if self.pixels.shape[2] < 3:
            legal = "three: red right, green up, blue out"
            what = f"'{self.file}' has {self.pixels.shape[2]} channel{'s' * (self.pixels.shape[2] > 1)}, no normals"
            raise SceneError(what, legal=legal)
        return self._gradient(self._texels("normals"), p, False)

    def height_gradient(self, p: Expr) -> Expr:
        """The gradient in space of the picture's values, taken as heights, a vec3."""
        if self.channel is None:
            self.number(p)  # refuses colours
        return self._gradient(self._texels("heights"), p, True)

    def _texels(self, role: str) -> Texels:
        if role not in self._made:
            channel = None if self.channel is None else "rgba".index(self.channel)
            values = values_for(self.pixels, role, self.picture.encoded, channel, self.green == "down", self.wrap)
            self._made[role] = Texels(values, self.wrap, self.file)
        return self._made[role]

    def _sampled(self, data: Texels, p: Expr) -> Expr:
        """The picture at a point: one projection, or the weighted sum of three."""
        place = _Place(p)
        return sum_of([place.read(data, self.layout, axis, weight) for axis, weight in _weights(self.layout).items()])

    def _gradient(self, data: Texels, p: Expr, per_tile: bool) -> Expr:
        """Slopes along u and v as a gradient in space. Gradients of the three projections add up (Mikkelsen 2020)."""
        place, layout = _Place(p), self.layout
        terms = []
        for axis, weight in _weights(layout).items():
            slope = place.read(data, layout, axis, weight)
            terms.append(_Frame(layout, axis).out(slope / vec2(*layout.extents) if per_tile else slope))
        return sum_of(terms)


def _weights(layout: Layout) -> dict[str, Expr]:
    """The weights of the projections, from the components of the normal if there are three; their sum is 1."""
    if layout.axis is not None:
        return {layout.axis: expr(1.0)}
    powers = [pow(abs(NORMAL[i]), layout.hardness) for i in range(3)]
    total = max(powers[0] + powers[1] + powers[2], 1e-30)
    return {axis: power / total for axis, power in zip("xyz", powers, strict=True)}


class _Place:
    """A point at which a texture is sampled, with the footprint there."""

    def __init__(self, p: Expr) -> None:
        self.p = p
        # If a pattern moves the point, the footprint is transformed by the derivative of the motion.
        self.dpdx, self.dpdy = (DPDX, DPDY) if p is POSITION else directional_derivatives(p, POSITION, (DPDX, DPDY))

    def read(self, data: Texels, layout: Layout, axis: str, weight: Expr) -> Expr:
        """The picture projected along one axis, times a weight."""
        frame, size = _Frame(layout, axis), vec2(*layout.extents)
        middle = (frame.within(self.p) - frame.turned(*layout.shift)) / size + 0.5
        return texture(data, middle, frame.within(self.dpdx) / size, frame.within(self.dpdy) / size, weight)


class _Frame:
    """The directions across and up a picture. With three projections each is mirrored to be readable from outside."""

    def __init__(self, layout: Layout, axis: str) -> None:
        (self._across, self._sign), (self._up, self._sign_up) = FACES[axis]
        self._mirror = where(NORMAL["xyz".index(axis)] < 0.0, -1.0, 1.0) if layout.axis is None else expr(1.0)
        self._cos, self._sin = cos(layout.turn), sin(layout.turn)

    def turned(self, right: Expr, up: Expr) -> Expr:
        """Components across and up the surface as components across and up the rotated picture, a vec2."""
        return vec2(self._cos * right + self._sin * up, self._cos * up - self._sin * right)

    def within(self, v: Expr) -> Expr:
        """The components of a vector in space across and up the picture, a vec2."""
        return self.turned(self._mirror * (self._sign * v[self._across]), self._sign_up * v[self._up])

    def out(self, slope: Expr) -> Expr:
        """The vector in space of a vec2 across and up the picture."""
        parts = [expr(0.0)] * 3
        parts[self._across] = self._mirror * (self._sign * (self._cos * slope.x - self._sin * slope.y))
        parts[self._up] = self._sign_up * (self._sin * slope.x + self._cos * slope.y)
        return vec3(*parts)


def _pair(what: str, value: Any, legal: str, low: float) -> tuple[Expr, Expr]:
    if not isinstance(value, tuple | list | np.ndarray) or np.ndim(np.asarray(value, object)) < 1 or len(value) != 2:
        raise SceneError(f"{what} = {short(value)}", legal=legal)
    across, up = (as_number(what, v, low, MOST_LENGTH, cells=low < 0.0) for v in value)
    return across, up


def _projected(
    what: str, picture: Picture, axis: str | None, size: Any, offset: Any, rotation: Any, hardness: Any, **parts: Any
) -> Texture:
    """A texture. If only its width is given, its height follows from the aspect ratio of the picture."""
    stored = stored_of(what, picture)
    if not (isinstance(size, tuple | list) or (isinstance(size, np.ndarray) and size.ndim)):
        width = as_number(f"{what}: size", size, LEAST_LENGTH, MOST_LENGTH)
        size = (width, width * (stored.pixels.shape[0] / stored.pixels.shape[1]))
    return Texture(what, stored, Layout(axis, size, offset, rotation, hardness, what), **parts)


@checked
def planar(
    source: Picture,
    size: Scalar | Sequence[Scalar] = 1.0,
    axis: str = "z",
    *,
    offset: Sequence[Scalar] = (0.0, 0.0),
    rotation: Scalar = 0.0,
    wrap: Wrap = "repeat",
    channel: str | None = None,
    green: str = "up",
) -> Texture:
    """A texture projected along one axis, its centre at the origin.

    Parameters
    ----------
    source : a picture: the name of a file, or an array (H, W) or (H, W, channels), row 0 at the top. Files of integers
        and arrays of uint8 are divided by the largest integer, and their colours are sRGB-encoded. OpenEXR, Radiance
        and other arrays are linear.
    size : width of the picture in scene units, or (width, height), > 0.
    axis : "x", "y" or "z". The picture is upright as seen from the positive end of the axis.
    offset : offset of its centre, across and up, in scene units.
    rotation : rotation about the centre, counter-clockwise, in radians.
    wrap : "repeat", "mirror", or "clamp" to the edge pixels.
    channel : "r", "g", "b" or "a", for values that are one number. Maps in several channels of one picture share one
        texture.
    green : direction of the green channel of a normal map: "up" (OpenGL) or "down" (Direct3D).

    Returns
    -------
    Texture

    Raises
    ------
    SceneError : a file that is missing or broken, more than 4096 pixels along an edge, or values out of range.
    """
    choice("planar: axis", axis, tuple(FACES), "'x', 'y' or 'z'")
    return _projected("planar", source, axis, size, offset, rotation, 1.0, wrap=wrap, channel=channel, green=green)


@checked
def triplanar(
    source: Picture,
    size: Scalar | Sequence[Scalar] = 1.0,
    hardness: Scalar = 4.0,
    *,
    offset: Sequence[Scalar] = (0.0, 0.0),
    rotation: Scalar = 0.0,
    wrap: Wrap = "repeat",
    channel: str | None = None,
    green: str = "up",
) -> Texture:
    """A texture projected along all three axes and blended by the normal. It fits any solid.

    Parameters
    ----------
    source, size, offset, rotation, wrap, channel, green : see `planar`.
    hardness : from 1 (wide blend) to 64. The weights are |n|^hardness, divided by their sum.

    Returns
    -------
    Texture

    Raises
    ------
    SceneError : as `planar` does.

    Notes
    -----
    The normal and height maps of the three projections add up as gradients (Mikkelsen 2020).
    """
    return _projected(
        "triplanar", source, None, size, offset, rotation, hardness, wrap=wrap, channel=channel, green=green
    )


def share_projection(a: Texture, b: Texture) -> bool:
    """True if two textures share a projection, so that their texels correspond."""

    def key(layout: Layout) -> tuple[Any, ...]:
        return layout.axis, layout.extents[0], layout.shift, layout.turn

    return key(a.layout) == key(b.layout)
