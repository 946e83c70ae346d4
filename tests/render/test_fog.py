"""Fog of the sky's colour: the shader, the reference and the horizon."""

from __future__ import annotations

import numpy as np
import pytest

import raymarch as rm
from raymarch.gpu.context import Context

SKY = rm.GradientSky((0.1, 0.2, 0.8), (0.9, 0.7, 0.5), (0.9, 0.7, 0.5))
MIRROR = rm.Material(albedo=(0.9, 0.9, 0.9), metalness=1, roughness=0)


def scene_of(**parts: object) -> rm.Scene:
    node = rm.plane(offset=-1) | rm.sphere().material(MIRROR)
    given = {"camera": rm.Camera((0, 0.5, 5), (0, 0.3, 0)), "sky": SKY, "fog": rm.Fog(None, 0.2), **parts}
    return rm.Scene(node, **given)  # type: ignore[arg-type]


WAYS = {
    "direct": {},
    "whitted": {"quality": rm.Quality(integrator="whitted"), "bounces": 2},
    "data": {"lights": [rm.PointLight((i, 3, 2), intensity=2) for i in range(9)]},
}


@pytest.mark.parametrize("name", WAYS)
def test_the_shader_and_the_reference_agree(name: str, egl: Context) -> None:
    scene = scene_of(**WAYS[name])
    with rm.Renderer((40, 30), context=egl) as renderer:
        found = renderer.render(scene).color
        clear = renderer.render(scene.replace(fog=None))
        depth, hit = clear.depth, np.isfinite(clear.depth)
        without = clear.color
    expected = rm.truth(scene, (40, 30)).color
    assert np.quantile(np.abs(found - expected), 0.98) < 1e-3
    # The closed form: exp(-density t) of the surface, and the rest of the sky in the direction of the ray.
    pose = scene.pose(rm.scene.parameter.Values({}), 4 / 3)
    directions = pose.directions(np.arange(40), np.arange(30)[:, None], (40, 30)).reshape(-1, 3)
    sky = SKY.radiance_along(directions, rm.scene.parameter.Values({})).reshape(30, 40, 3)
    kept = np.exp(-0.2 * np.where(hit, depth, 0.0))[..., None]
    assert np.abs(found - np.where(hit[..., None], without * kept + sky * (1 - kept), sky)).max() < 1e-4


def test_path_tracing_has_it_too(egl: Context) -> None:
    scene = scene_of(bounces=1, quality=rm.Quality(samples=2), fog=rm.Fog(None, 1e6))
    with rm.Renderer((20, 15), context=egl) as renderer:
        assert np.abs(renderer.render(scene).color - renderer.render(scene.replace(node=FAR)).color).max() < 1e-3


FAR = rm.sphere().translate((0, 0, 50))


def test_there_is_no_seam_at_the_horizon(egl: Context) -> None:
    camera = rm.Camera((0, 0, 0), (0, 0, -1))
    scene = rm.Scene(rm.plane(offset=-1), camera, sky=SKY, fog=rm.Fog(None, 0.2))
    with rm.Renderer((8, 200), context=egl) as renderer:
        rows = renderer.render(scene).color[:, 4]
    assert np.abs(np.diff(rows[90:110], axis=0)).max() < 0.02


def test_it_shows_in_the_repr_and_is_a_value() -> None:
    assert repr(rm.Fog(None, 0.1)) == "Fog(color=None, density=0.1)"
    assert rm.Fog(None) != rm.Fog() and rm.Fog().replace(color=None) == rm.Fog(None)
