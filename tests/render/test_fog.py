"""Fog of the sky's colour, and fog in layers: the shader, the reference and the horizon."""

from __future__ import annotations

import numpy as np
import pytest

import raymarch as rm
from raymarch.expr.arrays import evaluator
from raymarch.gpu.context import Context
from raymarch.plan import plan
from raymarch.scene.fog import LENGTH, ORIGIN, SKY_DISTANCE
from raymarch.scene.sky import DIRECTION
from raymarch.shader import assemble

SKY = rm.GradientSky((0.1, 0.2, 0.8), (0.9, 0.7, 0.5), (0.1, 0.3, 0.2))
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
    level = directions * (1, 0, 1)
    level = np.where(directions[:, 1:2] < 0, level / np.linalg.norm(level, axis=1, keepdims=True), directions)
    sky, haze = (SKY.radiance_along(d, rm.scene.parameter.Values({})).reshape(30, 40, 3) for d in (directions, level))
    kept = np.exp(-0.2 * np.where(hit, depth, 0.0))[..., None]
    assert np.abs(found - np.where(hit[..., None], without * kept + haze * (1 - kept), sky)).max() < 1e-4


def test_path_tracing_has_it_too(egl: Context) -> None:
    level = rm.GradientSky((0.1, 0.2, 0.8), (0.9, 0.7, 0.5), (0.9, 0.7, 0.5))  # the horizon goes on below
    scene = scene_of(bounces=1, quality=rm.Quality(samples=2), fog=rm.Fog(None, 1e6), sky=level)
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
    assert repr(rm.Fog(None, 0.1)) == "Fog(density=0.1)" and rm.Fog() == rm.Fog(None)
    assert rm.Fog(None) != rm.Fog((0, 0, 1)) and rm.Fog((0, 0, 1)).replace(color=None) == rm.Fog()


# Fog whose density falls with the height


def depth_of(fog: rm.Fog, origins: np.ndarray, directions: np.ndarray, length: np.ndarray, dtype: type) -> np.ndarray:
    """The optical depth by the expression, at a precision."""
    values = (np.asarray(v, dtype) for v in (origins, directions, length))
    found = evaluator([fog.optical_depth()], [ORIGIN, DIRECTION, LENGTH], dtype)(*values)[0]
    return np.asarray(np.broadcast_to(found, len(length)))


def by_quadrature(density: float, falloff: float, height: float, o: float, d: float, length: float) -> float:
    """The integral of the density along a ray, by Gauss-Legendre on intervals shorter than the scale of the fog."""
    nodes, weights = np.polynomial.legendre.leggauss(20)
    edges = np.linspace(0.0, length, 2 + int(falloff * abs(d) * length))
    half = 0.5 * np.diff(edges)[:, None]
    t = 0.5 * (edges[1:] + edges[:-1])[:, None] + half * nodes
    return float(np.sum(half * weights * density * np.exp(-falloff * (o + t * d - height))))


RAYS = [  # height of the origin, y of the direction, length
    *[(0.3, d, 40.0) for d in (0.0, 1e-12, -1e-7, 3e-6, -7e-6, 1.1e-5, 1e-4, -3e-3, 0.02, -0.2, 0.7, 1.0, -1.0)],
    *[(y, d, 5.0) for y in (-8.0, 12.0) for d in (0.0, 1.0, -1.0, 0.01)],
    *[(0.0, d / (1.5 * 2.0), 2.0) for d in (0.249, 0.25, 0.251)],  # around the end of the series
]


@pytest.mark.parametrize("scale", [1.0, 1000.0])
def test_the_optical_depth_is_the_integral_of_the_density(scale: float) -> None:
    fog = rm.Fog((1, 1, 1), density=0.2 / scale, falloff=1.5 / scale, height=0.5 * scale)
    o = np.array([[7 * scale, y * scale, 0] for y, _, _ in RAYS])
    d = np.array([[np.sqrt(1 - y * y), y, 0] for _, y, _ in RAYS])
    length = np.array([t * scale for *_, t in RAYS])
    known = [
        by_quadrature(0.2 / scale, 1.5 / scale, 0.5 * scale, *ray) for ray in zip(o[:, 1], d[:, 1], length, strict=True)
    ]
    np.testing.assert_allclose(depth_of(fog, o, d, length, np.float64), known, rtol=1e-7)  # the series ends there
    # 12 units of the fog's scale are an exponent of 18, of which float32 keeps 1e-6
    np.testing.assert_allclose(depth_of(fog, o, d, length, np.float32), known, rtol=1e-5)


def test_rays_without_end_have_the_closed_form() -> None:
    """density / (falloff d.y) upwards, nothing passes at the horizon and below; also in the largest and smallest units.

    Far below the fog's height the density is beyond float32: nothing passes, and nothing is NaN."""
    up = np.array([1.0, 0.5, 1e-3, 1e-6])
    for unit in (1e-12, 1.0, 1e12):
        fog = rm.Fog((1, 1, 1), density=0.2 / unit, falloff=1.5 / unit)
        d = np.stack([np.sqrt(1 - up * up), up, 0 * up], axis=1)
        end = np.full(len(up), SKY_DISTANCE)
        np.testing.assert_allclose(depth_of(fog, 0 * d, d, end, np.float32), 0.2 / (1.5 * up), rtol=1e-5)
        assert np.all(depth_of(fog, 0 * d[:3], -d[:3], end[:3], np.float32) > 1e3)
        flat = np.array([[1.0, 0.0, 0.0]])
        assert depth_of(fog, 0 * flat, flat, end[:1], np.float32)[0] > 1e3
        assert depth_of(fog, [[0, -1e6 * unit, 0]], d[:1], end[:1], np.float32)[0] > 1e3
    none = rm.Fog((1, 1, 1), density=0.0, falloff=1.5)
    assert depth_of(none, [[0, -1e6, 0]], [[0, -1, 0]], np.array([SKY_DISTANCE]), np.float32)[0] == 0.0


LAYER = rm.Fog((0.9, 0.8, 0.7), density=0.8, falloff=1.5, height=-1.0)
CAMERAS = {
    "across": rm.Camera((0, 0.5, 5), (0, 0.3, 0)),
    "up": rm.Camera((2, 0.2, 0), (2, 9, 0), up=(0, 0, 1)),
    "far away": rm.Camera((0, 1e5 + 0.5, 5), (0, 1e5 + 0.3, 0)),
}


@pytest.mark.parametrize("name", [*CAMERAS, "whitted", "path", "none"])
def test_the_layer_is_that_of_the_reference(name: str, egl: Context) -> None:
    """Also where the shader's coordinates are relative to a point near the camera."""
    camera, ways = CAMERAS.get(name, CAMERAS["across"]), WAYS.get(name, {})
    scene = scene_of(camera=camera, fog=LAYER.replace(color=None) if name == "none" else LAYER, **ways)
    if name == "far away":
        scene = scene.replace(node=scene.node.translate((0, 1e5, 0)), fog=LAYER.replace(height=1e5 - 1.0))
    if name == "path":  # of one surface without light of its own it is the same
        scene = scene.replace(node=rm.plane(offset=-1), lights=[], sky=(0, 0, 0), bounces=1)
    with rm.Renderer((24, 18), context=egl) as renderer:
        found = renderer.render(scene).color
    expected = rm.truth(scene.replace(bounces=0) if name == "path" else scene, (24, 18)).color
    assert np.quantile(np.abs(found - expected), 0.97) < (1e-2 if name == "far away" else 1e-3)


def test_a_camera_in_dense_fog_sees_fog_alone(egl: Context) -> None:
    scene = scene_of(fog=LAYER.replace(density=1e4))
    with rm.Renderer((8, 6), context=egl) as renderer:
        np.testing.assert_allclose(renderer.render(scene).color, np.broadcast_to((0.9, 0.8, 0.7), (6, 8, 3)), atol=1e-6)


def test_a_layer_of_its_own_colour_has_no_seam_at_the_horizon(egl: Context) -> None:
    """Homogeneous fog of its own colour has one: it does not cover the sky."""
    camera = rm.Camera((0, 0, 0), (0, 0, -1))
    jumps = []
    with rm.Renderer((8, 200), context=egl) as renderer:
        for fog in (LAYER, rm.Fog((0, 1, 0), 0.8)):
            rows = renderer.render(rm.Scene(rm.plane(offset=-1), camera, sky=SKY, fog=fog)).color[:, 4]
            jumps.append(np.abs(np.diff(rows[90:110], axis=0)).max())
    assert jumps[0] < 0.02 < 0.3 < jumps[1]


def test_fog_without_falloff_costs_no_byte_more() -> None:
    texts = [assemble(plan(scene_of(fog=fog))).text() for fog in (rm.Fog(), rm.Fog(height=3.0), LAYER)]
    assert texts[0] == texts[1] != texts[2]
