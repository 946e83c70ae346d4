"""Where rays that leave a solid meet it, by its closed form in float32: it is behind them."""

from __future__ import annotations

import numpy as np
import pytest

import raymarch as rm
from raymarch.expr.arrays import evaluator
from raymarch.expr.node import var
from raymarch.expr.types import VEC3
from raymarch.sdf.intersections import interval_of_ray

SOLIDS = {
    "sphere": rm.sphere(0.3),
    "ball far off": rm.sphere(0.02).translate((5.0, -3.0, 0.4)),
    "box": rm.box((0.4, 0.003, 0.7)),
    "cylinder": rm.cylinder(0.2, 0.9),
    "capsule": rm.capsule((0, -0.3, 0), (0.5, 0.3, 0), 0.15),
    "cone": rm.cone(0.4, 0.7, 0.0),
    "frustum": rm.cone(0.4, 0.5, 0.2),
    "ellipsoid": rm.ellipsoid((0.9, 0.2, 0.5)),
    "plane": rm.plane((0.3, 0.8, -0.5)),
}


@pytest.mark.parametrize("name", SOLIDS)
@pytest.mark.parametrize("grazing", [False, True])
def test_the_solid_of_a_hit_is_behind_the_rays_that_start_there(name: str, grazing: bool) -> None:
    """The bounds of light/solved_ahead, in ulp. Grazing rays start above the hit, as those of light/spawn_ray do."""
    random = np.random.default_rng(7)
    o, d = var("o", VEC3), var("d", VEC3)
    entries, exits = [], []
    for _ in range(6):
        moved = random.uniform(-1, 1, 3) * 10 ** random.uniform(-1, 1)
        node = SOLIDS[name].rotate(float(random.uniform(-3, 3)), tuple(random.normal(size=3))).translate(tuple(moved))
        ends = evaluator([interval_of_ray(node, o, d)], [o, d], np.float32)
        low, high = node.bounds if node.facts.bounded else (moved - 0.5, moved + 0.5)
        centre, reach = 0.5 * (low + high), 0.5 * float(np.max(high - low))
        eye = (centre + random.normal(size=3) * 10 ** random.uniform(-0.3, 0.7)).astype(np.float32)
        rays = centre + reach * random.uniform(-1, 1, (4000, 3)) - eye
        rays = (rays / np.linalg.norm(rays, axis=1, keepdims=True)).astype(np.float32)
        enter, leave = ends(eye, rays)[0].T
        met = (enter <= leave) & (enter > 0) & (enter < 100)
        t, p = enter[met], eye + enter[met, None] * rays[met]
        normal = node.gradient(p.astype(np.float64))
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        onward = random.normal(size=p.shape)
        onward -= (onward * normal).sum(axis=1, keepdims=True) * normal
        onward /= np.linalg.norm(onward, axis=1, keepdims=True)
        rise = 0.25 * 10 ** random.uniform(-3, 0, (len(p), 1)) if grazing else random.uniform(0.25, 1, (len(p), 1))
        onward = rise * normal + np.sqrt(1 - rise * rise) * onward
        ulp = 2.0**-23 * np.maximum(np.abs(p).max(axis=1), t)
        start = p + 4.0 * ulp[:, None] * np.maximum(1.0 - 4.0 * rise, 0.0) * normal
        enter, leave = ends(start.astype(np.float32), onward.astype(np.float32))[0].T
        crossed = enter <= leave
        entries.append((enter / ulp)[crossed])
        exits.append((leave / ulp)[crossed])
    assert sum(map(len, entries)) > 1000
    assert np.concatenate(entries).max() < 1.0 and np.concatenate(exits).max() < 13.0
