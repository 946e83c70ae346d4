"""Parts of a scene of many objects: the same tree with some operands of its unions only."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raymarch.expr.walk import topological
from raymarch.scene.camera import Pose
from raymarch.scene.parameter import Values
from raymarch.sdf.blends import levels
from raymarch.sdf.booleans import blend_of
from raymarch.sdf.instancing import instanced
from raymarch.sdf.labels import rows_of
from raymarch.sdf.node import Node
from raymarch.sdf.rows import Rows
from raymarch.sdf.visibility import hidden_from

ROWS = 256
"""Rows of a picture whose pixel is the width of the ray: a hit of the picture may lie a pixel beside an object."""

FEWEST = 8
"""Least number of operands of a blend that are looked at one by one."""

MARGIN = 1e-9
"""Share by which boxes are grown and distances to them reduced: rounding cannot leave out an operand."""

BY_OBJECT = ("slots", "order", "lower", "upper", "radius", "spread", "lipschitz")
"""The fields of a form with an entry of each object, beside `numbers`."""

Whole = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Boxes:
    """Boxes around some operands, each of which bounds the field of its operand from below.

    Attributes
    ----------
    middle, half : centre and half edges, (n, 3); 0 and inf where a side is infinite or nothing is known.
    rise : the field is at least this times the distance to the box, (n,); at most 1.
    """

    middle: NDArray[np.float64]
    half: NDArray[np.float64]
    rise: NDArray[np.float64]

    @classmethod
    def around(cls, lower: Any, upper: Any, rise: Any) -> Boxes:
        """Boxes from their corners."""
        known = np.isfinite(lower) & np.isfinite(upper)
        lower, upper = np.where(known, lower, 0.0), np.where(known, upper, 0.0)
        return cls(0.5 * (lower + upper), np.where(known, 0.5 * (upper - lower), np.inf), rise)

    @classmethod
    def bounding(cls, lower: Any, upper: Any, spread: Any, full: Any) -> Boxes:
        """Boxes of operands with these facts. Without a spread, or without a point inside, a box says nothing.

        full : whether the field of each is the distance outside of the solid; see `rises_fully`.
        """
        known = (np.isfinite(spread) & np.all(lower <= upper, axis=1))[:, None]
        lower, upper = np.where(known, lower, -np.inf), np.where(known, upper, np.inf)
        grown = MARGIN * np.abs(lower[np.isfinite(lower)]).max(
            initial=np.abs(upper[np.isfinite(upper)]).max(initial=0.0)
        )
        # A point with the value m > 0 lies in the box grown by spread * m on each side. The corners of such a box are
        # sqrt(3) times as far away as its faces.
        rise = np.where(full, 1.0, 1.0 / (math.sqrt(3.0) * np.where(known[:, 0], np.maximum(spread, 1.0), 1.0)))
        return cls.around(lower - grown, upper + grown, (1.0 - MARGIN) * rise)

    @classmethod
    def of(cls, nodes: Sequence[Node]) -> Boxes:
        """The boxes of some nodes."""
        facts = [node.facts for node in nodes]
        lower, upper = np.array([f.lower for f in facts]), np.array([f.upper for f in facts])
        full = np.array([rises_fully(node) for node in nodes], bool)
        return cls.bounding(lower.reshape(-1, 3), upper.reshape(-1, 3), np.array([f.spread for f in facts]), full)

    @classmethod
    def of_rows(cls, rows: Rows) -> Boxes:
        """The boxes of all objects of some rows."""
        lower, upper, spread = (
            np.concatenate([getattr(form, v) for form in rows.forms]) for v in ("lower", "upper", "spread")
        )
        full = [np.full(len(form), form.exact or _is_moved(form.template)) for form in rows.forms]
        return cls.bounding(lower, upper, spread, np.concatenate(full))

    def __len__(self) -> int:
        return len(self.rise)

    @staticmethod
    def joined(parts: Sequence[Boxes]) -> Boxes:
        """All boxes in order."""
        return Boxes(*(np.concatenate([getattr(part, v) for part in parts]) for v in ("middle", "half", "rise")))


def rises_fully(node: Node) -> bool:
    """True if the field is the distance outside of the solid: unions of exact solids are, although bounds inside."""
    pending = [node]
    while pending:
        each = pending.pop()
        if each.facts.exactness != "exact":
            if each.placed_as not in ("union", "rigid", "scale"):
                return False
            pending += each.children
    return True


def _is_moved(template: Node) -> bool:
    """The same of an instance, which is rotated, scaled by one factor, and labelled or not."""
    moved = template.children[0] if template.label is not None else template
    return rises_fully(moved.children[0])


class Parts:
    """The operands of the outermost unions of a tree, hard ones and blends that end at a distance, through labels and
    through `visible` where it shows a solid to rays of the kind `rays`; None is through no `visible`.

    Attributes
    ----------
    solids : the operands of hard unions that are none of the following, each once.
    many : those that are rows of objects.
    blends : the blends of `FEWEST` operands or more, which are looked at one by one.
    """

    def __init__(self, root: Node, rays: str | None = None) -> None:
        self.root, self._rays = root, rays
        order: list[Node] = topological([root], lambda node: node.children if self._inner(node) else ())
        self._spine = [node for node in order if self._inner(node)]
        ends = [node for node in order if not self._inner(node)]
        self.many = [node for node in ends if rows_of(node) is not None and node.facts.divisor == 1.0]
        self.blends = [node for node in ends if is_finite_blend(node)]
        self.solids = [node for node in ends if node not in {*self.many, *self.blends}]

    def _inner(self, node: Node) -> bool:
        shown = self._rays is not None and bool(hidden := hidden_from(node)) and self._rays not in hidden
        return shown or node.placed_as == "union" or node.label is not None

    def part(self, solids: Sequence[Node], kept: Mapping[Node, Whole]) -> Node | None:
        """The tree with some operands only; None for none.

        solids : the operands among `solids` that stay. kept : the numbers of the objects of rows that stay, and of the
        operands of blends, ascending.
        """
        made: dict[Node, Node | None] = dict(zip(solids, solids, strict=True))
        made |= {node: some_rows(node, kept.get(node, ())) for node in self.many}
        made |= {node: some_blended(node, kept.get(node, ())) for node in self.blends}
        for node in self._spine:
            children = [child for c in node.children if (child := made.get(c)) is not None]
            if len(children) == len(node.children) and all(
                a is b for a, b in zip(children, node.children, strict=True)
            ):
                made[node] = node
            elif children and (node.label is not None or node.placed_as != "union"):
                made[node] = _like(node, children)
            else:
                made[node] = _like(node, children) if len(children) > 1 else next(iter(children), None)
        last = self._spine[-1] if self._spine else None
        return next(iter(made.values()), None) if last is None else made[last]


def _like(node: Node, children: Sequence[Node]) -> Node:
    made = Node(node.definition, tuple(children), node.params, node.facts, node.label)
    made.where = node.where
    return made


def is_finite_blend(node: Node) -> bool:
    """True for a smooth union whose operands do not act beyond a distance, if it has `FEWEST` or more."""
    return len(node.children) >= FEWEST and blend_of(node) is not None


def influence(node: Node, values: Values) -> float:
    """The distance above a blend's smallest operand from which on operands change nothing.

    Let X be a number such that all operands below X are known, and none of those above is. A fold of two values where
    the nearer is below X - reach is right whatever an unknown other is. If it is not below, the result is at least
    X - reach - k / 4. So the values of one level of the tree are right where they are below X, those of the next where
    they are below X - reach - k / 4, and the root where it is below X minus this for each level.
    """
    blend = blend_of(node)
    assert blend is not None
    width = float(values.of(blend.width))
    return levels(len(node.children)) * width * (blend.reach + 0.25) * (1.0 + MARGIN)


def some_rows(node: Node, kept: Whole | Sequence[int]) -> Node | None:
    """Rows of some objects, ascending."""
    rows: Rows = node.params["rows"]
    if len(kept) in (0, len(rows)):
        return node if len(kept) else None
    forms, first = [], 0
    for form in rows.forms:
        mine = np.asarray([i - first for i in kept if first <= i < first + len(form)], np.int64)
        arrays = {
            v: getattr(form, v)[mine] for v in ("slots", "order", "lower", "upper", "radius", "spread", "lipschitz")
        }
        if len(mine):
            forms.append(replace(form, numbers=tuple(number[mine] for number in form.numbers), **arrays))
        first += len(form)
    made: Node = instanced(Rows(tuple(forms), rows.materials, rows.k, rows.family))
    made.where = node.where
    return made


def some_blended(node: Node, kept: Whole | Sequence[int]) -> Node | None:
    """A blend of some operands, ascending, in the same order of folds."""
    if len(kept) == len(node.children):
        return node
    row = {int(i): node.children[i] for i in kept}
    while len(row) > 1:
        above: dict[int, Node] = {}
        for i, each in row.items():
            other = above.get(i >> 1)
            above[i >> 1] = each if other is None else _like(node, (other, each))
        row = above
    return next(iter(row.values()), None)


@dataclass(frozen=True, eq=False)
class _Ray:
    """A ray of the width of a pixel."""

    pose: Pose
    origin: NDArray[Any]
    direction: NDArray[Any]

    def near(self, boxes: Boxes, reach: float = 0.0) -> Whole:
        """The operands whose field may be `reach` or less within a pixel of the ray, by the balls around the boxes."""
        radius = np.linalg.norm(boxes.half, axis=1) + reach / boxes.rise
        away = boxes.middle - self.origin
        t = np.maximum(away @ self.direction, 0.0)
        beside = np.linalg.norm(away - t[:, None] * self.direction, axis=1)
        return np.flatnonzero(np.isinf(radius) | (beside <= radius + self.pose.footprint(t + radius, ROWS)))


def along_ray(root: Node, pose: Pose, origin: NDArray[Any], ray: NDArray[Any], values: Values) -> Node:
    """The tree without the operands of outermost unions that a ray passes at more than a pixel, and blends without
    those that change no surface there.

    It has the same surface along the ray, and the field is never smaller. origin, ray : shape (3,), the ray unit.
    """
    parts, line = Parts(root), _Ray(pose, origin, ray)
    solids = [parts.solids[i] for i in line.near(Boxes.of(parts.solids))]
    kept = {node: line.near(Boxes.of_rows(node.params["rows"])) for node in parts.many}
    for node in parts.blends:
        kept[node] = line.near(Boxes.of(node.children), influence(node, values))
    found = parts.part(solids, kept)
    if found is None:  # a tree has one operand at least
        found = parts.part(parts.solids[:1], {node: np.arange(1) for node in (parts.many + parts.blends)[:1]})
        assert found is not None
    return found
