"""Cases of who owns the OpenGL context: threads, contexts of other code, forks."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import moderngl
import numpy as np

from raymarch.gpu import Renderer, current
from tests.hard.world import Figure, World, case
from tests.lab.owners import SIZE, Foreign, scene

ROOT = Path(__file__).parents[2]


def _wrong(picture: Any, right: Any) -> float:
    """Percent of the pixels that are not the same bit for bit."""
    return 100.0 * float(np.mean(np.any(picture != right, axis=-1)))


@case(72, "a renderer in another thread", before="memory that nobody wrote, `complete` True")
def threads(world: World) -> Iterator[Figure]:
    """An OpenGL context is current in one thread. Each call makes it current and releases it, so that any thread can
    draw. Threads that use the same renderer wait for each other."""
    right = [world.draw(scene(k), SIZE, ("color",)).color for k in range(3)]
    wrong: list[float] = []

    def draw(renderer: Renderer) -> None:
        wrong.extend(_wrong(renderer.render(scene(k)).color, right[k]) for k in range(3))

    with Renderer(SIZE, "egl") as one, Renderer(SIZE, "egl") as two:
        draw(one)
        workers = [threading.Thread(target=draw, args=(each,), daemon=True) for each in (one, two, one, two)]
        for worker in workers:
            worker.start()
        for worker in workers:
            worker.join(20)
        draw(two)
    yield Figure("threads that hang or fail, of 4", 6 - len(wrong) / 3, 0, "each draws three frames")
    yield Figure("% of pixels unlike those drawn alone", max(wrong), 0, "it is current in the thread that draws")


@case(76, "a context of other code", before="85 % of the pixels wrong, no error")
def foreign(world: World) -> Iterator[Figure]:
    """pygame, moderngl or glfw make their own context current between two frames. The platform is queried for it before
    each call, and it is made current again afterwards."""
    right = [world.draw(scene(k), SIZE, ("color",)).color for k in range(3)]
    settings: dict[str, Any] = {"backend": "egl"}
    wrong, harmed = [], 0
    with Renderer(SIZE, "egl") as renderer:
        current.unbind()
        gl: Any = moderngl.create_context(require=330, standalone=True, **settings)
        other = Foreign("other", gl, gl.__enter__)
        for k in (0, 1, 2, 1):
            other.begin()
            frame = renderer.render(scene(k))
            wrong.append(_wrong(frame.color, right[k]))
            harmed += frame.depth.shape != SIZE[::-1] or not other.unharmed()
        current.unbind()
        gl.release()
    yield Figure("% of pixels unlike those drawn alone", max(wrong), 0, "the platform is queried before each call")
    yield Figure("frames that leave the other context harmed or not current", harmed, 0, "it is made current again")


@case(77, "a fork after a render", before="hangs for ever")
def forks(world: World) -> Iterator[Figure]:
    """The driver's threads do not exist in a forked process, so that a draw there would hang. It is refused with the
    cure. A process that is forked before any use of OpenGL can draw."""
    late = """
import raymarch
from tests.lab.owners import SIZE, forked, scene
def work(): return raymarch.render(scene(0), SIZE, backend="egl").tobytes()
"""
    told = "print(sum(w == 'refused' and b'spawn' in m and b'forkserver' in m for w, m in answers))"
    yield Figure(
        "forks after a render that are not refused with the cure, of 2",
        2 - _answered(f"{late}work()\nanswers = [forked(work), forked(work)]\n{told}"),
        0,
        "drivers do not survive a fork",
    )
    yield Figure(
        "forks before a render that draw something else",
        1 - _answered(late + "w, m = forked(work)\nprint(int(w == 'drawn' and m == work()))"),
        0,
        "nothing was shared yet",
    )


def _answered(code: str) -> int:
    """The number that a program prints within its time; 0 if it hangs or fails."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, (ROOT, ROOT / "tests")))}
    command = [sys.executable, "-c", code]
    try:
        done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=180)
    except subprocess.TimeoutExpired:
        return 0
    return int(done.stdout) if done.returncode == 0 else 0
