"""Measure a scene at many settings: error, time, evaluations."""

from __future__ import annotations

import os
import platform
import random
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

import raymarch
from raymarch.cost.drawing import Renderers, Spent, brought_to, draw, nearest, timed
from raymarch.cost.errors import Errors, measure, picture_difference
from raymarch.cost.reference import Reference
from raymarch.cost.settings import Setting, marches_alone, schedule_of
from raymarch.cost.statistics import Median, median
from raymarch.cost.views import View, seen_from
from raymarch.expr.walk import find
from raymarch.gpu import driver_cache
from raymarch.gpu.renderer import Renderer
from raymarch.scene.scene import Scene, check_scene

T = TypeVar("T")


METRICS = {
    "pixels_p99": ("distance from the true hit, 99 % of the hits", "px"),
    "pixels_max": ("distance from the true hit, largest", "px"),
    "depth_rms": ("depth error in units of the scene, root mean square", ""),
    "depth_p99": ("depth error in units of the scene, 99 % of the hits", ""),
    "p1": ("sum of squared depth errors", ""),
    "normal_p99": ("angle of the normals, 99 % of the hits", "°"),
    "flip_p99": ("FLIP of the picture, 99 % of the pixels", ""),
    "flip_mean": ("FLIP of the picture, mean", ""),
    "flip_max": ("FLIP of the picture, largest", ""),
}
"""The errors that settings can be ordered by: description and unit."""

UNTIMED = Median(float("nan"), float("nan"), float("nan"), 0.0, 0)
"""The time of a setting that was not timed."""

Progress = Callable[[str, float], None]
"""Called with the current step and the completed fraction, 0 to 1."""
Judge = Callable[[Setting], Reference]
Count = Callable[..., float]


@dataclass(slots=True)
class Point:
    """The measurement of one setting.

    setting : name and quality. tracer, schedule : the choices of the plan.
    errors : against the reference.
    evaluations, iterations : mean over the primary rays. worst_evaluations : of the worst pixel.
    shader_bytes : size of the picture's shader.
    compile_ms, first_ms : compilation by the driver, and the first frame after it; not part of `times`.
    times : milliseconds of each measured frame. time : their median with its interval.
    walls : wall-clock milliseconds of each measured frame: an upper bound of its true time, of one thread.
    wholes : milliseconds of each measured frame by the clock of `times`, with the work of Python before and between.
    again : milliseconds of further frames, which take turns with those of its rivals: see `raymarch.cost.rivals`.
    views : the errors in further views; empty for a setting that changes more than the march.
    depth, done, color : the rendered arrays; `done` is False where a ray ran out of steps; color may be None.
    difference : FLIP of the picture against that of `known`, (H, W); None without colours.
    known : the reference of the comparison.
    all_evaluations : of the field and its gradient, mean per pixel, with those of shadows and all other rays; nan where
        they were not counted.
    """

    setting: Setting
    tracer: str
    errors: Errors
    evaluations: float
    iterations: float
    worst_evaluations: int
    shader_bytes: int
    compile_ms: float
    first_ms: float
    depth: NDArray[Any] = field(repr=False)
    done: NDArray[Any] = field(repr=False)
    color: NDArray[Any] | None = field(repr=False)
    known: Reference = field(repr=False)
    difference: NDArray[Any] | None = field(default=None, repr=False)
    schedule: str = "single"
    all_evaluations: float = float("nan")
    walls: list[float] = field(default_factory=list, repr=False)
    wholes: list[float] = field(default_factory=list, repr=False)
    times: list[float] = field(default_factory=list)
    again: list[float] = field(default_factory=list, repr=False)
    views: list[Errors] = field(default_factory=list, repr=False)

    @property
    def name(self) -> str:
        return self.setting.name

    @property
    def time(self) -> Median:
        """The median of `times`; nan if there are none."""
        return median(self.times) if self.times else UNTIMED

    @property
    def cpu(self) -> float:
        """Milliseconds of a frame beside the drawing: the median of `wholes` less `times`; nan if there are none."""
        beside = [whole - claimed for claimed, whole in zip(self.times, self.wholes, strict=True)]
        return median(beside).value if beside else float("nan")

    def add(self, spent: Spent) -> None:
        """Add the time of a frame."""
        self.times.append(spent.drawing)
        self.walls.append(spent.wall)
        self.wholes.append(spent.whole)

    @property
    def error_time(self) -> float:
        """The product of error and time, the measure of Bálint and Valasek (2018): `errors.p1` times milliseconds."""
        return self.errors.p1 * self.time.value

    def error(self, metric: str) -> float:
        """One of the errors; infinite with missed or false hits, because these are never traded for time.

        If neither the reference nor the frame has a hit, the error is 0.
        """
        errors = self.errors
        if not errors.sound or (errors.pixels == 0 and errors.missed_at_edges):
            return float("inf")
        found = float(getattr(errors, metric))
        return 0.0 if errors.pixels == 0 and found != found else found


@dataclass(slots=True)
class Sweep:
    """The measurements of all settings of a scene. The first point is the scene's own quality.

    name : of the scene. known : its reference. floor : mean of N* over the pixels; nan for an estimate.
    seed, repeats : seed of the frame order, and number of frames of each setting.
    environment : see `raymarch.cost.sweep.environment`.
    checks : results of the self-checks; see `raymarch.cost.checks`.
    untimed : why no times were taken; "" if they were. The front is then by evaluations.
    moment : the time of the frames in seconds, for a scene that reads it; else None.
    proof : figures of a proof of the picture with the scene's own quality, its sentence as "words"; None without one.
    views : the names of the further views in which settings of the march were judged.
    estimate : True if the field of the scene is an estimate. note : what the errors of a blurred picture are; or "".
    """

    name: str
    known: Reference
    points: list[Point]
    seed: int
    repeats: int
    environment: dict[str, Any]
    checks: list[Any] = field(default_factory=list)
    untimed: str = ""
    moment: float | None = None
    estimate: bool = False
    note: str = ""
    proof: Mapping[str, Any] | None = None
    views: tuple[str, ...] = ()

    @property
    def floor(self) -> float:
        return float(self.known.floor.mean()) if np.all(self.known.floor >= 0) else float("nan")

    @property
    def base(self) -> Point:
        return self.points[0]

    @property
    def blank(self) -> bool:
        """True if rays with the scene's own setting hit nothing, rightly: no distance of a hit can be compared."""
        return self.base.errors.sound and not any(e.pixels for e in (self.base.errors, *self.base.views))

    def comparable(self, metric: str = "pixels_p99") -> list[Point]:
        """The sound settings with comparable errors.

        Settings that change the light count only for errors of the picture, and only if their reference is the scene's.
        """
        pictured = metric.startswith("flip")
        sound = [p for p in self.points if p.errors.sound and (pictured or not p.setting.light)]
        return [p for p in sound if p.known is self.known]

    def cost(self, point: Point) -> float:
        """The time of a setting in milliseconds; its evaluations if no times were taken."""
        return point.evaluations if self.untimed else point.time.value

    def front(self, metric: str = "pixels_p99") -> list[Point]:
        """The comparable settings that no other beats in both cost and error, cheapest first.

        Empty for an error of hits, if nothing is hit.
        """
        if self.blank and not metric.startswith("flip"):
            return []
        return pareto(self.comparable(metric), self.cost, lambda p: p.error(metric))


def sweep(
    scene: Scene,
    settings: Sequence[Setting],
    known: Reference,
    renderer: Renderer,
    name: str = "scene",
    time: float = 0.0,
    params: Mapping[str, Any] | None = None,
    repeats: int = 9,
    seed: int = 1,
    progress: Progress | None = None,
    output: str = "color",
    judge: Judge | None = None,
    count: Count | None = None,
    seen: Sequence[View] = (),
) -> Sweep:
    """Measure a scene at each of some settings.

    settings : at least one; the first is what others are compared with.
    known : the reference of the scene, at the renderer's size.
    repeats : timed frames of each setting, >= 1. The settings take turns in random order, so that other load on the
        machine affects all settings equally. From 6 on, a median has a 95 % interval.
    seed : of that order.
    output : the timed output: "color", the picture; or "depth", marching and normals without shading. With "depth" no
        colours are compared.
    judge : returns the reference of a setting where it is not `known`.
    count : counts all evaluations, `raymarch.cost.effects.evaluations_of`; called for the first setting and for those
        that change the light.
    seen : further views, in which settings of the march are judged; see `raymarch.cost.views`.
    """
    check_scene("sweep", scene)
    if not settings or repeats < 1:
        raise ValueError(f"sweep: {len(settings)} settings, {repeats} repeats (at least one of each)")
    tell = progress or (lambda _what, _share: None)
    renderer.kept = max(renderer.kept, 8 * len(settings))  # otherwise each turn would plan and compile again
    total = len(settings) * (repeats + 2)
    points = []
    with Renderers(renderer, known.size) as renderers:
        for i, setting in enumerate(settings):
            tell(f"errors: {setting.name}", 2 * i / total)
            judged = known if judge is None else judge(setting)
            points.append(examine(scene, setting, judged, renderers.of(setting), time, params, output))
            if marches_alone(setting, settings[0].quality):
                views = [seen_from(view, scene, setting, renderers.of(setting), time, params) for view in seen]
                points[i].views = views
            if count is not None and (setting.light or i == 0):
                points[i].all_evaluations = count(setting.of(scene), renderers.of(setting), time, params)
        done = 2 * len(settings)
        for i in turns(len(settings), repeats, seed):
            setting = points[i].setting
            tell(f"time: {setting.name}", done / total)
            points[i].add(timed(scene, setting, renderers.of(setting), time, params, output))
            done += 1
    names = tuple(view.name for view in seen)
    return Sweep(name, known, points, seed, repeats, environment(renderer), views=names, **facts_of(scene, time))


def facts_of(scene: Scene, time: float) -> dict[str, Any]:
    """The fields of a `Sweep` that say what was measured: `moment`, `estimate`, `note`."""
    camera = scene.camera
    blurred = " and ".join(
        w for w, has in (("the centre of the lens", camera.lens), ("the frame's time", scene.motion_blur)) if has
    )
    return {
        "moment": time if find(scene.expressions(), "time") else None,
        "estimate": scene.node.exactness == "estimate",
        "note": f"Distances and normals are those at {blurred}; FLIP compares the blurred pictures." if blurred else "",
    }


def turns(number: int, repeats: int, seed: int) -> Iterator[int]:
    """The order in which settings are timed: each once in each of the repeats, in random order."""
    chance = random.Random(seed)
    for _ in range(repeats):
        order = list(range(number))
        chance.shuffle(order)
        yield from order


def examine(
    scene: Scene,
    setting: Setting,
    known: Reference,
    renderer: Renderer,
    time: float,
    params: Mapping[str, Any] | None,
    output: str,
) -> Point:
    """Measure everything of a setting but its time: errors, counts, and the first frame."""
    made, size = setting.of(scene), known.size
    frames = draw(scene, setting, renderer, time, params, (output,))
    compile_ms, first_ms = sum(t.compile for t in frames[0].timings), frames[0].milliseconds
    ready = renderer.prepared(made)
    color = brought_to(frames[-1].array("color"), size) if output == "color" else None
    geometry = renderer.render(made, time, params, ("depth",))
    difference = None if color is None else picture_difference(known, color)
    evaluations = geometry.array("evaluations")
    depth, normal, reach = (nearest(geometry.array(name), size) for name in ("depth", "normal", "reach"))
    draw(scene, setting, renderer, time, params, (output,))  # the warm-up
    return Point(
        setting=setting,
        tracer=ready.plan.marching.tracer,
        errors=measure(known, depth, normal, color, reach, difference),
        evaluations=float(evaluations.mean()),
        iterations=float(geometry.array("iterations").mean()),
        worst_evaluations=int(evaluations.max()),
        shader_bytes=len(ready.shader.text().encode()),
        compile_ms=compile_ms,
        first_ms=first_ms,
        depth=depth,
        done=nearest(geometry.array("done"), size),
        color=color,
        known=known,
        difference=None if difference is None else difference.astype(np.float32),
        schedule=schedule_of(ready.plan.marching),
    )


def environment(renderer: Any) -> dict[str, Any]:
    """The environment of a measurement: driver, clock, machine, versions and date, as plain data.

    renderer : has `context` (with `driver` and `backend`) and `clock` (with `kind` and `verdict`).
    """
    driver = renderer.context.driver
    return {
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "driver": {"renderer": driver.renderer, "vendor": driver.vendor, "version": driver.version},
        "draws_on": "CPU" if driver.is_software else "GPU",
        "backend": renderer.context.backend,
        "clock": {"kind": renderer.clock.kind, "verdict": renderer.clock.verdict},
        "driver_cache": "off" if driver_cache.is_off() else "as the driver has it",
        "machine": {"processor": platform.machine(), "cores": os.cpu_count(), "system": platform.system()},
        "versions": {
            "raymarch": raymarch.__version__,
            "python": platform.python_version(),
            "numpy": np.__version__,
        },
    }


def pareto(points: Sequence[T], cost: Callable[[T], float], error: Callable[[T], float]) -> list[T]:
    """The Pareto-optimal points, by ascending cost: no other is at least as good in both and better in one.

    Points whose cost or error is nan are never on the front.
    """
    usable = [p for p in points if cost(p) == cost(p) and error(p) == error(p)]
    best, found = float("inf"), []
    for point in sorted(usable, key=lambda p: (cost(p), error(p))):
        if error(point) < best:
            found.append(point)
            best = error(point)
    return found
