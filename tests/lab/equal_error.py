"""How much faster the default is than the enhanced tracer of 2018 at one resolution, at equal rms error of depth.

python -m tests.lab.equal_error [NAME ...] [WIDTHxHEIGHT]      examples by name; the three of the paper without one

The enhanced tracer ends where its ray came within epsilon, as published; its epsilon is made smaller until its error
is that of the default. Beside it stands the enhanced tracer with our last steps. Errors are those of depth away from
silhouettes. Times are CPU time of the passes that march (`steps_per_pass` of all steps makes that a pass of its own),
interleaved in one run; medians of the ratios, with their quartiles.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import raymarch as rm
from raymarch.cost.errors import measure
from raymarch.cost.reference import reference
from raymarch.scene import load
from tests.support.timing import cpu_time

EXAMPLES = Path(__file__).parents[2] / "examples"
TURNS = 11


def main() -> None:
    sizes = [a for a in sys.argv[1:] if "x" in a and a[0].isdigit()]
    names = [a for a in sys.argv[1:] if a not in sizes] or ["primitives", "village", "mandelbulb"]
    width, height = map(int, (sizes or ["320x180"])[0].split("x"))
    with rm.Renderer((width, height)) as renderer:
        for name in names:
            compare(renderer, name)


def compare(renderer: rm.Renderer, name: str) -> None:
    scene = load(EXAMPLES / f"{name}.py")
    known = reference(scene, renderer.size, samples=0)

    def with_quality(quality: rm.Quality) -> rm.Scene:
        return scene.replace(quality=quality.replace(steps_per_pass=quality.max_steps))

    def rms(quality: rm.Quality) -> float:
        return measure(known, renderer.render(with_quality(quality), outputs=("depth",)).depth).depth_rms

    ours = rm.Quality()
    reached = rms(ours)
    epsilon = 1.0
    while epsilon > 1e-3 and rms(published(epsilon)) > reached:
        epsilon = max(0.7 * epsilon, 1e-3)
    settings = {
        "default": ours,
        "default, all solids marched": ours.replace(analytic=False),
        f"enhanced, as published, epsilon {epsilon:.2g}": published(epsilon),
        "default, the field taken as a bound": ours.replace(assume_certified=True),
        "enhanced, proven, all solids marched": rm.Quality(tracer="enhanced", schedule="single", analytic=False),
    }
    if scene.node.exactness != "estimate":
        del settings["default, the field taken as a bound"]
    frames = {label: renderer.render(with_quality(quality), outputs=("depth",)) for label, quality in settings.items()}
    errors = {label: measure(known, frame.depth) for label, frame in frames.items()}
    counts = {label: float(frame.evaluations.mean()) for label, frame in frames.items()}
    passes = {
        label: [c for c in renderer.draw_calls(with_quality(quality)) if c.chosen.name in ("cone", "march")]
        for label, quality in settings.items()
    }
    times: dict[str, list[float]] = {label: [] for label in settings}
    for turn in range(TURNS + 1):
        for label, calls in passes.items():
            milliseconds = cpu_time(renderer.context, lambda calls=calls: [call.draw() for call in calls])
            if turn > 0:
                times[label].append(milliseconds)
    print(f"{name} {renderer.size[0]}x{renderer.size[1]}, {renderer.context.driver.renderer}")
    for label, found in times.items():
        low, middle, high = np.quantile(np.array(found) / np.array(times["default"]), [0.25, 0.5, 0.75])
        error = errors[label]
        print(
            f"  {label:<44} rms {error.depth_rms:.2e}  {error.missed} missed  {counts[label]:6.2f} evaluations"
            f"  {np.median(found):7.1f} ms  {middle:5.2f} times [{low:.2f}, {high:.2f}]"
        )


def published(epsilon: float) -> rm.Quality:
    """The tracer as its authors give it; the field of a fractal is taken as a bound."""
    return rm.Quality(
        tracer="enhanced",
        omega=0.95,
        schedule="single",
        refinement="none",
        epsilon=epsilon,
        analytic=False,
        assume_certified=True,
    )


if __name__ == "__main__":
    main()
