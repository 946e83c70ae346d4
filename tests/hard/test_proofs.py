"""The judge of random scenes by intervals: silent about right pictures, and not about wrong ones."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

import raymarch as rm
from tests.hard.proofs import contradicted

SCENE = rm.Scene(
    rm.sphere(0.5).translate((0, 0.5, 0)) | rm.plane(),
    rm.Camera((1.0, 1.5, 4.0), (0, 0.4, 0)),
    [rm.Sun((-0.6, 1.0, -0.9), shadow=True)],
)


def test_right_and_wrong_hits() -> None:
    truth = rm.truth(SCENE, (24, 14), outputs=("depth",))
    assert contradicted(SCENE, truth, shadows=True) == []
    moved = SimpleNamespace(depth=np.where(np.arange(24) == 12, 0.9, 1.0) * truth.depth)
    (said,) = contradicted(SCENE, moved)
    assert said == "11 hits are contradicted by intervals, the first in row 3, column 12"  # the others are sky


def test_a_flat_field_and_an_estimate_are_asked_less() -> None:
    """A hit before the surface may be one of a valley; one behind it is wrong in any case."""
    flat = SCENE.replace(node=rm.pipe(rm.sphere(), rm.sphere(1.1).translate((0.05, 0.02, 0)), 0.072))
    depth = rm.truth(flat, (24, 14), outputs=("depth",)).depth
    assert contradicted(flat, SimpleNamespace(depth=0.9 * depth)) == []
    assert "hits are contradicted" in contradicted(flat, SimpleNamespace(depth=1.1 * depth))[0]
    fractal = SCENE.replace(node=rm.mandelbulb())
    assert contradicted(fractal, SimpleNamespace(depth=np.ones((2, 2)))) == []
