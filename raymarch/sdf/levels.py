"""Where the surface of a field is: whether it is where the field is 0, how far it may be from a small value, and how
steep the field is there."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from itertools import islice
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from raymarch.errors import Doubt, SceneError
from raymarch.expr.arrays import SMALLEST, evaluator
from raymarch.expr.derivative import companion
from raymarch.expr.function import Function
from raymarch.expr.intervals import interval_of
from raymarch.expr.samples import Samples
from raymarch.expr.vocabulary import clamp, length, vec3
from raymarch.sdf.definition import PLACED
from raymarch.sdf.evaluation import evaluate_both, evaluate_undivided, undivided_field
from raymarch.sdf.labels import rows_of
from raymarch.sdf.node import Node, all_nodes
from raymarch.sdf.same import remembered

Array: TypeAlias = NDArray[np.float64]

PROBES = 4096
"""Number of points at which `has_levels` evaluates an estimate."""


def flatness(root: Node, stretches: bool = False) -> float:
    """How many times as large as the field the distance to a surface may be: 1 or more.

    It is the largest spread of the nodes of a tree, such as the ratio of the factors of an uneven scale, of sampled
    fields the largest ratio at a sample, and of fields that are divided by their steepest slope, such as implicit and
    displaced surfaces, or whose spread is not known, such as pipes, that over the least slope at the surface. Nodes of
    which it is not known are left out.

    stretches : True if rays know implicit surfaces that are only placed and united along a stretch, and do not end at a
        value.
    """
    return max([flatness_by_facts(root), *(_of_slopes(node) for node in [*_uncertain(root, stretches)][:MEASURED])])


@remembered
def flatness_by_facts(root: Node) -> float:
    """The same for what nodes state: uneven scales and sampled fields, and not for slopes that are measured."""
    nodes = all_nodes(root)
    known = [node.facts.spread for node in nodes if math.isfinite(node.facts.spread)]
    return max([1.0, *known, *(_of_samples(node) for node in nodes if node.definition.name == "sampled_grid")])


def _uncertain(root: Node, stretches: bool) -> Iterator[Node]:
    """The largest parts of a tree that are not only placed and united, and are divided by a steep slope or of unknown
    spread."""
    visited: set[int] = set()
    pending = [(root, stretches)]
    while pending:
        node, placed = pending.pop()
        facts = node.facts
        known = facts.undivided <= STEEP and (math.isfinite(facts.spread) or facts.exactness == "estimate")
        if id(node) in visited or known or node.definition.name == "sampled_grid":
            continue
        visited.add(id(node))
        if node.placed_as in ("union", "select", "rigid", "scale"):
            pending += [(child, placed) for child in node.children]
        elif facts.bounded:
            if not (placed and node.definition.name == "implicit_solid"):
                yield node
        else:
            pending += [(child, False) for child in node.children]


def _of_slopes(node: Node) -> float:
    """The steepest slope of the undivided field over the least at its surface."""
    slopes, steepest = slopes_at_surface(node), node.facts.undivided
    return 1.0 if slopes is None else steepest / max(slopes[0], steepest / FLATTEST)


STEEP = 2.0
"""Steepest slope of a field above which its least slope at the surface is measured."""

FLATTEST = 1e4
"""Largest ratio of the steepest slope to the least that is taken: float32 resolves no more."""


@remembered
def _of_samples(node: Node) -> float:
    """The largest ratio of a sample's distance to the surface, along the axes, to its value."""
    data: Samples = node.params["data"]
    cell = (interval_of(node.params["size"])[1] / (np.array(data.size) - 1.0))[::-1]
    values = data.values.astype(np.float64)
    outside = values > 0.0
    if outside.all() or not outside.any():
        return 1.0
    flattest = np.max(_along_axes(values, cell)[outside] / np.maximum(values[outside], SMALLEST))
    return float(flattest) * math.sqrt(node.facts.undivided**2 - 1.0)  # as the samples are divided


def _along_axes(values: NDArray[np.float64], cell: NDArray[np.float64]) -> NDArray[np.float64]:
    """An upper bound of the distance of each sample to the surface of linear interpolation: a path along the axes."""
    found = np.where(values > 0.0, np.inf, 0.0)
    for axis in range(3):  # to a neighbour inside
        value, distance = np.moveaxis(values, axis, 0), np.moveaxis(found, axis, 0)
        for here, there in ((np.s_[:-1], np.s_[1:]), (np.s_[1:], np.s_[:-1])):
            leaves = (value[here] > 0.0) & (value[there] <= 0.0)
            share = np.divide(value[here], value[here] - value[there], out=np.full(leaves.shape, np.inf), where=leaves)
            distance[here] = np.minimum(distance[here], cell[axis] * share)
    for axis in range(3):  # to a neighbour outside
        distance = np.moveaxis(found, axis, 0)
        at = (cell[axis] * np.arange(len(distance)))[:, None, None]
        for way in (np.s_[:], np.s_[::-1]):
            ahead = at if way == np.s_[:] else -at
            distance[way] = np.minimum.accumulate((distance - ahead)[way], axis=0) + ahead[way]
    return found


@remembered
def slopes_at_surface(node: Node) -> tuple[float, float] | None:
    """The least and the largest slope of the undivided field on the surface, but for 1 % each; None if not known.

    An offset by d moves the surface by d over the slope there. Points where the gradient is 0, but for rounding, are
    left out: there two solids touch from both sides, as a mirrored one its image, or an outline its axis of revolution.
    The slopes are those just outside: nearer, vectors whose square is below `SMALLEST` have short directions.
    """
    found = _surface_points(node, PROBES // 4, 0.05)
    if found is None:
        return None
    points, normals, size = found
    outward = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    value, gradient = evaluate_both(undivided_field(node), points + 1e-7 * size * outward)
    slopes = np.linalg.norm(gradient, axis=1)
    slopes = slopes[(np.abs(value) <= 1e-6 * size) & np.isfinite(points).all(axis=1) & (slopes > 1e-9)]
    if len(slopes) < 16:
        return None
    low, high = np.quantile(slopes, (0.01, 0.99))
    return float(low), float(high)


def to_surface(field: Function, points: Array, steps: int = 12) -> tuple[Array, Array]:
    """Points moved to the surface by Newton's method along the gradient, and the unit gradients at the last step."""
    for _ in range(steps):
        value, gradient = evaluate_both(field, points)
        square = np.maximum((gradient * gradient).sum(axis=1), 1e-12)
        with np.errstate(all="ignore"):  # of a field that is undefined at some points
            points = points - gradient * (value / square)[:, None]
    return points, gradient / np.sqrt(square)[:, None]


def _surface_points(node: Node, count: int, pad: float = 0.0) -> tuple[Array, Array, float] | None:
    """Random points of the box that are moved to the surface of the undivided field, normals, and the box's diagonal.

    pad : by which the box is enlarged on each side, in diagonals. None without a finite box, or without a field in
    float64.
    """
    lower, upper = node.bounds
    size = float(np.linalg.norm(upper - lower))
    if node.facts.empty or not 0.0 < size < np.inf:
        return None
    points = np.random.default_rng(0).uniform(lower - pad * size, upper + pad * size, (count, len(lower)))
    try:
        return *to_surface(undivided_field(node), points), size
    except SceneError:  # GLSL without a NumPy function
        return None


MEASURED = 16
"""Maximum number of such nodes of a tree whose operands are measured."""

FIRST_ORDER = 0.05
"""Relative error of a length below which a picture has no doubt."""


def moved_otherwise(root: Node, doubted: bool = False) -> Iterator[Doubt]:
    """A doubt about each node that moves the surface of a field that is not exact, with the distance by which it does.

    doubted : True for those only that move a part of the surface by another distance than the user asked for.
    """
    moving = [node for node in all_nodes(root) if node.placed_as == "offset" and node.children[0].exactness != "exact"]
    for node in moving[:MEASURED]:
        (child,) = node.children
        what, cure = f"{node.name} acts on a {child.exactness} field, {child.name}", ""
        slopes = slopes_at_surface(child)
        if slopes is None:
            wrong, so = False, "may move by another distance than the one asked for"
        else:
            low, high = 1.0 / slopes[1], 1.0 / max(slopes[0], 1e-9)
            wrong = high - 1.0 > FIRST_ORDER or 1.0 - low > FIRST_ORDER
            so = "moves by the distance asked for, and by more at edges that were cut"
            if wrong:
                so = f"moves by {low:.3g} to {high:.3g} times the distance asked for"
                cure = f"{node.name} before what deforms or blends the solid"
        if wrong or not doubted:
            yield Doubt("plan", f"{what}: the surface {so}", cure, node.where)
        yield from _false_walls(node, now=doubted)
    if (sheet := _without_inside(root)) is not None and (cut := flush_cut(root)) is not None:
        what = f"{cut.name} cuts flush with a face, and leaves a membrane there, which is drawn as {sheet.name} is"
        yield Doubt("plan", what, f"a tool that reaches beyond the face, or a thickness of {sheet.name}", cut.where)


def _false_walls(node: Node, now: bool) -> Iterator[Doubt]:
    """Doubts about an offset or a shell that draws a face where its child has none: there the child's field is 0, as
    where a tool ends flush with a face, or, from inside, where the parts of a union touch.

    now : by the length at the time and with the parameters that are bound, not by all that it may be.
    """
    (child,), (moved,) = node.children, node.params.values()
    ends = evaluator([moved], ())() * 2 if now and not moved.is_constant else interval_of(moved)
    low, high = (float(end) for end in ends)
    inward, outward = (0.5 * high, 0.5 * high) if node.name == "shell" else (-low, high)
    cut = flush_cut(child) if outward > 0.0 else None
    if cut is None and outward > 0.0 and (short := short_tool(child, outward)) is not None:
        cut = short[0]
    if cut is not None:
        what = f"{node.name} draws a wall over what {cut.name} cuts, at the end of a tool that is too short"
        yield Doubt("plan", what, f"a tool that reaches more than {outward:.3g} beyond the face", node.where)
    joined = next((n for n in all_nodes(child) if inward > 0.0 and touching(n)), None)
    if joined is not None:
        what = f"{node.name} draws a face inside the solid, where parts of {joined.name} touch"
        yield Doubt("plan", what, f"parts that overlap by more than {2.0 * inward:.3g}", node.where)


SHORT = 0.9
"""Slope of a field below which effects that read it as a distance have a doubt."""


def least_slope(root: Node, below: float = SHORT) -> float:
    """The least slope of a field near the surface of its nodes that stretch or deform; 1 if none is below a limit, or
    known: then the field may be read as a distance.

    below : `SHORT`, or `CORRECTED` for what effects divide by.
    """
    return min((slopes[0] for _, slopes in _uneven(root) if slopes[0] < below), default=1.0)


def _uneven(root: Node) -> list[tuple[Node, tuple[float, float]]]:
    """The nodes whose fields are no distances near their surface, with their least and largest slope there."""
    uneven = [n for n in all_nodes(root) if n.placed_as in ("stretch", "deform")]
    uneven = [n for n in uneven if n.exactness != "exact" and n.dimension == 3][:MEASURED]
    return [(node, slopes) for node in uneven if (slopes := slopes_at_surface(node)) is not None]


CORRECTED = 0.6
"""Slope of a field below which effects divide by it. This costs the gradient at each point that they read."""


def over_slope(root: Node) -> Callable[[Node], Callable[[Function], Function] | None]:
    """How fields of the nodes of a tree are read as distances, for `Lowering.distances`.

    Each is divided by its own slope, before it is compared with others, as in a union. None for a node that is read as
    it is.
    """
    chosen = {id(node): slopes[0] for node, slopes in _uneven(root) if slopes[0] < CORRECTED}

    def reading(node: Node) -> Callable[[Function], Function] | None:
        least = chosen.get(id(node))
        return None if least is None else lambda function: of_first_order(function, least)

    return reading


def of_first_order(field: Function, least: float) -> Function:
    """A field over its slope: the distance, to first order at the surface.

    least : the least slope near the surface. Where the field is flatter, as in the middle of a solid, it says nothing
    of the distance.
    """
    p, *others = field.params
    both = companion(field)(p, *others)
    slope = length(vec3(both.x, both.y, both.z))
    return Function(f"{field.name}_distance", field.params, both.w / clamp(slope, least, 1e9), where=field.where)


FLAT = 16.0
"""Ratio of a distance to the field, after an uneven scale, above which a hit needs a sample inside the solid."""


@remembered
def may_touch(root: Node) -> bool:
    """True if the field may fall to 0, or to the rounding of float32, where there is no surface.

    A node of a tree cuts, or an exclusive or, or the complement of a union, does: a face of the solid may be flush with
    one of the solid that cuts it.
    Or an uneven scale makes the field so flat that it is small far from the surface. False if some shape has no inside,
    as a `disc` of thickness 0: it is drawn where the field is 0.
    """
    nodes = all_nodes(root)
    return (any(map(_leaves_faces, nodes)) or any(map(_is_flat, nodes))) and _without_inside(root) is None


def _without_inside(root: Node) -> Node | None:
    """A shape of a tree that has no inside, as a disc of thickness 0; None without one."""
    shapes = [node for node in all_nodes(root) if not node.children and not node.facts.empty]
    return next((node for node in shapes if np.any(node.facts.lower >= node.facts.upper)), None)


def flush_cut(root: Node) -> Node | None:
    """A node of a tree that cuts and leaves a membrane of no thickness, found by points on it; None without one."""
    cutting = [n for n in all_nodes(root) if _leaves_faces(n)]
    return next((node for node in cutting[:MEASURED] if node.dimension == 3 and _has_membrane(node)), None)


def _leaves_faces(node: Node) -> bool:
    """True if the field of a node may be 0 and positive on both sides, as where it cuts flush with a face."""
    united = node.name == "complement" and any(n.placed_as == "union" for n in all_nodes(node.children[0]))
    return node.definition.cuts or node.definition.touches or united


@remembered
def _has_membrane(node: Node) -> bool:
    """True if the field is 0 at several points of the box and positive on both sides of them."""
    found = _surface_points(node, PROBES // 4)
    return found is not None and int(_flat_between(node, found, 1.0).sum()) >= 4


@remembered
def touching(node: Node) -> set[tuple[int, int]]:
    """Children of a node that touch at a common face, by their numbers, found by points on it; equal ones for copies of
    a child, also those in rows. There the field is 0 and negative on both sides, which is no surface to a ray inside.
    """
    rows, single = rows_of(node), len(node.children) < 2
    few = bool(node.children) if rows is None else len(rows) <= PROBES
    if node.dimension != 3 or not few or node.label is not None or node.placed_as in PLACED:
        return set()
    found = set()
    for i, surface in enumerate((*node.children, node)) if single else _met_by_others(node.children):
        points = _surface_points(surface, PROBES // 8) if surface.dimension == 3 else None  # not of a flat profile
        if points is None or int((flat := _flat_between(node, points, -1.0)).sum()) < 4:
            continue
        beyond = points[0][flat] + 1e-6 * points[2] * points[1][flat]
        found |= {(0, 0)} if single else {(i, k) for k, c in enumerate(node.children) if k != i and _holds(c, beyond)}
    return found


TOUCHED = 64
"""Maximum number of children of a node that are asked for others at their surface; of many, which take longer to
evaluate, `MEASURED`."""


def _met_by_others(children: Sequence[Node]) -> list[tuple[int, Node]]:
    """Children whose boxes meet that of another one, with their numbers."""
    lower, upper = (np.array([c.bounds[k] for c in children]) for k in (0, 1))
    found, most = [], TOUCHED if len(children) <= TOUCHED else MEASURED
    for i, child in enumerate(children):
        slack = 1e-6 * (np.abs(upper[i]) + np.abs(lower[i]))
        meets = np.all((lower <= upper[i] + slack) & (lower[i] - slack <= upper), axis=1)
        if meets.sum() > 1 and not child.facts.empty:
            found.append((i, child))
        if len(found) == most:
            break
    return found


def _holds(node: Node, points: Array) -> bool:
    return int((evaluate_undivided(node, points) < 0.0).sum()) >= 4


def _flat_between(node: Node, found: tuple[Array, Array, float], sign: float) -> NDArray[np.bool_]:
    """Of points of some surface, whether the field is 0 around them, and of a sign on both sides; see
    `_surface_points`."""
    points, normals, size = found
    step = 1e-6 * size
    least = np.eye(3)[np.argmin(np.abs(normals), axis=1)]
    first = np.cross(normals, least) / np.linalg.norm(np.cross(normals, least), axis=1)[:, None].clip(1e-12)
    around = (0.0 * first, first, -first, np.cross(normals, first), -np.cross(normals, first))  # no edge is flat
    flat = [np.abs(evaluate_undivided(node, points + 10.0 * step * way)) <= 0.1 * step for way in around]
    sides = [sign * evaluate_undivided(node, points + way * step * normals) > 0.25 * step for way in (1.0, -1.0)]
    return np.asarray(np.all([*flat, *sides], axis=0))


def short_tool(root: Node, reach: float) -> tuple[Node, float] | None:
    """A difference whose tool ends within `reach` beyond a face that it cuts, and how far beyond; None without one.

    There the field is the distance to the end of the tool, where nothing is drawn.
    """
    for node, factor in islice(scaled(root), PROBES):
        if node.name == "difference" and node.dimension == 3 and factor * _beyond_face(node) < reach:
            return node, factor * _beyond_face(node)
    return None


@remembered
def _beyond_face(node: Node) -> float:
    """How far the tools of a difference reach beyond flat faces that they cut, at least; infinite if they cut none."""
    base, *tools = node.children
    found = _surface_points(base, PROBES // 8)
    if found is None:
        return np.inf
    points, normals, size = found
    ends = np.full(len(points), np.inf)
    try:
        for tool in tools:
            within = evaluate_undivided(tool, points) < -1e-6 * size
            p, n = points[within], normals[within]
            low, high = np.zeros(len(p)), np.full(len(p), size)
            for _ in range(20):
                middle = 0.5 * (low + high)
                held = evaluate_undivided(tool, p + middle[:, None] * n) < 0.0
                low, high = np.where(held, middle, low), np.where(held, high, middle)
            straight = (evaluate_both(undivided_field(tool), p + high[:, None] * n)[1] * n).sum(axis=1) > 0.99
            nearest = -evaluate_undivided(tool, p + 0.5 * high[:, None] * n) > 0.49 * high  # and not a side of the tool
            if np.sum(straight & nearest) >= max(4.0, 0.25 * len(p)):  # else the end is round
                ends[within] = np.minimum(ends[within], np.where(straight & nearest, high, np.inf))
    except SceneError:  # GLSL without a NumPy function
        return np.inf
    return float(np.sort(ends)[3])


def thinnest(root: Node) -> tuple[Node, float] | None:
    """The node of an uneven scale above `FLAT` whose box is the thinnest, and how thick that is; None without one."""
    flat = [(factor, n) for n, factor in scaled(root, _is_flat) if _is_flat(n) and not n.facts.empty]
    found = [(factor * float(np.min(n.facts.upper - n.facts.lower)), n) for factor, n in flat]
    thickness, node = min(found, key=lambda each: each[0], default=(0.0, None))
    return None if node is None else (node, thickness)


def _is_flat(node: Node) -> bool:
    """True for an uneven scale by which the field is much smaller than the distance."""
    return node.placed_as == "stretch" and node.facts.spread > FLAT


def scaled(root: Node, ends: Callable[[Node], bool] = lambda _: False) -> Iterator[tuple[Node, float]]:
    """The nodes of a tree, each with the factor by which those above scale it; none below those where it ends."""
    visited: set[int] = set()
    pending = [(root, 1.0)]
    while pending:
        node, factor = pending.pop()
        if id(node) in visited:
            continue
        visited.add(id(node))
        yield node, factor
        if ends(node):
            continue
        scaled = node.params.get("factor", node.params.get("stretch")) if node.placed_as == "scale" else None
        factor *= 1.0 if scaled is None else float(interval_of(scaled)[1])
        pending += [(child, factor) for child in node.children]


@remembered
def has_levels(root: Node) -> bool:
    """True if every estimate in a tree is negative somewhere in its box, so that its surface is where it is 0.

    Others, such as |z| over the growth of a Mandelbox, only fall towards their solid: what is drawn of it is the points
    near which they are small. Judged by `PROBES` points of the box; an estimate without a box, or one in GLSL that only
    a GPU evaluates, counts as one of those.
    """
    estimates = [node for node in all_nodes(root) if node.exactness == "estimate"]
    return all(_is_negative_somewhere(n) for n in estimates if all(c.exactness != "estimate" for c in n.children))


@remembered
def _is_negative_somewhere(node: Node) -> bool:
    lower, upper = node.bounds
    if node.facts.empty or not (np.all(np.isfinite(lower)) and np.all(np.isfinite(upper))):
        return False
    points = np.random.default_rng(0).uniform(lower, upper, (PROBES, len(lower)))
    try:
        return bool(np.any(node.distance(points) < 0.0))
    except SceneError:
        return False
