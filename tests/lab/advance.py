"""Steps by the advance beside the default tracer: evaluations and N*, hits and the reference, CPU time in pairs.

python -m tests.lab.advance                     scenes of this file, all solids marched, without cones
python -m tests.lab.advance --closed            the same with closed forms
python -m tests.lab.advance --strong            strong twists, bends, tapers and displacements, alone and in unions
python -m tests.lab.advance --examples [NAME]   examples with their own settings
--size 320x180 --pairs 7                        by default 160x90 and 5
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

import raymarch as rm
from raymarch.plan import plan
from raymarch.scene import load
from raymarch.truth.floor import floor_evaluations

EXAMPLES = Path(__file__).parents[2] / "examples"
CAMERA = rm.Camera(position=(1.5, 2.5, 6.5), target=(0, 0, 0))
FLOOR = rm.plane(offset=-1.2)
TRACERS = ("bracketing", "advance")
Make = Callable[[np.random.Generator], rm.Node]


def scattered(make: Make, count: int, seed: int) -> list[rm.Node]:
    """Solids turned and placed at random."""
    random = np.random.default_rng(seed)
    return [
        make(random)
        .rotate(float(random.uniform(0, 6)), tuple(random.normal(size=3)))
        .translate(tuple(random.uniform(-1, 1, 3) * (2.5, 0.6, 2.5)))
        for _ in range(count)
    ]


def one_of(*kinds: Callable[[], rm.Node], low: float = 0.3, high: float = 0.6) -> Make:
    """One of some shapes, scaled at random."""
    return lambda random: kinds[random.integers(len(kinds))]().scale(float(random.uniform(low, high)))


def rounded(low: float, high: float, radius: float) -> Make:
    return lambda random: rm.rounded_box(tuple(random.uniform(low, high, 3)), radius)


def colored(random: np.random.Generator) -> rm.Node:
    return rounded(0.2, 0.5, 0.05)(random).material(rm.Material(tuple(random.uniform(size=3))))


def carved() -> rm.Node:
    """A carved rounded box, a torus blended with a ball, and a floor."""
    box = rm.rounded_box((1.4, 1.4, 1.4), 0.1).rotate(0.6, "y") - rm.sphere(1.1)
    blend = rm.union(rm.torus(0.8, 0.3), rm.sphere(0.6), k=0.3).rotate(1.1, "x")
    return box.translate((-1.3, 0, 0)) | blend.translate((1.3, 0.2, 0)) | rm.plane(offset=-0.9)


def blended() -> list[rm.Node]:
    arm = rm.capsule((-2, 0, 0), (-1, 1, 0), 0.2)
    joint = rm.union(arm, rm.sphere(0.5).translate((-1, 0.8, 0)), k=0.3)
    return [rm.union(*scattered(rounded(0.4, 1.0, 0.05), 3, 6), k=0.25), joint]


def scenes() -> Iterator[tuple[str, rm.Node]]:
    polyhedra = (rm.dodecahedron, rm.icosahedron, rm.octahedron, rm.truncated_cube)
    prisms = (rm.hexagonal_prism, rm.triangular_prism, rm.rhombus)
    bent = [rm.box((0.8, 2, 0.8)).twist(1.5).translate((-1, 0, 0)), rm.box((0.6, 1.6, 1)).bend(0.6)]
    column = rm.rounded_box((0.5, 1.4, 0.5), 0.08)
    kinds = {
        "12 rounded boxes (trial)": scattered(rounded(0.3, 1.0, 0.06), 12, 4),
        "rounded boxes": scattered(rounded(0.4, 1.2, 0.1), 6, 1),
        "polyhedra": scattered(one_of(*polyhedra), 6, 2),
        "prisms": scattered(one_of(*prisms, low=0.4, high=0.8), 6, 3),
        "carved": scattered(lambda _: rm.box(1) - rm.sphere(0.62) - rm.cylinder(0.2, 2), 4, 5),
        "blended": blended(),
        "torus": scattered(lambda _: rm.torus(0.6, 0.2), 5, 7),
        "twist and bend": [bent[0], bent[1].translate((1.3, 0, 0))],
        "repeated": [column.repeat((1.2, None, 1.2)).translate((0, -0.5, -2))],
        "60 boxes as rows": scattered(colored, 60, 8),
    }
    yield "carved and blended (trial)", carved()
    for name, solids in kinds.items():
        yield name, rm.union(FLOOR, *solids)


def strong() -> Iterator[tuple[str, rm.Node]]:
    """Solids deformed by large values; the same beside a ball on a floor; and that at 1,000 times the size."""
    bar = rm.rounded_box((0.7, 2.0, 0.5), 0.08)
    made = {
        "twist 3": bar.twist(3.0),
        "bend 1.2": rm.box((2.0, 0.4, 0.6)).bend(1.2),
        "taper": rm.box((1.2, 2.0, 1.2)).taper(0.7),
        "displaced by sines": rm.sphere(0.9).displace(lambda p: 0.12 * rm.sin(9 * p.x) * rm.sin(9 * p.y)),
        "displaced by noise": rm.sphere(0.9).displace_by_noise(0.25, 4.0, 4),
    }
    for name, solid in made.items():
        union = solid | rm.sphere(0.5).translate((1.8, -0.3, 0.5)) | FLOOR
        yield name, solid
        yield f"{name}, in a union", union
        yield f"{name}, x 1000", union.scale(1000.0)


class Drawn(NamedTuple):
    """Means and largest evaluations, seconds of the first frame and of further ones, and the depth."""

    mean: float
    most: float
    first: float
    seconds: list[float]
    depth: np.ndarray


def drawn(scene: rm.Scene, size: tuple[int, int], pairs: int) -> Mapping[str, Drawn]:
    """The scene by each tracer, in turns."""
    qualities = {tracer: scene.quality.replace(tracer=tracer) for tracer in TRACERS}
    made = {tracer: scene.replace(quality=quality) for tracer, quality in qualities.items()}
    renderers = {tracer: rm.Renderer(size) for tracer in TRACERS}
    first: dict[str, float] = {}
    seconds: dict[str, list[float]] = {tracer: [] for tracer in TRACERS}
    for turn in range(pairs + 1):
        for tracer in TRACERS:
            start = time.process_time()
            renderers[tracer].render(made[tracer]).image()
            spent = time.process_time() - start
            if turn:
                seconds[tracer].append(spent)
            else:
                first[tracer] = spent
    found = {}
    for tracer in TRACERS:
        frame = renderers[tracer].render(made[tracer], outputs=("depth", "evaluations"))
        counts = frame.evaluations
        found[tracer] = Drawn(float(counts.mean()), counts.max(), first[tracer], seconds[tracer], frame.depth)
        renderers[tracer].close()
    return found


def judged(depth: np.ndarray, true: np.ndarray, pixel: float) -> str:
    """Missed hits, hits more than a pixel beyond and before those of the reference, invented ones; errors in pixels."""
    hit, real = np.isfinite(depth), np.isfinite(true)
    both = hit & real
    off = (depth[both] - true[both]) / (pixel * true[both])
    counts = (np.sum(real & ~hit), np.sum(off > 1.0), np.sum(off < -1.0), np.sum(hit & ~real))
    p50, p99 = np.percentile(np.abs(off), (50, 99))
    return f"{' '.join(f'{count:3d}' for count in counts)}  {p50:.1e} {p99:.1e}"


def time_ratio(found: Mapping[str, Drawn]) -> str:
    before, after = (found[tracer] for tracer in TRACERS)
    low, middle, high = np.quantile(np.array(after.seconds) / np.array(before.seconds), (0.25, 0.5, 0.75))
    return f"{middle:.2f} ({low:.2f}..{high:.2f}), first {after.first / before.first:.2f}"


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--closed", action="store_true")
    parser.add_argument("--strong", action="store_true")
    parser.add_argument("--examples", nargs="*")
    parser.add_argument("--size", default="160x90")
    parser.add_argument("--pairs", type=int, default=5)
    given = parser.parse_args()
    width, height = map(int, given.size.split("x"))
    size, pixel = (width, height), 2.0 * np.tan(np.radians(float(CAMERA.fov) / 2)) / height
    if given.examples is not None:
        names = given.examples or sorted(str(f.relative_to(EXAMPLES))[:-3] for f in EXAMPLES.rglob("*.py"))
        for name in names:
            scene = load(EXAMPLES / f"{name}.py")
            if scene.node.exactness == "estimate" or scene.quality.tracer != "auto":
                continue
            found = drawn(scene, size, given.pairs)
            counts = " -> ".join(f"{each.mean:.2f} (most {each.most:.0f})" for each in found.values())
            print(f"{name:24} {counts:40} CPU time x {time_ratio(found)}", flush=True)
        return
    print("evaluations (over N*) of bracketing -> advance; of both: missed, beyond, before, invented, p50 and p99 px")
    quality = rm.Quality(analytic=None if given.closed else False, schedule="single")
    for name, node in strong() if given.strong else scenes():
        unit = 1000.0 if name.endswith("x 1000") else 1.0
        camera = CAMERA.replace(position=tuple(unit * x for x in (1.5, 2.5, 6.5)))
        scene = rm.Scene(node, camera, quality=quality)
        floor, true = float(floor_evaluations(scene, size).mean()), rm.truth(scene, size).depth
        found = drawn(scene, size, given.pairs)
        counts = " -> ".join(f"{each.mean:5.2f} ({each.mean / floor:.2f})" for each in found.values())
        judgement = " | ".join(judged(each.depth, true, pixel) for each in found.values())
        ratio = f"CPU time x {time_ratio(found)}, auto: {plan(scene, size=size).marching.tracer}"
        print(f"{name:27} N* {floor:5.2f}  {counts}  {judgement}  {ratio}", flush=True)


if __name__ == "__main__":
    main()
