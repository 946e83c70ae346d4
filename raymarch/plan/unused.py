"""What a scene asks for and its picture lacks: options that have no effect in the scene where they are given.

A request that the picture meets is none of them: `energy_compensation=False` without metal, or a tracer where no ray is
marched. Each rule yields the option with the reason and the cure.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from raymarch.errors import Doubt
from raymarch.expr.node import Expr
from raymarch.plan.shading import dims_ambient_light
from raymarch.scene.fields import SMOOTH
from raymarch.scene.fog import Fog
from raymarch.scene.light import Light, has_area
from raymarch.scene.light_kinds import PointLight, SphereLight, Sun
from raymarch.scene.material import Material
from raymarch.scene.medium import Medium
from raymarch.scene.parameter import is_zero
from raymarch.scene.scene import Scene
from raymarch.scene.surfaces import has_disc
from raymarch.sdf.labels import flattened, seen_labels
from raymarch.sdf.node import Node


def unused(scene: Scene) -> list[Doubt]:
    """A doubt for each option that has no effect, with the user's line where it is known."""
    return list(dict.fromkeys(doubt for rule in RULES for doubt in rule(scene)))


def _bounces(scene: Scene) -> Iterator[Doubt]:
    smooth = any(m.transmits or m.mirrors for m in scene.materials)
    if scene.quality.integrator == "whitted":
        if not smooth:
            what, cure = (
                "Quality(integrator='whitted') has no effect",
                "Material(metalness=1, roughness=0), or transmission=1",
            )
            if scene.bounces:  # with which paths bounce
                what = f"Scene(bounces={scene.bounces}) has no effect with integrator='whitted'"
                cure = f"integrator='path', {cure}"
            yield _doubt(f"{what}: no material is smooth", cure)
        elif not scene.bounces:
            yield _doubt(
                "Quality(integrator='whitted') has no effect with bounces = 0", "Scene(bounces=1) to 4, or None"
            )
    elif not scene.bounces and not scene.sky.lights:
        for m in scene.materials:
            if m.metallic and _constant(m.metalness) == 1.0 and (_constant(m.roughness) or 0.0) < SMOOTH and m.mirrors:
                cure = "Scene(bounces=2), or a sky with light=True"
                yield _doubt("a mirror shows nothing but lights", cure, m)
    if scene.whitted:
        for m in scene.materials:
            if m.frosted:
                yield _doubt("Quality(integrator='whitted') draws rough glass clear", "integrator='path'", m)


def _glass(scene: Scene) -> Iterator[Doubt]:
    labels = seen_labels(scene.node)
    if scene.sky.constant and labels and all(label is not None and label.transmits for label in labels):
        yield _doubt("glass shows what is behind it, and behind it is a sky of one colour", "GradientSky(), or a floor")


def _floor(scene: Scene) -> Iterator[Doubt]:
    parts = scene.node.children if scene.node.name == "union" else ()
    floor = any(part.facts.upper[1] < np.inf and not np.isfinite(part.facts.lower).any() for part in parts)
    for light in scene.lights:
        if floor and isinstance(light, Sun) and light.sun_direction.is_constant and light.sun_direction.data[1] < 0.0:
            y = float(light.sun_direction.data[1])
            what = f"Sun(sun_direction=...) shines from below the floor: its y is {y:.3g}; it points towards the sun"
            yield _doubt(what, "y > 0", light)


def _ambient(scene: Scene) -> Iterator[Doubt]:
    why, cure = (
        ("path-traced light finds it by itself", "")
        if scene.path_traced
        else ("no ambient light", "Sky(..., light=True)")
    )
    if scene.occlusion is not None and not dims_ambient_light(scene):
        yield _doubt(f"Scene(occlusion=...) has no effect: {why}", cure, scene.occlusion)


def _shadows(scene: Scene) -> Iterator[Doubt]:
    casting = [light for light in scene.lights if light.shadow]
    for light in scene.lights:
        name = type(light).__name__
        size = "radius" if isinstance(light, PointLight) else "softness"
        given = {size: not is_zero(light.softness) and not isinstance(light, SphereLight)}
        given |= {"penumbra": light.penumbra != "two-sided" and not has_area(light)}
        given |= {"shadow_radius": light.shadow_radius is not None}
        for option in (option for option, is_given in given.items() if is_given):
            if not light.shadow:
                yield _doubt(f"{name}({option}=...) has no effect without shadow=True", of=light)
            elif option == "penumbra" and not light.soft:
                yield _doubt(f"{name}(penumbra=...) has no effect without {size}", of=light)
    if scene.quality.shadow_steps is not None and not casting:
        yield _doubt("Quality(shadow_steps=...) has no effect: no light has shadow=True")
    if scene.quality.light_samples > 1 and not any(is_sampled(light, scene) for light in scene.lights):
        why = "no light has an area, no shadow has penumbra='sampled'"
        yield _doubt(f"Quality(light_samples=...) has no effect: {why}")


def _emissive_at_lights(scene: Scene) -> Iterator[Doubt]:
    """Emissive solids at the place of a light: they hide it, or light the scene a second time."""
    areas = [light for light in scene.lights if "visible" in light.arguments() and not light.visible]
    areas = [light for light in areas if light.has_position and light.arguments()["position"].is_constant]
    if not areas or not any(m.emits for m in scene.materials):
        return
    for solid, label in (each for operands in _unions(scene.node) for each in operands):
        if solid.facts.bounded and any(isinstance(m, Material) and m.emits for m in seen_labels(solid) or {label}):
            for light in areas:
                if solid.distance(light.arguments()["position"].data[None])[0] <= 0.0:
                    name = type(light).__name__
                    cure = f"{name}(visible=True) needs none"
                    yield _doubt(f"an emissive solid is at the place of a {name}", cure, light)


def _camera(scene: Scene) -> Iterator[Doubt]:
    camera = scene.camera
    if camera.opens and not scene.motion_blur:
        yield _doubt("Camera(shutter=...) has no effect: nothing in the scene reads rm.time", of=camera)
    if camera.focus is not None and not camera.lens:
        yield _doubt("Camera(focus=...) has no effect without an aperture", of=camera)


def _fog(scene: Scene) -> Iterator[Doubt]:
    if isinstance(scene.fog, Fog) and not is_zero(scene.fog.height) and not scene.fog.layered:
        yield _doubt("Fog(height=...) has no effect without a falloff", of=scene.fog)
    if isinstance(scene.fog, Medium) and isinstance(scene.fog.density, Expr) and is_zero(scene.fog.density):
        yield _doubt("Medium(density=0) is not seen", of=scene.fog)
    elif isinstance(scene.fog, Medium) and scene.bounces and any(m.transmits for m in scene.materials):
        cure = "take the glass out of the way: only the ray from the camera to the first surface passes it"
        yield _doubt("a Medium is not seen through glass", cure, scene.fog)


def _materials(scene: Scene) -> Iterator[Doubt]:
    for material in scene.materials:
        given = material.arguments()
        needed: dict[str, tuple[bool, str]] = {
            "ior": (material.transmits, "transmission"),
            "absorption": (material.transmits, "transmission"),
            "clearcoat_roughness": (material.coated, "clearcoat"),
            "subsurface_radius": (material.scatters, "subsurface"),
            "subsurface_color": (material.scatters, "subsurface"),
        }
        if material.scatters and not scene.path_traced:
            cure = "Scene(bounces=2) with Quality(integrator='path') scatters light below the surface"
            yield _doubt("Material(subsurface=...) is diffuse reflection without path-traced light", cure, material)
        for option, (used, other) in needed.items():
            if given[option] is not None and not used:
                yield _doubt(f"Material({option}=...) has no effect without {other}", of=material)


def _inside_glass(scene: Scene) -> Iterator[Doubt]:
    """Solids that a union with glass hides: it is one solid, and rays in glass meet its surface only."""
    if not scene.bounces or not any(m.transmits for m in scene.materials):
        return
    for operands in _unions(scene.node):
        labels = [seen_labels(solid) or {label} for solid, label in operands]
        lower, upper = (np.array(ends) for ends in zip(*(solid.bounds for solid, _ in operands), strict=True))
        clear = np.array([all(isinstance(m, Material) and m.transmits for m in made_of) for made_of in labels])
        for i, made_of in enumerate(labels):
            if clear[i]:
                held = np.all((lower[i] <= lower) & (upper <= upper[i]), axis=1)
                near = np.nonzero(held | ~clear & np.all((lower[i] < upper) & (lower < upper[i]), axis=1))[0]
                for j in [j for j in near.tolist() if not labels[j] <= made_of][:OVERLAPS]:
                    solid = operands[j][0]
                    if hidden := _hidden(solid, operands[i][0]):
                        yield _doubt(hidden, "(glass - solid) | solid, with a film of air between them", solid)


def _unions(root: Node) -> Iterator[list[tuple[Node, Any]]]:
    """The operands of the hard unions of a tree, each with the label that it inherits."""
    visited: set[tuple[Node, Any]] = set()
    pending: list[tuple[Node, Any]] = [(root, None)]
    while pending:
        node, label = each = pending.pop()
        if each in visited:
            continue
        visited.add(each)
        union = node.placed_as == "union"
        inherited = label if node.label is None else node.label
        children = [(child, inherited) for child in (flattened(node) if union else node.children)]
        if union:
            yield children
        pending += children


OVERLAPS = 64
"""Solids beside a glass that are asked whether they reach into it."""


def _hidden(solid: Node, glass: Node) -> str:
    """What a union of a solid with glass hides; empty if the solid is nowhere deeper in the glass than a thousandth of
    their common box. Points in boxes tell, at the defaults of parameters."""
    low, high = np.maximum(solid.bounds[0], glass.bounds[0]), np.minimum(solid.bounds[1], glass.bounds[1])
    if not np.all(np.isfinite([low, high])):
        return ""
    unit, deep = np.random.default_rng(1).uniform(size=(1024, 3)), 1e-3 * float(np.linalg.norm(high - low))
    points = low + (high - low) * unit
    if not np.any(np.maximum(solid.distance(points), glass.distance(points)) < -deep):
        return ""
    if solid.facts.bounded:
        points = solid.bounds[0] + (solid.bounds[1] - solid.bounds[0]) * unit
        if np.all(glass.distance(points[solid.distance(points) < 0.0]) < 0.0):
            return "a solid lies inside glass, in a union with it, and is not visible"
    return "a solid reaches into glass, in a union with it, and is not visible there"


RULES: tuple[Callable[[Scene], Iterator[Doubt]], ...] = (
    _bounces,
    _ambient,
    _shadows,
    _emissive_at_lights,
    _camera,
    _fog,
    _materials,
    _inside_glass,
    _glass,
    _floor,
)
"""The rules, by the parts of a scene."""


def _doubt(what: str, cure: str = "", of: Material | Light | object = None) -> Doubt:
    return Doubt("scene", what, cure, getattr(of, "where", None))


def is_sampled(light: Light, scene: Scene) -> bool:
    """True if random points of a light give its light or its shadow."""
    return has_area(light) or has_disc(light, scene.materials, scene.bouncing)


def _constant(value: Expr) -> float | None:
    return float(value.data) if value.is_constant else None
