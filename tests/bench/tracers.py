"""Evaluations a pixel of every tracer on the examples, beside the floor N*.

python -m tests.bench.tracers
"""

from __future__ import annotations

from pathlib import Path

import raymarch as rm
from raymarch.scene import load
from raymarch.scene.quality import TRACERS
from raymarch.truth.floor import floor_evaluations

SIZE = (320, 180)
EXAMPLES = Path(__file__).parents[2] / "examples"


def main() -> None:
    names = [name for name in TRACERS if name != "auto"]
    print(f"{'':<12}{'N*':>8}" + "".join(f"{name:>16}" for name in names))
    with rm.Renderer(SIZE) as renderer:
        for file in sorted(EXAMPLES.glob("*.py")):
            scene = load(file)
            floor = float(floor_evaluations(scene, SIZE).mean())
            cells = []
            for name in names:
                scene.quality = rm.Quality(tracer=name)
                mean = float(renderer.render(scene, outputs=("evaluations",)).evaluations.mean())
                cells.append(f"{mean:8.2f} ({mean / floor:.2f})")
            print(f"{file.stem:<12}{floor:8.2f}" + "".join(f"{cell:>16}" for cell in cells))


if __name__ == "__main__":
    main()
