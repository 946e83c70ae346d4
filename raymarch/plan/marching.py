"""How the rays of a scene are marched: tracer, schedule, and the modules that do it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from raymarch.plan.schedule import PIXEL, SCHEDULES, SINGLE, Schedule
from raymarch.scene.quality import Quality
from raymarch.scene.scene import Scene

MODULES = {"relaxed_again": "relaxed"}
"""Tracers whose module has another name."""

WORTH = 3e7
"""Operations of the field times pixels from which "auto" marches cones first. Below, a second program and pass cost
more than the evaluations that they save."""


@dataclass(frozen=True, slots=True)
class Marching:
    """The tracer and the schedule of a scene, each with its reason; `resumed` if rays are marched over many passes."""

    tracer: str
    tracer_reason: str
    schedule: Schedule
    schedule_reason: str
    resumed: bool = False

    @property
    def jittered(self) -> bool:
        """True if rays come from all of a pixel's square, and not from its middle alone."""
        return PIXEL in self.schedule.levels

    @property
    def cones(self) -> bool:
        """True if something is marched before the rays."""
        return bool(self.schedule.levels)


def choose(scene: Scene, operations: int, size: tuple[int, int] | None) -> Marching:
    """The tracer and the schedule for a scene.

    operations : of one evaluation of the field. size : of the picture, if it is known.
    """
    quality = scene.quality
    certified = trusted(scene)
    tracer, tracer_reason = _choose_tracer(quality, certified)
    schedule, schedule_reason = _choose_schedule(quality, certified, operations, size)
    if certified and quality.budget is None and (quality.samples > 1 or quality.temporal != "off"):
        schedule = Schedule((*schedule.levels, PIXEL), schedule.share)
        schedule_reason += "; the samples of a pixel start where the cone around it ended"
    return Marching(tracer, tracer_reason, schedule, schedule_reason, quality.budget is not None)


def trusted(scene: Scene) -> bool:
    """True if the field is no larger than the distance, or is taken for such a one."""
    return scene.node.exactness != "estimate" or scene.quality.trust


def _choose_tracer(quality: Quality, certified: bool) -> tuple[str, str]:
    asked = quality.tracer
    if not certified:
        if asked not in ("auto", "plain"):
            return "plain", f"the field is an estimate, on which Quality(tracer={asked!r}) would be fooled"
        return "plain", "the field is an estimate, which proves no longer step"
    if asked == "auto":
        return "auto_relaxed", "the field is certified, so a step is as long as its spheres prove"
    return asked, f"Quality(tracer={asked!r})"


def _choose_schedule(
    quality: Quality, certified: bool, operations: int, size: tuple[int, int] | None
) -> tuple[Schedule, str]:
    asked = quality.schedule
    if not certified:
        if asked in ("auto", "single"):
            return SINGLE, "the field is an estimate, which does not prove a cone free"
        return SINGLE, f"the field is an estimate, which does not prove the cones of Quality(schedule={asked!r}) free"
    if asked != "auto":
        return SCHEDULES[asked], f"Quality(schedule={asked!r})"
    if size is None:
        return SINGLE, "the size of the picture is not known"
    work = operations * size[0] * size[1]
    if work < WORTH:
        return SINGLE, f"{work:.2g} operations for one evaluation a pixel, too few for cones to pay"
    return SCHEDULES["cones"], f"{work:.2g} operations for one evaluation a pixel, of which cones save the larger part"


def modules(scene: Scene, marching: Marching, epsilon: float) -> list[tuple[str, str]]:
    """The modules that march, each with its reason."""
    quality, facts = scene.quality, scene.node.facts
    found = [(f"view/camera{'_interpolated' * (quality.rays == 'interpolated')}", "every picture has a camera")]
    add = found.append
    cone = "_cone" * marching.cones
    add((f"march/epsilon{cone}", f"a ray looks for its hit within {epsilon:g} pixel widths of a surface"))
    add(("march/hit", "what a ray found"))
    add((f"march/along{cone}", "the field is asked along rays" + " and cones" * marching.cones))
    if quality.correction == "proven":
        add(("march/settle", "the last steps towards a surface are along the measured slope, and proven"))
    else:
        add((f"march/{'stop' if quality.correction == 'none' else 'slope'}", f"{quality.correction!r} correction"))
    if marching.tracer != "front":
        add(("march/loop", "a ray goes on until it is near a surface"))
        aims = marching.tracer == "auto_relaxed" and quality.correction == "proven"
        add((f"march/aim{cone if aims else '_never'}", "where a step of a ray may lead" + " onto the surface" * aims))
    add(("march/exhausted", f"a ray may take {quality.max_steps} steps"))
    tracer = MODULES.get(marching.tracer, marching.tracer)
    if tracer == "plain" and quality.step_variation > 0:
        add(("march/plain_varied", f"Quality(step_variation={quality.step_variation:g})"))
        add(("random/pixel", "steps differ from pixel to pixel"))
    else:
        add((f"march/{tracer}", marching.tracer_reason))
    below, above = np.isfinite(facts.upper), np.isfinite(facts.lower)
    if np.any(below) or np.any(above):
        add(("march/below", "the scene's box ends on some side"))
        if np.any(above):
            add(("march/above", "the scene's box ends below on some axis"))
        if np.any(above & below) and not marching.cones:
            add(("march/slab", "the scene's box has two ends on some axis"))
        add(("march/clipped", "rays are marched inside the scene's box only"))
    else:
        add(("march/whole", "the scene's box has no end on any side"))
    on = "_on" * marching.cones
    if marching.cones:
        add(("march/carry", marching.schedule_reason))
    if marching.cones or marching.resumed:
        add((f"march/begin{on}", "rays go on from where cones ended" if on else "rays start at the camera"))
    if marching.resumed:
        add(("march/state", f"Quality(budget={quality.budget})"))
        add(("march/resumed", "what passes before found"))
    else:
        add((f"march/trace{on}", marching.schedule_reason))
    return found
