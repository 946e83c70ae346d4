"""What films take beside the drawing: CPU time and wall time of frames of 640x360 as files, and of drawing them alone.

python -m tests.lab.films                                # hello, 200 frames
python -m tests.lab.films village --frames 60 --rounds 3

Each kind of file is written in a process of its own, and all kinds take turns. The ratios are those to the drawing.
"""

from __future__ import annotations

import argparse
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

EXAMPLES = Path(__file__).parents[2] / "examples"
KINDS = ("alone", "png", "mp4", "gif", "exr")
ALONE = """
import sys, raymarch as rm
from raymarch.scene import load
scene, frames = load(sys.argv[1]), int(sys.argv[2])
with rm.Renderer((640, 360)) as renderer:
    for i in range(frames):
        renderer.render(scene, time=i / 30)
    renderer.context.finish()
"""


def spent(kind: str, scene: Path, frames: int) -> tuple[float, float]:
    """CPU seconds and wall seconds of a process that draws the frames."""
    with tempfile.TemporaryDirectory() as folder:
        if kind == "alone":
            command = ["-c", ALONE, str(scene), str(frames)]
        else:
            name = f"film.{kind}" if kind in ("mp4", "gif") else f"frame-{{:04d}}.{kind}"
            given = ["--frames", f"0:{frames - 1}", "--fps", "30", "--size", "640x360", "-o", f"{folder}/{name}"]
            command = ["-m", "raymarch", "render", str(scene), *given]
        before, begin = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
        subprocess.run([sys.executable, *command], check=True, capture_output=True, env=dict(os.environ))
        wall, after = time.perf_counter() - begin, resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, wall


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("name", nargs="?", default="hello", help="an example")
    parser.add_argument("--frames", type=int, default=200)
    parser.add_argument("--rounds", type=int, default=3)
    given = parser.parse_args()
    scene = EXAMPLES / f"{given.name}.py"
    found: dict[str, list[tuple[float, float]]] = {kind: [] for kind in KINDS}
    for _ in range(given.rounds):
        for kind in KINDS:
            found[kind].append(spent(kind, scene, given.frames))
    print(f"{'kind':8} {'CPU s':>8} {'wall s':>8} {'CPU ratio':>10} {'wall ratio':>11}")
    alone = found["alone"]
    for kind, rows in found.items():
        cpu, wall = (statistics.median(row[k] for row in rows) for k in (0, 1))
        ratios = (statistics.median(row[k] / own[k] for row, own in zip(rows, alone, strict=True)) for k in (0, 1))
        print(f"{kind:8} {cpu:8.2f} {wall:8.2f} {' '.join(f'{ratio:10.2f}' for ratio in ratios)}", flush=True)


if __name__ == "__main__":
    main()
