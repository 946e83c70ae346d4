"""Whether --error and --within keep what they are asked for: 8 scenes; 3 distances, 2 pictures' errors, 3 times each.

python -m tests.lab.targets                      # all of it, which takes long
python -m tests.lab.targets --error --within     # distances, which need no quiet machine, and times, which do
python -m tests.lab.targets --flip               # pictures; their truths take the longest

Each quality that was found is drawn once more, by another renderer, and held against the truth or the clock; pictures
against a truth of four times as many rays, or more, than the search had. A line for each, a verdict for each part, and
exit code 1 if one fails.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np

import raymarch as rm
from raymarch.cost.errors import measure, picture_doubt
from raymarch.cost.reference import reference
from raymarch.cost.search import for_error, for_time, parse_error
from raymarch.cost.settings import with_quality
from raymarch.errors import CostError
from raymarch.scene import load

EXAMPLES = Path(__file__).parents[2] / "examples"
SIZE = (160, 90)
SMALL = (80, 45)
"""For pictures, whose truths take 16 to 256 rays a pixel."""
ERRORS = ("0.5px", "0.05px", "0.003px")
FLIPS = ("flip:0.3", "flip:0.15")
FACTORS = (0.8, 1.1, 2.0)
"""Times that are asked for, over what the default takes."""
ALLOWED = 1.15
"""How much longer than asked for a frame may take."""
ENOUGH = 20 / 24
"""Share of all times that must be kept or clearly refused."""
FRAMES = 15
ROUNDS = 3
"""How often those frames are drawn, each time in turn with the default's: what strikes one strikes the other."""


def scenes() -> dict[str, Callable[[], rm.Scene]]:
    files = ("hello", "csg", "columns", "primitives", "village")
    made: dict[str, Callable[[], rm.Scene]] = {n: lambda n=n: load(EXAMPLES / f"{n}.py") for n in files}  # type: ignore[misc]
    made["twist"] = lambda: rm.Scene(rm.box((0.8, 2, 0.8)).twist(1.2))
    made["gyroid"] = lambda: rm.Scene(rm.gyroid() & rm.sphere(2))
    made["menger"] = lambda: rm.Scene(rm.menger() | rm.plane(offset=-1.2))
    return made


def row(name: str, target: str, verdict: str, words: str) -> None:
    print(f"{name:<12}{target:<12}{verdict:<9}{words}", flush=True)


def verdict(what: str, kept: int, asked: int, refused: int, holds: bool) -> bool:
    print(f"{what}: {kept} of {asked} kept, {refused} refused: {'HOLDS' if holds else 'FAILS'}\n", flush=True)
    return holds


def errors() -> bool:
    """Every distance is kept."""
    kept = refused = 0
    for name, make in scenes().items():
        scene = make()
        known = reference(scene, SIZE, samples=0)
        with rm.Renderer(SIZE) as searching, rm.Renderer(SIZE) as judging:  # one each for all targets: less to compile
            for target in ERRORS:
                try:
                    found = for_error(scene, target, SIZE, renderer=searching)
                except CostError as refusal:
                    refused += 1
                    row(name, target, "refused", refusal.what)
                    continue
                depth = judging.render(with_quality(scene, found.quality), outputs=("depth",)).depth
                reached = measure(known, depth)
                good = reached.sound and reached.pixels_p99 <= parse_error(target)[1]
                kept += good
                row(name, target, "kept" if good else "BROKEN", f"{reached.pixels_p99:.5f} px  {found.name}")
    asked = len(scenes()) * len(ERRORS)
    return verdict("distances", kept, asked, refused, kept == asked)


def flips() -> bool:
    """Every picture's error is kept against a better truth, or refused because no setting reaches it."""
    kept = refused = 0
    for name, make in scenes().items():
        scene = make()
        with rm.Renderer(SMALL) as searching, rm.Renderer(SMALL) as judging:
            for target in FLIPS:
                try:
                    found = for_error(scene, target, SMALL, renderer=searching)
                except CostError as refusal:
                    refused += 1
                    row(name, target, "refused", refusal.what)
                    continue
                frame = judging.render(with_quality(scene, found.quality))
                known = reference(scene, SMALL, samples=min(256, 4 * found.point.known.samples))
                reached = measure(known, frame.depth, color=frame.color)
                good = reached.sound and reached.flip_p99 + picture_doubt(known) <= parse_error(target)[1]
                kept += good
                words = f"FLIP {reached.flip_p99:.4f}, truth within {picture_doubt(known):.4f}  {found.name}"
                row(name, target, "kept" if good else "BROKEN", words)
    asked = len(scenes()) * len(FLIPS)
    return verdict("pictures", kept, asked, refused, kept + refused == asked)


def frame_time(scene: rm.Scene, renderer: rm.Renderer) -> float:
    """Median milliseconds of a frame."""
    renderer.render(scene)
    return float(np.median([renderer.render(scene).milliseconds for _ in range(FRAMES)]))


def times() -> bool:
    """A median within 1.15 times what was asked for, or a refusal that names the fastest."""
    kept = refused = 0
    for name, make in scenes().items():
        scene = make()
        with rm.Renderer(SIZE) as searching, rm.Renderer(SIZE) as judging:
            for factor in FACTORS:
                usual = frame_time(scene, judging)
                target = factor * usual
                try:
                    found = for_time(scene, target, SIZE, renderer=searching)
                except CostError as refusal:
                    refused += 1
                    row(name, f"{target:.2f} ms", "refused", refusal.legal or refusal.what)
                    continue
                made = with_quality(scene, found.quality)
                rounds = [(frame_time(made, judging), frame_time(scene, judging)) for _ in range(ROUNDS)]
                reached, now = (float(np.median(values)) for values in zip(*rounds, strict=True))
                good = reached <= ALLOWED * target
                kept += good
                drift = f", the default {now / usual:.2f} of what it took before" if abs(now / usual - 1) > 0.1 else ""
                words = f"{reached:.2f} ms, {reached / target:.2f} of it{drift}  {found.name}"
                row(name, f"{target:.2f} ms", "kept" if good else "BROKEN", words)
    asked = len(scenes()) * len(FACTORS)
    return verdict(f"times within {ALLOWED}", kept, asked, refused, kept + refused >= ENOUGH * asked)


PARTS = {"--error": errors, "--within": times, "--flip": flips}


if __name__ == "__main__":
    chosen = [part for name, part in PARTS.items() if name in sys.argv or not set(PARTS) & set(sys.argv)]
    results = [part() for part in chosen]
    sys.exit(0 if all(results) else 1)
