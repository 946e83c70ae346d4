"""The marching of a scene: its tracer, its schedule, and the GLSL modules of both."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from raymarch.plan.schedule import PIXEL, SCHEDULES, SINGLE, Schedule
from raymarch.scene.quality import Quality
from raymarch.scene.scene import Scene

MODULES = {"relaxed_again": "relaxed"}
"""Tracers whose module has a different name."""

SECONDARY = ("light/shadow", "light/cone", "light/triangulated", "light/two_sided", "path/secondary")
"""Modules that march secondary rays: from one surface to the next, or to a light."""

WORTH = 3e7
"""Operations of the field times pixels from which schedule "auto" marches cones. Below, a second program and pass cost
more than the evaluations that they save."""


@dataclass(frozen=True, slots=True)
class Marching:
    """The tracer and the schedule of a scene, each with its reason.

    steps : largest number of steps of a ray, not counting those of its cones.
    steps_per_pass : largest number of steps in one pass; None to take all steps in one pass.
    """

    tracer: str
    tracer_reason: str
    schedule: Schedule
    schedule_reason: str
    steps: int
    steps_per_pass: int | None

    @property
    def resumed(self) -> bool:
        """True if rays are marched over several passes."""
        return self.steps_per_pass is not None

    @property
    def passes(self) -> int:
        """The largest number of passes that march a ray."""
        return 1 if self.steps_per_pass is None else -(-self.steps // self.steps_per_pass)

    @property
    def jittered(self) -> bool:
        """True if rays go through any point of a pixel, not only its centre."""
        return PIXEL in self.schedule.levels

    @property
    def cones(self) -> bool:
        """True if cones are marched before the rays."""
        return bool(self.schedule.levels)


def choose(scene: Scene, operations: int, size: tuple[int, int] | None) -> Marching:
    """Choose the tracer and the schedule for a scene.

    operations : arithmetic operations in one evaluation of the field.
    size : (width, height) of the picture in pixels, None if not known.
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
        schedule_reason += "; the samples of a pixel start where its cone ended"
    steps = max(1, round(schedule.share * quality.max_steps))
    return Marching(tracer, tracer_reason, schedule, schedule_reason, steps, quality.steps_per_pass)


def trusted(scene: Scene) -> bool:
    """True if the field is certified to be no larger than the distance, or Quality(assume_certified=True) says so."""
    return scene.node.exactness != "estimate" or scene.quality.assume_certified


def _choose_tracer(quality: Quality, certified: bool) -> tuple[str, str]:
    asked = quality.tracer
    if not certified:
        if asked not in ("auto", "plain"):
            return "plain", f"the field is an estimate, so the longer steps of Quality(tracer={asked!r}) are not safe"
        return "plain", "the field is an estimate, so longer steps are not safe"
    if quality.shortened:
        return "plain", "Quality(step_scale=..., step_variation=...) shortens plain steps"
    if asked == "auto":
        return "bracketing", "the field is certified, so a step longer than the distance can be checked"
    return asked, f"Quality(tracer={asked!r})"


def _choose_schedule(
    quality: Quality, certified: bool, operations: int, size: tuple[int, int] | None
) -> tuple[Schedule, str]:
    asked = quality.schedule
    if not certified:
        if asked in ("auto", "single"):
            return SINGLE, "the field is an estimate, so no cone is certain to be empty"
        return (
            SINGLE,
            f"the field is an estimate, so the cones of Quality(schedule={asked!r}) are not certain to be empty",
        )
    if quality.shortened:
        return SINGLE, "Quality(step_scale=..., step_variation=...) shortens steps, so no cone is certain to be empty"
    if asked != "auto":
        return SCHEDULES[asked], f"Quality(schedule={asked!r})"
    if size is None:
        return SINGLE, "the size of the picture is not known"
    work = operations * size[0] * size[1]
    if work < WORTH:
        return SINGLE, f"{work:.2g} operations for one evaluation per pixel, too few for cones to save time"
    return SCHEDULES["cones"], f"{work:.2g} operations for one evaluation per pixel, enough for cones to save time"


def safe_step(quality: Quality) -> list[tuple[str, str]]:
    """The modules that give the length of a plain step, each with its reason."""
    if quality.step_variation > 0:
        why = f"Quality(step_variation={quality.step_variation:g})"
        return [("march/safe_step_varied", why), ("random/pixel", "step lengths vary from pixel to pixel")]
    if quality.step_scale < 1:
        return [("march/safe_step_scaled", f"Quality(step_scale={quality.step_scale:g})")]
    return [("march/safe_step", "a plain step is as long as the distance")]


def secondary(quality: Quality, names: Iterable[str]) -> list[tuple[str, str]]:
    """The modules that points on surfaces and secondary rays need, if any of the modules `names` uses them."""
    names = set(names)
    found = []
    if names & {*SECONDARY, "light/inner", "light/inner_depth"}:
        found.append(("march/nearness", "the precision of a point on a surface"))
    if not names & set(SECONDARY):
        return found
    found += [*safe_step(quality), ("march/epsilon", "secondary rays start two epsilons from a surface")]
    if names & set(SECONDARY) - {"light/two_sided"}:
        found.append(("march/contact", "secondary rays hit a surface within a fraction of an epsilon"))
        found.append(("march/extrapolate", "secondary rays that run out of steps are extrapolated"))
    return found


def modules(scene: Scene, marching: Marching, epsilon: float) -> list[tuple[str, str]]:
    """The modules that march primary rays, each with its reason.

    epsilon : distance to a surface, in pixel widths, at which a ray starts to refine its hit.
    """
    quality, facts = scene.quality, scene.node.facts
    found = [(f"view/camera{'_interpolated' * (quality.rays == 'interpolated')}", "every scene has a camera")]
    add = found.append
    cone = "_cone" * marching.cones
    add((f"march/widths{cone}", f"a ray refines its hit within {epsilon:g} pixel widths of a surface"))
    add(("march/hit", "the state of a ray and its hit"))
    if marching.tracer in ("plain", "bracketing"):
        add(("march/start", "the field at the camera is known when the frame begins"))
    else:
        add(("march/start_published", f"{marching.tracer} starts as published"))
    add((f"march/distance{cone}", "the field is evaluated along rays" + " and cones" * marching.cones))
    if quality.refinement == "proven" and trusted(scene):
        add(("march/refine", "the last steps follow the measured derivative, and each is verified"))
    elif quality.refinement == "proven":
        add(("march/refine_none", "the field is an estimate, whose hits are not refined"))
    else:
        add(
            (
                f"march/refine_{'none' if quality.refinement == 'none' else 'slope'}",
                f"Quality(refinement={quality.refinement!r})",
            )
        )
    add(("march/loop", "a ray steps until it is near a surface, and then refines its hit"))
    aims = marching.tracer in ("auto_relaxed", "bracketing") and quality.refinement == "proven"
    add(
        (
            f"march/aim{cone if aims else '_never'}",
            "whether a step may aim at the surface" if aims else "no step aims at the surface",
        )
    )
    if marching.tracer != "bracketing":
        add(("march/advance", "a step that may have passed a surface is undone"))
    add(("march/on_exhausted", f"a ray that runs out of its {quality.max_steps} steps ends at its last sample"))
    tracer = MODULES.get(marching.tracer, marching.tracer)
    add((f"march/{tracer}", marching.tracer_reason))
    if tracer == "plain":
        found += safe_step(quality)
    below, above = np.isfinite(facts.upper), np.isfinite(facts.lower)
    if np.any(below) or np.any(above):
        add(("march/below", "the scene's box is bounded on some side"))
        if np.any(above):
            add(("march/above", "the scene's box has a lower bound on some axis"))
        if np.any(above & below) and not marching.cones:
            add(("march/slab", "the scene's box has both bounds on some axis"))
        add(("march/clipped", "rays are marched only inside the scene's box"))
    else:
        add(("march/whole", "the scene's box is unbounded on all sides"))
    on = "_on" * marching.cones
    if marching.cones:
        add(("march/carry", marching.schedule_reason))
    if marching.cones or marching.resumed:
        add((f"march/begin{on}", "rays start where their cones ended" if on else "rays start at the camera"))
    if marching.resumed:
        add(("march/state", f"Quality(steps_per_pass={quality.steps_per_pass})"))
        add(("march/resumed", "the hits that the march passes found"))
    else:
        add((f"march/trace{on}", marching.schedule_reason))
    return found
