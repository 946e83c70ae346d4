"""The hand-written tracer draws the scene that raymarch draws."""

from __future__ import annotations

import numpy as np

import raymarch as rm
from raymarch.cost.errors import measure
from raymarch.cost.reference import reference
from tests.bench import basic

SIZE = (64, 48)


def test_both_hit_the_scene(egl):
    """By hand: within its own threshold, without the last rows before the horizon, where its steps run out."""
    known = reference(basic.scene(), SIZE, samples=0)
    color, depth = basic.draw_basic(egl, SIZE)
    hit = np.isfinite(depth) & known.hit & ~known.edges
    assert hit.sum() > 0.95 * (known.hit & ~known.edges).sum()
    assert not (np.isfinite(depth) & ~known.hit & ~known.edges).any()
    cosine = -np.sum(known.normal * known.direction, axis=-1)
    assert np.all(np.abs(depth[hit] - known.depth[hit]) * cosine[hit] <= 1.5e-4 * known.depth[hit])

    with rm.Renderer(SIZE) as renderer:
        frame = renderer.render(basic.scene(), outputs=("color", "depth"))
        ours = measure(known, frame.depth)
    assert ours.missed == 0 and ours.missed_at_edges == 0
    assert 500 * ours.pixels_p99 < measure(known, depth).pixels_p99
    inner = hit & (np.abs(frame.color - color).max(-1) < 0.02)
    assert inner.sum() > 0.97 * hit.sum()  # shadows of both end at other samples
