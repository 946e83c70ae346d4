"""Random scenes of objects as data, held against the same objects as text, the truth and the proof of their hits.

python -m tests.lab.objects [FIRST] [LAST]   (seeds, 0 to 100 by default; ends with code 1 if a picture is wrong)
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

import raymarch as rm
from raymarch.plan.gather import gather
from tests.hard.proofs import contradicted
from tests.hard.referee import Referee
from tests.hard.world import World

SIZE = (64, 48)
BLENDS = ("quadratic", "cubic", "quartic", "circular")


class Drawn:
    """A scene drawn by its seed: objects, what is done to their union, camera, lights and effects."""

    def __init__(self, seed: int) -> None:
        self.random = r = np.random.default_rng(seed)
        self.scale = float(r.choice([1e-3, 1.0, 1.0, 1e3]))
        self.spread = self.scale * float(r.choice([0.5, 1.2, 3.0]))
        self.special = str(r.choice(["", "", "glass", "mirror", "physical"]))
        self.labelled, self.on_lattice, self.moves = r.random() < 0.6, r.random() < 0.15, r.random() < 0.3
        self.params = [rm.Param("place", 0.4, 0.1, 0.9), rm.Param("tone", 0.6, 0.1, 1.0)]
        self.kinds = r.choice(len(self.shapes()), r.integers(1, 4), replace=False)

    def length(self, low: float, high: float) -> float:
        return self.scale * float(self.random.uniform(low, high))

    def vector(self, low: float, high: float) -> NDArray[np.float64]:
        return self.scale * self.random.uniform(low, high, 3)

    def material(self) -> rm.Material:
        r = self.random
        color: Any = tuple(r.uniform(0.1, 1, 3))
        kind = r.integers(0, 4)
        if kind == 1:
            color = rm.checker(color, tuple(r.uniform(0.1, 1, 3)), self.length(0.2, 0.4))
        elif kind == 2 and self.moves:
            color = (self.params[1], 0.2, 0.3)
        if not self.special:
            return rm.Material(color=color)
        if self.special == "glass" and r.random() < 0.5:
            return rm.Material(albedo=color, transmission=1.0, ior=1.3, roughness=0.0)
        if self.special == "mirror" and r.random() < 0.5:
            return rm.Material(albedo=color, metalness=1.0, roughness=0.0)
        return rm.Material(albedo=color, roughness=float(r.uniform(0.3, 1)))

    def perhaps(self, node: rm.Node, share: float = 1.0) -> rm.Node:
        """The node, of a material of its own where the scene has labels."""
        return node.material(self.material()) if self.labelled and self.random.random() < share else node

    def shapes(self) -> list[Callable[[], rm.Node]]:
        u, v = self.length, self.vector
        return [
            lambda: rm.sphere(u(0.1, 0.5)),
            lambda: rm.box(v(0.1, 0.9)),
            lambda: rm.torus(u(0.3, 0.5), u(0.05, 0.2)),
            lambda: rm.cylinder(u(0.1, 0.3), u(0.2, 0.9)),
            lambda: rm.ellipsoid(v(0.1, 0.6)),
            lambda: self.perhaps(rm.box(v(0.3, 0.9))) - self.perhaps(rm.sphere(u(0.2, 0.5)).translate(v(-0.2, 0.2))),
            lambda: rm.union(self.perhaps(rm.sphere(u(0.2, 0.4))), rm.box(v(0.1, 0.9)), k=u(0.05, 0.3)),
            lambda: rm.sphere(u(0.05, 0.1)).repeat((0.3 * self.scale,) * 3, (2, 3, 2)),
            lambda: rm.cylinder(u(0.1, 0.3), u(0.2, 0.9)).scale(tuple(self.random.uniform(0.4, 1.6, 3))),
        ]

    def object(self) -> rm.Node:
        r = self.random
        node = self.shapes()[int(r.choice(self.kinds))]()
        if r.random() < 0.7:
            node = node.rotate(r.uniform(0, 6), r.normal(size=3))
        if r.random() < 0.2:
            node = node.scale(r.uniform(0.5, 2))
        place = r.uniform(-self.spread, self.spread, 3)
        if self.on_lattice:  # on the borders of cells
            place = np.round(2 * place / self.scale) / 2 * self.scale
        return self.perhaps(node.translate(place), 0.7)

    def union(self, count: int) -> rm.Node:
        r, objects = self.random, [self.object() for _ in range(count)]
        kind = r.integers(0, 4)
        if kind == 0:
            return rm.union(*objects, k=self.length(0.01, 0.6), blend=str(r.choice(BLENDS)))
        if kind == 1:
            half = count // 2
            return rm.union(*objects[:half], k=self.length(0.01, 0.4)) | rm.union(*objects[half:])
        whole = rm.union(*objects)
        if kind == 2 and self.moves:
            return whole | self.object().translate((self.scale * self.params[0], 0, 0))
        return whole

    def changed(self, node: rm.Node) -> rm.Node:
        r, s = self.random, self.scale
        floor = rm.plane(offset=-s)
        changes: list[Callable[[], rm.Node]] = [
            lambda: node.translate(self.vector(-1, 1)),
            lambda: node.rotate(self.params[0] if self.moves else r.uniform(0, 6), r.normal(size=3)),
            lambda: node.scale(r.uniform(0.5, 2)),
            lambda: node.mirror("x"),
            lambda: node - rm.box(self.vector(0.3, 2)).material(self.material()),
            lambda: rm.box(self.vector(1, 3)) - node,
            lambda: node | floor.material(self.material()),
            lambda: rm.union(node, floor, k=self.length(0.05, 0.6), blend=str(r.choice(BLENDS))),
            lambda: node & rm.sphere(self.length(1, 4)),
            lambda: node | self.union(4),
            lambda: node.material(self.material()),
        ]
        return changes[r.integers(0, len(changes))]()

    def scene(self) -> rm.Scene:
        r, s = self.random, self.scale
        node = self.union(int(r.choice([4, 8, 14])))
        for _ in range(r.integers(0, 4)):
            node = self.changed(node)
        origin = np.zeros(3) if r.random() < 0.7 else s * r.uniform(-200, 200, 3)
        node = node.translate(origin)
        low, high = node.bounds
        extent = 2 * self.spread + s
        low = np.where(np.isfinite(low), low, origin - extent)
        high = np.where(np.isfinite(high), high, origin + extent)
        centre, half = 0.5 * (low + high), 0.5 * float(np.linalg.norm(high - low))
        towards = r.normal(size=3)
        away = float(r.choice([0.02, 0.3, 1.2, 2.0, 2.0, 30.0]))  # inside of the cells, near and far
        eye = centre + towards / np.linalg.norm(towards) * half * away
        target = centre + 0.2 * half * r.uniform(-1, 1, 3)
        camera = rm.Camera(tuple(eye), tuple(target), fov=50.0 if away < 20 else 3.0)
        lights: list[Any] = [rm.Sun(tuple(r.normal(size=3)), shadow=bool(r.random() < 0.6))]
        if r.random() < 0.3:
            lights.append(rm.PointLight(tuple(centre + half * r.normal(size=3)), shadow=True))
        effects: dict[str, Any] = {"quality": rm.Quality(max_steps=2048)}
        if self.special in ("glass", "mirror"):
            effects = {"bounces": 3, "quality": rm.Quality(max_steps=2048, integrator="whitted")}
        elif r.random() < 0.3:
            reach = self.length(0.2, 1.0)
            effects |= {"occlusion": rm.AmbientOcclusion(reach=reach), "sky": rm.Sky((0.5, 0.6, 0.8), light=True)}
        return rm.Scene(node, camera=camera, lights=lights, **effects)


def faults(world: World, seed: int) -> list[str] | None:
    """What is wrong with the picture of a seed; None if the scene is refused or none of its objects are data."""
    drawn = Drawn(seed)
    try:
        scene = drawn.scene()
    except rm.SceneError:
        return None
    if not gather(scene.node, "data", 0.0).rows:
        return None
    params = {name: float(drawn.random.uniform(0.1, 0.9)) for name in scene.parameters}
    versions = {name: scene.replace(quality=replace(scene.quality, objects=name)) for name in ("data", "text")}
    outputs = ("color", "depth", "normal", "iterations")
    data, text = (world.renderer.render(version, outputs=outputs, params=params) for version in versions.values())
    hits = [np.isfinite(frame.depth) for frame in (data, text)]
    both = hits[0] & hits[1]
    depth = np.abs(data.depth[both] - text.depth[both]) / text.depth[both]
    normal = np.abs(data.normal - text.normal).max(axis=-1)[both]
    color = np.abs(np.asarray(data.image(), int) - np.asarray(text.image(), int)).max(axis=-1)
    counts = {
        "hits": (np.count_nonzero(hits[0] != hits[1]), 4),
        "depths": (np.count_nonzero(depth > 2e-3), 4),
        "normals": (np.count_nonzero(normal > 0.03), 8),
        "colours": (np.count_nonzero(color > 2), 12),
    }
    found = [f"{count} {name} differ from those as text" for name, (count, most) in counts.items() if count > most]
    found += [f"data: {what}" for what in contradicted(versions["data"], data, params)]
    if not params:
        for name, frame in (("data", data), ("text", text)):
            referee = Referee(versions[name], SIZE)
            said = referee.unexplained(frame.depth, frame.iterations) + referee.turned(frame)
            found += [f"{name}: {fault}" for fault in said]
    return found


def main(arguments: list[str]) -> int:
    first, last = [int(a) for a in [*arguments, *["0", "100"][len(arguments) :]]]
    looked_at = wrong = 0
    with World() as world:
        for seed in range(first, last):
            found = faults(world, seed)
            looked_at += found is not None
            wrong += bool(found)
            if found:
                print(f"seed {seed}:", *found, sep="\n    ", flush=True)
    print(f"{looked_at} scenes with objects as data, {wrong} wrong")
    return int(wrong > 0)


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
