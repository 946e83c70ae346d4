"""What the look of a scene calls for: which modules shade it, and what `explain` says of it."""

from __future__ import annotations

from collections.abc import Sequence

from raymarch.errors import Location
from raymarch.plan import lights
from raymarch.plan.feature import Feature
from raymarch.scene.light import Light, PointLight, SphereLight, SpotLight, Sun
from raymarch.scene.material import Material
from raymarch.scene.scene import Scene

MODULES = {
    "sun": ("light/sun", "a light from infinitely far away"),
    "point": ("light/point", "a light falls off with the inverse square of the distance"),
    "attenuated": ("light/attenuated", "a light has an attenuation of its own"),
    "window": ("light/window", "a light has a range"),
    "fade": ("light/fade", "a light with an attenuation has a range"),
    "spot": ("light/spot", "a light shines into a cone"),
    "hard": ("light/shadow", "a light casts a hard shadow"),
    "two-sided": ("light/two_sided", "a light casts a soft shadow"),
    "cone": ("light/cone", "a light casts a soft shadow by its cone"),
    "triangulated": ("light/triangulated", "a light casts a triangulated soft shadow"),
    "sampled": ("light/sample_disc", "a light casts the shadows of its points, one a sample"),
}
"""The module that each trait of lights calls for, and why."""

SOFT = ("two-sided", "cone", "triangulated")


def surfaced(scene: Scene) -> bool:
    """True if light from elsewhere falls on surfaces, so that their normals and materials count."""
    return bool(scene.lights) or scene.sky.light or scene.path_traced or scene.whitted or _glows_by_pattern(scene)


def mapped(scene: Scene) -> bool:
    """True if a look depends on how the surface is seen: some material has a texture, or bends its normal."""
    return any(m.textured or m.relief for m in scene.materials)


def patterned(scene: Scene) -> bool:
    """True if a look depends on the point where it is asked, which is then just inside the solid."""
    return mapped(scene) or any(m.patterned for m in scene.materials)


def _glows_by_pattern(scene: Scene) -> bool:
    """True if what is given off depends on the point, or on how it is seen: it takes the normal of the surface."""
    return any(m.emits and (m.textured or m.patterned) for m in scene.materials)


def lit(scene: Scene) -> bool:
    """True if light falls on any surface, or comes from one."""
    return surfaced(scene) or any(m.emits for m in scene.materials)


def ambient_sky(scene: Scene) -> bool:
    """True if the sky lights surfaces by its mean; where light path_traced, ways that end in the sky bring its light."""
    return scene.sky.light and not scene.path_traced


def compensated(scene: Scene) -> bool:
    """True if there may be metal, which gives back the light that several of its facets mirror."""
    metal = scene.quality.energy_compensation and any(m.metallic for m in scene.materials)
    return metal and (bool(scene.lights) or ambient_sky(scene) or scene.path_traced)


def occluded(scene: Scene, model: str) -> bool:
    """True if there is ambient light for an AmbientOcclusion to dim."""
    return scene.occlusion is not None and ambient(scene, model)


def ambient(scene: Scene, model: str) -> bool:
    """True if some light comes from nowhere in particular."""
    return ambient_sky(scene) or (bool(scene.lights) and model != "physical")


def modules(scene: Scene, model: str | None, colored: bool) -> list[tuple[str, str]]:
    """The modules that shade, each with its reason.

    model : how surfaces are lit, None if they are not. colored : a picture is drawn, lit or not.
    """
    found: list[tuple[str, str]] = []
    if model is not None and surfaced(scene):
        found.append((f"material/{model}", "light shades materials"))
        found += _surfaces(scene)
        if scene.lights:
            found += _answers(scene, model)
        for trait in sorted(lights.traits(scene), key=list(MODULES).index):
            name, why = MODULES[trait]
            first = next((light for light in scene.lights if trait in lights.traits_of(light)), None)
            found.append((name, f"{why}: {type(first).__name__} at {first.where}" if first else why))
        if ambient_sky(scene):
            found += _from_sky(scene, model)
        if any(light.shadow for light in scene.lights):
            found += [("light/spawn_ray", "a light casts a shadow"), _outward(scene)]
        if "sampled" in lights.traits(scene):
            found.append(("random/pixel", "a point of a light is chosen at random"))
            found += [("light/shadow", "the shadow of a point")] if "hard" not in lights.traits(scene) else []
        if compensated(scene):
            found += _several(scene)
        if scene.path_traced or scene.whitted:
            found += _ways(scene, model) if scene.path_traced else _tree(scene, model)
        if occluded(scene, model):
            found.append(("light/ambient_occlusion", "Scene(occlusion=...)"))
    if colored:
        if scene.sky.constant:
            found.append(("sky/constant", "what is seen where nothing is hit"))
        if scene.fog is not None:
            found.append(("sky/fog", "Scene(fog=...)"))
    reasons: dict[str, str] = {}
    for name, why in found:
        reasons.setdefault(name, why)
    return list(reasons.items())


def _surfaces(scene: Scene) -> list[tuple[str, str]]:
    """The modules that find the material of a hit."""
    if mapped(scene):
        why = "a material has a texture or relief"
        return [("material/relief", why), ("light/inner", why), ("light/mapped", why)]
    if patterned(scene):
        why = "a material is a function of the point"
        return [("light/inner", why), ("light/patterned", why)]
    return [("light/light", "light shades materials")]


def _outward(scene: Scene) -> tuple[str, str]:
    """The module that knows the side on which rays leave a surface."""
    return (
        "light/geometric_normal_mapped" if mapped(scene) else "light/geometric_normal",
        "rays leave along the normal of the solid",
    )


def _answers(scene: Scene, model: str) -> list[tuple[str, str]]:
    """The modules by which surfaces answer a light."""
    found = []
    if model != "physical":
        found.append(("light/phong", "a material is shaded after Phong"))
    if model != "phong":
        found += [
            ("light/fresnel", "a material is physical"),
            ("light/d_ggx", "a material is physical"),
            _by_masking(scene, "light/{}"),
            ("light/albedo_f90", "a material is physical"),
            ("light/interface_transmittance", "a material is physical"),
            ("light/physical", "a material is physical"),
        ]
    if model == "mixed":
        glass = (scene.path_traced or scene.whitted) and any(m.transmits for m in scene.materials)
        name = "light/mixed_dielectric" if glass else "light/mixed"
        found.append((name, "some materials are physical and some after Phong"))
    return found


def _by_masking(scene: Scene, name: str) -> tuple[str, str]:
    """The module of a name that has one for each masking."""
    masking = scene.quality.masking
    return name.format(masking), f"Quality(masking={masking!r})"


def _several(scene: Scene) -> list[tuple[str, str]]:
    """The modules by which metals give back what several facets mirror."""
    why = "a material is a metal"
    found = [_by_masking(scene, f"light/{name}") for name in ("missing_{}", "missing_mean_{}")]
    found.append(("light/multiscatter_albedo", why))
    return [*found, ("light/multiscatter", why)] if scene.lights else found


def _ways(scene: Scene, model: str) -> list[tuple[str, str]]:
    """The modules by which light bounces."""
    why = f"Scene(bounces={scene.bounces})"
    found = [("path/secondary", why), ("light/spawn_ray", why), ("path/lobes", why), ("random/pixel", why)]
    found += [_outward(scene)] if mapped(scene) else []
    if model != "physical":
        found.append(("path/diffuse", why))
    if model != "phong":
        physical = ("light/fresnel", "light/albedo_f90", "light/interface_transmittance")
        found += [*((name, "a material is physical") for name in physical), _by_masking(scene, "light/{}")]
        found.append(("path/glossy", why))
        found += [("path/metal", "a material is a metal")] if compensated(scene) else []
    if any(m.transmits for m in scene.materials):
        found += _glass(scene)
    if any(m.frosted for m in scene.materials):
        found.append(("path/rough_dielectric", "glass is rough"))
    return found


def _glass(scene: Scene) -> list[tuple[str, str]]:
    """The modules of what transmits."""
    lights = [("path/dielectric", "lights shine on glass")] if scene.lights else []
    return [("path/fresnel_dielectric", "a material transmits light"), *lights]


def _tree(scene: Scene, model: str) -> list[tuple[str, str]]:
    """The modules by which all ways of mirrors and glass are followed."""
    why = "Quality(integrator='whitted')"
    found = [("path/secondary", why), ("light/spawn_ray", why), ("path/cutoff", why)]
    found += [_outward(scene)] if mapped(scene) else []
    if any(m.mirrors for m in scene.materials):
        found += [("light/fresnel", "a material mirrors"), ("path/mirror", "a material mirrors")]
    if any(m.transmits for m in scene.materials):
        found += [*_glass(scene), ("path/branch", "glass parts the light's way in two")]
    return found


def _from_sky(scene: Scene, model: str) -> list[tuple[str, str]]:
    """The modules by which surfaces answer the sky."""
    why = f"{type(scene.sky).__name__}(light=True)"
    found = [("sky/mean", why)]
    if model != "physical":
        found.append(("sky/diffuse", why))
    if model != "phong":
        found += [("light/albedo_f90", "a material is physical"), _by_masking(scene, "light/missing_{}")]
        found += [("light/directional_albedo", why), ("sky/specular", why)]
    return found


def features(scene: Scene) -> list[Feature]:
    """What there is of lights, shadows, materials and fog, used or not."""
    found: list[Feature] = []

    def feature(name: str, used: bool, yes: str, no: str, where_: Location | None = None) -> None:
        found.append(Feature(name, used, yes if used else no, where_ if used else None))

    def of_lights(name: str, some: Sequence[Light], no: str, yes: str = "{} in the scene") -> None:
        feature(name, bool(some), yes.format(len(some)), no, some[0].where if some else None)

    every = scene.lights
    casts = f"{{}} of {len(every)} lights cast one"
    of_lights("sun light", [x for x in every if isinstance(x, Sun)], "no Sun in the scene")
    plain = [x for x in every if isinstance(x, PointLight) and not isinstance(x, SpotLight | SphereLight)]
    of_lights("point lights", plain, "no PointLight in the scene")
    of_lights("spot lights", [x for x in every if isinstance(x, SpotLight)], "no SpotLight in the scene")
    of_lights("sphere lights", [x for x in every if isinstance(x, SphereLight)], "no SphereLight in the scene")
    few = f"up to {lights.AS_TEXT} lights are written out"
    feature("lights as data", lights.as_data(scene), f"{len(every)} lights in one loop", few)
    of_lights("hard shadows", [x for x in every if x.shadow and not x.soft], "no light has shadow=True", casts)
    of_lights("soft shadows", [x for x in every if x.soft], "no light with a shadow has a softness", casts)
    others = scene.materials[1:]
    feature("materials", bool(others), f"{len(others)} besides the default", "no node has a material")
    real = next((m for m in others if m.physical), None)
    feature("microfacets", real is not None, "a material is physical", "no material is physical", _place(real))
    metal = next((m for m in others if m.metallic), None)
    why = "Quality(energy_compensation=False)" if not scene.quality.energy_compensation else "no light falls on metal"
    why = "no material is a metal" if metal is None else why
    feature("light between facets", compensated(scene), "a material is a metal", why, _place(metal))
    patterned = next((m for m in others if m.patterned), None)
    why = "no value of a material is a function of the position"
    feature("patterns", patterned is not None, "a material has one", why, _place(patterned))
    own = next((m for m in others if m.textured or m.relief), None)
    why = "no material has a texture or relief"
    feature("maps", own is not None, "a material has some", why, _place(own))
    glowing = next((m for m in others if m.emits), None)
    feature("emission", glowing is not None, "a material has one", "no material has one", _place(glowing))
    feature("sky by direction", not scene.sky.constant, type(scene.sky).__name__, "the sky has one colour")
    bent = next((m for m in others if m.transmits), None)
    feature("glass", bent is not None, "a material transmits light", "no material transmits light", _place(bent))
    rough = next((m for m in others if m.frosted), None)
    why = "Quality(integrator='whitted') shows rough glass as clear" if scene.whitted else "Scene has no bounces"
    why = "no glass is rough" if rough is None else why
    used = rough is not None and scene.path_traced
    feature("frosted glass", used, "a material is rough, and transmits", why, _place(rough))
    several = f"one way of up to {scene.bounces} more surfaces for each sample"
    if scene.whitted:
        several = f"all ways of mirrors and glass to up to {scene.bounces} more surfaces"
    why = "nothing mirrors or transmits, for Quality(integrator='whitted')" if scene.bounces else "Scene has no bounces"
    feature("bounces of light", scene.path_traced or scene.whitted, several, why)
    feature("sky light", scene.sky.light, f"{type(scene.sky).__name__}(light=True)", "the sky lights nothing")
    shares = bool(every) and not all(m.physical for m in scene.materials)
    dimmed = scene.occlusion is not None and (ambient_sky(scene) or shares)
    steps = scene.occlusion.steps if scene.occlusion is not None else 0
    why = "Scene has no occlusion" if scene.occlusion is None else "there is no ambient light to keep out"
    feature("ambient occlusion", dimmed, f"{steps} evaluations a hit", why)
    feature("fog", scene.fog is not None, "Scene(fog=...)", "Scene has no fog")
    return found


def _place(material: Material | None) -> Location | None:
    return None if material is None else material.where
