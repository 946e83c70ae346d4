"""The clear coat: energy, reciprocity, its transmittance as an integral, and the reference against the shader."""

from __future__ import annotations

import numpy as np
import pytest

import raymarch as rm
from raymarch.expr.arrays import evaluator
from raymarch.expr.node import const, expr, var
from raymarch.expr.types import FLOAT
from raymarch.gpu.context import Context
from raymarch.scene.bsdf import Microfacets
from raymarch.scene.layers import Coated
from tests.functions.directions import slanted
from tests.support.bsdf import VIEW, evaluated, even, material, prepared, sampled

N = 20_000
COSINES = (0.05, 0.3, 0.95)


@pytest.mark.parametrize(("masking", "coat"), [("correlated", 0.05), ("separable", 0.3), ("correlated", 0.8)])
def test_a_white_surface_under_a_coat_reflects_no_more_than_arrives(masking: str, coat: float) -> None:
    """In a white furnace, by the mean weight of its samples; and as much under a white sky, but for the fits."""
    bsdf, one = Coated(Microfacets(masking, True)), const((1.0, 1.0, 1.0))
    for roughness in (0.1, 1.0):
        for metalness in (0.0, 1.0):
            given = material(
                color=(1.0, 1.0, 1.0),
                metalness=metalness,
                roughness=roughness,
                clearcoat=1.0,
                clearcoat_roughness=coat,
            )
            for cosine in COSINES:
                views = np.broadcast_to(slanted(cosine), (N, 3))
                weights = sampled(None, bsdf, given, views, even(N, "direction", "lobe", "several", "coat"))[1]
                whole = float(weights[:, 0].mean())
                assert 0.7 < whole <= 1.0, (roughness, metalness, cosine, whole)
                sky = bsdf.reflect_sky(prepared(bsdf, given), expr(cosine), one, one, one, [0.0, 0.0])
                shown = float(evaluator([sky], [VIEW])(slanted(cosine)[None])[0].ravel()[0])
                assert shown <= 1.0 and abs(shown - whole) < 0.07, (roughness, metalness, cosine, whole, shown)


def test_light_and_view_may_change_places() -> None:
    random = np.random.default_rng(1)
    bsdf = Coated(Microfacets(compensated=True))
    for _ in range(8):
        metalness, *rest = random.uniform(0.1, 1, 4)
        given = material(
            color=(0.7, 0.5, 0.2),
            metalness=metalness,
            roughness=rest[0],
            clearcoat=rest[1],
            clearcoat_roughness=rest[2],
        )
        a, b = (slanted(random.uniform(0.05, 1), random.uniform(0, 6))[None] for _ in range(2))
        there, back = evaluated(None, bsdf, given, a, b) / a[:, 2], evaluated(None, bsdf, given, b, a) / b[:, 2]
        np.testing.assert_allclose(there, back, rtol=1e-9)


@pytest.mark.parametrize("roughness", [0.1, 0.4, 0.8])
def test_the_base_loses_what_the_coat_reflects(roughness: float) -> None:
    """1 minus the transmittance is the integral of the coat over a black base, but for the fit."""
    bsdf = Coated(Microfacets())
    given = material(
        color=(0.0, 0.0, 0.0),
        f0=(0.0, 0.0, 0.0),
        metalness=1.0,
        roughness=1.0,
        clearcoat=1.0,
        clearcoat_roughness=roughness,
    )
    for cosine in (0.15, 0.5, 1.0):
        views = np.broadcast_to(slanted(cosine), (N, 3))
        u = {**even(N, "direction", "lobe"), "coat": np.zeros(N)}  # every sample is one of the coat
        directions, _ = sampled(None, bsdf, given, views, u)
        alpha = max(roughness**2, 1e-3)
        half = directions + views
        half /= np.linalg.norm(half, axis=1, keepdims=True)
        v_dot_h, light = np.sum(half * views, axis=1), np.maximum(directions[:, 2], 1e-9)
        lam = [0.5 * (np.sqrt(1 + alpha**2 * (1 / c**2 - 1)) - 1) for c in (np.full(N, cosine), light)]
        kept = (1 + lam[0]) / (1 + lam[0] + lam[1])  # G2 / G1
        known = np.where(directions[:, 2] > 0, (0.04 + 0.96 * (1 - v_dot_h) ** 5) * kept, 0.0).mean()
        found = 1.0 - float(evaluator([bsdf.transmittance(given, expr(cosine))], [])()[0])
        assert -0.004 < found - known < 0.03, (cosine, found, known)


def test_the_shader_is_the_reference(egl: Context) -> None:
    """Coats over a dielectric and a metal, in direct light, under the sky, and as mirrors."""
    red = rm.Material(albedo=(0.6, 0.05, 0.03), clearcoat=1, clearcoat_roughness=0.05)
    gold = rm.Material(albedo=(0.9, 0.6, 0.2), metalness=1, roughness=0.4, clearcoat=0.8, clearcoat_roughness=0.3)
    node = rm.plane(offset=-1).material(gold) | rm.sphere().material(red)
    for quality in ({}, {"bounces": 2, "quality": rm.Quality(integrator="whitted")}):
        scene = rm.Scene(
            node,
            rm.Camera((0, 1, 4)),
            [rm.Sun((1, 2, 1), shadow=True)],
            sky=rm.GradientSky(light=True),
            **quality,  # type: ignore[arg-type]
        )
        with rm.Renderer((24, 18), context=egl) as renderer:
            found = renderer.render(scene).color
        off = np.abs(found - rm.truth(scene, (24, 18)).color).max(axis=-1)
        assert np.quantile(off, 0.98) < 1e-3, np.sort(off.ravel())[-20:]


@pytest.mark.parametrize("masking", ["correlated", "separable"])
@pytest.mark.parametrize("coated", [False, True])
def test_mirrors_of_a_ray_tree_add_no_light(masking: str, coated: bool) -> None:
    """In a white furnace a ray tree sees mirrors, sky and diffuse light together, 1 at most at any angle."""
    base, one = Microfacets(masking, True), const((1.0, 1.0, 1.0))
    bsdf = Coated(base) if coated else base
    roughness, coat, metalness, cosine = (var(name, FLOAT) for name in ("r", "coat", "metalness", "c"))
    names = {"metalness": metalness, "roughness": roughness, "clearcoat": expr(1.0), "clearcoat_roughness": coat}
    given = prepared(bsdf, material(color=(1.0, 1.0, 1.0)) | names)
    traced = bsdf.traced(given, cosine)
    shown = bsdf.reflect_sky(given, cosine, one, one, one, traced) + bsdf.mirrored(given, cosine, traced)
    angles = np.cos(np.radians([0, 30, 60, 70, 80, 85, 88, 89, 89.9]))
    levels = (0.0, 0.02, 0.05, 0.1, 0.12, 0.14, 0.16, 0.19, 0.3, 1.0)
    grid = np.meshgrid(levels, levels if coated else (0.0,), (0.0, 0.5, 1.0), angles)
    values = [axis.ravel() for axis in grid]
    views = np.array([slanted(c) for c in values[-1]])
    found = evaluator([shown], [VIEW, roughness, coat, metalness, cosine])(views, *values)[0]
    assert found.max() <= 1.0 + 1e-12
