"""Errors of all penumbras against the visible part of the light's disc, and their evaluations.

python -m tests.lab.penumbras --pairs 200      # a table: mean, 99 % and worst error, evaluations, for each kind

A blocker (a plate, a ball, a box, a gap, an edge, a corner or a rod) hangs above a floor, in the light of a sun. Its
size goes by the radius of the light's disc at its height. Pixels look down through the blocker, near its shadow. The
truth intersects 2,000 rays to the light's cone with the blocker in closed form, in float64. It shares nothing with the
package. Pixels that see all or nothing of the light by more than a quarter of the disc's radius are left out.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import raymarch as rm
from raymarch.cost.effects import evaluation_counts
from raymarch.gpu import Renderer

Array = NDArray[np.float64]

SIZE = (24, 24)
KINDS = ("thin plate", "wide plate", "ball", "box", "gap", "edge", "corner", "rod")
METHODS = ("two-sided", "cone", "triangulated", "sampled")
RAYS = 2000


@dataclass(frozen=True)
class Solid:
    """A ball (of a radius) or a box (of half extents, turned by the rows of a matrix)."""

    centre: Array
    radius: float
    half: Array
    turn: Array

    def hit(self, origin: Array, rays: Array) -> NDArray[np.bool_]:
        """Which rays from a point meet it."""
        way = self.centre - origin
        if self.radius > 0.0:
            along = rays @ way
            return np.asarray((along > 0.0) & (way @ way - along**2 < self.radius**2))
        o, d = -way @ self.turn.T, rays @ self.turn.T
        with np.errstate(divide="ignore", invalid="ignore"):
            a, b = (-self.half - o) / d, (self.half - o) / d
        return np.asarray(np.maximum(np.minimum(a, b).max(axis=1), 0.0) <= np.maximum(a, b).min(axis=1))

    def node(self) -> rm.Node:
        """The same as a node."""
        if self.radius > 0.0:
            return rm.sphere(self.radius).translate(tuple(self.centre))
        matrix = np.eye(4)
        matrix[:3, :3] = self.turn
        return rm.box(tuple(2.0 * self.half)).transform(matrix.tolist()).translate(tuple(self.centre))


@dataclass(frozen=True)
class Pair:
    """Solids above a floor, the direction to the light, the sine of its angular radius, and that of the disc."""

    kind: str
    solids: list[Solid]
    light: Array
    sine: float
    disc: float

    def scene(self, method: str, shadow: bool = True, tracer: str = "auto") -> rm.Scene:
        """A picture of the floor about the middle of the shadow, from above."""
        white = rm.Material((1, 1, 1), ambient=0.0, specular=0.0)
        blocker = rm.union(*(solid.node() for solid in self.solids)).visible(camera=False)
        tangent = self.sine / np.sqrt(1.0 - self.sine**2)
        soft = {"softness": float(tangent), "penumbra": method} if shadow else {}
        sun = rm.Sun(tuple(self.light), shadow=shadow, **soft)  # type: ignore[arg-type]
        points = self.points()
        wide = float(points[-1, -1, 0] - points[0, 0, 0]) * SIZE[0] / (SIZE[0] - 1)
        camera = rm.Camera(
            tuple(np.add(self.centre, (0.0, 1.0, 0.0))),
            tuple(self.centre),
            up=(0, 0, -1),
            projection="orthographic",
            height=wide,
        )
        quality = rm.Quality(tracer=tracer, light_samples=64 if method == "sampled" else 1)
        return rm.Scene((rm.plane() | blocker).material(white), camera, lights=[sun], sky=(0, 0, 0), quality=quality)

    @property
    def centre(self) -> Array:
        """A point of the floor on the shadow's border, or of its middle."""
        solid = self.solids[0]
        edge = np.zeros(3) if solid.radius > 0.0 else (solid.half * (1.0, 0.0, 0.0)) @ solid.turn
        if self.kind in ("ball", "rod", "box"):
            edge = np.zeros(3)
        place = solid.centre - edge
        return np.asarray(place - self.light * place[1] / self.light[1])

    def points(self) -> Array:
        """The points of the pixels on the floor, (H, W, 3): as wide as the disc and the solid."""
        solid = self.solids[0]
        size = solid.radius or float(np.sort(solid.half)[1 if self.kind in ("rod", "box") else 0])
        wide = 1.3 * self.disc + (min(size, 3.0 * self.disc) if self.kind in ("ball", "rod", "box") else 0.0)
        k = (np.arange(SIZE[0]) + 0.5) / SIZE[0] * 2.0 - 1.0
        x, z = np.meshgrid(k * wide, k * wide)
        return np.asarray(self.centre + np.stack([x, np.zeros_like(x), z], axis=-1))

    def visible(self) -> Array:
        """The visible part of the light's cone at each pixel, (H, W): the truth."""
        k = np.arange(RAYS) + 0.5
        r, angle = self.sine * np.sqrt(k / RAYS), 2.399963 * k
        side = np.cross(self.light, (0.0, 0.0, 1.0))
        side /= np.linalg.norm(side)
        up = np.cross(self.light, side)
        rays = r[:, None] * (np.cos(angle)[:, None] * side + np.sin(angle)[:, None] * up)
        rays = rays + np.sqrt(1.0 - r * r)[:, None] * self.light
        found = [np.any([s.hit(p, rays) for s in self.solids], axis=0).mean() for p in self.points().reshape(-1, 3)]
        return 1.0 - np.reshape(found, SIZE[::-1])


def drawn(rng: np.random.Generator, kind: str) -> Pair:
    """A pair of a kind at random."""
    tilt, turn = np.radians(rng.uniform(0, 60)), rng.uniform(0, 2 * np.pi)
    light = np.array((np.sin(tilt) * np.cos(turn), np.cos(tilt), np.sin(tilt) * np.sin(turn)))
    sine, height = float(10 ** rng.uniform(-2, -0.6)), float(rng.uniform(1, 3))
    centre, disc = light * height / light[1], sine * height / light[1]
    angle = rng.uniform(0, np.pi)
    level = np.array(((np.cos(angle), 0, np.sin(angle)), (0, 1, 0), (-np.sin(angle), 0, np.cos(angle))))
    turned = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    turned = turned * np.sign(np.linalg.det(turned))
    either = level if rng.random() < 0.5 else turned

    def solid(half: Array, at: Array, turn: Array) -> Solid:
        return Solid(at, 0.0, np.minimum(half, (9.0, 0.45 * height, 9.0) if turn is level else 0.5 * height), turn)

    thickness = float(disc * 10 ** rng.uniform(-1.0, 0.3))
    wide = disc * rng.uniform(3, 10, 2)
    if kind == "ball":
        solids = [Solid(centre, min(float(disc * 10 ** rng.uniform(-0.5, 0.7)), 0.8 * height), np.zeros(3), level)]
    elif kind == "thin plate":
        wide, thin = disc * rng.uniform(1, 4, 2), disc * 10 ** rng.uniform(-2.5, -0.5)
        solids = [solid(np.array((wide[0], thin, wide[1])), centre, either)]
    elif kind == "wide plate":
        solids = [solid(np.array((wide[0], disc * 10 ** rng.uniform(-2, 0), wide[1])), centre, level)]
    elif kind == "box":
        solids = [solid(disc * 10 ** rng.uniform(-0.3, 0.7, 3), centre, either)]
    elif kind == "rod":
        thin = disc * 10 ** rng.uniform(-1.3, -0.3, 2)
        solids = [solid(np.array((thin[0], disc * rng.uniform(2, 6), thin[1])), centre, turned)]
    else:
        half = disc * np.array((8.0, 0.0, 12.0)) + (0.0, thickness, 0.0)
        solids = [solid(half, centre, level)]
        half = solids[0].half
        if kind == "edge":
            solids = [solid(half, centre + half[0] * level[0], level)]
        elif kind == "corner":
            solids = [solid(half, centre + half[0] * level[0] + half[2] * level[2], level)]
        else:
            gap = half[0] + 0.5 * disc * 10 ** rng.uniform(-1, 0.3)
            solids = [solid(half, centre + sign * gap * level[0], level) for sign in (1.0, -1.0)]
    return Pair(kind, solids, light, sine, float(disc))


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--pairs", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--tracer", default="auto")
    parser.add_argument("--methods", nargs="+", choices=METHODS, default=METHODS)
    given = parser.parse_args(arguments)
    rng = np.random.default_rng(given.seed)
    errors: dict[tuple[str, str], list[Array]] = defaultdict(list)
    silent: dict[str, list[Array]] = defaultdict(list)
    costs: dict[str, list[tuple[float, float]]] = defaultdict(list)
    with Renderer(SIZE) as renderer:
        for index in range(given.pairs):
            pair = drawn(rng, KINDS[index % len(KINDS)])
            wanted = pair.visible()
            free = renderer.render(pair.scene("cone", shadow=False)).color[..., 0]
            part = (wanted > 0.0) & (wanted < 1.0)
            lit, judged = wanted == 1.0, part | (np.roll(part, 3, 0) | np.roll(part, -3, 0))
            for method in given.methods:
                scene = pair.scene(method, tracer=given.tracer)
                frame = renderer.render(scene)
                error = (frame.color[..., 0] / free - wanted)[judged]
                errors[method, pair.kind].append(error)
                if len(error) and not any("penumbra" in doubt for doubt in frame.doubts()):
                    silent[method].append(np.abs(error))
                bare = pair.scene(method, shadow=False, tracer=given.tracer)
                asked = evaluation_counts(scene, renderer) - evaluation_counts(bare, renderer)
                points = 64 if method == "sampled" else 1
                costs[method].append(
                    (float(asked.mean()) / points, float(asked[lit].mean()) / points if lit.any() else 0)
                )
    print(f"{given.pairs} pairs; error of the visible part of the disc: mean, 99 %, worst, the part above .05")
    print("    of each kind: mean, worst, the part above .05")
    for method in given.methods:
        every = np.abs(np.concatenate([e for kind in KINDS for e in errors[method, kind]]))
        kinds = [np.abs(np.concatenate(errors[method, kind])) for kind in KINDS if errors[method, kind]]
        cost = np.mean(costs[method], axis=0)
        print(
            f"{method:12} {every.mean():.3f} {np.quantile(every, 0.99):.3f} {every.max():.3f}  "
            f"above .05 {np.mean(every > 0.05):.1%}, "
            f"without a doubt {sum(np.sum(e > 0.05) for e in silent[method]) / len(every):.1%}, "
            f"of one scene {max((np.mean(e > 0.05) for e in silent[method]), default=0.0):.0%}  "
            f"evaluations {cost[0]:.1f}, lit {cost[1]:.1f}"
        )
        print(
            "    "
            + ", ".join(
                f"{k} {e.mean():.3f} {e.max():.2f} {np.mean(e > 0.05):.0%}" for k, e in zip(KINDS, kinds, strict=False)
            )
        )
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
