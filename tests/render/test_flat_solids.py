"""Solids that an uneven scale makes flat: the pixels that they cover, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

import raymarch as rm
from tests.hard.world import view_of
from tests.support.cameras import camera_of

SIZE = (64, 48)
CAMERA = rm.Camera(position=(1.5, 1.2, 3), target=(0, 0, 0))
ALLOWED = 1
"""Pixels whose ray passes a silhouette within the error of a hit."""


def torus_is_hit(origin: NDArray[np.float64], direction: NDArray[np.float64]) -> bool:
    """Whether a line meets the torus of radii 1 and .25 about y: a quartic has a real root."""
    direction = direction / np.linalg.norm(direction)
    origin = origin - (origin @ direction) * direction
    along = np.poly1d([direction @ direction, 2.0 * origin @ direction, origin @ origin + 1.0 - 0.25**2])
    flat = np.poly1d([direction[::2] @ direction[::2], 2.0 * origin[::2] @ direction[::2], origin[::2] @ origin[::2]])
    roots = (along * along - 4.0 * flat).roots
    return bool(np.any(np.abs(roots.imag) < 1e-7 * (1.0 + np.abs(roots))))


def sphere_is_hit(origin: NDArray[np.float64], direction: NDArray[np.float64]) -> bool:
    unit = direction / np.linalg.norm(direction)
    return float(np.sum((origin - (origin @ unit) * unit) ** 2)) <= 1.0


@pytest.mark.parametrize("solid", ["torus", "sphere"])
@pytest.mark.parametrize("height", [1e-2, 1e-5])
def test_flat_solids_cover_their_pixels(solid: str, height: float, renderer: rm.Renderer) -> None:
    view = view_of((1.5, 1.2, 3), (0, 0, 0))
    renderer.resize(SIZE)
    node, is_hit = (rm.torus(), torus_is_hit) if solid == "torus" else (rm.sphere(), sphere_is_hit)
    scene = rm.Scene(node.scale((1, height, 1)), camera_of(view), lights=[])
    shown = np.isfinite(renderer.render(scene, outputs=("depth",)).depth)
    factors = np.array((1.0, height, 1.0))
    right = np.array([[is_hit(view.origin / factors, d / factors) for d in row] for row in view.directions])
    assert right.sum() > 200
    assert (shown != right).sum() <= ALLOWED
    assert renderer.render(scene, outputs=("evaluations",)).evaluations.mean() < 3.0


@pytest.mark.parametrize("direction", [(0, 1, 0), (1, 0.5, 0)])
@pytest.mark.parametrize("height", [1e-3, 1e-5])
def test_a_flat_disc_casts_its_shadow(height: float, direction: tuple[float, ...], renderer: rm.Renderer) -> None:
    """The shadow of a level disc is a disc of its radius, whatever the direction of the sun."""
    renderer.resize((64, 64))
    disc = rm.sphere().scale((1, height, 1)).translate((0, 1, 0)).visible(camera=False)
    camera = rm.Camera(position=(0, 8, 0), target=(0, 0, 0), up=(0, 0, -1), projection="orthographic", height=6)
    sun = rm.Sun(direction, shadow=True)
    color = renderer.render(rm.Scene(disc | rm.plane(), camera, [sun])).color[..., 0]
    x, z = np.meshgrid(*[6.0 * ((np.arange(64) + 0.5) / 64 - 0.5)] * 2)
    radius = np.hypot(x + direction[0] / direction[1], z + direction[2] / direction[1])
    dark = color < 0.5 * color.max()
    assert dark[radius < 0.97].all() and not dark[radius > 1.03].any()


def test_a_solid_thinner_than_the_rounding_of_points_is_doubted(renderer: rm.Renderer) -> None:
    renderer.resize((64, 36))

    def doubts(node: rm.Node) -> list[str]:
        frame = renderer.render(rm.Scene(node, CAMERA, lights=[]))
        return [doubt for doubt in frame.doubts() if "thick" in doubt]

    (doubt,) = doubts(rm.torus().scale((1, 1e-6, 1)).rotate(0.5, "x"))
    assert "scale" in doubt and "float32 holds points within" in doubt and "at least" in doubt
    assert __file__ in doubt
    assert not doubts(rm.torus().scale((1, 1e-5, 1)).rotate(0.5, "x"))
    assert doubts(rm.torus().scale((1, 1e-4, 1)).scale(0.01) | rm.sphere(0.1))
    assert not doubts(rm.torus(100, 25).scale((1, 1e-5, 1)).scale(0.01) | rm.sphere(0.1))
