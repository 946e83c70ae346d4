"""The light of a sky apart from its picture: closed forms, and the pictures of the two skies."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.gpu.prepare import prepare
from raymarch.truth import truth
from tests.support.refusals import refused

SIZE = (48, 32)
STUDIO = rm.Sky(lambda d: rm.mix(rm.vec3(0.1, 0.15, 0.2), rm.vec3(1.5, 1.2, 0.9), rm.smoothstep(0.0, 0.9, d.y)))
WAYS: dict[str, dict[str, Any]] = {
    "ambient": {"bounces": 0},
    "whitted": {"bounces": 2, "quality": rm.Quality(integrator="whitted")},
    "path": {"bounces": 2, "quality": rm.Quality(samples=4)},
}


def scene(sky: rm.Sky, **more: Any) -> rm.Scene:
    """A matte, a mirroring and, where rays bounce, a glass ball on a floor, under the sky alone."""
    glass = {"transmission": 1.0, "ior": 1.5} if more.get("bounces") else {"roughness": 0.5}
    skins = [{"roughness": 0.8}, {"metalness": 1.0, "roughness": 0.05}, glass]
    balls = [
        rm.sphere(0.8).translate((2 * i - 2, 0.8, 0)).material(rm.Material(albedo=(0.9, 0.6, 0.4), **skin))
        for i, skin in enumerate(skins)
    ]
    floor = rm.plane().material(rm.Material(albedo=(0.5, 0.5, 0.5), roughness=0.9))
    return rm.Scene(rm.union(*balls, floor), rm.Camera((0, 2, 7), (0, 0.8, 0)), lights=[], sky=sky, **more)


@pytest.mark.parametrize("way", WAYS)
def test_a_plane_under_a_uniform_light_has_its_albedo_times_it(way: str) -> None:
    """The irradiance of a uniform sky is pi times its radiance L, and the radiance of a diffuse plane albedo times L;
    whatever the sky looks like."""
    floor = rm.plane().material(rm.Material((0.6, 0.3, 0.2), specular=0.0, ambient=0.0))
    for light, radiance in ((rm.Sky((0.5, 0.8, 1.1)), (0.5, 0.8, 1.1)), (0.25, (0.25, 0.05, 0.025))):
        sky = rm.Sky((1.0, 0.2, 0.1), light=light)
        made = rm.Scene(floor, rm.Camera((0, 1, 3), (0, 0.8, 0)), lights=[], sky=sky, **WAYS[way])
        with rm.Renderer(SIZE) as renderer:
            found = renderer.render(made, outputs=("color", "depth"))
        hit, out = _all_near(np.isfinite(found.depth)), _all_near(~np.isfinite(found.depth))
        assert min(np.mean(hit), np.mean(out)) > 0.05
        wanted = np.array(radiance) * (0.6, 0.3, 0.2)
        np.testing.assert_allclose(found.color[hit], np.broadcast_to(wanted, (hit.sum(), 3)), rtol=3e-3)
        np.testing.assert_allclose(found.color[out], np.broadcast_to((1.0, 0.2, 0.1), (out.sum(), 3)), rtol=1e-6)


@pytest.mark.parametrize("way", WAYS)
def test_surfaces_are_those_under_the_light_and_the_rest_is_the_picture(way: str) -> None:
    """Camera rays see the sky itself; reflections, refractions and paths see the light."""
    picture = rm.GradientSky()
    with rm.Renderer(SIZE) as renderer:
        both, lit, seen = (
            renderer.render(scene(sky, **WAYS[way]), outputs=("color", "depth"))
            for sky in (picture.replace(light=STUDIO), STUDIO.replace(light=True), picture.replace(light=True))
        )
    edge = np.isfinite(both.depth)
    inside, outside = (_all_near(hit) for hit in (edge, ~edge))
    assert np.mean(inside) > 0.3 and np.mean(outside) > 0.03
    np.testing.assert_allclose(both.color[inside], lit.color[inside], atol=1e-6)
    np.testing.assert_allclose(both.color[outside], seen.color[outside], atol=1e-6)
    assert np.abs(lit.color[inside] - seen.color[inside]).mean() > 0.05


def _all_near(hit: np.ndarray) -> np.ndarray:
    """Pixels that are hit with all around them: samples of a pixel differ at its edges."""
    wide = np.pad(hit, 1, "edge")
    rows, columns = hit.shape
    return np.all([wide[i : i + rows, j : j + columns] for i in range(3) for j in range(3)], axis=0)


@pytest.mark.parametrize("way", WAYS)
def test_a_factor_multiplies_the_light_alone(way: str) -> None:
    dim = rm.Param("dim", 0.3, 0.0, 2.0)
    with rm.Renderer(SIZE) as renderer:
        whole = renderer.render(scene(STUDIO.replace(light=True), **WAYS[way]), outputs=("color", "depth"))
        part = renderer.render(scene(STUDIO.replace(light=0.3), **WAYS[way])).color
        set_to = renderer.render(scene(STUDIO.replace(light=dim), **WAYS[way]), params={"dim": 0.3}).color
        none = renderer.render(scene(STUDIO.replace(light=dim), **WAYS[way]), params={"dim": 0.0}).color
    hit = _all_near(np.isfinite(whole.depth))
    np.testing.assert_allclose(part[hit], 0.3 * whole.color[hit], rtol=2e-4, atol=1e-6)
    np.testing.assert_allclose(set_to, part, atol=1e-6)
    assert np.all(none[hit] == 0.0) and np.any(none[~hit] > 0.1)


@pytest.mark.parametrize("way", ["ambient", "whitted"])
def test_the_reference_agrees(way: str) -> None:
    made = scene(rm.Sky("white", light=STUDIO), **WAYS[way])
    with rm.Renderer(SIZE) as renderer:
        found = renderer.render(made, outputs=("color", "depth"))
    wanted = truth(made, SIZE)
    inside = _all_near(wanted.hit)
    assert np.percentile(np.abs(found.color - wanted.color)[inside], 99) < 2e-3
    np.testing.assert_allclose(found.color[~wanted.hit], 1.0)


def test_light_of_the_same_sky_changes_no_text() -> None:
    """A light of True or 1 is that of the sky itself, and a sky without light has no function of it."""
    texts = [prepare(scene(rm.GradientSky(light=light))).texts["color"] for light in (True, 1, 1.0)]
    assert texts[0] == texts[1] == texts[2] and "lighting_sky" not in texts[0]
    assert "lighting_sky" in prepare(scene(rm.GradientSky(light=0.5))).texts["color"]
    assert rm.Sky(light=0.0) != rm.Sky() and not rm.Sky(light=0.0).lights
    sky = rm.SunSky(light=rm.GradientSky(light=0.5))
    assert sky.replace(turbidity=3) == rm.SunSky(turbidity=3, light=rm.GradientSky(light=0.5))


@pytest.mark.parametrize("sky", [rm.Sky, rm.GradientSky, rm.SunSky])
def test_lights_of_other_kinds_are_refused(sky: Any) -> None:
    for light in (-0.5, (1, 0.9, 0.8), "white", None, rm.Sun(), np.nan):
        refused(lambda light=light: sky(light=light), f"{sky.__name__}: light", "rm.Sky((1, 0.9, 0.8))")


@pytest.mark.parametrize("kind", ["glsl", "html", "wgsl", "frag"])
def test_exports_hold_both(kind: str, tmp_path: Path) -> None:
    file = tmp_path / f"scene.{kind}"
    rm.export(scene(rm.Sky("white", light=STUDIO)), file)
    assert file.stat().st_size > 1000
