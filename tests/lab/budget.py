"""Frames within a time budget: `python -m tests.lab.budget [320x180 ... | examples/mandelbulb.py ...]`.

A size: light of 64 lights, within 33 ms. A scene file: 8 steps a pass, 320x180, within 16 ms.

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
RUNS = 5
"""Number of times that a scene is drawn whole and in frames, in turns. Medians are compared."""
SCENE = Path(__file__).parents[2] / "examples" / "papers" / "lights.py"


def cpu_time(self: Clock, draw: Callable[[], None]) -> float:
    """The CPU time of a draw in milliseconds, in place of the wall clock."""
    self._context.finish()
    start = time.process_time()
    draw()
    self._context.finish()
    return 1e3 * (time.process_time() - start)


def of_scene(file: str, size: tuple[int, int] = (320, 180), within: float = 16.0) -> None:
    """Print the times of the frames of a scene from a coarse picture to the whole one."""
    scene = runpy.run_path(file)["scene"]
    plain = scene.replace(quality=scene.quality.replace(samples=1, temporal="off"))
    split = plain.replace(quality=plain.quality.replace(steps_per_pass=8, temporal="accumulate"))
    with rm.Renderer(size) as renderer:
        effects = {each.name for each in renderer.prepared(split).plan.passes if each.effect is not None}

        def drawn(scene: rm.Scene, **given: float) -> list[tuple[float, float]]:
            """The times of the frames of a picture: all, and post effects alone, which each frame has. No frame is
            kept: one that somebody holds is read before its target is drawn again."""
            renderer.forget()
            found, complete = [], False
            while not complete:
                frame = renderer.render(scene, **given)
                complete = frame.complete
                times = [(timing.draw, timing.draw * (timing.name in effects)) for timing in frame.timings]
                found.append(tuple(np.sum(times, axis=0)))
                del frame
            return found

        runs = [(drawn(plain), drawn(split), drawn(split, within=within)) for _ in range(RUNS + 2)]
    each = [[np.sum(times, axis=0) for times in run] for run in runs[2:]]  # the first ones learn the times of passes
    (whole, of_whole), (passes, _), (parts, of_parts) = np.median(each, axis=0)
    took = [
        time
        for time, _ in sorted((run[2] for run in runs[2:]), key=lambda run: sum(time for time, _ in run))[RUNS // 2]
    ]
    shares = f"median {np.median(took[:-1] or took) / within:.2f}, p95 {np.percentile(took, 95) / within:.2f}"
    sums = f"{parts / passes:.2f} of {passes:.0f} ms in passes, {parts / whole:.2f} of {whole:.0f} ms in one"
    if effects:
        sums += f"; without post effects {(parts - of_parts) / (whole - of_whole):.2f}"
    print(f"{file}: {len(took)} frames, of the budget: {shares}; sum {sums}")


def main(names: list[str]) -> None:
    Clock.time = cpu_time  # type: ignore[method-assign]
    for name in names:
        if name.endswith(".py"):
            of_scene(name)
    if sizes := [name for name in names if not name.endswith(".py")]:
        lights(sizes)


def lights(sizes: list[str]) -> None:
    """Print the times of frames of 64 lights."""
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
