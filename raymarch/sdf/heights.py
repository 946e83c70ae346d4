"""Height maps: pictures and arrays as surfaces."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from raymarch.errors import SceneError
from raymarch.expr.calls import checked
from raymarch.expr.convert import input_file, numbers
from raymarch.expr.images import opened
from raymarch.expr.node import Expr, expr
from raymarch.expr.samples import Samples, sample
from raymarch.expr.vocabulary import length, max, min, vec2, vec3
from raymarch.sdf.definition import Child, operator, shape
from raymarch.sdf.domain import Data, NonNegative, Scalar, Size2, Vector
from raymarch.sdf.node import Node, method
from raymarch.sdf.sampled import MOST, refuse_broken, texels

__all__ = ["heightmap"]


# Height maps


def luminance(source: str | os.PathLike[str] | ArrayLike, what: str) -> NDArray[np.float64]:
    """Heights from 0 to 1 of an image file (its luminance), or an array as it is; shape (rows, columns)."""
    legal = f"from 2 x 2 to {MOST} x {MOST} finite numbers"
    if isinstance(source, str | os.PathLike):
        source = input_file(f"{what}: source", source, "an image file")
        with opened(what, source, MOST, least=2) as picture:
            array = np.asarray(picture.convert("F"), np.float64) / (65535.0 if "16" in picture.mode else 255.0)
    else:
        array = numbers(f"{what}: source", source, f"an image file, or heights {legal}")
        if array.ndim != 2 or not 2 <= np.min(array.shape) <= np.max(array.shape) <= MOST:
            raise SceneError(f"{what}: heights of shape {array.shape}", legal=f"(rows, columns), {legal}")
    refuse_broken(what, ~np.isfinite(array), "heights", legal)
    return array


def _carpet(data: Samples, size: Any, height: Any) -> Expr:
    cell = expr(size) / tuple(texels(data))
    return data.steepest * height / min(cell.x, cell.y)


def _some_hills() -> Samples:
    """Gentle hills, for the example."""
    y, x = np.mgrid[0:1:32j, 0:1:32j]
    return Samples(0.5 + 0.5 * np.sin(2 * np.pi * x) * np.cos(2 * np.pi * y))


HILLS = _some_hills()


@operator(
    bounds=lambda child, data, height: child.grown(max(float(data.values.max()), 0.0) * height),
    lipschitz=lambda child, data, size, height: child.lipschitz + _carpet(data, size, height),
    spread="keep",
    called="displace_by_image",
)
def displace_by_samples(
    p: Expr, child: Child, data: Data = HILLS, size: Size2 = (2.0, 2.0), height: NonNegative = 0.2
) -> Expr:
    """Displace a surface along its normals by data over the xz plane; outside the data the edge values continue."""
    at = (p.xz / size + 0.5) * tuple(texels(data))
    return child(p) - height * sample(data, at)


@method
def displace_by_image(
    node: Node, source: str | os.PathLike[str] | ArrayLike, size: Vector | Scalar = (2.0, 2.0), height: Scalar = 0.2
) -> Node:
    """Displace a surface along its normals by an image over the xz plane.

    Parameters
    ----------
    source : image file (its luminance, 0 to 1), or heights of shape (rows, columns); row 0 lies at the far side, -z.
    size : extents of the image along x and z, > 0.
    height : displacement for the value 1, a length >= 0.

    Returns
    -------
    Node

    Raises
    ------
    SceneError : arguments of another kind or outside their range.

    Notes
    -----
    The slope of the data adds to the Lipschitz constant, so steep maps are marched in smaller steps.
    """
    return displace_by_samples(node, Samples(luminance(source, "displace_by_image")), size, height)


@shape(
    exactness="bound",
    bounds=lambda data, size, height, base: (
        vec3(-0.5 * size.x, -base, -0.5 * size.y),
        vec3(0.5 * size.x, height * float(np.max(data.values)), 0.5 * size.y),
    ),
    # the gradient of y - h(x, z) is (-h_x, 1, -h_z)
    lipschitz=lambda data, size, height: length(vec2(1.0, _carpet(data, size, height))),
    spread=1.0,
    called="heightmap",
)
def terrain(
    p: Expr, data: Data = HILLS, size: Size2 = (2.0, 2.0), height: NonNegative = 0.4, base: NonNegative = 0.2
) -> Expr:
    """A block whose top follows sampled heights."""
    at = (p.xz / size + 0.5) * tuple(texels(data))
    over = p.y - height * sample(data, at)
    q = abs(vec2(p.x, p.z)) - 0.5 * size
    return max(over, max(-p.y - base, max(q.x, q.y)))


@checked
def heightmap(
    source: str | os.PathLike[str] | ArrayLike,
    size: Vector | Scalar = (2.0, 2.0),
    height: Scalar = 0.4,
    base: Scalar = 0.2,
) -> Node:
    """Terrain: a block whose top follows a height map.

    Parameters
    ----------
    source : image file (its luminance, 0 to 1), or heights of shape (rows, columns); row 0 lies at the far side, -z.
    size : extents along x and z, > 0.
    height : length of the value 1, >= 0.
    base : depth of the block below y = 0.

    Returns
    -------
    Node

    Raises
    ------
    SceneError : arguments of another kind or outside their range.

    Notes
    -----
    A bound: divided by the steepest slope of the map.
    """
    return terrain(Samples(luminance(source, "heightmap")), size, height, base)
