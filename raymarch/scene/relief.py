"""Perturbed normals: normal maps, height maps, and heights that are functions of the point (bump mapping).

Each becomes the gradient in space of a height over the surface (Mikkelsen 2010, 2020). Gradients add up, their mean
over a footprint is that of the surface, and they do not depend on the projection of a picture.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from raymarch.errors import SceneError
from raymarch.expr.convert import called, described
from raymarch.expr.derivative import gradient
from raymarch.expr.function import function
from raymarch.expr.node import Expr, expr
from raymarch.expr.types import FLOAT, VEC3
from raymarch.expr.vocabulary import abs, cross, dot, length, max, normalize, vec3, where
from raymarch.expr.walk import find, free_variables
from raymarch.scene.map_arithmetic import MapExpression
from raymarch.scene.parameter import MOST_LENGTH, as_number
from raymarch.scene.texture import Texture
from raymarch.sdf.domain import as_operand
from raymarch.sdf.interaction import DPDN, DPDX, DPDY, NORMAL, POSITION, SCENE_INTERACTION

FLAT = expr((0.0, 0.0, 0.0))


@function(n=VEC3, v=VEC3, width=FLOAT)
def footprint_axis(n: Expr, v: Expr, width: Expr) -> Expr:
    """The minor axis of the ellipse in which a cone as wide as a pixel meets the tangent plane.

    n, v : unit normal, and unit direction to the camera. At normal incidence it is a circle: any tangent will do.
    """
    tangent = cross(n, v)
    other = where(abs(n.y) < 0.9, vec3(n.z, 0.0, -n.x), vec3(0.0, -n.z, n.y))
    axis = where(length(tangent) < 1e-4, other, tangent)
    return axis * (width / length(axis))


@function(n=VEC3, v=VEC3, bump_gradient=VEC3)
def shading_normal(n: Expr, v: Expr, bump_gradient: Expr) -> Expr:
    """The normal with relief. One that faces away from the camera is turned until it just faces it."""
    bent, side = normalize(n - bump_gradient), where(dot(n, v) < 0.0, -1.0, 1.0)
    return normalize(bent + side * max(0.01 - side * dot(bent, v), 0.0) * v)


def bump_gradient(normal: Any, strength: Any, height: Any, scale: Any) -> Expr:
    """The bump gradient: a vector that shading subtracts from the unit normal before it normalises the result.

    A vec3 tangent to the surface, in scene space, as an expression of the label's space. FLAT if there is no relief.

    normal : a normal map or None, times `strength`.
    height : a height map, heights as an expression of POSITION, or None, times `scale`, in units of length.
    """
    if normal is None and height is None and type(strength) is type(scale) is float and strength == 1.0 > scale > 0.0:
        return FLAT  # the usual case: a scene may have thousands of materials
    normal_factor = as_number("Material: normal_strength", strength, 0.0, 100.0, cells=True)
    height_factor = as_number("Material: height_scale", scale, -MOST_LENGTH, MOST_LENGTH, cells=True)
    total = FLAT
    if normal is not None:
        if not isinstance(normal, Texture):
            what = f"Material: normal = {described(normal)}"
            raise SceneError(what, legal="planar(...) or triplanar(...) of a normal map; normal_strength scales it")
        total = total + normal_factor * normal.normal_map_gradient(POSITION)
    if height is not None:
        slope = height.height_gradient(POSITION) if isinstance(height, Texture) else gradient(height, POSITION)
        total = total + height_factor * slope
    return FLAT if total is FLAT else _in_scene(total)


def height_field(height: Callable[[Expr], Any] | Any) -> Texture | Expr | None:
    """A height map, the heights of a function of the point as an expression, or None."""
    legal = "a texture, which height_scale scales, or a function of a point that gives a number"
    if isinstance(height, MapExpression):
        raise SceneError(f"Material: height = {height!r}", legal=legal)
    if height is None or isinstance(height, Texture):
        return height
    if isinstance(height, Expr) and POSITION in free_variables([height]):  # from another material, by `replace`
        made = height
    elif not callable(height) or isinstance(height, Expr):
        raise SceneError(f"Material: height = {described(height)}", legal=legal)
    else:
        made = as_operand(
            "Material: height: the function gives", called("Material: height", height, POSITION, legal=legal), legal
        )
    if made.type is not FLOAT or find([made], "texture"):
        what = "reads a texture" if made.type is FLOAT else f"gives a {made.type}"
        raise SceneError(f"Material: height: the function {what}", legal=legal)
    return made


def _in_scene(slope: Expr) -> Expr:
    """The bump gradient in scene space from a gradient G in the label's space.

    N is the normal in the label's space, g the tangential part of G, and J the Jacobian from scene space to the label's
    space. The perturbed normal N - g is transformed by J transposed. Its component along an axis of the footprint is
    G.(J axis). Its component along the normal n of the scene is (N - g).(J n), by which the result is divided.
    """
    _, dpdx, dpdy = SCENE_INTERACTION
    perturbed = NORMAL - (slope - dot(slope, NORMAL) * NORMAL)
    n_component = max(dot(perturbed, DPDN), 1e-6 * length(DPDN))
    parts = [axis * (dot(slope, local) / dot(axis, axis)) for axis, local in ((dpdx, DPDX), (dpdy, DPDY))]
    return (parts[0] + parts[1]) / n_component
