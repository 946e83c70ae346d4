"""Areas, interiors and thin solids against Mitsuba 3, at several sizes of the picture.

python -m tests.lab.rooms [NAME ... | all] [--sizes 16,32,64] [--paths N] [--shows FILE.png]

Needs `pip install mitsuba scipy`. Thirty scenes are drawn at random: ten outside, with lights of some
size that stand free, touch and cut solids, ten rooms, and ten of plates as thin as a hundredth of the scene. All
surfaces are diffuse, and all lights are visible. Both renderers draw independent batches, and each pixel and the mean
of the picture are tested against their noise (`tests.lab.ztest`). `--paths` is the number of paths of each picture.
"""

from __future__ import annotations

import argparse
import math
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

import raymarch as rm
from tests.lab.ztest import Verdict, our_batches, verdict

PI = math.pi
DEPTH = {"area": 3, "room": 6, "thin": 4}
"""Mitsuba's `max_depth` of each kind of scene: `bounces` and 2, or 1 under a sky, which the last does not see."""

Vec = tuple[float, float, float]


@dataclass
class Case:
    """A scene: solids, lights, the light of the sky, and a camera.

    boxes : centre, size, colour and turn about y in degrees. balls : centre, radius, colour. rects : centre, width,
    height, direction and intensity. lamps : centre, radius and intensity of lights that are spheres.
    """

    depth: int
    camera: tuple[Vec, Vec, float]
    boxes: list[tuple[Vec, Vec, Vec, float]] = field(default_factory=list)
    balls: list[tuple[Vec, float, Vec]] = field(default_factory=list)
    rects: list[tuple[Vec, float, float, Vec, float]] = field(default_factory=list)
    lamps: list[tuple[Vec, float, float]] = field(default_factory=list)
    sky: Vec = (0.0, 0.0, 0.0)


WHITE, RED, GREEN = (0.73, 0.71, 0.68), (0.63, 0.06, 0.05), (0.14, 0.45, 0.09)


def room(case: Case, width: float = 2.0, height: float = 2.0, deep: float = 2.0, color: Vec = WHITE) -> None:
    """Add the five walls of a room that is open towards +z; it stands on y = 0."""
    t = 0.1
    middle = height / 2
    case.boxes += [
        ((0.0, -t, 0.0), (width + 4 * t, 2 * t, deep + 4 * t), color, 0.0),
        ((0.0, height + t, 0.0), (width + 4 * t, 2 * t, deep + 4 * t), color, 0.0),
        ((0.0, middle, -deep / 2 - t), (width + 4 * t, height + 4 * t, 2 * t), color, 0.0),
        ((-width / 2 - t, middle, 0.0), (2 * t, height + 2 * t, deep + 2 * t), RED, 0.0),  # behind the others' faces
        ((width / 2 + t, middle, 0.0), (2 * t, height + 2 * t, deep + 2 * t), GREEN, 0.0),
    ]


def cornell() -> Case:
    """The Cornell box with a light flush with its ceiling."""
    case = Case(6, ((0.0, 1.0, 3.9), (0.0, 1.0, 0.0), 38.0))
    room(case)
    case.boxes += [
        ((-0.35, 0.6, -0.3), (0.6, 1.2, 0.6), WHITE, 17.0),
        ((0.35, 0.3, 0.35), (0.6, 0.6, 0.6), WHITE, -18.0),
    ]
    case.rects += [((0.0, 2.0, 0.0), 0.5, 0.5, (0.0, -1.0, 0.0), 1.5)]
    return case


def drawn(kind: str, seed: int) -> Case:
    """A random scene of a kind: "area", "room" or "thin"."""
    rng = np.random.default_rng([seed, sorted(DEPTH).index(kind)])

    def pick(low: float, high: float) -> float:
        return round(float(rng.uniform(low, high)), 3)

    def color() -> Vec:
        return pick(0.2, 0.8), pick(0.2, 0.8), pick(0.2, 0.8)

    def stand(count: int, thin: bool) -> None:
        """Boxes and balls that stand on y = 0 within 0.8 of the origin; some plates lie above it."""
        for _ in range(count):
            at = pick(-0.7, 0.7), pick(-0.7, 0.6)
            if thin:
                sizes = [pick(0.3, 0.9), pick(0.3, 0.9), pick(0.02, 0.04)]
                size = tuple(sizes[i] for i in rng.permutation(3))
                lift = size[1] / 2 + (0.0 if rng.uniform() < 0.5 else pick(0.1, 0.9))
                case.boxes.append(((at[0], lift, at[1]), size, color(), pick(-45, 45)))
            elif rng.uniform() < 0.5:
                size = pick(0.2, 0.6), pick(0.2, 1.0), pick(0.2, 0.6)
                case.boxes.append(((at[0], size[1] / 2, at[1]), size, color(), pick(-45, 45)))
            else:
                radius = pick(0.15, 0.4)
                case.balls.append(((at[0], radius, at[1]), radius, color()))

    case = Case(DEPTH[kind], ((pick(-0.3, 0.3), pick(0.9, 1.1), 3.9), (0.0, pick(0.8, 1.0), 0.0), 38.0))
    if kind == "room" or (kind == "thin" and seed % 2):
        room(case, pick(1.8, 2.2), 2.0, pick(1.8, 2.2))
        ceiling = 2.0
    else:
        case.camera = ((pick(-1.5, 1.5), pick(0.8, 2.0), 3.6), (0.0, pick(0.2, 0.5), 0.0), 38.0)
        case.boxes.append(((0.0, -0.1, 0.0), (6.0, 0.2, 6.0), color(), 0.0))
        ceiling = pick(1.5, 2.5)
    stand(int(rng.integers(2, 5)), kind == "thin")
    which = seed % 5
    if which in (0, 3):  # flush with the ceiling of a room, free outside
        at = pick(-0.3, 0.3), ceiling, pick(-0.3, 0.3)
        case.rects.append((at, pick(0.2, 0.8), pick(0.2, 0.8), (0.0, -1.0, 0.0), pick(1.0, 2.0)))
    if which == 1:  # a ball of light that stands free, or touches the ceiling
        radius = pick(0.05, 0.3)
        lift = pick(1.2, 1.6) if seed < 5 else ceiling - radius
        case.lamps.append(((pick(-0.5, 0.5), lift, pick(0.2, 0.5)), radius, pick(0.5, 1.0)))
    if which == 2:  # one that cuts the floor
        radius = pick(0.1, 0.3)
        case.lamps.append(((pick(-0.6, 0.6), round(radius * pick(-0.5, 1.0), 3), 0.8), radius, pick(0.1, 0.3)))
    if which == 4:
        case.sky = pick(0.3, 1.0), pick(0.3, 1.0), pick(0.3, 1.0)
    return case


CASES = {"cornell": cornell} | {
    f"{kind}{k}": (lambda kind=kind, k=k: drawn(kind, k)) for kind in DEPTH for k in range(10)
}


def ours(case: Case) -> rm.Scene:
    """The scene for us."""

    def matte(color: Vec) -> rm.Material:
        return rm.Material(color, specular=0.0, ambient=0.0)

    solids = [
        (rm.box(size).rotate(math.radians(turn), "y") if turn else rm.box(size)).translate(at).material(matte(color))
        for at, size, color, turn in case.boxes
    ]
    solids += [rm.sphere(radius).translate(at).material(matte(color)) for at, radius, color in case.balls]
    lights: list[Any] = [
        rm.RectLight(at, w, h, direction, intensity=i, shadow=True, visible=True)
        for at, w, h, direction, i in case.rects
    ]
    lights += [
        rm.SphereLight(at, radius, intensity=i, shadow=True, penumbra="sampled", visible=True)
        for at, radius, i in case.lamps
    ]
    position, target, fov = case.camera
    return rm.Scene(
        rm.union(*solids),
        camera=rm.Camera(position, target, fov=fov),
        lights=lights,
        sky=case.sky,
        bounces=case.depth - 2 + any(case.sky),
    )


def theirs(mi: Any, case: Case, size: int, samples: int, seed: int) -> NDArray[np.float64]:
    """Mitsuba's picture, (size, size, 3). Its lights reflect nothing, as ours."""
    at = mi.ScalarTransform4f

    def rgb(color: Any) -> dict[str, Any]:
        return {"type": "rgb", "value": [float(c) for c in color]}

    def skin(color: Vec) -> dict[str, Any]:
        return {"type": "diffuse", "reflectance": rgb(color)}

    position, target, fov = case.camera
    scene: dict[str, Any] = {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": case.depth, "rr_depth": 1000},
        "sensor": {
            "type": "perspective",
            "fov": fov,
            "to_world": at().look_at(list(position), list(target), [0, 1, 0]),
            "film": {"type": "hdrfilm", "width": size, "height": size, "rfilter": {"type": "box"}},
            "sampler": {"type": "independent", "sample_count": samples},
        },
        "sky": {"type": "constant", "radiance": rgb(case.sky)},
    }
    for k, (centre, extent, color, turn) in enumerate(case.boxes):
        place = at().translate(list(centre)).rotate([0, 1, 0], turn).scale([s / 2 for s in extent])
        scene[f"box{k}"] = {"type": "cube", "to_world": place, "skin": skin(color)}
    for k, (centre, radius, color) in enumerate(case.balls):
        scene[f"ball{k}"] = {"type": "sphere", "center": list(centre), "radius": radius, "skin": skin(color)}
    for k, (centre, width, height, direction, intensity) in enumerate(case.rects):
        up = [0, 0, 1] if abs(direction[1]) > 0.999 else [0, 1, 0]
        start = np.array(centre) + 4e-4 * np.array(direction)  # nearer, the ceiling hides it
        place = at().look_at(start.tolist(), (start + direction).tolist(), up).scale([width / 2, height / 2, 1])
        glow = {"type": "area", "radiance": rgb([PI * intensity / (width * height)] * 3)}
        scene[f"rect{k}"] = {"type": "rectangle", "to_world": place, "light": glow, "skin": skin((0.0, 0.0, 0.0))}
    for k, (centre, radius, intensity) in enumerate(case.lamps):
        glow = {"type": "area", "radiance": rgb([intensity / radius**2] * 3)}
        lamp = {"type": "sphere", "center": list(centre), "radius": radius, "light": glow}
        scene[f"lamp{k}"] = lamp | {"skin": skin((0.0, 0.0, 0.0))}
    return np.asarray(mi.render(mi.load_dict(scene), seed=seed), np.float64)[..., :3]


BATCHES = 16


def judged(mi: Any, case: Case, size: int, paths: int) -> tuple[Verdict, float, list[NDArray[Any]]]:
    """The verdict of one scene at one size, the relative difference of the mean light, and both pictures.

    Means are over the pixels that show no light: a light is so bright that the noise of its edge would hide the rest.
    """
    samples = max(paths // (BATCHES * size * size), 1)
    scene = ours(case)
    with rm.Renderer((size, size)) as renderer:
        mine = our_batches(renderer, scene, BATCHES, samples)
        few = scene.replace(bounces=0, quality=rm.Quality(samples=16))
        hidden = few.replace(lights=[light.replace(visible=False) for light in scene.lights])
        shown = np.any(renderer.render(few).color != renderer.render(hidden).color, axis=-1)
    known = np.stack([theirs(mi, case, size, samples, 1 + k) for k in range(BATCHES)])
    pictures = [batches.mean(axis=0) for batches in (mine, known)]
    off = pictures[0][~shown].mean() / pictures[1][~shown].mean() - 1.0
    z, rest = verdict(mine, known, np.ones_like(shown)), verdict(mine, known, ~shown)
    return replace(z, whole=rest.whole), float(off), pictures


def main() -> None:
    import mitsuba as mi

    mi.set_variant("scalar_rgb")
    parser = argparse.ArgumentParser()
    parser.add_argument("names", nargs="*", default=["cornell"])
    parser.add_argument("--sizes", default="16,32,64")
    parser.add_argument("--paths", type=int, default=1 << 20)
    parser.add_argument("--shows")
    given = parser.parse_args()
    names = [name for name in CASES if name != "cornell"] if given.names == ["all"] else given.names
    print(f"{'scene':<10}{'size':>6}{'mean off':>10}{'z of mean':>10}{'pixels off':>11}{'worst z':>9}{'allowed':>9}")
    rows = []
    for name in names:
        for size in map(int, given.sizes.split(",")):
            z, off, pictures = judged(mi, CASES[name](), size, given.paths)
            line = f"{name:<10}{size:>6}{off:>10.3%}{z.whole:>10.2f}{z.different:>11}{z.worst:>9.2f}{z.allowed:>9.2f}"
            print(line, flush=True)
        rows.append(np.hstack(pictures))
    if given.shows:
        from PIL import Image

        shown = (np.clip(np.vstack(rows), 0, 1) ** (1 / 2.2) * 255).astype(np.uint8)
        Image.fromarray(shown).save(given.shows)


if __name__ == "__main__":
    main()
