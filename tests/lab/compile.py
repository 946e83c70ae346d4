"""How long a scene takes from Python to shader text.

    python -m tests.lab.compile

Prints medians with their quartiles over 30 runs. Nothing in the tests depends on it.
"""

from __future__ import annotations

import statistics
import time

import raymarch as rm
from raymarch.plan import plan
from raymarch.scene.scene import all_nodes
from raymarch.shader import assemble

RUNS = 30


def build() -> rm.Scene:
    """A scene of 50 nodes: seven pierced, turned boxes of two materials, joined over a floor."""
    solid = rm.plane(offset=-1)
    for i in range(6):
        pierced = rm.box((1, 1 + 0.01 * i, 1)).rotate(0.1 * i) - rm.sphere(0.6).translate((0.1 * i, 0, 0))
        painted = pierced.material(rm.Material(color=(0.1 * i, 0.5, 0.5)))
        solid = solid | painted.translate((2 * i, 0, 0))
    return rm.Scene(solid | rm.torus().translate((0, 2, 0)), lights=[rm.Sun(shadow=True), rm.PointLight((0, 4, 0))])


def quartiles(seconds: list[float]) -> str:
    low, middle, high = (1e3 * q for q in statistics.quantiles(seconds, n=4))
    return f"{middle:.1f} ms ({low:.1f} to {high:.1f})"


def main() -> None:
    building, compiling = [], []
    for _ in range(RUNS):
        start = time.perf_counter()
        scene = build()
        built = time.perf_counter()
        text = assemble(plan(scene)).text()
        building.append(built - start)
        compiling.append(time.perf_counter() - built)
    print(f"{len(all_nodes(scene.node))} nodes, {len(text)} bytes of shader, median and quartiles of {RUNS} runs:")
    print(f"  nodes from Python     {quartiles(building)}")
    print(f"  plan and shader text  {quartiles(compiling)}")


if __name__ == "__main__":
    main()
