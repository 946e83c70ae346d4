"""How much faster the default is than the enhanced tracer of 2018 at one resolution, at equal rms error of depth.

python -m tests.lab.equal_error [NAME ...] [WIDTHxHEIGHT]      examples by name; primitives and village without one

The enhanced tracer ends where its ray came within epsilon, as published; its epsilon is made smaller until its error
is that of the default. Beside it stands the enhanced tracer with our last steps. Times are of the passes that march
(`steps_per_pass` of all steps makes that a pass of its own), interleaved in one run; medians of the ratios, with their
quartiles.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from scipy.ndimage import maximum_filter, minimum_filter

import raymarch as rm
from raymarch.scene import load

EXAMPLES = Path(__file__).parents[2] / "examples"
TURNS = 15


def main() -> None:
    sizes = [a for a in sys.argv[1:] if "x" in a and a[0].isdigit()]
    names = [a for a in sys.argv[1:] if a not in sizes] or ["primitives", "village"]
    width, height = map(int, (sizes or ["320x180"])[0].split("x"))
    with rm.Renderer((width, height)) as renderer:
        for name in names:
            compare(renderer, name)


def compare(renderer: rm.Renderer, name: str) -> None:
    scene = load(EXAMPLES / f"{name}.py")
    truth = rm.truth(scene, renderer.size).depth
    far = maximum_filter(truth, 3)
    inner = np.isfinite(far) & (far < 1.05 * minimum_filter(truth, 3))  # silhouettes apart

    def draw(quality: rm.Quality) -> tuple[float, float, float]:
        whole = scene.replace(quality=quality.replace(steps_per_pass=quality.max_steps))
        frame = renderer.render(whole, outputs=("depth",))
        both = inner & np.isfinite(frame.depth)
        error = float(np.sqrt(np.mean((frame.depth[both] - truth[both]) ** 2)))
        marched = sum(t.draw for t in frame.timings if t.name in ("cone", "march"))
        return error, float(frame.evaluations.mean()), marched

    ours = rm.Quality(schedule="cones")
    reached = draw(ours)[0]
    epsilon = 0.1
    while epsilon > 1e-3 and draw(published(epsilon))[0] > reached:
        epsilon = max(0.7 * epsilon, 1e-3)
    settings = {
        "default": ours,
        "default, all solids marched": ours.replace(analytic=False),
        f"enhanced, as published, epsilon {epsilon:.2g}": published(epsilon),
        "enhanced, proven, all solids marched": rm.Quality(tracer="enhanced", schedule="single", analytic=False),
    }
    first = {label: draw(quality) for label, quality in settings.items()}
    times: dict[str, list[float]] = {label: [] for label in settings}
    for _ in range(TURNS):
        for label, quality in settings.items():
            times[label].append(draw(quality)[2])
    print(f"{name} {renderer.size[0]}x{renderer.size[1]}, {renderer.clock.kind}, {renderer.context.driver.renderer}")
    for label, (error, evaluations, _) in first.items():
        ratio = np.array(times[label]) / np.array(times["default"])
        low, middle, high = np.quantile(ratio, [0.25, 0.5, 0.75])
        print(
            f"  {label:<44} rms {error:.2e}  {evaluations:6.2f} evaluations  {np.median(times[label]):7.1f} ms"
            f"  {middle:5.2f} times [{low:.2f}, {high:.2f}]"
        )


def published(epsilon: float) -> rm.Quality:
    """The tracer as its authors give it."""
    return rm.Quality(
        tracer="enhanced", omega=0.95, schedule="single", refinement="none", epsilon=epsilon, analytic=False
    )


if __name__ == "__main__":
    main()
