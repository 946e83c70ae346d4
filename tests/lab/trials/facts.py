"""Rows 5 to 7, 9, 11, 12 and 26: bounds, ranges, distances far away, refusals, doubts, normals of tapered faces."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

import raymarch as rm
from tests.lab.trials.row import Array, Figure, looking_down, quiet, refused


def _turn(angle: float, axis: Any) -> Array:
    x, y, z = np.asarray(axis, float) / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.asarray(np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross)


CORNERS = np.array(np.meshgrid((-1, 1), (-1, 1), (-1, 1))).reshape(3, 8).T
AXES = {"x": (1, 0, 0), "y": (0, 1, 0), "z": (0, 0, 1), "xy": (1, 1, 0), "askew": (0.3, -1, 2)}


def _excess(bounds: tuple[Array, Array], lower: Array, upper: Array) -> tuple[float, float]:
    """How far the true box reaches out of the stated one, and the largest ratio of their sides."""
    out = max(float((bounds[0] - lower).max()), float((upper - bounds[1]).max()))
    return out, float(((bounds[1] - bounds[0]) / (upper - lower)).max())


def turned() -> Iterator[Figure]:
    """Boxes of solids that turn by time, by parameters and by numbers, about five axes."""
    out, ratio, which = -1.0, 0.0, ""
    moments = np.linspace(0, 2 * math.pi, 721)
    spun = rm.Param("a", 0.0, -10.0, 10.0)
    shapes: list[tuple[str, rm.Node, Array, float]] = [
        ("ball", rm.sphere(1), np.zeros((1, 3)), 1.0),
        ("box", rm.box((2, 1, 0.6)), CORNERS * (1, 0.5, 0.3), 0.0),
        ("capsule", rm.capsule((0, -1, 0), (0, 1, 0), 0.3), np.array([[0, -1.0, 0], [0, 1, 0]]), 0.3),
        ("two balls", rm.sphere(0.5) | rm.sphere(0.5).translate((2, 0, 0)), np.array([[0.0, 0, 0], [2, 0, 0]]), 0.5),
    ]
    for name, node, points, radius in shapes:
        for axis, way in AXES.items():
            swept = np.concatenate([points @ _turn(a, way).T for a in moments])
            for how, angle in (("time", rm.time), ("Param", spun), ("3 time", 3 * rm.time + 1)):
                found = _excess(node.rotate(angle, way).bounds, swept.min(0) - radius, swept.max(0) + radius)
                out = max(out, found[0])
                if found[1] > ratio:
                    ratio, which = found[1], f"{name} about {axis} by {how}"
    yield Figure("turned by time or Param: how far solids reach out of their box", "-", out, 1e-4)
    yield Figure(f"side of the box over the tight one, worst {which}", "3 (a ball)", ratio, 1.75)
    ball, box = rm.sphere(1), rm.box(1)
    for _ in range(10):
        ball = ball.rotate(1, "x")
    for _ in range(2000):
        box = box.rotate(1, "x")
    yield Figure(
        "ten nested turns of a ball: its box over 2",
        "25",
        float(np.ptp(np.array(ball.bounds), axis=0).max() / 2),
        1.001,
    )
    tight = np.ptp(0.5 * CORNERS @ _turn(2000, (1, 0, 0)).T, axis=0)
    side = float((np.ptp(np.array(box.bounds), axis=0) / tight).max())
    yield Figure("2,000 nested turns of a box: its box over the tight one", "-7.5e280 in GLSL", side, 1.001)
    with quiet():
        covered = float(
            np.isfinite(
                rm.truth(rm.Scene(rm.box(1).rotate(rm.time, "x").rotate(1.3 * rm.time, "y")), (64, 36)).depth
            ).mean()
        )
    yield Figure("a tumbling box covers less than 2 % of its default picture", ".3 %", float(covered < 0.02), 0)


def _legal() -> dict[str, Callable[[], Any]]:
    hashed, k = rm.hash, rm.Param("k", 0.3, 0.0, 1.0)

    def cells(build: Any) -> Callable[[], Any]:
        return lambda: rm.repeat_varied(build, 1, (3, 1, 3)).glsl()

    def painted(color: Callable[[Any], Any]) -> Callable[[], Any]:
        return cells(lambda i: rm.sphere(0.3).material(rm.Material(albedo=color(i))))

    calls = {
        f"colormap {name}": painted(lambda i, n=name: rm.colormap(hashed(i), n)) for name in ("viridis", "inferno")
    }
    calls |= {
        "colormap of noise": painted(lambda i: rm.colormap(rm.value_noise(i), "coolwarm", -1, 1)),
        "polynomial": painted(lambda i: rm.vec3(1, 1, 1) * (hashed(i) * (1 - hashed(i)) * 4)),
        "smoothstep": painted(lambda i: rm.vec3(1, 1, 1) * rm.smoothstep(0, 1, hashed(i))),
        "moved by noise": cells(lambda i: rm.sphere(0.3).translate((0.19 * rm.value_noise(i), 0, 0))),
        "turned boxes": cells(lambda i: rm.box(0.4).rotate(rm.tau * hashed(i), (1, 1, 0))),
        "turned twice": cells(lambda i: rm.box(0.5).rotate(hashed(i), "y").rotate(9 * hashed(i), "x")),
        "ellipsoids": lambda: rm.repeat_varied(
            lambda i: rm.ellipsoid((0.7 + 0.1 * hashed(i), 1, 0.7)).translate((0, 0.1 * rm.value_noise(i), 0)),
            2,
            (3, 1, 3),
        ).glsl(),
    }
    for blend in ("quadratic", "cubic", "circular", "root", "exponential", "round", "chamfer"):
        calls[f"k from 0, {blend}"] = lambda b=blend: rm.union(rm.sphere(), rm.box(), k=k, blend=b).glsl()
        calls[f"k from 0, {blend}, cut"] = lambda b=blend: rm.difference(rm.sphere(), rm.box(), k=k, blend=b).glsl()
    return calls


def ranges() -> Iterator[Figure]:
    """Legal values are taken, and every one of them is drawn."""
    calls = _legal()
    with quiet():
        bad = [name for name, call in calls.items() if refused(call)]
    yield Figure(f"{len(calls)} legal calls: refused {', '.join(bad)}", "3", len(bad), 0)


def varied() -> Iterator[Figure]:
    """Cells with solids of sizes and places of their own are drawn."""
    node = rm.repeat_varied(
        lambda i: rm.ellipsoid((0.7 + 0.1 * rm.hash(i), 1, 0.7)).translate((0, 0.1 * rm.value_noise(i), 0)),
        2,
        (3, 1, 3),
    )
    with quiet():
        shown = float(np.isfinite(rm.truth(rm.Scene(node), (32, 18)).depth).mean())
    yield Figure("varied ellipsoids (row 7) are drawn", "crash", float(shown < 0.02), 0)


def far_from_a_mesh() -> Iterator[Figure]:
    """The distance to meshes of a ball and of a box, outside of their grids."""
    import trimesh

    random, worst = np.random.default_rng(9), 0.0
    with tempfile.TemporaryDirectory() as tmp, quiet():
        trimesh.creation.icosphere(5).export(f"{tmp}/ball.stl")
        trimesh.creation.box((1, 2, 3)).export(f"{tmp}/box.stl")
        for name in ("ball", "box"):
            node = rm.mesh(f"{tmp}/{name}.stl", cache=tmp)
            way = random.normal(size=(400, 3))
            p = way / np.linalg.norm(way, axis=1)[:, None] * 10 ** random.uniform(0.35, 3, (400, 1))
            if name == "ball":
                wanted = np.linalg.norm(p, axis=1) - 1
                at_two = abs(float(node.distance(np.array([[2.0, 0, 0]]))[0]) - 1)
            else:
                wanted = np.linalg.norm(np.maximum(np.abs(p) - (0.5, 1, 1.5), 0), axis=1)
            worst = max(worst, float(np.abs(node.distance(p) / wanted - 1).max()))
    yield Figure("mesh of a unit ball at (2, 0, 0): error of 1", ".321", at_two, 0.1)
    yield Figure("meshes of a ball and a box at 2 to 1,000: too low by", "-", worst, 0.4)


def refusals() -> Iterator[Figure]:
    """What would drop a solid silently is refused."""
    a, b = rm.sphere(), rm.box()
    calls: list[Callable[[], Any]] = [
        lambda: a and b,
        lambda: a or b,
        lambda: not a,
        lambda: bool(a),
        lambda: a.translate((1, 0, 0)) and b,
        lambda: rm.circle() or rm.rectangle((1, 1)),
        lambda: b if a else None,
        lambda: any([a, b]),
    ]
    yield Figure("truth values of solids that pass", "3", sum(not refused(call) for call in calls), 0)


def empty_frames() -> Iterator[Figure]:
    """A solid that has moved out by time or a Param is told of."""
    away = rm.Param("away", 0.0, 0.0, 100.0)
    moved: dict[str, tuple[rm.Node, dict[str, Any]]] = {
        "time": (rm.sphere().translate((50 * rm.time, 0, 0)), {"time": 2.0}),
        "Param": (rm.sphere().translate((away, 0, 0)), {"params": {"away": 100.0}}),
        "behind": (rm.box().translate((0, 50 * rm.time, 0)), {"time": 2.0}),
        "shrunk": (rm.sphere(rm.max(1 - rm.time, 0)), {"time": 2.0}),
        "number": (rm.sphere().translate((100, 0, 0)), {}),
    }
    silent = []
    with quiet(), rm.Renderer((32, 18)) as renderer:
        for name, (node, how) in moved.items():
            frame = renderer.render(rm.Scene(node, rm.Camera((0, 0, 5), (0, 0, 0))), **how)
            if not frame.doubts():
                silent.append(name)
    yield Figure(f"empty frames without a doubt: {', '.join(silent)}", "1", len(silent), 0)


def tapered() -> Iterator[Figure]:
    """Normals where a solid touches the box of `taper` and other deformations, against the exact deformed faces."""
    worst = 0.0
    for rate in (0.3, -0.3, 0.6):
        node = rm.box((2, 1, 1)).taper(rate)
        scene = rm.Scene(node, looking_down(1.2), lights=[])
        with quiet(), rm.Renderer((60, 60)) as renderer:
            normal = renderer.render(scene, outputs=("normal",)).normal
        worst = max(worst, float(np.degrees(np.arccos(np.clip(normal[10:-10, 10:-10, 1], -1, 1))).max()))
    yield Figure("top of a tapered box: degrees off its normal", "47", worst, 0.5)
    ends = [
        float(rm.sphere(0.2).repeat_mirrored(1, n).bounds[1][0])
        for n in ((1, None, None), (2, None, None), (3, None, None))
    ]
    yield Figure(
        "repeat_mirrored of 1, 2, 3: its end against the docs",
        "docs differ",
        float(np.abs(np.array(ends) - (0.2, 0.7, 1.2)).max()),
        1e-9,
    )
