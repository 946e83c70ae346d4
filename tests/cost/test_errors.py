"""Each error against a frame that was spoiled by a known amount."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from raymarch.cost.errors import footprints, measure
from raymarch.cost.reference import Reference


def test_the_truth_has_no_error(known: Reference):
    found = measure(known, known.depth, known.normal, known.picture)
    assert found.sound
    assert found.pixels == int((known.hit & ~known.edges).sum())
    for name, value in found.as_dict().items():
        if name not in ("pixels", "apart"):
            assert value == pytest.approx(0.0, abs=1e-5), name


def test_depth_in_footprints_and_in_length(known: Reference):
    depth = known.depth + 0.25 * known.pixel * known.depth
    found = measure(known, depth)
    assert found.pixels_p50 == pytest.approx(0.25)
    assert found.pixels_p99 == pytest.approx(0.25)
    assert found.pixels_max == pytest.approx(0.25)
    inner = known.hit & ~known.edges
    off = 0.25 * known.pixel * known.depth
    assert found.depth_rms == pytest.approx(np.sqrt(np.mean(off[inner] ** 2)))
    assert found.depth_max == pytest.approx(off[inner].max())
    assert found.p1 == pytest.approx(np.sum(off[known.hit] ** 2))


def test_rays_on_their_way_count_with_how_far_they_came(known: Reference):
    depth = np.where(known.edges, np.inf, known.depth)
    reach = np.where(np.isfinite(known.depth), known.depth - 0.5, 0.0)
    found = measure(known, depth, reach=reach)
    assert found.p1 == pytest.approx(0.25 * (known.hit & known.edges).sum())
    assert measure(known, depth).p1 == 0.0


def test_a_few_bad_pixels_are_in_the_maximum_alone(known: Reference):
    depth = known.depth.copy()
    row, column = np.argwhere(known.hit & ~known.edges)[5]
    depth[row, column] *= 1.0 + 3.0 * known.pixel
    found = measure(known, depth)
    assert found.pixels_p99 == 0.0
    assert found.pixels_max == pytest.approx(3.0)


@pytest.mark.parametrize(
    ("where", "names"), [("inner", ("missed", "false")), ("edge", ("missed_at_edges", "false_at_edges"))]
)
def test_hits_that_are_missed_and_made_up(known: Reference, where, names):
    here = known.edges if where == "edge" else ~known.edges
    depth = known.depth.copy()
    lost = np.argwhere(here & known.hit)[:3]
    won = np.argwhere(here & ~known.hit)[:2]
    depth[tuple(lost.T)] = np.inf
    depth[tuple(won.T)] = 2.0
    found = measure(known, depth)
    counts = found.as_dict()
    assert (counts[names[0]], counts[names[1]]) == (3, 2)
    assert sum(counts[n] for n in ("missed", "false", "missed_at_edges", "false_at_edges")) == 5
    assert found.sound == (where == "edge")
    assert np.isinf(footprints(known, depth)).sum() == 5


def test_nan_is_a_missed_hit(known: Reference):
    depth = known.depth.copy()
    row, column = np.argwhere(known.hit & ~known.edges)[0]
    depth[row, column] = np.nan
    assert measure(known, depth).missed == 1


def test_normals_in_degrees(known: Reference):
    helper = np.where(np.abs(known.normal[..., :1]) < 0.9, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    side = np.cross(known.normal, helper)
    side /= np.maximum(np.linalg.norm(side, axis=-1, keepdims=True), 1e-30)
    turned = 5.0 * (np.cos(np.radians(3)) * known.normal + np.sin(np.radians(3)) * side)
    found = measure(known, known.depth, turned)
    assert found.normal_p50 == pytest.approx(3.0)
    assert found.normal_max == pytest.approx(3.0)


def test_a_hole_in_the_picture_is_a_region(known: Reference):
    color = known.picture.copy()
    color[10:16, 20:25] = (0, 1, 0)
    found = measure(known, known.depth, color=color)
    assert 30 <= found.flip_region <= 130  # what is near it changes to the eye too
    assert found.flip_max > 0.5 > found.flip_mean


def test_nothing_to_compare(known: Reference):
    found = measure(known, np.full(known.depth.shape, np.inf))
    assert found.pixels == 0
    assert found.as_dict()["pixels_p99"] is None


def test_other_shapes_are_refused(known: Reference):
    with pytest.raises(ValueError, match=r"\(2, 2\)"):
        measure(known, np.zeros((2, 2)))


def test_a_picture_of_silhouettes_alone_is_compared_at_them(known: Reference):
    everywhere = replace(known, edges=np.ones(known.edges.shape, np.bool_))
    found = measure(everywhere, known.depth * (1 + known.pixel))
    assert not found.apart
    assert found.pixels == known.hit.sum()
    assert found.pixels_p99 == pytest.approx(1.0)
    assert measure(known, known.depth).apart
