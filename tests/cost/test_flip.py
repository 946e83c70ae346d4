"""FLIP against its authors' evaluator; connected regions against scipy."""

from __future__ import annotations

import flip_evaluator
import numpy as np
import pytest
from scipy.ndimage import label

from raymarch.cost.flip import flip, largest_region

RANDOM = np.random.default_rng(7)


def pictures() -> list[tuple[str, np.ndarray, np.ndarray]]:
    smooth = np.stack(np.meshgrid(np.linspace(0, 1, 70), np.linspace(0, 1, 50)), -1)
    ramp = np.concatenate([smooth, 1 - smooth[..., :1]], -1).astype(np.float32)
    noisy = np.clip(ramp + RANDOM.normal(0, 0.1, ramp.shape), 0, 1).astype(np.float32)
    holed = ramp.copy()
    holed[20:24, 30:33] = 0
    green, blue = np.zeros_like(ramp), np.zeros_like(ramp)
    green[..., 1], blue[..., 2] = 1, 1
    tiny = RANDOM.random((3, 2, 3)).astype(np.float32)
    return [
        ("noise", ramp, noisy),
        ("hole", ramp, holed),
        ("worst colours", green, blue),
        ("shifted", ramp, np.roll(ramp, 1, 1)),
        ("tiny", tiny, tiny[::-1].copy()),
    ]


@pytest.mark.parametrize(("a", "b"), [p[1:] for p in pictures()], ids=[p[0] for p in pictures()])
def test_it_is_what_the_authors_compute(a, b):
    theirs, mean, _ = flip_evaluator.evaluate(a, b, "LDR", inputsRGB=False, applyMagma=False)
    ours = flip(a, b)
    assert np.abs(ours - theirs[..., 0]).max() < 2e-4  # theirs is float32, whose rounding passes through a square root
    assert abs(ours.mean() - mean) < 5e-5


def test_equal_pictures_differ_nowhere():
    _, a, _ = pictures()[0]
    assert flip(a, a).max() == 0.0


def test_what_a_screen_cannot_show_counts_as_its_end():
    _, a, b = pictures()[0]
    beyond = np.where(a >= 1.0, 7.0, a)
    assert np.array_equal(flip(beyond, b), flip(a, b))
    hole = b.copy()
    hole[3, 4] = np.nan
    assert np.all(np.isfinite(flip(a, hole)))


@pytest.mark.parametrize("shape", [(4, 4), (4, 5, 3), (4, 4, 4), (0, 4, 3)])
def test_other_shapes_are_refused(shape):
    with pytest.raises(ValueError, match="shape"):
        flip(np.zeros(shape), np.zeros((4, 4, 3)))


@pytest.mark.parametrize("share", [0.0, 0.05, 0.3, 0.41, 0.6, 1.0])
def test_largest_region(share):
    mask = RANDOM.random((40, 90)) < share
    found, _ = label(mask, np.ones((3, 3)))
    assert largest_region(mask) == (np.bincount(found[mask]).max() if mask.any() else 0)


def test_a_region_that_winds_is_one():
    mask = np.zeros((41, 41), bool)
    mask[::2] = True
    mask[1::4, -1] = True
    mask[3::4, 0] = True
    assert largest_region(mask) == mask.sum()
