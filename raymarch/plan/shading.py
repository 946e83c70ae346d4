"""What the shading of a scene calls for, and the features of its lights, materials and sky."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from raymarch.errors import Location
from raymarch.plan import lights
from raymarch.prices import Prices
from raymarch.scene.bsdf import BSDF
from raymarch.scene.light import Light
from raymarch.scene.light_kinds import KINDS
from raymarch.scene.material import Material
from raymarch.scene.scene import Scene
from raymarch.scene.sky import Sky
from raymarch.scene.surfaces import bsdf_of
from raymarch.sdf.labels import seen_labels
from raymarch.sdf.node import Node
from raymarch.sdf.same import remembered


@dataclass(frozen=True, slots=True)
class Feature:
    """An effect, whether the scene uses it, and why.

    where : the user's line that calls for it, if there is one.
    """

    name: str
    used: bool
    reason: str
    where: Location | None = None


def needs_surface(scene: Scene) -> bool:
    """True if surfaces reflect light or emit a pattern, so that their normals and materials are needed."""
    return bool(scene.lights) or scene.sky.lights or scene.path_traced or scene.whitted or _emits_pattern(scene)


def with_gradient(scene: Scene) -> bool:
    """True if one function finds both gradient and material of a hit. Maps need the normal before the material."""
    return needs_surface(scene) and scene.quality.normals == "analytic" and not mapped(scene)


def mapped(scene: Scene) -> bool:
    """True if a material has a texture or a relief, so that it depends on the normal and the footprint."""
    return _mapped(scene.node)


@remembered
def _mapped(solid: Node) -> bool:
    return any(m is not None and (m.textured or m.relief) for m in seen_labels(solid))


def has_relief(scene: Scene) -> bool:
    """True if a material perturbs normals or dims ambient light."""
    return any(m.relief for m in scene.materials)


def patterned(scene: Scene) -> bool:
    """True if a material depends on the point. Materials are then evaluated just inside the solid."""
    return mapped(scene) or _patterned(scene.node)


@remembered
def _patterned(solid: Node) -> bool:
    return any(m is not None and m.patterned for m in seen_labels(solid))


def _emits_pattern(scene: Scene) -> bool:
    """True if emission depends on the point or the footprint, so that the normal of the surface is needed."""
    return any(m.emits and (m.textured or m.patterned) for m in scene.materials)


def lit(scene: Scene) -> bool:
    """True if any surface reflects or emits light."""
    return needs_surface(scene) or any(m.emits for m in scene.materials)


def ambient_sky(scene: Scene) -> bool:
    """True if the sky lights surfaces by its mean. In path tracing, paths that end in the sky add its light instead."""
    return scene.sky.lights and not scene.path_traced


def compensated(scene: Scene) -> bool:
    """True if some material may be metallic and multiple scattering between its microfacets is compensated."""
    metal = scene.quality.energy_compensation and any(m.metallic for m in scene.materials)
    return metal and (bool(scene.lights) or ambient_sky(scene) or scene.path_traced)


def occluded(scene: Scene, model: str) -> bool:
    """True if the scene has an AmbientOcclusion and ambient light."""
    return scene.occlusion is not None and ambient(scene, model)


def dims_ambient_light(scene: Scene) -> bool:
    """True if an AmbientOcclusion would dim light: of the sky, or the ambient term of Phong materials."""
    return ambient_sky(scene) or (bool(scene.lights) and not all(m.physical for m in scene.materials))


def ambient(scene: Scene, model: str) -> bool:
    """True if the scene has ambient light: from the sky, or from lights on Phong materials."""
    return ambient_sky(scene) or (bool(scene.lights) and model != "physical")


def features(scene: Scene, as_data: bool, prices: Prices) -> list[Feature]:
    """The features of lights, shadows, materials, sky and fog, used or not.

    as_data : whether lights are rows. prices : of the device.
    """
    return [*_of_lights(scene, as_data, prices), *_of_materials(scene), *_of_surroundings(scene)]


def feature(name: str, used: bool, yes: str, no: str, where: Location | None = None) -> Feature:
    """A feature with its reason: one why it is used, one why it is not."""
    return Feature(name, used, yes if used else no, where if used else None)


def _of_lights(scene: Scene, as_data: bool, prices: Prices) -> Iterator[Feature]:
    every = scene.lights

    def of(name: str, some: Sequence[Light], no: str, yes: str = "{} in the scene") -> Feature:
        return feature(name, bool(some), yes.format(len(some)), no, some[0].where if some else None)

    casts = f"{{}} of {len(every)} lights cast one"
    kinds: list[type[Light]] = [*KINDS, *(type(light) for light in every)]
    for kind in dict.fromkeys(kinds):
        yield of(kind.LABEL, [light for light in every if type(light) is kind], f"no {kind.__name__} in the scene")
    few = f"up to {prices.lights} lights are written as code"
    found_by = ", by cells that list those in range" if as_data and lights.in_cells(scene, prices) else ""
    yield feature("lights as data", as_data, f"{len(every)} lights in one loop{found_by}", few)
    yield of("hard shadows", [x for x in every if x.shadow and not x.soft], "no light has shadow=True", casts)
    yield of("soft shadows", [x for x in every if x.soft], "no light that casts a shadow has a softness", casts)
    yield of("visible lights", lights.visible(scene), "no light has visible=True")
    both = [x for x in every if lights.samples_of(scene, x) > scene.quality.light_samples]
    why = "no light with an area is sampled, or no lobe is narrow"
    yield of("multiple importance sampling", both, why, "{} lights are sampled by narrow lobes too")


def _of_materials(scene: Scene) -> Iterator[Feature]:
    others = scene.materials[1:]

    def of(name: str, holds: Callable[[Material], bool], yes: str, no: str, used: bool = True) -> Feature:
        """Something that a scene uses if it holds for one of its materials."""
        first = next((material for material in others if holds(material)), None)
        return feature(name, used and first is not None, yes, no, None if first is None else first.where)

    yield feature("materials", bool(others), f"{len(others)} besides the default", "no node has a material")
    yield of("microfacets", lambda m: m.physical, "a material is physical", "no material is physical")
    why = "Quality(energy_compensation=False)" if not scene.quality.energy_compensation else "metal receives no light"
    why = why if any(m.metallic for m in others) else "no material is a metal"
    yield of("multiple scattering", lambda m: m.metallic, "a material is a metal", why, compensated(scene))
    for layer in BSDF.__subclasses__():
        if layer.LABEL:
            used = any(isinstance(part, layer) for part in bsdf_of(others, scene.quality).layers)
            yield feature(layer.LABEL, used, "a material has one", "no material has one")
    why = "no material has a value that is a function of the position"
    yield of("patterns", lambda m: m.patterned, "a material has one", why)
    why = "no material has a texture or relief"
    yield of("maps", lambda m: bool(m.textured or m.relief), "a material has some", why)
    yield of("emission", lambda m: m.emits, "a material has one", "no material has one")
    yield feature("sky by direction", not scene.sky.constant, type(scene.sky).__name__, "the sky has one colour")
    yield of("glass", lambda m: m.transmits, "a material transmits light", "no material transmits light")
    why = "Quality(integrator='whitted') renders rough glass as smooth" if scene.whitted else "Scene has no bounces"
    why = why if any(m.frosted for m in others) else "no glass is rough"
    frosted = "a material is rough and transmits light"
    yield of("frosted glass", lambda m: m.frosted, frosted, why, scene.path_traced)


def _of_surroundings(scene: Scene) -> Iterator[Feature]:
    several = f"one random path of up to {scene.bounces} bounces per sample"
    if scene.whitted:
        several = f"all reflected and refracted rays of up to {scene.bounces} bounces"
    why = "Quality(integrator='whitted') finds no mirror and no glass" if scene.bounces else "Scene has no bounces"
    yield feature("bounces of light", scene.path_traced or scene.whitted, several, why)
    kind, light = type(scene.sky).__name__, scene.sky.light
    lit = f"{kind}(light={'True' if light is True else 'another sky' if isinstance(light, Sky) else 'a factor'})"
    yield feature("sky light", scene.sky.lights, lit, "the sky does not light surfaces")
    dimmed = scene.occlusion is not None and dims_ambient_light(scene)
    steps = scene.occlusion.steps if scene.occlusion is not None else 0
    why = "Scene has no occlusion" if scene.occlusion is None else "the scene has no ambient light"
    yield feature("ambient occlusion", dimmed, f"{steps} evaluations per hit", why)
    yield feature("fog", scene.fog is not None, "Scene(fog=...)", "Scene has no fog")
