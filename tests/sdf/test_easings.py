"""Easing curves go from 0 to 1, and their steepest slopes are those that the bound of `extrude_to` divides by."""

from __future__ import annotations

import numpy as np
import pytest

from raymarch.expr.arrays import evaluator
from raymarch.expr.node import var
from raymarch.expr.types import FLOAT
from raymarch.sdf.profiles import EASINGS


@pytest.mark.parametrize("name", EASINGS)
def test_an_easing(name: str) -> None:
    curve, steepest = EASINGS[name]
    t = var("t", FLOAT)
    at = np.linspace(0.0, 1.0, 20001)
    found = evaluator([curve(t)], [t])(at)[0]
    slopes = np.diff(found) / np.diff(at)
    np.testing.assert_allclose(found[[0, -1]], [0.0, 1.0], atol=1e-12)
    assert slopes.min() >= -1e-9 and steepest - 1e-3 <= slopes.max() <= steepest + 1e-9
    if name.startswith("out_"):
        mirrored = evaluator([EASINGS[f"in_{name[4:]}"][0](t)], [t])(1.0 - at)[0]
        np.testing.assert_allclose(found, 1.0 - mirrored, atol=1e-12)
