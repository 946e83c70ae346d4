"""Whether the suite says the same again: the order of the tracers and the intervals, over several runs.

python -m tests.bench.repeats 5        # runs; each takes minutes
"""

from __future__ import annotations

import itertools
import sys
from pathlib import Path

from raymarch.cost.suite import QUICK, SCENES, TRACERS, Suite, find_scenes, measure_suite

EXAMPLES = Path(__file__).parents[2] / "examples"


def order(made: Suite, name: str) -> list[str]:
    """Tracers by error x time at most steps, best first."""
    steps = made.scale.steps[-1]
    scene = next(s for s in made.scenes if s.name == name)

    def product(tracer: str) -> float:
        point = scene.point(tracer, "single", steps)
        return point.errors.p1_apart * point.time.value

    return sorted(TRACERS, key=product)


def main(runs: int) -> None:
    made = [measure_suite(find_scenes(EXAMPLES), QUICK, seed) for seed in range(1, runs + 1)]
    for name in SCENES:
        orders = [order(m, name) for m in made]
        same = sum(o == orders[0] for o in orders)
        print(f"{name}: the order of the tracers is the same in {same} of {runs}; first run: {', '.join(orders[0])}")
    steps = QUICK.steps[-1]
    for tracer in TRACERS[1:]:
        ratios = [m.ratio((tracer, "single"), ("plain", "single"), steps, "product") for m in made]
        overlaps = sum(a.overlaps(b) for a, b in itertools.combinations(ratios, 2))
        pairs = runs * (runs - 1) // 2
        print(f"{tracer} over plain: {'; '.join(map(str, ratios))}; {overlaps} of {pairs} pairs of intervals overlap")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 5)
