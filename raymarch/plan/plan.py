"""The plan between a scene and its shader.

The plan chooses the functions and passes of the shader, and its modules where there are alternatives. The shader text
contains nothing that the scene does not use. `explain` prints the reasons.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from raymarch.errors import Doubt, Location, warn
from raymarch.expr.function import Function
from raymarch.expr.node import Expr
from raymarch.expr.operations import READING
from raymarch.expr.samples import Samples
from raymarch.expr.tables import Table
from raymarch.expr.texels import Texels
from raymarch.expr.types import Type
from raymarch.expr.walk import find, free_variables
from raymarch.plan import lights, marching, shading
from raymarch.plan.device import DeviceClass, device_class
from raymarch.plan.live_lights import LiveLights
from raymarch.plan.objects import crowded, misread
from raymarch.plan.passes import joining, with_cones
from raymarch.plan.shading import Feature
from raymarch.plan.stages import (
    Asked,
    FieldPlan,
    PassPlan,
    Refuse,
    SurfacePlan,
    ask,
    compile_seconds,
    drawn_of,
    fields_of,
    kept_surface,
    marching_of,
    objects_of,
    relative,
    surfaces_of,
)
from raymarch.plan.unused import unused
from raymarch.scene.legal import Condition, conditions_of
from raymarch.scene.origin import InReach, default_view, range_doubts
from raymarch.scene.parameter import Spec
from raymarch.scene.post import PostEffect
from raymarch.scene.quality import CONTACT, LAST_STEP, Quality
from raymarch.scene.reading import exact_distance, reads_field
from raymarch.scene.scene import Scene, all_nodes, check_scene
from raymarch.scene.tracer import OwnTracer
from raymarch.sdf.advance import STRETCH
from raymarch.sdf.levels import flatness, moved_otherwise
from raymarch.sdf.lower import Lowering


def plan(
    scene: Scene,
    passes: Sequence[str] = ("color",),
    size: tuple[int, int] | None = None,
    lowering: Lowering | None = None,
    standalone: bool = False,
    refuse: Refuse | None = None,
    device: DeviceClass | None = None,
    live: LiveLights | None = None,
) -> Plan:
    """Plan a scene. Raises PlanError for clashing parameters or a field that is too large.

    passes : names of the requested passes, of `raymarch.plan.passes.DRAWN`; passes that they need are added.
    size : (width, height) of the picture in pixels; decides whether marching cones first saves time.
    lowering : translates nodes to expressions; None for a new `Lowering`.
    standalone : plan a shader that other programs can draw: it computes the values of a frame itself, and marches no
        cones.
    refuse : called as soon as the field is known, with `Plan.compile_seconds`, `operations` and `shapes`; raises if
        that is too much to plan the rest.
    device : the class of devices that draw it. By default, or if the environment names one, see `device_class`;
        standalone plans are for hardware.
    live : how lights are drawn that come and go; see `LightMemory.fit`.
    """
    check_scene("plan", scene)
    asked = ask(scene, passes, standalone, device or device_class(is_software=not standalone), live)
    objects = objects_of(asked, all_fixed=lowering is not None)
    fields, lowering = fields_of(asked, objects, lowering, refuse)
    surfaces = surfaces_of(asked, fields, lowering)
    drawn = drawn_of(asked, fields, surfaces, size)
    for effect in scene.post if standalone else ():
        warn(f"{effect.LABEL} is left out: an exported shader draws each pixel alone", effect.where)
    return Plan(**vars(asked), **vars(fields), **vars(surfaces), **vars(drawn))


@dataclass(frozen=True, eq=False, kw_only=True)
class Plan(Asked, FieldPlan, SurfacePlan, PassPlan):
    """The functions, modules and passes that draw a scene: the results of all stages, and what follows from them.

    probes : modules that inspect the field, each with its reason; see `raymarch.plan.probe`.
    published : True to count the steps of a ray as Bálint and Valasek (2018) do, for comparisons: an undone step and
        the plain one that replaces it are one, and no ray takes more than `Quality.max_steps`. Its passes must count.
    """

    probes: Mapping[str, str] = field(default_factory=dict)
    published: bool = False

    @cached_property
    def variants(self) -> frozenset[str]:
        """The conditional lines of GLSL modules that the shader has; see `raymarch.glsl.VARIANTS`."""
        used = {
            "ADVANCE": self.advance is not None,
            "ANALYTIC": self.analytic.used,
            "AHEAD": self.cones_ahead,
            "BOUNCES": self.scene.bouncing,
            "CONES": self.marching.cones,
            "CUTS": marching.cut(self.scene),
            "EDGES": self.scene.quality.edges == "distance",
            "LIT": self.lights_split,
            "NOTED": any(p.notes for p in self.passes),
            "PUBLISHED": self.published,
            "RELIEF": self.relief is not None,
            "RISING": self.scene.quality.rising_steps > self.marching.steps and not self.scene.quality.steps_per_pass,
            "SAMPLES": self.scene.quality.samples > 1,
            "SHOWS": bool(lights.visible(self.scene)),
            "SKIPS": self._skips,
            "STANDALONE": self.standalone,
            "STANDS": marching.stands(self.scene),
            "FILMS": marching.films(self.scene),
            "BOUNDED": marching.clipped(self.scene),
            "STRETCH": self.stretched,
            "ESTIMATE": not self.certified,
            "HALVED": self._halves,
            "JOINT": self.joint,
            "MAPPED": shading.mapped(self.scene),
            "PATTERNED": shading.patterned(self.scene),
            "UNDIVIDED": self.undivided is not None and any(map(reads_field, self.scene.lights)),
        }
        return marching.variants_of(self.scene) | {name for name, called in used.items() if called}

    @property
    def _skips(self) -> bool:
        """True if turns of a march that only search skip what the others need: not where samples are noted, nor in a
        shader that is to be small."""
        named = self.marching.tracer in ("bracketing", "advance")
        return self.device.branches and named and not self.standalone and not any(p.notes for p in self.passes)

    @property
    def _halves(self) -> bool:
        """True if soft shadows take half of the distance, because two spheres of the field that meet prove nothing."""
        return self.undivided is not None or self.marching.tracer == "plain" or not self.certified

    @property
    def hoisted(self) -> Mapping[str, Expr]:
        """The hoisted expressions so far, by the name of the parameter that replaces each."""
        return self.hoist.expressions

    @property
    def origins(self) -> Mapping[Expr, Location]:
        """The user's line of each expression."""
        return self.hoist.origins

    @cached_property
    def parameters(self) -> dict[str, Spec]:
        """The parameters of the scene by name."""
        return self.scene.parameters

    @property
    def nodes(self) -> int:
        """Number of nodes of the scene."""
        return len(all_nodes(self.scene.node))

    @property
    def certified(self) -> bool:
        """True if the field is no larger than the distance, or Quality(assume_certified=True) is set."""
        return marching.trusted(self.scene)

    @property
    def refined(self) -> bool:
        """True if hits are refined, by default: the surface is where the field is 0."""
        return marching.refined(self.scene)

    @property
    def epsilon(self) -> float:
        """Distance to a surface, in pixel widths, at which a ray starts to refine its hit."""
        return self.scene.quality.near(self.refined)

    @property
    def contact_share(self) -> float:
        """The largest absolute value of the field at a hit, as a fraction of epsilon; 1 where hits are not refined.

        It is so small that a hit, after the last step, is within half an epsilon of the surface of any flat field.
        """
        stretches = self.marching.tracer == "advance"
        return min(CONTACT, (0.5 - LAST_STEP) / flatness(self.scene.node, stretches)) if self.refined else 1.0

    @cached_property
    def lights_as_data(self) -> bool:
        """True if the lights are rows of a texture rather than code."""
        return self.material is not None and (self.live is not None or lights.as_data(self.scene, self.prices))

    @cached_property
    def lights_in_cells(self) -> bool:
        """True if a grid of cells finds the lights that reach a surface."""
        found = lights.in_cells(self.scene, self.prices) if self.live is None else self.live.cells
        return self.lights_as_data and not self.standalone and found

    @cached_property
    def lights_split(self) -> bool:
        """True if several passes add a few samples of light each."""
        return any(p.lights for p in self.passes)

    @property
    def kept_surface(self) -> list[tuple[str, Type]]:
        """What passes that add light read of a surface: its parts as GLSL text, and their types."""
        return kept_surface(self, self)

    @property
    def occlusion_samples(self) -> int:
        """Number of samples of ambient occlusion of a surface."""
        dimmed = self.scene.occlusion is not None and shading.occluded(self.scene, self.model)
        return self.scene.occlusion.steps if self.scene.occlusion is not None and dimmed else 0

    def light_samples(self, turns: int) -> int:
        """Number of samples of light of a surface: those of ambient occlusion, then those of lights.

        turns : the largest number of lights of a surface, if they are rows of a texture.
        """
        occluded, most, every = self._light_counts
        return occluded + (turns * most if self.lights_as_data else every)

    @cached_property
    def _light_counts(self) -> tuple[int, int, int]:
        """Numbers of samples: of ambient occlusion, of the light that takes most, and of all lights if few."""
        every = 0 if self.lights_as_data else sum(lights.samples_of(self.scene, x) for x in self.scene.lights)
        return self.occlusion_samples, lights.stride(self.scene), every

    @property
    def compile_seconds(self) -> float:
        """Estimated seconds that a software renderer takes to compile the field and draw its first frame."""
        return compile_seconds(self.field, self.prices)

    @cached_property
    def sky_light(self) -> bool:
        """True if the shader reads the spherical harmonics of the sky."""
        return self.material is not None and shading.ambient_sky(self.scene)

    @cached_property
    def advance(self) -> Function | None:
        """The function that tells how far a ray is free; None if the tracer does not ask it."""
        return self.advancing(False) if self.marching.tracer == "advance" else None

    @property
    def tallies(self) -> bool:
        """True if evaluations by all rays are counted."""
        return any(p.tallies for p in self.passes)

    @property
    def tells_kinds(self) -> bool:
        """True if the shader keeps the kind of each ray: parts are hidden from some, or evaluations are counted."""
        return bool(self.hidden) or self.tallies

    @cached_property
    def cones_ahead(self) -> bool:
        """True if soft shadows ask how far the cone about a ray is free."""
        soft = any(map(reads_field, self.scene.lights))
        return soft and self.advance is not None and not (self.corrected if self.undivided else self.stretched)

    @cached_property
    def shadow_advance(self) -> Function | None:
        """How far a ray is free in the undivided field, or of solids in closed form; None if no soft shadow asks it."""
        of = "undivided" if self.undivided else "solved" * self.analytic.used
        return self.advancing(False, of) if of and self.cones_ahead else None

    @property
    def own_step(self) -> Function | None:
        """The function of a tracer that the scene defines itself; see `raymarch.scene.tracer`."""
        tracer = self.marching.tracer
        return tracer.step if isinstance(tracer, OwnTracer) else None

    @cached_property
    def stretched(self) -> bool:
        """True if that function has bounds that hold on a stretch of the ray."""
        return self.advance is not None and STRETCH in free_variables([self.advance.body])

    @cached_property
    def choices(self) -> Mapping[str, str]:
        """The modules chosen where several define the same names, each with its reason."""
        scene, normals = self.scene, self.scene.quality.normals
        solved = self.analytic.reason * self.analytic.used
        return {
            **marching.choices(scene, self.marching, self.epsilon, self.standalone, solved),
            f"normal/{normals}": f"Quality(normals={normals!r})",
            **joining(self.passes),
            **self.probes,
        }

    @cached_property
    def textures(self) -> list[Samples | Texels | Table]:
        """The pictures and sampled data that the field and the materials read, each once."""
        functions = (self.field, self.advance, self.material, self.relief, self.emission, self.glass)
        roots = [root for function in functions if function is not None for root in function.inner]
        if any(p.shades for p in self.passes):
            roots += self.scene.sky.expressions
        return list(dict.fromkeys(node.data for node in find(roots, "texture", "texture_in_atlas", *READING)))

    @cached_property
    def features(self) -> list[Feature]:
        """The effects that the scene uses, then those that it does not use."""
        return sorted(_features(self), key=lambda feature: not feature.used)

    @cached_property
    def without_effect(self) -> list[Doubt]:
        """A doubt for each option of the scene that has no effect."""
        return unused(self.given)

    @cached_property
    def conditions(self) -> list[Condition]:
        """Conditions checked against the values of each frame, because they could not be proven in advance."""
        moving = not all(value.is_constant for value in self.given.camera.expressions)
        return [*conditions_of(self.given), *([InReach(self.given)] if moving else [])]

    @cached_property
    def warnings(self) -> list[Doubt]:
        """Doubts about input that is legal but may not be intended."""
        scene, found = self.given, list[Doubt]()
        if scene.node.facts.empty:
            found.append(Doubt("plan", "the solid is empty: the bounding boxes of its operands do not overlap"))
        if scene.node.exactness == "estimate":
            found.append(Doubt("plan", "the field is an estimate: rays may miss surfaces"))
        for node in all_nodes(scene.node)[1:]:
            if node.facts.empty and not any(child.facts.empty for child in node.children):
                what = f"{node.name} is empty: the bounding boxes of its operands do not overlap"
                found.append(Doubt("plan", what, where=node.where))
        found += moved_otherwise(scene.node)
        found += misread(scene)
        found += crowded(self.located)
        found += [*self.without_effect, *range_doubts(self.view, self.origin, self.seen or self.field)]
        return list(dict.fromkeys(found))


def marched_otherwise(made: Plan, quality: Quality, size: tuple[int, int] | None = None) -> Plan:
    """The plan of the same scene with a quality that differs in `marching.FIELDS` alone.

    It equals a new plan. The functions of the field and of the materials are reused, which take nearly all of the time.
    size : of the picture, as for `plan`.
    """
    given, scene = made.given.replace(quality=quality), made.scene.replace(quality=quality)
    found = replace(made, given=given, view=default_view(given), scene=scene)
    march = marching_of(found, found, size)
    return replace(found, marching=march, passes=with_cones(made.passes, march.cones))


def relit(made: Plan, scene: Scene, live: LiveLights | None) -> Plan | None:
    """The plan of a scene that differs from that of another plan in its lights alone, if the shader stays the same.

    It equals a new plan. None if the shader is another one.

    live : how the lights are drawn; see `LightMemory.fit`.
    """
    view, origin, seen = relative(scene, live)
    found = replace(made, given=scene, view=view, scene=seen, live=live)
    covered = [frozenset(map(lights.signature, each.scene.lights)) for each in (made, found)]
    same = (
        made.lights_as_data
        and not lights.in_fog(scene)
        and covered[0] == covered[1]
        and (made.lights_in_cells, made.origin.tobytes()) == (found.lights_in_cells, origin.tobytes())
        and lights.split(made.scene) == lights.split(found.scene)
        and exact_distance(made.scene) == exact_distance(found.scene)
    )
    return found if same and found.lights_as_data else None


def _features(made: Plan) -> list[Feature]:
    scene = made.scene
    found = shading.features(scene, made.lights_as_data, made.prices)

    def feature(name: str, used: bool, yes: str, no: str) -> None:
        found.append(Feature(name, used, yes if used else no))

    why = "the scene's box is bounded on some side"
    feature("ray clipping", marching.clipped(scene), why, "the scene is unbounded on all sides")
    animated = bool(find(scene.expressions(), "time"))
    feature("time", animated, "the scene reads time", "nothing reads time")
    uniforms = f"{len(made.parameters)} uniform{'s' * (len(made.parameters) != 1)}"
    feature("parameters", bool(made.parameters), uniforms, "no Param is used")
    geometry = any(p.name == "geometry" for p in made.passes)
    effects = [p.effect for p in made.passes if p.effect is not None]
    for kind in {kind.__name__: kind for kind in PostEffect.__subclasses__()}.values():
        used = next((effect for effect in effects if isinstance(effect, kind)), None)
        reason = f"no picture with {kind.__name__} was requested" if used is None else "it is in the scene"
        found.append(Feature(kind.LABEL, used is not None, reason, None if used is None else used.where))
    feature("geometry pass", geometry, "arrays besides colour were requested", "only the picture was requested")
    gathered = made.gathered
    counted = f"{gathered.data:,} object{'s' * (gathered.data != 1)}"
    if moving := sum(len(rows) for rows in gathered.rows if rows.live):
        counted += f", of which {moving:,} move"
    beside = f", {gathered.text} beside them as text" if gathered.text else ""
    feature("objects as data", bool(gathered.rows), f"{counted}{beside}: {gathered.reason}", gathered.reason)
    feature("closed-form hits", made.analytic.used, made.analytic.reason, made.analytic.reason)
    feature("bounding volumes", made.bounding.used, made.bounding.reason, made.bounding.reason)
    for located in made.located:
        cells = located.cells
        listed = cells.texels[cells.texels[:, 1] > 0, 1]
        mean = f"{listed.mean():.1f}" if listed.size else "0"
        shown = " x ".join(map(str, cells.counts.tolist()))
        halved = f"{shown}, halved up to {cells.depth} times" if cells.depth else shown
        feature("cells", True, f"{halved}; {mean} objects a cell on average", "")
    moved = bool(np.any(made.origin))
    why = f"coordinates are relative to ({', '.join(f'{v:.8g}' for v in made.origin)})"
    feature("camera-relative", moved, why, "coordinates are small enough for float32")
    kinds = " and ".join(made.hidden)
    why = "no part is hidden by visible"
    feature("visibility by rays", bool(made.hidden), f"parts are hidden from {kinds} rays", why)
    quality = scene.quality
    feature("cones", made.marching.cones, made.marching.schedule_reason, made.marching.schedule_reason)
    several, smooth = quality.samples > 1, quality.edges == "distance"
    why = "Quality(edges='distance'): silhouettes cover their share of a pixel" if smooth else ""
    feature("anti-aliasing", several or smooth, why or f"{quality.samples} rays per pixel", "one ray per pixel")
    temporal = quality.temporal != "off"
    kept = f"Quality(temporal={quality.temporal!r})" if temporal else "the samples of a pixel are averaged"
    feature("history textures", temporal or quality.samples > 1, kept, "no frames or samples are accumulated")
    return found
