"""What a camera without a position frames: points on the outside of the solid, which samples of the field find.

The box of a solid is larger than what is seen of it: it has corners, it holds a solid that turns in all positions, and
an unbounded solid has none. A few thousand samples of the field, moved onto its surface, tell more in milliseconds.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import product
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from raymarch.expr.arrays import bound, evaluator_of
from raymarch.expr.raw import without_twin
from raymarch.expr.walk import find
from raymarch.sdf.evaluation import field_of
from raymarch.sdf.facts import around
from raymarch.sdf.levels import may_touch
from raymarch.sdf.node import Node, all_nodes

Points: TypeAlias = NDArray[np.float64]
Field: TypeAlias = Callable[[Points], NDArray[np.float64]]

VIEW = np.array([0.5, 0.45, 1.0])
"""The direction from the target to a camera without a `position`."""

CUBE = np.array(list(product((-1.0, 1.0), repeat=3)))
"""The corners of the cube that is framed if nothing else is known."""

EDGE = 12
"""Samples along each edge of a box."""

FACE = 200
"""Samples of a face of a cube that cuts a solid without end."""

LARGE = 200
"""Nodes of a solid above which its boxes are framed: samples of its field would take longer than a few milliseconds."""

WIDE = 6.0
"""A solid that moves or grows with its Params over more than this many of its own diagonals is framed at their
defaults alone: elsewhere it would be a speck."""

USUAL = 4.665
"""Distance from the origin at which a camera that frames `CUBE` stands, in pictures that are wider than high."""

TIMES = (0.0, 0.4, 0.9, 1.5, 2.2, 3.0, 3.9, 4.9)
"""Seconds at which a solid that reads time is sampled. Their steps differ, so few motions repeat with them."""

WINDOWS = (2.0, 8.0, 32.0)
"""Half the edges of the cubes in which a solid without a finite box is sought."""

SURROUNDS = 4.0
"""A medium whose diagonal is longer than this many diagonals of the solids is not framed."""

HORIZON = 30.0
"""Distance beyond which a ray that looks for a place of the camera counts as a miss."""


@dataclass(frozen=True, slots=True, eq=False)
class Framed:
    """What a camera without a position frames.

    Attributes
    ----------
    points : shape (N, 3): points whose convex hull holds what is seen, up to a few percent of its size.
    position : of a solid without end, where the camera stands; None for a distance that shows all points.
    centre : of the box of what is seen, if it has one.
    floor : height of the lowest point; None for a solid without end.
    sees : False if no place was found from which a camera sees the solid.
    cube : of a solid without end, the edge of a cube about the origin that shows how it repeats; 0 for any other.
    """

    points: Points
    position: NDArray[np.float64] | None = None
    centre: NDArray[np.float64] | None = None
    floor: float | None = None
    cube: float = 0.0
    sees: bool = True

    @property
    def middle(self) -> NDArray[np.float64]:
        """The point at which the camera looks: the centre of the box, or of the points if that lies elsewhere."""
        middle: NDArray[np.float64] = (self.points.min(axis=0) + self.points.max(axis=0)) / 2
        if self.centre is not None and np.linalg.norm(self.centre - middle) < 0.02 * self.diameter:
            return self.centre
        return middle

    @property
    def diameter(self) -> float:
        """The length of the diagonal of the points' box."""
        return float(np.linalg.norm(np.ptp(self.points, axis=0)))

    def beside(self, medium: Points, alone: bool) -> Framed:
        """What a camera frames with a medium. medium : two corners, (2, 3). alone : if nothing else has a size.

        A medium much larger than the solids surrounds them: they are framed, from within it.
        """
        box = corners(*medium)
        if alone:
            return Framed(box, centre=medium.mean(axis=0), floor=self.floor)
        if self.position is not None or np.linalg.norm(np.ptp(medium, axis=0)) > SURROUNDS * self.diameter:
            return self
        return replace(self, points=np.concatenate([self.points, box]))


def corners(lower: Points, upper: Points) -> Points:
    """The 8 corners of a box."""
    return np.where(CUBE > 0.0, upper, lower)


def _directions(n: int) -> Points:
    """Unit directions that cover the sphere evenly."""
    k = np.arange(n) + 0.5
    y, turn = 1.0 - 2.0 * k / n, k * np.pi * (3.0 - np.sqrt(5.0))
    s = np.sqrt(1.0 - y * y)
    return np.stack([s * np.cos(turn), y, s * np.sin(turn)], axis=1)


SUPPORT = np.concatenate([np.eye(3), -np.eye(3), _directions(58)])
"""Directions in which the farthest point is kept."""


def farthest(points: Points) -> Points:
    """The points that lie farthest in a direction of `SUPPORT`: at most 64, with nearly the same convex hull."""
    kept: Points = points[sorted({*np.argmax(points @ SUPPORT.T, axis=0).tolist()})]
    return kept


def frame_of(root: Node, parts: list[Node]) -> Framed:
    """What a camera frames of a solid. parts : its largest bounded parts that are not empty."""
    few = len(all_nodes(root)) <= LARGE
    if parts:
        box = around([part.facts for part in parts])
        points = farthest(np.concatenate([_outside(part, few) for part in parts]))
        found = Framed(points, centre=(box.lower + box.upper) / 2)
        lowest = float(points[:, 1].min())
        lowest = float(box.lower[1]) if lowest - box.lower[1] < 0.02 * found.diameter else lowest
        return replace(found, floor=lowest if root.facts.bounded else None)
    if not few or root.facts.empty or not (fields := list(_fields(root))):
        return Framed(CUBE)
    ends = _sought(fields)
    return _inside(fields[0]) if ends is None else Framed(farthest(ends), floor=float(ends[:, 1].min()))


def _outside(part: Node, few: bool) -> Points:
    """Points on the surface of a bounded solid; the corners of its box, or of those of its parts, if none is found."""
    lower, upper = np.array(part.facts.lower), np.array(part.facts.upper)
    if not few and part.definition.associative:
        boxes = [child.facts for child in part.children if child.facts.bounded and not child.facts.empty]
        return np.concatenate([corners(box.lower, box.upper) for box in boxes] or [corners(lower, upper)])
    point = not np.any(upper > lower)
    box = lower - point, upper + point
    fields = list(_fields(part)) if few and not point else []
    found = [_surface(field, *box) for field in fields]
    seen = np.concatenate(found) if found else np.zeros((0, 3))
    usual = list(_fields(part, ends=False)) if found else []
    if len(usual) < len(fields) and len(seen):
        near, within = _closer(usual, *box)
        if len(near) >= 4 and WIDE * np.linalg.norm(np.ptp(near, axis=0)) < np.linalg.norm(np.ptp(seen, axis=0)):
            return _to_corners(near, *within)
    if len(seen) < 4:
        return corners(*box)
    if not np.all(np.ptp(seen, axis=0) > 0.8 * (box[1] - box[0])):
        # A second, finer look: the box of a solid that turns is much larger than the solid
        low, high = _padded(seen)
        low, high = np.maximum(box[0], low), np.minimum(box[1], high)
        seen = np.concatenate([seen, *(_surface(field, low, high) for field in fields)])
    ends, size = corners(*box), np.linalg.norm(box[1] - box[0])
    own = [ends[field(ends) <= 1e-6 * size] for field in fields]  # the corners of a box belong to it
    return np.concatenate([_to_corners(seen, *box), *own])


def is_hollow(part: Node) -> bool:
    """True if samples of the field of a bounded solid find neither a surface nor an inside.

    A solid whose field may be 0 where it has no surface, as where a cut takes all of it, needs an inside.
    """
    lower, upper = np.array(part.facts.lower), np.array(part.facts.upper)
    if len(all_nodes(part)) > LARGE or not np.any(upper > lower):
        return False
    fields, samples = list(_fields(part)), _grid(lower, upper)
    if not may_touch(part):
        inside = (bool(np.any(field(samples) <= 0.0)) for field in fields)
        return bool(fields) and not any(inside) and not any(len(_surface(field, lower, upper)) for field in fields)
    tips = np.linalg.norm(upper - lower) * np.multiply.outer((1e-2, 1e-4, 1e-6), SUPPORT[:6]).reshape(-1, 1, 3)
    for field in fields:
        beside = (tips + _surface(field, lower, upper)).reshape(-1, 3)
        if np.any(field(np.concatenate([samples, beside])) < 0.0):
            return False
    return bool(fields)


def _closer(fields: list[Field], lower: Points, upper: Points) -> tuple[Points, tuple[Points, Points]]:
    """Points on the surfaces, and a box about them, from looks into ever smaller boxes."""
    found = np.concatenate([_surface(field, lower, upper) for field in fields])
    while len(found) and not np.all(np.ptp(found, axis=0) > 0.7 * (upper - lower)):
        low, high = _padded(found)
        lower, upper = np.maximum(lower, low), np.minimum(upper, high)
        found = np.concatenate([_surface(field, lower, upper) for field in fields])
    return found, (lower, upper)


def _padded(points: Points) -> tuple[Points, Points]:
    """The box of points, a little larger."""
    low, high = points.min(axis=0), points.max(axis=0)
    pad = 0.1 * (high - low) + 1e-6 * np.max(high - low)
    return low - pad, high + pad


def _to_corners(points: Points, lower: Points, upper: Points) -> Points:
    """Points moved from their centre by half the distance of two samples, since a corner lies between them."""
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    return np.clip(middle + (points - middle) * (EDGE / (EDGE - 1.0)), lower, upper)


def _fields(node: Node, ends: bool = True) -> Iterator[Field]:
    """The field at several times, with all Params at their defaults and, with `ends`, least and greatest values."""
    field = field_of(node)
    if without_twin(field.body):
        return
    evaluate = evaluator_of(field)
    specs = {leaf.data.name: leaf.data for leaf in find([field.body], "param")}
    choices = [{n: s.value for n, s in specs.items()}]
    choices += [
        {
            n: s.value if (at := getattr(s, end)) is None else np.broadcast_to(at, np.shape(s.value))
            for n, s in specs.items()
        }
        for end in ("min", "max")
        if specs and ends
    ]
    for time, params in product(TIMES if find([field.body], "time") else TIMES[:1], choices):

        def values(points: Points, time: float = time, params: dict[str, object] = params) -> NDArray[np.float64]:
            with bound(params, time), np.errstate(all="ignore"):
                found: NDArray[np.float64] = np.broadcast_to(evaluate(points)[0], len(points)).astype(np.float64)
            return np.where(np.isfinite(found), found, np.inf)

        yield values


def _grid(lower: Points, upper: Points) -> Points:
    """The centres of `EDGE`^3 cells of a box, a little uneven: none lies as far from one face as from another."""
    across = (np.arange(EDGE) + 0.5) / EDGE - 0.5
    unit = np.stack(np.meshgrid(across, 0.995 * across, 0.99 * across), axis=-1).reshape(-1, 3)
    return np.asarray((lower + upper) / 2 + unit * (upper - lower))


def _surface(field: Field, lower: Points, upper: Points) -> Points:
    """Points on the surface in a box: samples near it, moved along the gradient by Newton's method."""
    cell = float(np.linalg.norm(upper - lower)) / EDGE
    points = _grid(lower, upper)
    value = field(points)
    near = np.abs(value) < 1.5 * cell
    points, value = points[near], value[near]
    step = 1e-4 * cell
    tips = step * np.array([[1, -1, -1], [-1, -1, 1], [-1, 1, -1], [1, 1, 1]])
    for _ in range(3):
        if not len(points):
            break
        around = field((points[None] + tips[:, None]).reshape(-1, 3)).reshape(4, -1)
        slope = np.einsum("kn,kc->nc", np.where(np.isfinite(around), around, 0.0), tips) / (4.0 * step * step)
        length = np.maximum(np.sum(slope * slope, axis=1), 1e-6)
        points = points - slope * np.clip(value / length, -2.0 * cell, 2.0 * cell)[:, None]
        value = field(points)
    arrived = np.abs(value) < 0.05 * cell
    return np.clip(points[arrived], lower, upper)


def _sought(fields: list[Field]) -> Points | None:
    """Points of the surface of a solid without a finite box that ends nevertheless; None if it does not."""
    for half in WINDOWS:
        low, high = np.full(3, -half), np.full(3, half)
        found = np.concatenate([_surface(field, low, high) for field in fields])
        if len(found) >= 4 and np.max(np.abs(found)) < 0.9 * half:
            low, high = _padded(found)
            return np.concatenate([found, *(_surface(field, low, high) for field in fields)])
    return None


def _inside(field: Field) -> Framed:
    """The place of a camera in a solid without end: where it sees surfaces at many distances, none of them near."""
    usual = VIEW * (USUAL / np.linalg.norm(VIEW))
    for half in WINDOWS:
        places = np.concatenate([usual[None], _grid(np.full(3, -half), np.full(3, half))])
        free = field(places)
        room = float(np.max(free[1:]))
        if 0.0 < room < half / 3.0:
            break
    order = np.argsort(-free[1:], kind="stable")[:40] + 1
    places, free = places[[0, *order]], free[[0, *order]]
    ahead = _fan()
    reached = _trace(field, np.repeat(places, len(ahead), axis=0), np.tile(ahead, (len(places), 1)))
    reached = reached.reshape(len(places), -1)
    hits = np.mean(reached < HORIZON, axis=1)
    before = np.linspace(0.7, 1.0, 4)[:, None] * usual  # nothing of it is close in front of the camera
    if np.min(field(before)) > 0.5 and hits[0] >= 0.3 and reached[0].min() > 0.5:
        return Framed(CUBE)
    depth = np.mean(np.log(np.clip(reached, 1e-9, HORIZON)), axis=1)
    score = np.where((free > 0.0) & (hits >= 0.3), depth, -np.inf)
    best = int(np.argmax(score))
    if not np.isfinite(score[best]):
        return Framed(CUBE, sees=bool(free[0] > 0.5 and np.any(reached[0] < HORIZON)))
    ahead_of_it = -VIEW / np.linalg.norm(VIEW) * float(np.median(reached[best]))
    edge = _uncut(field, 2.5 * float(np.exp(depth[best])))
    return Framed(CUBE + places[best] + ahead_of_it, places[best], cube=edge)


def _uncut(field: Field, edge: float) -> float:
    """The edge of a cube about the origin, near a given one, whose faces pass between the copies of a solid.

    The edge is kept if no other cuts less than a quarter of what it cuts.
    """
    edges = edge * np.array([1.0, *np.linspace(0.7, 1.4, 29)])
    sides = np.concatenate([sign * np.eye(3)[[axis] * FACE] for axis in range(3) for sign in (1.0, -1.0)])
    across = np.random.default_rng(0).uniform(-1.0, 1.0, sides.shape)
    faces = np.where(sides == 0.0, across, sides)
    solid = field((0.5 * edges[:, None, None] * faces).reshape(-1, 3)).reshape(len(edges), -1) <= 0.0
    share = solid.mean(axis=1)
    clear = np.flatnonzero(share < 0.25 * share[0])
    if not len(clear):
        return edge
    least = clear[share[clear] <= share[clear].min() + 0.002]
    return float(edges[least[np.argmin(np.abs(edges[least] - edge))]])


def _fan() -> Points:
    """Unit directions of a few rays of a picture of the usual view."""
    backward = VIEW / np.linalg.norm(VIEW)
    right = np.cross((0.0, 1.0, 0.0), backward)
    right /= np.linalg.norm(right)
    x, y = np.meshgrid(np.linspace(-0.6, 0.6, 5), np.linspace(-0.35, 0.35, 5))
    rays = x.reshape(-1, 1) * right + y.reshape(-1, 1) * np.cross(backward, right) - backward
    return np.asarray(rays / np.linalg.norm(rays, axis=1, keepdims=True))


def _trace(field: Field, origins: Points, directions: Points) -> NDArray[np.float64]:
    """Distances to the surface along rays, roughly; `HORIZON` where there is none."""
    t = np.zeros(len(origins))
    live = np.arange(len(t))
    for _ in range(60):
        value = field(origins[live] + t[live, None] * directions[live])
        t[live] += np.maximum(value, 0.0)
        live = live[(value > 1e-3) & (t[live] < HORIZON)]
        if not len(live):
            break
    return np.minimum(t, HORIZON)
