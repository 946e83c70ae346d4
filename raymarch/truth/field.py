"""The field of a scene at one time, in float64: distances, gradients, material weights."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from raymarch.errors import SceneError
from raymarch.expr.arrays import bound, evaluator
from raymarch.expr.derivative import companion, gradient
from raymarch.expr.function import Function
from raymarch.expr.node import Expr, const
from raymarch.expr.types import FLOAT
from raymarch.expr.vocabulary import min
from raymarch.expr.walk import depends_on, substitute, topological
from raymarch.scene.ambient_occlusion import NORMAL, POINT
from raymarch.scene.fields import FIELDS
from raymarch.scene.parameter import Values
from raymarch.scene.reading import passes_zeros, read_as_distance
from raymarch.scene.scene import Scene
from raymarch.sdf.booleans import balanced
from raymarch.sdf.facts import Facts
from raymarch.sdf.interaction import SCENE_INTERACTION, material_expressions
from raymarch.sdf.levels import CORRECTED, least_slope, over_slope
from raymarch.sdf.lower import Lowering
from raymarch.sdf.node import Node
from raymarch.sdf.visibility import hiding_nodes
from raymarch.sdf.weights import weights_of

Array: TypeAlias = NDArray[Any]
Evaluate: TypeAlias = Callable[..., tuple[Array, ...]]

BLOCK = 1 << 14
"""Points evaluated at once: the arrays of a field of ordinary size then stay in the CPU cache."""

LINEAR = {"var", "add", "sub", "neg", "mul", "div", "dot", "cross", "matmul", "swizzle", "construct"}
"""Operations without kinks and steps. An expression of these with a constant gradient is affine."""


class Field:
    """The field of a scene with its parameters and time set.

    The field is min(planes, rest). `planes` are the operands of an outermost union that are affine in the point: their
    roots along a ray have a closed form. `rest` contains all other operands and may be None. Without affine operands,
    `rest` is the whole field.

    plane_normals : gradients of the planes, shape (k, 3); k may be 0.
    certified : False for a field whose exactness is "estimate": its values are not safe steps.
    touches : True if the field may fall to 0 where there is no surface; see `raymarch.scene.reading.passes_zeros`.
    """

    rest_box: Facts | None = None
    """A box outside of which `rest` is above 0, for a field that is asked in it only."""

    def __init__(self, scene: Scene, values: Values, rays: str = "camera", node: Node | None = None) -> None:
        """node : the solid in place of that of the scene, a part of it."""
        self._node = scene.node if node is None else node
        self._scene, self._values, self._rays, self._kinds = scene, values, rays, {rays: self}
        self.certified = self._node.exactness != "estimate"
        self.touches = self.certified and passes_zeros(scene, self._node)
        self._root_of_rays = root = Lowering(rays=rays).field(self._node)
        p = root.params[0]
        affine, other = _split(root.body, p)
        self._root = evaluator([root.body], [p])
        self._rest = evaluator([balanced(other, min)], [p]) if other else None
        self._planes = evaluator(affine, [p])
        normals = [values.of(gradient(operand, p)) for operand in affine]
        self.plane_normals: NDArray[np.float64] = np.array(normals, np.float64).reshape(-1, 3)

    @cached_property
    def _gradient(self) -> Evaluate:
        slope = companion(self._root_of_rays)
        return evaluator([slope.body], slope.params)

    @cached_property
    def _undivided_root(self) -> Function:
        least, node = self._least_slope, read_as_distance(self._scene, self._node)
        if not node.facts.divided and least == 1.0 and node is self._node:
            return self._root_of_rays
        reading = over_slope(node) if least < 1.0 else None
        return Lowering(rays=self._rays, distances=reading).field(node, undivided=True)

    @cached_property
    def _least_slope(self) -> float:
        return least_slope(self._node, CORRECTED)

    def undivided(self, points: Array) -> NDArray[np.float64]:
        """The field before it is divided, and over its slope if that is small: what effects read as the distance.

        (N, 3) -> (N,).
        """
        if self._undivided_root is self._root_of_rays:
            return self.distance(points)
        root = self._undivided_root
        return self._numbers(root.once("evaluate", lambda: evaluator([root.body], root.params)), points)[0]

    @property
    def divisor(self) -> float:
        """By which it is divided for a step, at most."""
        facts = self._node.facts
        return (facts.undivided / facts.lipschitz if facts.divided else 1.0) / self._least_slope

    @cached_property
    def _marked(self) -> tuple[list[Expr], Evaluate]:
        """The parts with materials, and an evaluator of d field / d distance for each."""
        marked = Lowering(rays=self._rays).field(self._node, label=self._scene.materials[0])
        marks, weights = weights_of(marked)
        return marks, evaluator(weights, marked.params)

    @cached_property
    def _materials(self) -> Evaluate:
        numbers = [number for mark in self._marked[0] for number in _numbers_of(material_expressions(mark))]
        return evaluator(numbers, [self._root_of_rays.params[0], *SCENE_INTERACTION])

    def of(self, rays: str) -> Field:
        """The field of a kind of rays, of `raymarch.sdf.visibility.KINDS`."""
        if not hiding_nodes(self._node):
            return self
        if rays not in self._kinds:
            self._kinds[rays] = made = Field(self._scene, self._values, rays, self._node)
            made._kinds = self._kinds
        return self._kinds[rays]

    def distance(self, points: Array) -> NDArray[np.float64]:
        """Signed distance; points (N, 3) -> (N,). Raises SceneError where it is NaN."""
        return self._numbers(self._root, points)[0]

    def rest(self, points: Array) -> NDArray[np.float64]:
        """Distance to everything but the planes, inf if there is nothing else; (N, 3) -> (N,)."""
        if self._rest is None:
            return np.full(points.shape[0], np.inf)
        return self._numbers(self._rest, points)[0]

    @property
    def has_rest(self) -> bool:
        """False if the field consists of planes only."""
        return self._rest is not None

    def planes(self, points: Array) -> NDArray[np.float64]:
        """Signed distance to each plane; (N, 3) -> (k, N)."""
        if not self.plane_normals.size:
            return np.empty((0, points.shape[0]))
        return self._numbers(self._planes, points)

    def gradient(self, points: Array) -> NDArray[np.float64]:
        """Gradient of the distance; (N, 3) -> (N, 3). Gradients that are not finite become 0."""
        (value,) = self._run(self._gradient, points, (4,))
        return np.where(np.isfinite(value[:, :3]).all(axis=1, keepdims=True), value[:, :3], 0.0)

    def ambient_occlusion(self, points: Array, normals: Array, side: float) -> NDArray[np.float64]:
        """Ambient visibility, (N, 3) -> (N,). normals : unit, (N, 3). side : -1 inside the solid, else 1."""
        occlusion = self._scene.ambient_occlusion
        assert occlusion is not None
        visibility = occlusion.visibility(self._undivided_root, const(side))
        return self._run(evaluator([visibility], [POINT, NORMAL]), points, (), normals)[0]

    def material_weights(self, points: Array) -> NDArray[np.float64]:
        """Weight of each material of the scene, >= 0 with sum 1; (N, 3) -> (N, len(materials)).

        The weight is |d field / d distance| summed over the parts with that material. Where all these derivatives are
        0, the default material has weight 1.
        """
        materials = self._scene.materials
        weights = np.zeros((points.shape[0], len(materials)))
        marks, weigh = self._marked
        for mark, weight in zip(marks, self._run(weigh, points, ()), strict=True):
            weights[:, materials.index(mark.data)] += np.abs(weight)
        total = weights.sum(axis=1)
        weights[~((total > 0.0) & np.isfinite(total))] = np.arange(len(materials)) == 0
        return weights / weights.sum(axis=1, keepdims=True)

    @property
    def mapped(self) -> bool:
        """True if material values depend on the normal and the pixel footprint."""
        return any(m.textured or m.relief for m in self._scene.materials)

    @property
    def patterned(self) -> bool:
        """True if material values depend on the point where they are evaluated."""
        return self.mapped or any(m.patterned for m in self._scene.materials)

    def material_values(self, points: Array, *frame: Array) -> dict[str, NDArray[np.float64]]:
        """Material values blended by the material weights: by name, (N, 3) -> (N, 1) or (N, 3).

        frame : unit normals and the two axes of the footprint, (N, 3) each; not needed unless `mapped`.
        """
        default = self._scene.materials[0]
        default_values = np.array([self._values.of(number) for number in _numbers_of(default.expressions)])
        marks, weigh = self._marked
        shape = (len(marks), len(default_values), len(points))
        weights = np.abs(np.array(self._run(weigh, points, ()))).reshape(shape[0], shape[2])
        values = np.array(self._run(self._materials, points, (), *(frame or 3 * (points,)))).reshape(shape)
        total = weights.sum(axis=0)
        blended = (total > 0.0) & np.isfinite(total)
        mixed = np.einsum("mn,mkn->nk", np.where(blended, weights, 0.0) / np.where(blended, total, 1.0), values)
        mixed = np.where(blended[:, None], mixed, default_values)
        ends = np.cumsum([value.type.size for value in default.expressions])
        return dict(zip(FIELDS, np.split(mixed, ends[:-1], axis=1), strict=True))

    def _numbers(self, evaluate: Evaluate, points: Array) -> NDArray[np.float64]:
        values = self._run(evaluate, points, ())
        stacked: NDArray[np.float64] = np.stack(values)
        self._refuse_nan(stacked, points)
        return stacked

    def _refuse_nan(self, values: Array, points: Array) -> None:
        """Raise SceneError if a value, (..., N), is NaN."""
        if np.isnan(values).any():
            where = points[np.isnan(values.reshape(-1, len(points))).any(axis=0)][0]
            node = self._node
            raise SceneError(f"the field of {node.name} is NaN at {where.tolist()}", legal="a number", where=node.where)

    def _run(
        self, evaluate: Evaluate, points: Array, shape: tuple[int, ...], *more: Array
    ) -> list[NDArray[np.float64]]:
        """Evaluate all results at all points in blocks; each result has `shape` at each point."""
        blocks = [[v[i : i + BLOCK] for v in (points, *more)] for i in range(0, max(len(points), 1), BLOCK)]
        with bound(self._values.params, self._values.time):
            parts = [[np.broadcast_to(v, (len(b[0]), *shape)) for v in evaluate(*b)] for b in blocks]
        return [np.concatenate(column) for column in zip(*parts, strict=True)]


def _split(root: Expr, p: Expr) -> tuple[list[Expr], list[Expr]]:
    """Operands of the outermost minimum: the affine ones, and the others."""
    affine: list[Expr] = []
    other: list[Expr] = []
    pending, seen = [root], set[Expr]()
    while pending:
        part = pending.pop()
        if part in seen:
            continue
        seen.add(part)
        if part.op == "min" and part.type is FLOAT:
            pending.extend(reversed(part.args))
            continue
        plain = _inlined(part)
        if _is_affine(plain, p):
            affine.append(plain)
        else:
            other.append(part)
    return affine, other


def _inlined(part: Expr) -> Expr:
    """The expression with all function calls inlined."""
    while calls := [node for node in topological([part]) if node.op == "call"]:
        (part,) = substitute([part], {call: call.data.inline(*call.args) for call in calls})
    return part


def _is_affine(part: Expr, p: Expr) -> bool:
    moving = depends_on([part], [p])
    if part not in moving or any(node in moving and node.op not in LINEAR for node in topological([part])):
        return False
    return p not in topological([gradient(part, p)])


def _numbers_of(fields: Sequence[Expr]) -> list[Expr]:
    """The fields of a material as scalars: vectors are split into components."""
    return [number for value in fields for number in (value if value.type.is_vector else (value,))]
