"""`raymarch cost` on the workers of a cluster: each setting is a task, and so is each reference.

Errors and evaluations do not depend on the worker. Times are taken by one worker that is alone on its machine, in the
same random order as without a cluster; without such a worker no times are taken.
"""

from __future__ import annotations

import uuid
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

from raymarch.cluster.machines import Machine
from raymarch.cluster.source import Source
from raymarch.cluster.submit import RETRIES, Cluster, Failed, Options
from raymarch.cluster.worker import STATE, Job, Refused, drawing
from raymarch.cost.checks import Check, check, check_clock
from raymarch.cost.drawing import Renderers, Spent, by_cpu_time, draw, timed
from raymarch.cost.effects import evaluations_of
from raymarch.cost.reference import Reference, reference
from raymarch.cost.settings import Setting, marches_alone
from raymarch.cost.sweep import Point, Progress, Sweep, environment, examine, facts_of, turns
from raymarch.cost.variants import ideal_of
from raymarch.cost.views import View, cameras, seen_from
from raymarch.errors import CostError, RaymarchError
from raymarch.export.stills import Shot
from raymarch.scene.camera import Camera, Pose
from raymarch.scene.scene import Scene

SHARED = "more than one worker runs on each machine, so their times depend on each other"
"""Why no times are taken."""


@dataclass(frozen=True, slots=True)
class Moment:
    """What all settings of a sweep draw: size, time, parameters, and rays per pixel of the reference picture."""

    size: tuple[int, int]
    time: float
    params: Mapping[str, Any]
    samples: int


@dataclass(frozen=True, slots=True)
class Times:
    """The times of the frames of each setting; where they were measured."""

    spent: list[list[Spent]]
    environment: dict[str, Any]
    clock: Check


def sweep_on(
    cluster: Cluster[Any],
    source: Source,
    scene: Scene,
    settings: Sequence[Setting],
    moment: Moment,
    name: str,
    repeats: int,
    seed: int,
    options: Options,
    report: Progress,
    tell: Callable[[str], None],
) -> Sweep:
    """As `raymarch.cost.sweep.sweep`, with its checks.

    tell : called with notes on the workers.

    Raises ClusterError if the workers cannot be used, and CostError for a setting that cannot be drawn.
    """
    job = cluster.job(scene.quality, Shot(moment.size), options, tell)
    run, sent, client = uuid.uuid4().hex[:8], cluster.send(source), cluster.client
    ideals = [setting.variations if ideal_of(scene, setting.variations) is not scene else () for setting in settings]
    references = {
        ideal: client.submit(_reference, sent, job, moment, ideal, key=f"raymarch-reference-{run}-{k}", retries=RETRIES)
        for k, ideal in enumerate(dict.fromkeys([(), *ideals]))
    }

    seen = cameras(scene, moment.size, moment.time, moment.params)
    kept = {
        name: client.submit(_depths, sent, job, moment, made.camera, key=f"raymarch-view-{run}-{k}", retries=RETRIES)
        for k, (name, (made, _)) in enumerate(seen.items())
    }
    poses = [pose for _, pose in seen.values()]

    def start(unit: tuple[int, Setting]) -> Any:
        i, setting = unit
        judged = list(kept.values()) if marches_alone(setting, scene.quality) else []
        words = (sent, job, moment, setting, references[ideals[i]], setting.light or i == 0, poses, judged)
        how: dict[str, Any] = {"retries": RETRIES, "resources": cluster.resources}
        return client.submit(_examine, *words, key=f"raymarch-draw-{run}-{i}", **how)

    points: dict[int, Point] = {}
    for (i, setting), found in cluster.completed(enumerate(settings), start):
        points[i] = _checked(found, setting.name)
        report(f"errors: {setting.name}", len(points) / (len(settings) + 1))
    known = {ideal: _checked(future.result(), "the reference") for ideal, future in references.items()}
    for i, ideal in enumerate(ideals):
        points[i].known = known[ideal]
    ordered = [points[i] for i in range(len(settings))]
    found = _times(cluster, sent, job, moment, settings, repeats, seed, report)
    measured_on = _environment(job.machines, found)
    untimed, facts = "" if found else SHARED, facts_of(scene, moment.time)
    names = tuple(seen)
    made = Sweep(name, known[()], ordered, seed, repeats, measured_on, untimed=untimed, views=names, **facts)
    for i, point in enumerate(ordered):
        if found is None:
            point.compile_ms = point.first_ms = float("nan")
        else:
            for spent in found.spent[i]:
                point.add(spent)
    made.checks = check(made, scene, None, moment.time, moment.params)
    if found is not None:
        made.checks.insert(0, found.clock)
    return made


def _checked(found: Any, what: str) -> Any:
    """What a task returned. CostError if it failed."""
    if isinstance(found, Refused | Failed):
        fault = CostError(f"{what} cannot be measured: {found.message}")
        fault.where = None
        raise fault
    return found


def _times(
    cluster: Cluster[Any],
    sent: Any,
    job: Job,
    moment: Moment,
    settings: Sequence[Setting],
    repeats: int,
    seed: int,
    report: Progress,
) -> Times | None:
    """The times of all settings, by one worker that is alone on its machine; None if there is none."""
    alone = cluster.alone()
    if not alone:
        return None
    report("times", len(settings) / (len(settings) + 1))
    future = cluster.client.submit(
        _time, sent, job, moment, settings, repeats, seed, workers=alone, pure=False, retries=RETRIES
    )
    found: Times = _checked(future.result(), "the time")
    return found


def _environment(machines: Sequence[Machine], found: Times | None) -> dict[str, Any]:
    """See `raymarch.cost.sweep.environment`. Without times there is no clock."""
    if found is not None:
        return found.environment
    context = SimpleNamespace(driver=machines[0].driver, backend="cluster")
    return environment(SimpleNamespace(context=context, clock=SimpleNamespace(kind="no clock", verdict=SHARED)))


# On a worker


def _reference(source: Source, job: Job, moment: Moment, ideal: tuple[tuple[str, Any], ...]) -> Reference | Refused:
    """The reference of the scene, or of an ideal of it. Uses no OpenGL."""
    try:
        with STATE.lock:
            scene = STATE.scene(source, job.quality)
        return reference(ideal_of(scene, ideal), moment.size, moment.time, moment.params, moment.samples)
    except RaymarchError as fault:
        return Refused.by(fault)


def _depths(source: Source, job: Job, moment: Moment, camera: Camera) -> Reference | Refused:
    """The reference of the scene from another camera, of depth alone. Uses no OpenGL."""
    try:
        with STATE.lock:
            scene = STATE.scene(source, job.quality)
        return reference(scene.replace(camera=camera), moment.size, moment.time, moment.params, 0)
    except RaymarchError as fault:
        return Refused.by(fault)


def _examine(
    source: Source,
    job: Job,
    moment: Moment,
    setting: Setting,
    known: Reference | Refused,
    counted: bool,
    poses: Sequence[Pose],
    seen: Sequence[Reference | Refused],
) -> Point | Refused:
    """A point without its times. Its references stay on the worker. poses, seen : of further views."""
    if isinstance(known, Refused):
        return known
    try:
        with drawing(job, moment.size, job.timeout) as renderer, Renderers(renderer, moment.size) as renderers:
            scene = STATE.scene(source, job.quality)
            own = renderers.of(setting)
            found = examine(scene, setting, known, own, moment.time, moment.params, "color")
            for pose, view in zip(poses, seen, strict=False):
                if isinstance(view, Refused):
                    return view
                other = View("", pose, view)
                found.views.append(seen_from(other, scene, setting, own, moment.time, moment.params))
            if counted:
                found.all_evaluations = evaluations_of(setting.of(scene), own, moment.time, moment.params)
            return replace(found, known=None)  # type: ignore[arg-type]  # the client has it
    except RaymarchError as fault:
        return Refused.by(fault)


def _time(
    source: Source, job: Job, moment: Moment, settings: Sequence[Setting], repeats: int, seed: int
) -> Times | Refused:
    """The times of all settings, each drawn once before."""
    limit = job.timeout * len(settings)
    try:
        with (
            drawing(job, moment.size, limit) as renderer,
            by_cpu_time(renderer),
            Renderers(renderer, moment.size) as renderers,
        ):
            scene = STATE.scene(source, job.quality)
            renderer.kept = max(renderer.kept, 4 * len(settings))
            where = (moment.time, moment.params)
            for setting in settings:
                for _ in range(2):
                    draw(scene, setting, renderers.of(setting), *where)
            spent: list[list[Spent]] = [[] for _ in settings]
            for i in turns(len(settings), repeats, seed):
                spent[i].append(timed(scene, settings[i], renderers.of(settings[i]), *where))
            return Times(spent, environment(renderer), check_clock(renderer))
    except RaymarchError as fault:
        return Refused.by(fault)
