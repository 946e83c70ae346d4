"""User-defined fractals: space is folded and scaled repeatedly, then the distance of a solid is evaluated there.

The folds of most such fractals are here as well: `plane_fold`, `box_fold` and `ball_fold`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Annotated, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from raymarch.errors import SceneError
from raymarch.expr.calls import checked
from raymarch.expr.convert import called, numbers, short
from raymarch.expr.function import loop
from raymarch.expr.node import Expr, Operand, const, expr
from raymarch.expr.types import FLOAT, VEC3
from raymarch.expr.vocabulary import abs as absolute
from raymarch.expr.vocabulary import clamp, dot, length, max, min, normalize, rotation2, vec3
from raymarch.sdf.definition import Child, operator, shape
from raymarch.sdf.domain import Count, Domain, Factor, Scalar, as_operand, corners_of
from raymarch.sdf.node import Node
from raymarch.sdf.solids import from_faces
from raymarch.sdf.values import at_least

__all__ = ["ball_fold", "box_fold", "fold_fractal", "plane_fold"]

Fold: TypeAlias = Callable[[Expr, Expr, Expr], tuple[Any, Any]]
Corners: TypeAlias = tuple[tuple[float, ...], tuple[float, ...]]
TINY = 1e-20


@checked
def plane_fold(z: Operand, normal: Operand) -> Expr:
    """Reflect points behind a plane through the origin to its front.

    Parameters
    ----------
    z : vec3.
    normal : vec3 of any length but 0, towards the front. Keeps distances: `growth` stays as it is.

    Returns
    -------
    Expr

    Raises
    ------
    SceneError : arguments of another kind or outside their range.
    """
    n = normalize(as_operand("plane_fold: normal", normal, "a vec3, not all zero"))
    z = as_operand("plane_fold: z", z, "a vec3")
    return z - 2.0 * min(dot(z, n), 0.0) * n


@checked
def box_fold(z: Operand, limit: Operand = 1.0) -> Expr:
    """Reflect points beyond a face of the cube from -limit to limit in that face. Keeps distances.

    Parameters
    ----------
    z : the point, a vec3.
    limit : half the edge of the cube, a length > 0. Returns the new point.

    Returns
    -------
    Expr

    Raises
    ------
    SceneError : arguments of another kind or outside their range.
    """
    at, end = as_operand("box_fold: z", z, "a vec3"), as_operand("box_fold: limit", limit, "a number > 0")
    return 2.0 * clamp(at, -end, end) - at


@checked
def ball_fold(z: Operand, growth: Operand, inner: Operand = 0.5, outer: Operand = 1.0) -> tuple[Expr, Expr]:
    """Invert the points of a ball about the origin in its sphere; scale those of an inner ball.

    Parameters
    ----------
    z, growth : see `fold_fractal`.
    inner, outer : radii of the balls, 0 < inner <= outer. Returns the new z and growth.

    Returns
    -------
    tuple[Expr, Expr]

    Raises
    ------
    SceneError : arguments of another kind or outside their range.
    """
    far, near = (as_operand(f"ball_fold: {n}", r, "a radius > 0") for n, r in (("outer", outer), ("inner", inner)))
    at, grown = as_operand("ball_fold: z", z, "a vec3"), as_operand("ball_fold: growth", growth, "a number")
    turn = max(far * far / max(dot(at, at), near * near), 1.0)
    return turn * at, turn * grown


def _steps(fold: Fold, p: Expr, bailout: Scalar, iterations: int) -> tuple[Expr, Expr]:
    def step(i: Expr, z: Expr, growth: Expr) -> tuple[Any, Any]:
        made = called("fold_fractal: fold", fold, z, growth, p, legal="a function from (z, growth, p) to (z, growth)")
        if not isinstance(made, tuple | list) or len(made) != 2:
            raise SceneError(f"fold_fractal: fold gives {short(made)}", legal="(z, growth): a vec3 and a number")
        kinds = [expr(part).type for part in made]
        if kinds[0] is not VEC3 or kinds[1] is not FLOAT:
            raise SceneError(f"fold_fractal: fold gives a {kinds[0]} and a {kinds[1]}", legal="a vec3 and a float")
        return made[0], made[1]

    z, growth = loop(iterations, (p, 1.0), step, until=lambda i, z, growth: dot(z, z) > bailout * bailout)
    return z, max(growth, TINY)


def _to_box(value: Expr, p: Expr, bounds: Corners) -> Expr:
    """The larger of the field and the distance to the stated box of the fractal."""
    if not np.all(np.isfinite(bounds)):
        return value
    lower, upper = const(bounds[0]), const(bounds[1])
    return at_least(value, from_faces(absolute(p - 0.5 * (lower + upper)) - 0.5 * (upper - lower)))


def _kaleidoscope(z: Expr, growth: Expr, p: Expr) -> tuple[Any, Any]:
    """The specimen: mirrors of a tetrahedron, with a slight turn in between."""
    for normal in ((1.0, 1.0, 0.0), (1.0, 0.0, 1.0), (0.0, 1.0, 1.0)):
        z = plane_fold(z, normal)
    turned = rotation2(z.xz, 0.2)
    z = vec3(turned.x, z.y, turned.y)
    return 2.0 * z - 1.0, 2.0 * growth


FoldOf = Annotated[Any, Domain(None, holds=Callable)]
BoundsOf = Annotated[Any, Domain(None, holds=tuple)]
CUBE: Corners = ((-1.5,) * 3, (1.5,) * 3)


def _bounds(bounds: Corners, **_: Any) -> tuple[Expr, Expr]:
    return const(bounds[0]), const(bounds[1])


@shape(exactness="estimate", bounds=_bounds, called="fold_fractal")
def folded_orbit(
    p: Expr, fold: FoldOf = _kaleidoscope, bounds: BoundsOf = CUBE, bailout: Factor = 100.0, iterations: Count = 8
) -> Expr:
    """A user-defined fractal: the points whose orbit stays near the origin."""
    z, growth = _steps(fold, p, bailout, iterations)
    return _to_box(length(z) / growth, p, bounds)


@operator(exactness="estimate", bounds=lambda child, **given: _bounds(**given), called="fold_fractal")
def folded_solid(
    p: Expr,
    child: Child,
    fold: FoldOf = _kaleidoscope,
    bounds: BoundsOf = CUBE,
    bailout: Factor = 100.0,
    iterations: Count = 3,
) -> Expr:
    """A user-defined fractal, made of copies of a solid."""
    z, growth = _steps(fold, p, bailout, iterations)
    return _to_box(child(z) / growth, p, bounds)


@checked
def fold_fractal(
    fold: Fold,
    solid: Node | None = None,
    bounds: float | Sequence[Sequence[float]] | NDArray[Any] = 2.0,
    iterations: int = 8,
    bailout: float = 100.0,
) -> Node:
    """A user-defined fractal: space is folded repeatedly, then the distance of a solid is evaluated there.

    Parameters
    ----------
    fold : function from (z, growth, p) to the next (z, growth): z, a vec3, starts at the point p; growth, a number,
        starts at 1 and is multiplied by the factor by which the fold scales lengths. Use functions of
        `raymarch.expr.vocabulary`, `plane_fold`, `box_fold` and `ball_fold`. The function is traced once; it may use
        parameters and time.
    solid : the solid whose distance at the last z, divided by the growth, is the field. None for |z| divided by the
        growth, as for the Mandelbox.
    bounds : half the edge of a cube about the origin around the fractal, or two corners of a box, infinite where it is
        unbounded. Not checked.
    iterations : maximum number of folds, >= 1.
    bailout : the iteration ends where |z| exceeds this, > 0.

    Returns
    -------
    Node

    Raises
    ------
    SceneError : arguments of another kind or outside their range.

    Notes
    -----
    An estimate: nothing is proven of it, so it is marched with "plain". If each fold scales all lengths by at most its
    factor of the growth, the field is a bound. If not, `Quality(step_scale=...)` helps.
    """
    if not callable(fold):
        raise SceneError(f"fold_fractal: fold = {short(fold)}", legal="a function of (z, growth, p)")
    corners = _corners(bounds)
    if solid is None:
        return folded_orbit(fold, corners, bailout, iterations)
    return folded_solid(solid, fold, corners, bailout, iterations)


def _corners(bounds: Any) -> Corners:
    legal = "a number > 0, or two corners of three numbers, lower < upper"
    half = numbers("fold_fractal: bounds", bounds, legal)
    given = np.outer((-half, half), np.ones(3)) if half.ndim == 0 and half > 0.0 else bounds
    lower, upper = corners_of("fold_fractal: bounds", given, legal).tolist()
    return tuple(lower), tuple(upper)
