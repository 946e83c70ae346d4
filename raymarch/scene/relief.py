"""What bends the normal of a surface: normal maps, height maps, and heights that are functions of the point.

All of them are the gradient in space of a height over the surface (Mikkelsen 2010, 2020): gradients add up, their mean
over a footprint is that of the surface, and it does not matter how a picture was laid.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from raymarch.errors import SceneError
from raymarch.expr.convert import called, short
from raymarch.expr.derivative import gradient
from raymarch.expr.node import Expr, expr
from raymarch.expr.types import FLOAT
from raymarch.expr.vocabulary import dot, max
from raymarch.expr.walk import find, free_variables
from raymarch.scene.parameter import as_number
from raymarch.scene.texture import Texture
from raymarch.sdf.domain import as_operand
from raymarch.sdf.lower import ACROSS, ALONG, NORMAL, OUTWARD, POSITION, SEEN

FLAT = expr((0.0, 0.0, 0.0))


def tilt_of(normal: Any, strength: Any, height: Any, scale: Any) -> Expr:
    """What is taken off the unit normal of a surface in the scene, before it is made of length 1 again.

    A vec3 along the surface, an expression of the label's space; FLAT for nothing.

    normal : a normal map or None. height : a height map, heights as an expression of POSITION, or None; times `scale`,
        in lengths.
    """
    steep = as_number("Material: normal_strength", strength, 0.0, 100.0, cells=True)
    tall = as_number("Material: height_scale", scale, -1e3, 1e3, cells=True)
    total = FLAT
    if normal is not None:
        if not isinstance(normal, Texture):
            what = f"Material: normal = {short(normal)} ({type(normal).__name__})"
            raise SceneError(what, legal="planar(...) or triplanar(...) of a normal map")
        total = total + steep * normal.tilt(POSITION)
    if height is not None:
        total = total + tall * (height.rise(POSITION) if isinstance(height, Texture) else gradient(height, POSITION))
    return FLAT if total is FLAT else _in_scene(total)


def height_of(height: Callable[[Expr], Any] | Any) -> Texture | Expr | None:
    """A height map, the heights that a function of the point gives, or None."""
    legal = "a texture, or a function of a point that gives a number"
    if height is None or isinstance(height, Texture):
        return height
    if isinstance(height, Expr) and POSITION in free_variables([height]):  # of another material
        made = height
    elif not callable(height) or isinstance(height, Expr):
        raise SceneError(f"Material: height = {short(height)} ({type(height).__name__})", legal=legal)
    else:
        made = as_operand(
            "Material: height: the function gives", called("Material: height", height, POSITION, legal=legal), legal
        )
    if made.type is not FLOAT or find([made], "texture"):
        what = "reads a texture" if made.type is FLOAT else f"gives a {made.type}"
        raise SceneError(f"Material: height: the function {what}", legal=legal)
    return made


def _in_scene(slope: Expr) -> Expr:
    """The tilt in the scene from a gradient G in the label's space.

    With N the normal there, g the part of G along the surface and J the derivative of the space, the bent normal
    N - g goes with J transposed. Along the footprint's axes that is G.(J axis); along the normal n of the scene it is
    (N - g).(J n), by which all is divided.
    """
    _, across, along = SEEN
    bent = NORMAL - (slope - dot(slope, NORMAL) * NORMAL)
    upright = max(dot(bent, OUTWARD), 1e-6)
    parts = [axis * (dot(slope, moved) / dot(axis, axis)) for axis, moved in ((across, ACROSS), (along, ALONG))]
    return (parts[0] + parts[1]) / upright
