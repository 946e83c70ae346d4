"""A rectangular light against Lambert's formula for a polygon, which is exact."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import raymarch as rm
from raymarch.errors import SceneError
from raymarch.expr.arrays import evaluator
from raymarch.gpu.context import Context
from raymarch.scene.light import FAR, POINT, SAMPLE, sample_of

WHITE = rm.Material((1, 1, 1), specular=0, ambient=0)
PLACED: list[dict[str, Any]] = [
    {"position": (0.0, 2.0, 0.0)},
    {"position": (0.5, 1.5, -0.3), "width": 2.0, "height": 0.5, "direction": (0.2, -1.0, 0.3)},
    {"position": (0.0, 1.0, 2.0), "width": 0.5, "height": 1.5, "direction": (0.1, -0.2, -1.0), "up": (1.0, 1.0, 0.0)},
]


def corners(light: rm.RectLight) -> NDArray[np.float64]:
    """The corners of the rectangle, counterclockwise as seen from where it shines, from the arguments alone."""
    given = {
        k: np.asarray(getattr(light, k).data, float) for k in ("position", "width", "height", "direction", "upright")
    }
    d = given["direction"] / np.linalg.norm(given["direction"])
    right = np.cross(d, given["upright"])
    right /= np.linalg.norm(right)
    up = np.cross(right, d)
    at = [(-1, -1), (-1, 1), (1, 1), (1, -1)]
    return np.array([given["position"] + x * given["width"] / 2 * right + y * given["height"] / 2 * up for x, y in at])


def lambert(polygon: NDArray[np.float64], point: NDArray[np.float64], normal: NDArray[np.float64]) -> float:
    """Irradiance of a polygon of radiance 1 that lies above the horizon of the point (Lambert 1760)."""
    v = polygon - point
    v = v / np.linalg.norm(v, axis=1, keepdims=True)
    w = np.roll(v, -1, axis=0)
    angles = np.arccos(np.clip(np.sum(v * w, axis=1), -1, 1))
    axes = np.cross(v, w)
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    return abs(0.5 * float(np.sum(angles * (axes @ normal))))


@pytest.mark.parametrize("given", PLACED)
def test_its_light_is_that_of_a_polygon(given: dict[str, Any]) -> None:
    light = rm.RectLight(**given, intensity=3.0)
    polygon = corners(light)
    area = float(light.width.data) * float(light.height.data)
    side = 200
    u = (np.stack(np.meshgrid(np.arange(side), np.arange(side)), -1).reshape(-1, 2) + 0.5) / side
    sampled = evaluator(sample_of(light), [POINT, SAMPLE, FAR])
    normal = np.array([0.0, 1.0, 0.0])
    for point in np.array([[0.0, 0.0, 0.0], [0.7, 0.0, -0.4], [-1.5, 0.0, 0.5]]):
        direction, _, radiance = sampled(np.tile(point, (len(u), 1)), u, np.full(len(u), 9.0))
        assert np.allclose(np.linalg.norm(direction, axis=1), 1)
        found = np.mean(radiance * np.maximum(direction @ normal, 0)[:, None], axis=0)
        wanted = 3.0 / area * lambert(polygon, point, normal)  # radiance pi intensity / area, over pi
        np.testing.assert_allclose(found, wanted, rtol=1e-4)


def test_it_shines_from_one_side() -> None:
    scene = rm.Scene(rm.plane().material(WHITE), rm.Camera((0, 3, 4), (0, 0, 0)), lights=[rm.RectLight((0, 1, 0))])
    behind = scene.replace(lights=[rm.RectLight((0, 1, 0), direction=(0, 1, 0))])
    assert rm.truth(scene, size=(8, 6)).color[4:].max() > 0.1
    assert not rm.truth(behind.replace(sky=(0, 0, 0)), size=(8, 6)).color.any()


@pytest.mark.parametrize("count", [1, 9])
@pytest.mark.parametrize("samples", [1, 4])
def test_the_shader_draws_its_penumbra(egl: Context, count: int, samples: int) -> None:
    """Below half of a wide block: the mean over many samples is the reference within the noise of both."""
    node = (rm.plane() | rm.box((2, 0.1, 2)).translate((1, 0.7, 0))).material(WHITE)
    light, whole = (rm.RectLight((0, 2, 0), 1.0, 1.5, intensity=4 / n, shadow=True) for n in (count, 1))
    quality = rm.Quality(samples=96 // samples, light_samples=samples)
    scene = rm.Scene(node, rm.Camera((0, 3, 4), (0, 0, 0)), lights=[light] * count, sky=(0, 0, 0), quality=quality)
    with rm.Renderer(size=(24, 16), backend="egl") as renderer:
        drawn = renderer.render(scene).color[..., 0]
    # Equal lights add up to one.
    wanted = rm.truth(scene.replace(lights=[whole], quality=rm.Quality()), size=(24, 16)).color[..., 0]
    off = np.abs(drawn - wanted)
    shade = (wanted > 0.05 * wanted.max()) & (wanted < 0.6 * wanted.max())
    assert shade.sum() > 10 and np.median(off) < 0.03 and np.mean(drawn) == pytest.approx(np.mean(wanted), rel=0.02)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"width": 0.0}, "RectLight: width = 0.0"),
        ({"up": (0, 2, 0)}, "RectLight: up = .*not parallel"),
        ({"direction": (0, 0, 0)}, "RectLight: direction"),
    ],
)
def test_what_makes_no_rectangle_is_refused(given: dict[str, Any], message: str) -> None:
    with pytest.raises(SceneError, match=message):
        rm.RectLight((0, 1, 0), **given)
