"""Differences of prisms along one axis, rewritten as one prism: the solid is the same, and the field beside it is the
distance, also beyond the rims of holes, where a difference of solids reads less."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from operator import is_
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from raymarch.expr.intervals import interval_of
from raymarch.expr.node import Expr, const
from raymarch.expr.vocabulary import vec2, vec3
from raymarch.sdf.affine import transform
from raymarch.sdf.booleans import difference, intersection, union
from raymarch.sdf.definition import definition_of
from raymarch.sdf.derivation import derive_facts
from raymarch.sdf.flat import circle, rectangle
from raymarch.sdf.labels import flattened
from raymarch.sdf.node import Node, all_nodes, at_line_of, folded, replaced
from raymarch.sdf.placement import affine_of, offset_of
from raymarch.sdf.placing import rotate, rotate_about, scale, translate, with_label
from raymarch.sdf.profiles import straight_extrusion
from raymarch.sdf.same import remembered
from raymarch.sdf.solids import box, cylinder

Array: TypeAlias = NDArray[np.float64]

ALIGNED = 1e-9
"""Largest sine of the angle between two axes that are one."""
FLUSH = 1e-7
"""How far below a face an end may be that is flush with it, in sizes: less than float32 tells."""

AXES = {definition_of(box): (0, 1, 2), definition_of(cylinder): (1,), definition_of(straight_extrusion): (2,)}
"""Prisms, and the axes along which each is one."""
MEASURED = 256
"""Maximum number of differences of a tree that is read: 2 ms for each."""
DEEPEST = 64
"""Maximum number of nodes above a prism."""


@dataclass(frozen=True, slots=True)
class Prism:
    """A flat shape, extruded by half of a height on both sides of a centre."""

    section: Node
    centre: Expr
    height: Expr

    def moved(self, offset: Sequence[Expr]) -> Prism:
        *flat, along = offset
        still = all(_is_zero(o) for o in flat)
        return Prism(self.section if still else translate(self.section, vec2(*flat)), self.centre + along, self.height)

    def scaled(self, factor: float) -> Prism:
        if factor == 1.0:
            return self
        return Prism(scale(self.section, factor), self.centre * factor, self.height * factor)

    def turned(self, angle: Expr | float) -> Prism:
        return Prism(rotate(self.section, angle), self.centre, self.height)

    def goes_through(self, other: Prism) -> bool:
        """True if it is proved, for all values of parameters, that no end lies in the other one."""
        longer, apart = 0.5 * (self.height - other.height), self.centre - other.centre
        least = min(float(interval_of(each)[0]) for each in (longer - apart, longer + apart))
        return least >= -FLUSH * float(interval_of(other.height)[1])


def _is_zero(value: Expr) -> bool:
    return value.is_constant and not value.data


def with_prisms(root: Node) -> Node:
    """The same solid; hard differences that are prisms, or prisms that others cut, are rewritten as such."""
    cuts = [node for node in all_nodes(root) if _is_cut(node)]
    if len(cuts) > MEASURED:
        return root
    inner = {id(node.children[0]) for node in cuts}
    shown = [node.children[1 if _is_cut(node) else 0 :] for node in all_nodes(root)]
    inner -= {id(node) for children in shown for node in children}  # the first operand is read with the tools
    found = {id(node): prism for node in cuts if id(node) not in inner and (prism := as_prism(node)) is not None}
    if not found:
        return root
    derive_facts(union(*found.values()))  # of all at once

    def made(node: Node, children: list[Node]) -> Node:
        if id(node) in found:
            return found[id(node)]
        return node if all(map(is_, children, node.children)) else replaced(node, tuple(children))

    return folded(root, made)


def _is_cut(node: Node) -> bool:
    return node.name == "difference" and not node.params and node.dimension == 3


@remembered
def as_prism(node: Node) -> Node | None:
    """A hard difference of solids with all tools that go through the first one as parts of one prism; None without.

    The solid and the tools are boxes, cylinders and extrusions along one axis, placed and united. They may depend on
    parameters where these do not tilt the axis. Tools that end in the solid, and others, cut the prism as before.
    """
    found = _united(node)
    if found is None:
        return None
    base, tools = _operands(node)
    made, others = at_line_of(node, found[0]), found[1]
    if node.labelled:
        if base.label is None or base.children[0].labelled or any(tool.labelled for tool in tools):
            return at_line_of(node, intersection(node, made))  # the first operand alone tells the material
        made = at_line_of(node, with_label(made, base.label))
    return at_line_of(node, difference(made, *others)) if others else made


def _operands(node: Node) -> tuple[Node, list[Node]]:
    """The solid that a difference, and those that are its first operands, cut, and all tools."""
    tools = list[Node]()
    while _is_cut(node):
        found = [part for tool in node.children[1:] for part in (flattened(tool) if _is_union(tool) else [tool])]
        node, tools = node.children[0], [*found, *tools]
    return node, tools


def _is_union(node: Node) -> bool:
    return node.name == "union" and not node.params


@remembered
def _united(node: Node) -> tuple[Node, list[Node]] | None:
    """Of a difference: the prism of the solid and the tools that go through it, and the other tools; None without.

    Of several axes, the one along which most tools go through.
    """
    base, tools = _operands(node)
    found = [each for frame in _frames(base) if (each := _along(base, tools, frame)) is not None]
    return min(found, key=lambda each: len(each[1])) if found else None


def _frames(node: Node) -> Iterator[Array]:
    """The axes along which the first shape of a solid is a prism: each the last column of a rotation, or reflection,
    which turns the shape back."""
    matrix = np.eye(3)
    while node.children and node.definition not in AXES:
        if (placed := affine_of(node)) is not None:
            matrix = placed[2] * placed[0] @ matrix
        node = node.children[0]
    left, _, right = np.linalg.svd(matrix)
    for axis in AXES.get(node.definition, ()):
        yield np.roll((left @ right).T, 2 - axis, axis=1)


def _along(base: Node, tools: Sequence[Node], frame: Array) -> tuple[Node, list[Node]] | None:
    """The same along the last column of a frame."""
    cutting = [_prisms(tool, frame) for tool in tools]
    solid = _prisms(base, frame) if any(cutting) else []
    if not solid or any((each.centre, each.height) != (solid[0].centre, solid[0].height) for each in solid):
        return None
    sections, others = list[Node](), list[Node]()
    for tool, parts in zip(tools, cutting, strict=True):
        if parts and all(part.goes_through(solid[0]) for part in parts):
            sections += [part.section for part in parts]
        else:
            others.append(tool)
    if not sections:
        return None
    flat = difference(union(*[each.section for each in solid]), *sections)
    made = straight_extrusion(flat, solid[0].height)
    made = made if _is_zero(solid[0].centre) else translate(made, vec3(0.0, 0.0, solid[0].centre))
    turn = np.block([[frame.T, np.zeros((3, 1))], [np.eye(4)[3]]])  # for row vectors
    return (made if np.array_equal(frame, np.eye(3)) else transform(made, turn)), others


def _prisms(node: Node, frame: Array, depth: int = 0) -> list[Prism]:
    """The prisms along an axis that a node unites; none for other nodes.

    frame : its columns are two directions of the plane of the sections, and the axis. depth : number of nodes above.
    """
    if depth == DEEPEST:
        return []
    if node.definition in AXES:
        return _prism(node, frame)
    if _is_union(node):
        each = [_prisms(child, frame, depth + 1) for child in flattened(node)]
        return [prism for some in each for prism in some] if all(each) else []
    if _is_cut(node):
        found = _united(node)
        return [] if found is None or found[1] else _prisms(found[0], frame, depth + 1)
    if (offset := offset_of(node)) is not None:
        by = _components(offset, frame)
        return [prism.moved(by) for prism in _prisms(node.children[0], frame, depth + 1)]
    if (placed := affine_of(node)) is not None:
        matrix, shift, factor = placed
        inner = factor * matrix @ frame
        if not np.allclose(inner.T @ inner, np.eye(3), rtol=0.0, atol=ALIGNED):
            return []
        by = [const(value) for value in (-factor * inner.T @ shift).tolist()]
        return [prism.scaled(factor).moved(by) for prism in _prisms(node.children[0], inner, depth + 1)]
    if node.definition is definition_of(rotate_about) and node.params["axis"].is_constant:
        axis = np.asarray(node.params["axis"].data, np.float64)
        along = float(axis @ frame[:, 2] / np.linalg.norm(axis))
        if abs(along) < 1.0 - ALIGNED**2:
            return []
        angle = node.params["angle"] * float(np.sign(along * np.linalg.det(frame)))
        return [prism.turned(angle) for prism in _prisms(node.children[0], frame, depth + 1)]
    return []


def _components(vector: Expr, frame: Array) -> list[Expr]:
    """The components of a vector along the columns of a frame."""
    terms = [[(c, part) for c, part in zip(column, vector, strict=True) if c] for column in frame.T.tolist()]
    return [sum((c * part for c, part in each), const(0.0)) for each in terms]


def _prism(shape: Node, frame: Array) -> list[Prism]:
    """A shape as a prism along the last column of a frame, if it is one."""
    *across, axis = np.argsort(np.abs(frame[:, 2])).tolist()
    if axis not in AXES[shape.definition] or np.abs(frame[across, 2]).max() > ALIGNED:
        return []
    centre = const(0.0)
    if shape.definition is definition_of(cylinder):
        return [Prism(circle(shape.params["radius"]), centre, shape.params["height"])]
    if shape.definition is definition_of(box):
        first, second = sorted(across, key=lambda i: -abs(frame[i, 0]))  # turned by 45 degrees at most
        x, y = frame[first, :2] * np.sign(frame[first, 0])
        size = list(shape.params["size"])
        made = Prism(rectangle(vec2(size[first], size[second])), centre, size[axis])
    else:
        made = Prism(shape.children[0], centre, shape.params["height"])
        x, y = frame[0, :2]
        if np.linalg.det(frame[:2, :2]) < 0.0 and "y" not in shape.children[0].facts.symmetry:
            made = replace(made, section=transform(made.section, np.diag([1.0, -1.0, 1.0])))
    angle = float(np.arctan2(y, x))
    return [made.turned(angle) if abs(angle) > ALIGNED else made]
