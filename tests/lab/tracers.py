"""Evaluations a pixel of every tracer and schedule on the examples, beside the floor N*; misses against the truth.

python -m tests.lab.tracers [NAME ...]     examples by name; all that are there without one
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import raymarch as rm
from raymarch.scene import load
from raymarch.scene.quality import TRACERS
from raymarch.truth.floor import floor_evaluations

SIZE = (320, 180)
EXAMPLES = Path(__file__).parents[2] / "examples"
STEPS = 4000  # enough for each schedule to come to its end


def main() -> None:
    settings = [(name, "single") for name in TRACERS if name != "auto"]
    settings += [("auto", schedule) for schedule in ("two", "four", "six", "cone", "cones")]
    files = [EXAMPLES / f"{name}.py" for name in sys.argv[1:]] or sorted(EXAMPLES.glob("*.py"))
    print("evaluations a pixel (times N*), hits missed and invented against float64\n")
    with rm.Renderer(SIZE) as renderer:
        for file in files:
            scene = load(file)
            certified = scene.node.exactness != "estimate"
            floor = float(floor_evaluations(scene, SIZE).mean()) if certified else float("nan")
            truth = rm.truth(scene, SIZE)
            true_hit = np.isfinite(truth.depth)
            print(f"{file.stem}   N* {floor:.2f}")
            given = scene.quality
            for tracer, schedule in settings:
                quality = given.replace(
                    tracer=tracer,
                    schedule=schedule,
                    max_steps=STEPS,
                    assume_certified=not certified,
                    omega=None,
                    analytic=False,
                )
                scene = scene.replace(quality=quality)
                frame = renderer.render(scene, outputs=("evaluations",))
                mean, hit = float(frame.evaluations.mean()), np.isfinite(frame.depth)
                missed, invented = int((true_hit & ~hit).sum()), int((hit & ~true_hit).sum())
                print(f"  {tracer:<14}{schedule:<8}{mean:9.2f} ({mean / floor:4.2f}) {missed:7d}{invented:7d}")


if __name__ == "__main__":
    main()
