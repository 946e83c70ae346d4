"""Times `raymarch render` from the command to the file, against another checkout: CPU and wall time, in turns.

python -m tests.lab.start                              # this checkout, examples/hello.py
python -m tests.lab.start ../other -n 15               # and another one
python -m tests.lab.start --scene examples/csg.py --cold   # without the driver's shader cache
python -m tests.lab.start --words --help               # another command

The first run of each is not counted: it compiles the bytecode and fills the driver's cache.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[2]


def once(tree: Path, words: list[str], folder: str, cold: bool) -> tuple[float, float]:
    """Wall and CPU time of a command in seconds."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    environment |= {"PYTHONPATH": str(tree), "MESA_SHADER_CACHE_DISABLE": "true" if cold else "false"}
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    command = [sys.executable, "-m", "raymarch", *words]
    subprocess.run(command, cwd=folder, env=environment, check=True, capture_output=True)
    wall, after = time.perf_counter() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
    return wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("trees", nargs="*", type=Path, help="other checkouts")
    parser.add_argument("-n", type=int, default=15, help="runs of each")
    parser.add_argument("--scene", default="examples/hello.py")
    parser.add_argument("--cold", action="store_true", help="without the driver's shader cache")
    parser.add_argument("--words", nargs=argparse.REMAINDER, help="the words of another command")
    given = parser.parse_args()
    trees = [ROOT, *(tree.resolve() for tree in given.trees)]
    words = given.words or ["render", str(ROOT / given.scene)]
    found: dict[Path, list[tuple[float, float]]] = {tree: [] for tree in trees}
    with tempfile.TemporaryDirectory() as folder:
        for turn in range(given.n + 1):
            for tree in trees:
                for file in Path(folder).glob("*.png"):
                    file.unlink()
                times = once(tree, words, folder, given.cold)
                if turn:
                    found[tree].append(times)
    for tree, runs in found.items():
        wall, cpu = (np.quantile(column, [0.5, 0.0, 1.0]) for column in np.array(runs).T)
        shown = [f"{name} {q[0]:.3f} s ({q[1]:.3f} to {q[2]:.3f})" for name, q in (("CPU", cpu), ("wall", wall))]
        print(f"{tree}: {', '.join(shown)}, {len(runs)} runs")


if __name__ == "__main__":
    main()
