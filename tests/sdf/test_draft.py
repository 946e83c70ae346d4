"""Extrusions whose sides lean, against frusta and sections."""

from __future__ import annotations

import math

import numpy as np
import pytest

import raymarch as rm
from raymarch.errors import SceneError


def test_a_drafted_rectangle_is_a_frustum() -> None:
    """Sides of the frustum are planes: the distance to the nearest face inside, and the sign everywhere."""
    draft, size, height = 0.3, np.array((2.0, 1.0)), 0.8
    points = np.random.default_rng(1).uniform(-1.5, 1.5, (20_000, 3))
    found = rm.rectangle(tuple(size)).extrude(height, draft=draft).distance(points)
    x, y, z = np.abs(points[:, 0]), np.abs(points[:, 1]), points[:, 2]
    inset = (z + 0.5 * height) * math.tan(draft)
    faces = [
        np.abs(z) - 0.5 * height,
        *((a - 0.5 * s + inset) * math.cos(draft) for a, s in zip((x, y), size, strict=True)),
    ]
    true = np.max(faces, axis=0)
    inside = true < 0.0
    assert 0.02 < inside.mean() < 0.5
    np.testing.assert_allclose(found[inside], true[inside], atol=1e-12)
    assert np.all((found < 0.0) == inside)


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("draft", [-0.4, 0.2, 0.9])
def test_each_section_is_the_outline_moved(draft: float, scale: float) -> None:
    """Of a ring: at every height both circles move; where the ring has closed, nothing is left."""
    ring = (rm.circle(scale) - rm.circle(0.5 * scale)).extrude(0.4 * scale, draft=draft)
    for share in (0.01, 0.5, 0.99):
        z, inset = (share - 0.5) * 0.4 * scale, share * 0.4 * scale * math.tan(draft)
        for radius, outwards in ((scale - inset, 1.0), (0.5 * scale + inset, -1.0)):
            open_ring = 0.5 * scale + inset < scale - inset
            for off in (-1e-3, 1e-3):
                value = float(ring.distance([(radius + off * outwards * scale, 0.0, z)])[0])
                assert (value < 0.0) == (off < 0.0 and open_ring and radius > 0.0), (share, radius, off)


def test_it_is_seen_measured_and_moved() -> None:
    """The volume of a frustum of a cone; a Param; the box; what is refused."""
    made = rm.circle(1.0).extrude(1.0, draft=0.25)
    top = 1.0 - math.tan(0.25)
    assert rm.measure(made).volume == pytest.approx(math.pi / 3 * (1 + top + top * top), rel=3e-3)
    np.testing.assert_allclose(rm.circle(1.0).extrude(1.0, draft=-0.25).bounds[1], (1 + math.tan(0.25),) * 2 + (0.5,))
    moving = rm.circle(1.0).extrude(1.0, draft=rm.Param("lean", 0.1, -0.5, 0.5))
    with rm.Renderer((32, 18)) as renderer:
        camera = rm.Camera((0, 5, 0.01), (0, 0, 0))
        for lean in (-0.5, 0.5):
            still = rm.Scene(rm.circle(1.0).extrude(1.0, draft=lean), camera)
            depths = (renderer.render(s, params=p, outputs=("depth",)).depth for s, p in (
                (still, {}), (rm.Scene(moving, camera), {"lean": lean})))  # fmt: skip
            np.testing.assert_allclose(*depths, atol=2e-3)
    for wrong in (2.0, "steep"):
        with pytest.raises(SceneError, match="extrude: draft"):
            rm.circle(1.0).extrude(1.0, draft=wrong)
    with pytest.raises(SceneError, match="draft beside scale or twist"):
        rm.circle(1.0).extrude(1.0, scale=0.5, draft=0.1)
