"""An option that has no effect in its scene is named; the same option where it has one is not."""

from __future__ import annotations

import pickle
from typing import Any

import pytest

import raymarch as rm
from raymarch.plan import plan
from raymarch.plan.unused import unused

MIRROR = rm.Material(metalness=1, roughness=0)
CHALK = rm.Material(albedo=(0.8, 0.8, 0.8), roughness=1)
GLASS = rm.Material(transmission=1)
WHITTED = rm.Quality(integrator="whitted")
GREY, LIT = rm.Sky((0.5, 0.5, 0.5)), rm.Sky((0.5, 0.5, 0.5), light=True)


def scene(material: rm.Material = CHALK, **given: Any) -> rm.Scene:
    return rm.Scene(rm.sphere().material(material), **given)


def sun(**given: Any) -> dict[str, Any]:
    return {"lights": [rm.Sun(**given)]}


CASES: dict[str, tuple[rm.Scene, rm.Scene]] = {
    "integrator='whitted') has no effect: no material is smooth": (
        scene(CHALK, quality=WHITTED),
        scene(MIRROR, quality=WHITTED),
    ),
    "Scene(bounces=2) has no effect with integrator='whitted': no material is smooth": (
        scene(CHALK, quality=WHITTED, bounces=2),
        scene(CHALK, bounces=2),
    ),
    "a Medium is not seen through glass": (
        scene(GLASS, sky=rm.GradientSky(), fog=rm.Medium(1.0, ((-1, -1, -1), (1, 1, 1))), bounces=2),
        scene(MIRROR, sky=rm.GradientSky(), fog=rm.Medium(1.0, ((-1, -1, -1), (1, 1, 1))), bounces=2),
    ),
    "no effect with bounces = 0": (scene(MIRROR, quality=WHITTED, bounces=0), scene(MIRROR, quality=WHITTED)),
    "a mirror shows nothing but lights": (scene(MIRROR, sky=GREY), scene(MIRROR, sky=LIT)),
    "draws rough glass clear": (
        scene(GLASS.replace(roughness=0.4), sky=rm.GradientSky(), quality=WHITTED),
        scene(GLASS.replace(roughness=0.4), sky=rm.GradientSky()),
    ),
    "Scene(occlusion=...) has no effect: no ambient light": (
        scene(occlusion=rm.AmbientOcclusion(), sky=GREY),
        scene(occlusion=rm.AmbientOcclusion(), sky=LIT),
    ),
    "path-traced light finds it by itself": (
        scene(occlusion=rm.AmbientOcclusion(), sky=LIT, bounces=1),
        scene(rm.Material(), occlusion=rm.AmbientOcclusion(), sky=LIT, bounces=1),
    ),
    "Sun(softness=...) has no effect without shadow=True": (
        scene(**sun(softness=0.1)),
        scene(**sun(softness=0.1, shadow=True)),
    ),
    "Sun(penumbra=...) has no effect without softness": (
        scene(**sun(penumbra="cone", shadow=True)),
        scene(**sun(penumbra="cone", shadow=True, softness=0.1)),
    ),
    "PointLight(shadow_radius=...) has no effect without shadow=True": (
        scene(lights=[rm.PointLight((0, 3, 0), shadow_radius=2)]),
        scene(lights=[rm.PointLight((0, 3, 0), shadow_radius=2, shadow=True)]),
    ),
    "Quality(shadow_steps=...) has no effect": (
        scene(quality=rm.Quality(shadow_steps=64)),
        scene(quality=rm.Quality(shadow_steps=64), **sun(shadow=True)),
    ),
    "Quality(light_samples=...) has no effect": (
        scene(quality=rm.Quality(light_samples=4), **sun(shadow=True, softness=0.1)),
        scene(quality=rm.Quality(light_samples=4), **sun(shadow=True, softness=0.1, penumbra="sampled")),
    ),
    "Camera(shutter=...) has no effect": (
        scene(camera=rm.Camera(shutter=0.1)),
        scene(camera=rm.Camera(shutter=0.1), **sun(sun_direction=(rm.time, 1, 0))),
    ),
    "Camera(focus=...) has no effect": (
        scene(camera=rm.Camera(focus=3)),
        scene(camera=rm.Camera(focus=3, aperture=0.1)),
    ),
    "Medium(density=0) is not seen": (
        scene(fog=rm.Medium(0, ((-1, -1, -1), (1, 1, 1)))),
        scene(fog=rm.Medium(1, ((-1, -1, -1), (1, 1, 1)))),
    ),
    "Fog(height=...) has no effect": (scene(fog=rm.Fog(height=1)), scene(fog=rm.Fog(height=1, falloff=1))),
    "Material(ior=...) has no effect without transmission": (
        scene(rm.Material(roughness=0.4, ior=1.3)),
        scene(rm.Material(transmission=1, ior=1.3), sky=rm.GradientSky()),
    ),
    "Material(absorption=...) has no effect": (
        scene(rm.Material(roughness=0.4, absorption=1)),
        scene(rm.Material(transmission=1, absorption=1), sky=rm.GradientSky()),
    ),
    "Material(clearcoat_roughness=...) has no effect without clearcoat": (
        scene(rm.Material(roughness=0.4, clearcoat_roughness=0.1)),
        scene(rm.Material(roughness=0.4, clearcoat_roughness=0.1, clearcoat=1)),
    ),
}


@pytest.mark.parametrize("words", CASES)
def test_an_option_without_effect_is_named(words: str) -> None:
    without, with_effect = CASES[words]
    (sentence,) = unused(without)
    assert words in sentence and unused(with_effect) == []


BALL, PEARL = rm.sphere().material(GLASS), rm.sphere(0.3).material(CHALK)
OUT = PEARL.translate((0.8, 0, 0))
SWALLOWED = {
    "a ball": (BALL | PEARL, (BALL - PEARL) | PEARL),
    "another glass": (BALL | rm.sphere(0.3).material(GLASS.replace(ior=1.2)), BALL | rm.sphere(0.3).material(GLASS)),
    "a moved union": ((BALL | PEARL).translate((1, 0, 0)), (BALL | PEARL.translate((1.4, 0, 0))).translate((1, 0, 0))),
    "a part of it": (BALL | OUT, (BALL - OUT) | OUT),
    "no material": (BALL | rm.sphere(0.3), (BALL | rm.sphere(0.3)).material(GLASS)),
    "a hollow": (BALL | PEARL, (BALL - rm.sphere(0.32)) | PEARL),
    "a chain": (rm.plane(offset=-1) | BALL | PEARL, rm.plane(offset=-1) | BALL | PEARL.translate((3, 0, 0))),
    "a floor": (rm.plane(offset=-0.9) | BALL, rm.plane(offset=-1) | BALL),
}


@pytest.mark.parametrize("name", SWALLOWED)
def test_a_solid_that_glass_hides_is_named(name: str) -> None:
    hidden, seen = (rm.Scene(node, sky=rm.GradientSky(), bounces=4) for node in SWALLOWED[name])
    (sentence,) = unused(hidden)
    partly = name in ("a part of it", "a floor")
    assert ("reaches into glass" if partly else "lies inside glass") in sentence
    assert unused(seen) == [] == unused(hidden.replace(bounces=0))


def test_a_sentence_has_the_line_of_the_part() -> None:
    light = rm.Sun(softness=0.1)
    (sentence,) = unused(rm.Scene(rm.sphere(), lights=[light, light]))
    assert sentence.startswith(f"{light.where}: Sun(softness=...)") and light.where is not None
    assert light.where.file == __file__


@pytest.mark.parametrize("words", CASES)
def test_a_doubt_is_a_sentence_of_its_parts(words: str) -> None:
    (doubt,) = unused(CASES[words][0])
    place = f"{doubt.where}: " if doubt.where is not None else ""
    assert doubt == place + doubt.what + (f" ({doubt.cure})" if doubt.cure else "")
    assert doubt.stage == "scene" and not doubt.what.endswith(")")
    read = pickle.loads(pickle.dumps(doubt))
    assert (read, vars(read)) == (doubt, vars(doubt))


def test_plans_and_pictures_tell() -> None:
    without = scene(occlusion=rm.AmbientOcclusion(), sky=GREY)
    assert plan(without).warnings == unused(without)
    with pytest.warns(UserWarning, match=r"Scene\(occlusion=...\) has no effect"):
        rm.render(without, size=(8, 8))


def test_whitted_mirrors_have_bounces_by_default() -> None:
    assert scene(MIRROR, quality=WHITTED).bounces == scene(GLASS, quality=WHITTED).bounces == 4
    assert scene(CHALK, quality=WHITTED).bounces == scene(MIRROR).bounces == 0
