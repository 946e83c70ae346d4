"""The surface of a scene as a closed triangle mesh: marching cubes in the blocks that may contain the surface.

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
from raymarch.expr.arrays import bound, evaluator
from raymarch.expr.raw import without_twin
from raymarch.scene.parameter import Values
from raymarch.scene.scene import Scene
from raymarch.sdf.lower import lower
from raymarch.sdf.node import Node
from raymarch.truth.field import Field

Array = NDArray[Any]
Progress = Callable[[float], None]

BLOCK = 16
"""Cells along an edge of a block. Smaller ones rule out more space, and cost more calls."""

BATCH = 1 << 15
"""Points that are evaluated at once."""

SNAP = 1e-3
"""Least absolute value of the field at a grid point, in cells: vertices then keep this distance from grid points, so
that they are distinct in float32."""

LARGEST = 2048
"""Maximum number of cells along the longest edge."""


@dataclass(frozen=True, slots=True)
class Surface:
    """A closed triangle mesh.

    Attributes
    ----------
    vertices : (N, 3) float64, in scene units. normals : (N, 3), unit, outward. faces : (M, 3) int64, counter-clockwise
        seen from outside. colors : (N, 3), linear RGB from 0 to 1.
    cell : length of the edge of a cell. The mesh is at most half the diagonal of a cell away from smooth surfaces.
        Sharp edges and corners are cut off by up to 1.2 cells.
    blocks, sampled : numbers of blocks of cells in the box, and of those that were sampled.
    """

    vertices: NDArray[np.float64]
    normals: NDArray[np.float64]
    faces: NDArray[np.int64]
    colors: NDArray[np.float64]
    cell: float
    blocks: int
    sampled: int


def surface_of(
    scene: Scene,
    values: Values,
    cells: int,
    box: tuple[Array, Array] | None = None,
    progress: Progress | None = None,
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
    vertices, faces = _marched(solid, first, cell, blocks, progress)
    if not len(faces):
        raise SceneError(
            "the mesh is empty: no point of the grid lies inside the solid",
            legal="a solid in the box, or more cells",
            where=scene.node.where,
        )
    count = int(np.prod(-(-shape // BLOCK)))
    normals, colors = _attributes(scene, values, solid, vertices, faces, cell)
    return Surface(vertices, normals, faces, colors, cell, count, len(blocks))


def _box_of(node: Node, box: tuple[Array, Array] | None) -> tuple[Array, Array]:
    """The box to sample: the given one, within the bounds of the solid."""
    low, high = node.bounds
    if box is not None:
        low, high = np.maximum(low, box[0]), np.minimum(high, box[1])
    if np.any(low >= high):
        raise SceneError(
            "the solid is empty" if box is None else "the solid has no part in the box",
            legal="a solid with a volume",
            where=node.where,
        )
    if not np.all(np.isfinite([low, high])):
        endless = _endless(node)
        raise SceneError(
            f"{endless.name} is unbounded, and a mesh is finite",
            legal="a bounded solid, or a box: --box X,Y,Z:X,Y,Z",
            where=endless.where or node.where,
        )
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
            raise SceneError(
                "a mesh of a GLSL node without a NumPy function",
                legal="glsl_node(..., twin=a function from points (N, 3) to distances (N,))",
                where=node.where,
            )
        self._node, self._values = node, values
        pad = 0.0 if clipped else 0.5 * cell
        self.middle, self.half = (low + high) / 2, (high - low) / 2 + pad
        self.lipschitz = max(1.0, node.lipschitz)
        self._single = evaluator([field.body], field.params, np.float32)
        self._double = evaluator([field.body], field.params)

    def outside(self, points: Array) -> Array:
        """Distance by which the points are outside the box in the maximum norm; negative inside."""
        return np.max(np.abs(points - self.middle) - self.half, axis=-1)

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
            near = [np.abs(np.maximum(solid.distance(part), solid.outside(part))) <= reach for part in parts]
            blocks = blocks[np.concatenate(near)]
        if size == 1:
            return blocks[np.lexsort(blocks.T[::-1])]
        size //= 2
        children = np.array(list(product((0, 1), repeat=3)))
        blocks = (2 * blocks[:, None, :] + children).reshape(-1, 3)


def _marched(
    solid: _Solid, first: Array, cell: float, blocks: Array, progress: Progress | None
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Vertices and faces of the surface in some blocks.

    Each grid point is evaluated once, so that blocks agree on its value, and vertices on the faces between blocks are
    the same grid edges: vertices are joined by the number of their edge.
    """
    try:
        from skimage.measure import marching_cubes
    except ImportError:
        raise SceneError("meshes need the package scikit-image", legal="pip install 'raymarch[mesh]'") from None
    if not len(blocks):
        return np.zeros((0, 3)), np.zeros((0, 3), np.int64)
    numbering = np.max(blocks, axis=0) * BLOCK + BLOCK + 2
    keys: list[Array] = []
    places: list[Array] = []
    triangles: list[Array] = []
    before = 0
    for block, values in _values_of_blocks(solid, first, cell, blocks, progress):
        if values.min() > 0.0 or values.max() < 0.0:
            continue
        corners, faces, _, _ = marching_cubes(values, 0.0, gradient_direction="descent")
        corner = np.floor(corners)
        across = corners != corner
        # an edge along an axis, or (3) the centre of a cell, which some cases need
        axis = np.where(across.sum(axis=1) == 1, np.argmax(across, axis=1), 3)
        index = corner.astype(np.int64) + block * BLOCK
        keys.append(((index[:, 0] * numbering[1] + index[:, 1]) * numbering[2] + index[:, 2]) * 4 + axis)
        places.append(corners.astype(np.float64) + block * BLOCK)
        triangles.append(faces.astype(np.int64) + before)
        before += len(corners)
    if not keys:
        return np.zeros((0, 3)), np.zeros((0, 3), np.int64)
    _, chosen, joined = np.unique(np.concatenate(keys), return_index=True, return_inverse=True)
    vertices = first + cell * np.concatenate(places)[chosen]
    return vertices, joined[np.concatenate(triangles)]


def _values_of_blocks(
    solid: _Solid, first: Array, cell: float, blocks: Array, progress: Progress | None
) -> Iterator[tuple[Array, NDArray[np.float32]]]:
    """Each block with its values in cells at all its grid points, (BLOCK + 1) along each edge.

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
            yield np.array(block), values
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
    found[near] = np.where(found[near] < 0.0, np.float32(-SNAP), np.float32(SNAP))
    return found


def _attributes(
    scene: Scene, values: Values, solid: _Solid, vertices: Array, faces: Array, cell: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Normals from the gradient, of the box where that clips the solid, and linear colours of the materials."""
    field = Field(scene, values)
    normals, colors = np.empty_like(vertices), np.empty_like(vertices)
    for i in range(0, len(vertices), BATCH):
        part, points = slice(i, i + BATCH), vertices[i : i + BATCH]
        gradient = field.gradient(points)
        away = points - solid.middle
        beyond = np.abs(away) - solid.half
        cut = np.max(beyond, axis=1) > field.distance(points)
        axis = np.argmax(beyond, axis=1)
        gradient[cut] = np.eye(3)[axis[cut]] * np.sign(away[np.arange(len(away)), axis])[cut, None]
        normals[part] = gradient
    normals[:] = _unit(normals, vertices, faces)
    for i in range(0, len(vertices), BATCH):
        part = slice(i, i + BATCH)
        colors[part] = np.clip(_colors(field, vertices[part], normals[part], cell), 0.0, 1.0)
    return normals, colors


def _unit(gradient: Array, vertices: Array, faces: Array) -> Array:
    """Unit normals; where the gradient vanishes, from the faces around the vertex."""
    size = np.linalg.norm(gradient, axis=1)
    flat = size < 1e-12
    if np.any(flat):
        gradient[flat] = _face_normals(vertices, faces)[flat]
        size[flat] = np.maximum(np.linalg.norm(gradient[flat], axis=1), 1e-300)
    return gradient / size[:, None]


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
