"""Regular and semiregular polyhedra, all exact.

Each is the convex hull of one vertex and its images under the mirror planes of a cube, a tetrahedron or an icosahedron
(the construction of Wythoff and Coxeter). Three mirror planes bound a chamber of space, and points are folded into it.
In the chamber the solid has one vertex V, an edge from V perpendicular to each mirror plane that does not contain V,
and one face for each corner of the chamber. By symmetry, the surface point nearest to a point of the chamber lies in
the chamber too, so these few pieces determine the distance.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, reduce, wraps
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raymarch.expr.function import Vec3Expr, function
from raymarch.expr.node import Expr, const, swizzle
from raymarch.expr.vocabulary import abs, all_of, dot, length, max, min, sqrt, vec3, where
from raymarch.sdf.definition import cube, shape
from raymarch.sdf.domain import Positive, Scalar
from raymarch.sdf.node import Node

__all__ = ["dodecahedron", "icosahedron", "octahedron", "tetrahedron"]
__all__ += ["cuboctahedron", "icosidodecahedron", "rhombicuboctahedron"]
__all__ += ["truncated_cube", "truncated_octahedron", "truncated_tetrahedron"]
__all__ += ["truncated_dodecahedron", "truncated_icosahedron"]

Floats = NDArray[np.float64]

_GOLDEN = (1.0 + math.sqrt(5.0)) / 2.0
_OBLIQUE = (-0.5 * _GOLDEN, -0.5, 0.5 / _GOLDEN)
"""Normal of the mirror plane of the icosahedron at 36 degrees to x = 0 and 60 degrees to y = 0."""


@function()
def tetrahedral_fold(p: Vec3Expr) -> Expr:
    """The image of p with x >= y >= |z| under the mirrors of the tetrahedron: swaps, and sign changes by pairs."""
    q = where(p.x < 0.0, vec3(-p.x, p.y, -p.z), p)
    q = where(q.y < 0.0, vec3(q.x, -q.y, -q.z), q)
    q = where(q.x < q.y, swizzle(q, "yxz"), q)
    q = where(q.y < abs(q.z), where(q.z < 0.0, vec3(q.x, -q.z, -q.y), swizzle(q, "xzy")), q)
    return where(q.x < q.y, swizzle(q, "yxz"), q)


@function()
def octahedral_fold(p: Vec3Expr) -> Expr:
    """The image of p with x >= y >= z >= 0 under the mirrors of the cube."""
    q = abs(p)
    q = where(q.x < q.y, swizzle(q, "yxz"), q)
    q = where(q.y < q.z, swizzle(q, "xzy"), q)
    return where(q.x < q.y, swizzle(q, "yxz"), q)


@function()
def icosahedral_fold(p: Vec3Expr) -> Expr:
    """The image of p in one of the 120 chambers of the icosahedron. Three reflections in the oblique mirror plane reach
    each of the 15 chambers of an octant."""
    q = abs(p)
    for _ in range(3):
        q = abs(q - 2.0 * min(dot(q, _OBLIQUE), 0.0) * const(_OBLIQUE))
    return q


@dataclass(frozen=True)
class Mirrors:
    """Three mirror planes, given by their unit normals towards the chamber, and the folding of a point into it."""

    fold: Callable[[Expr], Expr]
    normals: tuple[tuple[float, float, float], ...]


_HALF = math.sqrt(0.5)
TETRAHEDRAL = Mirrors(tetrahedral_fold, ((0.0, _HALF, _HALF), (_HALF, -_HALF, 0.0), (0.0, _HALF, -_HALF)))
OCTAHEDRAL = Mirrors(octahedral_fold, ((0.0, 0.0, 1.0), (0.0, _HALF, -_HALF), (_HALF, -_HALF, 0.0)))
ICOSAHEDRAL = Mirrors(icosahedral_fold, ((1.0, 0.0, 0.0), _OBLIQUE, (0.0, 1.0, 0.0)))


@dataclass(frozen=True)
class Solid:
    """A polyhedron whose vertex has equal distances from the mirror planes in `ringed` and lies on the others.

    All lengths are for vertices on the unit sphere.
    """

    mirrors: Mirrors
    ringed: tuple[int, ...]

    @cached_property
    def normals(self) -> Floats:
        return np.array(self.mirrors.normals)

    @cached_property
    def vertex(self) -> Floats:
        distances = [1.0 if i in self.ringed else 0.0 for i in range(3)]
        v = np.linalg.solve(self.normals, distances)
        return v / np.linalg.norm(v) + 0.0

    @property
    def edge(self) -> float:
        """Length of an edge, which joins the vertex and its image in a mirror plane."""
        return 2.0 * float(self.normals[self.ringed[0]] @ self.vertex)

    def faces(self) -> list[tuple[Floats, list[Floats]]]:
        """For each face of the chamber: its outward normal, and for each of its edges there the normal of the edge
        in the face, inwards."""
        found = []
        for i, j in combinations(range(3), 2):
            edges = [k for k in (i, j) if k in self.ringed]
            if not edges or (len(edges) == 1 and np.abs(self.normals[i] @ self.normals[j]) < 1e-9):
                continue  # the vertex lies on the corner of the chamber, or the face is a single edge
            out = np.cross(self.normals[i], self.normals[j])
            out *= np.sign(out @ self.vertex) / np.linalg.norm(out)
            to_centre = out * (out @ self.vertex) - self.vertex
            inward = [to_centre - self.normals[k] * (self.normals[k] @ to_centre) for k in edges]
            found.append((out + 0.0, [t / np.linalg.norm(t) + 0.0 for t in inward]))
        return found

    def vertices(self) -> Floats:
        """All vertices, of shape (N, 3)."""
        known = self.vertex[None]
        while True:
            wider = np.concatenate([known, *[known - 2.0 * np.outer(known @ n, n) for n in self.normals]])
            _, distinct = np.unique(np.round(wider, 6) + 0.0, axis=0, return_index=True)
            if len(distinct) == len(known):
                return known
            known = wider[distinct]

    def reach(self, radius: Any) -> tuple[Expr, Expr]:
        """Bounds, symmetric on each axis."""
        return cube(tuple(self.vertices().max(axis=0)) * radius)

    def distance(self, p: Expr, radius: Scalar) -> Expr:
        """Signed distance for vertices on a sphere of the radius."""
        from_vertex = self.mirrors.fold(p) - const(self.vertex) * radius
        faces = self.faces()
        if len(faces) == len(self.ringed) == 1:
            return self._regular(from_vertex, *faces[0])
        heights = [dot(from_vertex, const(out)) for out, _ in faces]
        to_edges = []
        for k in self.ringed:
            edge = const(self.normals[k])
            to_edges.append(from_vertex - min(dot(from_vertex, edge), 0.0) * edge)
        nearest = reduce(min, [dot(v, v) for v in to_edges])
        for height, (_, inward) in zip(heights, faces, strict=True):
            above = all_of(height > 0.0, *[dot(from_vertex, const(t)) >= 0.0 for t in inward])
            nearest = where(above, height * height, nearest)
        inside = max(*heights)
        return where(inside > 0.0, sqrt(nearest), inside)

    def _regular(self, from_vertex: Expr, out: Floats, inward: Sequence[Floats]) -> Expr:
        """The distance to one face with one edge: above the face, beyond the edge or beyond the vertex."""
        edge = self.normals[self.ringed[0]]
        r = vec3(dot(from_vertex, const(out)), dot(from_vertex, const(0.0 - inward[0])), dot(from_vertex, const(edge)))
        return where(r.x > 0.0, length(max(r, 0.0)), r.x)


SOLIDS: dict[str, Solid] = {}
"""The polyhedra, by name."""


def polyhedron(mirrors: Mirrors, *ringed: int) -> Callable[[Callable[[Expr, Scalar], None]], Callable[..., Node]]:
    """Decorator: a name with the first line of its docstring becomes the shape of `Solid(mirrors, ringed)`."""
    solid = Solid(mirrors, ringed)

    def decorate(named: Callable[[Expr, Scalar], None]) -> Callable[..., Node]:
        SOLIDS[named.__name__] = solid

        @wraps(named)
        def field(p: Expr, radius: Scalar) -> Expr:
            return solid.distance(p, radius)

        field.__doc__ = f"""{named.__doc__}

        radius : distance of the vertices from the origin, > 0; an edge is {solid.edge:.3f} times as long.
        """
        symmetry = "" if mirrors is TETRAHEDRAL else "xyz"
        return shape(exactness="exact", bounds=solid.reach, symmetry=symmetry, convex=True)(field)

    return decorate


@polyhedron(TETRAHEDRAL, 0)
def tetrahedron(p: Expr, radius: Positive = 1.0) -> None:
    """Regular tetrahedron; its vertices are four corners of a cube, one in the direction (1, 1, 1)."""


@polyhedron(OCTAHEDRAL, 2)
def octahedron(p: Expr, radius: Positive = 1.0) -> None:
    """Regular octahedron; its vertices lie on the axes."""


@polyhedron(ICOSAHEDRAL, 0)
def dodecahedron(p: Expr, radius: Positive = 1.0) -> None:
    """Regular dodecahedron: twelve pentagons."""


@polyhedron(ICOSAHEDRAL, 2)
def icosahedron(p: Expr, radius: Positive = 1.0) -> None:
    """Regular icosahedron: twenty triangles."""


@polyhedron(TETRAHEDRAL, 0, 1)
def truncated_tetrahedron(p: Expr, radius: Positive = 1.0) -> None:
    """Tetrahedron with its corners cut off: four triangles, four regular hexagons."""


@polyhedron(OCTAHEDRAL, 0, 1)
def truncated_cube(p: Expr, radius: Positive = 1.0) -> None:
    """Cube with its corners cut off: eight triangles, six regular octagons."""


@polyhedron(OCTAHEDRAL, 1, 2)
def truncated_octahedron(p: Expr, radius: Positive = 1.0) -> None:
    """Octahedron with its corners cut off: six squares, eight regular hexagons. Its copies fill space."""


@polyhedron(OCTAHEDRAL, 1)
def cuboctahedron(p: Expr, radius: Positive = 1.0) -> None:
    """Cube cut off at the midpoints of its edges: eight triangles, six squares."""


@polyhedron(OCTAHEDRAL, 0, 2)
def rhombicuboctahedron(p: Expr, radius: Positive = 1.0) -> None:
    """Cube whose edges and corners are cut off: eight triangles, eighteen squares."""


@polyhedron(ICOSAHEDRAL, 0, 1)
def truncated_dodecahedron(p: Expr, radius: Positive = 1.0) -> None:
    """Dodecahedron with its corners cut off: twenty triangles, twelve regular decagons."""


@polyhedron(ICOSAHEDRAL, 1, 2)
def truncated_icosahedron(p: Expr, radius: Positive = 1.0) -> None:
    """Icosahedron with its corners cut off, the football: twelve pentagons, twenty regular hexagons."""


@polyhedron(ICOSAHEDRAL, 1)
def icosidodecahedron(p: Expr, radius: Positive = 1.0) -> None:
    """Icosahedron cut off at the midpoints of its edges: twenty triangles, twelve pentagons."""
