"""Search for a quality by measurement: the fastest within an error bound, or the most accurate within a time limit."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, field, replace
from typing import Any

from raymarch.cost.drawing import timed
from raymarch.cost.errors import check_followed, picture_doubt
from raymarch.cost.reference import Reference, reference
from raymarch.cost.settings import Setting, differences, named, settled
from raymarch.cost.statistics import Median, median
from raymarch.cost.sweep import Point, Progress, sweep
from raymarch.errors import CostError
from raymarch.expr.convert import short
from raymarch.gpu.renderer import Renderer
from raymarch.scene.quality import Quality
from raymarch.scene.scene import Scene, check_scene

LADDER = (2.0, 1.0, 0.5, 0.2, 0.1, 0.05, 0.02, 0.01, 0.004, 0.002)
"""Candidate epsilons, coarsest first."""
STEPS = {0.02: 2048, 0.002: 8192}
"""Maximum steps of a ray from this epsilon down."""
TRACERS = ("auto", "bracketing", "enhanced", "plain")
SCHEDULES = ("single", "cone")
SAMPLES = (1, 4, 16)
"""Candidate rays per pixel, from the scene's own on, where only more rays can reduce the error of the picture."""
TRUTH_SAMPLES = (16, 64)
"""Rays per pixel of the reference picture: more where its noise is too large for the error bound."""
REPEATS = 7
AGAIN = 15
"""Frames by which a setting must prove that it is within the time limit."""
SURE = 0.33
"""Fraction of the error bound of a picture that the noise of the reference may take up."""
CONTENDERS = 2
"""Number of epsilons within the error bound that are timed with every tracer."""
ERROR = {"px": "pixels_p99", "flip": "flip_p99"}
WORDS = {
    "pixels_p99": "99 % of the hits within {:.3g} px of the true ones",
    "flip_p99": "FLIP at most {:.3g} for 99 % of the pixels",
}


@dataclass(frozen=True, slots=True)
class Found:
    """The result of a search, with its measured error and time.

    quality : the quality found. name : its differences from the scene's own. point : all of its errors.
    time : median milliseconds with its interval. metric : the error that was bounded. tried : number of settings
        measured.
    doubt : uncertainty of the reference in that error; see `raymarch.cost.errors.picture_doubt`.
    """

    quality: Quality
    name: str
    point: Point
    time: Median
    metric: str
    tried: int
    doubt: float = 0.0

    @property
    def error(self) -> float:
        """The measured error plus the uncertainty of the reference."""
        return self.point.error(self.metric) + self.doubt

    @property
    def words(self) -> str:
        """One sentence."""
        errors = self.point.errors
        blank = errors.pixels == 0 and self.metric != "flip_p99"
        reached = "no ray hits a surface, as in the reference" if blank else WORDS[self.metric].format(self.error)
        apart = (
            ""
            if self.metric == "flip_p99" or errors.apart or blank
            else " (with silhouettes: there are few other hits)"
        )
        if self.doubt:
            apart = f" ({self.doubt:.2g} of it is the uncertainty of the reference)"
        return (
            f"{self.name} ({self.point.tracer}): {reached}{apart}, {'' if blank else 'no hit missed, '}"
            f"{self.time.value:.2f} ms [{self.time.low:.2f}, {self.time.high:.2f}]; the best of {self.tried} settings"
        )


def parse_error(text: str | float) -> tuple[str, float]:
    """ "0.5px" or 0.5 -> ("pixels_p99", 0.5); "flip:0.05" -> ("flip_p99", 0.05). CostError for anything else."""
    number = r"(\d+\.?\d*(?:e[-+]?\d+)?|\.\d+(?:e[-+]?\d+)?)"
    match = re.fullmatch(
        rf"\s*(?:{number}\s*(?:px)?|flip\s*:\s*{number})\s*", text if isinstance(text, str) else short(text)
    )
    value = float(match[1] or match[2]) if match else 0.0
    if match is None or value <= 0 or (match[2] and value > 1):
        raise CostError(f"error {short(text)}", legal="a distance in pixels such as 0.5px, or flip:X with 0 < X <= 1")
    return ERROR["px" if match[1] else "flip"], value


def parse_time(text: str | float) -> float:
    """ "16ms" or 16 -> 16.0 milliseconds. CostError for anything else."""
    match = re.fullmatch(r"\s*(\d+\.?\d*|\.\d+)\s*(ms|s)?\s*", text if isinstance(text, str) else short(text))
    value = float(match[1]) * (1e3 if match[2] == "s" else 1.0) if match else 0.0
    if value <= 0:
        raise CostError(f"time {short(text)}", legal="milliseconds above 0, such as 16ms")
    return value


def for_error(
    scene: Scene,
    error: str,
    size: tuple[int, int] = (640, 360),
    time: float = 0.0,
    params: Mapping[str, Any] | None = None,
    backend: str = "auto",
    renderer: Any = None,
    progress: Progress | None = None,
) -> Found:
    """The fastest setting within an error bound, measured against the reference of this picture.

    Parameters
    ----------
    error : see `parse_error`.
    size, time, params : of the picture.
    backend : of a new renderer; or `renderer` : an open one of that size.

    The scene's own `samples` are kept; more are tried only for the error of a picture, where needed. First the search
    finds the coarsest epsilon within the bound without a missed or false hit. This epsilon and the next finer one are
    then timed with every tracer. The result is the fastest setting whose own error is within the bound. The error of a
    picture includes the uncertainty of the reference picture; the reference takes more rays where this is a third of
    the bound.

    Raises CostError if no setting is within the bound, with the best error; and for the error of a path-traced picture,
    which has no reference.
    """
    check_scene("for_error", scene)
    metric, target = parse_error(error)
    if metric == "flip_p99":
        check_followed(scene)
    counts = TRUTH_SAMPLES if metric == "flip_p99" else (0,)
    for samples in counts:
        with _bench(scene, size, time, params, backend, renderer, progress, samples) as bench:
            if samples == counts[-1] or bench.doubt <= SURE * target:
                return bench.fastest(metric, target)
    raise AssertionError("unreachable: no reference was computed")


def for_time(
    scene: Scene,
    within: str | float,
    size: tuple[int, int] = (640, 360),
    moment: float = 0.0,
    params: Mapping[str, Any] | None = None,
    backend: str = "auto",
    renderer: Any = None,
    progress: Progress | None = None,
) -> Found:
    """The most accurate setting whose frames are within a time limit on this machine.

    Parameters
    ----------
    within : "16ms", or milliseconds.
    size, moment, params, backend, renderer : as for `for_error`.

    All epsilons are timed in turns, with the scene's own `samples`. Of those with a median within the limit and without
    a missed hit, the one of the smallest error is timed again by itself, as it will be used: in two halves, with the
    fastest setting in between. It is accepted if the median of each half is within the limit; otherwise the next one is
    timed.

    Raises CostError if no setting is within the limit, with the fastest.
    """
    check_scene("for_time", scene)
    target = parse_time(within)
    metric = "pixels_p99"
    with _bench(scene, size, moment, params, backend, renderer, progress, 0) as bench:
        made = bench.sweep(bench.settings(_ladder(scene.quality, scene.quality.samples)))
        sound = sorted((p for p in made if p.errors.sound), key=lambda p: (p.error(metric), p.time.value))
        for point in sound:
            if point.time.value > target:
                continue
            halves = [bench.time(point)]
            if halves[0].value <= target:
                bench.time(min(sound, key=lambda p: p.time.value))
                halves.append(bench.time(point))
            worse = max(halves, key=lambda t: t.value)
            if worse.value <= target:
                return Found(point.setting.quality, point.name, point, worse, metric, len(bench.tried))
    if not sound:
        raise CostError("no setting finds every hit of this scene", legal="a field that is certified; see explain")
    fastest = min(sound, key=lambda p: p.time.value)
    raise CostError(
        f"no setting that finds every hit draws this in {target:g} ms",
        legal=f"the fastest, {fastest.name}, takes {fastest.time}; a smaller picture is faster",
    )


@dataclass(slots=True)
class _Bench:
    """Measures candidates: a scene, its reference, a renderer, and the qualities measured so far."""

    scene: Scene
    known: Reference
    renderer: Renderer
    moment: float
    params: Mapping[str, Any] | None
    progress: Progress
    tried: set[Quality] = field(default_factory=set)

    @property
    def doubt(self) -> float:
        """Uncertainty of the reference picture; 0 for other errors."""
        return picture_doubt(self.known) if self.known.samples > 1 else 0.0

    def settings(self, qualities: Iterable[Quality]) -> list[Setting]:
        """Qualities as settings; those that are the same for this scene are dropped."""
        scene, size = self.scene, self.known.size
        base = settled(scene, scene.quality, size)
        found = []
        for quality in dict.fromkeys(settled(scene, q, size) for q in qualities):
            changed = {name: getattr(quality, name) for name in differences(quality, base)}
            found.append(Setting(named(changed or {"epsilon": quality.epsilon}), quality))
        return found

    def sweep(self, settings: Sequence[Setting], repeats: int = REPEATS) -> list[Point]:
        """Errors and times of some settings."""
        self.tried.update(s.quality for s in settings)
        how: dict[str, Any] = {"time": self.moment, "params": self.params, "repeats": repeats}
        return sweep(self.scene, settings, self.known, self.renderer, progress=self.progress, **how).points

    def time(self, point: Point) -> Median:
        """Time one setting by itself, as it will be used."""
        where = (self.scene, point.setting, self.renderer, self.moment, self.params)
        return median([timed(*where)[0] for _ in range(AGAIN)])

    def fastest(self, metric: str, target: float) -> Found:
        """The fastest contender within the target."""
        if self.doubt >= target:
            raise CostError(f"the reference picture has a noise of FLIP {self.doubt:.2g}", legal="a larger error")
        contenders = [s for rung in self._rungs(metric, target) for s in self.settings(_pairs(rung.setting.quality))]
        keeping = [p for p in self.sweep(contenders) if p.error(metric) + self.doubt <= target]
        if not keeping:
            raise AssertionError("a setting was within the error bound and, rendered again, is not")
        best = min(keeping, key=lambda p: p.time.value)
        return Found(best.setting.quality, best.name, best, best.time, metric, len(self.tried), self.doubt)

    def _rungs(self, metric: str, target: float) -> list[Point]:
        """The coarsest settings within an error bound, and the next finer ones, with the fewest rays per pixel."""
        tried: list[Point] = []
        for samples in _sample_counts(self.scene.quality, metric):
            settings = self.settings(_ladder(self.scene.quality, samples))
            if metric == "flip_p99":  # if the finest epsilon fails, only more rays can help
                tried += self.sweep(settings[-1:], 1)
                if tried[-1].error(metric) + self.doubt > target:
                    continue
            found: list[Point] = []
            for setting in settings:
                tried += self.sweep([setting], 1)
                if tried[-1].error(metric) + self.doubt <= target:
                    found.append(tried[-1])
                if len(found) == CONTENDERS:
                    break
            if found:
                return found
        raise _nothing_keeps(metric, min(tried, key=lambda p: p.error(metric)), self.doubt)


@contextmanager
def _bench(
    scene: Scene,
    size: tuple[int, int],
    moment: float,
    params: Mapping[str, Any] | None,
    backend: str,
    renderer: Any,
    progress: Progress | None,
    samples: int,
) -> Iterator[_Bench]:
    """The reference, and the given renderer or a new one."""
    tell = progress or (lambda _what, _share: None)
    known = reference(scene, size, moment, params, samples, lambda what: tell(what, 0.0))
    with nullcontext(renderer) if renderer else Renderer(size, backend) as drawing:
        yield _Bench(scene, known, drawing, moment, params, tell)


def _nothing_keeps(metric: str, best: Point, doubt: float) -> CostError:
    if best.errors.sound:
        reached = WORDS[metric].format(best.error(metric) + doubt)
        return CostError(
            f"no setting is within this error: the best, {best.name}, has {reached}", legal="a larger error"
        )
    wrong = f"misses {best.errors.missed} and has {best.errors.false} false hits"
    return CostError(f"no setting finds every hit: {best.name} {wrong}", legal="a certified field; see explain")


def _sample_counts(base: Quality, metric: str) -> tuple[int, ...]:
    """Candidate rays per pixel: the base's own, and more for the error of a picture; one with a step limit per pass."""
    more = SAMPLES if metric == "flip_p99" and base.steps_per_pass is None and base.edges == "samples" else ()
    return (base.samples, *(n for n in more if n > base.samples))


def _ladder(base: Quality, samples: int) -> Iterator[Quality]:
    """The base with each epsilon, coarsest first, at a number of rays per pixel."""
    for epsilon in LADDER:
        steps = max([base.max_steps, *(n for e, n in STEPS.items() if epsilon <= e)])
        yield replace(
            base, tracer="auto", schedule="auto", omega=None, epsilon=epsilon, max_steps=steps, samples=samples
        )


def _pairs(quality: Quality) -> list[Quality]:
    """A quality with every tracer, with and without cones."""
    return [replace(quality, tracer=tracer, schedule=schedule) for tracer in TRACERS for schedule in SCHEDULES]
