"""`sample`, `pdf` and `eval` of each BSDF agree: chi-squared of the directions, and the means of the weights."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.special import chdtri

from raymarch import glsl
from raymarch.expr.hashing import PCG_GLSL
from raymarch.expr.node import const, expr
from raymarch.gpu.context import Context
from raymarch.gpu.program import FULL_SCREEN, Program
from raymarch.gpu.targets import Target
from raymarch.scene.bsdf import BSDF, Microfacets, Phong
from raymarch.scene.layers import Blend, Coated
from tests.functions.directions import slanted
from tests.support.bsdf import density, evaluated, material, sampled
from tests.truth.lobes import random_of_pixel

N = 100_000
ACROSS, AROUND = 12, 8
Array = NDArray[np.float64]


def numbers() -> Array:
    """Two dimensions of the pixel's own random numbers: those of the shader are tested, not NumPy's."""
    x, y = np.arange(N) % 1000, np.arange(N) // 1000
    return np.stack([random_of_pixel(x, y, 3, d) for d in (17, 18)], axis=1).astype(np.float64)


def binned(found: Array, weights: Array | None = None) -> Array:
    """Directions above the surface, counted by cosine and angle."""
    bins = np.linspace(0, 1, ACROSS + 1), np.linspace(-np.pi, np.pi, AROUND + 1)
    return np.histogram2d(found[:, 2], np.arctan2(found[:, 1], found[:, 0]), bins, weights=weights)[0]


def integrated(function: Callable[[Array], Array], fine: int = 32) -> Array:
    """The integral of a function of directions over each bin."""
    z = (np.arange(ACROSS * fine) + 0.5) / (ACROSS * fine)
    turn = -np.pi + 2 * np.pi * (np.arange(AROUND * fine) + 0.5) / (AROUND * fine)
    zz, tt = np.meshgrid(z, turn, indexing="ij")
    s = np.sqrt(1 - zz**2)
    at = np.stack([s * np.cos(tt), s * np.sin(tt), zz], axis=-1).reshape(-1, 3)
    cells = function(at).reshape(ACROSS, fine, AROUND, fine).mean(axis=(1, 3))
    return np.asarray(cells * 2 * np.pi / (ACROSS * AROUND))


def chi_squared(found: Array, expected: Array) -> tuple[float, int]:
    """Of directions against the expected share of each bin; and its freedom."""
    counts, expected = binned(found), N * expected
    enough = expected > 20
    return float((((counts - expected) ** 2)[enough] / expected[enough]).sum()), int(enough.sum()) - 1


BSDFS: Mapping[str, tuple[BSDF, Mapping[str, Any]]] = {
    "dielectric": (Microfacets(), material(color=(0.6, 0.6, 0.6), metalness=0.0, roughness=0.6)),
    "metal": (Microfacets(), material(color=(0.9, 0.9, 0.9), metalness=1.0, roughness=0.7)),
    "separable": (Microfacets("separable"), material(color=(0.9, 0.9, 0.9), metalness=1.0, roughness=0.8)),
    "compensated": (Microfacets(compensated=True), material(color=(0.9, 0.9, 0.9), metalness=0.8, roughness=0.9)),
    "coated": (
        Coated(Microfacets(compensated=True)),
        material(color=(0.7, 0.7, 0.7), metalness=0.4, roughness=0.8, clearcoat=0.9, clearcoat_roughness=0.6),
    ),
    "phong": (Phong(), material(color=(0.5, 0.5, 0.5), shininess=8.0, specular=0.0, ambient=0.0)),
    "blend": (
        Blend(Phong(), Microfacets()),
        material(color=(0.5, 0.5, 0.5), shininess=8.0, specular=0.0, ambient=0.0, metalness=0.5, roughness=0.8)
        | {"physical": expr(0.3)},
    ),
}


@pytest.mark.parametrize("cosine", [0.3, 0.9])
@pytest.mark.parametrize("name", BSDFS)
def test_directions_have_their_density_and_weights_the_value(name: str, cosine: float) -> None:
    """The directions of `sample` have the density `pdf`. The weights in each bin add up to the integral of `eval`."""
    bsdf, values = BSDFS[name]
    drawn = np.random.default_rng(4).random((N, 6))
    u = {"direction": numbers(), **{n: drawn[:, i] for i, n in enumerate(("lobe", "model", "several", "coat"))}}
    view = slanted(cosine)
    directions, weights = sampled(None, bsdf, values, np.broadcast_to(view, (N, 3)), u)
    statistic, freedom = chi_squared(directions, integrated(lambda d: density(bsdf, values, d, view)))
    assert statistic < chdtri(freedom, 0.0001)
    views = lambda d: np.broadcast_to(view, d.shape)  # noqa: E731
    known = integrated(lambda d: evaluated(None, bsdf, values, d, views(d))[:, 0] / np.pi)
    found, spread = binned(directions, weights[:, 0]) / N, np.sqrt(binned(directions, weights[:, 0] ** 2)) / N
    known_well = known > 1e-3
    assert np.all((np.abs(found - known) < 5 * spread + 2e-3 * known)[known_well])


def test_a_wrong_density_is_found_out() -> None:
    """The even hemisphere for the cosine lobe, and the microfacets of another roughness."""
    view, bsdf = slanted(0.6), Microfacets()
    u = {"direction": numbers(), "lobe": np.random.default_rng(4).random(N)}
    metal = material(color=(1.0, 1.0, 1.0), metalness=1.0, roughness=0.7)
    directions, _ = sampled(None, bsdf, metal, np.broadcast_to(view, (N, 3)), u)
    rougher = {**metal, "roughness": const(0.73)}
    assert chi_squared(directions, integrated(lambda d: density(bsdf, rougher, d, view)))[0] > 300
    matte, _ = sampled(None, *BSDFS["phong"], np.broadcast_to(view, (N, 3)), u)
    assert chi_squared(matte, integrated(lambda d: 0 * d[:, 2] + 0.5 / np.pi))[0] > 1e4


def test_numbers_are_even_and_dimensions_independent() -> None:
    u = numbers()
    counts, *_ = np.histogram2d(u[:, 0], u[:, 1], 32, [[0, 1], [0, 1]])
    expected = N / 32**2
    assert ((counts - expected) ** 2 / expected).sum() < chdtri(32**2 - 1, 0.001)
    assert abs(np.corrcoef(u.T)[0, 1]) < 0.004


def test_the_device_has_the_same_numbers(egl: Context) -> None:
    """Bit for bit."""
    module = "\n".join(glsl.load("random/pixel").lines)
    main = """
layout(location = 0) out vec4 one;
void main() {
    one = vec4(random_of_pixel(17), random_of_pixel(18), 0.0, 1.0);
}
"""
    with Target(egl, (64, 32)) as target:
        source = f"#version 330 core\n{PCG_GLSL}\n{module}\n{main}"
        Program(egl, FULL_SCREEN, source, lambda line: ("", None), "test").draw(target, {"u_sample": 3})
        one = target.read(0)[::-1]
    y, x = np.mgrid[0:32, 0:64]
    u = np.stack([random_of_pixel(x.ravel(), y.ravel(), 3, d) for d in (17, 18)], axis=1)
    assert np.array_equal(one[..., :2].reshape(-1, 2), u)
