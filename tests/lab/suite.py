"""The comparison of Bálint and Valasek, "Accelerating Sphere Tracing" (2018), here P1, over its three scenes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raymarch.cost.checks import check
from raymarch.cost.drawing import by_cpu_time
from raymarch.cost.reference import reference
from raymarch.cost.settings import Setting, settled
from raymarch.cost.statistics import Median, median
from raymarch.cost.sweep import Point, Sweep, sweep
from raymarch.errors import CostError
from raymarch.gpu.driver_cache import without_driver_cache
from raymarch.gpu.prepare import assembled, passes_for
from raymarch.gpu.renderer import Renderer
from raymarch.plan import marched_otherwise, plan
from raymarch.scene.file import load
from raymarch.scene.quality import PRESETS, Quality
from raymarch.scene.scene import Scene

SCENES = ("mandelbulb", "primitives", "village")
TRACERS = ("plain", "relaxed_again", "relaxed", "enhanced", "auto_relaxed", "bracketing", "advance")
"""P1's relaxed tracer relaxes again after each overstep; Keinert's, `relaxed`, does not."""
SCHEDULED = ("plain", "relaxed_again", "enhanced")
SCHEDULES = ("single", "two", "four", "six", "cone")
PAIRED = ("plain", "enhanced", "auto_relaxed", "bracketing", "advance")
"""Tracers of the comparison of products, each with and without cones."""
EPSILONS = (0.5, 0.1, 0.02)
BARE = Quality(refinement="none", schedule="single", epsilon=0.05, assume_certified=True, analytic=False)
"""As in P1: a ray ends where the field is small enough, without a refinement step."""
COUNTED = ("plain", "relaxed_again", "enhanced")
"""P1's tracers, whose steps are counted as in P1 too."""
OVERSTEPS = (16, 24)
"""P1's figure 5 counts the undone steps in this range."""

Tell = Callable[[str, float], None]


@dataclass(frozen=True, slots=True)
class Scale:
    """Extent of the measurement: picture size, frames of each setting, maximum steps of rays."""

    size: tuple[int, int]
    repeats: int
    steps: tuple[int, ...]
    scheduled: tuple[str, ...]
    schedule_steps: tuple[int, ...]


FULL = Scale((320, 180), 15, (8, 16, 24, 32, 48, 64, 96, 128), SCHEDULED, (16, 32, 64, 96, 128))
QUICK = Scale((160, 90), 7, (8, 16, 32, 64, 128), ("plain", "enhanced"), (16, 32, 64, 128))


@dataclass(frozen=True, slots=True)
class Measured:
    """One scene.

    march : tracers and schedules over steps, timed without shading. A step is an evaluation of the field.
    published : P1's tracers over steps that are counted as in P1: an undone step and its plain replacement are one.
    product : presets, and tracers over epsilons, as pictures.
    oversteps : of P1's steps 17 to 24, by tracer: the number that a ray took and that of those undone, (2, H, W).
    """

    name: str
    march: Sweep
    published: Sweep
    product: Sweep
    oversteps: Mapping[str, NDArray[np.float64]]

    def point(self, tracer: str, schedule: str, steps: int, published: bool = False) -> Point:
        """A point of `march`, or of `published`."""
        points = self.published.points if published else self.march.points
        return next(p for p in points if p.name == key(tracer, schedule, steps))


@dataclass(frozen=True, slots=True)
class Suite:
    """The results of all scenes. `scale` is the extent of the measurement, `seed` that of all random orders."""

    scenes: tuple[Measured, ...]
    scale: Scale
    seed: int

    @property
    def environment(self) -> dict[str, Any]:
        return self.scenes[0].march.environment

    def alone(self, name: str) -> Suite:
        """The results of one scene."""
        return replace(self, scenes=tuple(s for s in self.scenes if s.name == name))

    def ratio(
        self, one: tuple[str, str], other: tuple[str, str], steps: int, what: str, published: bool = False
    ) -> Median:
        """One (tracer, schedule) over another at some steps: the geometric mean over the scenes, with its interval.

        what : "time", "error" (P1's without silhouettes, which has no interval) or "product". Times are
        compared frame by frame within a turn, so that temporary load on the machine cancels.
        published : True for steps that are counted as in P1.
        """
        logs = []
        for scene in self.scenes:
            a, b = scene.point(*one, steps, published), scene.point(*other, steps, published)
            error = np.log(max(a.errors.p1_apart, 1e-30) / max(b.errors.p1_apart, 1e-30)) if what != "time" else 0.0
            time = np.log(np.array(a.times) / np.array(b.times)) if what != "error" else np.zeros(len(a.times))
            logs.append(error + time)
        return median([float(v) for v in np.exp(np.mean(logs, axis=0))])


def key(tracer: str, schedule: str, steps: int) -> str:
    """Name of a point of `Measured.march`."""
    return f"{tracer}, {schedule}, {steps} steps"


def find_scenes(folder: Path) -> list[Path]:
    """The files of P1's scenes. CostError if one is missing."""
    files = [folder / f"{name}.py" for name in SCENES]
    for file in files:
        if not file.is_file():
            raise CostError(f"no scene '{file}'", legal="run in a clone of the project, or give --scenes FOLDER")
    return files


def measure_suite(
    files: Sequence[Path], scale: Scale, seed: int = 1, backend: str = "auto", tell: Tell | None = None
) -> Suite:
    """Measure all scenes."""
    say = tell or (lambda _what, _share: None)
    found = []
    for i, file in enumerate(files):

        def part(what: str, share: float, i: int = i, name: str = file.stem) -> None:
            say(f"{name}: {what}", (i + share) / len(files))

        found.append(_measure(load(file), file.stem, scale, seed, backend, part))
    return Suite(tuple(found), scale, seed)


def _measure(scene: Scene, name: str, scale: Scale, seed: int, backend: str, tell: Tell) -> Measured:
    known = reference(scene, scale.size, samples=1, progress=lambda what: tell(what, 0.0))
    with without_driver_cache(), Renderer(scale.size, backend) as renderer, by_cpu_time(renderer):
        bare = march_settings(scale)
        common: dict[str, Any] = {"name": name, "repeats": scale.repeats, "seed": seed}
        march = sweep(scene, bare, known, renderer, **common, progress=lambda w, s: tell(w, 0.6 * s), output="depth")
        shown = product_settings(scene, scale.size)
        product = sweep(scene, shown, known, renderer, **common, progress=lambda w, s: tell(w, 0.6 + 0.4 * s))
        product.checks = check(product, scene, renderer)
    with Renderer(scale.size, backend) as renderer, by_cpu_time(renderer):
        alike = [Setting(key(t, "single", n), _bare(t, n)) for t in COUNTED for n in scale.steps]
        count_as_published(renderer, scene, [s.quality for s in alike])
        published = sweep(scene, alike, known, renderer, **common, output="depth")
        oversteps = {tracer: _oversteps(scene, tracer, renderer) for tracer in COUNTED[1:]}
    return Measured(name, march, published, product, oversteps)


def _bare(tracer: str, steps: int) -> Quality:
    return replace(BARE, tracer=tracer, max_steps=steps)


def count_as_published(renderer: Renderer, scene: Scene, qualities: Sequence[Quality]) -> None:
    """Let a renderer draw depths of a scene with steps that are counted as in P1, for some qualities."""
    renderer.kept = max(renderer.kept, 16 * len(qualities))
    passes, size = passes_for(("depth",)), renderer.size
    first = plan(scene.replace(quality=BARE), passes, size, device=renderer.context.driver.device_class)
    for quality in qualities:
        made = replace(marched_otherwise(first, quality, size), published=True)
        renderer.adopt(scene.replace(quality=quality), assembled(made), ("depth",))


def march_settings(scale: Scale) -> list[Setting]:
    """Tracers over steps, then schedules over steps."""
    wanted = [(tracer, "single", steps) for tracer in TRACERS for steps in scale.steps]
    wanted += [(t, s, n) for t in scale.scheduled for s in SCHEDULES for n in scale.schedule_steps]
    return [
        Setting(key(*names), replace(BARE, tracer=names[0], schedule=names[1], max_steps=names[2]))
        for names in dict.fromkeys(wanted)
    ]


def product_settings(scene: Scene, size: tuple[int, int]) -> list[Setting]:
    """The scene's own quality, the presets, and tracers with and without cones over epsilons."""
    found = {settled(scene, scene.quality, size): Setting("base", scene.quality)}
    for name in PRESETS:
        quality = scene.quality.to_preset(name)
        meant = settled(scene, quality, size)
        found[meant] = replace(found.get(meant, Setting(name, quality)), preset=name)
    for epsilon in EPSILONS:
        for tracer in PAIRED:
            for schedule in ("single", "cone"):
                quality = Quality(tracer=tracer, schedule=schedule, epsilon=epsilon)
                name = f"{tracer}{', cone' * (schedule == 'cone')}, epsilon {epsilon:g}"
                found.setdefault(settled(scene, quality, size), Setting(name, quality))
    return list(found.values())


def _oversteps(scene: Scene, tracer: str, renderer: Renderer) -> NDArray[np.float64]:
    """Of P1's steps in OVERSTEPS, the number that each ray took and that of those undone, (2, H, W)."""
    qualities = [_bare(tracer, steps) for steps in OVERSTEPS]
    count_as_published(renderer, scene, qualities)
    counts = []
    for quality in qualities:
        frame = renderer.render(scene.replace(quality=quality), outputs=("depth",))
        undone = frame.fallbacks.astype(np.float64)
        counts.append(np.stack([frame.iterations - undone, undone]))  # an undone step and its replacement are one
    found: NDArray[np.float64] = counts[1] - counts[0]
    return found


def undone_of_taken(oversteps: NDArray[np.float64]) -> float:
    """The fraction of the steps taken that were undone."""
    taken, undone = oversteps
    return float(undone.sum() / max(taken.sum(), 1.0))


def undone_of_all(oversteps: NDArray[np.float64]) -> NDArray[np.float64]:
    """The fraction of all steps that were undone, of each pixel; steps that a ray did not take, as it had ended, count
    as not undone."""
    fraction: NDArray[np.float64] = oversteps[1] / (OVERSTEPS[1] - OVERSTEPS[0])
    return fraction
