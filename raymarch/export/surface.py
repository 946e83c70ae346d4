"""The surface of a scene as a closed triangle mesh: dual contouring in the blocks that may contain the surface.

A field that changes by at most L times the length of a step has no zero in a ball of radius r around a point where its
absolute value exceeds L r. Blocks are halved until they have `BLOCK` cells along an edge; those that this rules out are
not sampled.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raymarch.errors import SceneError
from raymarch.export.dual import contour
from raymarch.export.thin import left_out, watched
from raymarch.expr.arrays import bound, evaluator
from raymarch.expr.raw import without_twin
from raymarch.scene.parameter import Values
from raymarch.scene.scene import Scene
from raymarch.sdf.evaluation import lower
from raymarch.sdf.node import Node
from raymarch.truth.field import Field
from raymarch.truth.large import field_of

Array = NDArray[Any]
Progress = Callable[[float], None]

BLOCK = 16
"""Cells along an edge of a block. Smaller ones rule out more space, and cost more calls."""

BATCH = 1 << 15
"""Points that are evaluated at once."""

SNAP = 1e-3
"""Least absolute value of the field at a grid point, in cells, so that float32 and float64 agree on its sign."""

AROUND = 10.0 * SNAP * np.array([(0.2, 0.55, 0.81), (0.2, -0.55, -0.81), (-0.2, 0.55, -0.81), (-0.2, -0.55, 0.81)])
"""Places around such a point, in cells: on both sides of each plane through it, and none in a plane of grid points."""

NEAR = 1e-12
"""A zero on an edge of the grid is found if the absolute value of the field there is at most this, in cells, or 8 units
in the last place of the coordinates."""

CREASE = 0.9
"""A vertex where the gradient's cosine to the mean normal of the faces around is less lies on a sharp edge or corner,
and takes the mean normal."""

LARGEST = 2048
"""Maximum number of cells along the longest edge."""


@dataclass(frozen=True, slots=True, repr=False)
class Surface:
    """A closed triangle mesh.

    vertices : (N, 3) float64, in scene units. normals : (N, 3), unit, outward. faces : (M, 3) int64, counter-clockwise
        seen from outside. colors : (N, 3), linear RGB from 0 to 1.
    cell : length of the edge of a cell. The mesh is at most half the diagonal of a cell away from the surface, except
        for parts that are thinner than a cell. Vertices lie on sharp edges and corners.
    blocks, sampled : numbers of blocks of cells in the box, and of those that were sampled.
    deviation : largest distance of vertices and middles of triangles, of up to 20,000 of each, from the surface.
    missed : (N, 3), points of the surface that are a cell or more away from the triangles: of parts and gaps thinner
        than a cell. Not sought for a field that is only an estimate.
    """

    vertices: NDArray[np.float64]
    normals: NDArray[np.float64]
    faces: NDArray[np.int64]
    colors: NDArray[np.float64]
    cell: float
    blocks: int
    sampled: int
    deviation: float
    missed: NDArray[np.float64]

    def __repr__(self) -> str:
        return f"<mesh: {len(self.faces):,} triangles, off the surface by up to {self.deviation:.2g}>"

    @property
    def bounds(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Corners of the smallest box around the mesh. `node.bounds` is a box around the solid, often a larger one."""
        return self.vertices.min(axis=0), self.vertices.max(axis=0)

    @property
    def area(self) -> float:
        """The area of the triangles."""
        return float(np.sum(np.linalg.norm(self._across, axis=1)) / 2)

    @property
    def volume(self) -> float:
        """The volume inside the triangles."""
        return float(np.sum(self._parts) / 6)

    @property
    def centroid(self) -> NDArray[np.float64]:
        """The centre of mass of the inside, at an even density."""
        corners = self._corners.sum(axis=1)
        return self.vertices.mean(axis=0) + corners.T @ self._parts / (4 * np.sum(self._parts))

    @property
    def _corners(self) -> NDArray[np.float64]:
        """The corners of the triangles (M, 3, 3), relative to the mean of the vertices, where sums lose least."""
        return (self.vertices - self.vertices.mean(axis=0))[self.faces]

    @property
    def _across(self) -> NDArray[np.float64]:
        """The normals of the triangles, as long as twice their areas."""
        a, b, c = self._corners.transpose(1, 0, 2)
        return np.asarray(np.cross(b - a, c - a))

    @property
    def _parts(self) -> NDArray[np.float64]:
        """Six times the signed volumes of the tetrahedra between the triangles and the mean of the vertices."""
        return np.asarray(np.einsum("ij,ij->i", self._corners[:, 0], self._across))


CHECKED = 20_000
"""Triangles and vertices at which the deviation of a mesh is measured."""


def surface_of(
    scene: Scene, values: Values, cells: int, box: tuple[Array, Array] | None = None, progress: Progress | None = None
) -> Surface:
    """The surface of a scene.

    cells : cells along the longest edge of the box. box : (lower, upper) to which the solid is clipped; None is its
    bounds. progress : called with the fraction done, 0 to 1.
    Raises SceneError for a solid without bounds, an empty one, and a field that has no NumPy function or is NaN.
    """
    lower_corner, upper_corner = _box_of(scene.node, box)
    cell = float(np.max(upper_corner - lower_corner)) / cells
    solid = _Solid(scene.node, values, lower_corner, upper_corner, cell, clipped=box is not None)
    shape = np.ceil((upper_corner - lower_corner) / cell - 1e-9).astype(np.int64) + 2  # one cell around the box
    first = (lower_corner + upper_corner) / 2 - cell * shape / 2
    blocks = _blocks_near_surface(solid, first, shape, cell)
    field = field_of(scene, values)

    def tangents(starts: Array, axes: Array, ends: Array) -> tuple[Array, Array]:
        found = _zeros(solid, first, cell, starts, axes, ends)
        return (found - first) / cell, _gradients(field, solid, found)

    def nearby(points: Array) -> tuple[Array, Array]:
        return _linear(field, solid, first + cell * points, cell)

    near: list[Array] = []
    sampled = watched(_values_of_blocks(solid, first, cell, blocks, progress), solid.lipschitz, near)
    mesh = contour(sampled, tangents, nearby)
    vertices, faces = first + cell * mesh.vertices, mesh.faces
    certain = scene.node.exactness != "estimate"
    thin = first + cell * left_out(near, mesh.vertices, nearby) if certain else np.empty((0, 3))
    if not len(faces):
        return Surface(vertices, vertices, faces, vertices, cell, 0, len(blocks), np.inf, thin)
    count = int(np.prod(-(-shape // BLOCK)))
    normals = _normals(_gradients(field, solid, vertices), mesh.normals, vertices, faces)
    colors = np.empty_like(vertices)
    for i in range(0, len(vertices), BATCH):
        part = slice(i, i + BATCH)
        colors[part] = np.clip(_colors(field, vertices[part], normals[part], cell), 0.0, 1.0)
    middles = vertices[faces[:: 1 + len(faces) // CHECKED]].mean(axis=1)
    checked = np.concatenate([middles, vertices[:: 1 + len(vertices) // CHECKED]])
    deviation = float(np.max(_distances(field, solid, checked)))
    return Surface(vertices, normals, faces, colors, cell, count, len(blocks), deviation, thin)


def _box_of(node: Node, box: tuple[Array, Array] | None) -> tuple[Array, Array]:
    """The box to sample: the given one, within the bounds of the solid."""
    low, high = node.bounds
    if box is not None:
        low, high = np.maximum(low, box[0]), np.minimum(high, box[1])
    if np.any(low >= high):
        what = "the solid is empty" if box is None else "the solid has no part in the box"
        raise SceneError(what, legal="a solid with a volume", where=node.where)
    if not np.all(np.isfinite([low, high])):
        endless = _endless(node)
        what = f"{endless.name} is unbounded, and a mesh is finite"
        raise SceneError(what, legal="a bounded solid, or a box: --box X,Y,Z:X,Y,Z", where=endless.where or node.where)
    return low, high


def _endless(node: Node) -> Node:
    """The part that makes a solid unbounded: the deepest one without an unbounded child."""
    while True:
        part = next((c for c in node.children if c.dimension == 3 and not c.facts.bounded and not c.facts.empty), None)
        if part is None:
            return node
        node = part


class _Solid:
    """The field of a solid, clipped to a box: by the user, or half a cell outside its bounds."""

    def __init__(self, node: Node, values: Values, low: Array, high: Array, cell: float, clipped: bool) -> None:
        field = lower(node)
        if without_twin(field.body):
            what = "a mesh of a GLSL node without a NumPy function"
            legal = "glsl_node(..., twin=a function from points (N, 3) to distances (N,))"
            raise SceneError(what, legal=legal, where=node.where)
        self._node, self._values = node, values
        pad = 0.0 if clipped else 0.5 * cell
        self.middle, self.half = (low + high) / 2, (high - low) / 2 + pad
        self.lipschitz = max(1.0, node.lipschitz)
        coarse = float(np.spacing(np.float32(np.max(np.abs([low, high]))))) > SNAP * cell  # far from the origin
        self._double = evaluator([field.body], field.params)
        self._single = self._double if coarse else evaluator([field.body], field.params, np.float32)

    def outside(self, points: Array) -> Array:
        """Distance by which the points are outside the box in the maximum norm; negative inside."""
        return np.max(np.abs(points - self.middle) - self.half, axis=-1)

    def clipped(self, points: Array) -> Array:
        """The field, clipped to the box."""
        return np.maximum(self.distance(points), self.outside(points))

    def distance(self, points: Array, dtype: type[np.floating[Any]] = np.float64) -> Array:
        """The field, not clipped; points (N, 3) float64 -> (N,)."""
        run = self._double if dtype is np.float64 else self._single
        with bound(self._values.params, self._values.time):
            found = np.broadcast_to(run(points)[0], len(points))
        if np.isnan(found).any():
            where = points[np.isnan(found)][0]
            raise SceneError(
                f"the field of {self._node.name} is NaN at {where.tolist()}", legal="a number", where=self._node.where
            )
        return found


def _blocks_near_surface(solid: _Solid, first: Array, shape: Array, cell: float) -> Array:
    """The indices (N, 3) of the blocks that the Lipschitz bound cannot rule out, in order of x, y and z."""
    count = -(-shape // BLOCK)
    size = 1 << int(np.max(count) - 1).bit_length() if np.max(count) > 1 else 1
    blocks = np.zeros((1, 3), np.int64)
    while True:
        edge = size * BLOCK * cell
        blocks = blocks[np.all(blocks * size < count, axis=1)]
        if np.isfinite(solid.lipschitz):
            # by a thousandth longer, for rounding and for vertices on the faces of blocks
            reach = 1.001 * solid.lipschitz * edge * np.sqrt(3.0) / 2
            parts = np.array_split(first + (blocks + 0.5) * edge, 1 + len(blocks) // BATCH)
            near = [np.abs(solid.clipped(part)) <= reach for part in parts]
            blocks = blocks[np.concatenate(near)]
        if size == 1:
            return blocks[np.lexsort(blocks.T[::-1])]
        size //= 2
        children = np.array(list(product((0, 1), repeat=3)))
        blocks = (2 * blocks[:, None, :] + children).reshape(-1, 3)


def _values_of_blocks(
    solid: _Solid, first: Array, cell: float, blocks: Array, progress: Progress | None
) -> Iterator[tuple[Array, NDArray[np.float32]]]:
    """The first point of each block, and its values in cells at all its points, (BLOCK + 1) along each edge.

    A block owns the points of its cells' lower corners; those of its upper faces belong to the next blocks. Only two
    layers of blocks are in memory.
    """
    wanted = {tuple(block) for block in blocks.tolist()}
    steps = tuple(product((0, 1), repeat=3))
    owners = {tuple(a + b for a, b in zip(block, step, strict=True)) for block in wanted for step in steps}
    by_layer: dict[int, list[tuple[int, ...]]] = {}
    for owner in sorted(owners):
        by_layer.setdefault(owner[0], []).append(owner)
    layers: dict[int, dict[tuple[int, ...], NDArray[np.float32]]] = {}
    own = np.stack(np.meshgrid(*[np.arange(BLOCK)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    faces = own[np.any(own == 0, axis=1)]  # all that blocks before need of a block without a surface
    done = 0
    for x in sorted({block[0] for block in wanted}):
        for layer in (x, x + 1):
            if layer not in layers:
                layers[layer] = {}
                whole = [owner for owner in by_layer.get(layer, []) if owner in wanted]
                rest = [owner for owner in by_layer.get(layer, []) if owner not in wanted]
                for group, points in ((whole, own), (rest, faces)):
                    per_call = max(1, BATCH // len(points))
                    for i in range(0, len(group), per_call):
                        some = group[i : i + per_call]
                        found = _sampled(solid, first, cell, np.array(some), points)
                        for owner, row in zip(some, found, strict=True):
                            store = np.empty((BLOCK,) * 3, np.float32)
                            store[tuple(points.T)] = row
                            layers[layer][owner] = store
        for block in [block for block in by_layer[x] if block in wanted]:
            values = np.empty((BLOCK + 1,) * 3, np.float32)
            for step in steps:
                owner = tuple(a + b for a, b in zip(block, step, strict=True))
                to = tuple(slice(BLOCK, None) if s else slice(0, BLOCK) for s in step)
                of = tuple(slice(0, 1) if s else slice(None) for s in step)
                values[to] = layers[owner[0]][owner][of]
            yield BLOCK * np.array(block), values
            done += 1
        if progress is not None:
            progress(done / len(wanted))
        del layers[x]


def _sampled(solid: _Solid, first: Array, cell: float, blocks: Array, points: Array) -> NDArray[np.float32]:
    """The field in cells at some points of some blocks, (blocks, points), none of them closer to 0 than `SNAP`."""
    at = first + cell * (blocks[:, None, :] * BLOCK + points)
    found: Array = solid.distance(at.reshape(-1, 3), np.float32).reshape(len(blocks), -1) / np.float32(cell)
    middles = first + cell * BLOCK * (blocks + 0.5)
    clipped = solid.outside(middles) > -cell * BLOCK / 2  # the others lie inside the box
    found[clipped] = np.maximum(found[clipped], solid.outside(at[clipped]) / cell)
    np.clip(found, -1e6, 1e6, out=found)
    near = np.abs(found) < SNAP
    found[near] = np.where(_inside(solid, at[near], cell, found[near] < 0.0), np.float32(-SNAP), np.float32(SNAP))
    return found


def _inside(solid: _Solid, points: Array, cell: float, inside: Array) -> Array:
    """Whether points at which the field is 0, but for rounding, are inside the solid: as what is around them, if that
    lies on one side. There two solids touch, or what is cut ends at the face of the tool, and no film is left."""
    around = solid.clipped((points[:, None, :] + cell * AROUND).reshape(-1, 3)).reshape(len(points), len(AROUND)) < 0.0
    return np.where(inside, around.any(axis=1), around.all(axis=1))


def _zeros(solid: _Solid, first: Array, cell: float, starts: Array, axes: Array, ends: Array) -> NDArray[np.float64]:
    """The zeros of the clipped field on some edges of the grid, by the Illinois variant of regula falsi.

    starts : the lower ends as indices. ends : the values at both ends in cells, of different signs.
    """
    origin = first + cell * starts
    ahead = cell * np.eye(3)[axes]
    low, high = np.zeros(len(starts)), np.ones(len(starts))
    low_value, high_value = ends[:, 0].astype(np.float64), ends[:, 1].astype(np.float64)
    at = low_value / (low_value - high_value)
    side = np.zeros(len(starts), np.int8)
    rows = np.arange(len(starts))
    near = max(NEAR, 8 * np.finfo(np.float64).eps * float(np.max(np.abs(origin), initial=0.0)) / cell)
    for _ in range(30):
        found = np.concatenate(
            [
                solid.clipped(origin[part] + at[part, None] * ahead[part]) / cell
                for part in np.array_split(rows, 1 + len(rows) // BATCH)
            ]
        )
        going = np.abs(found) > near
        rows, found = rows[going], found[going]
        if not len(rows):
            break
        is_low = (found < 0.0) == (low_value[rows] < 0.0)
        for chosen, end, value, other, sign in (
            (is_low, low, low_value, high_value, 1),
            (~is_low, high, high_value, low_value, -1),
        ):
            moved = rows[chosen]
            end[moved], value[moved] = at[moved], found[chosen]
            again = moved[side[moved] == sign]
            other[again] *= 0.5  # an end that stays for two turns counts half
            side[moved] = sign
        at[rows] = low[rows] + (high[rows] - low[rows]) * low_value[rows] / (low_value[rows] - high_value[rows])
    return origin + at[:, None] * ahead


def _gradients(field: Field, solid: _Solid, points: Array) -> NDArray[np.float64]:
    """The unit gradients at some points, of the box where that clips the solid; 0 where the field has none."""
    return _linear(field, solid, points, 1.0)[1]


SLOW = 0.7
"""Length of a gradient below which the linear approximation is not trusted: the field may rise faster elsewhere."""

STEPS = 24


def _distances(field: Field, solid: _Solid, points: Array) -> NDArray[np.float64]:
    """Distances of some points from the surface: the absolute value of the field over the length of its gradient. Where
    that is short, the least of this and of the ways along the gradient, by steps as long as the value of the field."""
    linear, directions = _linear(field, solid, points, 1.0)
    found = np.abs(linear)
    rows = np.flatnonzero(np.abs(solid.clipped(points)) < SLOW * found)
    at, directions = points[rows].copy(), directions[rows]
    for _ in range(STEPS if len(rows) else 0):
        at -= solid.clipped(at)[:, None] * directions
        linear, directions = _linear(field, solid, at, 1.0)
        found[rows] = np.minimum(found[rows], np.linalg.norm(at - points[rows], axis=1) + np.abs(linear))
    return found


def _linear(field: Field, solid: _Solid, points: Array, cell: float) -> tuple[Array, Array]:
    """The values of the clipped field in cells over the length of its gradient, and the unit gradients."""
    distances, found = np.empty(len(points)), np.empty_like(points)
    for i in range(0, len(points), BATCH):
        part = points[i : i + BATCH]
        gradient, value = field.gradient(part), field.distance(part)
        away = part - solid.middle
        beyond = np.abs(away) - solid.half
        cut = np.max(beyond, axis=1) > value
        axis = np.argmax(beyond, axis=1)
        gradient[cut] = np.eye(3)[axis[cut]] * np.sign(away[np.arange(len(away)), axis])[cut, None]
        size = np.linalg.norm(gradient, axis=1)
        flat = size < 1e-12
        size[flat] = 1.0
        gradient[flat] = 0.0
        distances[i : i + BATCH] = np.where(cut, np.max(beyond, axis=1), value) / (size * cell)
        found[i : i + BATCH] = gradient / size[:, None]
    return distances, found


def _normals(gradients: Array, sums: Array, vertices: Array, faces: Array) -> NDArray[np.float64]:
    """Unit normals: the gradient; on sharp edges and corners the mean of the faces around the vertex."""
    size = np.linalg.norm(sums, axis=1, keepdims=True)
    flat = size[:, 0] < 1e-6
    if np.any(flat):
        sums[flat] = _face_normals(vertices, faces)[flat]
        size = np.linalg.norm(sums, axis=1, keepdims=True)
    mean = sums / np.maximum(size, 1e-300)
    smooth = np.einsum("ij,ij->i", gradients, mean) > CREASE
    return np.where(smooth[:, None], gradients, mean)


def _colors(field: Field, vertices: Array, normals: Array, cell: float) -> NDArray[np.float64]:
    """Linear base colours; textures are averaged over the size of a cell."""
    helper = np.where(np.abs(normals[:, :1]) < 0.5, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    tangent = np.cross(normals, helper)
    tangent *= cell / np.linalg.norm(tangent, axis=1, keepdims=True)
    found: Mapping[str, Array] = field.material_values(vertices, normals, tangent, np.cross(normals, tangent))
    return np.asarray(found["color"], np.float64)


def _face_normals(vertices: Array, faces: Array) -> NDArray[np.float64]:
    """Sums of the normals of the faces around each vertex, weighted by area."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    total = np.zeros_like(vertices)
    for k in range(3):
        np.add.at(total, faces[:, k], np.cross(b - a, c - a))
    return total
