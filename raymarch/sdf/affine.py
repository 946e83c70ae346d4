"""Affine maps: matrices of numbers, and of expressions of time and parameters."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raymarch.errors import SceneError
from raymarch.expr.convert import holdable, numbers, short
from raymarch.expr.evaluate import Program
from raymarch.expr.intervals import INTERVALS, interval_of
from raymarch.expr.node import Expr, const, var
from raymarch.expr.types import FLOAT
from raymarch.expr.vocabulary import abs, acos, clamp, columns, cos, cross, dot, max, sqrt, vec2, vec3
from raymarch.expr.walk import find, substitute
from raymarch.sdf.definition import Child, definition_of, operator
from raymarch.sdf.domain import Matrix3, MatrixLike, Positive, Vec3, as_operand
from raymarch.sdf.node import Node, method
from raymarch.sdf.placing import spread_through, translate
from raymarch.sdf.regions import Motion

Array = NDArray[np.float64]

ROUNDING = 1e-6
"""Relative error of a smallest stretch in float32."""


@operator(
    exactness=lambda child, linear: "exact" if _is_rigid(linear) else "bound",
    spread=lambda child, linear, stretch: child.spread * spread_through(linear) / stretch,
    convex=True,
    motion=lambda child, linear, offset: Motion(linear, offset),
    dimension="any",
    called="transform",
    placing=lambda child, linear: "scale" if _is_rigid(linear, 1e-12) else "stretch",
)
def affine(p: Expr, child: Child, linear: Matrix3, inverse: Matrix3, offset: Vec3, stretch: Positive) -> Expr:
    """The affine map x -> linear x + offset. `stretch` is the smallest singular value of `linear`."""
    return stretch * child(inverse @ (p - offset))


def _is_rigid(linear: Expr, tolerance: float = 8 * np.finfo(np.float64).eps) -> bool:
    """A rotation or reflection times one factor: all singular values agree to rounding. False where the matrix is not
    known, as in a form that many objects share."""
    if not linear.is_constant:
        return False
    values = np.linalg.svd(linear.data, compute_uv=False)
    return bool(values[0] - values[-1] <= tolerance * values[0])


@operator(
    exactness="bound",
    bounds=lambda child, linear: linear @ child.box,
    spread=lambda child, linear, stretch: child.spread * spread_through(linear) / stretch,
    dimension="any",
    called="transform",
    placing="stretch",
)
def linear_map(p: Expr, child: Child, linear: Matrix3, stretch: Positive, inverse: Matrix3) -> Expr:
    """The linear map x -> linear x of a matrix that changes. `stretch` is at most its smallest singular value."""
    return stretch * child(inverse @ p)


@method
def transform(node: Node, matrix: MatrixLike) -> Node:
    """Apply an affine matrix.

    Parameters
    ----------
    matrix : shape (4, 4), for row vectors as pyrr makes them: (x, y, z, 1) @ matrix, so the last row holds the
        offset and the last column is (0, 0, 0, 1). It may rotate, scale, shear and reflect, but not flatten:
        its smallest singular value scales distances. A rotation with one factor keeps exactness. For a flat shape
        the same in the plane: shape (3, 3), (x, y, 1) @ matrix. Elements may be expressions of `time` and of
        parameters with a range; such a matrix gives a bound, unless only its offset changes.

    Returns
    -------
    Node

    Raises
    ------
    SceneError : arguments of another kind or outside their range.

    Examples
    --------
    >>> node = rm.sphere(1).transform([[1, 0, 0, 0], [0, 2, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    >>> node.bounds[1]
    array([1., 2., 1.])
    >>> pulse = 1.0 + 0.5 * rm.sin(rm.time)
    >>> rm.sphere(1).transform([[1, 0, 0, 0], [0, pulse, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]).bounds[1]
    array([1. , 1.5, 1. ])
    """
    n = node.dimension if isinstance(node, Node) else 3
    rows = _rows(matrix, n)
    if rows is None:
        return _constant(node, matrix, n)
    (*linear, offset) = rows
    if all(row.is_constant for row in linear):
        fixed = np.zeros((n + 1, n + 1))
        fixed[:n, :n], fixed[n, n] = [row.data for row in linear], 1.0
        return translate(_constant(node, fixed, n), offset)
    made = _changing(node, linear)
    return made if offset.is_constant and not np.any(offset.data) else translate(made, offset)


def _rows(matrix: Any, n: int) -> list[Expr] | None:
    """The rows of a matrix with expressions, without its last column; None for a matrix of numbers.

    SceneError for another shape or another last column.
    """
    try:
        if not any(isinstance(row, Expr) or any(isinstance(each, Expr) for each in row) for row in matrix):
            return None
        listed = [list(row) for row in matrix]
    except TypeError:
        return None
    legal = f"{n + 1}x{n + 1} finite numbers, or expressions of time and parameters"
    if [len(row) for row in listed] != [n + 1] * (n + 1):
        sizes = " + ".join(str(len(row)) for row in listed)
        raise SceneError(f"transform: a matrix of {len(listed)} rows with {sizes} elements", legal=legal)
    made = [[as_operand("transform: matrix", each, legal) for each in row] for row in listed]
    if any(each.type is not FLOAT for row in made for each in row):
        raise SceneError(f"transform: matrix = {short(matrix)}", legal=legal)
    for row in made:
        if wrong := [each for each in row if each.is_constant and not np.isfinite(each.data)]:
            raise SceneError(f"transform: an element of the matrix is {_shown(wrong[0])}", legal=legal)
    last = [row[n] for row in made]
    if not _is_corner(last):
        swapped = _is_corner(made[n])
        hint = "for column vectors, it seems: pass its transpose" if swapped else "not affine"
        raise SceneError(
            f"transform: last column ({', '.join(map(_shown, last))}), {hint}",
            legal=f"last column ({', '.join('0' * n)}, 1)",
        )
    vector = vec2 if n == 2 else vec3
    return [vector(*row[:n]) for row in made]


def _is_corner(elements: Sequence[Expr]) -> bool:
    """True for the last column of an affine matrix."""
    *zeros, one = elements
    return all(each.is_constant for each in elements) and not any(e.data for e in zeros) and bool(one.data == 1.0)


def _shown(element: Expr) -> str:
    return f"{float(element.data):g}" if element.is_constant else "an expression"


def _constant(node: Node, matrix: Any, n: int) -> Node:
    """A node under a matrix of numbers."""
    corner = [0.0] * n + [1.0]
    m = numbers("transform: matrix", matrix, f"{n + 1}x{n + 1} finite numbers")
    if m.shape != (n + 1, n + 1) or not holdable(m):
        what = f"transform: a matrix of shape {m.shape}, values {short(m.tolist())}"
        raise SceneError(what, legal=f"{n + 1}x{n + 1} finite numbers")
    if not np.array_equal(m[:, n], corner):
        for_columns = np.array_equal(m[n], corner)
        hint = "for column vectors, it seems: pass its transpose" if for_columns else "not affine"
        shown = f"({', '.join(f'{v:g}' for v in corner)})"
        raise SceneError(f"transform: last column {m[:, n].tolist()}, {hint}", legal=f"last column {shown}")
    linear = m[:n, :n].T
    singular = np.linalg.svd(linear, compute_uv=False)
    if singular[-1] <= 1e-12 * singular[0] or singular[-1] == 0.0:
        what = f"transform: singular matrix, its stretches are {singular.tolist()}"
        raise SceneError(what, legal="an invertible matrix")
    mapped = isinstance(node, Node) and node.definition is definition_of(affine)
    inner = node.params if mapped else {}
    if mapped and all(each.is_constant for each in inner.values()):
        both = linear @ inner["linear"].data
        if np.linalg.cond(both) < 1e12:  # one map has a closer bound than two
            whole = np.eye(n + 1)
            whole[:n, :n], whole[n, :n] = both.T, linear @ inner["offset"].data + m[n, :n]
            return _constant(node.children[0], whole, n)
    return affine(node, linear, np.linalg.inv(linear), m[n, :n], float(singular[-1]))


def _changing(node: Node, rows: Sequence[Expr]) -> Node:
    """A node under a matrix of expressions, whose rows are the columns for column vectors."""
    low, high = smallest_stretch(rows)
    inverse, estimate = inverted(rows)
    if low <= 0.0 and not find(rows, "time"):
        unranged = [leaf.data.name for leaf in find(rows, "param") if leaf.data.min is None or leaf.data.max is None]
        cure = f"; Param {unranged[0]!r} needs min= and max=" if unranged else ""
        raise SceneError(
            f"transform: a matrix whose smallest stretch is between 0 and {high:.3g}",
            legal=f"a matrix that flattens nothing, for all values of its parameters{cure}",
        )
    least = low * (1.0 - ROUNDING)
    stretch = max(estimate, least) if np.isinf(high) else clamp(estimate, least, high)
    return linear_map(node, columns(*rows), stretch, inverse)


def inverted(vectors: Sequence[Expr]) -> tuple[Expr, Expr]:
    """The inverse of the matrix with these columns, and at most its smallest singular value.

    The singular value is the root of the smallest eigenvalue of A'A in closed form (Smith 1961), less what rounding may
    add to it, or |det A| / |adj A| with the Frobenius norm, whichever is larger.
    """
    if len(vectors) == 2:
        (a, c), (b, d) = vectors
        rows, determinant = [vec2(d, -b), vec2(-c, a)], a * d - b * c
    else:
        x, y, z = vectors
        rows = [cross(y, z), cross(z, x), cross(x, y)]
        determinant = dot(x, rows[0])
    parts = [vec2(*column) if len(column) == 2 else vec3(*column) for column in zip(*rows, strict=True)]
    inverse = columns(*[part / determinant for part in parts])  # vectors are hoisted, matrices are not
    size = sum((dot(row, row) for row in rows), const(0.0))
    below = abs(determinant) / sqrt(size)
    mean = sum((dot(v, v) for v in vectors), const(0.0)) / len(vectors)
    least = max(_least_eigenvalue(vectors, mean) - ROUNDING * mean, 0.0)
    return inverse, max(sqrt(least), below * (1.0 - ROUNDING))


def _least_eigenvalue(vectors: Sequence[Expr], mean: Expr) -> Expr:
    """Of A'A, whose diagonal has this mean."""
    square = [[dot(a, b) for b in vectors] for a in vectors]
    if len(vectors) == 2:
        half = 0.5 * (square[0][0] - square[1][1])
        return mean - sqrt(half * half + square[0][1] * square[0][1])
    a, b, c = (square[i][i] - mean for i in range(3))
    u, v, w = square[1][2], square[0][2], square[0][1]
    p = sqrt(max((a * a + b * b + c * c + 2.0 * (u * u + v * v + w * w)) / 6.0, 1e-30))
    half = 0.5 * (a * (b * c - u * u) - w * (w * c - u * v) + v * (w * u - b * v)) / (p * p * p)
    return mean + 2.0 * p * cos(acos(clamp(half, -1.0, 1.0)) / 3.0 + 2.0 * math.pi / 3.0)


PIECES, ROUNDS = 4096, 40
"""Largest number of pieces of the ranges of parameters and angles, and of their bisections."""

CLOSE = 0.95
"""Share of the smallest stretch that its lower bound reaches, if enough pieces are allowed."""


def smallest_stretch(vectors: Sequence[Expr]) -> tuple[float, float]:
    """Bounds of the smallest singular value of the matrix with these columns, over all values of time and parameters.

    Sines and cosines of one angle without a range share it: an angle from 0 to 2 pi. The ranges of angles and of
    parameters are bisected. In each piece the matrix is M + E with |E| <= R by intervals, and by Weyl's inequality its
    singular values are those of M within the Frobenius norm of R. The lower bound is 0 or less if none is found.
    """
    entries, inputs, start, end = _sources([each for vector in vectors for each in vector])
    program, size = Program(entries, inputs, INTERVALS), len(vectors)

    def over(start: Array, end: Array) -> tuple[Array, Array]:
        with np.errstate(all="ignore"):
            found = program(*[(start[:, i], end[:, i]) for i in range(len(inputs))])
        low, high = (np.stack([np.broadcast_to(each[k], len(start)) for each in found], axis=1) for k in (0, 1))
        known = np.isfinite(low).all(axis=1) & np.isfinite(high).all(axis=1)
        low, high = np.where(known[:, None], low, 0.0), np.where(known[:, None], high, 0.0)
        middle = (0.5 * (low + high)).reshape(-1, size, size)
        apart = np.where(known, np.linalg.norm(0.5 * (high - low), axis=1), np.inf)
        least = np.linalg.svd(middle, compute_uv=False)[:, -1]
        return least - apart, least + apart

    bottom, top = over(start, end)
    for _ in range(ROUNDS if len(inputs) else 0):
        wanted = CLOSE * np.maximum(top.min(), 0.0)
        open_ = bottom < wanted
        if not np.any(open_) or len(bottom) + open_.sum() > PIECES:
            break
        at, to = start[open_], end[open_]
        middle = 0.5 * (at + to)
        widest = np.arange(at.shape[1]) == np.argmax(to - at, axis=1)[:, None]
        at, to = (
            np.concatenate([at, np.where(widest, middle, at)]),
            np.concatenate([np.where(widest, middle, to), to]),
        )
        halves = over(at, to)
        start, end = np.concatenate([start[~open_], at]), np.concatenate([end[~open_], to])
        bottom, top = np.concatenate([bottom[~open_], halves[0]]), np.concatenate([top[~open_], halves[1]])
    return float(np.maximum(bottom.min(), 0.0)), float(top.max())


def _sources(entries: Sequence[Expr]) -> tuple[list[Expr], list[Expr], Array, Array]:
    """Entries of a matrix as functions of numbers with a finite range, these numbers, and the ends of their ranges."""
    angles: dict[Expr, Expr] = {}
    for wave in find(entries, "sin", "cos"):
        (angle,) = wave.args
        if not np.all(np.isfinite(interval_of(angle))) and angle.type is FLOAT:
            angles.setdefault(angle, var(f"angle {len(angles)}", FLOAT))
    entries = substitute(entries, angles)
    ends = dict.fromkeys(angles.values(), (0.0, 2.0 * math.pi))
    for leaf in find(entries, "param"):
        low, high = leaf.data.ends
        if leaf.type is FLOAT and np.isfinite(low) and np.isfinite(high):
            ends[leaf] = float(low), float(high)
    inputs = list(ends)
    given = np.array([ends[each] for each in inputs]).reshape(-1, 2)
    return entries, inputs, given[None, :, 0], given[None, :, 1]
