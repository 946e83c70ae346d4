"""Light within a time budget, on 64 lights: `python -m tests.lab.budget [320x180 640x360 ...]`.

CPU milliseconds of frames, on a driver that draws on one thread (LP_NUM_THREADS=1).
"""

from __future__ import annotations

import runpy
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

import raymarch as rm
from raymarch.gpu.clock import Clock

BUDGET = 33.0
SCENE = Path(__file__).parents[2] / "examples" / "papers" / "lights.py"


def cpu_time(self: Clock, draw: Callable[[], None]) -> float:
    """The CPU time of a draw in milliseconds, in place of the wall clock."""
    self._context.finish()
    start = time.process_time()
    draw()
    self._context.finish()
    return 1e3 * (time.process_time() - start)


def main(sizes: list[str]) -> None:
    Clock.time = cpu_time  # type: ignore[method-assign]
    scene = runpy.run_path(str(SCENE))["scene"]
    whole = scene.replace(quality=scene.quality.replace(temporal="accumulate"))
    for name in sizes:
        width, height = map(int, name.split("x"))
        for per_pass in ("auto", 1, 16):
            split = whole.replace(quality=whole.quality.replace(lights_per_pass=per_pass))
            with rm.Renderer((width, height)) as renderer:
                renderer.render(split)  # compiles
                renderer.forget()
                frames = [renderer.render(split, within=BUDGET)]
                while not frames[-1].complete:
                    frames.append(renderer.render(split, within=BUDGET))
                color = frames[-1].color
                renderer.forget()
                same = np.array_equal(color, renderer.render(whole).color)
            took = [sum(timing.draw for timing in frame.timings) for frame in frames]
            first, rest = took[0], took[1:]
            spread = f"median {np.median(rest):5.1f}, p95 {np.percentile(rest, 95):5.1f}, most {max(rest):5.1f}"
            print(f"{name} {per_pass!s:>4}: {len(frames):3} frames, first {first:5.1f} ms, then {spread}; same: {same}")


if __name__ == "__main__":
    main(sys.argv[1:] or ["320x180", "640x360"])
