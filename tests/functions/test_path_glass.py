"""Rough glass, and glass that lights shine on: functions alone, against integrals in float64."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from raymarch.expr.function import Function
from raymarch.expr.node import const, var
from raymarch.expr.types import FLOAT, VEC2, VEC3
from raymarch.expr.vocabulary import get
from raymarch.gpu.context import Context
from raymarch.scene.bsdf import over_dielectric
from raymarch.scene.reflectance import sample_rough_dielectric
from tests.support.bsdf import Z as UP
from tests.support.bsdf import material
from tests.support.glsl_harness import evaluate

ULP = 2.0**-24
PI = float(np.pi)


def frosted(
    egl: Context, roughness: float, ior: float, side: float, views: ArrayLike, drawn: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
    """Directions, weights, and whether the side changed, for eyes and random numbers, (N, 3); z is the normal. A way
    that does not go on has the weight 0."""
    drawn = np.asarray(drawn)
    symbols = [var(name, type) for name, type in (("view", VEC3), ("u", VEC2), ("choice", FLOAT))]
    found = sample_rough_dielectric(UP, symbols[0], ior, side, roughness, *symbols[1:])
    parts = (Function("part", tuple(symbols), get(found, name)) for name in ("direction", "weight"))
    direction, weight = (evaluate(egl, part, [views, drawn[:, :2], drawn[:, 2]]).astype(np.float64) for part in parts)
    assert np.all(np.isfinite(direction)) and np.all(np.isfinite(weight))
    return direction, weight[:, 0], (weight[:, 0] > 0.0) & (direction[:, 2] < 0.0)


def eye(cosine: float) -> NDArray[np.float64]:
    return np.array([np.sqrt(1.0 - cosine * cosine), 0.0, cosine])


def even(n: int) -> NDArray[np.float64]:
    """Points that fill a cube evenly."""
    return np.asarray((np.arange(n)[:, None] * (0.8191725134, 0.6710436067, 0.5497004779) + 0.5) % 0.9999999)


def hemisphere(n: int = 700) -> tuple[NDArray[np.float64], float]:
    """Directions above z = 0, and the solid angle of each."""
    c, turn = (a.ravel() for a in np.meshgrid((np.arange(n) + 0.5) / n, (np.arange(n) + 0.5) * 2 * PI / n))
    s = np.sqrt(1.0 - c * c)
    return np.stack([s * np.cos(turn), s * np.sin(turn), c], axis=1), 2 * PI / n**2


def fresnel(cosine: NDArray[np.float64], ratio: float) -> NDArray[np.float64]:
    """Unpolarised; ratio is the index on the side of the light over that beyond."""
    beyond = np.sqrt(np.maximum(1.0 - ratio**2 * (1.0 - cosine**2), 0.0))
    upright = ((ratio * cosine - beyond) / (ratio * cosine + beyond)) ** 2
    lying = ((cosine - ratio * beyond) / (cosine + ratio * beyond)) ** 2
    return np.where(ratio**2 * (1.0 - cosine**2) >= 1.0, 1.0, 0.5 * (upright + lying))


def density(z: NDArray[np.float64], alpha: float) -> NDArray[np.float64]:
    """GGX."""
    return np.asarray(alpha**2 / (PI * (z**2 * (alpha**2 - 1.0) + 1.0) ** 2))


def hidden(z: NDArray[np.float64] | float, alpha: float) -> NDArray[np.float64]:
    """Smith's Lambda for GGX."""
    return np.asarray(0.5 * (np.sqrt(1.0 + alpha**2 * (1.0 / np.square(z) - 1.0)) - 1.0))


def shares(cosine: float, alpha: float, ratio: float) -> tuple[float, float]:
    """What is mirrored, and what goes through, of light from one direction: the integrals of Walter et al. (2007),
    equations 20 and 21, over all directions. Masking of what is mirrored is correlated by height."""
    i = eye(cosine)
    o, angle = hemisphere()
    h = (i + o) / np.linalg.norm(i + o, axis=1, keepdims=True)
    masked = 1.0 / (1.0 + hidden(cosine, alpha) + hidden(o[:, 2], alpha))
    mirrored = fresnel(h @ i, ratio) * density(h[:, 2], alpha) * masked / (4.0 * cosine)
    o = -o  # beyond
    h = -(ratio * i + o)
    h /= np.linalg.norm(h, axis=1, keepdims=True)
    h *= np.sign(h[:, 2:])
    to_i, to_o = h @ i, np.einsum("ij,ij->i", h, o)
    met = (to_i > 0) & (to_o < 0)
    g = 1.0 / (1.0 + hidden(cosine, alpha)) / (1.0 + hidden(o[:, 2], alpha))
    bent = np.abs(to_i * to_o) / cosine * (1.0 - fresnel(np.clip(to_i, 1e-9, 1), ratio)) * density(h[:, 2], alpha) * g
    bent = np.where(met, bent / (ratio * to_i + to_o) ** 2, 0.0)
    return float(np.sum(mirrored) * angle), float(np.sum(bent) * angle)


@pytest.mark.parametrize("cosine", [0.95, 0.35])
@pytest.mark.parametrize("roughness", [0.5, 0.9])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_frosted_glass_parts_light_as_its_integrals_do(
    egl: Context, roughness: float, cosine: float, side: float
) -> None:
    n, ior = 2**16, 1.5
    views = np.broadcast_to(eye(cosine), (n, 3))
    _, weight, bent = frosted(egl, roughness, ior, side, views, even(n))
    mirrored, through = shares(cosine, roughness**2, 1.0 / ior if side > 0 else ior)
    np.testing.assert_allclose(weight[~bent].sum() / n, mirrored, atol=2e-3)
    np.testing.assert_allclose(weight[bent].sum() / n, through, atol=2e-3)


@pytest.mark.parametrize("roughness", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_way_lies_on_its_side_and_brings_no_more_than_it_gets(egl: Context, roughness: float, side: float) -> None:
    """Also for eyes that graze, or that a bent normal turns away from."""
    cosines = np.tile([1.0, 0.7, 0.1, 1e-3, 1e-5, 0.0, -1e-3, -0.2, -0.9], 512)
    views = np.stack([eye(c) for c in cosines])
    drawn = np.random.default_rng(3).random((len(cosines), 3)) * 0.9999999
    direction, weight, bent = frosted(egl, roughness, 1.5, side, views, drawn)
    mirrored = (weight > 0.0) & ~bent
    assert np.all(direction[mirrored, 2] > 0.0) and np.all(direction[bent, 2] < 0.0)
    assert np.all(weight <= 1.0 + 16 * ULP) and np.all(weight >= 0.0)
    seen = cosines >= 1e-3
    assert mirrored[seen].any() and bent[seen].any()
    np.testing.assert_allclose(np.linalg.norm(direction[mirrored | bent], axis=1), 1.0, rtol=1e-5)


@pytest.mark.parametrize(("side", "ratio"), [(1.0, 1 / 1.5), (-1.0, 1.5)])
def test_smooth_glass_is_what_is_left_at_a_roughness_of_0(egl: Context, side: float, ratio: float) -> None:
    cosines = np.random.default_rng(5).uniform(0.05, 1.0, 2000)
    views = np.stack([eye(c) for c in cosines])
    drawn = np.random.default_rng(6).random((2000, 3)) * (0.999, 0.9, 0.9999999)  # the last tenth are rare, far facets
    direction, weight, bent = frosted(egl, 0.0, 1.5, side, views, drawn)
    sure = np.abs(drawn[:, 2] - fresnel(cosines, ratio)) > 1e-2
    assert np.array_equal(bent[sure], (drawn[:, 2] >= fresnel(cosines, ratio))[sure])
    np.testing.assert_allclose(weight, 1.0, atol=1e-5)
    sine = ratio * np.sqrt(1.0 - cosines**2)
    z = np.where(bent, -np.sqrt(np.maximum(1.0 - sine**2, 0.0)), cosines)
    near = ~bent | (sine < 0.95)  # refraction is infinitely steep at the critical angle
    np.testing.assert_allclose(direction[near, 2], z[near], atol=5e-3)


def test_a_glazed_material_answers_by_its_shares(egl: Context) -> None:
    """What it mirrors at right angles, and what it spreads, are the sums of the two; also if all is mirrored."""
    color = np.random.default_rng(2).random((64, 3))
    share = np.linspace(0.0, 1.0, 64)
    coat = (0.6 / 2.6) ** 2
    for metalness, f0 in ((0.0, 0.04), (0.4, 0.1), (1.0, 0.04), (0.0, 1.0)):
        symbols = var("color", VEC3), var("share", FLOAT)
        values = {**material(metalness=metalness, roughness=0.3, f0=(f0, f0, f0)), "color": symbols[0]}
        made = over_dielectric(values, const(1.6), symbols[1])
        mirrored, spread = (
            evaluate(egl, Function("part", symbols, made[name]), [color, share]).astype(np.float64)
            for name in ("f0", "color")
        )
        metal = made["metalness"].data
        own = f0 * (1.0 - metalness) + color * metalness
        known = own + share[:, None] * (coat - own)
        np.testing.assert_allclose(mirrored, known, atol=8 * ULP)
        matte = (1.0 - share[:, None]) * (1.0 - metalness) * (1.0 - f0) * color
        np.testing.assert_allclose((1.0 - mirrored) * spread, matte, atol=16 * ULP)
        assert np.all(metal == 0.0) and np.all(np.isfinite(spread))
