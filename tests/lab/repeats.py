"""Whether the suite says the same again: the order of the tracers and the intervals, over several runs.

python -m tests.lab.repeats 5        # runs

Each run measures the suite's three scenes anew, in its own random order: P1's tracers at 32 and 128 steps. Two tracers
are in order where the 95 % interval of their ratio, frame by frame of the same turn, leaves out 1; where it does not,
they count as equal. Runs agree if no two of them put a pair in opposite orders. Exit code 1 if they do not.
"""

from __future__ import annotations

import itertools
import sys
from contextlib import ExitStack
from pathlib import Path

import raymarch as rm
from raymarch.cost.reference import reference
from raymarch.cost.statistics import Median
from raymarch.cost.sweep import sweep
from raymarch.scene import load
from tests.lab.suite import SCENES, TRACERS, Measured, Scale, Suite, find_scenes, march_settings

EXAMPLES = Path(__file__).parents[2] / "examples"
STEPS = (32, 128)
SCALE = Scale((160, 90), 25, STEPS, (), ())


def ratio(made: Suite, scene: str, one: str, other: str) -> Median:
    """Error times time of one tracer over another's, at most steps."""
    return made.alone(scene).ratio((one, "single"), (other, "single"), STEPS[-1], "product")


def order(made: Suite, scene: str) -> str:
    """Tracers by error times time, best first; "=" between those that cannot be told apart."""

    def product(tracer: str) -> float:
        return ratio(made, scene, tracer, "plain").value

    ordered = sorted(TRACERS, key=product)
    words = ordered[0]
    for a, b in itertools.pairwise(ordered):
        words += f" {'<' if ratio(made, scene, a, b).high < 1.0 else '='} {b}"
    return words


def compared(runs: list[Suite], scene: str) -> tuple[int, int, int]:
    """Over pairs of tracers: how many any run tells apart; of those, how many no run puts the other way round; and how
    many all runs' medians put the same way."""
    told = agree = same = 0
    for one, other in itertools.combinations(TRACERS, 2):
        found = [ratio(made, scene, one, other) for made in runs]
        below, above = any(f.high < 1.0 for f in found), any(f.low > 1.0 for f in found)
        if below or above:
            told += 1
            agree += below != above
            same += len({f.value < 1.0 for f in found}) == 1
    return told, agree, same


def measured(count: int) -> list[Suite]:
    """The runs, one after the other. What was compiled and the truth are kept from the first."""
    runs: list[Suite] = []
    with ExitStack() as stack:
        kept = []
        for file in find_scenes(EXAMPLES):
            scene = load(file)
            renderer = stack.enter_context(rm.Renderer(SCALE.size))
            kept.append((file.stem, scene, reference(scene, SCALE.size, samples=0), renderer))
        for seed in range(1, count + 1):
            scenes = []
            for name, scene, known, renderer in kept:
                settings = march_settings(SCALE)
                made = sweep(scene, settings, known, renderer, name, repeats=SCALE.repeats, seed=seed, output="depth")
                scenes.append(Measured(name, made, made, {}))
            runs.append(Suite(tuple(scenes), SCALE, seed))
            for name in SCENES:
                print(f"run {seed}, {name}: {order(runs[-1], name)}", flush=True)
    return runs


def main(count: int) -> bool:
    runs = measured(count)
    holds = True
    for name in SCENES:
        told, agree, same = compared(runs, name)
        holds &= told == agree
        print(f"{name}: {told} pairs are told apart; {agree} never the other way round, {same} the same in all {count}")
    pairs = count * (count - 1) // 2
    for tracer in TRACERS[1:]:
        ratios = [m.ratio((tracer, "single"), ("plain", "single"), STEPS[-1], "product") for m in runs]
        overlaps = sum(a.overlaps(b) for a, b in itertools.combinations(ratios, 2))
        print(f"{tracer} over plain: {'; '.join(map(str, ratios))}; {overlaps} of {pairs} pairs of intervals overlap")
    print(f"the order of the tracers is the same in {count} of {count} runs: {'HOLDS' if holds else 'FAILS'}")
    return holds


if __name__ == "__main__":
    sys.exit(0 if main(int(sys.argv[1]) if len(sys.argv) > 1 else 5) else 1)
