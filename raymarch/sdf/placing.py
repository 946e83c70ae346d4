"""Transforms: rigid motions, scaling, affine maps and mirrors; and the material label."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, cast

import numpy as np

from raymarch.errors import SceneError
from raymarch.expr.convert import described, short
from raymarch.expr.degrees import suspect_degrees
from raymarch.expr.node import Expr, const, expr
from raymarch.expr.types import FLOAT
from raymarch.expr.vocabulary import (
    abs,
    clamp,
    columns,
    cos,
    cross,
    dot,
    length,
    max,
    min,
    sin,
    transpose,
    vec2,
    vec3,
    where,
)
from raymarch.sdf.definition import Child, ChildFacts, definition_of, operator
from raymarch.sdf.domain import Angle, Direction, Positive, Scalar, Size3, Vec3, Vector, as_operand
from raymarch.sdf.facts import Exactness, Facts
from raymarch.sdf.node import Node, method, solid
from raymarch.sdf.regions import Motion
from raymarch.sdf.solids import box

AXES: Mapping[str, tuple[float, float, float]] = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


def axis_vector(name: str, axis: Vector | str, dimension: int = 3) -> Vector:
    """The direction that "x", "y", "z" or a vector stands for."""
    if not isinstance(axis, str):
        return axis
    known = [*AXES][:dimension]
    if axis not in known:
        legal = f"{', '.join(map(repr, known))} or {dimension} numbers, not all zero"
        raise SceneError(f"{name}: axis = {short(axis)}", legal=legal)
    return AXES[axis][:dimension]


def unmoved(symmetry: str, offset: Expr) -> str:
    """The axes of a symmetry along which an offset is 0."""
    if offset.is_constant:  # of many objects; taking an expression apart takes longer than all else
        still = [not o for o in offset.data.tolist()]
    else:
        still = [o.is_constant and not o.data for o in offset]
    return "".join(axis for axis, zero in zip("xyz", still, strict=False) if zero and axis in symmetry)


def _axes(dimension: int) -> list[Expr]:
    return [const(row) for row in np.eye(dimension)]


def spread_through(matrix: Expr) -> Expr:
    """The factor by which a matrix enlarges the extent of a cube about the origin, along an axis."""
    first, *others = [abs(matrix @ axis) for axis in _axes(matrix.type.size)]
    for reach in others:
        first = first + reach
    return max(*first)


@method
@operator(
    symmetry=lambda child, offset: unmoved(child.symmetry, offset),
    motion=lambda child, offset: Motion(offset=offset, turns=False),
    dimension="any",
    placing="rigid",
)
def translate(p: Expr, child: Child, offset: Vec3) -> Expr:
    """Translate.

    offset : vec3 (vec2 for a flat shape), length.
    """
    return child(p - offset)


def rotation_matrix(axis: Expr, angle: Scalar) -> Expr:
    """Rotation about a unit axis, counter-clockwise seen from its tip (Rodrigues 1840), for column vectors.

    About an axis of the coordinates it is exactly the matrix of the plane across.
    """
    c, s = cos(angle), sin(angle)
    x, y, z = axis
    turn = 1.0 - c
    return columns(
        vec3(x * x + c * (1.0 - x * x), turn * x * y + s * z, turn * x * z - s * y),
        vec3(turn * x * y - s * z, y * y + c * (1.0 - y * y), turn * y * z + s * x),
        vec3(turn * x * z + s * y, turn * y * z - s * x, z * z + c * (1.0 - z * z)),
    )


@operator(
    motion=lambda child, axis, angle: Motion(rotation_matrix(axis, angle), axis=axis, angle=angle),
    called="rotate",
    placing="rigid",
)
def rotate_about(p: Expr, child: Child, axis: Direction, angle: Angle) -> Expr:
    """Rotate about an axis through the origin."""
    return child(transpose(rotation_matrix(axis, angle)) @ p)


def _turning(angle: Expr) -> Expr:
    c, s = cos(angle), sin(angle)
    return columns(vec2(c, s), vec2(-s, c))


@operator(
    motion=lambda child, angle: Motion(_turning(angle), axis=const((0.0, 0.0, 1.0)), angle=angle),
    dimension=2,
    called="rotate",
    placing="rigid",
)
def turn(p: Expr, child: Child, angle: Angle) -> Expr:
    """A flat shape turned about the origin, counter-clockwise."""
    c, s = cos(angle), sin(angle)
    return child(vec2(c * p.x + s * p.y, c * p.y - s * p.x))


def _check_angle(what: str, angle: Any) -> None:
    """SceneError for what looks like an axis; a SceneWarning for a number that is likely an angle in degrees."""
    if isinstance(angle, str | tuple | list):
        legal = f'an angle in radians, then an axis: {what}(0.5, "y")'
        raise SceneError(f"{what}: angle = {short(angle)}", legal=legal)
    suspect_degrees(f"{what}: angle", angle)


@method
def rotate(node: Node, angle: Scalar, axis: Vector | str | None = None) -> Node:
    """Rotate about an axis through the origin, counter-clockwise as seen from the tip of the axis.

    Parameters
    ----------
    angle : angle in radians.
    axis : "x", "y", "z" or a direction of any length but 0; None is "y". A flat shape rotates in its plane,
        counter-clockwise, and takes no axis.

    Returns
    -------
    Node

    Raises
    ------
    SceneError : arguments of another kind or outside their range.
    """
    _check_angle("rotate", angle)
    if isinstance(node, Node) and node.dimension == 2:
        if axis is not None and not (isinstance(axis, str) and axis in ("y", "z")):
            raise SceneError(f"rotate: axis = {short(axis)} for a flat shape", legal="the angle alone")
        return turn(node, angle)
    return rotate_about(node, axis_vector("rotate", "y" if axis is None else axis), angle)


def turn_between(start: Expr, end: Expr) -> Expr:
    """The smallest rotation that takes one unit vector to another, for column vectors.

    Rodrigues' formula with sin and cos of the angle as the cross and dot products: R = c I + [v] + v v' / (1 + c).
    If the two are opposite, half a turn about a perpendicular axis.
    """
    v, c = cross(start, end), dot(start, end)
    opposite = c < -1.0 + 1e-6  # beyond this, 1 + c has only one or two significant bits in float32
    factor = 1.0 / where(opposite, 1.0, 1.0 + c)
    x, y, z = v
    turn = columns(vec3(c, z, -y) + factor * x * v, vec3(-z, c, x) + factor * y * v, vec3(y, -x, c) + factor * z * v)
    across = where(abs(start.x) < 0.7, vec3(0.0, start.z, -start.y), vec3(start.y, -start.x, 0.0))
    a = across / length(across)
    half = columns(2.0 * a.x * a - vec3(1, 0, 0), 2.0 * a.y * a - vec3(0, 1, 0), 2.0 * a.z * a - vec3(0, 0, 1))
    return where(opposite, half, turn)


@operator(
    motion=lambda child, axis, direction: Motion(turn_between(axis, direction)),
    called="orient",
    placing="rigid",
)
def oriented(p: Expr, child: Child, axis: Direction = (0.0, 1.0, 0.0), direction: Direction = (1.0, 1.0, 1.0)) -> Expr:
    """Rotate so that an axis points along a direction."""
    return child(transpose(turn_between(axis, direction)) @ p)


@method
def orient(node: Node, direction: Vector = (1.0, 1.0, 1.0), axis: Vector | str = "y") -> Node:
    """Rotate by the smallest angle that makes an axis of the solid point along a direction.

    Parameters
    ----------
    direction : vec3 of any length but 0.
    axis : axis of the solid: "x", "y", "z" or a direction.

    Returns
    -------
    Node

    Raises
    ------
    SceneError : arguments of another kind or outside their range.
    """
    return oriented(solid("orient", node), axis_vector("orient", axis), direction)


@operator(
    symmetry="keep",
    motion=lambda child, factor: Motion(factor, turns=False),
    dimension="any",
    called="scale",
    placing="scale",
)
def scale_evenly(p: Expr, child: Child, factor: Positive) -> Expr:
    """Scale by one factor. Distances are scaled by it too, so they stay exact."""
    return factor * child(p / factor)


@operator(
    bounds=lambda child, factors: child.box * factors,
    symmetry="keep",
    spread=lambda child, factors: child.spread * max(*factors) / min(*factors),
    dimension="any",
    called="scale",
    placing="stretch",
)
def scale_axes(p: Expr, child: Child, factors: Size3) -> Expr:
    """Scale along each axis by its own factor. The smallest factor scales distances, which gives a bound."""
    *others, smallest = factors
    for factor in reversed(others):
        smallest = min(factor, smallest)
    return smallest * child(p / factors)


@method
def scale(node: Node, factor: Scalar | Vector) -> Node:
    """Scale about the origin.

    Parameters
    ----------
    factor : one number > 0, which keeps exactness, or one for each axis, which gives a bound. A box stays a box, and
        factors of factors are one node: its bound is closer than that of two.

    Returns
    -------
    Node

    Raises
    ------
    SceneError : arguments of another kind or outside their range.
    """
    value = as_operand("scale: factor", factor, "a number > 0, or one for each axis")
    if value.type is FLOAT:
        return scale_evenly(node, cast(Scalar, factor))
    if value.is_constant and value.type.is_vector and np.all(value.data == value.data[0]):
        return scale_evenly(node, float(value.data[0]))
    if node.definition is definition_of(scale_axes) and value.is_constant and node.params["factors"].is_constant:
        return scale(node.children[0], tuple(value.data * node.params["factors"].data))
    scaled = scale_axes(node, factor)
    if node.definition is definition_of(box):
        return box(node.params["size"] * scaled.params["factors"])
    return scaled


def _exact_if_one_sided(child: Facts, normal: Expr) -> Exactness:
    """Exactness: a part beyond the mirror plane is cut off, and distances to it are too small. A part that touches the
    plane merges with its image, and its surface there is then inside."""
    if not normal.is_constant:
        return "bound"
    n = np.asarray(normal.data)
    with np.errstate(invalid="ignore"):
        nearest = np.where(n == 0, 0.0, np.where(n > 0, n * child.lower, n * child.upper)).sum()
    return "exact" if nearest > 0 else "bound"


def _reflection(normal: Expr) -> Expr:
    """The matrix of the reflection in the plane through the origin."""
    return columns(*[axis - 2.0 * n * normal for axis, n in zip(_axes(len(normal)), normal, strict=True)])


def _mirrored_bounds(child: ChildFacts, normal: Expr) -> tuple[Expr, Expr]:
    """The box and its reflection."""
    image = _reflection(normal) @ child.box
    return min(child.lower, image), max(child.upper, image)


def _mirrored_radii(child: ChildFacts, normal: Expr) -> list[tuple[Expr, Expr]]:
    reach = length(child.centre)
    ball = expr((child.radii.w,) * 4)
    return [*child.within(), (clamp(_reflection(normal) @ child.centre, -reach, reach), ball)]


def _mirrored_symmetry(child: Facts, normal: Expr) -> str:
    n = len(normal)
    along = [a for a, v in AXES.items() if normal.is_constant and np.array_equal(np.abs(normal.data), v[:n])]
    return "".join(sorted({*child.symmetry, *along})) if along else ""


@operator(
    exactness=_exact_if_one_sided,
    bounds=_mirrored_bounds,
    symmetry=_mirrored_symmetry,
    spread=lambda child, normal: child.spread * spread_through(_reflection(normal)),
    radii=_mirrored_radii,
    dimension="any",
    called="mirror",
    placing="select",
)
def mirror_across(p: Expr, child: Child, normal: Direction) -> Expr:
    """Evaluates the child at the reflection of points behind the plane through the origin."""
    return child(p - 2.0 * min(dot(p, normal), 0.0) * normal)


@method
def mirror(node: Node, axis: Vector | str) -> Node:
    """The half on the side that the axis points to, and its reflection in the plane through the origin.

    Parameters
    ----------
    axis : "x", "y", "z" or a normal of any length but 0; in the plane "x", "y" or a vec2.

    Returns
    -------
    Node

    Raises
    ------
    SceneError : arguments of another kind or outside their range.
    """
    return mirror_across(node, axis_vector("mirror", axis, node.dimension if isinstance(node, Node) else 3))


@operator(
    symmetry="keep",
    motion=lambda child: Motion(turns=False),
    dimension="any",
    called="material",
    placing="rigid",
)
def labelled(p: Expr, child: Child) -> Expr:
    """The same field with a label, which determines the material."""
    return child(p)


@method
def material(node: Node, material: Any) -> Node:
    """Assign a material. Parts that have their own material keep it.

    Parameters
    ----------
    material : a `Material`.

    Returns
    -------
    Node
        A node with the same field.

    Raises
    ------
    SceneError : what is no Material.

    Examples
    --------
    >>> rm.sphere(1).material(rm.Material(color="gold")).distance((2, 0, 0))
    array(1.)
    """
    refuse_label("material", material)
    return with_label(node, material)


_NO_LABEL = (str, int, float, tuple, list, dict, set, frozenset, np.ndarray, np.generic, Node, Expr)


def refuse_label(what: str, label: Any) -> None:
    """SceneError for a value that is no material."""
    elsewhere = getattr(type(label), "BELONGS", "") not in ("", "node.material(...)")
    if label is None or isinstance(label, _NO_LABEL) or elsewhere:
        given = "a node (Node)" if isinstance(label, Node) else described(label)
        raise SceneError(f"{what} = {given}", legal="rm.Material(color=...)")


def with_label(node: Node, label: Any) -> Node:
    """The node with a label of any kind, which determines its material."""
    made = labelled(node)
    known = None if node.known_facts is None else replace(node.known_facts, divisor=1.0)
    return Node(made.definition, made.children, made.params, known, label)
