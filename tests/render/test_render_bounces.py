"""Light that bounces: what must come out whatever the chance, as the mean over many samples."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.errors import SceneError
from raymarch.expr.vocabulary import abs as size
from raymarch.expr.vocabulary import vec3, where
from raymarch.gpu import Renderer
from raymarch.gpu.context import Context
from raymarch.plan import plan
from raymarch.shader import assemble
from raymarch.truth import silhouettes, truth

SIZE = (24, 18)


def mean(renderer: Renderer, node: rm.Node, samples: int = 64, **parts: object) -> np.ndarray:
    """Colours where the solid is hit, each the mean over the samples."""
    renderer.resize(SIZE)
    parts = {"lights": [], "sky": (1, 1, 1), "bounces": 1, **parts}
    scene = rm.Scene(node, quality=rm.Quality(samples=samples), **parts)  # type: ignore[arg-type]
    frame = renderer.render(scene)
    hit = np.isfinite(frame.depth)
    hit[1:-1, 1:-1] &= hit[2:, 1:-1] & hit[:-2, 1:-1] & hit[1:-1, 2:] & hit[1:-1, :-2]
    return frame.color[hit]


def test_a_plane_under_a_white_sky_has_its_albedo(renderer: Renderer) -> None:
    matte = rm.Material((0.6, 0.3, 0.2), specular=0, ambient=0)
    camera = rm.Camera((0, 5, 0.1), (0, 0, 0))
    found = mean(renderer, rm.plane().material(matte), camera=camera, samples=4)
    np.testing.assert_allclose(found, np.broadcast_to((0.6, 0.3, 0.2), found.shape), rtol=1e-5)


@pytest.mark.parametrize("metalness", [0.0, 1.0])
@pytest.mark.parametrize("roughness", [0.0, 0.4, 1.0])
def test_a_white_furnace_gets_back_no_more_than_it_gives(
    renderer: Renderer, metalness: float, roughness: float
) -> None:
    skin = rm.Material(albedo=(1, 1, 1), metalness=metalness, roughness=roughness)
    found = mean(renderer, rm.sphere().material(skin))
    assert found.mean() <= 1.005
    if metalness == 1.0 and roughness == 0.0:
        np.testing.assert_allclose(found, 1.0, atol=2e-3)  # a mirror loses nothing
    if metalness == 1.0:
        assert found.mean() >= 0.97


def test_metal_of_one_reflection_is_a_choice(renderer: Renderer) -> None:
    """It loses what its facets hide, as in Mitsuba."""
    skin = rm.Material(albedo=(1, 1, 1), metalness=1, roughness=1)
    renderer.resize(SIZE)
    quality = rm.Quality(samples=64, energy_compensation=False)
    frame = renderer.render(rm.Scene(rm.sphere().material(skin), lights=[], sky=(1, 1, 1), bounces=1, quality=quality))
    assert 0.3 < frame.color[np.isfinite(frame.depth)].mean() < 0.6


def test_no_metal_or_no_wish_is_no_text_of_it() -> None:
    """Also beside glass, which is no metal."""
    gold = rm.Material(albedo=(1, 0.8, 0.3), metalness=1)
    for material, parts, there in (
        (gold, {"bounces": 1}, True),
        (gold, {}, True),
        (gold, {"quality": rm.Quality(energy_compensation=False)}, False),
        (gold, {"lights": []}, False),
        (rm.Material(albedo=(1, 0.8, 0.3), roughness=1), {"bounces": 1}, False),
    ):
        scene = rm.Scene(rm.sphere().material(material), **parts)  # type: ignore[arg-type]
        assert ("missing_albedo" in assemble(plan(scene)).text()) == there


@pytest.mark.parametrize("count", [2, 12])
def test_rough_metal_gets_as_much_from_two_points_of_a_light_as_from_one(renderer: Renderer, count: int) -> None:
    """Also where lights are rows of a texture: with two points they left out what several facets mirror."""
    angles = np.linspace(0, 6, count)
    lights = [rm.Sun((np.cos(a), 1, np.sin(a)), shadow=True, softness=0.05, penumbra="sampled") for a in angles]
    metal = rm.Material(albedo=(1, 1, 1), metalness=1, roughness=1)
    scene = rm.Scene(rm.sphere().material(metal), rm.Camera((0, 0, 4), fov=40), lights, sky=(0, 0, 0))
    one, two = (
        renderer.render(scene.replace(quality=rm.Quality(light_samples=n, samples=4))).color.mean() for n in (1, 2)
    )
    assert abs(two / one - 1) < 0.02


def test_metal_answers_lights_alike_with_glass_in_the_scene(renderer: Renderer) -> None:
    """Glass beside it takes other code, for both integrator to follow the light, and where models mix."""
    gold = rm.Material(albedo=(1, 0.8, 0.3), metalness=1, roughness=1)
    away = rm.sphere(0.1).translate((40, 0, 0))
    matte = away.translate((0, 9, 0)).material(rm.Material((1, 0, 0)))
    glass = away.material(rm.Material(transmission=1.0))
    ball, camera, lights = rm.sphere().material(gold), rm.Camera((0, 0, 4), (0, 0, 0)), [rm.Sun((1, 1, 2))]
    renderer.resize(SIZE)

    def drawn(node: rm.Node, **parts: Any) -> np.ndarray:
        return renderer.render(rm.Scene(node, camera, lights, (0, 0, 0), **parts)).color

    known = drawn(ball)
    assert known.max() > 0.5
    for node in (ball | glass, ball | glass | matte, ball | matte):
        for integrator in ("path", "whitted"):
            found = drawn(node, bounces=2, quality=rm.Quality(integrator=integrator))
            np.testing.assert_allclose(found[6:12, 9:15], known[6:12, 9:15], rtol=2e-3, atol=1e-4)


def test_clear_glass_in_a_white_sky_is_not_seen(renderer: Renderer) -> None:
    glass = rm.Material(transmission=1.0, ior=1.5)
    found = mean(renderer, rm.sphere().material(glass), bounces=16, samples=32)
    assert abs(found.mean() - 1.0) < 0.005


@pytest.mark.parametrize("roughness", [0.05, 0.3, 0.7])
def test_frosted_glass_in_a_white_sky_gives_back_what_its_facets_do_not_hide(
    renderer: Renderer, roughness: float
) -> None:
    """A pane at right angles: of what comes in, only the light that other facets hide is lost."""
    glass = rm.Material(transmission=1.0, ior=1.5, roughness=roughness)
    camera = rm.Camera((0, 0, 6), (0, 0, 0), fov=10)
    found = mean(renderer, rm.box((4, 4, 0.4)).material(glass), camera=camera, bounces=16, samples=64).mean()
    kept = 1.0 - hidden(roughness**2)
    assert found <= 1.002
    assert found >= kept**4  # two faces, and what is mirrored between them meets them again


def hidden(alpha: float) -> float:
    """Mean share that facets hide of light that leaves a surface of GGX evenly, by Smith's term, in float64."""
    cosine = (np.arange(1000) + 0.5) / 1000
    g1 = 2 * cosine / (cosine + np.sqrt(alpha**2 + (1 - alpha**2) * cosine**2))
    return float(1.0 - np.mean(2 * cosine * g1))


def test_smooth_glass_is_the_limit_of_frosted(renderer: Renderer) -> None:
    """By the same random numbers: a roughness of a thousandth moves what is seen by less than the noise of a pixel."""
    sky = rm.GradientSky()
    clear, rough = (
        mean(renderer, rm.sphere().material(rm.Material(transmission=1.0, roughness=r)), bounces=8, sky=sky)
        for r in (0.0, 1e-3)
    )
    np.testing.assert_allclose(rough.mean(axis=0), clear.mean(axis=0), rtol=2e-3)


def test_a_lamp_shines_on_frosted_glass(renderer: Renderer) -> None:
    """As on a dielectric of the same index that is black inside."""
    lamp: dict[str, Any] = {"lights": [rm.Sun((0.2, 0.4, 1.0))], "sky": (0, 0, 0), "samples": 1}
    glass = rm.Material(transmission=1.0, ior=1.5, roughness=0.4)
    coat = rm.Material(albedo=(0, 0, 0), f0=0.04, roughness=0.4)
    seen, known = (mean(renderer, rm.sphere().material(skin), **lamp) for skin in (glass, coat))
    np.testing.assert_allclose(seen, known, atol=1e-5)
    assert known.max() > 0.1


def test_a_lamp_in_a_mirror_behind_frosted_glass_is_no_speck(renderer: Renderer) -> None:
    """A mirror gives back a point of light as a speck that chance finds too seldom; seen through what blurs, it is
    blurred. Facets of that width, alpha, seen at right angles send back 1 / (4 alpha^2) of a light."""
    renderer.resize((48, 36))
    pane = rm.box((6, 6, 0.1)).translate((0, 0, 2)).material(rm.Material(transmission=1.0, ior=1.2, roughness=0.5))
    mirror = rm.sphere().material(rm.Material(albedo=(1, 1, 1), metalness=1, roughness=0))
    scene = rm.Scene(
        pane | mirror, rm.Camera((0, 0, 5), (0, 0, 0)), [rm.Sun((0.2, 0.4, 1))], (0, 0, 0), bounces=6,
        quality=rm.Quality(samples=64),
    )  # fmt: skip
    found = renderer.render(scene).color
    assert found.mean() > 0.0 and found.max() < 1 / (4 * 0.5**4)


@pytest.mark.parametrize("roughness", [0.0, 1e-3])
def test_glass_absorbs_by_the_way_through_it(renderer: Renderer, roughness: float) -> None:
    """At an index of 1 the way is straight: exp(-absorption d) is left of what is behind."""
    ink = rm.Material(transmission=1.0, ior=1.0, absorption=(0.5, 1.0, 2.0), roughness=roughness)
    renderer.resize((201, 151))
    camera = rm.Camera((0, 0, 5), (0, 0, 0))
    scene = rm.Scene(rm.box((2, 2, 1.5)).material(ink), camera=camera, lights=[], sky=(1, 1, 1))
    assert scene.bounces == 6
    np.testing.assert_allclose(renderer.render(scene).color[75, 100], np.exp(-1.5 * np.array([0.5, 1, 2])), rtol=5e-3)


def test_all_light_is_mirrored_beyond_the_critical_angle(renderer: Renderer) -> None:
    """A cube of index 2 seen through one face shows no light of what is behind the faces beside it: they are
    mirrors."""
    renderer.resize((41, 31))
    cube = rm.box((2, 2, 2)).material(rm.Material(transmission=1.0, ior=2.0))
    camera = rm.Camera((0, 0, 4), (0, 0, 0), fov=24)
    only_beside = rm.Sky(lambda d: where(size(d.x) > 0.9, vec3(1.0), vec3(0.0)))
    frame = renderer.render(rm.Scene(cube, camera, [], only_beside, bounces=8, quality=rm.Quality(samples=32)))
    assert frame.color[13:18, 18:23].mean() < 0.02


def test_a_mirror_shows_the_scene(renderer: Renderer) -> None:
    mirror = rm.Material(albedo=(1, 1, 1), metalness=1, roughness=0)
    lamp = rm.Material(emission=(0, 3, 0))
    node = rm.plane().material(mirror) | rm.box((40, 2, 40)).translate((0, 6, 0)).material(lamp)
    camera = rm.Camera((0, 2, 4), (0, 0, 0), fov=20)
    found = mean(renderer, node, camera=camera, sky=(1, 0, 0), samples=1)
    np.testing.assert_allclose(found, np.broadcast_to((0, 3, 0), found.shape), atol=1e-2)


def test_more_samples_are_smoother_and_of_the_same_mean(renderer: Renderer) -> None:
    skin = rm.Material((0.8, 0.8, 0.8), specular=0, ambient=0)
    node = (rm.sphere() | rm.plane(offset=-1)).material(skin)
    few, many, known = (mean(renderer, node, samples=n, sky=rm.GradientSky()) for n in (2, 64, 1024))
    assert np.abs(few - known).mean() > 3 * np.abs(many - known).mean()
    assert abs(few.mean() - known.mean()) < 0.03 * known.mean()


def test_a_sampled_shadow_is_that_of_the_whole_disc(renderer: Renderer) -> None:
    """Also behind what is thin: held against even points of the disc in float64."""
    renderer.resize((40, 30))
    roof = rm.box((1.2, 0.02, 1.2)).translate((0, 0.8, 0))
    white = rm.Material((1, 1, 1), specular=0, ambient=0)
    scene = rm.Scene(
        (roof | rm.plane()).material(white),
        rm.Camera((0, 2.5, 3), (0, 0.2, 0)),
        [rm.SphereLight((0.3, 3, 0.2), 0.6, intensity=9, shadow=True, penumbra="sampled")],
        quality=rm.Quality(samples=256),
    )
    known = truth(scene, (40, 30))
    off = np.abs(renderer.render(scene).color - known.color).max(axis=-1)[~silhouettes(known, 2)]
    assert off.mean() < 0.01 and np.percentile(off, 95) < 0.05


def test_no_bounces_is_no_text_of_them() -> None:
    for scene in (rm.Scene(rm.sphere()), rm.Scene(rm.sphere(), bounces=0)):
        text = assemble(plan(scene)).text()
        assert "bounce" not in text and "random_of_pixel" not in text


@pytest.mark.parametrize("bounces", [-1, 17, 2.0, True])
def test_bounces_beyond_the_limit_are_refused(bounces: object) -> None:
    with pytest.raises(SceneError, match="bounces"):
        rm.Scene(rm.sphere(), bounces=bounces)  # type: ignore[arg-type]


@pytest.mark.parametrize("marched", [False, True])
@pytest.mark.parametrize(("albedo", "roughness", "ior"), [(0.5, 0.0, 1.5), (1.0, 0.0, 2.5), (0.5, 0.3, 1.5)])
def test_what_glass_stands_on_is_as_bright_as_below_a_film_of_air(
    egl: Context, albedo: float, roughness: float, ior: float, marched: bool
) -> None:
    """In a white sky. Paths that leave a face under glass meet the glass, not that face again, and those that leave the
    glass are refracted as by glass."""
    glass = rm.Material(transmission=1, roughness=roughness, ior=ior)
    grey = rm.Material(albedo=(albedo,) * 3, roughness=1, f0=0)

    def seen(gap: float) -> float:
        core = rm.sphere(0.5) if marched else rm.box((1, 1, 0.4)).translate((0, 0, -0.3))
        shell = rm.sphere(0.8) - rm.sphere(0.5 + gap) if marched else rm.box((1, 1, 0.4)).translate((0, 0, 0.1 + gap))
        sky, quality = rm.Sky((1, 1, 1), light=True), rm.Quality(samples=256)
        camera = rm.Camera((0, 0, 5), (0, 0, 0), fov=4)
        node = shell.material(glass) | core.material(grey)
        scene = rm.Scene(node, camera, lights=[], sky=sky, bounces=10, quality=quality)
        with rm.Renderer((6, 6), context=egl) as small:
            return float(small.render(scene).color.mean())

    assert seen(0.0) == pytest.approx(seen(1e-3), abs=0.02)
