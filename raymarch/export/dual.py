"""Dual contouring: a closed triangle mesh from the signs of a field on a grid, and its zeros on the grid's edges.

After Ju et al. 2002, "Dual Contouring of Hermite Data". A cell has one vertex for each patch of the surface in it, as
in Nielson 2004, "Dual Marching Cubes", so that the mesh is manifold. The vertex minimises the sum of squared distances
from the tangent planes at the zeros on the cell's edges, so it lies on sharp edges and corners. Each edge of the grid
with a zero has a quadrilateral, whose corners are the vertices of the four cells around it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
Ints = NDArray[np.int64]

FLAT = 0.1
"""Singular values below this fraction of the largest do not count: the vertex stays near the mean of the zeros."""

INSET = 4e-4
"""Least distance of a vertex from the faces of its cell, in cells: vertices of neighbours stay distinct in float32."""

TOLERANCE = 5e-4
"""A vertex is on the surface if its distance is at most this, in cells."""

REACH = 1.0
"""A vertex is no farther from the middle of its cell than this along each axis, in cells."""

TURNS = 5
"""How often tangent planes are added to the vertices that are not on the surface, at most."""

BATCH = 1 << 17
"""Vertices or planes that are treated at once."""

CORNERS: Ints = np.array(list(product((0, 1), repeat=3)))
"""The corners of a cell; corner k is bit k of its case, 1 inside the solid."""


def _edges() -> Ints:
    """The edges of a cell: (axis, offset of the lower end in x, y, z, place of the cell around the edge)."""
    places = [(0, 0), (1, 0), (1, 1), (0, 1)]  # offsets along the next two axes, in turning order about the edge
    found = []
    for axis in range(3):
        for place, (a, b) in enumerate(places):
            offset = [0, 0, 0]
            offset[(axis + 1) % 3], offset[(axis + 2) % 3] = a, b
            found.append((axis, *offset, place))
    return np.array(found)


EDGES = _edges()


def _patches() -> Ints:
    """The number of the patch that crosses each edge of a cell, (256, 12), or -1.

    On a face whose diagonals have different signs, the corners inside the solid are connected. The rule depends on the
    face alone, so that both of its cells agree.
    """
    lower = EDGES[:, 1:4]
    upper = lower + np.eye(3, dtype=np.int64)[EDGES[:, 0]]
    table = np.full((256, 12), -1)
    for case in range(1, 255):
        inside = {tuple(corner): bool(case >> k & 1) for k, corner in enumerate(CORNERS.tolist())}
        crossed = [e for e in range(12) if inside[tuple(lower[e])] != inside[tuple(upper[e])]]
        patch = {e: e for e in crossed}

        def join(group: list[int], patch: dict[int, int] = patch) -> None:
            least = min(patch[e] for e in group)
            old = {patch[e] for e in group}
            for e in patch:
                patch[e] = least if patch[e] in old else patch[e]

        for axis, side in product(range(3), (0, 1)):
            on_face = [e for e in crossed if lower[e][axis] == upper[e][axis] == side]
            if len(on_face) == 2:
                join(on_face)
            elif on_face:  # join the two edges at each corner outside
                for corner in (c for c, is_in in inside.items() if not is_in and c[axis] == side):
                    join([e for e in on_face if corner in (tuple(lower[e]), tuple(upper[e]))])
        numbers = sorted(set(patch.values()))
        for e in crossed:
            table[case, e] = numbers.index(patch[e])
    return table


PATCHES = _patches()
COUNTS: Ints = PATCHES.max(axis=1) + 1


@dataclass(frozen=True, slots=True)
class Dual:
    """A mesh in cells: vertices (N, 3), sums of the unit gradients around them (N, 3), faces (M, 3)."""

    vertices: NDArray[np.float64]
    normals: NDArray[np.float64]
    faces: Ints


def contour(
    blocks: Iterable[tuple[Ints, Array]],
    tangents: Callable[[Ints, Ints, Array], tuple[Array, Array]],
    nearby: Callable[[Array], tuple[Array, Array]],
) -> Dual:
    """The mesh of the zeros in some blocks of a grid.

    blocks : for each block, the index of its first point and the values at its points (n, n, n); neighbours share a
    face of points. Blocks with all zeros must be among them.
    tangents : the zeros on some edges and the unit gradients there, (N, 3) each, from the points (N, 3) where the
    edges start, their axes (N,), and the values at both ends (N, 2).
    nearby : the signed distances of some points (N, 3) from the surface, in the linear approximation, (N,), and the
    unit gradients there, (N, 3).
    """
    edges, values, cells, cases = _collected(blocks)
    if not len(cells):
        return Dual(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3), np.int64))
    places, normals = tangents(edges[:, :3], edges[:, 3], values)
    first = np.concatenate([[0], np.cumsum(COUNTS[cases])])
    strides = np.array([1 << 42, 1 << 21, 1]) * 3
    keys = edges[:, :3] @ strides + edges[:, 3]
    order = np.argsort(keys)
    keys = keys[order]
    quads = np.full((len(edges), 4), -1)
    members: list[Ints] = []
    owners: list[Ints] = []
    for e, (axis, *offset, place) in enumerate(EDGES.tolist()):
        patch = PATCHES[cases, e]
        crossed = np.flatnonzero(patch >= 0)
        wanted = (cells[crossed] + offset) @ strides + axis
        found = order[np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)]
        vertex = first[:-1][crossed] + patch[crossed]
        quads[found, place] = vertex
        members.append(found)
        owners.append(vertex)
    member, owner = np.concatenate(members), np.concatenate(owners)
    cell_of = np.repeat(cells, COUNTS[cases], axis=0)
    quads[values[:, 0] > 0.0] = quads[values[:, 0] > 0.0, ::-1]
    whole = np.all(quads >= 0, axis=1)
    quads, of_edge = quads[whole], np.flatnonzero(whole)
    quads, cell_of, owner = _manifold(quads, of_edge, cell_of, member, owner)
    middle = cell_of.astype(np.float64) + 0.5
    planes = _Planes.of(len(cell_of))
    for i in range(0, len(owner), BATCH):
        plane, vertex = member[i : i + BATCH], owner[i : i + BATCH]
        planes.add(vertex, places[plane] - middle[vertex], normals[plane])
    vertices = middle + _minimisers(middle, planes, nearby)
    return Dual(vertices, planes.normals, _triangles(quads, vertices, normals[of_edge]))


def _collected(blocks: Iterable[tuple[Ints, Array]]) -> tuple[Ints, Array, Ints, Ints]:
    """Edges with a zero (x, y, z, axis) and the values at their ends; cells with a patch, and their cases."""
    edges, values = [np.zeros((0, 4), np.int64)], [np.zeros((0, 2))]
    cells: list[Ints] = [np.zeros((0, 3), np.int64)]
    cases: list[Ints] = []
    for first, block in blocks:
        inside = block < 0.0
        n = len(block) - 1
        own = tuple(slice(0, n) for _ in range(3))
        case = np.zeros((n,) * 3, np.int64)
        for k, corner in enumerate(CORNERS.tolist()):
            case |= inside[tuple(slice(c, n + c) for c in corner)].astype(np.int64) << k
        at = np.nonzero((case > 0) & (case < 255))
        if not len(at[0]):
            continue
        cells.append(np.stack(at, axis=1) + first)
        cases.append(case[at])
        for axis in range(3):
            upper = tuple(slice(int(k == axis), n + int(k == axis)) for k in range(3))
            at = np.nonzero(inside[own] != inside[upper])
            place = np.stack(at, axis=1)
            edges.append(np.column_stack([place + first, np.full(len(place), axis)]))
            values.append(np.stack([block[own][at], block[upper][at]], axis=1))
    joined = np.concatenate(cases) if cases else np.zeros(0, np.int64)
    return np.concatenate(edges), np.concatenate(values), np.concatenate(cells), joined


@dataclass(slots=True)
class _Planes:
    """Sums over the tangent planes of each vertex: n n^T, n (n . p), n and p, and their number; p is relative to the
    middle of the vertex's cell."""

    matrix: Array
    right: Array
    normals: Array
    places: Array
    number: Array

    @classmethod
    def of(cls, count: int) -> _Planes:
        return cls(
            np.zeros((count, 3, 3)), np.zeros((count, 3)), np.zeros((count, 3)), np.zeros((count, 3)), np.zeros(count)
        )

    def add(self, owner: Ints, places: Array, normals: Array) -> None:
        """Add a plane to each of some vertices, which may repeat."""
        count = len(self.number)
        away = np.einsum("ij,ij->i", normals, places)
        self.number += np.bincount(owner, minlength=count)
        for i in range(3):
            self.right[:, i] += np.bincount(owner, normals[:, i] * away, minlength=count)
            self.normals[:, i] += np.bincount(owner, normals[:, i], minlength=count)
            self.places[:, i] += np.bincount(owner, places[:, i], minlength=count)
            for j in range(i, 3):
                self.matrix[:, i, j] += np.bincount(owner, normals[:, i] * normals[:, j], minlength=count)
                self.matrix[:, j, i] = self.matrix[:, i, j]

    def nearest(self, rows: Ints) -> tuple[Array, Array]:
        """For some vertices the point nearest to their planes, and the one of the cell that is nearest to them."""
        matrix = self.matrix[rows]
        mean = self.places[rows] / self.number[rows, None]
        right = self.right[rows] - np.einsum("nij,nj->ni", matrix, mean)
        best = mean + _solved(matrix, right)
        limit = 0.5 - INSET
        inside = best.copy()
        free = np.ones(inside.shape, bool)
        for _ in range(3):  # what would leave the cell stays on its faces, and the rest is solved again
            beyond = (np.abs(inside) > limit) & free
            some = np.flatnonzero(beyond.any(axis=1))
            if not len(some):
                break
            worst = np.argmax(np.where(free[some], np.abs(inside[some]), 0.0), axis=1)
            free[some, worst] = False
            fixed = np.where(free[some], mean[some], np.clip(inside[some], -limit, limit))
            rest = right[some] - np.einsum("nij,nj->ni", matrix[some], fixed - mean[some])
            mask = free[some].astype(float)
            part = matrix[some] * mask[:, :, None] * mask[:, None, :]
            inside[some] = fixed + mask * _solved(part, rest * mask)
        return best, np.clip(inside, -limit, limit)


def _minimisers(middle: Array, planes: _Planes, nearby: Callable[[Array], tuple[Array, Array]]) -> Array:
    """The vertex of each patch: the point nearest to its tangent planes, from the middle of its cell.

    nearby : see `contour`.

    A vertex that is not on the surface gets another plane, the one at the nearest point of the surface: the cell's
    edges may miss the planes of an edge or a corner. A vertex may leave its cell if it is on the surface.
    """
    vertices = np.zeros(middle.shape)
    errors = np.full(len(middle), np.inf)
    rows = np.arange(len(middle))
    for turn in range(TURNS):
        best, inside = np.empty((len(rows), 3)), np.empty((len(rows), 3))
        for i in range(0, len(rows), BATCH):
            best[i : i + BATCH], inside[i : i + BATCH] = planes.nearest(rows[i : i + BATCH])
        distances, gradients = nearby(middle[rows] + inside)
        outside = np.flatnonzero(np.any(best != inside, axis=1) & (np.abs(best).max(axis=1) < REACH))
        if len(outside):
            beyond, their_gradients = nearby(middle[rows[outside]] + best[outside])
            better = np.abs(beyond) < np.minimum(TOLERANCE, np.abs(distances[outside]))
            chosen = outside[better]
            inside[chosen], distances[chosen], gradients[chosen] = best[chosen], beyond[better], their_gradients[better]
        better = np.abs(distances) < errors[rows]
        vertices[rows[better]], errors[rows[better]] = inside[better], np.abs(distances[better])
        off = np.flatnonzero((np.abs(distances) > TOLERANCE) & (np.abs(distances) < REACH))
        if turn == TURNS - 1 or not len(off):
            break
        rows = rows[off]
        foot = inside[off] - distances[off, None] * gradients[off]
        _, across = nearby(middle[rows] + foot)
        planes.add(rows, foot, across)
    return vertices


def _solved(matrix: Array, right: Array) -> Array:
    """Least-squares solutions of symmetric systems (N, 3, 3), without directions in which they are nearly singular."""
    sizes, axes = np.linalg.eigh(matrix)
    used = sizes > FLAT**2 * np.maximum(sizes[:, -1:], 1e-300)
    parts = np.einsum("nji,nj->ni", axes, right) * np.where(used, 1.0 / np.where(used, sizes, 1.0), 0.0)
    return np.einsum("nij,nj->ni", axes, parts)


def _triangles(quads: Ints, vertices: Array, normals: Array) -> Ints:
    """Each quadrilateral as two triangles, by the diagonal whose triangles agree better with the field's normal."""
    best = []
    halves = (((0, 1, 2), (0, 2, 3)), ((1, 2, 3), (1, 3, 0)))
    for pair in halves:
        facing = []
        for corners in pair:
            a, b, c = (vertices[quads[:, k]] for k in corners)
            across = np.cross(b - a, c - a)
            size = np.maximum(np.linalg.norm(across, axis=1), 1e-300)
            facing.append(np.einsum("ij,ij->i", across, normals) / size)
        best.append(np.minimum(*facing))
    first = best[0] >= best[1]
    split = np.where(first[:, None, None], quads[:, halves[0]], quads[:, halves[1]])
    return split.reshape(-1, 3)


def _manifold(quads: Ints, of_edge: Ints, cells: Ints, member: Ints, owner: Ints) -> tuple[Ints, Ints, Ints]:
    """Split vertices until each side belongs to two quadrilaterals, and those around a vertex are one fan.

    Two cells that share a face with four zeros may have one patch each, so that two sides join the same vertices. The
    quadrilaterals around one of the vertices are then split into two fans between these sides, each with a vertex, and
    those around the other one form two fans.
    """
    sides = np.sort(np.stack([quads, np.roll(quads, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    found, times = np.unique(sides[:, 0] * (len(cells) + 1) + sides[:, 1], return_counts=True)
    pairs = np.stack(np.divmod(found[times > 2], len(cells) + 1), axis=1)
    if not len(pairs):
        return quads, cells, owner
    quads, owner = quads.copy(), owner.copy()
    more: list[Ints] = []
    touched = np.unique(pairs)
    around: dict[int, list[int]] = {vertex: [] for vertex in touched.tolist()}
    for row in np.flatnonzero(np.isin(quads, touched).any(axis=1)).tolist():
        for vertex in quads[row].tolist():
            if vertex in around:
                around[vertex].append(row)
    planes = {(int(member[k]), int(owner[k])): k for k in np.flatnonzero(np.isin(owner, touched)).tolist()}

    def split(vertex: int, side: int) -> bool:
        fan = _fan(quads, around[vertex], vertex, side)
        if len(fan) == len(around[vertex]):
            return False
        new = len(cells) + len(more)
        for row in fan:
            quads[row][quads[row] == vertex] = new
            plane = planes.pop((int(of_edge[row]), vertex))
            planes[int(of_edge[row]), new] = plane
            owner[plane] = new
            around[vertex].remove(row)
        around[new] = fan
        more.append(cells[vertex] if vertex < len(cells) else more[vertex - len(cells)])
        return True

    for vertex, side in pairs.tolist():
        split(vertex, side)
    for vertex in list(around):
        while split(vertex, _beside(quads, around[vertex][0], vertex, 1)):
            pass
    return quads, np.concatenate([cells, np.array(more).reshape(-1, 3)]), owner


def _beside(quads: Ints, row: int, vertex: int, step: int) -> int:
    """The corner that follows a vertex in a quadrilateral, or precedes it."""
    corners = quads[row].tolist()
    return int(corners[(corners.index(vertex) + step) % 4])


def _fan(quads: Ints, rows: list[int], a: int, b: int) -> list[int]:
    """The quadrilaterals around a vertex a, in turning order, from one of its sides to b to the next of these sides."""
    fan = [row for row in rows if _beside(quads, row, a, 1) == b][:1]
    while fan and _beside(quads, fan[-1], a, -1) != b:
        side = _beside(quads, fan[-1], a, -1)
        following = [row for row in rows if row not in fan and _beside(quads, row, a, 1) == side]
        if not following:
            break
        fan.append(following[0])
    return fan or rows
