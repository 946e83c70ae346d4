"""The page docs/accuracy.md: the measurements of the suite, and which claims of Bálint and Valasek (2018) hold here.

python -m tests.lab.accuracy            # measures and writes the page and its figures
python -m tests.lab.accuracy --quick    # small pictures and few frames
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from raymarch.cli.progress import watched
from raymarch.cost.plots import save
from raymarch.cost.statistics import Median, median
from raymarch.cost.sweep import Point
from raymarch.cost.text import labelled, standing, worth
from raymarch.files import import_optional
from raymarch.scene.quality import PRESETS, PROMISED
from tests.lab.suite import (
    FULL,
    QUICK,
    TRACERS,
    Measured,
    Suite,
    find_scenes,
    measure_suite,
    undone_of_all,
    undone_of_taken,
)
from tests.lab.suite_plots import figure_3, figure_5, fronts

ROOT = Path(__file__).parents[2]

Curve = tuple[tuple[str, str], tuple[str, str]]

ENHANCED_OVER_RELAXED: Curve = (("enhanced", "single"), ("relaxed_again", "single"))
ENHANCED_OVER_PLAIN: Curve = (("enhanced", "single"), ("plain", "single"))
TWO_OVER_ONE: Curve = (("enhanced", "two"), ("enhanced", "single"))
CONE_OVER_ONE: Curve = (("enhanced", "cone"), ("enhanced", "single"))


def page(made: Suite, pictures: Mapping[str, str]) -> str:
    """The page in Markdown.

    pictures : paths of the figures relative to the page: "tracers", "oversteps", "fronts".
    """
    parts = [
        _head(made),
        "## Which claims of the paper hold here\n",
        claims(made),
        "## Tracers and schedules\n",
        _tracers_text(made),
        f"![the paper's figure 3]({pictures['tracers']})\n",
        *(_tracer_table(made, scene) for scene in made.scenes),
        "## Steps that were undone\n",
        "The fraction of the steps 17 to 24 that were too long and were undone, as in figure 5 of the paper: 0 is "
        "black, 1 is white. As there, an undone step and the plain one that replaces it are one step. Rays that ended "
        "before are black; of the steps that rays took, a larger part was undone.\n",
        f"![the paper's figure 5]({pictures['oversteps']})\n",
        "## Presets and the front\n",
        "Whole pictures, with all that a quality includes: cones, refinement of hits, shading. "
        "Distances are in pixel footprints, without silhouettes.\n",
        f"![fronts]({pictures['fronts']})\n",
        *(_preset_table(scene) for scene in made.scenes),
        "## Checks of the measurement\n",
        _checks(made),
    ]
    return "\n".join(parts)


def _head(made: Suite) -> str:
    env, scale = made.environment, made.scale
    clock = "CPU time" if env["clock"]["kind"] == "CPU time" else f"the {env['clock']['kind']}"
    return (
        "# Accuracy against time\n\n"
        "After this page you can compare the tracers and schedules by error, evaluations and time, and know which "
        "claims of a paper hold here.\n\n"
        "`python -m tests.lab.accuracy` writes this page. It repeats the comparison of Bálint and Valasek, "
        '"Accelerating Sphere Tracing" (2018), over scenes like the three of the paper, and adds later tracers. '
        "[cost.md](cost.md) describes how errors and times are measured. "
        "The tracer [`advance`](marching.md#steps-by-the-advance) also knows how the field changes along the ray, and "
        "goes below N\\*; the others know values alone. Of an estimate it knows no more, and is `bracketing` there.\n\n"
        f"Measured on {env['date'][:10]}: {env['driver']['renderer']}, {env['driver']['version']}, by {clock}; "
        f"{env['machine']['cores']} cores; {scale.size[0]}x{scale.size[1]} pixels, {scale.repeats} frames of each "
        f"setting in random order (seed {made.seed}); raymarch {env['versions']['raymarch']}. Times hold for this "
        "machine, errors and evaluations for all machines.\n"
    )


# Claims


def claims(made: Suite) -> str:
    """A table: what the paper says, what was measured, whether it holds."""
    rows = [
        _best("enhanced is up to 1.5 times better than relaxed in error x time", made, ENHANCED_OVER_RELAXED, 1.5),
        _always("enhanced is better than relaxed at every number of steps", made, ENHANCED_OVER_RELAXED, 0),
        _always("enhanced is better than plain from 64 steps on", made, ENHANCED_OVER_PLAIN, 64),
        _par("on the fractal enhanced and relaxed are on par", made),
        _saving("two resolutions save enhanced up to 20 % of its time", made, TWO_OVER_ONE),
        _saving("not in the paper: one converged pass of cones, in time", made, CONE_OVER_ONE),
        _undone("enhanced rarely repeats a step", made),
    ]
    lines = ["| claim | measured, with 95 % interval | holds here |", "|---|---|---|"]
    return "\n".join([*lines, *(f"| {a} | {b} | {c} |" for a, b, c in rows)]) + "\n"


def _ratios(
    made: Suite, pair: Curve, steps: Sequence[int], what: str = "product", published: bool = False
) -> dict[int, Median]:
    return {n: made.ratio(*pair, n, what, published) for n in steps}


OTHERWISE = "if an undone step counts as a step of its own"


def _best(claim: str, made: Suite, pair: Curve, factor: float) -> tuple[str, str, str]:
    words = []
    for published in (True, False):
        found = _ratios(made, pair, made.scale.steps, published=published)
        steps, ratio = min(found.items(), key=lambda item: item[1].value)
        words.append(f"{1 / ratio.value:.2f} times [{1 / ratio.high:.2f}, {1 / ratio.low:.2f}] at {steps} steps")
        if published:
            verdict = "yes" if 1 / ratio.high >= factor else "no" if 1 / ratio.low < factor else "within the interval"
    return claim, f"{words[0]}; {OTHERWISE}, {words[1]}", verdict


def _always(claim: str, made: Suite, pair: Curve, start: int) -> tuple[str, str, str]:
    steps = [n for n in made.scale.steps if n >= start]
    words = []
    for published in (True, False):
        found = _ratios(made, pair, steps, published=published)
        words.append(", ".join(f"{n}: {found[n].value:.2f} [{found[n].low:.2f}, {found[n].high:.2f}]" for n in steps))
        if published:
            better = [n for n in steps if found[n].high < 1.0]
            worse = [n for n in steps if found[n].low > 1.0]
    verdict = (
        "yes"
        if len(better) == len(steps)
        else f"at {len(better)} of {len(steps)}, worse at {len(worse)}, else within the intervals"
    )
    return claim, f"ratio of error x time, by steps: {words[0]}; {OTHERWISE}: {words[1]}", verdict


def _par(claim: str, made: Suite) -> tuple[str, str, str]:
    alone, steps = made.alone(made.scenes[0].name), made.scale.steps[-1]
    ratio = alone.ratio(*ENHANCED_OVER_RELAXED, steps, "product", published=True)
    verdict = (
        "yes" if ratio.low <= 1.0 <= ratio.high else "enhanced is better" if ratio.high < 1.0 else "relaxed is better"
    )
    return claim, f"error x time {ratio} of relaxed's at {steps} steps", verdict


def _saving(claim: str, made: Suite, pair: Curve) -> tuple[str, str, str]:
    found = _ratios(made, pair, made.scale.schedule_steps, "time")
    steps, ratio = min(found.items(), key=lambda item: item[1].value)
    saved = f"{1 - ratio.value:.0%} [{1 - ratio.high:.0%}, {1 - ratio.low:.0%}] at {steps} steps"
    verdict = "yes" if ratio.high < 1.0 else "no" if ratio.low >= 1.0 else "not distinguishable from none"
    return claim, saved, verdict


def _undone(claim: str, made: Suite) -> tuple[str, str, str]:
    taken, every = (
        {n: np.mean([share(s.oversteps[n]) for s in made.scenes]) for n in ("relaxed_again", "enhanced")}
        for share in (undone_of_taken, lambda found: undone_of_all(found).mean())
    )
    words = (
        f"{taken['enhanced']:.1%} of the steps 17 to 24 that rays took, relaxed {taken['relaxed_again']:.1%}; if rays "
        f"that have ended count as 0, {every['enhanced']:.1%}, relaxed {every['relaxed_again']:.1%}"
    )
    return claim, words, "yes" if taken["enhanced"] < 0.5 * taken["relaxed_again"] else "no"


# Tables


def _tracers_text(made: Suite) -> str:
    steps = made.scale.steps
    order = sorted(TRACERS, key=lambda t: _mean_evaluations(made, t))
    return (
        f"Rays are marched for {steps[0]} to {steps[-1]} steps and end there: without refinement of "
        "the hit, and with the fractal's estimate taken as a bound, as in the paper. Error is that of the paper: the "
        "sum of squared differences of depth, without silhouettes, where a single pixel would dominate the sum. A step "
        "of these tables is an evaluation of the field, an undone step too. "
        "`relaxed_again` is the paper's relaxed tracer; `relaxed` is that of Keinert et al. (2014), which stops "
        f"relaxing after the first step that was too long. By evaluations, fewest first: {', '.join(order)}.\n"
    )


def _mean_evaluations(made: Suite, tracer: str) -> float:
    steps = made.scale.steps[-1]
    return float(np.mean([np.log(s.point(tracer, "single", steps).evaluations) for s in made.scenes]))


def _tracer_table(made: Suite, scene: Measured) -> str:
    """Times are relative to the plain tracer, frame by frame within a turn."""
    steps, floor = made.scale.steps[-1], scene.march.floor
    over = f", N* = {floor:.2f}" if floor > 0 else ", no N*: the field is an estimate"
    lines = [
        f"### {scene.name}, {steps} steps{over}\n",
        "| tracer | evaluations a pixel | over N* | error | time over plain | error x that |",
        "|---|---|---|---|---|---|",
    ]
    plain = scene.point("plain", "single", steps)
    for tracer in TRACERS:
        if tracer == "advance" and not floor > 0:
            continue
        p = scene.point(tracer, "single", steps)
        ratio = f"{p.evaluations / floor:.2f}" if floor > 0 else "-"
        error = p.errors.p1_apart
        time = median([a / b for a, b in zip(p.times, plain.times, strict=True)])
        lines.append(f"| {tracer} | {p.evaluations:.2f} | {ratio} | {error:.3g} | {time} | {error * time.value:.3g} |")
    return "\n".join(lines) + "\n"


def _preset_table(scene: Measured) -> str:
    product = scene.product
    lines = [
        f"### {scene.name}\n",
        "| preset | limit | px p99 | px max | missed | evaluations a pixel | ms |",
        "|---|---|---|---|---|---|---|",
    ]
    certified = product.floor > 0
    for name in PRESETS:
        point = next((p for p in product.points if p.setting.preset == name), None)
        if point is not None:
            lines.append(_preset_row(name, point, certified))
    lines.append(f"\nThe default {standing(product, 'pixels_p99')}. Recommended: ")
    lines[-1] += "; ".join(labelled(p) for p in worth(product.front(), "pixels_p99")) + ".\n"
    if not certified:
        lines.append(
            "The field is an estimate: the presets guarantee nothing, and nearly all pixels are silhouettes.\n"
        )
    return "\n".join(lines)


def _preset_row(name: str, point: Point, certified: bool) -> str:
    e = point.errors
    promise = f"{PROMISED[name]:g} px" if certified else "none"
    missed = e.missed + e.false
    numbers = f"{e.pixels_p99:.2g} | {e.pixels_max:.2g} | {missed} | {point.evaluations:.2f} | {point.time}"
    return f"| {name} | {promise} | {numbers} |"


def _checks(made: Suite) -> str:
    lines = []
    for scene in made.scenes:
        lines += [
            f"- {scene.name}, {c.name}: {'holds' if c.holds else 'FAILED'}. {c.words}" for c in scene.product.checks
        ]
    return "\n".join(lines) + "\n"


def main(arguments: Sequence[str] | None = None) -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--quick", action="store_true", help="small pictures and few frames")
    options.add_argument("--scenes", type=Path, default=ROOT / "examples", help="folder of the scenes [examples]")
    options.add_argument(
        "-o",
        "--output",
        type=Path,
        default=ROOT / "docs" / "accuracy.md",
        help="page to write; its figures go to pictures/ beside it [docs/accuracy.md]",
    )
    options.add_argument("--seed", type=int, default=1, help="seed of the random order of frames [1]")
    options.add_argument("--backend", default="auto", help="auto, egl, osmesa or window [auto]")
    given = options.parse_args(arguments)
    if not given.output.absolute().parent.is_dir():
        options.error(f"no folder '{given.output.parent}'")
    import_optional("a figure", "matplotlib", "report")
    files = find_scenes(given.scenes)
    with watched() as tell:
        made = measure_suite(files, QUICK if given.quick else FULL, given.seed, given.backend, tell)
    print(claims(made))
    write(made, given.output)
    print(f"wrote {given.output} and its figures")


def write(made: Suite, output: Path) -> None:
    """Write the page and its figures."""
    names = {"tracers": figure_3, "oversteps": figure_5, "fronts": fronts}
    (output.parent / "pictures").mkdir(exist_ok=True)
    pictures = {name: f"pictures/{output.stem}-{name}.png" for name in names}
    for name, draw in names.items():
        (output.parent / pictures[name]).write_bytes(save(draw(made)))
    output.write_text(page(made, pictures), encoding="utf-8")


if __name__ == "__main__":
    main()
