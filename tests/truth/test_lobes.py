"""Random directions have the densities that their weights divide by: chi-squared at a million samples."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2

from raymarch import glsl
from raymarch.expr.hashing import PCG_GLSL
from raymarch.gpu.context import Context
from raymarch.gpu.program import FULL_SCREEN, Program
from raymarch.gpu.targets import Target
from tests.truth.lobes import pdf_visible_normal, random_of_pixel, sample_cosine, sample_visible_normal

N = 1_000_000
ACROSS, AROUND = 16, 12


def numbers() -> Any:
    """Two dimensions of the pixel's own random numbers: those of the shader are tested, not NumPy's."""
    x, y = np.arange(N) % 1000, np.arange(N) // 1000
    return np.stack([random_of_pixel(x, y, 3, d) for d in (17, 18)], axis=1).astype(np.float64)


def chi_squared(found: Any, density: Callable[[Any], Any]) -> tuple[float, int]:
    """Of directions binned by cosine and angle, against the integral of a density over each bin; and its freedom."""
    bins = np.linspace(0, 1, ACROSS + 1), np.linspace(-np.pi, np.pi, AROUND + 1)
    counts, *_ = np.histogram2d(found[:, 2], np.arctan2(found[:, 1], found[:, 0]), bins)
    fine = 64
    z = (np.arange(ACROSS * fine) + 0.5) / (ACROSS * fine)
    turn = -np.pi + 2 * np.pi * (np.arange(AROUND * fine) + 0.5) / (AROUND * fine)
    zz, tt = np.meshgrid(z, turn, indexing="ij")
    s = np.sqrt(1 - zz**2)
    at = np.stack([s * np.cos(tt), s * np.sin(tt), zz], axis=-1).reshape(-1, 3)
    cell = density(at).reshape(ACROSS, fine, AROUND, fine).mean(axis=(1, 3)) * 2 * np.pi / (ACROSS * AROUND)
    expected = N * cell
    enough = expected > 20
    statistic = float((((counts - expected) ** 2)[enough] / expected[enough]).sum())
    return statistic, int(enough.sum()) - 1


def test_cosine_lobe() -> None:
    statistic, freedom = chi_squared(sample_cosine(numbers()), lambda d: d[:, 2] / np.pi)
    assert statistic < chi2.ppf(0.999, freedom)


@pytest.mark.parametrize("alpha", [0.3, 0.7, 1.0])
@pytest.mark.parametrize("cosine", [0.2, 0.6, 0.99])
def test_facets_that_are_seen(alpha: float, cosine: float) -> None:
    view = np.array([np.sqrt(1 - cosine**2), 0.0, cosine])
    statistic, freedom = chi_squared(
        sample_visible_normal(view, alpha, numbers()), lambda h: pdf_visible_normal(view, alpha, h)
    )
    assert statistic < chi2.ppf(0.999, freedom)


def test_a_wrong_density_is_found_out() -> None:
    """The even hemisphere for the cosine lobe, and the facets of another roughness."""
    u = numbers()
    assert chi_squared(sample_cosine(u), lambda d: 0 * d[:, 2] + 0.5 / np.pi)[0] > 1e4
    view = np.array([0.8, 0.0, 0.6])
    assert chi_squared(sample_visible_normal(view, 0.5, u), lambda h: pdf_visible_normal(view, 0.52, h))[0] > 500


def test_numbers_are_even_and_dimensions_independent() -> None:
    u = numbers()
    counts, *_ = np.histogram2d(u[:, 0], u[:, 1], 32, [[0, 1], [0, 1]])
    expected = N / 32**2
    assert ((counts - expected) ** 2 / expected).sum() < chi2.ppf(0.999, 32**2 - 1)
    assert abs(np.corrcoef(u.T)[0, 1]) < 0.004


def test_the_device_has_the_same_numbers_and_directions(egl: Context) -> None:
    """The numbers bit for bit; directions to float32."""
    modules = "\n".join("\n".join(glsl.load(name).lines) for name in ("random/pixel", "path/lobes"))
    main = """
layout(location = 0) out vec4 one;
layout(location = 1) out vec4 two;
void main() {
    vec2 u = vec2(random_of_pixel(17), random_of_pixel(18));
    one = vec4(sample_cosine(vec3(0.0, 0.0, 1.0), u), u.x);
    two = vec4(sample_visible_normal(vec3(0.0, 0.0, 1.0), vec3(0.8, 0.0, 0.6), 0.5, u), u.y);
}
"""
    with Target(egl, (64, 32), 2) as target:
        Program(
            egl, FULL_SCREEN, f"#version 330 core\n{PCG_GLSL}\n{modules}\n{main}", lambda line: ("", None), "test"
        ).draw(target, {"u_sample": 3})
        one, two = target.read(0)[::-1], target.read(1)[::-1]
    y, x = np.mgrid[0:32, 0:64]
    u = np.stack([random_of_pixel(x.ravel(), y.ravel(), 3, d) for d in (17, 18)], axis=1)
    assert np.array_equal(one[..., 3].ravel(), u[:, 0]) and np.array_equal(two[..., 3].ravel(), u[:, 1])
    # About z, the branchless basis is that of x and y.
    np.testing.assert_allclose(one[..., :3].reshape(-1, 3), sample_cosine(u.astype(np.float64)), atol=2e-3)
    wanted = sample_visible_normal(np.array([0.8, 0.0, 0.6]), 0.5, u.astype(np.float64))
    np.testing.assert_allclose(two[..., :3].reshape(-1, 3), wanted, atol=2e-3)
