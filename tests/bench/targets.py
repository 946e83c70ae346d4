"""Whether --error and --within keep what they are asked for: 8 scenes, 3 targets each.

python -m tests.bench.targets            # errors, which need no quiet machine, then times
python -m tests.bench.targets --error    # errors alone

Each found quality is drawn once more, by another renderer, and held against the truth or the clock.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np

import raymarch as rm
from raymarch.cost.errors import measure
from raymarch.cost.reference import reference
from raymarch.cost.search import for_error, for_time, parse_error
from raymarch.cost.settings import with_quality
from raymarch.errors import CostError
from raymarch.scene import load

EXAMPLES = Path(__file__).parents[2] / "examples"
SIZE = (160, 90)
ERRORS = ("0.5px", "0.05px", "0.003px")
FACTORS = (0.8, 1.1, 2.0)
"""Times that are asked for, over what the default takes."""
ALLOWED = 1.15
"""How much longer than asked for a frame may take."""
FRAMES = 15


def scenes() -> dict[str, Callable[[], rm.Scene]]:
    files = ("hello", "csg", "columns", "primitives", "village")
    made: dict[str, Callable[[], rm.Scene]] = {n: lambda n=n: load(EXAMPLES / f"{n}.py") for n in files}  # type: ignore[misc]
    made["twist"] = lambda: rm.Scene(rm.box((0.8, 2, 0.8)).twist(1.2))
    made["gyroid"] = lambda: rm.Scene(rm.gyroid() & rm.sphere(2))
    made["menger"] = lambda: rm.Scene(rm.menger() | rm.plane(offset=-1.2))
    return made


def frame_time(scene: rm.Scene) -> float:
    with rm.Renderer(SIZE) as renderer:
        renderer.render(scene)
        return float(np.median([renderer.render(scene).milliseconds for _ in range(FRAMES)]))


def errors() -> None:
    kept = asked = 0
    for name, make in scenes().items():
        for target in ERRORS:
            scene = make()
            asked += 1
            try:
                found = for_error(scene, target, SIZE)
            except CostError as refusal:
                print(f"{name:<12}{target:<10}refused: {refusal.what}")
                continue
            with rm.Renderer(SIZE) as renderer:
                depth = renderer.render(with_quality(scene, found.quality), outputs=("depth",)).depth
            reached = measure(reference(scene, SIZE, samples=0), depth)
            good = reached.sound and reached.pixels_p99 <= parse_error(target)[1]
            kept += good
            print(f"{name:<12}{target:<10}{'kept' if good else 'BROKEN':<8}{reached.pixels_p99:.5f} px  {found.name}")
    print(f"errors kept: {kept} of {asked}")


def times() -> None:
    kept = asked = refused = 0
    for name, make in scenes().items():
        usual = frame_time(make())
        for factor in FACTORS:
            scene, target = make(), factor * usual
            asked += 1
            try:
                found = for_time(scene, target, SIZE)
            except CostError as refusal:
                refused += 1
                print(f"{name:<12}{target:8.2f} ms  refused: {refusal.legal}")
                continue
            reached = frame_time(with_quality(scene, found.quality))
            good = reached <= ALLOWED * target
            kept += good
            print(f"{name:<12}{target:8.2f} ms  {'kept' if good else 'BROKEN':<8}{reached:8.2f} ms  {found.name}")
    print(f"times kept within {ALLOWED}: {kept} of {asked}, {refused} refused")


if __name__ == "__main__":
    errors()
    if "--error" not in sys.argv:
        times()
