"""Subsurface scattering against radiative transfer in float64, and against diffuse reflection in its limit."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import raymarch as rm

TINTS = (0.3, 0.8, 0.95)


@pytest.fixture(scope="module")
def renderer() -> Any:
    with rm.Renderer((24, 24)) as made:
        yield made


def matter(radius: Any, color: Any = TINTS, **others: Any) -> rm.Material:
    """Matter under a surface that reflects almost nothing itself."""
    given: dict[str, Any] = {"roughness": 1.0, "f0": 0.0} | others
    return rm.Material(subsurface=1, subsurface_radius=radius, subsurface_color=color, **given)


def ball(material: rm.Material, samples: int = 32, **others: Any) -> rm.Scene:
    """A ball of radius 1 that fills most of a picture of nearly parallel rays."""
    given: dict[str, Any] = {"sky": rm.Sky((1, 1, 1), light=True), "bounces": 1, "lights": []} | others
    quality = rm.Quality(samples=samples, **given.pop("quality", {}))
    return rm.Scene(rm.sphere(1).material(material), rm.Camera((0, 0, 60), (0, 0, 0), fov=2), quality=quality, **given)


def mean(renderer: Any, scene: rm.Scene) -> Any:
    frame = renderer.render(scene)
    return frame.color[np.isfinite(frame.depth)].mean(axis=0)


def walked(radius: float, color: float, inside: Any, n: int = 40_000) -> tuple[float, float]:
    """The fractions of light that leave a solid on the side of the point (0, 0, 0) where it enters, and elsewhere.

    inside : a function of heights below 0 that tells whether they are inside. Light enters along -z with the cosine
    distribution; only the height counts.
    """
    draw = np.random.default_rng(4)
    s = 4.09712 + 4.20863 * color - np.sqrt(9.59217 + 41.6808 * color + 17.7126 * color**2)
    z, slope, weight, left, through = np.zeros(n), -np.sqrt(1 - draw.random(n)), np.ones(n), 0.0, 0.0
    while len(z):
        z = z - np.log(1 - draw.random(len(z))) * radius * slope
        kept = inside(z)
        left, through = left + weight[z > 0].sum(), through + weight[~kept & (z <= 0)].sum()
        z, weight = z[kept], weight[kept] * (1 - s * s)
        slope, lost = draw.uniform(-1, 1, len(z)), (weight < 0.1) & (draw.random(len(z)) < 0.5)
        z, slope, weight = z[~lost], slope[~lost], np.where(weight < 0.1, 2 * weight, weight)[~lost]
    return left / n, through / n


@pytest.mark.parametrize("color", TINTS)
def test_a_thick_solid_has_its_color(color: float) -> None:
    """The single-scattering albedo is the inverse of what a half-space reflects, by a walk in float64."""
    left, _ = walked(1.0, color, lambda z: (z <= 0) & (z > -60))
    assert abs(left - color) < 0.006


def test_a_thick_plate_has_its_color(renderer: Any) -> None:
    """80 mean free paths thick, so that walks leap: a leap absorbs as the walk that it replaces. Lit from the front."""
    plate = rm.box((60, 60, 4)).material(matter(0.05))
    sky = rm.Sky(lambda d: rm.where(d.z > 0.0, 1.0, 0.0) * rm.vec3(1, 1, 1), light=True)
    camera = rm.Camera((0, 0, 60), (0, 0, 0), fov=1)
    scene = rm.Scene(plate, camera, [], sky, bounces=1, quality=rm.Quality(samples=24))
    np.testing.assert_allclose(renderer.render(scene).color.mean(axis=(0, 1)), TINTS, atol=0.012)


@pytest.mark.parametrize("radius", [0.25, 1.0])
def test_thin_parts_glow(renderer: Any, radius: float) -> None:
    """A plate of thickness 1 that is lit from behind alone: what passes it is what walks in float64 give."""
    behind = rm.Sky(lambda d: rm.where(d.z < 0.0, 1.0, 0.0) * rm.vec3(1, 1, 1), light=True)
    plate = rm.box((60, 60, 1)).material(matter(radius))
    camera = rm.Camera((0, 0, 60), (0, 0, 0), fov=1)
    scene = rm.Scene(plate, camera, [], behind, bounces=1, quality=rm.Quality(samples=24))
    found = renderer.render(scene).color.mean(axis=(0, 1))
    known = [walked(radius, color, lambda z: (z <= 0) & (z >= -1))[1] for color in TINTS]
    np.testing.assert_allclose(found, known, atol=0.01)


SURFACES: dict[str, dict[str, Any]] = {
    "plain": {"roughness": 0.5},
    "coated": {"roughness": 0.4, "clearcoat": 1, "clearcoat_roughness": 0.3},
    "half metal": {"roughness": 0.5, "metalness": 0.5},
}


@pytest.mark.parametrize("name", SURFACES)
def test_a_short_radius_is_diffuse_reflection(renderer: Any, name: str) -> None:
    """Under a sun, with all that lies over the matter; and any weight of it is."""
    color, light = (0.8, 0.5, 0.2), {"lights": [rm.Sun((1, 1, 1))], "sky": rm.Sky((0, 0, 0))}
    known = mean(renderer, ball(rm.Material(albedo=color, **SURFACES[name]), 96, **light))
    for weight in (1.0, 0.5):
        walks = rm.Material(
            albedo=color, subsurface=weight, subsurface_radius=1e-7, subsurface_color=color, **SURFACES[name]
        )
        np.testing.assert_allclose(mean(renderer, ball(walks, 96, **light)), known, rtol=0.015)
        np.testing.assert_allclose(mean(renderer, ball(walks, 96, **{**light, "bounces": 0})), known, rtol=1e-6)


@pytest.mark.parametrize("radius", [1e-7, 0.02, 0.4, (0.5, 0.1, 0.02)])
def test_no_surface_reflects_more_than_arrives(renderer: Any, radius: Any) -> None:
    """In a white furnace matter that absorbs nothing gives back what it gets; other matter less."""
    noise = 0.0 if isinstance(radius, float) else 0.04  # of colours that walk apart
    found = mean(renderer, ball(matter(radius, (1, 1, 1), roughness=0.2, f0=0.04), 12))
    assert np.all(found <= 1.003 + noise) and np.all(found > 0.97 - noise)
    assert np.all(mean(renderer, ball(matter(radius, (0.9, 0.5, 0.1)), 12)) < (0.999, 0.98, 0.7))


def test_a_longer_radius_lets_more_light_pass(renderer: Any) -> None:
    """Red light goes farthest, so a ball of grey matter is red; the picture is even for equal radii."""
    red = mean(renderer, ball(matter((0.4, 0.1, 0.02), (0.6, 0.6, 0.6))))
    assert red[0] > red[1] + 0.05 and red[1] > red[2] + 0.02
    grey = mean(renderer, ball(matter(0.1, (0.6, 0.6, 0.6))))
    assert np.ptp(grey) < 1e-6


def test_glass_stands_beside_matter(renderer: Any) -> None:
    """One of two balls in a furnace is clear glass: it shows the sky, the other its own colour."""
    glass = rm.Material(transmission=1, ior=1.2)
    node = rm.sphere(0.5).material(matter(1e-7, (0.5, 0.5, 0.5))).translate((-0.5, 0, 0))
    both = node | rm.sphere(0.5).material(glass).translate((0.5, 0, 0))
    scene = rm.Scene(
        both,
        rm.Camera((0, 0, 60), (0, 0, 0), fov=2),
        [],
        rm.Sky((1, 1, 1), light=True),
        bounces=3,
        quality=rm.Quality(samples=32),
    )
    frame = renderer.render(scene)
    solid, left = np.isfinite(frame.depth), np.arange(24)[None] < 12
    assert abs(frame.color[solid & left].mean() - 0.5) < 0.02
    assert frame.color[solid & ~left].mean() > 0.97
