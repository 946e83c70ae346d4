"""The stages of a plan: what is asked for, its field, its surfaces, its passes.

Each stage is a function of the results before it, and its result is complete when it is made. `Plan` is all results
together.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from raymarch.errors import PlanError
from raymarch.expr.derivative import companion
from raymarch.expr.function import Function
from raymarch.expr.node import Expr, var
from raymarch.expr.operations import operations as count_operations
from raymarch.expr.operations import reads, straight_lines
from raymarch.expr.types import FLOAT, VEC3, Type
from raymarch.plan import analytic, lights, marching, shading
from raymarch.plan.analytic import Analytic
from raymarch.plan.bounding import BoundedUnions
from raymarch.plan.device import DeviceClass
from raymarch.plan.gather import Gathered, Gatherer
from raymarch.plan.hoisting import Hoisting
from raymarch.plan.live_lights import LiveLights
from raymarch.plan.marching import Marching
from raymarch.plan.materials import Materials, materials_of
from raymarch.plan.motion import changes, motion_of
from raymarch.plan.objects import Located, ObjectsInCells
from raymarch.plan.passes import ATTACHMENTS, BEFORE, Pass, picture_passes, split_lights, with_cones
from raymarch.prices import STANDARD, Prices
from raymarch.scene.origin import DefaultView, default_view, origin_of, refuse_extent, seen_from
from raymarch.scene.reading import exact_distance, read_as_distance, reads_field
from raymarch.scene.scene import Scene
from raymarch.sdf.advance import Advancing
from raymarch.sdf.convexity import is_convex
from raymarch.sdf.levels import CORRECTED, least_slope, over_slope
from raymarch.sdf.lower import Lowering
from raymarch.sdf.node import Node
from raymarch.sdf.visibility import KINDS, hidden_from, hiding_nodes, labels_hidden_from

LARGEST = 1024
"""Largest number of shapes written as code. With more, compilers take many seconds or fail."""

Refuse: TypeAlias = Callable[[float, int, int], None]


# What is asked for


@dataclass(frozen=True, eq=False, kw_only=True)
class Asked:
    """What is asked for.

    given : the scene of the caller. view : its default view. origin : origin of the shader's coordinates in that
        scene, shape (3,), float64.
    scene : the scene relative to `origin`; all that is planned describes it.
    standalone : True for a shader that computes the values of a frame itself and marches no cones.
    pictures : the passes that are asked for, without cones, and before light is split.
    device : the class of devices that draw it.
    live : how the lights are drawn if they come and go. `scene` then has the lights of `given` and those kept.
    """

    given: Scene
    view: DefaultView
    origin: NDArray[np.float64]
    scene: Scene
    standalone: bool
    pictures: Sequence[Pass]
    device: DeviceClass
    live: LiveLights | None = None

    @property
    def prices(self) -> Prices:
        """The prices of that class or device."""
        return self.device.prices

    @property
    def shaded(self) -> bool:
        """True if surfaces reflect or emit light, and a pass draws it."""
        return shading.lit(self.scene) and any(p.shades for p in self.pictures)

    @property
    def geometry(self) -> bool:
        """True if a pass draws normals and indices of materials."""
        return any(p.surfaces for p in self.pictures)

    @property
    def bent(self) -> bool:
        """True if a pass draws normals with relief."""
        return any(p.bends for p in self.pictures)


def ask(
    scene: Scene, passes: Sequence[str], standalone: bool, device: DeviceClass, live: LiveLights | None = None
) -> Asked:
    """The scene relative to its origin, and the passes that draw it. PlanError if they cannot be combined."""
    view, origin, seen = relative(scene, live)
    mixed = _refuse_mixed(seen, standalone)
    post = () if standalone else seen.post
    pictures = picture_passes(passes, seen.quality, changes(seen), mixed, post)
    return Asked(
        given=scene,
        view=view,
        origin=origin,
        scene=seen,
        standalone=standalone,
        pictures=pictures,
        device=device,
        live=live,
    )


def relative(scene: Scene, live: LiveLights | None) -> tuple[DefaultView, NDArray[np.float64], Scene]:
    """The default view of a scene, the origin of the shader, and the scene relative to it, with all lights that its
    text draws."""
    view = default_view(scene)
    origin = origin_of(view)
    seen = seen_from(scene, origin)
    if live is not None and live.kept:
        seen = seen.replace(lights=(*seen.lights, *live.kept))
    read = read_as_distance(seen, seen.node)
    if read is not seen.node:
        seen = seen.replace(node=read)
    return view, origin, lights.with_discs(seen)


def _refuse_mixed(scene: Scene, standalone: bool) -> bool:
    """Whether a pixel shows many surfaces, by a lens or an open shutter. PlanError if they cannot be drawn."""
    found = {"aperture": scene.camera.lens, "shutter": scene.motion_blur}
    for name, used in found.items():
        if used and scene.quality.steps_per_pass is not None:
            what = f"Quality(steps_per_pass=...) marches one ray per pixel, and Camera({name}=...) needs many"
            raise PlanError(what, legal=f"steps_per_pass=None, or {name}=0", where=scene.camera.where)
    if scene.quality.edges == "distance":
        _refuse_edges(scene)
    if found["shutter"] and standalone:
        what = "Camera(shutter=...): an exported shader draws one moment"
        raise PlanError(what, legal="shutter=0, or a picture or film by `raymarch render`", where=scene.camera.where)
    return any(found.values())


def _refuse_edges(scene: Scene) -> None:
    """PlanError for a scene whose edges cannot be smoothed by distance: one whose pixels need many rays anyway, or
    whose field is no distance near the surface."""
    found = {
        "Camera(aperture=...)": scene.camera.lens,
        "Camera(shutter=...)": scene.motion_blur,
        "Scene(bounces=...)": scene.bouncing,
    }
    for name, used in found.items():
        if used:
            what = f"Quality(edges='distance') smooths the edges that one sharp ray meets, and {name} needs many rays"
            raise PlanError(what, legal="edges='samples', with Quality(samples=...)", where=scene.where)
    if not marching.trusted(scene):
        what = "Quality(edges='distance') reads how far an edge is from the field, and this field is an estimate"
        raise PlanError(what, legal="edges='samples', with Quality(samples=...)", where=scene.where)


# Objects


@dataclass(frozen=True, slots=True)
class ObjectPlan:
    """The objects that are rows. fewer : with the objects that are rows where text takes long to compile, if the plan
    may still choose these."""

    chosen: Gathered
    fewer: Gathered | None = None


def objects_of(asked: Asked, all_fixed: bool) -> ObjectPlan:
    """Choose the objects that are rows. all_fixed : they do not depend on the cost of their text."""
    scene, quality = asked.scene, asked.scene.quality
    live = not asked.standalone and quality.temporal != "reproject"  # motion vectors are computed for text
    gatherer = Gatherer(quality.objects, exact_distance(scene), live, asked.prices)
    chosen = gatherer.gather(scene.node)
    if all_fixed or chosen.rows or quality.objects != "auto":
        return ObjectPlan(chosen)
    fewer = gatherer.gather(scene.node, why="costly")
    costly = _costly(fewer, asked.prices.skip)
    total = sum(operations for _, operations in costly)
    if total < asked.prices.costly_objects or quality.bounding_volumes:
        return ObjectPlan(chosen, fewer if fewer.rows else None)
    prices, n = asked.prices, sum(count for count, _ in costly)
    each = f"{n} of them take {prices.skip:.0f} operations or more, {total:,} together"
    from_on = f"{prices.costly_objects:,.0f} on they are rows"
    shared = f"each of {len(costly)} forms" if len(costly) > 1 else "all"
    why = f"{each} (from {from_on}); text repeats them, rows share one function for {shared}"
    return ObjectPlan(replace(fewer, reason=why))


def _costly(gathered: Gathered, least: float) -> list[tuple[int, int]]:
    """Of each form whose objects take so many operations that text would give them bounding volumes: the number of
    objects, and their operations together."""
    each = [(len(f), count_operations([f.columns.field.body])) for rows in gathered.rows for f in rows.forms]
    return [(n, n * operations) for n, operations in each if operations >= least]


# The field


@dataclass(frozen=True, eq=False, kw_only=True)
class FieldPlan:
    """The field, and how it is evaluated.

    hoist : replaces the time-only expressions of the functions of a shader.
    seen : the field of camera rays, if parts are hidden from some kind of ray.
    hidden : the kinds of rays that parts are hidden from. If there are any, `field` reads the kind of the ray.
    gathered, located : the objects that are rows, and their cells.
    advancing : makes the function that tells how far a ray is free. With True, OnlyDistance is raised if a solid does
        not know more of that than its distance.
    operations : of one evaluation. shapes : number of distinct shapes written as code.
    """

    hoist: Hoisting
    field: Function
    seen: Function | None
    hidden: Sequence[str]
    bounding: BoundedUnions
    analytic: Analytic
    gathered: Gathered
    located: Sequence[Located]
    advancing: Callable[..., Function]
    operations: int
    shapes: int


def fields_of(
    asked: Asked, objects: ObjectPlan, lowering: Lowering | None, refuse: Refuse | None
) -> tuple[FieldPlan, Lowering]:
    """The field, and the pass over its nodes that others continue. PlanError if it is too large.

    refuse : see `plan`.
    """
    made = _Lowered(asked, objects.chosen, lowering)
    if objects.fewer is not None and made.seconds > asked.prices.slow_text:
        estimate = f"text is estimated to take {made.seconds:.0f} s to compile, more than {asked.prices.slow_text:.0f}"
        why = f"{estimate}; rows share one function for each form"
        made = _Lowered(asked, replace(objects.fewer, reason=why))
    lowering, hoist, field, gathered = made.lowering, made.hoist, made.field, made.gathered
    if len(lowering.shapes) > LARGEST:
        raise PlanError(
            f"the field has {len(lowering.shapes)} shapes, too many to compile as text",
            legal=f"up to {LARGEST} distinct shapes; objects of equal form can be data (docs/scale.md), "
            + "but those that move are text in exports, " * asked.standalone
            + "and `repeat` makes copies of one",
            where=asked.scene.node.where,
        )
    operations = count_operations([field.body], turns=not gathered.rows)
    if refuse is not None:
        refuse(made.seconds, operations, len(lowering.shapes))
    quality = asked.scene.quality
    solid, hidden, seen = gathered.node, made.hidden, None
    if hidden:
        _refuse_hidden_glass(asked.scene, solid)
        seen = hoist(lowering.for_camera().field(solid))
    smooth = quality.edges == "distance"
    closed = analytic.choose(solid, quality.analytic, bool(hidden), smooth, asked.prices)
    if closed.used:
        closed = analytic.complete(closed, solid, field, lowering, hoist)
    refuse_extent(asked.view, asked.origin, seen or field)
    found = FieldPlan(
        hoist=hoist,
        field=field,
        seen=seen,
        hidden=[kind for kind in KINDS if any(kind in hidden_from(node) for node in hidden)],
        bounding=made.bounding,
        analytic=closed,
        gathered=gathered,
        advancing=cache(partial(_advance_of, solid, closed, lowering, hoist)),
        located=[made.objects.located(rows) for rows in gathered.rows],
        operations=operations,
        shapes=len(lowering.shapes),
    )
    return found, lowering


def _advance_of(
    solid: Node, closed: Analytic, lowering: Lowering, hoist: Hoisting, wholly: bool, of: str = ""
) -> Function:
    """How far a ray through the marched solids is free, or through those "solved" in closed form, or in the "undivided"
    field of all."""
    if of:
        root = analytic.union_of(closed.solved, solid) if of == "solved" else solid
        return hoist(Advancing(lowering).function(root, f"{of}_advance", of == "undivided"))
    root = analytic.union_of(closed.marched, solid) if closed.used else solid
    return hoist(Advancing(lowering, wholly).function(root, "field_advance"))


class _Lowered:
    """The function of the field with some objects as rows, and what makes further functions of the same nodes."""

    def __init__(self, asked: Asked, gathered: Gathered, lowering: Lowering | None = None) -> None:
        self.gathered, self.lowering, self.prices = gathered, lowering or Lowering(), asked.prices
        self.objects = ObjectsInCells(gathered.rows, asked.prices, asked.device.branches)
        self.hidden = hiding_nodes(gathered.node)
        self.hoist = Hoisting(self.lowering.origins, asked.prices)
        self.bounding = BoundedUnions(asked.scene.quality.bounding_volumes, self.hoist, asked.prices)
        if gathered.rows:
            self.lowering.objects = self.objects
        self.lowering.rays = None if self.hidden else "camera"
        allowed = self.bounding.allowed(hidden=bool(self.hidden), rows=bool(gathered.rows))
        if allowed and self.lowering.sites is None:
            self.lowering.bounding = self.bounding
        self.field = self.hoist(self.lowering.field(gathered.node))

    @property
    def seconds(self) -> float:
        return compile_seconds(self.field, self.prices)


def compile_seconds(field: Function, prices: Prices = STANDARD) -> float:
    """Estimated seconds that a software renderer takes to compile a field and draw its first frame.

    Measured on llvmpipe: chains of 100, 200 and 1,000 smooth unions take 4.5, 16 and 346 s, polygons of 50 and 100
    corners 7 and 22 s. The time grows with the square of the operations in text without branches. 3,500 operations
    in bounding volumes, which are branches, take 6.5 s.
    """
    return sum(map(prices.seconds, straight_lines([field.body])))


def _refuse_hidden_glass(scene: Scene, solid: Node) -> None:
    """PlanError for glass that rays which start at surfaces do not see: they would enter it and never leave it."""
    glass = any(m is not None and m.transmits for m in labels_hidden_from(solid, "reflection"))
    if glass and (scene.path_traced or scene.whitted):
        what = "visible(reflection=False) hides a part that transmits light: its refracted rays would not leave it"
        legal = "reflection=True for glass, or a scene without bounces"
        raise PlanError(what, legal=legal, where=hiding_nodes(solid)[0].where)


# Surfaces


@dataclass(frozen=True, eq=False, kw_only=True)
class SurfacePlan(Materials):
    """The functions that passes evaluate at a hit, besides those of materials. Each is None if it is not needed.

    joint : True if one function finds both gradient and material.
    undivided : the field before it is divided, for effects that read distances; None if they read `field`.
    corrected : True if parts of it are divided by their slope, which is small.
    further : further functions of the point that modules call.
    twins : leaves whose current values the motion pass reads, by the name of their twin; see `raymarch.plan.motion`.
    """

    joint: bool
    gradient: Function | None
    undivided: Function | None
    corrected: bool
    further: Sequence[Function]
    twins: Mapping[str, Expr]


def surfaces_of(asked: Asked, fields: FieldPlan, lowering: Lowering) -> SurfacePlan:
    """The functions of normals, materials, distances and motion that the passes need."""
    scene, solid, hoist = asked.scene, fields.gathered.node, fields.hoist
    shaded, geometry, moving = asked.shaded, asked.geometry, BEFORE in asked.pictures
    further: list[Function] = []
    undivided, soft = None, any(map(reads_field, scene.lights))
    reads = shaded and (soft or scene.occlusion is not None)
    least = least_slope(solid, CORRECTED) if reads else 1.0
    if reads and (solid.facts.divided or least < 1.0):
        reading = lowering.again()
        if least < 1.0:
            reading = replace(reading, distances=over_slope(solid), _functions={})
        undivided = hoist(reading.field(solid, "undivided_field", undivided=True))
        r = var("r", FLOAT)
        slope = (solid.facts.undivided / solid.facts.lipschitz if solid.facts.divided else 1.0) / least
        further += [undivided, Function("divided", (r,), r / slope)] if soft else []
    joint = shading.with_gradient(scene) and shaded and lowering.sites is None
    needs_normal = (shaded and shading.needs_surface(scene) and not joint) or geometry or asked.bent or moving
    sliced = any(p.name == "slice" for p in asked.pictures)
    gradient = None
    if sliced or (needs_normal and scene.quality.normals == "analytic"):
        gradient = companion(fields.field)
    materials = Materials()
    if shaded or geometry or asked.bent:
        joined = fields.field if joint else None
        materials = materials_of(scene, solid, lowering, shaded, geometry, joined, hoist, asked.bent)
    twins: Mapping[str, Expr] = {}
    if moving:
        place, twins = motion_of(solid, lowering, hoist)
        further.append(place)
    return SurfacePlan(
        **vars(materials),
        joint=joint,
        gradient=gradient,
        undivided=undivided,
        corrected=least < 1.0,
        further=further,
        twins=twins,
    )


def kept_surface(asked: Asked, surfaces: Materials) -> list[tuple[str, Type]]:
    """What passes that add light read of a surface: its parts as GLSL text, and their types."""
    assert surfaces.material is not None
    material = surfaces.material.type
    material = dict(material.fields).get("material", material)
    found = [("surface.normal", VEC3), ("surface.t", FLOAT)]
    found += [(f"surface.material.{name}", type) for name, type in material.fields]
    if surfaces.relief is not None:
        found += [("surface.geometric_normal", VEC3), ("surface.ambient_visibility", FLOAT)]
    found += [("u_side", FLOAT)] if "OWN_START" in marching.variants_of(asked.scene) else []
    return found + ([("emitted", VEC3)] if surfaces.emission is not None else [])


# Passes


@dataclass(frozen=True, eq=False, kw_only=True)
class PassPlan:
    """The march of the rays, and all passes in drawing order."""

    marching: Marching
    passes: Sequence[Pass]


def drawn_of(asked: Asked, fields: FieldPlan, surfaces: Materials, size: tuple[int, int] | None) -> PassPlan:
    """The passes that draw what is asked for. size : of the picture, as for `plan`."""
    march, passes = marching_of(asked, fields, size), asked.pictures
    several = not asked.standalone and [p.name for p in passes if p.shades] == ["color"] and lights.split(asked.scene)
    if several and surfaces.material is not None:
        texels = 1 + max(k for k, _ in lights.layout([type for _, type in kept_surface(asked, surfaces)]))
        passes = split_lights(passes, texels) if texels <= ATTACHMENTS else passes
    return PassPlan(marching=march, passes=with_cones(passes, march.cones))


def marching_of(asked: Asked, fields: FieldPlan, size: tuple[int, int] | None) -> Marching:
    """The tracer and the cones of the marched solids."""
    closed, cells = fields.analytic, bool(fields.gathered.rows)
    marched = count_operations([closed.rest.body], turns=not cells) if closed.rest else fields.operations
    read = reads([(closed.rest or fields.field).body])
    bounded = [node.facts.bounded for node in (closed.marched if closed.used else [asked.scene.node])]
    beside = cells and closed.used and any(node.facts.bounded and is_convex(node) for node in closed.marched)
    ahead = fields.advancing if closed.marched or not closed.used else None
    given = asked.scene, marched, size, asked.standalone, cells, closed.used, not all(bounded), ahead
    return marching.choose(*given, read, beside, asked.prices)
