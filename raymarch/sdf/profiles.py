"""From 2D to 3D and back: extrusion along z, revolution about y, slices."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Annotated, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from raymarch.errors import SceneError
from raymarch.expr.convert import choice, short
from raymarch.expr.degrees import suspect_degrees
from raymarch.expr.intervals import interval_of
from raymarch.expr.node import Expr, expr
from raymarch.expr.types import FLOAT
from raymarch.expr.vocabulary import abs, clamp, cos, length, max, min, sin, sqrt, square, vec2, vec3, where
from raymarch.sdf.booleans import balanced, hull, intersection, union
from raymarch.sdf.definition import Child, ChildFacts, around_y, combination, definition_of, operator
from raymarch.sdf.deform import taper
from raymarch.sdf.deform import twist as twist_solid
from raymarch.sdf.domain import Angle, Domain, Length, Positive, Scalar, Word, domain_of
from raymarch.sdf.facts import Exactness, Facts
from raymarch.sdf.flat import across, circle, flat_triangle, leftward, polygon, rectangle, regular_polygon
from raymarch.sdf.joints import largest_difference
from raymarch.sdf.node import Node, has_constants, method
from raymarch.sdf.placing import rotate
from raymarch.sdf.placing import scale as enlarge
from raymarch.sdf.rounds import cone
from raymarch.sdf.solids import box, from_faces, plane

# Extrusion


def _prism(profile: Expr, z: Expr, height: Scalar) -> Expr:
    """The intersection of a profile in the xy plane and the slab |z| <= height / 2."""
    return from_faces(vec2(profile, abs(z) - 0.5 * height))


def _prism_bounds(lower: Expr, upper: Expr, height: Expr) -> tuple[Expr, Expr]:
    return vec3(lower, -0.5 * height), vec3(upper, 0.5 * height)


@operator(
    exactness="exact",
    bounds=lambda child, height: _prism_bounds(child.lower, child.upper, height),
    lipschitz=1.0,
    symmetry=lambda child: child.symmetry + "z",
    spread="keep",
    convex=True,
    child_dimension=2,
    called="extrude",
)
def straight_extrusion(p: Expr, child: Child, height: Positive = 1.0) -> Expr:
    """Extrude a flat shape along z, half of the height on either side of the xy plane.

    height : full extent along z, > 0.

    Exact for an exact shape: the distances to the profile and to the caps are at right angles (Pythagoras). Inside, the
    smaller of the two counts.
    """
    return _prism(child(p.xy), p.z, height)


STEEPEST_DRAFT = 1.4
Draft = Annotated[Any, Domain(FLOAT, low=-STEEPEST_DRAFT, high=STEEPEST_DRAFT, unit="radians")]


def _drafted_bounds(child: ChildFacts, height: Any, draft: Any) -> tuple[Expr, Expr]:
    return _prism_bounds(*child.grown(max(-sin(draft) / cos(draft), 0.0) * height), height)


@operator(
    bounds=_drafted_bounds,
    lipschitz=1.0,
    symmetry=lambda child: child.symmetry,
    spread=lambda child, height, draft: math.sqrt(2.0) * child.spread / cos(draft),
    convex=lambda child: child.convex and child.exactness == "exact",
    child_dimension=2,
    called="extrude",
)
def drafted_extrusion(p: Expr, child: Child, height: Positive = 1.0, draft: Draft = 0.1) -> Expr:
    """Extrude a flat shape along z with sides that lean.

    height : full extent along z, > 0. draft : angle of the sides to the z axis, in radians; above 0 the upper end is
        smaller.

    A bound for an exact shape: the section at a height is the shape moved inwards by the way along the leaning side,
    and the distance to a leaning plane is the cosine of the angle times that across.
    """
    lean = max(sin(draft) * (p.z + 0.5 * height), min(sin(draft) * height, 0.0))  # none beyond the ends
    section = cos(draft) * child(p.xy) + lean
    return max(section, abs(p.z) - 0.5 * height)


@method
def extrude(node: Node, height: Scalar = 1.0, scale: Scalar = 1.0, twist: Scalar = 0.0, draft: Scalar = 0.0) -> Node:
    """Extrude a flat shape along z, half of the height on either side of the xy plane.

    Parameters
    ----------
    height : full extent along z, > 0.
    scale : factor of the upper end, >= 0.01; the section grows evenly from the lower end, which is the shape itself.
        0 is a tip, of a circle or a convex polygon of numbers that is not twisted.
    twist : angle in radians by which the upper end is turned from x towards y, evenly from the lower end.
    draft : angle in radians, -1.4 to 1.4, by which the sides lean inwards from the lower end upwards, as the taper of
        CAD programs. Above 0 corners stay sharp; below 0 convex corners of the shape become round cones. Not beside
        `scale` or `twist`.

    Returns
    -------
    Node

    Raises
    ------
    SceneError : arguments of another kind or outside their range.

    Notes
    -----
    Exact for an exact shape without scale, twist and draft. With them a bound: see `taper` and `twist`; but a circle
    and a convex polygon of numbers that only grow are a cone and planes. Draft moves the outline of an exact shape by
    height * tan(draft) at the upper end; sides that meet below it end there in a ridge.
    """
    made = straight_extrusion(node, height)
    lean = domain_of(Draft, None).accept("extrude", "draft", draft)
    angle = domain_of(Angle, None).accept("extrude", "twist", twist)
    suspect_degrees("extrude: twist", twist)
    turns = not (angle.is_constant and angle.data == 0.0)
    factor = Domain(FLOAT, low=0.0).accept("extrude", "scale", scale)
    pointed = None if turns else _pointed(node, height, factor)
    if pointed is None:
        factor = Domain(FLOAT, low=0.01).accept("extrude", "scale", scale)
    grows = not (factor.is_constant and factor.data == 1.0)
    if not (lean.is_constant and lean.data == 0.0):
        if grows or turns:
            raise SceneError("extrude: draft beside scale or twist", legal="one of them; scale=, for sides that meet")
        return drafted_extrusion(node, height, lean)
    if not (grows or turns):
        return made
    if pointed is not None:
        return pointed
    middle = 0.5 * (1.0 + factor)
    profile = rotate(node, 0.5 * angle) if turns else node
    profile = enlarge(profile, middle) if grows else profile
    upright = rotate(straight_extrusion(profile, height), -0.5 * math.pi, "x")
    if turns:
        upright = twist_solid(upright, angle / height)
    if grows:
        upright = taper(upright, (factor - 1.0) / (height * middle))
    return rotate(upright, 0.5 * math.pi, "x")


def _pointed(node: Node, height: Scalar, scale: Expr) -> Node | None:
    """A circle or a convex polygon whose upper end is scaled, if all are numbers: a cone, or planes; else None."""
    given = expr(height)
    if not (given.is_constant and scale.is_constant) or scale.data == 1.0:
        return None
    tall, end = float(given.data), float(scale.data)
    if node.definition is definition_of(circle) and has_constants(node):
        radius = float(expr(node.params["radius"]).data)
        return rotate(cone(radius, tall, end * radius), 0.5 * math.pi, "x")
    corners = _convex_corners(node)
    return None if corners is None else _frustum(corners, end * corners, tall)


Easing: TypeAlias = Callable[[Expr], Expr]

EASINGS: Mapping[str, tuple[Easing, float]] = {
    "linear": (lambda t: t, 1.0),
    "smooth": (lambda t: t * t * (3.0 - 2.0 * t), 1.5),
    "smoother": (lambda t: t * t * t * (t * (6.0 * t - 15.0) + 10.0), 1.875),
    "sine": (lambda t: 0.5 - 0.5 * cos(math.pi * t), 0.5 * math.pi),
    "in_sine": (lambda t: 1.0 - cos(0.5 * math.pi * t), 0.5 * math.pi),
    "out_sine": (lambda t: sin(0.5 * math.pi * t), 0.5 * math.pi),
    "in_quad": (lambda t: t * t, 2.0),
    "out_quad": (lambda t: t * (2.0 - t), 2.0),
    "in_out_quad": (lambda t: where(t < 0.5, 2.0 * t * t, 1.0 - 2.0 * square(1.0 - t)), 2.0),
    "in_cubic": (lambda t: t * t * t, 3.0),
    "out_cubic": (lambda t: 1.0 - square(1.0 - t) * (1.0 - t), 3.0),
    "in_out_cubic": (lambda t: where(t < 0.5, 4.0 * t * t * t, 1.0 - 4.0 * square(1.0 - t) * (1.0 - t)), 3.0),
    "in_quart": (lambda t: square(square(t)), 4.0),
    "out_quart": (lambda t: 1.0 - square(square(1.0 - t)), 4.0),
    "in_out_quart": (lambda t: where(t < 0.5, 8.0 * square(square(t)), 1.0 - 8.0 * square(square(1.0 - t))), 4.0),
    "in_quint": (lambda t: square(square(t)) * t, 5.0),
    "out_quint": (lambda t: 1.0 - square(square(1.0 - t)) * (1.0 - t), 5.0),
    "in_out_quint": (
        lambda t: where(t < 0.5, 16.0 * square(square(t)) * t, 1.0 - 16.0 * square(square(1.0 - t)) * (1.0 - t)),
        5.0,
    ),
}
"""Easing curves of a fraction t from 0 to 1, each with its steepest slope."""


def _loft_slope(sections: int, height: Any, gap: Any, easing: str) -> Expr:
    """Lipschitz constant: 1 across; along z, the gap times the slope of the easing curve over one section."""
    return sqrt(1.0 + square(EASINGS[easing][1] * sections * gap / height))


@combination(
    bounds=lambda children, height: _prism_bounds(*hull(children), height),
    lipschitz=1.0,
    spread=lambda children, height, gap, easing: (
        balanced([c.spread for c in children], max) * _loft_slope(len(children) - 1, height, gap, easing)
    ),
    child_dimension=2,
    called="extrude_to",
)
def loft(
    p: Expr, children: Sequence[Child], height: Positive = 1.0, gap: Positive = 1.0, easing: Word = "smooth"
) -> Expr:
    """Flat shapes at equal steps along z, each blended into the next.

    gap : differences of two profiles are clamped to this, so that the slope does not grow with distance.
    """
    ease, sections = EASINGS[easing][0], len(children) - 1
    along = (p.z / height + 0.5) * float(sections)
    profile, *others = [child(p.xy) for child in children]
    for i, other in enumerate(others):
        profile = profile + ease(clamp(along - float(i), 0.0, 1.0)) * clamp(other - profile, -gap, gap)
    return _prism(profile / _loft_slope(sections, height, gap, easing), p.z, height)


@method
def extrude_to(node: Node, other: Node, height: Scalar = 1.0, easing: str = "smooth") -> Node:
    """Extrude a flat shape along z while it changes into another one.

    Parameters
    ----------
    node, other : bounded flat shapes: the profile at z = -height / 2 and that at z = height / 2.
    height : full extent along z, > 0.
    easing : name of the easing curve of the transition: "linear", "smooth", "smoother", "sine"; or "in_", "out_" or
        "in_out_" before "quad", "cubic", "quart" or "quint", such as "in_quad"; "in_sine", "out_sine". With "linear",
        two convex polygons of numbers (`rectangle`, `polygon`, `regular_polygon`, `flat_triangle`) give the frustum
        between them: their convex hull, which has plane sides.

    Returns
    -------
    Node

    Raises
    ------
    SceneError : a solid, a shape without bounds, an unknown easing, or a height that is not above 0.

    Notes
    -----
    A bound: between the ends the two distances are mixed and divided by the slope of the mix. Along z it is at most
    their largest difference times the easing's slope over the height. That difference is found on a grid, whose
    spacing is added.
    """
    easing = choice("extrude_to: easing", easing, tuple(EASINGS))
    for each in (node, other):
        if not isinstance(each, Node) or each.dimension != 2:
            raise SceneError(f"extrude_to of {short(each)}", legal="two flat shapes, such as circle() and rectangle()")
        if not each.facts.bounded:
            raise SceneError(f"extrude_to: {each.name} is unbounded", legal="flat shapes that are bounded")
    ends = [_convex_corners(each) for each in (node, other)]
    tall = expr(height)
    known = tall.is_constant and tall.type is FLOAT and 0.0 < float(tall.data) < np.inf
    if known and easing == "linear" and ends[0] is not None and ends[1] is not None:
        return _frustum(ends[0], ends[1], float(tall.data))
    return loft([node, other], height, largest_difference(node, other), easing)


MOST_CORNERS = 64
"""Maximum number of corners of a polygon whose frustum has a plane for each."""


def _convex_corners(node: Node) -> NDArray[np.float64] | None:
    """The corners of a convex polygon with constant numbers, counter-clockwise; None for any other shape."""
    if not (node.facts.convex and has_constants(node)):
        return None
    p = {name: np.array(v.data if isinstance(v, Expr) else v, np.float64) for name, v in node.params.items()}
    if node.definition is definition_of(rectangle):
        corners = 0.5 * p["size"] * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    elif node.definition is definition_of(polygon):
        corners = p["points"]
    elif node.definition is definition_of(flat_triangle):
        corners = np.array([p["a"], p["b"], p["c"]])
    elif node.definition is definition_of(regular_polygon):
        turn = math.tau * np.arange(int(p["sides"])) / p["sides"]
        corners = p["radius"] * np.stack([np.sin(turn), np.cos(turn)], axis=1)
    else:
        return None
    area = np.sum(across(corners, np.roll(corners, -1, axis=0)))
    return None if len(corners) > MOST_CORNERS else corners if area > 0.0 else corners[::-1]


def _frustum(bottom: NDArray[np.float64], top: NDArray[np.float64], height: float) -> Node:
    """The convex hull of two convex polygons, at z = -height / 2 and height / 2.

    With the support functions a and b of the two, the section at the share t of the height has (1 - t) a + t b. Its
    edges have the normals of the edges of both, and each is in one plane.
    """
    edges = np.concatenate([np.roll(each, -1, axis=0) - each for each in (bottom, top)])
    edges = edges[np.linalg.norm(edges, axis=1) > 0.0]
    normals = -leftward(edges) / np.linalg.norm(edges, axis=1, keepdims=True)
    normals = normals[np.unique(np.round(normals, 12), axis=0, return_index=True)[1]]
    below, above = (np.max(each @ normals.T, axis=0) for each in (bottom, top))
    both = np.concatenate([bottom, top])
    low, high = both.min(axis=0), both.max(axis=0)
    sides = [
        plane((*n.tolist(), (a - b) / height), 0.5 * (a + b) / math.hypot(1.0, (a - b) / height))
        for n, a, b in zip(normals, below.tolist(), above.tolist(), strict=True)
    ]
    middle = (*(0.5 * (low + high)).tolist(), 0.0)
    return intersection(box((*(high - low).tolist(), height)).translate(middle), *sides)


# Revolution


def _mirrored(child: Facts, offset: Expr) -> bool:
    """True if the profile is symmetric, so that one half contains the nearest point."""
    low, high = interval_of(offset)
    return "x" in child.symmetry and bool(low == 0.0 == high)


def _exact_if_clear(child: Facts, offset: Expr) -> Exactness:
    """A bound if the profile touches the axis: parts beyond it are cut off, and an edge on it is then inside."""
    clear = child.lower[0] + interval_of(offset)[0] > 0.0
    return "exact" if clear or _mirrored(child, offset) else "bound"


@operator(
    exactness=_exact_if_clear,
    bounds=lambda child, offset: around_y(child.upper.x + offset, child.lower.y, child.upper.y),
    lipschitz=1.0,
    symmetry=lambda child: "xyz" if "y" in child.symmetry else "xz",
    spread="keep",
    convex=lambda child, offset: child.convex and _mirrored(child, offset),
    child_dimension=2,
    called="revolve",
)
def whole_revolution(p: Expr, child: Child, offset: Length = 0.0) -> Expr:
    """Revolve a flat shape about the y axis.

    offset : distance by which the shape is first moved along +x, away from the axis. The part at x < 0 is cut off.

    Exact for an exact shape that does not touch the axis, or that is symmetric about it (offset 0): the nearest point
    then lies in the half plane of the point. Else a bound.
    """
    return child(vec2(length(p.xz) - offset, p.y))


@method
def revolve(node: Node, offset: Scalar = 0.0, angle: Scalar = math.tau) -> Node:
    """Revolve a flat shape about the y axis.

    Parameters
    ----------
    offset : distance by which the shape is first moved along +x, away from the axis. The part at x < 0 is cut off.
    angle : of the whole turn in radians, half of it on either side of the +x axis, above 0 and up to 2 pi.

    Returns
    -------
    Node

    Raises
    ------
    SceneError : arguments of another kind or outside their range.

    Notes
    -----
    A whole turn is exact for an exact shape that does not touch the axis, or that is symmetric about it (offset 0).
    Else a bound.
    """
    made = whole_revolution(node, offset)
    turn = Domain(FLOAT, low=0.0, high=math.tau, open=True, unit="radians").accept("revolve", "angle", angle)
    low, high = interval_of(turn)
    if low >= math.tau * (1.0 - 1e-6):
        return made
    sides = [rotate(plane((0.0, 0.0, 1.0)), -0.5 * turn, "y"), rotate(plane((0.0, 0.0, -1.0)), 0.5 * turn, "y")]
    if high <= math.pi:
        return intersection(made, *sides)
    if low < math.pi:
        what = f"revolve: angle from {low:.4g} to {high:.4g}"
        raise SceneError(what, legal="a range up to pi, or from pi on")
    return intersection(made, union(*sides))


# From 3D to 2D


def _missed(child: ChildFacts, z: Any) -> Expr:
    return (z < child.lower.z) | (z > child.upper.z)


def _slice_bounds(child: ChildFacts, z: Any) -> tuple[Expr, Expr]:
    """The solid's box from above; inverted if the plane misses the box."""
    low, high, missed = child.lower.xy, child.upper.xy, _missed(child, z)
    return where(missed, high, low), where(missed, low, high)


@method
@operator(
    bounds=_slice_bounds,
    symmetry=lambda child: child.symmetry.replace("z", ""),
    spread=lambda child, z: where(_missed(child, z), np.inf, child.spread),
    convex=True,
    dimension=2,
    child_dimension=3,
)
def slice(p: Expr, child: Child, z: Length = 0.0) -> Expr:
    """The section of a solid in a plane parallel to the xy plane, a flat shape.

    z : position of the plane.

    A bound: the nearest surface in space may lie beside the plane.
    """
    return child(vec3(p, z))
