"""Proofs of pictures.

python -m tests.lab.proofs [SCENE.py ...]     # the examples, or some scenes
python -m tests.lab.proofs --nodes            # every sample of every node; --skip 200 goes on behind the first ones
python -m tests.lab.proofs --trees 2000       # random solids; --seed N begins elsewhere, --estimates tries those too,
                                              # --skip 1000 goes on behind the first ones
python -m tests.lab.proofs --shadows SCENE.py # and the hard shadows of all lights
python -m tests.lab.proofs --objects 100000   # boxes and balls of random sizes in random places
python -m tests.lab.proofs --whole SCENE.py   # the covered part of each pixel against 1,089 samples; --set horizon=1
python -m tests.lab.proofs --faults           # seeded faults (tests/lab/proof_faults.py)
--size 160x90 and --within 0.05px are those of the pictures
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections import Counter
from pathlib import Path
from typing import Any
from unittest.mock import patch

import hypothesis
import numpy as np
from hypothesis import HealthCheck, Phase, settings
from hypothesis import strategies as st

import raymarch as rm
from raymarch.cli.common import parse_settings
from raymarch.errors import RaymarchError
from raymarch.proof import search
from raymarch.proof.shadows import Shadows
from raymarch.scene.file import load
from tests.hard.python import as_python
from tests.lab import proof_faults
from tests.lab.fuzz import scene_of, small
from tests.lab.proof_faults import Depths
from tests.support.node_samples import samples

EXAMPLES = Path(__file__).parents[2] / "examples"
SLOW = ("chess", "array", "blob", "city", "forest", "lamps", "molecule", "costly", "mandelbulb")
"""Examples that take minutes; ask for them by name."""


LONG = 10.0
"""CPU seconds of a proof that is shown in any case."""

PROMISED = "0.1px"
"""Of docs/marching.md: a hit that is contradicted at this tolerance breaks the promise."""


def _tried(scene: rm.Scene, given: argparse.Namespace, frame: Any = None, within: str = "") -> rm.Proof:
    width, height = map(int, given.size.split("x"))
    with warnings.catch_warnings(), patch.object(search, "MOST", given.effort):
        warnings.simplefilter("ignore")
        return rm.prove(scene, frame, size=(width, height), tolerance=within or given.within, shadows=given.shadows)


def _row(name: str, found: rm.Proof, begun: float, *more: Any) -> None:
    print(
        f"| {name} | {100 * found.share:.3f} % | {found.contradicted} | {found.open} "
        f"| {found.evaluations.mean():.1f}, median {np.median(found.evaluations):.0f} |",
        f" {time.process_time() - begun:.1f} s CPU",
        *([dict(found.reasons)] if found.open else []),
        *more,
        flush=True,
    )
    if found.shadows:
        asked, *counts = (sum(each) for each in zip(*map(_counts, found.shadows), strict=True))
        print(
            f"| {name}, shadows | {asked} | {100 * counts[0] / asked:.1f} % | {counts[1]} | {counts[2]} |", flush=True
        )


def _counts(of: Shadows) -> tuple[int, ...]:
    return of.asked, *map(of.count, (search.PROVED, search.CONTRADICTED, search.OPEN))


def objects(given: argparse.Namespace) -> None:
    """Boxes and balls in a room whose size keeps their density."""
    begun, count, random = time.process_time(), given.objects, np.random.default_rng(1)
    room = count ** (1.0 / 3.0)
    places = np.tile(np.eye(4)[:3], (count, 1, 1))
    places[:, :, :3] *= random.uniform(0.3, 1.0, (count, 1, 1))
    places[:, :, 3] = random.uniform(-room, room, (count, 3))
    half = count // 2
    solid = rm.instances(rm.box(1.0), places[:half]) | rm.instances(rm.sphere(0.5), places[half:])
    camera = rm.Camera((0.7 * room, 0.5 * room, 2.2 * room), (0, 0, 0))
    _row(f"{count} objects", _tried(rm.Scene(solid, camera), given), begun)


def examples(given: argparse.Namespace) -> None:
    for file in given.scenes or sorted(f for f in EXAMPLES.rglob("*.py") if f.stem not in SLOW):
        begun = time.process_time()
        _row(file.stem, _tried(load(file), given), begun)


SAMPLES = 33
"""Samples of a pixel along each axis, of which the middle one is its centre."""


def whole(given: argparse.Namespace) -> None:
    """Bounds of the covered part of each pixel against the share of samples that hit."""
    width, height = map(int, given.size.split("x"))
    params = parse_settings(given.set)
    for file in given.scenes:
        begun, scene = time.process_time(), load(file)
        with rm.Renderer((width * SAMPLES, height * SAMPLES)) as renderer:
            fine = np.asarray(renderer.render(scene, 0.0, params, outputs=("depth",)).depth)
        part = np.isfinite(fine).reshape(height, SAMPLES, width, SAMPLES).mean(axis=(1, 3))
        edge = (part > 0.0) & (part < 1.0)
        frame = Depths(fine[SAMPLES // 2 :: SAMPLES, SAMPLES // 2 :: SAMPLES])
        found = rm.prove(scene, frame, pixels="whole", params=params, tolerance=given.within)
        assert found.coverage is not None
        low, high = found.coverage
        print(
            f"| {file.stem} {' '.join(given.set)} | {edge.sum()} of {edge.size} pixels with an edge "
            f"| {((part < low) | (part > high)).sum()} outside | bounds {np.mean((high - low)[edge]):.3f} apart there "
            f"| {found.contradicted} contradicted | {time.process_time() - begun:.1f} s CPU",
            flush=True,
        )


class Tally:
    """Scenes and pixels by verdict, apart for estimates, of which the march promises nothing."""

    def __init__(self, given: argparse.Namespace) -> None:
        self.given = given
        self.scenes: Counter[str] = Counter()
        self.pixels: Counter[str] = Counter()

    def judge(self, name: str, scene: rm.Scene) -> rm.Proof | None:
        """The proof of a scene; a row if not all of it is proved, or if it took long. None if the scene is refused."""
        begun, more = time.process_time(), []
        kind = "estimate" if scene.node.exactness == "estimate" else "certified"
        try:
            found = _tried(scene, self.given)
            if found.contradicted:
                at_promise = _tried(scene, self.given, Depths(found.depth), PROMISED).contradicted
                more = [kind, f"{at_promise} contradicted at {PROMISED}"]
        except RaymarchError as error:
            self.scenes["refused"] += 1
            print(f"| {name} | refused: {str(error).splitlines()[0][:150]}", flush=True)
            return None
        verdict = "contradicted" if found.contradicted else "open" if found.open else "proved"
        self.scenes[f"{kind} {verdict}"] += 1
        for each in ("proved", "contradicted", "open"):
            self.pixels[f"{kind} {each}"] += getattr(found, each)
        if more and at_promise:
            self.pixels[f"{kind} contradicted at {PROMISED}"] += at_promise
        if found.share < 1.0 or time.process_time() - begun > LONG:
            _row(name, found, begun, *more)
        return found

    def show(self) -> None:
        print(dict(self.scenes), dict(self.pixels), flush=True)


def nodes(given: argparse.Namespace) -> None:
    tally = Tally(given)
    for done, sample in enumerate(samples()[given.skip :], given.skip):
        if done % 50 == 0:
            print(f"{done} samples:", end=" ")
            tally.show()
        node = sample.build()
        tally.judge(sample.id, scene_of(node.extrude(0.5) if node.dimension == 2 else node, 0))
    tally.show()


def trees(given: argparse.Namespace) -> None:
    tally, skipped, done = Tally(given), Counter[str](), Counter[str]()

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
        scene = scene_of(node, view)
        if scene.node.exactness == "estimate" and not given.estimates:
            skipped["estimates"] += 1
            hypothesis.reject()
        done["trees"] += 1
        if done["trees"] <= given.skip:
            return
        found = tally.judge(f"view {view}", scene)
        if found is not None and found.contradicted:
            print(as_python(node), flush=True)
        if tally.scenes.total() % 50 == 0:
            print(f"{done['trees']} trees:", end=" ")
            tally.show()

    look()
    tally.show()
    print(dict(skipped))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", type=Path)
    parser.add_argument("--size")
    parser.add_argument("--within", default="0.05px")
    parser.add_argument("--nodes", action="store_true")
    parser.add_argument("--whole", action="store_true")
    parser.add_argument("--shadows", action="store_true")
    parser.add_argument("--objects", type=int, metavar="COUNT")
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE")
    parser.add_argument("--trees", type=int, metavar="COUNT")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--skip", type=int, default=0, help="samples or random solids, not judged again")
    parser.add_argument("--estimates", action="store_true", help="random solids whose field is an estimate, too")
    parser.add_argument("--effort", type=int, help="evaluations for a ray; 500 for random solids")
    parser.add_argument("--faults", action="store_true")
    asked = parser.parse_args()
    asked.effort = asked.effort or (500 if asked.trees else search.MOST)
    sizes = {"96x54": asked.faults, "48x48": asked.nodes or asked.trees, "48x27": asked.whole}
    asked.size = asked.size or next((size for size, given in sizes.items() if given), "160x90")
    if asked.faults:
        proof_faults.main(["--size", asked.size, "--within", asked.within])
        return
    modes = {whole: asked.whole, objects: asked.objects, nodes: asked.nodes, trees: asked.trees}
    next((mode for mode, given in modes.items() if given), examples)(asked)


if __name__ == "__main__":
    main()
