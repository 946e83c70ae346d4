"""The field of a scene at one moment, in float64: distances, gradients, weights of the materials."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from raymarch.errors import SceneError
from raymarch.expr.arrays import bound, evaluator
from raymarch.expr.derivative import companion, gradient
from raymarch.expr.node import Expr
from raymarch.expr.types import FLOAT
from raymarch.expr.vocabulary import min
from raymarch.expr.walk import depends_on, substitute, topological
from raymarch.scene.material import FIELDS
from raymarch.scene.parameter import Values
from raymarch.scene.scene import Scene
from raymarch.sdf.booleans import balanced
from raymarch.sdf.lower import SEEN, Lowering, look_of, lower
from raymarch.sdf.weights import weights_of

Array: TypeAlias = NDArray[Any]
Evaluate: TypeAlias = Callable[..., tuple[Array, ...]]

BLOCK = 1 << 14
"""Points that are evaluated at once: the arrays of a field of ordinary size then stay in the processor's cache."""

LINEAR = {"var", "add", "sub", "neg", "mul", "div", "dot", "cross", "matmul", "swizzle", "construct"}
"""Operations without kinks and steps. An expression of these whose gradient is constant is affine."""


class Field:
    """The field of a scene with its parameters and time set.

    The field is min(planes, rest): `planes` are the operands of an outermost union that are affine in the point,
    whose roots along a ray are known in closed form; `rest` is all else and may be None. Where there is no
    such operand, `rest` is the whole field.

    Attributes
    ----------
    plane_normals : gradients of the planes, shape (k, 3); k may be 0.
    certified : False for an estimate, of which nothing may be relied on.
    """

    def __init__(self, scene: Scene, values: Values) -> None:
        self._scene, self._values = scene, values
        self.certified = scene.node.exactness != "estimate"
        whole = lower(scene.node)
        p = whole.params[0]
        affine, other = _split(whole.body, p)
        self._whole = evaluator([whole.body], [p])
        self._rest = evaluator([balanced(other, min)], [p]) if other else None
        self._planes = evaluator(affine, [p])
        normals = [values.of(gradient(operand, p)) for operand in affine]
        self.plane_normals: NDArray[np.float64] = np.array(normals, np.float64).reshape(-1, 3)
        slope = companion(whole)
        self._gradient = evaluator([slope.body], slope.params)
        self._marks, self._weights = _material_weights(scene)
        self._looks = evaluator([number for mark in self._marks for number in _numbers_of(look_of(mark))], [p, *SEEN])

    def distance(self, points: Array) -> NDArray[np.float64]:
        """Signed distance; points (N, 3) -> (N,). Raises SceneError where it is NaN."""
        return self._numbers(self._whole, points)[0]

    def rest(self, points: Array) -> NDArray[np.float64]:
        """The distance without the planes, inf where nothing is left; (N, 3) -> (N,)."""
        if self._rest is None:
            return np.full(points.shape[0], np.inf)
        return self._numbers(self._rest, points)[0]

    @property
    def has_rest(self) -> bool:
        """False if the field is one of planes only."""
        return self._rest is not None

    def planes(self, points: Array) -> NDArray[np.float64]:
        """Signed distance to each plane; (N, 3) -> (k, N)."""
        if not self.plane_normals.size:
            return np.empty((0, points.shape[0]))
        return self._numbers(self._planes, points)

    def gradient(self, points: Array) -> NDArray[np.float64]:
        """Gradient of the distance; (N, 3) -> (N, 3). What is not finite is given as 0."""
        (value,) = self._run(self._gradient, points, (4,))
        return np.where(np.isfinite(value[:, :3]).all(axis=1, keepdims=True), value[:, :3], 0.0)

    def material_weights(self, points: Array) -> NDArray[np.float64]:
        """Share of each material of the scene in the surface, >= 0 with sum 1; (N, 3) -> (N, len(materials)).

        The share is |d field / d distance| of the parts made of it. Where no part moves the field at all, the
        surface is made of the default material.
        """
        materials = self._scene.materials
        weights = np.zeros((points.shape[0], len(materials)))
        for mark, share in zip(self._marks, self._run(self._weights, points, ()), strict=True):
            weights[:, materials.index(mark.data)] += np.abs(share)
        total = weights.sum(axis=1)
        weights[~((total > 0.0) & np.isfinite(total))] = np.eye(len(materials))[0]
        return weights / weights.sum(axis=1, keepdims=True)

    @property
    def mapped(self) -> bool:
        """True if looks depend on how the surface is seen."""
        return any(m.textured or m.relief for m in self._scene.materials)

    @property
    def patterned(self) -> bool:
        """True if looks depend on the point where they are asked."""
        return self.mapped or any(m.patterned for m in self._scene.materials)

    def looks(self, points: Array, *frame: Array) -> dict[str, NDArray[np.float64]]:
        """The values of the surface's material, mixed by the weights: by name, (N, 3) -> (N, 1) or (N, 3).

        frame : unit normals and the two axes of the footprint, (N, 3) each; they may be left out if nothing is mapped.
        """
        default = self._scene.materials[0]
        usual = np.array([self._values.of(number) for number in _numbers_of(default.expressions)])
        shape = (len(self._marks), len(usual), len(points))
        weights = np.abs(np.array(self._run(self._weights, points, ()))).reshape(shape[0], shape[2])
        values = np.array(self._run(self._looks, points, (), *(frame or 3 * (points,)))).reshape(shape)
        total = weights.sum(axis=0)
        seen = (total > 0.0) & np.isfinite(total)
        mixed = np.einsum("mn,mkn->nk", np.where(seen, weights, 0.0) / np.where(seen, total, 1.0), values)
        mixed = np.where(seen[:, None], mixed, usual)
        ends = np.cumsum([value.type.size for value in default.expressions])
        return dict(zip(FIELDS, np.split(mixed, ends[:-1], axis=1), strict=True))

    def _numbers(self, evaluate: Evaluate, points: Array) -> NDArray[np.float64]:
        values = self._run(evaluate, points, ())
        stacked: NDArray[np.float64] = np.stack(values)
        if np.isnan(stacked).any():
            where = points[np.isnan(stacked).any(axis=0)][0]
            node = self._scene.node
            raise SceneError(f"the field of {node.name} is NaN at {where.tolist()}", legal="a number", where=node.where)
        return stacked

    def _run(
        self, evaluate: Evaluate, points: Array, shape: tuple[int, ...], *more: Array
    ) -> list[NDArray[np.float64]]:
        """All results at all points, block by block; each has `shape` at each point."""
        blocks = [[v[i : i + BLOCK] for v in (points, *more)] for i in range(0, max(len(points), 1), BLOCK)]
        with bound(self._values.params, self._values.time):
            parts = [[np.broadcast_to(v, (len(b[0]), *shape)) for v in evaluate(*b)] for b in blocks]
        return [np.concatenate(column) for column in zip(*parts, strict=True)]


def _split(root: Expr, p: Expr) -> tuple[list[Expr], list[Expr]]:
    """The operands of an outermost minimum: those that are affine in p, and the others."""
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
    """The expression with the bodies of all functions in place of their calls."""
    while calls := [node for node in topological([part]) if node.op == "call"]:
        (part,) = substitute([part], {call: call.data.inline(*call.args) for call in calls})
    return part


def _is_affine(part: Expr, p: Expr) -> bool:
    moving = depends_on([part], [p])
    if part not in moving or any(node in moving and node.op not in LINEAR for node in topological([part])):
        return False
    return p not in topological([gradient(part, p)])


def _numbers_of(look: Sequence[Expr]) -> list[Expr]:
    """The fields of a material, vectors component by component."""
    return [number for value in look for number in (value if value.type.is_vector else (value,))]


def _material_weights(scene: Scene) -> tuple[list[Expr], Evaluate]:
    """The marked parts, and an evaluator of how much the distance of each moves the field."""
    marked = Lowering().field(scene.node, label=scene.materials[0])
    marks, weights = weights_of(marked)
    return marks, evaluator(weights, marked.params)
