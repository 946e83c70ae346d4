"""Mirrors and glass without chance: the tree of integrator against the float64 truth, and against random integrator."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.errors import SceneError
from raymarch.expr.vocabulary import sin, vec3
from raymarch.gpu import Renderer
from raymarch.plan import plan
from raymarch.shader import assemble
from raymarch.truth import silhouettes, truth

SIZE = (64, 48)
TREE = rm.Quality(integrator="whitted")
CLEAR = rm.Material(transmission=1, ior=1.5)
GREEN = rm.Material(transmission=1, ior=1.6, absorption=(1.6, 0.25, 0.9))
SILVER = rm.Material(albedo=(0.95, 0.93, 0.9), metalness=1, roughness=0)
SATIN = rm.Material(albedo=(0.9, 0.6, 0.3), metalness=1, roughness=0.14)
FILM = rm.Material(albedo=(0.2, 0.5, 0.2), roughness=0.05, transmission=0.5, ior=1.3)
TILES = rm.Material(albedo=lambda p: 0.5 + 0.3 * sin(2 * p.x) * vec3(sin(2 * p.z)), roughness=0.02)
FROST = rm.Material(transmission=1, roughness=0.4)
COATED = rm.Material(albedo=(0.8, 0.2, 0.2), roughness=0.35, metalness=0.4, transmission=0.5, ior=1.7)
CLAY = rm.Material((0.7, 0.3, 0.2))
SOLIDS = {
    "glass": rm.sphere(0.8).material(CLEAR) | rm.sphere(0.5).translate((-1.2, -0.2, -1.2)).material(CLAY),
    "absorbing": rm.box((1.2, 1.2, 1.2)).rotate(0.6, "y").material(GREEN),
    "mirrors": rm.sphere(0.7).translate((-0.8, 0, 0)).material(SILVER)
    | rm.sphere(0.6).translate((0.7, 0, 0.2)).material(SATIN),
    "lit glass": rm.sphere(0.7).translate((-0.9, 0, 0)).material(FROST)
    | rm.union(
        rm.sphere(0.6).material(COATED), rm.sphere(0.5).translate((0.6, 0.3, 0)).material(CLAY), k=0.2
    ).translate((0.6, 0, 0)),
    "both": rm.sphere(0.7).translate((-0.8, 0, 0)).material(CLEAR)
    | rm.sphere(0.6).translate((0.7, 0, -0.4)).material(SILVER)
    | rm.sphere(0.4).translate((0.3, -0.2, 0.9)).material(FILM),
}


def scene(name: str, **parts: Any) -> rm.Scene:
    parts = {
        "camera": rm.Camera((0.3, 2.6, 4.2), (0, -0.2, 0)),
        "lights": [rm.Sun((-0.5, 1, 0.6), intensity=0.8, shadow=True)],
        "sky": rm.GradientSky(light=True),
        "bounces": 3,
        "quality": TREE,
        **parts,
    }
    return rm.Scene(SOLIDS[name] | rm.plane(offset=-0.9).material(TILES), **parts)


@pytest.mark.parametrize("name", SOLIDS)
def test_a_tree_is_true_in_each_pixel(name: str, renderer: Renderer) -> None:
    """Every pixel's colour is among those of the true picture around it, to a step of 8 bits; the few that are not show
    where a way leaps from one thing to another, which no pixel's middle need hit alike."""
    renderer.resize(SIZE)
    made = scene(name, fog=rm.Fog(density=0.02) if name == "both" else None)
    known, found = truth(made, SIZE).color, renderer.render(made).color
    rows, columns = known.shape[:2]
    near = np.pad(known, ((1, 1), (1, 1), (0, 0)), "edge")
    near = np.stack([near[i : i + rows, j : j + columns] for i in range(3) for j in range(3)])
    wrong = np.maximum(found - near.max(axis=0), near.min(axis=0) - found).max(axis=-1)
    assert np.mean(wrong > 1 / 255) < 0.01
    assert np.percentile(np.abs(found - known), 90) < 1e-3


@pytest.mark.parametrize("lit", [False, True])
def test_mirrors_in_mirrors_are_dulled_for_the_sake_of_lights(lit: bool, renderer: Renderer) -> None:
    """Where no light shines, the last mirror shows the sky as sharp as it is; where one does, a little blurred."""
    renderer.resize(SIZE)
    lights = [rm.Sun((-0.5, 1, 0.6), intensity=0.8)] if lit else []
    mirrors = rm.sphere(0.7).translate((-0.8, 0, 0)) | rm.sphere(0.6).translate((0.7, 0, 0.2)) | rm.plane(offset=-0.9)
    camera, sky = rm.Camera((0.3, 2.6, 4.2), (0, -0.2, 0)), rm.GradientSky(light=True)
    made = rm.Scene(mirrors.material(SILVER), camera, lights, sky, bounces=1, quality=TREE)
    known, found = truth(made, SIZE).color, renderer.render(made).color
    assert np.percentile(np.abs(found - known).max(axis=-1), 90) < 1e-3


def test_lights_shine_on_glass(renderer: Renderer) -> None:
    """In the dark nothing else comes from it, but what its other share scatters."""
    renderer.resize(SIZE)
    lights = [rm.Sun((-0.5, 1, 0.6)), rm.Sun((0.4, 0.5, 1.0), color=(1, 0.5, 0.2))]
    made = rm.Scene(
        SOLIDS["lit glass"], rm.Camera((0.3, 1.0, 4.0), (0, 0, 0)), lights, (0, 0, 0), bounces=1, quality=TREE
    )
    known, found = truth(made, SIZE), renderer.render(made).color
    off = np.abs(found - known.color).max(axis=-1)[~silhouettes(known)]
    assert np.mean(off > 1 / 255) < 0.002 and known.color.max() > 0.3


@pytest.mark.parametrize("integrator", ["whitted", "path"])
@pytest.mark.parametrize("share", [1.0, 0.5])
@pytest.mark.parametrize("lamp", [None, rm.Sun(intensity=1e-9)])
def test_glass_glows(integrator: str, share: float, lamp: rm.Sun | None, renderer: Renderer) -> None:
    """What it gives off comes from its outside, however much light goes through."""
    renderer.resize((24, 18))
    glow = rm.Material(albedo=(0, 0, 0), f0=0, transmission=share, ior=1.0, emission=(0.5, 0.25, 0.0))
    camera, lights = rm.Camera((0, 0, 9), (0, 0, 0), fov=6), [lamp] if lamp else []
    quality = rm.Quality(integrator=integrator, samples=4)
    made = rm.Scene(rm.sphere().material(glow), camera, lights, (0, 0, 0), bounces=2, quality=quality)
    found = renderer.render(made).color
    np.testing.assert_allclose(found, np.broadcast_to((0.5, 0.25, 0.0), found.shape), atol=1e-5)
    if integrator == "whitted":
        np.testing.assert_allclose(truth(made, (24, 18)).color, found, atol=1e-5)


@pytest.mark.parametrize("name", ["glass", "mirrors"])
def test_a_tree_is_the_mean_of_random_ways(name: str, renderer: Renderer) -> None:
    """Where all is perfectly smooth or gives off light by itself, both are the same: within three standard errors."""
    renderer.resize((32, 24))
    wall = rm.Material(color=(0, 0, 0), specular=0, ambient=0, emission=lambda p: 0.5 + 0.4 * vec3(sin(3 * p)))
    balls = {
        "glass": rm.sphere(0.8).material(CLEAR),
        "mirrors": rm.sphere(0.7).translate((-0.8, 0, 0)).material(SILVER)
        | rm.sphere(0.6).translate((0.7, 0, 0)).material(SILVER),
    }[name]
    node = balls | rm.plane(offset=-0.9).material(wall)
    parts = {"camera": rm.Camera((0.3, 1.2, 4.2), (0, 0, 0)), "lights": [], "sky": rm.GradientSky(), "bounces": 4}

    def drawn(integrator: str) -> Any:
        quality = rm.Quality(samples=128, integrator=integrator)
        return renderer.render(rm.Scene(node, quality=quality, **parts)).color.astype(np.float64).mean(axis=-1)

    apart = drawn("path") - drawn("whitted")
    error = apart.std() / np.sqrt(apart.size)
    assert error < 5e-4 and abs(apart.mean()) <= 3 * error


def test_clear_glass_in_a_white_sky_is_not_seen(renderer: Renderer) -> None:
    renderer.resize((24, 18))
    for shape in (rm.sphere(), rm.box((1, 1, 1)).rotate(0.5, (1, 2, 3))):
        made = rm.Scene(shape.material(CLEAR), lights=[], sky=(1, 1, 1), bounces=4, quality=TREE)
        np.testing.assert_allclose(renderer.render(made).color, 1.0, atol=2e-3)


def test_a_tree_is_not_in_the_text_unless_something_mirrors() -> None:
    clay = rm.sphere().material(CLAY)
    plain, asked = (assemble(plan(rm.Scene(clay, bounces=n, quality=TREE))).text() for n in (0, 4))
    assert plain == asked
    assert "Branch" not in assemble(plan(rm.Scene(rm.sphere().material(SILVER), bounces=4, quality=TREE))).text()


def test_a_tree_is_no_deeper_than_four() -> None:
    assert rm.Scene(rm.sphere().material(CLEAR), quality=TREE).bounces == 4
    with pytest.raises(SceneError, match=r"bounces = 5 .*63 rays.*up to 4.*path"):
        rm.Scene(rm.sphere().material(CLEAR), bounces=5, quality=TREE)
    with pytest.raises(SceneError, match="integrator = 'bush'"):
        rm.Quality(integrator="bush")


@pytest.mark.parametrize("analytic", [True, False])
def test_corners_of_a_room_of_mirrors_reflect_its_walls(renderer: Renderer, analytic: bool) -> None:
    """Near a corner a reflected ray starts behind the next wall, which is a face of the scene's box."""
    room = (rm.box((30, 11, 20)) | rm.sphere(0.05)).material(
        rm.Material(albedo=(0.8, 0.7, 0.6), metalness=0.5, roughness=0)
    )
    light = rm.PointLight(position=(0, 1, 0.3), shadow=True, intensity=80)
    quality = rm.Quality(integrator="whitted", analytic=analytic)
    camera = rm.Camera((1.3, 0.15, 0.1), (0.2, 0.1, 0), fov=80)
    scene = rm.Scene(room, camera, lights=[light], sky=rm.Sky((0, 50, 0)), bounces=1, quality=quality)
    renderer.resize((64, 36))
    assert renderer.render(scene).color[..., 1].max() < 20
