"""What stands within a pixel of a hit casts its soft shadow there, and is seen in a mirror, as in closed form."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

import raymarch as rm
from raymarch.scene.parameter import Values

Array = NDArray[np.float64]
CLOSED = rm.Quality(analytic=False)


def first_of_boxes(origins: Array, ray: Array, centres: Array, half: Array) -> Array:
    """Distances to the first of some boxes along rays of one direction, (N,); inf for none."""
    nearest = np.full(len(origins), np.inf)
    with np.errstate(divide="ignore", invalid="ignore"):
        for centre in centres:
            one, other = (centre - half - origins) / ray, (centre + half - origins) / ray
            enter, leave = np.maximum(np.minimum(one, other).max(axis=1), 0.0), np.maximum(one, other).min(axis=1)
            nearest = np.where(enter <= leave, np.minimum(nearest, enter), nearest)
    return nearest


def on_a_line(count: int, pitch: float) -> Array:
    """Centres of so many solids along z, (N, 3)."""
    z = (np.arange(count) - 0.5 * (count - 1)) * pitch
    return np.stack([0.0 * z, 0.0 * z, z], axis=1)


@pytest.mark.parametrize("penumbra", ["two-sided", "cone", "triangulated"])
@pytest.mark.parametrize("rise", [0.45, 0.52])
def test_a_soft_shadow_of_a_thin_fin_beside_a_hit(penumbra: str, rise: float) -> None:
    """Their first sample lies .36 of a pixel from a hit, and proves nothing of a fin at .12 to .19 of it."""
    rows, pixel = 96, 4.0 / 96
    half, pitch = np.array((4.5, 0.3 * pixel, 0.075 * pixel)), 1.41 * pixel
    fins = rm.box(tuple(2.0 * half)).repeat((None, None, pitch), (1, 1, 120))
    to_sun = np.array((0.0, rise, -np.sqrt(1.0 - rise * rise)))
    camera = rm.Camera((0, 6, 0), (0, 0, 0), up=(0, 0, -1), projection="orthographic", height=4.0)
    sun = rm.Sun(tuple(to_sun), shadow=True, softness=0.004, penumbra=penumbra)
    scene = rm.Scene(
        (fins | rm.plane()).material(rm.Material("white", ambient=0)), camera, [sun], sky=(0, 0, 0), quality=CLOSED
    )
    with rm.Renderer(size=(4, rows)) as renderer:
        lit = renderer.render(scene).color[:, 1, 1] > 0.02
    points = np.zeros((rows, 3))
    points[:, 2] = (np.arange(rows) + 0.5) * pixel - 2.0
    centres = on_a_line(120, pitch)
    on_floor = np.isinf(first_of_boxes(points + np.array((0, 1, 0)), np.array((1e-9, -1.0, 1e-9)), centres, half))
    edges = [to_sun + np.array((0.0, 0.0, side * 0.006)) for side in (-1.0, 0.0, 1.0)]
    reached = np.array([np.isinf(first_of_boxes(points, ray, centres, half)) for ray in edges])
    near = first_of_boxes(points, to_sun, centres, half) > 0.12 * pixel
    hidden = on_floor & near & ~reached.any(axis=0)
    assert hidden.sum() >= 15 and not lit[hidden].any()


@pytest.mark.parametrize("rise", [0.4, 0.52])
@pytest.mark.parametrize("integrator", ["path", "whitted"])
def test_a_thin_fin_beside_a_hit_is_seen_in_a_mirror(integrator: str, rise: float) -> None:
    """Fins of a quarter of a pixel on a mirror: reflected rays would pass over those before their first sample."""
    rows, pixel, across = 48, 4.0 / 48, float(np.sqrt(1.0 - rise * rise))
    half, pitch = np.array((4.5, 0.75 * rise * pixel, 0.125 * pixel)), 1.478 * pixel
    fins = rm.box(tuple(2.0 * half)).repeat((None, None, pitch), (1, 1, 80))
    black, mirror = (
        rm.Material(albedo=(0, 0, 0), roughness=1, f0=0),
        rm.Material(albedo=(1, 1, 1), metalness=1, roughness=0),
    )
    camera = rm.Camera((0, 6 * rise, 6 * across), (0, 0, 0), projection="orthographic", height=4.0)
    quality = rm.Quality(integrator=integrator, analytic=False)
    node = fins.material(black) | rm.plane().material(mirror)
    scene = rm.Scene(node, camera, lights=[], sky=(1, 1, 1), bounces=1, quality=quality)
    with rm.Renderer(size=(4, rows)) as renderer:
        bright = renderer.render(scene).color[:, 1, 1] > 0.5
    y = 2.0 - (np.arange(rows) + 0.5) * pixel
    starts = np.stack([0.0 * y, 6 * rise + y * across, 6 * across - y * rise], axis=1)
    down, centres = np.array((1e-9, -rise, -across)), on_a_line(80, pitch)
    floor = starts[:, 1] / rise
    points = starts + floor[:, None] * down
    seen = first_of_boxes(starts, down, centres, half) > floor
    hidden = seen & np.isfinite(first_of_boxes(points, np.array((1e-9, rise, -across)), centres, half))
    assert hidden.sum() >= 12 and not bright[hidden].any()


@pytest.mark.parametrize("kind", ["mirror", "shadow"])
def test_a_fin_in_closed_form_less_than_128_ulp_ahead(kind: str) -> None:
    """Fins of 16 ulp on a mirror, or in the sun: secondary rays meet those that they enter, however near."""
    ulp, rows, away = 2.0**-10, 48, 9000.0
    pixel, size = 8.0 * ulp, np.array((400.0, 32.0, 16.0)) * ulp
    centres = on_a_line(9, 64.0 * ulp)
    black, white = rm.Material("black", ambient=0), rm.Material("white", ambient=0)
    mirror = rm.Material(albedo=(1, 1, 1), metalness=1, roughness=0)
    fins = rm.union(*(rm.box(tuple(size)).translate(tuple(c)) for c in centres)).material(black)
    floor = rm.plane().material(mirror if kind == "mirror" else white)
    rise = 0.6
    to_sun = np.array((0.0, rise, -np.sqrt(1.0 - rise * rise)))
    down = np.array((0.0, -1.0, 0.0)) if kind == "shadow" else to_sun * (1, -1, 1)
    camera = rm.Camera(
        tuple(-away * down),
        (0, 0, 0),
        up=(0, 0, -1) if kind == "shadow" else (0, 1, 0),
        projection="orthographic",
        height=rows * pixel,
    )
    lights = [rm.Sun(tuple(to_sun), shadow=True)] if kind == "shadow" else []
    sky = (0, 0, 0) if kind == "shadow" else (1, 1, 1)
    quality = rm.Quality(analytic=True)
    scene = rm.Scene(fins | floor, camera, lights, sky=sky, bounces=1, quality=quality)
    with rm.Renderer(size=(4, rows)) as renderer:
        bright = renderer.render(scene).color[:, 1, 1] > 0.1
    starts, ray = scene.pose(Values({}, 0.0), 4 / rows).rays(np.array([1]), np.arange(rows)[:, None], (4, rows))
    starts, ray = np.broadcast_to(starts, (rows, 1, 3))[:, 0], np.broadcast_to(ray, (rows, 1, 3))[0, 0]
    t = starts[:, 1] / -ray[1]
    seen = first_of_boxes(starts, ray + 1e-12, centres, 0.5 * size) > t
    first = first_of_boxes(starts + t[:, None] * ray, to_sun + 1e-12, centres, 0.5 * size)
    hidden = seen & (first > 8.0 * ulp) & (first < 100.0 * ulp)
    assert hidden.sum() >= 6 and not bright[hidden].any()
