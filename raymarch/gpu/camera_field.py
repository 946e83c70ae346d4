"""The field at the camera, from which all rays start: evaluated in float64 on the CPU."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raymarch.expr.arrays import bound, evaluator
from raymarch.expr.function import Function
from raymarch.expr.raw import without_twin
from raymarch.expr.tables import LiveTable
from raymarch.expr.walk import find, substitute
from raymarch.plan import Plan
from raymarch.scene.parameter import Values
from raymarch.sdf.facts import beyond

CHEAP = 120
"""Up to so many operations a field is evaluated at the camera in each frame: in about .3 ms. Others are evaluated at
the points of a lattice, and bounded at the camera."""

NEAR = 16.0
"""The value at a point of the lattice is at least so many times the length that is subtracted from it at the camera: a
sixteenth of the first step of a ray at most, in place of an evaluation of the field in each frame."""

TRIES = 5
"""So many lattices are tried, the coarsest first, before the field is evaluated at the camera."""

FINER = 3
"""A lattice has cells of an eighth of those of the last one at least: of a field that is bounded far from its solid, as
that of a repetition, a point of a coarse lattice tells little of the camera, and fine cells are soon left."""

AROUND = np.stack(np.meshgrid(*[(0, -1, 1)] * 3, indexing="ij"), axis=-1).reshape(27, 3)
"""A point of a lattice, and its neighbours. All are evaluated at once, about the next point on the camera's way: it
will pass some of them, and 27 points take hardly longer than one."""

KEPT = 64
"""Maximum number of evaluations of such points that are kept."""

UNKNOWN = {"u_side": 1.0, "u_start": (0.0, 0.0, 0.0, 0.0)}


class CameraField:
    """The field at the camera, for the uniforms `u_side` and `u_start`.

    A certified field is no larger than the distance to the solid. So from a point at which it has the value v, any
    camera within a way w < v is free by v - w, and on the same side. The point is that of a lattice which the camera's
    place alone determines: pictures do not depend on earlier frames.

    plan : of the scene. Raw GLSL cannot be evaluated here; rays then start without knowledge.
    """

    def __init__(self, plan: Plan) -> None:
        self._plan = plan
        self._functions: list[Function] = []
        start, marched = plan.seen or plan.field, plan.analytic.rest
        if not without_twin(start.body):
            self._functions = [start] if marched is None else [start, marched]
        self._known: dict[tuple[int, ...], tuple[float, NDArray[np.float64]]] = {}
        self._before: dict[int, NDArray[np.float64]] = {}
        """The last point that was not known, of each lattice."""
        self._values: bytes = b""
        self._last: tuple[Any, dict[str, Any]] = None, UNKNOWN
        self.evaluated = 0
        """Number of evaluations so far."""

    @cached_property
    def lattice(self) -> bool:
        """True if the field is evaluated at the points of a lattice: it is certified, costly, and constant in time."""
        if self._plan.operations <= CHEAP or self._plan.scene.node.exactness == "estimate":
            return False
        names, timed = self._reads
        return not (timed or self._live or any(name in self._plan.hoisted for name in names))

    def uniforms(self, values: Values, position: NDArray[np.float64], step: float) -> dict[str, Any]:
        """The uniforms of a frame. values : with hoisted ones. step : length of the differences for the gradient.

        u_side is -1 inside the solid, else 1. u_start is the gradient and the value of the field, both times u_side.
        The value is rounded down, so that float32 certifies no more than float64. Outside of all solids it is that of
        the field through which rays are marched: without the parts that are hit in closed form.
        """
        if not self._functions:
            return UNKNOWN
        asked = self._read(values), position.tobytes(), step
        if self._live or asked != self._last[0]:
            self._last = asked, self._now(values, position, step)
        return self._last[1]

    def _now(self, values: Values, position: NDArray[np.float64], step: float) -> dict[str, Any]:
        self._forget_other(values)
        with bound(values.params, values.time):
            found, gradient = self._near(position, step) if self.lattice else self._exact(position, step)
        side = -1.0 if found < 0.0 else 1.0
        gradient = side * gradient
        if not np.all(np.isfinite([*gradient, found])):
            return UNKNOWN | {"u_side": side}
        value = abs(found) * (1.0 - 1e-6) - 1e-6 * float(np.abs(position).max())
        return {"u_side": side, "u_start": (*gradient.tolist(), max(value, 0.0))}

    def _exact(self, point: NDArray[np.float64], step: float) -> tuple[float, NDArray[np.float64]]:
        """The value at a point, and the gradient."""
        (value,), (gradient,) = self._at(point[None], step)
        return float(value), gradient

    def _at(self, points: NDArray[np.float64], step: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The values at some points, (n, 3), and the gradients."""
        self.evaluated += 1
        placed = np.concatenate([points[:, None], points[:, None] + step * np.eye(3)], axis=1)
        whole, *rest = (np.broadcast_to(v, 4 * len(points)) for v in self._evaluate(placed.reshape(-1, 3)))
        found = whole.reshape(-1, 4)
        if rest:
            found = np.where(found[:, :1] < 0.0, found, rest[0].reshape(-1, 4))
        with np.errstate(divide="ignore", invalid="ignore"):  # an empty solid is infinitely far away
            return found[:, 0], (found[:, 1:] - found[:, :1]) / step

    @cached_property
    def _evaluate(self) -> Callable[..., tuple[Any, ...]]:
        """The whole field and the marched one, which have most operations in common."""
        (param,) = self._functions[0].params
        others = [substitute([f.body], dict(zip(f.params, [param], strict=True)))[0] for f in self._functions[1:]]
        return evaluator([self._functions[0].body, *others], [param])

    def _near(self, position: NDArray[np.float64], step: float) -> tuple[float, NDArray[np.float64]]:
        """A bound at the camera with the sign of the field, and the gradient near it."""
        level = self._coarsest(position)
        for _ in range(TRIES):
            cell = 2.0**level
            index = np.round(position / cell)
            key = (level, *index.astype(int).tolist())
            if key not in self._known:
                self._add(level, index, step)
            value, gradient = self._known[key]
            farthest = 0.5 * math.sqrt(3.0) * cell
            if abs(value) >= NEAR * farthest:
                way = float(np.linalg.norm(position - index * cell)) * (1.0 + 1e-12)
                return math.copysign(abs(value) - way, value), gradient
            least = abs(value) - farthest  # at the camera
            fits = math.floor(math.log2(least / farthest * cell / NEAR)) if least > 0.0 else level - FINER
            level = min(level - 1, max(fits, level - FINER))
        return self._exact(position, step)

    def _add(self, level: int, index: NDArray[np.float64], step: float) -> None:
        """Evaluate the field at a point of a lattice and its neighbours."""
        while len(self._known) >= KEPT * len(AROUND):
            del self._known[next(iter(self._known))]
        near = index + np.clip(index - self._before.get(level, index), -1.0, 1.0) + AROUND
        self._before[level] = index
        values, gradients = self._at(near * 2.0**level, step)
        for at, value, gradient in zip(near.astype(int).tolist(), values.tolist(), gradients, strict=True):
            self._known.setdefault((level, *at), (value, gradient))

    def _forget_other(self, values: Values) -> None:
        """Forget all points if a parameter that the field reads has changed."""
        now = self._read(values)
        if now != self._values:
            self._known.clear()
            self._values = now

    def _read(self, values: Values) -> bytes:
        """The values of the parameters that the field reads, and of time if it does."""
        names, timed = self._reads
        return b"".join(np.asarray(values.params[name]).tobytes() for name in names) + (b"%a" % values.time) * timed

    @cached_property
    def _reads(self) -> tuple[list[str], bool]:
        """The names of the parameters that the field reads; hoisted ones are of time. Whether it reads time itself."""
        found = find([function.body for function in self._functions], "param", "time")
        return [node.data.name for node in found if node.op == "param"], any(node.op == "time" for node in found)

    @cached_property
    def _live(self) -> bool:
        """True if the field reads tables of other parameters."""
        found = find([function.body for function in self._functions], "fetch")
        return any(isinstance(node.data, LiveTable) for node in found)

    def _coarsest(self, position: NDArray[np.float64]) -> int:
        """The exponent of the first lattice: its cells fit if the field is the distance to the scene's box."""
        facts, (_, scale) = self._plan.scene.node.facts, self._plan.scene.middle
        away = float(np.linalg.norm(beyond(facts.lower, facts.upper, position))) if facts.bounded else 0.0
        return math.ceil(math.log2(max(away, 0.25 * scale) / (NEAR * 0.5 * math.sqrt(3.0))))
