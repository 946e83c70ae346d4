"""Ranges of expressions that use a value more than once: they hold sampled values, and are hardly wider."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.expr.arrays import evaluator
from raymarch.expr.intervals import interval_of
from raymarch.sdf.cells import Cells

INDEX = Cells((-40.0, 0.0, -40.0), (40.0, 0.0, 40.0)).index
H = rm.hash(INDEX)
P = rm.Param("p", 0.5, -1.0, 2.0)
S = rm.sin(rm.time)

KNOWN: list[tuple[Any, Any, Any]] = [
    (4.0 * H * (1.0 - H), 0.0, 1.0),
    (3.0 * H * H - 2.0 * H * H * H, 0.0, 1.0),
    (P**3 - 3.0 * P, -2.0, 2.0),
    (P * P - P * H + H * H, 0.0, 4.0),
    (S * (1.0 - S), -2.0, 0.25),
    (rm.vec3(H * (1.0 - H), H, 1.0 - H), (0.0, 0.0, 0.0), (0.25, 1.0, 1.0)),
    (rm.value_noise(0.3 * INDEX), -1.0, 1.0),
    (rm.mix(1.0, 3.0, H), 1.0, 3.0),
    (rm.colormap(H, ["white", "black", "red"]), (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)),
    (rm.colormap(0.25 * H, ["white", "black", "red", "red", "red"]), (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)),
    (rm.colormap(0.5 + 0.5 * H, ["white", "black", "red"]), (0.0, 0.0, 0.0), (1.0, 0.0, 0.0)),
]


@pytest.mark.parametrize(("value", "low", "high"), KNOWN)
def test_ranges_in_closed_form(value: Any, low: Any, high: Any) -> None:
    """Within a thousandth of the width."""
    least, most = interval_of(value)
    slack = 1e-3 * np.max(np.subtract(high, low))
    assert np.all(least <= np.add(low, 1e-9)) and np.all(most >= np.subtract(high, 1e-9))
    np.testing.assert_allclose(least, low, atol=slack)
    np.testing.assert_allclose(most, high, atol=slack)


@pytest.mark.parametrize("seed", range(6))
def test_random_polynomials(seed: int) -> None:
    random = np.random.default_rng(seed)
    a, b = random.uniform(-3, 3, (2, 6))
    value = sum(x * P**i * H**j for x, i, j in zip(a, (1, 2, 3, 0, 1, 2), (0, 1, 0, 2, 3, 1), strict=True)) + b[0]
    p, h = np.meshgrid(np.linspace(-1, 2, 400), np.linspace(0, 1, 400))
    found = sum(x * p**i * h**j for x, i, j in zip(a, (1, 2, 3, 0, 1, 2), (0, 1, 0, 2, 3, 1), strict=True)) + b[0]
    least, most = interval_of(value)
    width = np.ptp(found)
    assert least <= found.min() and most >= found.max()
    assert most - least <= 1.05 * width


def test_a_colour_of_a_cell_is_drawn() -> None:
    def build(i: Any) -> Any:
        return rm.box(0.4).material(rm.Material(rm.colormap(rm.hash(i), "viridis")))

    cells = rm.repeat_varied(build, 1, (3, 1, 3))
    assert np.isfinite(rm.truth(rm.Scene(cells), size=(8, 6)).color).all()
    with pytest.raises(rm.SceneError, match="between"):
        rm.Material(rm.colormap(H, "viridis") * 1.2)


def test_values_lie_in_their_ranges() -> None:
    value = rm.colormap(P * P - 0.5 * P, "inferno")
    low, high = interval_of(value)
    for p in np.linspace(-1, 2, 50):
        at = np.ravel(evaluator([rm.colormap(float(p * p - 0.5 * p) + 0.0 * P, "inferno")], [])()[0])
        assert np.all((at >= low - 1e-9) & (at <= high + 1e-9))
