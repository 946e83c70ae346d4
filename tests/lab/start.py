"""Times `raymarch render` from the command to the file, against another checkout: CPU and wall time, in turns.

python -m tests.lab.start                              # this checkout, examples/hello.py
python -m tests.lab.start ../other -n 15               # and another one
python -m tests.lab.start --scene examples/csg.py --cold   # without the driver's shader cache
python -m tests.lab.start --words --help               # another command
python -m tests.lab.start --nodes 20000                # the nodes of a scene of as many objects, in each checkout

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


def make_nodes(n: int) -> None:
    """Prints the CPU time of a node, of six to an object."""
    import raymarch as rm

    def objects(n: int) -> None:
        color = rm.Material(color=(0.2, 0.5, 0.5))
        for i, place in enumerate(np.random.default_rng(1).uniform(-50, 50, (n, 3)).tolist()):
            shape = rm.sphere(0.3 + 0.01 * (i % 7)) if i % 2 else rm.box((0.5, 0.4, 0.3 + 0.01 * (i % 5)))
            turned = shape.round(0.02).rotate(0.1 * (i % 60), "y").scale(1.0 + 0.1 * (i % 3))
            turned.translate(place).material(color)

    objects(10)
    start = time.process_time()
    objects(n)
    print(f"{1e6 * (time.process_time() - start) / (6 * n):.1f} us of CPU a node, {6 * n} nodes")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("trees", nargs="*", type=Path, help="other checkouts")
    parser.add_argument("-n", type=int, default=15, help="runs of each")
    parser.add_argument("--scene", default="examples/hello.py")
    parser.add_argument("--cold", action="store_true", help="without the driver's shader cache")
    parser.add_argument("--nodes", type=int, default=0, help="make the nodes of so many objects")
    parser.add_argument("--words", nargs=argparse.REMAINDER, help="the words of another command")
    given = parser.parse_args()
    trees = [ROOT, *(tree.resolve() for tree in given.trees)]
    if given.nodes:
        code = f"import runpy; runpy.run_path({str(Path(__file__).resolve())!r})['make_nodes']({given.nodes})"
        for tree in trees * 3:
            print(f"{tree}: ", end="", flush=True)
            environment = {**os.environ, "PYTHONPATH": str(tree)}
            subprocess.run([sys.executable, "-c", code], env=environment, cwd="/", check=True)
        return
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
