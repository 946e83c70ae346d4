"""Instances: one solid at many places, given as arrays."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from raymarch.conveniences import carried_out_by
from raymarch.errors import SceneError
from raymarch.expr.calls import checked
from raymarch.expr.convert import holdable, numbers, short
from raymarch.expr.node import Expr, const, var
from raymarch.expr.types import FLOAT, MAT3, VEC3
from raymarch.expr.vocabulary import vec3
from raymarch.expr.walk import find
from raymarch.sdf.affine import affine
from raymarch.sdf.definition import shape
from raymarch.sdf.derivation import divisor_of
from raymarch.sdf.domain import Domain
from raymarch.sdf.evaluation import lower
from raymarch.sdf.facts import Facts
from raymarch.sdf.flat import circle
from raymarch.sdf.node import Node, solid
from raymarch.sdf.placing import material, refuse_label, translate
from raymarch.sdf.profiles import extrude
from raymarch.sdf.regions import Turned
from raymarch.sdf.rows import Form, Rows, Slot
from raymarch.sdf.solids import sphere
from raymarch.sdf.values import with_bound
from raymarch.sdf.visibility import hiding_nodes

__all__ = ["instances"]

Array = NDArray[np.float64]

LEGAL = (
    "(N, 3) positions, (N, 4) positions and factors, (N, 6) positions and vectors, (N, 4, 4) matrices for row vectors, "
    "or (N, 3, 4) matrices for column vectors"
)
RIGID = "rotations times one factor > 0, and an offset"


def _placements(transforms: ArrayLike) -> tuple[Array | None, Array]:
    """Linear parts for column vectors, (N, 3, 3), or None for translations; and offsets, (N, 3)."""
    given = numbers("instances: transforms", transforms, LEGAL)
    if given.ndim == 2 and given.shape[1] == 3:
        linear, offsets = None, given
    elif given.ndim == 2 and given.shape[1] == 4:
        linear, offsets = given[:, 3, None, None] * np.eye(3), given[:, :3]
    elif given.ndim == 2 and given.shape[1] == 6:
        linear, offsets = _along(given[:, 3:]), given[:, :3]
    elif given.ndim == 3 and given.shape[1:] == (4, 4):
        if not np.array_equal(given[:, :, 3], np.broadcast_to((0.0, 0.0, 0.0, 1.0), given.shape[:2])):
            row = int(np.argmax(np.any(given[:, :, 3] != (0.0, 0.0, 0.0, 1.0), axis=1)))
            turned = np.array_equal(given[row, 3], (0.0, 0.0, 0.0, 1.0))
            hint = ", for column vectors, it seems: pass its transpose" if turned else ""
            what = f"instances: transforms[{row}] has the last column {given[row, :, 3].tolist()}{hint}"
            raise SceneError(what, legal="last column (0, 0, 0, 1)")
        linear, offsets = np.swapaxes(given[:, :3, :3], 1, 2), given[:, 3, :3]
    elif given.ndim == 3 and given.shape[1:] == (3, 4):
        linear, offsets = given[:, :, :3], given[:, :, 3]
    else:
        raise SceneError(f"instances: transforms of shape {given.shape}", legal=LEGAL)
    if not len(given):
        raise SceneError("instances: no transforms", legal="one or more")
    if not holdable(given):
        row = int(np.argmax(~np.isfinite(given.reshape(len(given), -1)).all(axis=1)))
        raise SceneError(f"instances: transforms[{row}] = {short(given[row].tolist())}", legal="finite numbers")
    return linear, np.ascontiguousarray(offsets)


def _along(vectors: Array) -> Array:
    """The matrices (N, 3, 3) that turn the y axis along some vectors by the shortest way, times their lengths."""
    lengths = np.linalg.norm(vectors, axis=1)
    if np.any(lengths == 0.0):
        row = int(np.argmax(lengths == 0.0))
        raise SceneError(
            f"instances: the vector of transforms[{row}] is 0", legal="vectors with a length: leave it out"
        )
    with np.errstate(invalid="ignore"):
        x, y, z = (vectors / lengths[:, None]).T
        wide = np.hypot(x, z)
        a, b = np.where(wide > 0.0, (x, z) / np.where(wide > 0.0, wide, 1.0), [[1.0], [0.0]])
    less = 1.0 - y  # about the horizontal axis at right angles to (a, b)
    turned = np.stack([1 - a * a * less, x, -a * b * less, -x, y, -z, -a * b * less, z, 1 - b * b * less], axis=1)
    return lengths[:, None, None] * turned.reshape(-1, 3, 3)


def _factors(linear: Array) -> Array:
    """The scale of each matrix, (N,). SceneError for one that is no rotation times a factor."""
    squared = np.einsum("nki,nkj->nij", linear, linear)
    factors = np.sqrt(np.trace(squared, axis1=1, axis2=2) / 3.0)
    off = np.abs(squared - (factors**2)[:, None, None] * np.eye(3)).max(axis=(1, 2))
    wrong = ~((factors > 0.0) & (off <= 1e-6 * factors**2) & (np.linalg.det(linear) > 0.0))
    if wrong.any():
        row = int(np.argmax(wrong))
        raise SceneError(f"instances: transforms[{row}] = {short(linear[row].tolist())}", legal=RIGID)
    return np.asarray(factors, np.float64)


def _materials(given: Any, n: int) -> tuple[tuple[Any, ...], NDArray[np.int64]]:
    """The distinct materials, and the index of each instance's among them."""
    if given is None:
        return (None,), np.zeros(n, np.int64)
    if not isinstance(given, list | tuple):
        return (given,), np.zeros(n, np.int64)
    if len(given) == 2 and isinstance(given[1], np.ndarray):
        palette, chosen = list(given[0]), np.asarray(given[1])
        if chosen.shape != (n,) or chosen.dtype.kind not in "iu":
            what = f"instances: materials with indices of shape {chosen.shape}, {chosen.dtype}"
            raise SceneError(what, legal=f"{n} integers")
        if len(palette) == 0 or chosen.min() < 0 or chosen.max() >= len(palette):
            what = f"instances: materials with indices from {chosen.min()} to {chosen.max()}"
            raise SceneError(what, legal=f"from 0 to {len(palette) - 1}, of {len(palette)} materials")
    else:
        if len(given) != n:
            raise SceneError(f"instances: {len(given)} materials for {n} transforms", legal="as many as transforms")
        palette, chosen = list(given), np.arange(n)
    unique: dict[Any, int] = {}
    known = np.array([unique.setdefault(each, len(unique)) for each in palette])
    return tuple(unique), known[chosen].astype(np.int64)


def _repeatable(node: Node) -> Facts:
    """The facts of a solid that may be an instance. SceneError for another."""
    facts = solid("instances", node).facts
    wrong = {
        "an estimate": facts.exactness == "estimate",
        "unbounded": not facts.bounded,
        "empty": facts.empty,
        "of unknown spread": not np.isfinite(facts.spread),
    }
    if (what := next((what for what, found in wrong.items() if found), None)) is not None:
        legal = "a bounded solid that is exact or a bound, with spread=... if it is a shape of your own"
        raise SceneError(f"instances of {node.name}, which is {what}", legal=legal)
    body = lower(node).body
    if find([body], "param", "time", "cell", "raw", "raw_slope"):
        raise SceneError(f"instances of {node.name}", legal="a solid without Param, time and GLSL of its own")
    if hiding_nodes(node):
        what = "instances of a solid with parts that are hidden by visible"
        raise SceneError(what, legal="instances(...).visible(...)")
    return facts


def rows_from(node: Node, transforms: ArrayLike, materials: Any) -> Rows:
    """The rows of the instances of a solid; see `instances`."""
    facts = _repeatable(node)
    linear, offsets = _placements(transforms)
    n = len(offsets)
    offset = var("offset", VEC3)
    identity = linear is not None and bool(np.all(linear == np.eye(3)))
    half, middle = 0.5 * (facts.upper - facts.lower), 0.5 * (facts.upper + facts.lower)
    template: Node
    leaves: tuple[Expr, ...]
    values: tuple[Array, ...]
    if linear is None or identity:
        placed = translate(node, (0.0, 0.0, 0.0))
        params: dict[str, Any] = {"offset": offset}
        leaves, values = (offset,), (offsets,)
        centre, reach = middle + offsets, np.broadcast_to(half, (n, 3))
        spread, factors = np.full(n, facts.spread), np.ones(n)
    else:
        factors = _factors(linear)
        inverse = np.swapaxes(linear, 1, 2) / (factors**2)[:, None, None]
        placed = affine(node, np.eye(3), np.eye(3), (0.0, 0.0, 0.0), 1.0)
        leaves = (var("inverse", MAT3), offset, var("factor", FLOAT))
        values = (inverse, offsets, factors)
        params = {"linear": const(np.eye(3)), "inverse": leaves[0], "offset": offset, "stretch": leaves[2]}
        centre, reach = linear @ middle + offsets, np.abs(linear) @ half
        if facts.exactness == "exact":
            turned = Turned([facts] * n)
            turned.move(linear, offsets)
            (least, most), _ = turned.here((centre - reach, centre + reach))
            centre, reach = 0.5 * (least + most), 0.5 * (most - least)
        wider = np.abs(linear).sum(axis=2).max(axis=1) / factors
        spread = np.full(n, 1.0) if facts.exactness == "exact" else facts.spread * wider
    template = Node(placed.definition, (node,), params, placed.facts)
    palette, chosen = _materials(materials, n)
    if palette != (None,):
        template = material(template, Slot(0))
    form = Form(
        template,
        leaves,
        {},
        values,
        chosen[:, None],
        np.arange(n),
        centre - reach,
        centre + reach,
        np.linalg.norm(half) * factors,
        spread,
        np.full(n, facts.lipschitz),
        facts.exactness == "exact",
        divisor_of(node) or 1.0,
    )
    return Rows((form,), palette, given=(rows_from, node, np.asarray(transforms, np.float64), materials))


SOME = rows_from(sphere(0.4), [(-0.6, 0.0, 0.0), (0.6, 0.0, 0.0), (0.0, 0.8, 0.0)], None)


@shape(
    exactness=lambda rows: "exact" if len(rows) == 1 and rows.forms[0].exact else "bound",
    bounds=lambda rows: (const(rows.lower), const(rows.upper)),
    lipschitz=lambda rows: rows.divisor * max(float(form.lipschitz.max()) for form in rows.forms),
    spread=lambda rows: max(float(form.spread.max()) for form in rows.forms),
    shift=lambda by, rows: ({"rows": moved(rows, -by)}, np.zeros(3)),
    called="instances",
)
def instanced(p: Expr, rows: Annotated[Any, Domain(None, holds=Rows)] = SOME) -> Expr:
    """Many objects, as rows of numbers."""
    distance = rows.field(p)
    return distance if rows.divisor == 1.0 else with_bound(distance * rows.divisor, distance)


def moved(rows: Rows, by: Array) -> Rows:
    """The same instances moved by a vec3, in float64."""
    _, node, transforms, materials = rows.origin
    shifted = transforms.copy()
    if transforms.ndim == 2:
        shifted[:, :3] += by
    elif transforms.shape[1] == 4:
        shifted[:, 3, :3] += by
    else:
        shifted[:, :, 3] += by
    return rows_from(node, shifted, materials)


# Flat shapes

MOST_FLAT = 1024
"""Maximum number of copies of a flat shape: each evaluation asks all of them."""

LEGAL_FLAT = "(N, 2) positions, (N, 3) positions and factors, (N, 4) positions and vectors, or (N, 3, 3) matrices"


def _flat_rows(node: Node, transforms: ArrayLike) -> Rows:
    """The copies of a flat shape, as rows of a solid that has this cross-section and ends far from the plane z = 0."""
    given = numbers("instances: transforms", transforms, LEGAL_FLAT)
    n, shape_of_row = given.size and len(np.atleast_1d(given)), given.shape[1:]
    if n > MOST_FLAT:
        legal = (
            f"up to {MOST_FLAT:,}: each evaluation asks all. Extrude the shape first, and make instances of the solid"
        )
        raise SceneError(f"instances: {n:,} copies of a flat shape", legal=legal)
    if shape_of_row in ((2,), (3,)):
        made = np.insert(given, 2, 0.0, axis=1)
    elif shape_of_row == (4,):
        made = np.insert(given, [2, 4], 0.0, axis=1)
    elif shape_of_row == (3, 3):
        made = np.zeros((n, 4, 4))
        made[:, :2, :2], made[:, 3, :2], made[:, 3, 3] = given[:, :2, :2], given[:, 2, :2], 1.0
        made[:, 2, 2] = np.linalg.norm(given[:, 0, :2], axis=1)
    else:
        raise SceneError(f"instances: transforms of shape {given.shape}", legal=LEGAL_FLAT)
    if not node.facts.bounded:
        raise SceneError(f"instances of {node.name}, which is unbounded", legal="a bounded shape")
    return rows_from(extrude(node, 8.0 * float(np.max(node.facts.size, initial=1e-6))), made, None)


SOME_FLAT = _flat_rows(circle(0.4), [(-0.6, 0.0), (0.6, 0.0), (0.0, 0.8)])


@shape(
    exactness=lambda copies: "exact" if len(copies) == 1 and copies.forms[0].exact else "bound",
    bounds=lambda copies: (const(copies.lower[:2]), const(copies.upper[:2])),
    lipschitz=lambda copies: copies.divisor * float(copies.forms[0].lipschitz.max()),
    spread=lambda copies: float(copies.forms[0].spread.max()),
    dimension=2,
    called="instances",
)
def instanced_2d(p: Expr, copies: Annotated[Any, Domain(None, holds=Rows)] = SOME_FLAT) -> Expr:
    """Copies of a flat shape, as rows of numbers. Each evaluation asks all of them."""
    distance = copies.field(vec3(p, 0.0))
    return distance if copies.divisor == 1.0 else with_bound(distance * copies.divisor, distance)


def _are_colors(given: Any) -> bool:
    """True for a list of colours: strings, or sequences of three numbers."""
    if not isinstance(given, list | tuple) or len(given) == 0:
        return False
    return all(isinstance(c, str) or (isinstance(c, list | tuple) and len(c) == 3) for c in given)


@checked
def instances(node: Node, transforms: ArrayLike, materials: Any = None) -> Node:
    """One solid at many places, from arrays: a union of N copies, which takes no longer to write than one.

    Parameters
    ----------
    node : the solid, or flat shape: bounded, exact or a bound, without `Param` and `time`.
    transforms : N rows, 1 or more. Shape (N, 3): positions, in units of length.
        (N, 4): x, y, z and a factor > 0 of the size, such as the radius of a `sphere(1)`:
        `np.column_stack([positions, radii])`.
        (N, 6): x, y, z and a vector, for arrows: the y axis of the node points along it, by the shortest rotation, and
        its length is the factor of the size.
        (N, 4, 4): matrices for row vectors, as `transform` takes them, the offset in the last row.
        (N, 3, 4): matrices for column vectors, the offset in the last column.
        A matrix is a rotation times one factor > 0, and an offset.
        Of a flat shape up to 1,024, each without the third coordinate: (N, 2), (N, 3), (N, 4) or (N, 3, 3).
    materials : of the instances; parts of the node that have their own material keep it. None leaves it to the node.

        - a Material for all, or a sequence of N.
        - colours: shape (N, 3), linear RGB, each in [0, 1]; or N strings such as "#ff8800", encoded in sRGB.
        - a dict of arguments of Material: {"albedo": (N, 3), "roughness": (N,), "metalness": 1}. A value that is no
          array of N is that of all.
        - (materials, indices): a sequence of materials, and integers of shape (N,), the index of each instance's.

    Returns
    -------
    a Node: the hard union of all copies. It may be combined by unions, intersections, differences and rigid
    transforms. A bound, because inside overlapping solids it is not exact.

    Raises
    ------
    SceneError : arrays of another shape, for numbers that are not finite, and for matrices that stretch.
    """
    if isinstance(node, Node) and node.dimension == 2:
        if materials is not None:
            what = "instances: materials of a flat shape"
            raise SceneError(what, legal="None; extrude the shape first, and make instances of the solid")
        return instanced_2d(_flat_rows(node, transforms))
    if isinstance(materials, np.ndarray) or _are_colors(materials):
        materials = {"color": materials}
    if isinstance(materials, Mapping):
        n = len(_placements(transforms)[1])
        materials = carried_out_by("materials_by_value")("instances", materials, n)
    given = [] if materials is None else [materials]
    if isinstance(materials, list | tuple):
        indexed = len(materials) == 2 and isinstance(materials[1], np.ndarray)
        given = list(materials[0]) if indexed and isinstance(materials[0], list | tuple) else list(materials)
    for each in given:
        refuse_label("instances: material", each)
    return instanced(rows_from(node, transforms, materials))
