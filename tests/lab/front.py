"""Whether the default quality lies on the Pareto front of each example.

python -m tests.lab.front                                 # examples/*.py and examples/papers/*.py
python -m tests.lab.front hello village --size 160x90     # some, at another size
python -m tests.lab.front --turns 0                       # without times
python -m tests.lab.front --json front.json               # every setting, for programs

Settings are those of `raymarch cost` with the scene's own rays per pixel, light and resolution: others cost a multiple,
or have errors of other kinds. Costs are evaluations of the field per camera ray (of primary rays by pixels_p99, of all
rays by flip_p99), and CPU time of a frame. A setting dominates the default if it is no worse in error and cost and
better in one. Times of a rival and of the default are taken in turns; its ratio is a median with a 95 % interval, and
it is faster only if the interval is below 1 in two rounds.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import raymarch as rm
from raymarch.cost.effects import evaluations_of
from raymarch.cost.reference import Reference, reference
from raymarch.cost.settings import Setting, axes, grid
from raymarch.cost.statistics import Median, median
from raymarch.cost.sweep import Point, examine
from raymarch.scene import load
from tests.support.timing import cpu_time

ROOT = Path(__file__).parents[2] / "examples"
METRICS = ("pixels_p99", "flip_p99")
NEAR = 1.15
"""Rivals up to this many times as slow as the default in three turns are timed in all turns."""


@dataclass
class Measured:
    """A setting with its costs. ratio : its time over that of the default; None if it was not timed in all turns."""

    point: Point
    evaluations: float
    all_evaluations: float = float("nan")
    milliseconds: float = float("nan")
    ratio: Median | None = None
    again: Median | None = None

    def error(self, metric: str) -> float:
        return self.point.error(metric)

    def count(self, metric: str) -> float:
        """The evaluations that an error is bought with."""
        return self.all_evaluations if metric == "flip_p99" else self.evaluations

    @property
    def wrong_at_edges(self) -> int:
        """Missed and false hits at silhouettes, which neither error contains."""
        return self.point.errors.missed_at_edges + self.point.errors.false_at_edges

    @property
    def faster(self) -> bool:
        return all(t is not None and t.high < 1.0 for t in (self.ratio, self.again))

    def as_dict(self) -> dict[str, Any]:
        return {
            "name": self.point.name,
            "tracer": self.point.tracer,
            "schedule": self.point.schedule,
            "errors": self.point.errors.as_dict(),
            "evaluations": self.evaluations,
            "all_evaluations": self.all_evaluations,
            "milliseconds": self.milliseconds,
            "ratio": self.ratio and self.ratio.as_dict(),
            "again": self.again and self.again.as_dict(),
        }


@dataclass
class Example:
    """An example with all of its settings, the default first."""

    name: str
    pictured: bool
    settings: list[Measured] = field(default_factory=list)

    @property
    def default(self) -> Measured:
        return self.settings[0]

    def no_worse(self, metric: str) -> list[Measured]:
        """The other settings whose error is at most that of the default."""
        return [s for s in self.settings[1:] if s.error(metric) <= self.default.error(metric) < float("inf")]

    def by_count(self, metric: str) -> list[Measured]:
        """The settings that dominate the default in evaluations, cheapest first."""
        own = self.default
        found = [
            s
            for s in self.no_worse(metric)
            if s.count(metric) <= own.count(metric)
            and (s.count(metric), s.error(metric)) != (own.count(metric), own.error(metric))
        ]
        return sorted(found, key=lambda s: (s.count(metric), s.error(metric)))

    def by_time(self, metric: str) -> list[Measured]:
        """The settings that dominate the default in time, fastest first."""
        found = [s for s in self.no_worse(metric) if s.faster]
        return sorted(found, key=lambda s: s.ratio.value if s.ratio else 1.0)


def measure(file: Path, name: str, renderer: rm.Renderer, turns: int) -> Example:
    """Errors, evaluations and times of one example."""
    scene = load(file)
    scene = scene.replace(quality=scene.quality.to_preset("normal"))
    made = Example(name, not scene.path_traced)
    known = reference(scene, renderer.size, samples=16 if made.pictured else 0)
    settings = [s for s in grid(scene, axes(), renderer.size) if comparable(s, scene.quality)]
    renderer.kept = 8 * len(settings)
    for setting in settings:
        made.settings.append(examined(scene, setting, known, renderer))
        print(f"\r{name}: {setting.name:<40}", end="", file=sys.stderr, flush=True)
    best = [m for m in METRICS if m != "flip_p99" or made.pictured]
    rivals = [s for s in made.settings[1:] if any(s in made.no_worse(m) for m in best)]
    for some in (made.default, *rivals):
        some.all_evaluations = all_evaluations(scene, some, renderer)
    if turns:
        take_times(scene, made.default, rivals, renderer, turns)
    print(f"\r{'':60}\r", end="", file=sys.stderr, flush=True)
    return made


def comparable(setting: Setting, own: rm.Quality) -> bool:
    """True for a setting of the scene's own rays per pixel, light and resolution."""
    return (setting.frames, setting.scale, setting.variations, setting.quality.samples) == (1, 1.0, (), own.samples)


def examined(scene: rm.Scene, setting: Setting, known: Reference, renderer: rm.Renderer) -> Measured:
    point = examine(scene, setting, known, renderer, 0.0, None, "color")
    return Measured(point, point.evaluations)


def all_evaluations(scene: rm.Scene, of: Measured, renderer: rm.Renderer) -> float:
    """Evaluations of all rays of a pixel, at one camera ray per pixel, with the cones of the setting."""
    made = of.point.setting.of(scene)
    single = made.replace(quality=made.quality.replace(samples=1, schedule="single"))
    frame = renderer.render(single, outputs=("depth",))
    return evaluations_of(made, renderer) - float(frame.evaluations.mean()) + of.evaluations


def take_times(scene: rm.Scene, own: Measured, rivals: Sequence[Measured], renderer: rm.Renderer, turns: int) -> None:
    """Time the rivals and the default in turns; those that seem faster again, in a second round."""

    def timed(some: Sequence[Measured], turns: int) -> list[Median]:
        scenes = [s.point.setting.of(scene) for s in (own, *some)]
        times: list[list[float]] = [[] for _ in scenes]
        for turn in range(turns + 1):
            for k, made in enumerate(scenes):
                calls = renderer.draw_calls(made)
                taken = cpu_time(renderer.context, lambda calls=calls: [call.draw() for call in calls])
                if turn:
                    times[k].append(taken)
        for s, found in zip((own, *some), times, strict=True):
            s.milliseconds = median(found).value
        return [median([b / a for a, b in zip(times[0], found, strict=True)]) for found in times[1:]]

    first = zip(rivals, timed(rivals, min(3, turns)), strict=True)
    near = [s for s, ratio in first if ratio.low < NEAR]
    for s, ratio in zip(near, timed(near, turns), strict=True):
        s.ratio = ratio
    faster = [s for s in near if s.ratio is not None and s.ratio.high < 1.0]
    for s, ratio in zip(faster, timed(faster, turns), strict=True):
        s.again = ratio


def row(made: Example) -> str:
    """A row of the table."""
    own = made.default
    cells = [made.name, figures(own, made.pictured)]
    for metric in METRICS:
        if metric == "flip_p99" and not made.pictured:
            cells.append("no reference picture")
            continue
        counted, timed = made.by_count(metric), made.by_time(metric)
        parts = [f"{len(counted)} need fewer: {rival(counted[0], made, metric)}"] if counted else []
        parts += [f"{len(timed)} are faster: {rival(timed[0], made, metric)}"] if timed else []
        cells.append("; ".join(parts) or "yes")
    return f"| {' | '.join(cells)} |"


def figures(of: Measured, pictured: bool) -> str:
    flip = f"{of.error('flip_p99'):.4f}" if pictured else "-"
    return (
        f"{of.error('pixels_p99'):.2g} px, {flip}, {of.wrong_at_edges} wrong at edges, "
        f"{of.evaluations:.2f}/{of.all_evaluations:.2f}, {of.milliseconds:.1f} ms"
    )


def rival(of: Measured, made: Example, metric: str) -> str:
    ratio = f", time x{of.ratio.value:.2f} [{of.ratio.low:.2f}, {of.ratio.high:.2f}]" if of.ratio else ""
    return f"`{of.point.name}` {figures(of, made.pictured)}{ratio}"


def main(arguments: Sequence[str]) -> int:
    names, size, turns, file = [], "320x180", 15, None
    rest = list(arguments)
    while rest:
        match rest.pop(0):
            case "--size":
                size = rest.pop(0)
            case "--turns":
                turns = int(rest.pop(0))
            case "--json":
                file = Path(rest.pop(0))
            case name:
                names.append(name)
    files = [ROOT / f"{n}.py" for n in names] or [*sorted(ROOT.glob("*.py")), *sorted(ROOT.glob("papers/*.py"))]
    width, height = map(int, size.split("x"))
    found = {}
    print("| example | default | on the front by pixels_p99 | by flip_p99 |\n|---|---|---|---|")
    for scene in files:
        name = str(scene.relative_to(ROOT).with_suffix(""))
        with rm.Renderer((width, height)) as renderer:
            made = measure(scene, name, renderer, turns)
        print(row(made), flush=True)
        found[name] = [s.as_dict() for s in made.settings]
        if file is not None:
            file.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
