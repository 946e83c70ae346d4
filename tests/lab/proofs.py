"""Proofs of pictures.

python -m tests.lab.proofs [SCENE.py ...]     # the examples, or some scenes
python -m tests.lab.proofs --nodes            # every sample of every node
python -m tests.lab.proofs --trees 2000       # random solids; --seed N begins elsewhere
python -m tests.lab.proofs --faults           # seeded faults of the march and of pictures: what is contradicted
--size 160x90 and --within 0.05px are those of the pictures
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import hypothesis
import numpy as np
from hypothesis import HealthCheck, Phase, settings
from hypothesis import strategies as st

import raymarch as rm
from raymarch import glsl
from raymarch.errors import RaymarchError
from raymarch.scene.file import load
from raymarch.scene.parameter import set_values
from tests.hard.python import as_python
from tests.lab.fuzz import scene_of, small
from tests.support.node_samples import samples

EXAMPLES = Path(__file__).parents[2] / "examples"
SLOW = ("chess", "array", "blob", "city", "forest", "lamps", "molecule", "costly", "mandelbulb")
"""Examples that take minutes; ask for them by name."""

MARCH = (
    ("march/loop", "refined(widths, t, next, derivative)", "next > 0.0"),
    ("march/loop", "float leap = leap_pixels * u_pixel * at.t;", "float leap = 200.0 * u_pixel * at.t;"),
    ("march/loop", "at.t + last_step(widths, at)", "at.t * (1.0 + 0.2 * u_pixel)"),
    ("march/loop", "at.t + last_step(widths, at)", "at.t * (1.0 - 0.2 * u_pixel)"),
    (
        "march/loop",
        "float z = aiming ? secant : search + further;",
        "float z = aiming ? secant : 1.5 * at.r + 0.01;",
    ),
    ("march/loop", "float next = march_distance(ray, t);", "float next = march_distance(ray, t) - 0.01;"),
    ("march/loop", "float next = march_distance(ray, t);", "float next = march_distance(ray, t) + 0.01;"),
    ("march/loop", "float next = march_distance(ray, t);", "float next = 1.02 * march_distance(ray, t) - 0.004;"),
    ("march/loop", "bool near = empty && (at.refining ? next < abs(at.r) :", "bool near = (at.refining ? true :"),
    ("march/loop", "hit.found = found;", "hit.found = found && fract(97.0 * hit.t) > 0.05;"),
)
"""Lines of the march in a spoiled form."""


def _tried(scene: rm.Scene, given: argparse.Namespace, frame: Any = None) -> rm.Proof:
    width, height = map(int, given.size.split("x"))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return rm.prove(scene, frame, size=(width, height), tolerance=given.within)


def _row(name: str, found: rm.Proof, begun: float) -> None:
    print(
        f"| {name} | {100 * found.share:.3f} % | {found.contradicted} | {found.open} "
        f"| {found.evaluations.mean():.1f} |",
        f" {time.process_time() - begun:.1f} s CPU",
        *([dict(found.reasons)] if found.open else []),
        flush=True,
    )


def examples(given: argparse.Namespace) -> None:
    for file in given.scenes or sorted(f for f in EXAMPLES.rglob("*.py") if f.stem not in SLOW):
        begun = time.process_time()
        _row(file.stem, _tried(load(file), given), begun)


def nodes(given: argparse.Namespace) -> None:
    shares: Counter[str] = Counter()
    for sample in samples():
        node, begun = sample.build(), time.process_time()
        if node.dimension == 2:
            node = node.extrude(0.5)
        try:
            found = _tried(scene_of(node, 0), given)
        except RaymarchError as error:
            shares["refused"] += 1
            print(f"| {sample.id} | {str(error)[:150]}", flush=True)
            continue
        shares["contradicted" if found.contradicted else "open" if found.open else "proved"] += 1
        if found.contradicted or found.open:
            _row(sample.id, found, begun)
    print(dict(shares))


def trees(given: argparse.Namespace) -> None:
    shares: Counter[str] = Counter()
    pixels: Counter[str] = Counter()

    @hypothesis.seed(given.seed)
    @settings(
        max_examples=given.trees,
        database=None,
        deadline=None,
        suppress_health_check=list(HealthCheck),
        phases=(Phase.generate,),
        print_blob=False,
    )
    @hypothesis.given(small, st.integers(0, 10_000))
    def look(node: rm.Node, view: int) -> None:
        begun = time.process_time()
        try:
            found = _tried(scene_of(node, view), given)
        except RaymarchError as error:
            shares["refused"] += 1
            print(f"refused: {str(error)[:150]}", flush=True)
            return
        shares["contradicted" if found.contradicted else "open" if found.open else "proved"] += 1
        for name in ("proved", "contradicted", "open"):
            pixels[name] += getattr(found, name)
        if found.contradicted:
            _row(f"view {view}", found, begun)
            print(as_python(node), flush=True)
        if sum(shares.values()) % 50 == 0:
            print(dict(shares), dict(pixels), flush=True)

    look()
    print(dict(shares), dict(pixels))


def _spoiled(module: str, line: str, by: str) -> Iterator[None]:
    load_module = glsl.load

    def load_spoiled(name: str, variants: frozenset[str] = frozenset()) -> glsl.Module:
        made = load_module(name, variants)
        return replace(made, lines=tuple(x.replace(line, by) for x in made.lines)) if name == module else made

    glsl.load = load_spoiled
    yield
    glsl.load = load_module


def faults(given: argparse.Namespace) -> None:
    """Each fault of the march in six scenes, and six faults of each of these pictures."""
    marched = rm.Quality(analytic=False)
    scenes = {name: load(next(EXAMPLES.rglob(f"{name}.py"))).replace(quality=marched) for name in FAULTY}
    count: Counter[str] = Counter()

    def judged(name: str, scene: rm.Scene, right: Any, drawn: Any) -> None:
        found = _tried(scene, given, drawn)
        differs = _differs(right.depth, drawn.depth, found.within)
        if found.contradicted:
            verdict = "contradicted"
        elif not differs.any():
            verdict = "within the tolerance"
        elif np.all(found.grazing[differs]):
            verdict = "on grazing rays alone"
        else:
            verdict = "missed"
            print(f"missed: {name}; {differs.sum()} hits moved, {found.open} open", flush=True)
        count[verdict] += 1

    width, height = map(int, given.size.split("x"))
    for name, scene in scenes.items():
        right = _draw(scene, (width, height))
        for module, line, by in MARCH:
            for _ in _spoiled(module, line, by):
                judged(f"{name}: {by}", scene, right, _draw(scene, (width, height)))
        for title, spoil in PICTURES.items():
            judged(f"{name}: {title}", scene, right, Depths(spoil(right.depth, _pixels(scene, right.depth))))
    print(dict(count))


def _differs(right: Any, drawn: Any, within: Any) -> Any:
    """Where two pictures differ by more than the tolerance."""
    both = np.isfinite(right) & np.isfinite(drawn)
    apart = np.abs(np.where(both, right, 0.0) - np.where(both, drawn, 0.0)) > within
    return apart | (np.isfinite(right) != np.isfinite(drawn))


def _draw(scene: rm.Scene, size: tuple[int, int]) -> Any:
    with rm.Renderer(size) as renderer:
        return renderer.render(scene, outputs=("depth",))


class Depths:
    """A picture of another renderer."""

    def __init__(self, depth: Any) -> None:
        self.depth = depth


def _pixels(scene: rm.Scene, depth: Any) -> Any:
    height, width = depth.shape
    pose = scene.pose(set_values(scene.parameters, None, 0.0, scene.where), width / height)
    return pose.pixel(height) * np.where(np.isfinite(depth), depth, 0.0)


FAULTY = ("hello", "columns", "csg", "plates", "smoothing", "primitives")
PICTURES = {
    "0.1 px behind": lambda depth, pixel: depth + 0.11 * pixel,
    "0.1 px before": lambda depth, pixel: depth - 0.11 * pixel,
    "a hit lost": lambda depth, _: np.where(
        np.arange(depth.size).reshape(depth.shape) == _middle(depth), np.inf, depth
    ),
    "a row shifted": lambda depth, _: np.roll(depth, 1, axis=1),
    "a column of sky": lambda depth, _: np.where(np.arange(depth.shape[1]) == depth.shape[1] // 2, np.inf, depth),
    "half the distance": lambda depth, _: 0.5 * depth,
}
"""Faults of whole pictures."""


def _middle(depth: Any) -> int:
    return int(np.flatnonzero(np.isfinite(depth))[np.isfinite(depth).sum() // 2])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", type=Path)
    parser.add_argument("--size")
    parser.add_argument("--within", default="0.05px")
    parser.add_argument("--nodes", action="store_true")
    parser.add_argument("--trees", type=int, metavar="COUNT")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--faults", action="store_true")
    asked = parser.parse_args()
    asked.size = asked.size or ("48x48" if asked.nodes or asked.trees else "160x90")
    (nodes if asked.nodes else trees if asked.trees else faults if asked.faults else examples)(asked)


if __name__ == "__main__":
    main()
