"""Materials, lights and shadows on the device, held against the float64 truth."""

from __future__ import annotations

import numpy as np
import pytest

import raymarch as rm
from raymarch.gpu import Renderer
from raymarch.gpu.context import Context
from raymarch.plan import lights
from raymarch.scene.parameter import set_values
from raymarch.truth import silhouettes, truth
from tests.support.shader_samples import lamps, scenes, solid

SIZE, SMALL = (80, 60), (56, 42)
"""The smaller for soft shadows, whose truth takes long."""
SKIES = ("gradient sky", "sun sky", "blue sky", "matte under a sky", "gold under a sky", "occlusion")
EXACT = ("physical", "masking", "both models", "patterns", "glow without lights", "many plain lamps", *SKIES)
MAPS = ("mapped", "relief", "relief under a sky", "relief in corners", "matte relief", "glow of a texture")
SAMPLING = 1 / (31 * np.pi)
"""Samples half a clearance r apart know the least between them to r (1 - sqrt(15) / 4), r / 31; the share of the disc
that is seen changes by 2 / pi sqrt(1 - r^2) of that, 1 / (31 pi) at most."""
AWAY = rm.Camera((5.079, 3.367, 7.483), (1.345, 0.007, 0.016))
SOFT = ("soft shadows", "soft shadows without end", "lamps", "many lamps")


def differences(renderer: Renderer, scene: rm.Scene, size: tuple[int, int] = SIZE) -> np.ndarray:
    """Off silhouettes, over what is there: a highlight of brightness 20 need not be known to 1/255."""
    renderer.resize(size)
    known = truth(scene, size)
    found = renderer.render(scene).color
    return (np.abs(found - known.color) / np.maximum(known.color, 1.0)).max(axis=-1)[~silhouettes(known)]


@pytest.mark.parametrize("name", [*EXACT, *MAPS])
def test_a_look_is_true(renderer: Renderer, name: str) -> None:
    off = differences(renderer, scenes()[name])
    assert np.mean(off > 1 / 255) < 1e-3 and np.percentile(off, 95) < 1e-3


@pytest.mark.parametrize("name", SOFT)
def test_a_soft_shadow_is_true(renderer: Renderer, name: str) -> None:
    """The samples on its way are others in float32, by which a penumbra may change by `SAMPLING` of the light; what is
    beyond is the border of a hard one, or of the lamp that touches a ball."""
    off = differences(renderer, scenes()[name].replace(camera=AWAY), SMALL)
    assert np.mean(off > 1 / 255) < 0.01 and np.mean(off > 1.05 * SAMPLING) < 3e-3


def test_many_lights_are_what_each_of_them_is(renderer: Renderer) -> None:
    """As rows of a texture in one loop they light like text does."""
    renderer.resize(SIZE)
    few = [lamps()[k] for k in (0, 1, 3, 4, 5)]
    pictures = [
        renderer.render(rm.Scene(solid(), lights=some)).color
        for some in (few, [*few, *(rm.PointLight((9, 9, 9), intensity=0) for _ in range(20))])
    ]
    np.testing.assert_allclose(pictures[0], pictures[1], atol=1e-5)


def test_rows_hold_what_their_lights_have_and_no_more() -> None:
    plain = rm.Scene(solid(), lights=[rm.PointLight((k, 3, 0)) for k in range(64)])
    values = set_values(plain.parameters, {})
    assert lights.rows(plain, values).shape == (64, 2, 4)
    every = rm.Scene(solid(), lights=4 * lamps())
    values = set_values(every.parameters, {})
    rows = lights.rows(every, values)
    assert rows.shape == (24, 4, 4) and rows.dtype == np.float32
    kinds = list(lights.table(every).forms)
    for row, light in zip(rows, every.lights, strict=True):
        assert row[0, 0] == kinds.index(lights.key(light)) and (row[0, 1] > 0) == light.shadow
        held = np.concatenate([values.of(value).ravel() for value in light.emitter_values().values()])
        assert set(held.astype(np.float32)) <= set(row[1:].ravel())


def test_rows_follow_parameters_without_a_new_shader(renderer: Renderer) -> None:
    renderer.resize((16, 12))
    height = rm.Param("height", 3.0, 1.0, 9.0)
    scene = rm.Scene(rm.sphere(), lights=[rm.PointLight((k, height, 0)) for k in range(12)], sky=(0, 0, 0))
    low, high = (renderer.render(scene, params={"height": h}) for h in (2.0, 8.0))
    assert low.color.max() > 2 * high.color.max()
    assert high.timings[0].compile == 0.0


def test_the_ends_of_an_extruded_profile_show_its_material(renderer: Renderer) -> None:
    """No distance of the profile moves the field there; beside other materials as alone."""
    red, blue = (rm.Material(c, specular=0.0, ambient=1.0) for c in ((1, 0, 0), (0, 0, 1)))
    profile = rm.rectangle((1, 1)).material(red) | rm.circle(0.4).material(blue).translate((0.8, 0))
    solid = profile.extrude(0.6) | rm.sphere(0.2).translate((0, 1, 0))
    scene = rm.Scene(solid, rm.Camera((0.3, 0.2, 4), (0.3, 0.2, 0), fov=40), [rm.Sun((0, 0, -1))])
    renderer.resize(SIZE)
    known, frame = truth(scene, SIZE), renderer.render(scene)
    end = known.hit & (known.normal[..., 2] > 0.99) & (known.depth < 4)
    assert end.sum() > 200
    for index, color in ((1, (1, 0, 0)), (2, (0, 0, 1))):
        part = end & (known.material == index)
        assert part.sum() > 20
        np.testing.assert_allclose(known.color[part], np.broadcast_to(color, (part.sum(), 3)), atol=1e-9)
    assert np.mean(np.abs(frame.color - known.color)[end].max(axis=-1) > 1e-3) < 0.02
    assert np.mean((frame.material != known.material)[end]) < 0.02


@pytest.mark.parametrize("scale", [1e-3, 1e3])
def test_ambient_occlusion_follows_the_size_of_the_scene(egl: Context, scale: float) -> None:
    def scene(size: float, **given: float) -> rm.Scene:
        node = rm.plane(offset=-size) | rm.sphere(size) | rm.box((size, size, size)).translate((1.5 * size, 0, 0))
        return rm.Scene(
            node,
            rm.Camera((0, 3 * size, 5 * size), (0, 0, 0)),
            lights=[],
            sky=rm.Sky((1, 1, 1), light=True),
            occlusion=rm.AmbientOcclusion(**given),
        )

    with rm.Renderer((32, 18), backend="egl") as renderer:
        one, other = (renderer.render(scene(size)).color for size in (1.0, scale))
        fixed = renderer.render(scene(scale, reach=0.5)).color
    assert np.abs(one - other).max() < 2e-3 < np.abs(one - fixed).max()
    known = rm.truth(scene(scale), (32, 18), outputs=("color",)).color
    assert np.median(np.abs(known - other)) < 1e-3
    ball = rm.Scene(rm.sphere(), occlusion=rm.AmbientOcclusion())
    assert ball.ambient_occlusion is not None and ball.occlusion is not None
    assert float(ball.ambient_occlusion.reach.data) == pytest.approx(0.5) and ball.occlusion.reach is None
