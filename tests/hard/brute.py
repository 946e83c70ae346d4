"""A renderer by brute force: plain NumPy in float64, which shares no code with the package.

A solid is a tree of tuples:

    ("sphere", radius)  ("box", size)  ("plane", normal, offset)  ("torus", major, minor)  ("cylinder", radius, height)
    ("capsule", a, b, radius)  ("union" | "intersection" | "difference", k, blend, a, b, ...)  ("move", by, a)
    ("turn", angle, axis, a)  ("scale", factor, a)  ("repeat", spacings, counts, a)  ("mirror", axis, a)
    ("paint", i, a)  ("visible", kinds, a), hidden from these rays: "camera shadow"

A ray meets the first of the solids that a hard union joins at its root: spheres and planes in closed form, all
others by steps of half the distance and bisection. Normals are central differences. A picture also says where it is
uncertain: at silhouettes and borders of shadows, and how much its values vary within each pixel.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Tree = tuple[Any, ...]

ULP = 2.0**-23
"""Of float32, relative: what the judged picture is computed in."""

FAR = 1e7
"""Where rays end, in units of the distance from the camera to its target."""


# Fields


def blended(a: Array, b: Array, k: float, family: str) -> Array:
    """The smooth minimum of two distances; equal ones a give a - k/4. As in the table of normalised smooth minima."""
    if k == 0.0:
        return np.minimum(a, b)
    k4, low, gap = 0.25 * k, np.minimum(a, b), np.abs(a - b)
    if family == "exponential":
        return low - k4 * np.log2(np.exp2(-(a - low) / k4) + np.exp2(-(b - low) / k4))
    if family == "root":
        return 0.5 * (a + b - np.sqrt((a - b) ** 2 + (2 * k4) ** 2))
    if family == "circular_geometric":
        r = k4 / (math.sqrt(2.0) - 1.0)
        return np.maximum(r, low) - np.sqrt(np.maximum(r - a, 0.0) ** 2 + np.maximum(r - b, 0.0) ** 2)
    width = {"quadratic": 4.0, "cubic": 6.0, "quartic": 16.0 / 3.0, "circular": 1.0 / (1.0 - math.sqrt(0.5))}[
        family
    ] * k4
    h = np.maximum(width - gap, 0.0) / width
    if family == "quadratic":
        return low - h**2 * width / 4.0
    if family == "cubic":
        return low - h**3 * width / 6.0
    if family == "quartic":
        return low - h**3 * (4.0 - h) * width / 16.0
    return low - 0.5 * width * (1.0 + h - np.sqrt(1.0 - h * (h - 2.0)))


FAMILIES = ("quadratic", "cubic", "quartic", "circular", "exponential", "root", "circular_geometric")


@cache
def turn(angle: float, axis: tuple[float, ...]) -> Array:
    """The matrix of a rotation, right-handed (Rodrigues)."""
    x, y, z = np.asarray(axis, float) / np.linalg.norm(axis)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + math.sin(angle) * cross + (1.0 - math.cos(angle)) * cross @ cross


def _leaf(tree: Tree, p: Array) -> Array:
    kind = tree[0]
    if kind == "sphere":
        return np.linalg.norm(p, axis=1) - tree[1]
    if kind == "plane":
        n = np.asarray(tree[1], float)
        return p @ (n / np.linalg.norm(n)) - tree[2]
    if kind == "torus":
        return np.hypot(np.hypot(p[:, 0], p[:, 2]) - tree[1], p[:, 1]) - tree[2]
    if kind == "capsule":
        a, b = np.asarray(tree[1], float), np.asarray(tree[2], float)
        share = np.clip((p - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
        return np.linalg.norm(p - a - share[:, None] * (b - a), axis=1) - tree[3]
    if kind == "box":
        beyond = np.abs(p) - 0.5 * np.asarray(tree[1], float)
    elif kind == "cylinder":
        beyond = np.stack([np.hypot(p[:, 0], p[:, 2]) - tree[1], np.abs(p[:, 1]) - 0.5 * tree[2]], axis=1)
    else:
        raise ValueError(kind)
    outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=1)
    return outside + np.minimum(beyond.max(axis=1), 0.0)


def _copies(spacing: Any, counts: Any) -> list[Array]:
    """Where the copies of a repetition stand."""
    along = [
        [0.0] if s is None else [(i - (n - 1) / 2) * s for i in range(n)] for s, n in zip(spacing, counts, strict=True)
    ]
    return [np.array([x, y, z]) for x in along[0] for y in along[1] for z in along[2]]


def _inner(tree: Tree, p: Array) -> tuple[float, Array]:
    """A transform: what the distance of its child is multiplied by, and the points that the child is asked at."""
    kind = tree[0]
    if kind == "move":
        return 1.0, p - np.asarray(tree[1], float)
    if kind == "turn":
        return 1.0, p @ turn(tree[1], tree[2])  # rows: the transposed matrix is the inverse
    if kind == "scale":
        return tree[1], p / tree[1]
    q = p.copy()
    q[:, "xyz".index(tree[1])] = np.abs(q[:, "xyz".index(tree[1])])
    return 1.0, q


def distance(tree: Tree, p: Array) -> Array:
    """The field of a solid at points (N, 3)."""
    kind = tree[0]
    if kind == "paint":
        return distance(tree[2], p)
    if kind == "nothing":
        return np.full(len(p), math.inf)
    if kind in ("move", "turn", "scale", "mirror"):
        factor, q = _inner(tree, p)
        return factor * distance(tree[-1], q)
    if kind == "repeat":
        return np.min([distance(tree[3], p - c) for c in _copies(tree[1], tree[2])], axis=0)
    if kind in ("union", "intersection", "difference"):
        k, family, first, *others = tree[1:]
        value = distance(first, p)
        for other in others:
            value = _joined(kind, value, distance(other, p), k, family)
        return value
    return _leaf(tree, p)


def _joined(kind: str, a: Array, b: Array, k: float, family: str) -> Array:
    if np.isinf(a).any() or np.isinf(b).any():  # nothing there
        k = 0.0
    if kind == "union":
        return blended(a, b, k, family)
    return -blended(-a, -b if kind == "intersection" else b, k, family)


def steepness(tree: Tree) -> float:
    """The largest slope of a field: the root of 2 for each geometric blend around a blend of the same kind."""
    within = max((steepness(child) for child in children_of(tree)), default=1.0)
    blends = len(tree) - 4 if tree[0] in ("union", "intersection", "difference") and tree[1] else 0
    return within * math.sqrt(2.0) ** blends if blends and tree[2] == "circular_geometric" else within


KINDS = ("camera", "shadow", "reflection")
"""Of rays."""


def children_of(tree: Tree) -> list[Tree]:
    """The solids that a solid is made of."""
    return [child for child in tree[1:] if isinstance(child, tuple) and child and isinstance(child[0], str)]


def shown(tree: Tree, rays: str) -> Tree:
    """A tree without what is hidden from a kind of rays."""
    if tree[0] == "visible":
        return ("nothing",) if rays in tree[1] else shown(tree[2], rays)
    return tuple(shown(c, rays) if isinstance(c, tuple) and c and isinstance(c[0], str) else c for c in tree)


def vacant(tree: Tree) -> bool:
    """Whether there is no solid."""
    kind, children = tree[0], children_of(tree)
    if kind == "union":
        return all(map(vacant, children))
    if kind == "intersection":
        return any(map(vacant, children))
    return kind == "nothing" or (bool(children) and vacant(children[0]))


def around(tree: Tree) -> tuple[Array, float]:
    """A ball that holds a solid."""
    kind, origin = tree[0], np.zeros(3)
    if kind == "paint":
        return around(tree[2])
    if kind == "plane":
        return origin, math.inf
    if kind == "sphere":
        return origin, tree[1]
    if kind == "box":
        return origin, 0.5 * float(np.linalg.norm(tree[1]))
    if kind == "torus":
        return origin, tree[1] + tree[2]
    if kind == "cylinder":
        return origin, math.hypot(tree[1], 0.5 * tree[2])
    if kind == "capsule":
        a, b = np.asarray(tree[1], float), np.asarray(tree[2], float)
        return 0.5 * (a + b), 0.5 * float(np.linalg.norm(b - a)) + tree[3]
    if kind == "union":
        balls = [around(child) for child in tree[3:] if not vacant(child)]
        centre = np.mean([c for c, _ in balls], axis=0)
        return centre, max(float(np.linalg.norm(c - centre)) + r for c, r in balls) + 0.25 * tree[1] * (len(balls) - 1)
    if kind == "intersection":
        return min((around(child) for child in tree[3:]), key=lambda ball: ball[1])
    if kind == "difference":
        return around(tree[3])
    centre, radius = around(tree[-1])
    if kind == "move":
        return centre + np.asarray(tree[1], float), radius
    if kind == "turn":
        return turn(tree[1], tree[2]) @ centre, radius
    if kind == "scale":
        return tree[1] * centre, tree[1] * radius
    reach = float(np.linalg.norm(centre)) + radius
    if kind == "repeat":
        reach += max(float(np.linalg.norm(c)) for c in _copies(tree[1], tree[2]))
    return origin, reach


# Materials

COLOR, SHININESS, SPECULAR, AMBIENT, MIRROR = slice(0, 3), 3, 4, 5, 6
GREY = {"color": (0.5, 0.5, 0.5)}


def _values(material: dict[str, Any], p: Array) -> Array:
    """Colour, shininess, specular, ambient, and 1 for a mirror; at points in the material's own space."""
    made = np.zeros((len(p), 7))
    color = material.get("mirror", material.get("color"))
    if color[0] == "checker":
        _, a, b, size = color
        cell = np.floor(p / size + 0.25).sum(axis=1)
        made[:, COLOR] = np.where((cell % 2 == 0)[:, None], a, b)
    else:
        made[:, COLOR] = color
    made[:, SHININESS] = material.get("shininess", 32.0)
    made[:, SPECULAR] = material.get("specular", 0.25)
    made[:, AMBIENT] = material.get("ambient", 0.1)
    if "mirror" in material:
        made[:, SPECULAR:MIRROR] = 0.0
        made[:, MIRROR] = 1.0
    return made


@dataclass
class Made:
    """A field, what its surface is made of, (N, 7), or None if nothing says it, and the size of its derivative by the
    fields of its parts. What nothing says is one part."""

    distance: Array
    values: Array | None
    weight: Array


def surface(tree: Tree, p: Array, materials: list[dict[str, Any]]) -> Made:
    """Blends mix the materials of their leaves by the derivatives of the field."""
    kind = tree[0]
    if kind == "paint":
        found = surface(tree[2], p, materials)
        return replace(found, values=_values(materials[tree[1]], p)) if found.values is None else found
    if kind in ("move", "turn", "scale", "mirror"):
        factor, q = _inner(tree, p)
        found = surface(tree[-1], q, materials)
        return replace(found, distance=factor * found.distance)
    if kind == "repeat":
        copies = [surface(tree[3], p - c, materials) for c in _copies(tree[1], tree[2])]
        near, rows = np.argmin([copy.distance for copy in copies], axis=0), np.arange(len(p))
        values = None if copies[0].values is None else np.array([copy.values for copy in copies])[near, rows]
        distances, weights = ([getattr(copy, name) for copy in copies] for name in ("distance", "weight"))
        return Made(np.min(distances, axis=0), values, np.array(weights)[near, rows])
    if kind in ("union", "intersection", "difference"):
        k, family, first, *others = tree[1:]
        made = surface(first, p, materials)
        for other in others:
            made = _mixed(kind, made, surface(other, p, materials), k, family)
        return made
    return Made(distance(tree, p), None, np.ones(len(p)))


def _mixed(kind: str, first: Made, second: Made, k: float, family: str) -> Made:
    a, b = first.distance, second.distance
    if np.isinf(b).any():  # nothing there
        return replace(first, distance=_joined(kind, a, b, k, family))
    if np.isinf(a).any():
        return replace(second, distance=_joined(kind, a, b, k, family))
    h = 1e-5 * k if k else np.maximum(1e-9 * np.abs(a - b), 1e-300)
    wa = np.abs(_joined(kind, a + h, b, k, family) - _joined(kind, a - h, b, k, family)) / (2.0 * h)
    wb = np.abs(_joined(kind, a, b + h, k, family) - _joined(kind, a, b - h, k, family)) / (2.0 * h)
    if k == 0.0:
        wins = a <= b if kind == "union" else a >= (b if kind == "intersection" else -b)
        wa, wb = wins.astype(float), 1.0 - wins
    wa, wb = wa * first.weight, wb * second.weight
    joined = _joined(kind, a, b, k, family)
    if first.values is None and second.values is None:  # one part of one material
        return Made(joined, None, np.ones(len(a)))
    if kind == "difference" and second.values is None:
        return Made(joined, first.values, first.weight)  # the first operand decides
    grey = _values(GREY, np.zeros((len(a), 3)))
    va, vb = (grey if made.values is None else made.values for made in (first, second))
    share = (wb / np.maximum(wa + wb, 1e-300))[:, None]  # both are 0 where neither operand changes the field
    return Made(joined, (1.0 - share) * va + share * vb, wa + wb)


# Rays


@dataclass(frozen=True)
class Part:
    """One of the solids that a hard union joins at the root; its kind is "any" if it has no closed form."""

    tree: Tree
    kind: str
    centre: Array
    radius: float
    normal: Array


def operands(trees: list[Tree]) -> list[Tree]:
    """The solids that hard unions join at the root."""
    return [
        leaf for tree in trees for leaf in (operands(list(tree[3:])) if tree[0] == "union" and not tree[1] else [tree])
    ]


def parts_of(trees: list[Tree]) -> list[Part]:
    return [part_of(tree) for tree in operands(trees)]


def part_of(tree: Tree) -> Part:
    """One solid; its kind is "none" if there is nothing."""
    core, by = tree, np.zeros(3)
    if vacant(tree):
        return Part(tree, "none", by, 0.0, by)
    while core[0] in ("paint", "move"):
        by = by + np.asarray(core[1], float) if core[0] == "move" else by
        core = core[-1]
    centre, radius = around(tree)
    if core[0] == "plane":
        n = np.asarray(core[1], float) / np.linalg.norm(core[1])
        return Part(tree, "plane", by + core[2] * n, math.inf, n)
    if not math.isfinite(radius):
        raise ValueError(f"an endless solid that is no plane: {core[0]}")
    return Part(tree, "sphere" if core[0] == "sphere" else "any", centre, radius, np.zeros(3))


@dataclass
class Met:
    """What rays met: how far (inf for nothing), which part, and whether another ray beside may meet something else."""

    t: Array
    part: NDArray[np.int64]
    close: NDArray[np.bool_]


@dataclass
class Rays:
    """Origins and unit directions (N, 3), the range of each, and how wide its uncertainty is: base + grows * t."""

    origin: Array
    direction: Array
    start: Array
    end: Array
    base: Array
    grows: Array

    def at(self, t: Array) -> Array:
        return self.origin + t[:, None] * self.direction

    def width(self, t: Array) -> Array:
        return self.base + self.grows * t

    def of(self, rows: Any) -> Rays:
        return Rays(*(getattr(self, name)[rows] for name in ("origin", "direction", "start", "end", "base", "grows")))


def meet(parts: list[Part], rays: Rays, own: NDArray[np.int64] | None = None) -> Met:
    """The first hits of rays. own : the part that a ray starts on, -1 for none."""
    n = len(rays.start)
    met = Met(np.full(n, math.inf), np.full(n, -1), np.zeros(n, bool))
    passed = np.zeros(n, bool)
    for i, part in enumerate(parts):
        if part.kind == "none":
            continue
        left = None if own is None else own == i
        found = {"plane": _meet_plane, "sphere": _meet_sphere, "any": _meet_any}[part.kind](part, rays, left)
        nearer = found.t < met.t
        passed |= found.close & ~np.isfinite(found.t)
        met.close = np.where(nearer, found.close, met.close)  # what is behind another hit does not matter
        met.t = np.where(nearer, found.t, met.t)
        met.part = np.where(nearer, i, met.part)
    met.close |= passed
    return met


def _meet_plane(part: Part, rays: Rays, left: Any) -> Met:
    fall = rays.direction @ part.normal
    above = (rays.origin - part.centre) @ part.normal
    with np.errstate(divide="ignore", invalid="ignore"):
        t = -above / fall
        hit = (fall < 0.0) & (t > rays.start) & (t < rays.end)
        begins = above + rays.start * fall
        t, hit = np.where(begins < 0.0, rays.start, t), hit | (begins < 0.0)  # a ray that starts inside ends there
        last = np.minimum(rays.end, FAR * np.abs(above))
        low = above + last * fall
    if left is not None:
        hit &= ~left
    close = np.abs(low) < rays.width(np.where(np.isfinite(last), last, 0.0))
    close |= np.abs(begins) < rays.width(rays.start)
    if left is not None:
        close &= ~left
    return Met(np.where(hit, t, math.inf), np.zeros(len(t), int), close)


def _meet_sphere(part: Part, rays: Rays, left: Any) -> Met:
    away = rays.origin - part.centre
    along = np.sum(away * rays.direction, axis=1)
    beside = np.linalg.norm(away - along[:, None] * rays.direction, axis=1)
    half = np.sqrt(np.maximum((part.radius - beside) * (part.radius + beside), 0.0))
    first, second = -along - half, -along + half
    t = np.where(first > rays.start, first, np.where(second > rays.start, rays.start, second))
    hit = (beside < part.radius) & (second > rays.start) & (t < rays.end)
    passed = np.clip(-along, rays.start, rays.end)
    close = np.abs(np.linalg.norm(rays.at(passed) - part.centre, axis=1) - part.radius) < rays.width(passed)
    if left is not None:
        hit &= ~left  # convex
        close &= ~left
    return Met(np.where(hit, t, math.inf), np.zeros(len(t), int), close)


def _meet_any(part: Part, rays: Rays, left: Any) -> Met:
    """Steps of half the distance inside of the ball around the part; a change of sign is bisected."""
    n = len(rays.start)
    met = Met(np.full(n, math.inf), np.zeros(n, int), np.zeros(n, bool))
    steep = steepness(part.tree)
    away = rays.origin - part.centre
    along = np.sum(away * rays.direction, axis=1)
    beside = np.linalg.norm(away - along[:, None] * rays.direction, axis=1)
    radius = 1.001 * part.radius + rays.width(np.maximum(-along, 0.0))
    half = np.sqrt(np.maximum((radius - beside) * (radius + beside), 0.0))
    t, end = np.maximum(-along - half, rays.start), np.minimum(-along + half, rays.end)
    rows = np.flatnonzero((beside < radius) & (t < end))
    t, end, ray = t[rows], end[rows], rays.of(rows)
    before, entered = t.copy(), np.full(len(rows), math.nan)  # of the bracket
    low = np.full(len(rows), math.nan)  # front of the bracket
    falling, last = np.zeros(len(rows), bool), np.full(len(rows), -math.inf)
    first, brackets = True, []
    while len(rows):
        f = distance(part.tree, ray.at(t))
        width = ray.width(t)
        if first:
            f = np.where((left[rows] if left is not None else False) & (f < 0) & (f > -width), 0.0, f)
            first = False
        inside = f < 0.0
        begins = inside & np.isnan(entered)
        entered[begins], low[begins] = t[begins], before[begins]
        sure = inside & (f < -width)
        out = ~inside & ~np.isnan(entered)  # it was in, but not deep
        passing = ~inside & falling & (f > last) & (last < width)
        met.close[rows[out | passing]] = True
        done = sure | out
        falling, last = f < last, f
        before = t
        step = np.maximum(0.5 / steep * np.abs(f), np.maximum(0.5 * width, 1e-4 * part.radius))
        beyond = ~done & (t >= end)
        met.close[rows[beyond & ~np.isnan(entered)]] = True
        t = np.minimum(t + step, end)
        finished = (done | beyond) & ~np.isnan(entered)
        if finished.any():
            brackets.append((rows[finished], low[finished], entered[finished]))
        on = ~(done | beyond)
        rows, t, end, before, entered, low, falling, last = (
            x[on] for x in (rows, t, end, before, entered, low, falling, last)
        )
        ray = ray.of(on)
    if brackets:
        rows, low, entered = (np.concatenate(x) for x in zip(*brackets, strict=True))
        met.t[rows] = _bisected(part, rays.of(rows), low, entered)
    return met


def _bisected(part: Part, rays: Rays, low: Array, high: Array) -> Array:
    for _ in range(50):
        middle = 0.5 * (low + high)
        inside = distance(part.tree, rays.at(middle)) < 0.0
        low, high = np.where(inside, low, middle), np.where(inside, middle, high)
    return low


def normal_of(part: Part, p: Array, size: Array) -> Array:
    """Central differences over a width of 1e-5 of a size."""
    h = 1e-5 * size
    steps = np.eye(3)
    rise = [distance(part.tree, p + h[:, None] * step) - distance(part.tree, p - h[:, None] * step) for step in steps]
    n = np.stack(rise, axis=1)
    return n / np.maximum(np.linalg.norm(n, axis=1), 1e-300)[:, None]


# Light


@dataclass
class Spec:
    """A scene in plain numbers."""

    trees: list[Tree]
    materials: list[dict[str, Any]]
    lights: list[dict[str, Any]]
    position: tuple[float, ...]
    target: tuple[float, ...]
    fov: float
    sky: tuple[float, ...] = (0.5, 0.65, 0.85)
    sky_light: bool = False
    fog: tuple[tuple[float, ...] | None, float, float, float] | None = None
    """color, None for that of the sky; density, falloff and height"""
    occlusion: tuple[int, float, float, float] | None = None
    """steps, reach, strength, decay"""
    bounces: int = 0
    moving: int = 0
    """If not 0, which of the numbers are parameters or depend on time; the values are the same."""
    height: float | None = None
    """Of an orthographic picture, in scene units; None is perspective."""
    near: float = 0.0
    far: float = math.inf
    quality: dict[str, Any] = field(default_factory=dict)
    """Settings that must not change the picture."""
    tags: tuple[str, ...] = field(default=())

    def changed(self, **parts: Any) -> Spec:
        return replace(self, **parts)


@dataclass
class Light:
    """What comes from one light to points: directions (N, 3), distances (N,) and radiance (N, 3)."""

    direction: Array
    distance: Array
    radiance: Array


def light_at(light: dict[str, Any], p: Array) -> Light:
    power = np.asarray(light.get("color", (1.0, 1.0, 1.0)), float) * light.get("intensity", 1.0)
    if light["kind"] == "sun":
        towards = np.asarray(light["direction"], float) / np.linalg.norm(light["direction"])
        return Light(np.tile(towards, (len(p), 1)), np.full(len(p), math.inf), np.tile(power, (len(p), 1)))
    way = np.asarray(light["position"], float) - p
    far = np.linalg.norm(way, axis=1)
    to = way / far[:, None]
    if light.get("attenuation") is None:
        factor = 1.0 / far**2
        if light.get("range") is not None:
            factor *= np.clip(1.0 - (far / light["range"]) ** 4, 0.0, 1.0) ** 2
    else:
        c, linear, square = light["attenuation"]
        factor = 1.0 / (c + linear * far + square * far**2)
        if light.get("range") is not None:
            factor *= np.maximum(1.0 - far / light["range"], 0.0)
    if light["kind"] == "spot":
        axis = np.asarray(light["direction"], float) / np.linalg.norm(light["direction"])
        outer, inner = math.cos(light["angle"]), math.cos(light["angle"] * (1.0 - light["blend"]))
        factor *= np.clip((-(to @ axis) - outer) / max(inner - outer, 1e-6), 0.0, 1.0) ** 2
    return Light(to, far, factor[:, None] * power)


GRAZING = 0.03
"""Cosine to a light below which a hard shadow is uncertain."""


@dataclass
class Shaded:
    """Colours of rays, and all that says how certain they are."""

    color: Array  # (2, N, 3): patterns asked a little inside of the solid, and a little outside
    t: Array
    normal: Array
    part: NDArray[np.int64]
    lit: Array  # (L, N): how much of each light is seen; also of what a mirror shows
    close: NDArray[np.bool_]
    flipped: Array  # (L, 2, N, 3): with that light's shadow the other way


class Brute:
    """The pictures of one scene. size : width and height in pixels."""

    def __init__(self, spec: Spec, size: tuple[int, int]) -> None:
        self.spec, self.size = spec, size
        trees = operands(spec.trees)
        self.parts, self.blockers, self.reflected = (
            [part_of(shown(tree, rays)) for tree in trees] for rays in ("camera", "shadow", "reflection")
        )
        self.eye = np.asarray(spec.position, float)
        self.scale = float(np.linalg.norm(np.asarray(spec.target, float) - self.eye))
        self.parallel = spec.height is not None
        self.tan = 0.5 * (spec.height or 0.0) if self.parallel else math.tan(math.radians(spec.fov) / 2.0)
        self.pixel = 2.0 * self.tan / size[1]

    def foot(self, t: Array) -> Array:
        """Width of a pixel at distances along rays."""
        return np.full_like(t, self.pixel) if self.parallel else self.pixel * t

    def camera_rays(self, x: Array, y: Array) -> Rays:
        """Rays through places of the picture, in pixels from its upper left corner."""
        width, height = self.size
        back = (self.eye - np.asarray(self.spec.target, float)) / self.scale
        right = np.cross((0.0, 1.0, 0.0), back)
        right /= np.linalg.norm(right)
        up = np.cross(back, right)
        u = (2.0 * x / width - 1.0) * self.tan * width / height
        v = (1.0 - 2.0 * y / height) * self.tan
        aside = u[:, None] * right + v[:, None] * up
        n, coarse = len(x), 8 * ULP * np.abs(self.eye).max()
        origin = np.tile(self.eye, (n, 1)) + (aside if self.parallel else 0.0)
        d = np.tile(-back, (n, 1)) if self.parallel else aside - back
        d /= np.linalg.norm(d, axis=1)[:, None]
        cosine = d @ -back
        start, end = self.spec.near / cosine, np.minimum(self.spec.far / cosine, FAR * self.scale)
        wide = coarse + (0.3 * self.pixel if self.parallel else 0.0)
        grows = 8 * ULP + (0.0 if self.parallel else 0.3 * self.pixel)
        return Rays(origin, d, start, end, np.full(n, wide), np.full(n, grows))

    def trace(self, x: Array, y: Array) -> Shaded:
        rays = self.camera_rays(x, y)
        made = self._shaded(rays, np.zeros(len(x)), None, self.spec.bounces)
        if self.spec.near > 0.0 or self.parallel:  # what starts in a solid shows its inner side
            first = rays.at(rays.start)
            within = np.min([distance(part.tree, first) for part in self.parts], axis=0)
            made.close |= within < rays.width(rays.start)
        if math.isfinite(self.spec.far):
            made.close |= np.abs(made.t - rays.end) < 4.0 * rays.width(rays.end)
        return made

    def _shaded(self, rays: Rays, travelled: Array, own: Any, bounces: int) -> Shaded:
        spec, n = self.spec, len(rays.start)
        parts = self.parts if own is None else self.reflected
        met = meet(parts, rays, own)
        lights = len(spec.lights)
        made = Shaded(
            np.tile(np.asarray(spec.sky, float), (2, n, 1)), met.t, np.zeros((n, 3)), met.part,
            np.ones((lights, n)), met.close, np.tile(np.asarray(spec.sky, float), (lights, 2, n, 1)),
        )  # fmt: skip
        if spec.fog is not None and spec.fog[2] > 0.0 and own is None:  # a layer also covers the sky
            made.color, made.flipped = (self._fogged(c, rays, np.full(n, math.inf)) for c in (made.color, made.flipped))
        hit = np.flatnonzero(np.isfinite(met.t))
        if not len(hit):
            return made
        t, d = met.t[hit], rays.direction[hit]
        p, part = rays.origin[hit] + t[:, None] * d, met.part[hit]
        foot = self.foot(travelled[hit] + t)
        normal, values = self._local(parts, p, part, foot)
        made.close[hit] |= self._beside_a_border(parts, p, d, normal, part, foot, values)
        made.normal[hit] = normal
        view = -d
        ambient_open = self._open(p, normal)
        color = np.zeros((2, len(hit), 3))
        flipped = np.zeros((lights, 2, len(hit), 3))
        if spec.sky_light:
            color += (ambient_open[:, None] * np.asarray(spec.sky)) * values[..., COLOR] * (1 - values[..., MIRROR:])
        for i, light in enumerate(spec.lights):
            at = light_at(light, p)
            facing = np.sum(normal * at.direction, axis=1)
            seen, unsure = self._seen(light, at, p, normal, part, facing, foot)
            given = at.radiance * self._answer(normal, view, at.direction, facing, values)
            everywhere = at.radiance * values[..., COLOR] * (values[..., AMBIENT, None] * ambient_open[:, None])
            color += everywhere + seen[:, None] * given
            flipped[i] = (1.0 - 2.0 * seen)[:, None] * given
            made.lit[i, hit] = seen
            made.close[hit] |= unsure & (np.abs(given).max(axis=(0, 2)) > 1e-3)
        self._mirrored(made, hit, p, normal, d, part, values[0], foot, travelled[hit] + t, bounces, color)
        flipped = flipped + color
        if spec.fog is not None and own is None:
            color, flipped = (self._fogged(c, rays.of(hit), t) for c in (color, flipped))
        made.color[:, hit] = color
        made.flipped[:, :, hit] = flipped
        return made

    def _fogged(self, color: Array, rays: Rays, t: Array) -> Array:
        """Colours (..., N, 3) behind a length of fog, whose density is exponential in the height."""
        assert self.spec.fog is not None
        fog, density, falloff, height = self.spec.fog
        rate = falloff * rays.direction[:, 1]
        with np.errstate(all="ignore"):
            reach = np.where(rate == 0.0, t, -np.expm1(-rate * t) / rate)
            depth = density * np.exp(falloff * (height - rays.origin[:, 1])) * reach
        left = np.exp(-depth)[:, None]
        behind = np.asarray(self.spec.sky if fog is None else fog, float)
        return np.asarray(behind + left * (color - behind))

    def _local(
        self, parts: list[Part], p: Array, part: NDArray[np.int64], foot: Array, known: Array | None = None
    ) -> tuple[Array, Array]:
        """Normals, if not known, and materials a little inside and a little outside of the solid, (2, N, 7)."""
        normal, values = np.zeros_like(p) if known is None else known, np.zeros((2, len(p), 7))
        for i, one in enumerate(parts):
            rows = part == i
            if rows.any():
                size = (
                    np.full(rows.sum(), one.radius) if math.isfinite(one.radius) else np.maximum(self.scale, foot[rows])
                )
                if known is None:
                    normal[rows] = normal_of(one, p[rows], size)
                for side, sign in enumerate((-1.0, 1.0)):
                    at = p[rows] + sign * (1e-5 * size)[:, None] * normal[rows]
                    found = surface(one.tree, at, self.spec.materials).values
                    values[side, rows] = _values(GREY, at) if found is None else found
        return normal, values

    def _beside_a_border(
        self, parts: list[Part], p: Array, d: Array, normal: Array, part: Any, foot: Array, values: Array
    ) -> Any:
        """Where a pattern changes within a few hundredths of a pixel."""
        found = np.zeros(len(p), bool)
        if not any(material.get("color", " ")[0] == "checker" for material in self.spec.materials):
            return found
        cosine = np.maximum(np.abs(np.sum(d * normal, axis=1)), 1e-3)[:, None]
        across = np.cross(d, normal) / np.maximum(np.linalg.norm(np.cross(d, normal), axis=1), 1e-9)[:, None]
        along = np.cross(normal, across) / cosine
        for shift in (across, along):
            for sign in (-0.04, 0.04):
                other = self._local(parts, p + sign * foot[:, None] * shift, part, foot, normal)[1]
                found |= np.all(np.abs(other - values)[..., COLOR].max(axis=-1) > 0.02, axis=0)
        return found

    def _open(self, p: Array, normal: Array) -> Array:
        """Ambient occlusion: a weighted mean of distance over length along the normal."""
        if self.spec.occlusion is None:
            return np.ones(len(p))
        steps, reach, strength, decay = self.spec.occlusion
        missing = weights = 0.0
        for i in range(steps):
            far = reach * (i + 1) / steps
            at = p + far * normal
            r = np.min([distance(part.tree, at) for part in self.blockers], axis=0)
            missing = missing + decay**i * np.clip(1.0 - r / far, 0.0, 1.0)
            weights += decay**i
        return np.asarray(np.clip(1.0 - strength * missing / weights, 0.0, 1.0))

    def _seen(
        self, light: dict[str, Any], at: Light, p: Array, normal: Array, part: Any, facing: Array, foot: Array
    ) -> Any:
        """Whether each point sees the light, 0 or 1, and where that is uncertain."""
        n = len(p)
        seen = (facing > 0.0).astype(float)
        unsure = np.abs(facing) < GRAZING
        if not light.get("shadow"):
            return np.ones(n), np.zeros(n, bool)
        rows = np.flatnonzero(facing > 0.0)
        size = 8 * ULP * np.maximum(np.abs(p[rows]).max(axis=1), np.abs(self.eye).max())
        base = 0.5 * foot[rows] + size
        start = 0.05 * base / np.maximum(facing[rows], GRAZING)
        end = np.minimum(at.distance[rows], FAR * self.scale)
        rays = Rays(p[rows], at.direction[rows], start, end, base, np.full(len(rows), 8 * ULP))
        shadow = meet(self.blockers, rays, part[rows])
        # What lies deep in a solid that casts shadows, and is hidden from the camera, is dark.
        deep = np.max([-distance(each.tree, p[rows]) for each in self.blockers], axis=0, initial=0.0)
        seen[rows] = ~np.isfinite(shadow.t) & (deep <= 4.0 * base)
        unsure[rows] |= shadow.close | ((deep > base) & (deep <= 8.0 * base))
        return seen, unsure

    def _answer(self, normal: Array, view: Array, to: Array, facing: Array, values: Array) -> Array:
        """What a surface sends to the eye of a light that faces it: Phong's terms, or a mirror's glint; (2, N, 3)."""
        lit = np.maximum(facing, 0.0)
        bounced = 2.0 * facing[:, None] * normal - to
        high = np.where(facing > 0.0, np.maximum(np.sum(bounced * view, axis=1), 0.0), 0.0)
        gloss = np.where(high > 0.0, np.power(high, values[..., SHININESS]), 0.0)
        matte = lit[:, None] * values[..., COLOR] + (values[..., SPECULAR] * gloss)[..., None]
        half = to + view
        half /= np.maximum(np.linalg.norm(half, axis=1), 1e-300)[:, None]
        alpha, nv = 1e-3, np.maximum(np.sum(normal * view, axis=1), 1e-4)
        sine = np.linalg.norm(np.cross(normal, half), axis=1)
        cosine = np.sum(normal * half, axis=1)
        d_ggx = alpha**2 / (math.pi * (sine**2 + alpha**2 * cosine**2) ** 2)
        below = lit * np.sqrt(nv**2 * (1 - alpha**2) + alpha**2) + nv * np.sqrt(lit**2 * (1 - alpha**2) + alpha**2)
        fresnel = _schlick(values[..., COLOR], np.sum(half * view, axis=1))
        glint = fresnel * (math.pi * d_ggx * lit * 0.5 / np.maximum(below, 1e-300))[:, None]
        mirror = values[..., MIRROR:]
        return np.asarray((1.0 - mirror) * matte + mirror * glint)

    def _mirrored(
        self, made: Shaded, hit: Any, p: Array, normal: Array, d: Array, part: Any, values: Array, foot: Array,
        travelled: Array, bounces: int, color: Array,
    ) -> None:  # fmt: skip
        """Adds what mirrors show, once; a mirror in a mirror is uncertain."""
        rows = np.flatnonzero(values[:, MIRROR] > 0.0)
        if not len(rows):
            return
        if bounces < self.spec.bounces or not bounces:
            made.close[hit[rows]] = True
            return
        cosine = -np.sum(normal[rows] * d[rows], axis=1)
        away = d[rows] + 2.0 * cosine[:, None] * normal[rows]
        base = 0.5 * foot[rows] + 8 * ULP * np.abs(p[rows]).max(axis=1)
        start = 0.05 * base / np.maximum(cosine, GRAZING)
        far = np.full(len(rows), FAR * self.scale)
        next_rays = Rays(p[rows], away, start, far, base, np.full(len(rows), 0.3 * self.pixel + 8 * ULP))
        seen = self._shaded(next_rays, travelled[rows], part[rows], bounces - 1)
        color[:, rows] += _schlick(values[rows, COLOR], cosine) * seen.color
        made.close[hit[rows]] |= seen.close | (cosine < GRAZING)
        made.lit[:, hit[rows]] += 2 * seen.lit
        made.part[hit[rows]] += 100 * (1 + seen.part)

    def picture(self) -> Picture:
        """What each pixel shows at its centre, and what its corners say of that."""
        width, height = self.size
        cx, cy = (a.ravel() for a in np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5))
        kx, ky = (a.ravel() for a in np.meshgrid(np.arange(width + 1.0), np.arange(height + 1.0)))
        all_rays = self.trace(np.concatenate([cx, kx]), np.concatenate([cy, ky]))
        n = width * height

        def split(values: Any) -> tuple[Any, list[Any]]:
            """At the centres (..., H, W), and at the four corners of each."""
            centres = values[:n].reshape(height, width, *values.shape[1:])
            grid = values[n:].reshape(height + 1, width + 1, *values.shape[1:])
            return centres, [grid[:-1, :-1], grid[1:, :-1], grid[:-1, 1:], grid[1:, 1:]]

        t, t_corners = split(all_rays.t)
        normal, normal_corners = split(all_rays.normal)
        hit = np.isfinite(t)
        certain = np.ones_like(hit)
        for other in t_corners:
            certain &= np.isfinite(other) == hit
        for values in (all_rays.close, *all_rays.lit):
            centre, corners = split(values)
            for other in corners:
                certain &= other == centre
            if values.dtype == bool:
                certain &= ~centre
        turned = np.max([np.linalg.norm(other - normal, axis=-1) for other in normal_corners], axis=0)
        certain &= turned < 0.5
        with np.errstate(invalid="ignore"):
            apart = np.max([np.abs(other - t) for other in t_corners], axis=0)
        certain &= ~hit | (apart < 0.3 * t)
        colors, spans = [], []
        for version in all_rays.color:
            centre, corners = split(version)
            colors.append(centre)
            spans.append(np.max([np.abs(other - centre).max(axis=-1) for other in corners], axis=0))
        flipped = np.array([[split(version)[0] for version in light] for light in all_rays.flipped])
        part = split(all_rays.part)[0]
        return Picture(t, normal, np.array(colors), np.array(spans), apart, turned, certain, part, flipped)


@dataclass
class Picture:
    """Arrays (H, W, ...). color, span: of the two sides that patterns are asked on; span, apart, turned: by how much
    colour, depth and normal vary within the pixel; certain: False at silhouettes, creases and borders of shadows."""

    t: Array
    normal: Array
    color: Array
    span: Array
    apart: Array
    turned: Array
    certain: NDArray[np.bool_]
    part: NDArray[np.int64]
    flipped: Array


def _schlick(f0: Array, cosine: Array) -> Array:
    rest = (1.0 - np.clip(cosine, 0.0, 1.0))[:, None]
    return np.asarray(f0 + (1.0 - f0) * rest**5)
