"""How the rays of a scene are marched: tracer, schedule, and the modules that do it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from raymarch.plan.schedule import PIXEL, SCHEDULES, SINGLE, Schedule
from raymarch.scene.quality import Quality
from raymarch.scene.scene import Scene

MODULES = {"relaxed_again": "relaxed"}
"""Tracers whose module has another name."""

SECONDARY = ("light/shadow", "light/cone", "light/triangulated", "light/two_sided", "path/secondary")
"""Modules that march rays from one surface to the next, or to a light."""

WORTH = 3e7
"""Operations of the field times pixels from which "auto" marches cones first. Below, a second program and pass cost
more than the evaluations that they save."""


@dataclass(frozen=True, slots=True)
class Marching:
    """The tracer and the schedule of a scene, each with its reason.

    steps : that a ray may take after its cones. steps_per_pass : of one pass, None if all are taken in one.
    """

    tracer: str
    tracer_reason: str
    schedule: Schedule
    schedule_reason: str
    steps: int
    steps_per_pass: int | None

    @property
    def resumed(self) -> bool:
        """True if rays are marched over many passes."""
        return self.steps_per_pass is not None

    @property
    def passes(self) -> int:
        """In how many passes a ray is marched at most."""
        return 1 if self.steps_per_pass is None else -(-self.steps // self.steps_per_pass)

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
    if (
        certified
        and not quality.shortened
        and quality.steps_per_pass is None
        and (quality.samples > 1 or quality.temporal != "off")
    ):
        schedule = Schedule((*schedule.levels, PIXEL), schedule.share)
        schedule_reason += "; the samples of a pixel start where the cone around it ended"
    steps = max(1, round(schedule.share * quality.max_steps))
    return Marching(tracer, tracer_reason, schedule, schedule_reason, steps, quality.steps_per_pass)


def trusted(scene: Scene) -> bool:
    """True if the field is no larger than the distance, or is taken for such a one."""
    return scene.node.exactness != "estimate" or scene.quality.assume_certified


def _choose_tracer(quality: Quality, certified: bool) -> tuple[str, str]:
    asked = quality.tracer
    if not certified:
        if asked not in ("auto", "plain"):
            return "plain", f"the field is an estimate, on which Quality(tracer={asked!r}) would be fooled"
        return "plain", "the field is an estimate, which proves no longer step"
    if quality.shortened:
        return "plain", "Quality(step_scale=..., step_variation=...) shortens plain steps"
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
    if quality.shortened:
        return SINGLE, "no cone is proven free of a field that needs shorter steps"
    if asked != "auto":
        return SCHEDULES[asked], f"Quality(schedule={asked!r})"
    if size is None:
        return SINGLE, "the size of the picture is not known"
    work = operations * size[0] * size[1]
    if work < WORTH:
        return SINGLE, f"{work:.2g} operations for one evaluation a pixel, too few for cones to pay"
    return SCHEDULES["cones"], f"{work:.2g} operations for one evaluation a pixel, of which cones save the larger part"


def safe_step(quality: Quality) -> list[tuple[str, str]]:
    """The module that says how far a plain step goes, with its reason."""
    if quality.step_variation > 0:
        why = f"Quality(step_variation={quality.step_variation:g})"
        return [("march/safe_step_varied", why), ("random/pixel", "steps differ from pixel to pixel")]
    if quality.step_scale < 1:
        return [("march/safe_step_scaled", f"Quality(step_scale={quality.step_scale:g})")]
    return [("march/safe_step", "a plain step is as long as the distance")]


def secondary(quality: Quality, names: Iterable[str]) -> list[tuple[str, str]]:
    """What the modules that march from a surface onwards need besides, if any of `names` is one of them."""
    if not any(name in SECONDARY for name in names):
        return []
    found = safe_step(quality)
    if any(name in SECONDARY and name != "light/two_sided" for name in names):
        found.append(("march/extrapolate", "what becomes of rays that run out of steps on their way from a surface"))
    return found


def modules(scene: Scene, marching: Marching, epsilon: float) -> list[tuple[str, str]]:
    """The modules that march, each with its reason."""
    quality, facts = scene.quality, scene.node.facts
    found = [(f"view/camera{'_interpolated' * (quality.rays == 'interpolated')}", "every picture has a camera")]
    add = found.append
    cone = "_cone" * marching.cones
    add((f"march/epsilon{cone}", f"a ray looks for its hit within {epsilon:g} pixel widths of a surface"))
    add(("march/hit", "what a ray found"))
    add((f"march/distance{cone}", "the field is asked along rays" + " and cones" * marching.cones))
    if quality.refinement == "proven":
        add(("march/refine", "the last steps towards a surface are along the measured slope, and proven"))
    else:
        add(
            (
                f"march/refine_{'none' if quality.refinement == 'none' else 'slope'}",
                f"{quality.refinement!r} correction",
            )
        )
    if marching.tracer != "bracketing":
        add(("march/loop", "a ray goes on until it is near a surface"))
        aims = marching.tracer == "auto_relaxed" and quality.refinement == "proven"
        add((f"march/aim{cone if aims else '_never'}", "where a step of a ray may lead" + " onto the surface" * aims))
    add(("march/on_exhausted", f"a ray may take {quality.max_steps} steps"))
    tracer = MODULES.get(marching.tracer, marching.tracer)
    add((f"march/{tracer}", marching.tracer_reason))
    if tracer == "plain":
        found += safe_step(quality)
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
        add(("march/state", f"Quality(steps_per_pass={quality.steps_per_pass})"))
        add(("march/resumed", "what passes before found"))
    else:
        add((f"march/trace{on}", marching.schedule_reason))
    return found
