"""Rows 1, 2 and 10: fillets in chains, walls of deformed solids, and sections between polygons."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterator

import numpy as np
from scipy.spatial import cKDTree

import raymarch as rm
from tests.hard.brute import blended, distance
from tests.lab.trials.row import Array, Figure, crossing, quiet

HALVES = {
    "quadratic": 0.25,
    "cubic": 0.25,
    "quartic": 0.25,
    "circular": 0.25,
    "exponential": 0.25,
    "round": 1 - math.sqrt(0.5),
    "chamfer": 0.5,
}
"""How far from both planes of a right corner the middle of each blend lies, over its k."""


def _depth(node: rm.Node, corner: Array, way: Array, solid: bool) -> float:
    """How far from a corner, along its diagonal, the surface lies."""
    way = way / np.linalg.norm(way)

    def held(p: Array) -> Array:
        return (node.distance(p) <= 0) == solid

    return float(crossing(held, corner[None], way[None], 3.0)[0]) / math.sqrt(2)


def chains() -> Iterator[Figure]:
    """Ribs on a bar, holes in it and cuts of it, joined one by one; each corner is as the first."""
    worst = {"union": 0.0, "difference": 0.0, "intersection": 0.0}
    for blend, share in HALVES.items():
        k = 1.0
        for count in range(1, 9):
            fillet = rm.box((200, 4, 20))
            groove = rm.box((200, 4, 20))
            bar = rm.box((200, 4, 20)).translate((0, 0, 0))
            for i in range(count):
                rib = rm.box((4, 20, 10)).translate((-80 + 20 * i, 8, 0))
                fillet = rm.union(fillet, rib, k=k, blend=blend)
                groove = rm.difference(groove, rib, k=k, blend=blend)
                bar = rm.intersection(bar, rm.plane((0, 0, 1), 5 - 0.1 * i) | rm.box(0.01), k=k, blend=blend)
            for i in {0, count - 1}:
                corner = np.array((-78.0 + 20 * i, 2.0, 0.0))
                found = _depth(fillet, corner, np.array((1.0, 1.0, 0.0)), True) / k
                worst["union"] = max(worst["union"], abs(found / share - 1))
                found = _depth(groove, corner, np.array((1.0, -1.0, 0.0)), False) / k
                worst["difference"] = max(worst["difference"], abs(found / share - 1))
            if count == 1:
                found = _depth(bar, np.array((0.0, 2.0, 5.0)), np.array((0.0, -1.0, -1.0)), False) / k
                worst["intersection"] = max(worst["intersection"], abs(found / share - 1))
    for kind, now in worst.items():
        yield Figure(f"chains of 1 to 8, 7 blends, {kind}: corner against its closed form", "sqrt 2 each", now, 0.01)
    built = rm.box((100, 4, 20))
    for i in range(5):
        built = rm.union(built, rm.box((4, 20, 10)).translate((-40 + 20 * i, 8, 0)), k=1, blend="round")
    way = np.array((1.0, 1.0, 0.0))
    found = [_depth(built, np.array((-38.0 + 20 * i, 2.0, 0.0)), way, True) / HALVES["round"] for i in range(5)]
    yield Figure("the five fillets of 1", ".94 1.32 1.87 2.65 3.75", float(np.abs(np.array(found) - 1).max()), 0.01)
    moved = rm.Param("k", 0.5, 0.0, 2.0)
    built = rm.box((100, 4, 20))
    for i in range(5):
        built = rm.difference(built, rm.cylinder(4, 20).translate((-40 + 20 * i, 0, 0)), k=moved, blend="chamfer")
    ends = [np.array((-36.0 + 20 * i, 2.0, 0.0)) for i in range(5)]
    with quiet():
        found = []
        for corner in ends:

            def open_at(p: Array) -> Array:
                return built.distance(p, params={"k": 1.5}) > 0

            way = np.array((1.0, -1.0, 0.0)) / math.sqrt(2)
            found.append(float(crossing(open_at, corner[None], way[None], 3.0)[0]) * math.sqrt(2))
    yield Figure(
        "legs of chamfered holes, k a Param at 1.5", ".5 to 1.99", float(np.abs(np.array(found) / 1.5 - 1).max()), 0.01
    )


def _surface(node: rm.Node, seed: int, count: int) -> Array:
    """Points of a surface, by bisection between random points inside and outside."""
    random = np.random.default_rng(seed)
    lower, upper = (np.asarray(b) for b in node.bounds)
    size = upper - lower
    ends = random.uniform(lower - 0.05 * size, upper + 0.05 * size, (2, 8 * count, 3))
    held = node.distance(ends.reshape(-1, 3)).reshape(2, -1) <= 0
    pick = np.flatnonzero(held[0] & ~held[1])[:count]
    start, way = ends[0][pick], ends[1][pick] - ends[0][pick]
    far = np.linalg.norm(way, axis=1)
    share = crossing(lambda p: node.distance(p) <= 0, start, way, 1.0)
    assert far.min() > 0
    return np.asarray(start + share[:, None] * way)


def _ball(tmp: str) -> rm.Node:
    import trimesh

    trimesh.creation.icosphere(4).export(f"{tmp}/ball.stl")
    return rm.mesh(f"{tmp}/ball.stl", cache=tmp)


def _walls(tmp: str) -> dict[str, rm.Node]:
    box, lump = rm.box((1, 0.8, 0.9)), rm.sphere(0.8)
    return {
        "mesh": _ball(tmp),
        "twist": rm.box(1).twist(2),
        "bend": rm.box((2, 0.3, 0.6)).bend(0.5),
        "taper": box.taper(0.3),
        "shear": box.shear(0.7),
        "shear back": lump.shear(0.7).shear(-0.7),
        "chamfer": rm.union(lump, rm.box(1.2), k=0.2, blend="chamfer"),
        "scale": lump.scale((2, 0.5, 1)),
        "turned scale": lump.rotate(0.6, (1, 2, 0)).scale((2, 1, 0.6)).twist(0.5),
        "displace": lump.displace(0.02, 6),
        "ellipsoid": rm.ellipsoid((2, 1, 0.6)),
        "implicit": rm.implicit(lambda p: p.x**4 + p.y**4 + p.z**4 - 1, bounds=((-1.3,) * 3, (1.3,) * 3)),
        "wrap": rm.box((3, 0.6, 0.4)).wrap_around(-1.5, 1.5),
    }


def tails() -> Iterator[Figure]:
    """Blends that reach far, root and circular-geometric: the chain against the same chain in NumPy."""
    random, worst = np.random.default_rng(3), 0.0
    bar = ("box", (100, 4, 20))
    ribs = [("move", (-40 + 20 * i, 8, 0), ("box", (4, 20, 10))) for i in range(5)]
    for blend in ("root", "circular_geometric"):
        node = rm.box((100, 4, 20))
        for i in range(5):
            node = rm.union(node, rm.box((4, 20, 10)).translate((-40 + 20 * i, 8, 0)), k=1, blend=blend)

            def inside(p: Array, count: int = i + 1, blend: str = blend) -> Array:
                value = distance(bar, p)
                for rib in ribs[:count]:
                    value = blended(value, distance(rib, p), 1.0, blend)
                return value <= 0

            corner = np.array((-38.0 + 20 * i, 2.0, 0.0)) + random.uniform(-1, 1, (40, 3)) * (0, 0, 3)
            way = np.broadcast_to(np.array((1.0, 1.0, 0.0)) / math.sqrt(2), corner.shape)
            found = crossing(lambda p, node=node: node.distance(p) <= 0, corner - 0.1 * way, way, 3.0)
            worst = max(worst, float(np.abs(found - crossing(inside, corner - 0.1 * way, way, 3.0)).max()))
    yield Figure("chains of 5, root and circular_geometric, against NumPy", "sqrt 2 each", worst, 0.005)


def walls() -> Iterator[Figure]:
    """Offsets by .02 and shells of .04 of each deformation: the new surface against points of the old, and doubts."""
    import tempfile

    t, off, named = 0.02, {}, {}
    with tempfile.TemporaryDirectory() as tmp, quiet(), rm.Renderer((8, 8)) as renderer:
        for name, node in _walls(tmp).items():
            old = cKDTree(_surface(node, 1, 60_000))
            for way, moved in (("offset", node.offset(t)), ("shell", node.shell(2 * t))):
                near, _ = old.query(_surface(moved, 2, 400))
                found = float(np.median(near)) / t
                told = [
                    re.search(r"moves by (\S+) to (\S+) times", str(d))
                    for d in renderer.render(rm.Scene(moved)).doubts()
                ]
                low, high = next(((float(m[1]), float(m[2])) for m in told if m), (1.0, 1.0))
                off[f"{way} of {name}"] = max(low - found, found - high, 0.0)
        ball = _ball(tmp)
        x = np.array([[1.0, 0.0, 0.0]])
        zero = np.zeros((1, 3))
        wall = 2 * (float(crossing(lambda p: ball.shell(0.1).distance(p + 1.0 * x) <= 0, zero, x, 0.5)[0]))
        named["mesh ball shell(.1)"] = abs(wall / 0.1 - 1)
        reach = float(crossing(lambda p: ball.offset(0.2).distance(p) <= 0, zero, x, 2.0)[0])
        named["mesh ball offset(.2)"] = abs((reach - 1) / 0.2 - 1)
        box = rm.box(1).twist(2).offset(0.1)
        y = np.array([[0.0, 1.0, 0.0]])
        named["box(1).twist(2).offset(.1), up"] = abs(
            (float(crossing(lambda p: box.distance(p) <= 0, zero, y, 2.0)[0]) - 0.5) / 0.1 - 1
        )
    worst = max(off, key=lambda each: off[each])
    yield Figure(
        f"13 solids, offset and shell: thickness beyond what is asked or told, worst {worst}",
        "1.3 to 1.9 x",
        off[worst],
        0.08,
    )
    for name, now in named.items():
        yield Figure(name, ".148, .334, .193", now, 0.05)


def sections() -> Iterator[Figure]:
    """`extrude_to` between polygons: the corner of each section lies on the line between the corners."""
    worst = 0.0
    for (a, b), sides in itertools.product(((2.0, 1.0), (1.0, 3.0), (2.0, 0.1)), (4, 3)):
        if sides == 4:
            low, high = rm.rectangle((a, a)), rm.rectangle((b, b))
            corners = np.array((0.5 * a, 0.5 * a)), np.array((0.5 * b, 0.5 * b))
        else:
            corner = [(math.cos(t), math.sin(t)) for t in (math.pi / 2, math.pi * 7 / 6, math.pi * 11 / 6)]
            low, high = (rm.polygon([(s * x, s * y) for x, y in corner]) for s in (a, b))
            corners = np.array((0.0, a)), np.array((0.0, b))
        node = low.extrude_to(high, 2.0, "linear")
        for z in (-0.5, 0.0, 0.7):
            share = 0.5 + 0.5 * z
            wanted = np.linalg.norm((1 - share) * corners[0] + share * corners[1])
            way = corners[0] / np.linalg.norm(corners[0])
            for up in ((way[0], way[1], 0.0),):
                start = np.array([[0.0, 0.0, z]])
                found = crossing(lambda p, node=node: node.distance(p) <= 0, start, np.array([up]), 5.0)[0]
                other = crossing(lambda p, node=node: node.distance(p) <= 0, start * (1, 1, -1), np.array([up]), 5.0)[0]
                worst = max(worst, min(abs(found / wanted - 1), abs(other / wanted - 1)))
    yield Figure("corners of sections between squares and triangles", ".707 for .75", worst, 0.01)
