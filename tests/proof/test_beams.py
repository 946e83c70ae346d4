"""Beams around neighbouring rays."""

from __future__ import annotations

import numpy as np

import raymarch as rm
from raymarch.proof.beams import beside_beams
from raymarch.proof.parts import Operands
from raymarch.proof.rays import Rays, picked
from raymarch.scene.parameter import Values


def test_what_beams_cut_off_is_free_on_each_ray() -> None:
    """Of a blend of small balls, seen by rays that pass between them; a box beside it keeps its stretches."""
    random, side, reach = np.random.default_rng(8), 24, 20.0
    balls = [rm.sphere(0.15).translate(place) for place in random.uniform(-2.0, 2.0, (40, 3))]
    solid = rm.union(*balls, k=0.1)
    across = np.stack(np.meshgrid(*[np.linspace(-0.3, 0.3, side)] * 2), axis=-1).reshape(-1, 2)
    for given, from_ in (([across[:, 0], across[:, 1], -1.0 + 0.0 * across[:, 0]], 0.0), ([0.0, 0.0, -1.0], 10.0)):
        way = np.stack(np.broadcast_arrays(*given, np.zeros(len(across)))[:3], axis=1)
        way /= np.linalg.norm(way, axis=1, keepdims=True)
        rays = Rays(np.pad(from_ * across, ((0, 0), (0, 1))) + np.array([0.0, 0.0, 9.0]), way)
        made = Operands(solid | rm.box(9.0).translate((0.0, -7.0, 0.0)), Values({}, 0.0), "camera", whole=False)
        whole = made.met(rays, np.zeros(len(way)), np.full(len(way), reach))
        evaluations = np.zeros(len(way), np.int64)
        left = beside_beams(made, rays, whole, evaluations)
        counts = [len(work) - made.blends[work.operands].sum() for work in (whole, left)]
        assert counts[0] == counts[1] > 0 and 0 < evaluations.sum() < len(way)
        first, last = np.full(len(way), np.inf), np.full(len(way), -np.inf)
        mine = left[made.blends[left.operands]]
        first[mine.rays], last[mine.rays] = mine.start, mine.end
        t = np.linspace(0.0, reach, 801)[:, None]
        value = solid.distance((rays.origins + t[..., None] * rays.directions).reshape(-1, 3)).reshape(len(t), -1)
        cut = (t < first) | (t > last)
        assert np.all(value[cut] > 0.0) and np.any(value < 0.0, axis=0).sum() > 20
        assert np.sum(last - first, where=first < np.inf) < 0.7 * np.sum(whole.end - whole.start)


def test_rows_are_picked_with_each_component_in_one_run() -> None:
    for shape in ((7,), (7, 3), (7, 3, 3)):
        values, rows = np.random.default_rng(1).random(shape), np.array([3, 0, 3])
        found = picked(values, rows)
        assert np.array_equal(found, values[rows]) and found.flags.f_contiguous
