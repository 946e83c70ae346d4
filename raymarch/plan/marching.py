"""The marching of a scene: its tracer, its schedule, and the choices of GLSL modules that follow.

A schedule has coarse levels of cones that are marched first, so that rays start where their cones ended.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from raymarch.expr.function import Function
from raymarch.expr.operations import operations as count_operations
from raymarch.expr.operations import reads as count_reads
from raymarch.prices import SAVED, SAVED_BESIDE, SAVED_FAR, STANDARD, Prices
from raymarch.scene.quality import Quality
from raymarch.scene.reading import passes_zeros, touching_glass
from raymarch.scene.scene import Scene
from raymarch.scene.tracer import OwnTracer
from raymarch.sdf.advance import DEEPEST, OnlyDistance, implicit_nodes, readable, steepest_slopes
from raymarch.sdf.levels import flatness_by_facts, has_levels

MODULES = {"relaxed_again": "relaxed", "advance": "bracketing"}
"""Tracers whose module has a different name."""

FIELDS: Final = (
    *("tracer", "max_steps", "epsilon", "omega", "beta", "step_scale", "step_variation", "schedule"),
    *("refinement", "shadow_steps"),
)
"""Fields of `Quality` that change how rays are marched, and no function that is generated for a scene."""


def unmarched(quality: Quality) -> Quality:
    """The quality with the defaults of all `FIELDS`: equal for qualities whose plans differ in marching alone."""
    plain = Quality()
    return quality.replace(**{name: getattr(plain, name) for name in FIELDS})


@dataclass(frozen=True, slots=True)
class Level:
    """A level of cones.

    scale : width and height relative to the final picture, above 0 and up to 1.
    share : fraction of the steps that its cones may take; 1 marches them until they stop.
    """

    scale: float
    share: float = 1.0

    def size(self, picture: tuple[int, int]) -> tuple[int, int]:
        """(width, height) of the level in cells."""
        return max(1, round(picture[0] * self.scale)), max(1, round(picture[1] * self.scale))


@dataclass(frozen=True, slots=True)
class Schedule:
    """Levels from coarse to fine, and the fraction of the steps that remains for the rays."""

    levels: tuple[Level, ...] = ()
    share: float = 1.0


def _published(scales: tuple[float, ...]) -> Schedule:
    """Bálint and Valasek 2018: an eighth of the steps for each level, the rest for the rays.

    Their table for six resolutions leaves 3/8 after four eighths. It omits one of the five levels.
    """
    return Schedule(tuple(Level(scale, 1 / 8) for scale in scales), 1 - len(scales) / 8)


SINGLE: Final = Schedule()

SCHEDULES: Final = {
    "single": SINGLE,
    "two": _published((1 / 2,)),
    "four": _published((1 / 4, 1 / 2, 3 / 4)),
    "six": _published((1 / 6, 1 / 3, 1 / 2, 2 / 3, 5 / 6)),
    "cone": Schedule((Level(1 / 4),)),
    "cones": Schedule((Level(1 / 16), Level(1 / 4), Level(1 / 2))),
}
"""Schedules by their names in `Quality`."""

PIXEL: Final = Level(1.0)
"""One cone around each whole pixel; all samples of the pixel start where it ended."""


@dataclass(frozen=True, slots=True)
class Marching:
    """The tracer and the schedule of a scene, each with its reason.

    steps : largest number of steps of a ray, not counting those of its cones.
    steps_per_pass : largest number of steps in one pass; None to take all steps in one pass.
    free : True if every solid tells how far a ray is free, so that no step is undone.
    """

    tracer: str
    tracer_reason: str
    schedule: Schedule
    schedule_reason: str
    steps: int
    steps_per_pass: int | None
    free: bool = False

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


def choose(
    scene: Scene,
    operations: int,
    size: tuple[int, int] | None,
    standalone: bool = False,
    cells: bool = False,
    closed: bool = False,
    far: bool = False,
    advancing: Callable[[bool], Function] | None = None,
    reads: int = 0,
    beside: bool = False,
    prices: Prices = STANDARD,
) -> Marching:
    """Choose the tracer and the schedule for a scene.

    operations : arithmetic operations in one evaluation of the field.
    size : (width, height) of the picture in pixels, None if not known.
    standalone : True for a shader that draws the picture in one pass, without cones. It has no room for the tables of
        height maps.
    cells : True if objects are found through cells. closed : True if some solids have closed-form hits.
    far : True if a marched solid is unbounded.
    advancing : makes the function that tells how far a ray is free; see `raymarch.plan.stages.FieldPlan`.
    reads : texels that one evaluation reads. beside : True if objects in cells stand beside a convex solid that is
        marched. prices : of the device.
    """
    quality = scene.quality
    certified, several = trusted(scene), quality.samples > 1 or quality.temporal != "off"
    tracer, tracer_reason = _choose_tracer(scene, certified, refined(scene))
    known = advancing is not None and (beside or not cells) and not (standalone and steepest_slopes(scene.node))
    if tracer == "bracketing" and certified and quality.tracer == "auto" and advancing is not None and known:
        tracer, tracer_reason = _whether_to_advance(scene, operations, reads, advancing, beside, prices)
    saved = SAVED_FAR if far else SAVED_BESIDE if closed else SAVED
    known_size = None if cells else size
    schedule, schedule_reason = _choose_schedule(quality, certified, operations * saved, known_size, prices)
    if cells and schedule is SINGLE and certified and quality.schedule == "auto" and not quality.shortened:
        schedule_reason = "cells skip empty space, so cones would save less than their program takes to compile"
    if standalone:
        schedule, schedule_reason = SINGLE, "a standalone shader draws the picture in one pass"
    elif quality.edges == "distance":
        schedule, schedule_reason = SINGLE, "rays are wider than cones: Quality(edges='distance')"
    elif scene.motion_blur:
        schedule, schedule_reason = SINGLE, "the scene moves while the shutter is open, and cones hold one moment"
    elif certified and not (quality.shortened or quality.steps_per_pass) and several:
        schedule = Schedule((*schedule.levels, PIXEL), schedule.share)
        schedule_reason += "; the samples of a pixel start where its cone ended"
    steps = max(1, round(schedule.share * quality.camera_steps))
    free = tracer == "advance" and _all_free(scene, advancing)
    return Marching(tracer, tracer_reason, schedule, schedule_reason, steps, quality.steps_per_pass, free)


def trusted(scene: Scene) -> bool:
    """True if the field is certified to be no larger than the distance, or Quality(assume_certified=True) says so."""
    return scene.node.exactness != "estimate" or scene.quality.assume_certified


def refined(scene: Scene) -> bool:
    """True if the surface is where the field is 0, so that hits are refined; see `has_levels`."""
    return has_levels(scene.node) or scene.quality.assume_certified


def cut(scene: Scene) -> bool:
    """True if a hit needs a sample beyond the surface: a cut, or glass solids that touch, may leave a membrane of no
    thickness."""
    return scene.quality.refinement == "proven" and refined(scene) and passes_zeros(scene, scene.node)


def stands(scene: Scene) -> bool:
    """True if glass touches what is no glass: rays in glass end at such a face, although the field is 0 there."""
    return cut(scene) and False in touching_glass(scene, scene.node)


def films(scene: Scene) -> bool:
    """True if paths may pass a film of air of no thickness between glass and what is no glass."""
    return not scene.whitted and False in touching_glass(scene, scene.node)


def clipped(scene: Scene) -> bool:
    """True if the scene's box is bounded on some side, so that rays are clipped to it."""
    facts = scene.node.facts
    return bool(np.any(np.isfinite(facts.lower)) or np.any(np.isfinite(facts.upper)))


def _choose_tracer(scene: Scene, certified: bool, refines: bool) -> tuple[str, str]:
    quality, asked = scene.quality, scene.quality.tracer
    if not certified:
        if asked in ("auto", "bracketing") and refines and not quality.shortened:
            return "bracketing", "the field is an estimate, so a step is at most a pixel longer than its value"
        if asked not in ("auto", "plain"):
            return "plain", f"the field is an estimate, so the longer steps of Quality(tracer={asked!r}) are not safe"
        return "plain", "the field is an estimate, so longer steps are not safe"
    if quality.shortened:
        return "plain", "Quality(step_scale=..., step_variation=...) shortens plain steps"
    if asked == "advance":
        unreadable = _unreadable(scene)
        return ("bracketing", unreadable) if unreadable else ("advance", "Quality(tracer='advance')")
    if asked == "auto" and _unreadable(scene) is None and implicit_nodes(scene.node):
        return "advance", "an implicit surface is known along stretches of a ray"
    if asked == "auto":
        return "bracketing", "the field is certified, so a step longer than the distance can be checked"
    return str(asked) if not isinstance(asked, OwnTracer) else asked, f"Quality(tracer={asked!r})"


FLATTEST = 16.0
"""Largest ratio of a distance to its field for which float32 tells how far a ray is free."""


def _unreadable(scene: Scene) -> str | None:
    """Why the field does not tell how far a ray is free; None if it does."""
    if scene.node.exactness == "estimate":
        return "an estimate does not tell how far a ray is free"
    if not readable(scene.node):
        return f"the tree has more than {DEEPEST} nodes one above the other"
    if flatness_by_facts(scene.node) > FLATTEST:
        return "the field is flat along some axis, and float32 does not tell how far a ray is free"
    return None


def _enters(scene: Scene) -> bool:
    """True if rays go through solids."""
    return scene.bouncing and any(material.transmits for material in scene.materials)


def _all_free(scene: Scene, advancing: Callable[[bool], Function] | None) -> bool:
    """True if every solid tells how far a ray is free, up to its surface: no step is undone, and no hit is refined."""
    ends = refined(scene) and scene.quality.refinement == "proven" and not cut(scene)
    if advancing is None or not ends or _enters(scene):
        return False
    try:
        advancing(True)
    except OnlyDistance:
        return False
    return True


BY_SLOPE = 1.4
"""Largest ratio of the operations of the advance to those of the distance, as a multiple of the steepest slope of a
height map: the distance is divided by that slope, the advance is not. With a ratio of 4.5, slopes of 2.4, 3.5 and 4.9
take .59, .58 and .57 of the evaluations, and .99, .98 and .99 of the CPU time, 320x180, llvmpipe."""


PARTLY = 1.5
"""The same ratio where of some solids only boxes are known, for objects in cells beside a convex solid: those of
chess.py take .89 of the evaluations of all rays, with a ratio of 1.0, and .98 of the CPU time. Other solids keep the
distance: those of array.py would take .68, with a ratio of 1.3, but 1.00 of the CPU time, and 1.15 of that of a first
frame."""

FURTHER = 0.3
"""Seconds of a further operation of the advance, as a share of those of text without branches. First frames, CPU time
on llvmpipe: 1,000 further operations take .33 s in village, .1 to .4 s in array, .13 s of ten carved boxes."""


def _whether_to_advance(
    scene: Scene, operations: int, reads: int, advancing: Callable[[bool], Function], beside: bool, prices: Prices
) -> tuple[str, str]:
    """The tracer of a certified field: by how far rays are free, if that saves time."""
    longer = "a step longer than the distance can be checked"
    if _enters(scene):
        return "bracketing", f"{longer}, inside of solids too"
    if (unreadable := _unreadable(scene)) is not None:
        return "bracketing", f"{longer}; {unreadable}"
    quality = scene.quality
    if quality.bounding_volumes is not None or quality.refinement != "proven":
        how = "Quality(bounding_volumes=..., refinement=...) choose how distances are evaluated"
        return "bracketing", f"{longer}; {how}"
    if prices.seconds(operations) > prices.patience and not beside:
        return "bracketing", f"{longer}; to tell how far a ray is free takes long to compile"
    limits, of = [prices.advance, *[BY_SLOPE * slope for slope in steepest_slopes(scene.node)]], "of all solids"
    try:
        body = advancing(True).body
    except OnlyDistance as unknown:
        if not beside:
            return "bracketing", f"{longer}; of {unknown.node.name} nothing but the distance is known along a ray"
        limits, of = [PARTLY], "of some solids, and up to the boxes of others"
        body = advancing(False).body
    needed = count_operations([body], turns=not beside)
    if 1e-3 * FURTHER * prices.compile * (needed - operations) > prices.patience:
        return "bracketing", f"{longer}; to tell how far a ray is free takes long to compile"
    ahead, distance = needed + prices.read * count_reads([body]), max(operations + prices.read * reads, 1)
    ratio = ahead / distance
    worth = min(limits)
    times = f"{prices.nanoseconds(ahead)} in place of {prices.nanoseconds(distance)}; worth it up to {worth:.1f} times"
    cost = f"in {ratio:.1f} times the operations of the distance ({times})"
    if ratio > worth:
        return "bracketing", f"{longer}; how far a ray is free is known {cost}, which is more than it saves"
    return "advance", f"how far a ray is free is known {of}, {cost}"


def _choose_schedule(
    quality: Quality, certified: bool, saved: float, size: tuple[int, int] | None, prices: Prices
) -> tuple[Schedule, str]:
    asked = quality.schedule
    if not certified:
        cones = f"the cones of Quality(schedule={asked!r}) are not certain to be empty"
        none = "no cone is certain to be empty"
        return SINGLE, f"the field is an estimate, so {none if asked in ('auto', 'single') else cones}"
    if quality.shortened:
        return SINGLE, "Quality(step_scale=..., step_variation=...) shortens steps, so no cone is certain to be empty"
    if asked != "auto":
        return SCHEDULES[asked], f"Quality(schedule={asked!r})"
    if size is None:
        return SINGLE, "the size of the picture is not known"
    work = saved * size[0] * size[1]
    price = f"their pass takes {prices.milliseconds(prices.draw)}, and saves about {prices.milliseconds(work)}"
    if work < prices.draw:
        return SINGLE, f"cones would cost more than they save: {price}"
    return SCHEDULES["cone"], f"cones save time: {price}"


def variants_of(scene: Scene) -> frozenset[str]:
    """The conditional lines of GLSL modules that the scene's camera calls for; see `raymarch.glsl.VARIANTS`."""
    camera = scene.camera
    found = {
        "ORTHOGRAPHIC": camera.orthographic,
        "OWN_START": camera.orthographic or camera.cuts or camera.lens,
        "CLIP_PLANES": camera.clips,
        "LENS": camera.lens,
        "WIDE_CONE": camera.orthographic or camera.lens,
    }
    return frozenset(name for name, used in found.items() if used)


def interpolated(scene: Scene) -> bool:
    """True if ray directions are interpolated between the corners of the picture."""
    return scene.quality.rays == "interpolated" and not variants_of(scene)


def interlaced(scene: Scene) -> bool:
    """True if a picture within a budget of time may go on in the next frame, from coarse to fine grids of pixels."""
    return scene.quality.temporal == "accumulate" and not interpolated(scene)


def _field_along(marching: Marching) -> str:
    """The module that evaluates the field along a ray."""
    return "march/distance_ahead" if marching.tracer == "advance" else "march/distance"


def choices(
    scene: Scene, marching: Marching, epsilon: float, standalone: bool = False, solved: str = ""
) -> dict[str, str]:
    """The modules chosen to march rays, each with its reason.

    epsilon : distance to a surface, in pixel widths, at which a ray starts to refine its hit.
    standalone : True for a shader that computes the camera itself.
    solved : why some solids are solved in closed form; "" if none is.
    """
    quality = scene.quality
    own = dict.fromkeys(("view/pose", "view/camera"), "a standalone shader computes the camera")
    camera = scene.camera
    calls = {"projection": camera.orthographic, "near, far": camera.clips, "aperture": camera.lens}
    called = ", ".join(name for name, used in calls.items() if used)
    reason = f"Camera({called})" if called else f"Quality(rays={quality.rays!r})"
    given = {"view/camera" + "_interpolated" * interpolated(scene): reason}
    own_step = isinstance(marching.tracer, OwnTracer)
    tracer = "own" if own_step else "free" if marching.free else MODULES.get(marching.tracer, marching.tracer)
    found = {
        **(own if standalone else given),
        "march/widths": f"a ray refines its hit within {epsilon:g} pixel widths of a surface",
        _field_along(marching): "the field is evaluated along rays" + " and cones" * marching.cones,
        f"march/{tracer}": marching.tracer_reason,
    }
    if "OWN_START" in variants_of(scene):
        found["march/start_published"] = "each ray starts at a point of its own"
    elif marching.tracer in ("plain", "bracketing", "advance"):
        found["march/start"] = "the field at the camera is known when the frame begins"
    else:
        found["march/start_published"] = f"{marching.tracer} starts as published"
    found |= {} if marching.free else {"march/loop": "the march of a ray"}
    found |= _steps_of(scene, marching)
    if solved:
        found["march/analytic"] = solved
    found["march/clipped"] = "rays are marched only inside the scene's box, if it has one"
    found |= {"march/cone_size": marching.schedule_reason} if marching.cones else {}
    if marching.resumed:
        found["march/resumed"] = f"Quality(steps_per_pass={quality.steps_per_pass})"
    else:
        found["march/trace"] = marching.schedule_reason
    return found


def _steps_of(scene: Scene, marching: Marching) -> dict[str, str]:
    """The modules of the steps of a ray: undone, plain, aimed at the surface, refining."""
    quality, found = scene.quality, dict[str, str]()
    if marching.tracer not in ("bracketing", "advance"):
        found["march/advance"] = "a step that may have passed a surface is undone"
    if quality.refinement != "proven":
        found[f"march/refine_{quality.refinement}"] = f"Quality(refinement={quality.refinement!r})"
    elif refined(scene):
        found["march/refine"] = "the last steps follow the measured derivative, and each is verified"
    else:
        found["march/refine_none"] = "an estimate that is never negative has no surface to refine hits on"
    if marching.tracer in ("auto_relaxed", "bracketing") and quality.refinement == "proven":
        found["march/aim"] = "whether a step may aim at the surface"
    else:
        found["march/aim_never"] = "no step aims at the surface"
    if quality.step_variation > 0:
        found["march/safe_step_varied"] = f"Quality(step_variation={quality.step_variation:g})"
    elif quality.step_scale < 1:
        found["march/safe_step_scaled"] = f"Quality(step_scale={quality.step_scale:g})"
    else:
        found["march/safe_step"] = "a plain step is as long as the distance"
    return found
