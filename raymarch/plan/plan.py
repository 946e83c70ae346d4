"""The plan between a scene and its shader.

The plan chooses the functions and passes of the shader, and its modules where there are alternatives. The shader text
contains nothing that the scene does not use. `explain` prints the reasons.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from dataclasses import field as default
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from raymarch.errors import Location, PlanError, warn
from raymarch.expr.derivative import companion
from raymarch.expr.function import Function
from raymarch.expr.node import Expr, var
from raymarch.expr.operations import operations as count_operations
from raymarch.expr.operations import straight_lines
from raymarch.expr.samples import Samples
from raymarch.expr.tables import Table
from raymarch.expr.texels import Texels
from raymarch.expr.types import FLOAT, VEC3, Type
from raymarch.expr.walk import find
from raymarch.plan import analytic, lights, marching, shading
from raymarch.plan.analytic import Analytic
from raymarch.plan.bounding import LEAST, Bounding
from raymarch.plan.gather import Gathered, gather
from raymarch.plan.hoisting import Hoisting
from raymarch.plan.marching import Marching
from raymarch.plan.materials import materials_of
from raymarch.plan.motion import changes, motion_of
from raymarch.plan.objects import Located, ObjectsInCells, exact_distance, misread, reads_field
from raymarch.plan.passes import ATTACHMENTS, BEFORE, CONE, DRAWN, Pass, joining, passes_of
from raymarch.plan.shading import Feature
from raymarch.plan.unused import unused
from raymarch.scene.bsdf import BSDF, Phong
from raymarch.scene.legal import Condition, conditions_of
from raymarch.scene.origin import DefaultView, InReach, default_view, origin_of, range_warning, refuse_extent, seen_from
from raymarch.scene.parameter import Spec
from raymarch.scene.post import PostEffect
from raymarch.scene.quality import CONTACT, Quality
from raymarch.scene.scene import Scene, all_nodes, check_scene
from raymarch.sdf.levels import flatness, moved_otherwise
from raymarch.sdf.lower import Lowering
from raymarch.sdf.node import Node
from raymarch.sdf.visibility import KINDS, hidden_from, hiding_nodes, labels_hidden_from

SLOW = 10.0
"""Estimated seconds to compile a field from which fewer objects become rows. Twelve chess pieces of five kinds have
their first frame in half the time; further frames take 1.6 times as long. See docs/scale.md."""

COSTLY = 20_000
"""Operations of costly objects together from which they become rows: cells spare as many evaluations as bounding
volumes, in a shader with one function for each form. See docs/scale.md."""

Refuse: TypeAlias = Callable[[float, int, int], None]

LARGEST = 1024
"""Largest number of shapes written as code. With more, compilers take many seconds or fail."""


@dataclass(slots=True)
class Plan:
    """The functions, modules and passes that draw a scene.

    given : the scene of the caller. origin : origin of the shader's coordinates in that scene, shape (3,), float64.
    hoist : replaces the time-only expressions of the functions of a shader.
    scene : the scene relative to `origin`; all other attributes describe it.
    """

    given: Scene
    origin: NDArray[np.float64]
    hoist: Hoisting
    scene: Scene
    field: Function
    origins: dict[Expr, Location]
    passes: list[Pass]
    parameters: dict[str, Spec]
    marching: Marching
    analytic: Analytic
    bounding: Bounding
    shapes: int
    gathered: Gathered
    located: list[Located]
    nodes: int
    operations: int
    gradient: Function | None = None
    material: Function | None = None
    material_index: Function | None = None
    emission: Function | None = None
    glass: Function | None = None
    relief: Function | None = None
    model: str = "phong"
    bsdf: BSDF = default(default_factory=Phong)
    choices: dict[str, str] = default(default_factory=dict)
    features: list[Feature] = default(default_factory=list)
    textures: list[Samples | Texels | Table] = default(default_factory=list)
    warnings: list[str] = default(default_factory=list)
    twins: dict[str, Expr] = default(default_factory=dict)
    """Leaves whose current values the motion pass reads, by the name of their twin; see `raymarch.plan.motion`."""
    conditions: list[Condition] = default(default_factory=list)
    """Conditions checked against the values of each frame, because they could not be proven in advance."""
    further: list[Function] = default(default_factory=list)
    """Further functions of the point that modules call."""
    hidden: list[str] = default(default_factory=list)
    """The kinds of rays that parts are hidden from. If there are any, `field` reads the kind of the ray."""
    seen: Function | None = None
    """The field of camera rays, if parts are hidden from some kind of ray."""
    undivided: Function | None = None
    """The field before it is divided, for effects that read distances; None if they are `field`, or there are none."""
    standalone: bool = False
    """True for a shader that computes the values of a frame itself and marches no cones."""

    @property
    def variants(self) -> frozenset[str]:
        """The conditional lines of GLSL modules that the shader has; see `raymarch.glsl.VARIANTS`."""
        used = {
            "ANALYTIC": self.analytic.used,
            "BOUNCES": self.scene.bouncing,
            "CONES": self.marching.cones,
            "CUTS": marching.cut(self.scene),
            "LIT": self.lights_split,
            "SAMPLES": self.scene.quality.samples > 1,
            "SHOWS": bool(lights.visible(self.scene)),
            "STANDALONE": self.standalone,
            "ESTIMATE": not self.certified,
            "UNDIVIDED": self.undivided is not None and any(map(reads_field, self.scene.lights)),
            "UNCOUNTED": not any(p.counts for p in self.passes),
        }
        return marching.variants_of(self.scene) | {name for name, called in used.items() if called}

    @property
    def hoisted(self) -> Mapping[str, Expr]:
        """The hoisted expressions so far, by the name of the parameter that replaces each."""
        return self.hoist.expressions

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

        It is so small that the hit is within an epsilon of the surface, however flat the field.
        """
        return min(CONTACT, 1.0 / flatness(self.scene.node)) if self.refined else 1.0

    @property
    def lights_as_data(self) -> bool:
        """True if the lights are rows of a texture rather than code."""
        return self.material is not None and lights.as_data(self.scene)

    @property
    def lights_in_cells(self) -> bool:
        """True if a grid of cells finds the lights that reach a surface."""
        return self.lights_as_data and not self.standalone and lights.in_cells(self.scene)

    @property
    def lights_split(self) -> bool:
        """True if several passes add a few samples of light each."""
        return any(p.lights for p in self.passes)

    @property
    def kept_surface(self) -> list[tuple[str, Type]]:
        """What passes that add light read of a surface: its parts as GLSL text, and their types."""
        assert self.material is not None
        material = self.material.type
        material = dict(material.fields).get("material", material)
        found = [("surface.normal", VEC3), ("surface.t", FLOAT)]
        found += [(f"surface.material.{name}", type) for name, type in material.fields]
        if shading.mapped(self.scene):
            found += [("surface.geometric_normal", VEC3), ("surface.ambient_visibility", FLOAT)]
        found += [("u_side", FLOAT)] if "OWN_START" in self.variants else []
        return found + ([("emitted", VEC3)] if self.emission is not None else [])

    @property
    def occlusion_samples(self) -> int:
        """Number of samples of ambient occlusion of a surface."""
        dimmed = self.scene.occlusion is not None and shading.occluded(self.scene, self.model)
        return self.scene.occlusion.steps if self.scene.occlusion is not None and dimmed else 0

    def light_samples(self, turns: int) -> int:
        """Number of samples of light of a surface: those of ambient occlusion, then those of lights.

        turns : the largest number of lights of a surface, if they are rows of a texture.
        """
        scene = self.scene
        if self.lights_as_data:
            return self.occlusion_samples + turns * lights.stride(scene)
        return self.occlusion_samples + sum(lights.samples_of(scene, light) for light in scene.lights)

    @property
    def compile_seconds(self) -> float:
        """Estimated seconds that a software renderer takes to compile the field and draw its first frame.

        Measured on llvmpipe: chains of 100, 200 and 1,000 smooth unions take 4.5, 16 and 346 s, polygons of 50 and 100
        corners 7 and 22 s. The time grows with the square of the operations in text without branches. 3,500 operations
        in bounding volumes, which are branches, take 6.5 s.
        """
        return _compile_seconds(self.field)

    @property
    def sky_light(self) -> bool:
        """True if the shader reads the spherical harmonics of the sky."""
        return self.material is not None and shading.ambient_sky(self.scene)


def _compile_seconds(field: Function) -> float:
    return sum(1.2e-3 * n + 1.3e-6 * n * n for n in straight_lines([field.body]))


def _costly(gathered: Gathered) -> list[tuple[int, int]]:
    """Of each form whose objects take so many operations that text would give them bounding volumes: the number of
    objects, and their operations together."""
    each = [(len(f), count_operations([f.columns.field.body])) for rows in gathered.rows for f in rows.forms]
    return [(n, n * operations) for n, operations in each if operations >= LEAST]


def _why_costly(gathered: Gathered) -> str:
    costly = _costly(gathered)
    count, total = sum(n for n, _ in costly), sum(operations for _, operations in costly)
    each = f"{count} of them take {LEAST} operations or more, {total:,} together (from {COSTLY:,} on they are rows)"
    shared = f"each of {len(costly)} forms" if len(costly) > 1 else "all"
    return f"{each}; text repeats them, rows share one function for {shared}"


def plan(
    scene: Scene,
    passes: Sequence[str] = ("color",),
    size: tuple[int, int] | None = None,
    lowering: Lowering | None = None,
    standalone: bool = False,
    gathered: Gathered | None = None,
    refuse: Refuse | None = None,
) -> Plan:
    """Plan a scene. Raises PlanError for clashing parameters or a field that is too large.

    passes : names of the requested passes, of `raymarch.plan.passes.DRAWN`; passes that they need are added.
    size : (width, height) of the picture in pixels; decides whether marching cones first saves time.
    lowering : translates nodes to expressions; None for a new `Lowering`.
    standalone : plan a shader that other programs can draw: it computes the values of a frame itself, and marches no
        cones.
    gathered : the objects that are rows; None to choose them.
    refuse : called as soon as the field is known, with `Plan.compile_seconds`, `operations` and `shapes`; raises if
        that is too much to plan the rest.
    """
    check_scene("plan", scene)
    given, view = scene, default_view(scene)
    origin = origin_of(view)
    scene = lights.with_discs(seen_from(given, origin))
    fixed = lowering is not None or gathered is not None
    lowering = lowering or Lowering()
    live = not standalone and scene.quality.temporal != "reproject"  # motion vectors are computed for text
    asked = (scene.node, scene.quality.objects, exact_distance(scene), live)
    gathered = gathered or gather(*asked)
    if not fixed and not gathered.rows and scene.quality.objects == "auto" and not scene.quality.bounding_volumes:
        fewer = gather(*asked, why="costly")
        if sum(operations for _, operations in _costly(fewer)) >= COSTLY:
            gathered = fewer
            gathered.reason = _why_costly(fewer)
    objects = ObjectsInCells(gathered.rows)
    if gathered.rows:
        lowering.objects = objects
    solid = gathered.node
    hidden = hiding_nodes(solid)
    lowering.rays = None if hidden else "camera"
    hoist = Hoisting(lowering.origins)
    bounding = Bounding(scene.quality.bounding_volumes, hoist)
    if bounding.allowed(hidden=bool(hidden), rows=bool(gathered.rows)) and lowering.sites is None:
        lowering.bounding = bounding
    definition = hoist(lowering.field(solid))
    seconds = 0.0 if fixed or gathered.rows or scene.quality.objects != "auto" else _compile_seconds(definition)
    if seconds > SLOW:
        estimate = f"text is estimated to take {seconds:.0f} s to compile, more than {SLOW:.0f}"
        fewer = gather(*asked, why=f"{estimate}; rows share one function for each form")
        if fewer.rows:
            return plan(given, passes, size, None, standalone, fewer, refuse)
    shapes = len(lowering.shapes)
    if shapes > LARGEST:
        raise PlanError(
            f"the field has {shapes} shapes, too many to compile as text",
            legal=f"up to {LARGEST} distinct shapes; objects of equal form can be data (docs/scale.md), "
            + "but those that move are text in exports, " * standalone
            + "and `repeat` makes copies of one",
            where=scene.node.where,
        )
    operations = count_operations([definition.body], turns=not gathered.rows)
    if refuse is not None:
        refuse(seconds or _compile_seconds(definition), operations, shapes)
    at_camera = definition
    if hidden:
        _refuse_hidden_glass(scene, solid)
        at_camera = hoist(lowering.for_camera().field(solid))
    closed = analytic.choose(solid, scene.quality.analytic, hidden=bool(hidden))
    if closed.used:
        analytic.complete(closed, solid, definition, lowering, hoist)
    refuse_extent(view, origin, at_camera)
    shapes = len(lowering.shapes)
    lit = shading.lit(scene)
    chosen = _marching_of(scene, operations, gathered, closed, size, standalone)
    mixed = _refuse_mixed(scene, standalone)
    post = () if standalone else scene.post
    several = lights.split(scene) and not standalone and [p for p in passes if DRAWN[p].shades] == ["color"]

    def drawn_with(texels: int) -> list[Pass]:
        return passes_of(passes, scene.quality, chosen.cones, changes(scene), mixed, post, texels)

    drawn = drawn_with(int(several))
    geometry = any(p.surfaces for p in drawn)
    made = Plan(
        given=given,
        origin=origin,
        hoist=hoist,
        scene=scene,
        field=definition,
        origins=lowering.origins,
        passes=drawn,
        parameters=scene.parameters,
        marching=chosen,
        analytic=closed,
        bounding=bounding,
        shapes=shapes,
        gathered=gathered,
        located=[objects.located(rows) for rows in gathered.rows],
        nodes=len(all_nodes(scene.node)),
        operations=operations,
        standalone=standalone,
        hidden=[kind for kind in KINDS if any(kind in hidden_from(node) for node in hidden)],
        seen=at_camera if hidden else None,
    )
    shaded = lit and any(p.shades for p in drawn)
    soft = any(map(reads_field, scene.lights))
    if solid.facts.divided and shaded and (soft or scene.occlusion is not None):
        made.undivided = hoist(lowering.again().field(solid, "undivided_field", undivided=True))
        r = var("r", FLOAT)
        slope = solid.facts.undivided / solid.facts.lipschitz
        made.further += [made.undivided, Function("divided", (r,), r / slope)] if soft else []
    needs_normal = (shaded and shading.needs_surface(scene)) or geometry
    sliced = any(p.name == "slice" for p in drawn)
    joint = shading.with_gradient(scene) and shaded and lowering.sites is None
    needs_normal = (needs_normal and not joint) or geometry or BEFORE in drawn
    if sliced or (needs_normal and scene.quality.normals == "analytic"):
        made.gradient = companion(definition)
    if shaded or geometry:
        found = materials_of(scene, solid, lowering, shaded, geometry, definition if joint else None, hoist)
        made.model, made.bsdf, made.material, made.emission = found.model, found.bsdf, found.record, found.emission
        made.material_index, made.glass, made.relief = found.index, found.glass, found.relief
        if several:
            texels = 1 + max(k for k, _ in lights.layout([type for _, type in made.kept_surface]))
            made.passes = drawn = drawn_with(texels if texels <= ATTACHMENTS else 0)
    if BEFORE in drawn:
        place, made.twins = motion_of(solid, lowering, hoist)
        made.further.append(place)
    made.choices = _choices_of(made, joint)
    made.textures = _textures_of(made)
    _describe_effects(made)
    made.conditions = conditions_of(given)
    if not all(value.is_constant for value in given.camera.expressions):
        made.conditions.append(InReach(given))
    for effect in scene.post if standalone else ():
        warn(f"{effect.LABEL} is left out: an exported shader draws each pixel alone", effect.where)
    made.warnings = _warnings(made, view)
    return made


def marched_otherwise(made: Plan, quality: Quality, size: tuple[int, int] | None = None) -> Plan:
    """The plan of the same scene with a quality that differs in `marching.FIELDS` alone.

    It equals a new plan. The functions of the field and of the materials are reused, which take nearly all of the time.
    size : of the picture, as for `plan`.
    """
    given, scene = made.given.replace(quality=quality), made.scene.replace(quality=quality)
    chosen = _marching_of(scene, made.operations, made.gathered, made.analytic, size, made.standalone)
    passes = [CONE] * chosen.cones + [p for p in made.passes if p is not CONE]
    found = replace(made, given=given, scene=scene, marching=chosen, passes=passes, features=[])
    own = _marching_choices(made)
    found.choices = _marching_choices(found) | {n: why for n, why in made.choices.items() if n not in own}
    _describe_effects(found)
    found.warnings = _warnings(found, default_view(given))
    return found


def _marching_of(
    scene: Scene, operations: int, gathered: Gathered, closed: Analytic, size: tuple[int, int] | None, standalone: bool
) -> Marching:
    cells = bool(gathered.rows)
    marched = count_operations([closed.rest.body], turns=not cells) if closed.rest else operations
    far = not all(node.facts.bounded for node in (closed.marched if closed.used else [scene.node]))
    return marching.choose(scene, marched, size, standalone, cells, closed.used, far)


def _refuse_mixed(scene: Scene, standalone: bool) -> bool:
    """Whether a pixel shows many surfaces, by a lens or an open shutter. PlanError if they cannot be drawn."""
    found = {"aperture": scene.camera.lens, "shutter": scene.motion_blur}
    for name, used in found.items():
        if used and scene.quality.steps_per_pass is not None:
            what = f"Quality(steps_per_pass=...) marches one ray per pixel, and Camera({name}=...) needs many"
            raise PlanError(what, legal=f"steps_per_pass=None, or {name}=0", where=scene.camera.where)
    if found["shutter"] and standalone:
        what = "Camera(shutter=...): an exported shader draws one moment"
        raise PlanError(what, legal="shutter=0, or a picture or film by `raymarch render`", where=scene.camera.where)
    return any(found.values())


def _refuse_hidden_glass(scene: Scene, solid: Node) -> None:
    """PlanError for glass that rays which start at surfaces do not see: they would enter it and never leave it."""
    glass = any(m is not None and m.transmits for m in labels_hidden_from(solid, "reflection"))
    if glass and (scene.path_traced or scene.whitted):
        what = "visible(reflection=False) hides a part that transmits light: its refracted rays would not leave it"
        legal = "reflection=True for glass, or a scene without bounces"
        raise PlanError(what, legal=legal, where=hiding_nodes(solid)[0].where)


def _textures_of(made: Plan) -> list[Samples | Texels | Table]:
    """The pictures and sampled data that the field and the materials read, each once."""
    functions = (made.field, made.material, made.relief, made.emission, made.glass)
    roots = [root for function in functions if function is not None for root in function.inner]
    if any(p.shades for p in made.passes):
        roots.append(made.scene.sky.radiance)
    return list(dict.fromkeys(node.data for node in find(roots, "texture", "sample", "sample_slope", "fetch")))


def _choices_of(made: Plan, joint: bool) -> dict[str, str]:
    """The modules chosen where several define the same names, each with its reason."""
    scene, normals = made.scene, made.scene.quality.normals
    return {
        **_marching_choices(made),
        f"normal/{normals}": f"Quality(normals={normals!r})",
        **shading.choices(scene, made.model, joint),
        **joining(made.passes),
    }


def _marching_choices(made: Plan) -> dict[str, str]:
    solved = made.analytic.reason * made.analytic.used
    return marching.choices(made.scene, made.marching, made.epsilon, made.standalone, solved)


def _describe_effects(made: Plan) -> None:
    scene = made.scene

    def feature(name: str, used: bool, yes: str, no: str) -> None:
        made.features.append(Feature(name, used, yes if used else no))

    made.features += shading.features(scene)
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
        made.features.append(Feature(kind.LABEL, used is not None, reason, None if used is None else used.where))
    feature("geometry pass", geometry, "arrays besides colour were requested", "only the picture was requested")
    gathered = made.gathered
    counted = f"{gathered.data:,} object{'s' * (gathered.data != 1)}"
    if moving := sum(len(rows) for rows in gathered.rows if rows.live):
        counted += f", of which {moving:,} move"
    beside = f", {gathered.text} beside them as text" if gathered.text else ""
    feature("objects as data", bool(gathered.rows), f"{counted}{beside}: {gathered.reason}", gathered.reason)
    feature("closed-form hits", made.analytic.used, made.analytic.reason, made.analytic.reason)
    feature("bounding volumes", made.bounding.used, made.bounding.reason, made.bounding.reason)
    for found in made.located:
        cells = found.cells
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
    feature("anti-aliasing", quality.samples > 1, f"{quality.samples} rays per pixel", "one ray per pixel")
    temporal = quality.temporal != "off"
    kept = f"Quality(temporal={quality.temporal!r})" if temporal else "the samples of a pixel are averaged"
    feature("history textures", temporal or quality.samples > 1, kept, "no frames or samples are accumulated")
    made.features.sort(key=lambda f: not f.used)


def _warnings(made: Plan, view: DefaultView) -> list[str]:
    """Warnings about input that is legal but may not be intended."""
    scene, found = made.given, []
    if scene.node.facts.empty:
        found.append("the solid is empty: the bounding boxes of its operands do not overlap")
    if scene.node.exactness == "estimate":
        found.append("the field is an estimate: rays may miss surfaces")
    for node in all_nodes(scene.node)[1:]:
        if node.facts.empty and not any(child.facts.empty for child in node.children):
            place = f" at {node.where}" if node.where else ""
            found.append(f"{node.name}{place} is empty: the bounding boxes of its operands do not overlap")
    found += moved_otherwise(scene.node)
    found += misread(scene)
    return [*found, *unused(scene), *range_warning(view, made.origin, made.seen or made.field)]
