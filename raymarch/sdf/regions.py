"""Boxes of solids that turn.

Beside its box, a solid has radii: of the cylinders about the lines through the centre of the box along x, y and z, and
of the ball about the centre, that contain it. A rotation keeps the ball, and the cylinder about its axis. A chain of
rigid motions by constant numbers is one motion of the solid at its end, so its box does not grow with the chain.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raymarch.expr.intervals import Interval, cosine, matrix_product
from raymarch.expr.node import Expr, const
from raymarch.expr.types import FLOAT
from raymarch.expr.vocabulary import columns
from raymarch.sdf.facts import Facts, Placed, radial

Array = NDArray[np.float64]
Disc = tuple[Interval, Array]
"""The range of a centre, (n, d), and radii about it, (n, 4)."""

ROUNDING = 1e-12
"""Relative difference that is not more than rounding."""

BLURRED = 4.0
"""Ratio of the spread of a box to the swell of its ball above which a rotation by an unknown angle forgets the box."""

DIAGONAL = float(np.sqrt(3.0))
SIDES = [*product((0, 1), repeat=3)]


@dataclass(frozen=True, slots=True)
class Motion:
    """A map x -> matrix x + offset, a rotation times one factor; None for the identity and no offset.

    matrix : or the factor alone. axis, angle : of a rotation about an axis. turns : False if the solid is only
    translated or scaled.
    """

    matrix: Expr | None = None
    offset: Expr | None = None
    axis: Expr | None = None
    angle: Expr | None = None
    turns: bool = True

    def scaled(self, length: Expr) -> Expr:
        """Lengths of a solid that is only translated or scaled."""
        return length if self.matrix is None else length * self.matrix

    def carried(self, point: Expr) -> Expr:
        """Points of such a solid."""
        return self.scaled(point) if self.offset is None else self.scaled(point) + self.offset

    def parts(self, dimension: int) -> list[Expr]:
        """Matrix, offset, axis and angle; an axis of 0 for none."""
        factor = const(1.0) if self.matrix is None else self.matrix
        matrix = columns(*[factor * const(axis) for axis in np.eye(dimension)]) if factor.type is FLOAT else factor
        given, absent = (self.offset, self.axis, self.angle), (np.zeros(dimension), np.zeros(3), 0.0)
        return [matrix, *(const(b) if a is None else a for a, b in zip(given, absent, strict=True))]


class Regions:
    """Boxes and radii of some nodes.

    children : the facts of the children of each. box : the boxes, by the rule of the definition; those of a motion that
    turns follow from it. values : the ranges of `n_discs` pairs of a centre and radii, and of the parts of a motion.
    """

    def __init__(
        self,
        children: Sequence[Sequence[Facts]],
        box: Interval,
        values: Sequence[Interval],
        n_discs: int,
        motion: Motion | None,
    ) -> None:
        n, d = box[0].shape
        self.lower, self.upper = box[0].astype(np.float64), box[1].astype(np.float64)
        self.children = children
        self.radii: list[Array | None] = [None] * n
        self.placed: list[Placed | None] = [None] * n
        self.far = [np.inf] * n
        self._ways = ["stated"] * n
        if n_discs:
            whole = [[np.broadcast_to(end, (n, end.shape[-1])) for end in value] for value in values[: 2 * n_discs]]
            discs = [((c[0], c[1]), r[1]) for c, r in zip(whole[::2], whole[1::2], strict=True)]
            self._set(np.arange(n), about(box, discs), "tight", box)
        if motion is None:
            return
        ranges = zip(values[2 * n_discs :], ((d, d), (d,), (3,), ()), strict=True)
        matrix, offset, axis, angle = ([np.broadcast_to(end, (n, *shape)) for end in value] for value, shape in ranges)
        if motion.turns:
            before = [np.array([getattr(facts[0], side) for facts in children]) for side in ("lower", "upper")]
            low, high = matrix_product((matrix[0], matrix[1]), (before[0], before[1]))
            self.lower = np.where(np.isnan(low), -np.inf, low + offset[0])
            self.upper = np.where(np.isnan(high), np.inf, high + offset[1])
        still = np.all(matrix[0] == matrix[1], axis=(1, 2)) & np.all(offset[0] == offset[1], axis=1)
        chained = motion.turns | np.array([facts[0].placed is not None for facts in children])
        if at := np.nonzero(still & chained & _are_rigid(matrix[0]))[0].tolist():
            turned, known = Turned([children[i][0] for i in at]), (self.lower[at], self.upper[at])
            turned.move(matrix[0][at], offset[0][at])
            hull = tightened(known, turned.hull())
            self._set(at, (hull, None), "placed", None)
            self._set(at, turned.here(hull), "placed and tight", hull)
            for i, placed in zip(at, turned.ends, strict=True):
                self.placed[i] = placed
        for i in np.nonzero(~np.any((offset[0] != 0.0) | (offset[1] != 0.0), axis=1) & (still | motion.turns))[
            0
        ].tolist():
            self.far[i] = children[i][0].farthest * (float(np.linalg.norm(matrix[0][i, 0])) if still[i] else 1.0)
        about_axis = np.all(axis[0] == axis[1], axis=1) & np.any(axis[0] != 0.0, axis=1)
        for by_axis in (True, False):
            if motion.turns and (at := np.nonzero(~still & (about_axis == by_axis))[0].tolist()):
                turned, known = Turned([children[i][0] for i in at]), (self.lower[at], self.upper[at])
                if by_axis:
                    before = [np.array([getattr(children[i][0], side) for i in at]) for side in ("lower", "upper")]
                    swept, *discs = turned.rotated(known, before, axis[0][at], (angle[0][at], angle[1][at]))
                else:
                    swept, *discs = turned.somehow(known, (matrix[0][at], matrix[1][at]))
                blurred = np.array([DIAGONAL * end.facts.spread > BLURRED * end.facts.swell for end in turned.ends])
                box = np.where(blurred[:, None], -np.inf, swept[0]), np.where(blurred[:, None], np.inf, swept[1])
                far = np.array([self.far[i] for i in at])[:, None].repeat(4, axis=1)
                discs.append(((np.zeros((len(at), d)), np.zeros((len(at), d))), far))
                for disc in discs:
                    box, _ = about(box, [disc])
                self._set(at, (box, np.min([about(box, [disc])[1] for disc in discs], axis=0)), "swept", None)
                for k in np.nonzero(blurred)[0]:
                    self._ways[at[k]] = "ball"

    def _set(self, at: Any, found: tuple[Interval, Array | None], way: str, before: Interval | None) -> None:
        """Boxes and radii of some nodes. before : the boxes that are of this way only where they differ."""
        box, radii = found
        self.lower[at], self.upper[at] = box
        for k, i in enumerate(at):
            if before is None or np.any(box[0][k] != before[0][k]) or np.any(box[1][k] != before[1][k]):
                self._ways[i] = way
            self.radii[i] = None if radii is None else radii[k]

    def spread(self, i: int, stated: float, undivided: bool = False) -> float:
        """The spread of a node: that of its definition for the box of its definition. Points in a box of the radii are
        within the swell of these; those in a box that turns move by up to its diagonal."""
        spread, swell = ("undivided_spread", "undivided_swell") if undivided else ("spread", "swell")
        way, below = self._ways[i], self.children[i]
        if way == "stated":
            return stated
        swelling: float = max([getattr(facts, swell) for facts in below], default=stated * DIAGONAL)
        if way in ("tight", "ball"):
            return max(stated, swelling) if way == "tight" else swelling
        placed = self.placed[i] or below[0].placed or Placed(below[0], np.eye(1), np.zeros(1))
        grown: float = getattr(placed.facts, spread)
        if way == "swept":
            return grown * DIAGONAL + swelling
        rows = np.abs(placed.linear).sum(axis=1).max() / np.linalg.norm(placed.linear[0])
        return grown * float(rows) + (swelling if way == "placed and tight" else 0.0)

    def swell(self, i: int, spread: float, undivided: bool = False) -> float:
        """The swell of a node with this spread."""
        if self.radii[i] is None or not self.children[i]:
            return spread * DIAGONAL
        return max(getattr(facts, "undivided_swell" if undivided else "swell") for facts in self.children[i])


def _are_rigid(matrices: Array) -> NDArray[np.bool_]:
    """True for rotations and reflections times one factor."""
    square = np.einsum("nij,nkj->nik", matrices, matrices)
    size = square[:, :1, :1]
    return np.all(np.abs(square - size * np.eye(matrices.shape[-1])) <= ROUNDING * size, axis=(1, 2))


def tightened(box: Interval, other: Interval) -> Interval:
    """The common part of two boxes. A side stays if the other one is closer by rounding only, or is not a number."""
    slack = ROUNDING * np.nan_to_num(np.maximum(np.abs(box[0]), np.abs(box[1])), nan=0.0, posinf=0.0)
    low = np.where(other[0] > box[0] + slack, other[0], box[0])
    return low, np.where(other[1] < box[1] - slack, other[1], box[1])


def about(box: Interval, discs: Sequence[Disc]) -> tuple[Interval, Array]:
    """The box and the radii of a solid in a box, each point of which also lies within one of some discs."""
    d = box[0].shape[-1]
    boxes = [(low - _extent(r)[:, :d], high + _extent(r)[:, :d]) for (low, high), r in discs]
    box = tightened(box, (np.min([b[0] for b in boxes], axis=0), np.max([b[1] for b in boxes], axis=0)))
    centre = 0.5 * (box[0] + box[1])
    known = [radial(np.maximum(np.abs(low - centre), np.abs(high - centre))) + r for (low, high), r in discs]
    return box, np.fmin(
        np.nan_to_num(np.max(known, axis=0), nan=np.inf, posinf=np.inf), radial(0.5 * (box[1] - box[0]))
    )


def _extent(radii: Array) -> Array:
    """How far radii reach along each axis, (n, 3)."""
    x, y, z, ball = np.moveaxis(radii, -1, 0)
    return np.minimum(np.stack([np.minimum(y, z), np.minimum(x, z), np.minimum(x, y)], axis=-1), ball[:, None])


class Turned:
    """Some solids that turn. ends : those at the ends of their chains of motions by constants, as these place them.

    All have three dimensions in here; z is 0 in the plane.
    """

    def __init__(self, children: Sequence[Facts]) -> None:
        n, d = len(children), len(children[0].lower)
        self.dimension = d
        self.ends = [child.placed or Placed(child, np.eye(d), np.zeros(d)) for child in children]
        self.lower, self.upper, self.offset = (np.zeros((n, 3)) for _ in range(3))
        self.linear = np.broadcast_to(np.eye(3), (n, 3, 3)).copy()
        self.radii = np.array([end.facts.reach for end in self.ends])
        for i, end in enumerate(self.ends):
            self.lower[i, :d], self.upper[i, :d] = end.facts.lower, end.facts.upper
            self.linear[i, :d, :d], self.offset[i, :d] = end.linear, end.offset

    def move(self, matrix: Array, offset: Array) -> None:
        """Add a motion by constants to each chain."""
        d = self.dimension
        self.linear[:, :d, :d] = matrix @ self.linear[:, :d, :d]
        self.offset[:, :d] = np.einsum("nij,nj->ni", matrix, self.offset[:, :d]) + offset
        maps = zip(self.ends, self.linear, self.offset, strict=True)
        self.ends = [Placed(end.facts, linear[:d, :d], moved[:d]) for end, linear, moved in maps]

    @property
    def _size(self) -> Array:
        return np.linalg.norm(self.linear[:, 0], axis=-1)

    @property
    def _ball(self) -> Array:
        return self._size * self.radii[:, 3]

    @property
    def _centre(self) -> Array:
        return np.einsum("nij,nj->ni", self.linear, 0.5 * (self.lower + self.upper)) + self.offset

    @property
    def _corners(self) -> Array:
        """Of the boxes, (8, n, 3)."""
        ends = np.stack([self.lower, self.upper])
        corners = np.stack([np.stack([ends[side, :, i] for i, side in enumerate(c)], axis=-1) for c in SIDES])
        return np.einsum("nij,cnj->cni", self.linear, corners) + self.offset

    def _radius(self, axis: Array) -> Array:
        """About a unit axis, (n, 3): that of the ball, if it is not an axis of the box."""
        along = np.abs(np.einsum("nij,ni->nj", self.linear, axis)) / self._size[:, None]
        k, n = np.argmax(along, axis=-1), np.arange(len(along))
        return np.where(along[n, k] >= 1.0 - ROUNDING, self.radii[n, k] * self._size, self._ball)

    def _flat(self, box: Interval) -> Interval:
        return box[0][:, : self.dimension], box[1][:, : self.dimension]

    def hull(self) -> Interval:
        """The boxes around the moved boxes."""
        low, high = matrix_product((self.linear, self.linear), (self.lower, self.upper))
        return self._flat((low + self.offset, high + self.offset))

    def here(self, box: Interval) -> tuple[Interval, Array]:
        """The boxes and radii after the motions by constants. box : one that is known."""
        size, centre = self._size, self._centre
        # the cylinder about each axis of the box, with its ends
        across = np.sqrt(np.maximum((size**2)[:, None, None] - self.linear**2, 0.0)) * self.radii[:, None, :3]
        reach = (np.abs(self.linear) * 0.5 * (self.upper - self.lower)[:, None] + across).min(axis=-1)
        box = tightened(box, self._flat((centre - reach, centre + reach)))
        axes = [self._radius(np.broadcast_to(axis, centre.shape)) for axis in np.eye(3)]
        return about(box, [(self._flat((centre, centre)), np.stack([*axes, self._ball], axis=-1))])

    def rotated(
        self, box: Interval, before: Sequence[Array], axis: Array, angle: Interval
    ) -> tuple[Interval, Disc, Disc]:
        """The boxes after rotations about unit axes, (n, 3), by angles of a range, and two discs.

        box : one that is known. before : the boxes before the rotation.
        """
        d, corners, centre, ball = self.dimension, self._corners, self._centre, self._ball[:, None]
        columns = _swept(np.broadcast_to(np.eye(3)[:, None], (3, *axis.shape)), axis, angle)
        low, high = (np.moveaxis(end, 0, -1)[:, :d, :d] for end in columns)
        box = tightened(box, matrix_product((low, high), (before[0], before[1])))
        low, high = _swept(corners, axis, angle)
        box = tightened(box, self._flat((low.min(axis=0), high.max(axis=0))))
        # the cylinder about the axis
        radius, heights = self._radius(axis)[:, None], np.einsum("ni,cni->cn", axis, corners)
        foot = np.einsum("ni,ni->n", axis, centre)[:, None] * axis
        wide = np.linalg.norm(centre - foot, axis=-1)[:, None] + radius
        across = wide * np.sqrt(np.maximum(1.0 - axis**2, 0.0))
        ends = heights.min(axis=0)[:, None] * axis, heights.max(axis=0)[:, None] * axis
        box = tightened(box, self._flat((np.minimum(*ends) - across, np.maximum(*ends) + across)))
        low, high = _swept(centre[None], axis, angle)
        along = np.where(np.abs(axis) >= 1.0 - ROUNDING, radius, ball)
        radii, away = np.concatenate([along, ball], axis=-1), wide - radius
        return box, (self._flat((low[0], high[0])), radii), (self._flat((foot, foot)), radii + away)

    def somehow(self, box: Interval, matrix: Interval) -> tuple[Interval, Disc, Disc]:
        """The same for rotations whose matrices lie in a range: no row of a rotation is longer than 1."""
        d, centre = self.dimension, self._centre
        some = np.zeros((len(centre), 3, 3))
        some[:, :d, :d] = (matrix[0] != 0.0) | (matrix[1] != 0.0)
        far = np.sqrt(np.einsum("nij,cnj->cni", some, self._corners**2)).max(axis=0)
        box = tightened(box, self._flat((-far, far)))
        far = np.sqrt(np.einsum("nij,nj->ni", some, centre**2))
        image = tightened(self._flat((-far, far)), matrix_product(matrix, (centre[:, :d], centre[:, :d])))
        ball = np.repeat(self._ball[:, None], 4, axis=1)
        origin = np.zeros((len(centre), d))
        return box, (image, ball), ((origin, origin), ball + np.linalg.norm(centre, axis=-1)[:, None])


def _swept(points: Array, axis: Array, angle: Interval) -> Interval:
    """The ranges of points, (c, n, 3), that turn about unit axes, (n, 3), by angles of a range, (n,).

    A component is a + b cos t + c sin t = a + sqrt(b^2 + c^2) cos(t - atan2(c, b)).
    """
    a = np.einsum("ni,cni->cn", axis, points)[..., None] * axis
    b, c = points - a, np.cross(axis, points)
    phase, size = np.arctan2(c, b), np.hypot(b, c)
    low, high = cosine((angle[0][:, None] - phase, angle[1][:, None] - phase))
    return a + size * low, a + size * high
