"""What pragmas of NVIDIA's compiler and choices of the plan do to the time of compiling and of drawing.

python -m tests.gpu.pragmas [--size 1920x1080] [--jobs 14] [--seconds 60] [EXAMPLE ...]

Each case is a process of its own, so that nothing is cached. Draws of several processes share the device: their times
are hints alone.
"""

from __future__ import annotations

import argparse
import os
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures import TimeoutError as Late
from functools import partial
from multiprocessing import get_context
from typing import Any

PRAGMAS = {
    "": (),
    "unroll": ("optionNV(unroll none)",),
    "inline": ("optionNV(inline none)",),
    "ifcvt": ("optionNV(ifcvt none)",),
    "three": ("optionNV(unroll none)", "optionNV(inline none)", "optionNV(ifcvt none)"),
}
SETTINGS: dict[str, dict[str, Any]] = {"data": {"objects": "data"}, "no boxes": {"bounding_volumes": False}}
EXAMPLES = ("village", "showcase/chess", "papers/array", "showcase/lanterns", "large/costly", "papers/frosted")


def measure(name: str, pragma: str, setting: str, size: tuple[int, int]) -> str:
    """Milliseconds of compiling and of drawing one case."""
    import raymarch as rm
    from raymarch.gpu.program import FULL_SCREEN, Program
    from raymarch.scene import load
    from tests.gpu import times  # sets what the driver reads from the environment

    made, lines = Program.__init__, "".join(f"#pragma {text}\n" for text in PRAGMAS[pragma])

    def with_pragmas(self: Program, context: Any, vertex: str, fragment: str, *more: Any) -> None:
        if vertex == FULL_SCREEN and fragment.startswith("#version 330 core\n"):
            fragment = fragment.replace("#version 330 core\n", f"#version 330 core\n{lines}", 1)
        made(self, context, vertex, fragment, *more)

    Program.__init__ = with_pragmas  # type: ignore[method-assign]
    scene = load(times.EXAMPLES / f"{name}.py")
    scene = scene.replace(quality=scene.quality.replace(**SETTINGS.get(setting, {})))
    with rm.Renderer(size) as renderer:
        begin = time.perf_counter()
        frame = renderer.render(scene)
        first = 1e3 * (time.perf_counter() - begin)
        compiled = sum(t.compile for t in frame.timings)
        calls = renderer.draw_calls(scene)
        with renderer.context.bound():
            drawn = times.timed(renderer.context.gl, lambda: [call.draw() for call in calls], 5)
    return (
        f"{name:<20}{pragma or setting or '-':<10} compile {compiled:8.0f} ms   first {first:8.0f}   draw {drawn:9.3f}"
    )


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("examples", nargs="*", default=EXAMPLES)
    parser.add_argument("--size", default="1920x1080")
    parser.add_argument("--jobs", type=int, default=14)
    parser.add_argument("--seconds", type=float, default=60)
    given = parser.parse_args(arguments)
    width, height = map(int, given.size.split("x"))
    cases = [(name, pragma, "") for name in given.examples for pragma in PRAGMAS]
    cases += [(name, "", setting) for name in given.examples for setting in SETTINGS]
    cases.sort(key=lambda case: case[0] != "showcase/chess")  # the longest first
    pool = ProcessPoolExecutor(given.jobs, get_context("spawn"), max_tasks_per_child=1)
    asked = [pool.submit(partial(measure, *case, (width, height))) for case in cases]
    try:
        for done in as_completed(asked, given.seconds):
            print(done.result() if done.exception() is None else f"fails: {done.exception()}"[:200], flush=True)
    except Late:
        print("out of time")
    pool.shutdown(wait=False, cancel_futures=True)
    os._exit(0)  # without waiting for cases that are out of time


if __name__ == "__main__":
    raise SystemExit(main())
