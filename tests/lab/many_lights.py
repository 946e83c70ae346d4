"""What many lights cost, with a grid of cells and in a loop over all: `python -m tests.lab.many_lights [64 1024 ...]`.

CPU seconds of one process, on a driver that draws on one thread (LP_NUM_THREADS=1).
"""

from __future__ import annotations

import sys
import time

import numpy as np

import raymarch as rm
from raymarch.cost.effects import evaluations_of
from raymarch.plan import lights
from raymarch.scene.scene import Scene

SIZE = (640, 360)


def town(n: int, *, limited: bool = True) -> Scene:
    """Boxes on a floor under n lights, one on each 2 x 2 units, each with a shadow and a range of 4."""
    random = np.random.default_rng(1)
    edge = 2.0 * n**0.5
    boxes = rm.box((1.2, 1.6, 1.2)).repeat((4, None, 4)).translate((0, 0.8, 0))
    places = random.uniform((-edge / 2, 1.8, -edge / 2), (edge / 2, 3.0, edge / 2), (n, 3))
    reach = 4.0 if limited else None
    lamps = [rm.PointLight(p, random.uniform(0.3, 1, 3), 0.6, shadow=True, range=reach) for p in places]
    return rm.Scene(boxes | rm.plane(), camera=rm.Camera((0.3, 5, edge / 2), (0, 0, 0)), lights=lamps, sky=(0, 0, 0))


def main(counts: list[int]) -> None:
    found = lights.in_cells
    for n in counts:
        drawn = {}
        for name, scene in (("cells", town(n)), ("loop", town(n)), ("no range", town(n, limited=False))):
            if name == "no range" and n > 64:
                continue
            lights.in_cells = found if name == "cells" else lambda scene: False
            with rm.Renderer(SIZE) as renderer:
                times = [time.process_time()]
                for _ in range(4):
                    drawn[name] = renderer.render(scene).color
                    times.append(time.process_time())
                first, *more = np.diff(times)
                asked = evaluations_of(scene, renderer)
            seconds = f"first {first:6.2f} s, frame {np.median(more):6.3f} s"
            print(f"{n:6,} {name:9} {seconds}, {asked:.1f} evaluations a pixel")
        print("       the same picture:", np.array_equal(drawn["cells"], drawn["loop"]))


if __name__ == "__main__":
    main([int(n) for n in sys.argv[1:]] or [16, 64, 256, 1024])
