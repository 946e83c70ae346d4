"""The columns of a form, numbers of an object that do not depend on the point, and how they lie in a row."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from raymarch.expr.arrays import Remembered, evaluator, evaluator_of
from raymarch.expr.derivative import companion
from raymarch.expr.function import Function
from raymarch.expr.node import Expr, const, construct, swizzle, var
from raymarch.expr.types import FLOAT
from raymarch.expr.vocabulary import columns
from raymarch.expr.walk import depends_on, find, substitute, topological

if TYPE_CHECKING:
    from raymarch.sdf.rows import Form

Array: TypeAlias = NDArray[np.float64]


def _invariant(roots: Sequence[Expr], point: Expr, leaves: Sequence[Expr]) -> list[Expr]:
    """The largest subexpressions that depend on leaves, but not on the point."""
    moving, own = depends_on(roots, [point]), depends_on(roots, leaves)
    found: dict[Expr, None] = {}
    for node in topological(roots):
        if node in moving or node not in own:
            found.update((arg, None) for arg in node.args if arg in own and arg not in moving and node in moving)
    found.update((root, None) for root in roots if root in own and root not in moving)
    return list(found)


class Columns:
    """The columns of a form and its field as a function of them.

    field : float field(vec3 p, columns...).
    known : what replaces a subexpression over the leaves: a column, or a constant if all objects have the same value.
    """

    def __init__(self, form: Form, lowered: Function, roots: Sequence[Expr]) -> None:
        (self.point,) = lowered.params
        self.form = form
        self.live = tuple(find(roots, "param", "time"))
        """The parameters and time, on which some columns depend."""
        fixed = _invariant(roots, self.point, [*form.leaves, *self.live])
        changing = {e for e in fixed if self.live and find([e], "param", "time")}  # also inside of functions
        self.known: dict[Expr, Expr] = {}
        made: list[Expr] = []
        kept: list[Expr] = []
        values: list[Array] = []
        for node, value in zip(fixed, self._computed(fixed), strict=True):
            same = None
            if node not in changing:
                if np.all(value == value[:1]):
                    self.known[node] = const(value[0], node.type)
                    continue
                pairs = enumerate(zip(kept, values, strict=True))
                same = next((k for k, (e, v) in pairs if e not in changing and np.array_equal(v, value)), None)
            if same is None:
                kept.append(node)
                values.append(np.ascontiguousarray(value, np.float64))
                made.append(var(f"column {len(made)}", node.type))
            self.known[node] = made[-1 if same is None else same]
        self.params = tuple(made)
        self._values, self.sources = values, kept
        self._now = Remembered(lambda: self._computed(self.sources), self.live)
        self.field = self.function(lowered.name, lowered.body, lowered)

    def _computed(self, nodes: Sequence[Expr]) -> list[Array]:
        """The values of expressions over the leaves for each object, for the bound parameters and time."""
        found = evaluator(nodes, self.form.leaves)(*self.form.numbers) if nodes else ()
        return [np.broadcast_to(v, (len(self.form), *e.type.shape)) for v, e in zip(found, nodes, strict=True)]

    @property
    def values(self) -> Sequence[Array]:
        """The value of each column for each object, shape (n, ...) each, for the bound parameters and time."""
        return self._now() if self.live else self._values

    def function(self, name: str, body: Expr, like: Function | None = None) -> Function:
        """A function of the point and the columns; the body is over the leaves."""
        (replaced,) = substitute([body], self.known)
        where = like.where if like is not None else None
        return Function(name, (self.point, *self.params), replaced, {}, where)

    @cached_property
    def _single(self) -> Callable[..., Any]:
        run = evaluator([self.field.body], self.field.params, np.float32)
        narrow = [column.astype(np.float32) for column in self._values]

        def distance(points: Any, rows: Any) -> Any:
            columns = [column.astype(np.float32) for column in self.values] if self.live else narrow
            return run(points, *(column[rows] for column in columns))[0]

        return distance

    def distance(self, points: Array, rows: Any, dtype: Any = np.float64) -> Array:
        """Distances; points (..., 3) and rows, integers or a slice, are broadcast."""
        if dtype is np.float32:
            return self._single(points, rows)
        (value,) = evaluator_of(self.field)(points, *(column[rows] for column in self.values))
        return np.asarray(value, np.float64)

    def gradient(self, points: Array, rows: Any) -> Array:
        """Gradient and distance, (..., 4)."""
        (value,) = evaluator_of(companion(self.field))(points, *(column[rows] for column in self.values))
        return np.asarray(value, np.float64)


class Packing:
    """Where the columns of a form lie in the texels of one row."""

    def __init__(self, params: Sequence[Expr], extra: int = 0) -> None:
        self.params = params
        self.starts: list[int] = []
        used = 0
        for size in [*(p.type.size**2 if p.type.is_matrix else p.type.size for p in params), *[1] * extra]:
            if size <= 4 and used % 4 + size > 4:
                used += 4 - used % 4  # a vector does not straddle texels
            self.starts.append(used)
            used += size
        self.texels = max(1, -(-used // 4))

    def table(self, values: Sequence[Array], n: int) -> NDArray[np.float32]:
        """The rows, shape (n * texels, 4); matrices by columns."""
        flat = np.zeros((n, 4 * self.texels), np.float32)
        for start, value in zip(self.starts, values, strict=True):
            numbers = np.swapaxes(value, -1, -2).reshape(n, -1) if value.ndim == 3 else value.reshape(n, -1)
            flat[:, start : start + numbers.shape[1]] = numbers
        return flat.reshape(-1, 4)

    def read(self, texels: Sequence[Expr]) -> list[Expr]:
        """The columns as expressions of the texels of a row, and the extra numbers."""
        kinds = [p.type for p in self.params] + [FLOAT] * (len(self.starts) - len(self.params))
        found: list[Expr] = []
        for start, kind in zip(self.starts, kinds, strict=True):
            if kind.is_matrix:
                size = kind.size
                numbers = [swizzle(texels[i // 4], "xyzw"[i % 4]) for i in range(start, start + size * size)]
                found.append(columns(*[construct(*numbers[i * size : (i + 1) * size]) for i in range(size)]))
            else:
                texel, first = texels[start // 4], start % 4
                found.append(swizzle(texel, "xyzw"[first : first + kind.size]) if kind.size < 4 else texel)
        return found
