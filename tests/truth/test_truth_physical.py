"""The physical model against what physics asks of it: energy, reciprocity, distances, and known integrals."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from raymarch.expr.arrays import value_of
from raymarch.expr.node import expr
from raymarch.expr.vocabulary import step
from raymarch.scene import Camera, Material, PointLight, Quality, Scene, SphereLight, SpotLight, Sun
from raymarch.scene.bsdf import Microfacets
from raymarch.scene.reflectance import albedo_f90
from raymarch.sdf import box, plane, sphere, union
from raymarch.truth import truth
from raymarch.truth.bsdf import values_of
from tests.support.bsdf import microfacets
from tests.support.refusals import refused

ABOVE = Camera((0, 5, 0), (0, 0, 0), up=(0, 0, 1))
ROUGH, METAL, SEEN = (0.05, 0.2, 0.5, 0.8, 1.0), (0.0, 0.5, 1.0), (0.02, 0.1, 0.3, 0.6, 0.95)


def directions(cosine: Any, turn: Any) -> Any:
    sine = np.sqrt(np.maximum(1 - cosine**2, 0))
    return np.stack([sine * np.cos(turn), sine * np.sin(turn), cosine * np.ones_like(turn)], axis=-1)


def answer(
    view: Any, light: Any, color: float, metal: float, rough: float, masking: str = "correlated", several: bool = True
) -> Any:
    """Reflectance times cosine times pi, of a grey surface that faces z."""
    light = np.atleast_2d(light)
    n = len(light)
    wide = (np.broadcast_to(v, (n, 3)) for v in ((0.0, 0.0, 1.0), view))
    tint, f0 = (np.full((n, 3), v) for v in (color, 0.04))
    values = np.full((n, 1), metal), np.full((n, 1), rough)
    return microfacets(*wide, light, tint, *values, f0, masking, several)[:, 0]


def albedo(seen: float, color: float, metal: float, rough: float, masking: str, several: bool = True) -> float:
    """What a white furnace sends back: the integral over all lights, sampled by facets and evenly."""
    view = directions(np.array(seen), np.array(0.0))
    # A grid in the half vector's own measure puts the samples where the highlight is.
    alpha = max(rough * rough, 1e-3)
    xi, turn = np.meshgrid((np.arange(250) + 0.5) / 250, 2 * np.pi * (np.arange(64) + 0.5) / 64)
    xi, turn = xi.ravel(), turn.ravel()
    cosine = np.sqrt((1 - xi) / (1 + (alpha**2 - 1) * xi))
    half = directions(cosine, turn)
    light = 2 * (half @ view)[:, None] * half - view
    density = alpha**2 / (np.pi * ((cosine**2) * (alpha**2 - 1) + 1) ** 2)
    share = density * cosine / (4 * np.maximum(half @ view, 1e-12))
    even = np.maximum(light[:, 2], 0) / np.pi
    valid = (light[:, 2] > 0) & (half @ view > 0)
    found = np.zeros(len(light))
    # One half of the samples from each of two densities, weighted by the balance heuristic.
    found[valid] = answer(view, light[valid], color, metal, rough, masking, several) / (share + even)[valid]
    spread = directions(np.sqrt(1 - xi), turn)
    other = spread + view
    other /= np.linalg.norm(other, axis=1, keepdims=True)
    c = other[:, 2]
    density = alpha**2 / (np.pi * ((c**2) * (alpha**2 - 1) + 1) ** 2)
    share2 = density * c / (4 * np.maximum(other @ view, 1e-12))
    found2 = answer(view, spread, color, metal, rough, masking, several) / (share2 + spread[:, 2] / np.pi)
    return float((found.mean() + found2.mean()) / np.pi)


@pytest.mark.parametrize("masking", ["correlated", "separable"])
def test_a_white_furnace_gives_back_no_more_than_it_gets(masking: str) -> None:
    for rough in ROUGH:
        for metal in METAL:
            for seen in SEEN:
                assert albedo(seen, 1.0, metal, rough, masking, several=False) <= 1.0 + 2e-3, (rough, metal, seen)


@pytest.mark.parametrize("masking", ["correlated", "separable"])
def test_white_metal_gives_back_what_it_gets(masking: str) -> None:
    """Of any roughness, at any angle; and what is between a metal and a dielectric, but for its rim. What facets
    mirror once loses up to 68 % of it."""
    for rough in (0.05, 0.1, 0.15, 0.2, 0.3, 0.5, 0.7, 0.85, 1.0):
        for metal in METAL:
            for seen in SEEN:
                found = albedo(seen, 1.0, metal, rough, masking)
                assert found <= 1.005, (rough, metal, seen)
                # The matte part of dielectrics is a fit that keeps a rim: see `albedo_f90`.
                assert found >= (0.97 if metal == 1.0 or seen > 0.02 else 0.88), (rough, metal, seen)
    assert albedo(0.95, 1.0, 1.0, 1.0, masking, several=False) < 0.33


def walked(cosine: float, alpha: float, f0: float, n: int = 20_000) -> float:
    """The share of even light that facets of GGX give back after any number of reflections: a random walk between them
    (Heitz et al. 2016), of which the package has nothing. Schlick's reflectance at each."""
    random = np.random.default_rng(7)
    w = -np.broadcast_to([np.sqrt(1 - cosine**2), 0.0, cosine], (n, 3)).copy()
    height, energy, kept = np.full(n, 1.0), np.ones(n), 0.0  # heights are uniform in [-1, 1]
    for _ in range(40):
        # How far along its way does it meet a facet? The chance to leave is the masking from this height on.
        tangent = np.abs(w[:, 2]) / np.maximum(np.hypot(w[:, 0], w[:, 1]), 1e-12)
        size = 0.5 * (np.sqrt(1 + (alpha / np.maximum(tangent, 1e-12)) ** 2) - 1)
        up = w[:, 2] > 0
        lam = np.where(up, size, -1.0 - size)
        u = random.random(len(w))
        c1 = np.clip(0.5 * (height + 1), 1e-12, 1.0)
        leave = np.where(up, c1 ** np.where(up, lam, 0.0), 0.0)
        out = u > 1 - leave
        kept += energy[out].sum()
        w, height, energy, u, lam, c1 = (x[~out] for x in (w, height, energy, u, lam, c1))
        if not len(w):
            break
        height = 2 * np.clip(c1 / (1 - u) ** (1 / lam), 0.0, 1.0) - 1
        # One of the facets seen from there, which may be from below: by caps, in a stretched frame.
        v = -w
        stretched = np.stack([alpha * v[:, 0], alpha * v[:, 1], v[:, 2]], axis=1)
        stretched /= np.linalg.norm(stretched, axis=1, keepdims=True)
        turn, z = 2 * np.pi * random.random(len(v)), (1 - random.random(len(v))) * (1 + stretched[:, 2])
        z = z - stretched[:, 2]
        s = np.sqrt(np.clip(1 - z * z, 0, 1))
        h = np.stack([s * np.cos(turn), s * np.sin(turn), z], axis=1) + stretched
        h = np.stack([alpha * h[:, 0], alpha * h[:, 1], np.maximum(h[:, 2], 1e-9)], axis=1)
        h /= np.linalg.norm(h, axis=1, keepdims=True)
        both = np.einsum("ij,ij->i", h, v)
        energy = energy * (f0 + (1 - f0) * np.clip(1 - both, 0, 1) ** 5)
        w = 2 * both[:, None] * h - v
    return float(kept / n)


def test_a_walk_between_the_facets_keeps_all_light_and_loses_what_one_reflection_loses() -> None:
    assert abs(walked(0.6, 1.0, 1.0) - 1.0) < 2e-3


@pytest.mark.parametrize("rough", [0.6, 1.0])
@pytest.mark.parametrize("color", [0.34, 0.78])
def test_coloured_metal_is_as_bright_as_after_a_walk_between_its_facets(rough: float, color: float) -> None:
    """Light that several facets mirror is darker and of a deeper colour; so is what is given back of it."""
    for seen in (0.3, 0.6, 0.95):
        known = walked(seen, rough**2, color)
        assert abs(albedo(seen, color, 1.0, rough, "correlated") - known) < 0.05, (seen, known)
        assert known - albedo(seen, color, 1.0, rough, "correlated", several=False) > 0.03 * color


def test_the_furnace_as_a_fit() -> None:
    """What the sky's light uses in place of the integral, at every roughness and angle."""
    for rough in (0.0, 0.2, 0.4, 0.6, 0.8, 1.0):
        for seen in (0.05, 0.15, 0.3, 0.6, 0.95):
            share, edge = (float(value_of(x)) for x in Microfacets().directional_albedo(expr(seen), expr(rough)))
            assert abs(share + edge - albedo(seen, 1.0, 1.0, rough, "correlated", several=False)) < 0.012, (rough, seen)
            assert abs(0.04 * share + edge - albedo(seen, 0.04, 1.0, rough, "correlated", several=False)) < 0.06, (
                rough,
                seen,
            )


def test_what_facets_give_back_at_grazing_angles_as_a_fit() -> None:
    """Of a surface whose f0 is 0; too little would let a white one give back more than it gets."""
    for rough in (0.05, 0.2, 0.4, 0.6, 0.8, 1.0):
        for seen in (0.05, 0.15, 0.3, 0.6, 0.95):
            over = float(values_of(albedo_f90, seen, rough)) - albedo(seen, 0.0, 1.0, rough, "correlated", False)
            assert -0.003 <= over <= (0.03 if seen > 0.1 else 0.1), (rough, seen)


def test_a_white_surface_has_no_dark_rim() -> None:
    """Seen from the side it is as bright as from above, but for what facets hide from each other of f0."""
    for rough in (0.4, 0.7, 1.0):
        for seen in (0.02, 0.1, 0.3, 0.6, 0.95):
            assert albedo(seen, 1.0, 0.0, rough, "correlated") >= 0.94, (rough, seen)


def test_a_smooth_metal_loses_nothing_and_a_rough_one_what_smith_says() -> None:
    """Figures of the correlated and the separable form at roughness .5 and cosine .1, from independent integrals."""
    assert abs(albedo(0.9, 1.0, 1.0, 0.05, "correlated", several=False) - 1.0) < 2e-3
    assert abs(albedo(0.1, 1.0, 1.0, 0.5, "correlated", several=False) - 0.89) < 0.01
    assert abs(albedo(0.1, 1.0, 1.0, 0.5, "separable", several=False) - 0.85) < 0.01


def test_light_and_eye_may_change_places() -> None:
    random = np.random.default_rng(1)
    for _ in range(50):
        a, b = directions(random.uniform(0.05, 1, 2), random.uniform(0, 6, 2))
        color, metal, rough = random.uniform(0, 1, 3)
        for masking in ("correlated", "separable"):
            there = answer(a, b, color, metal, rough, masking)[0] / b[2]
            back = answer(b, a, color, metal, rough, masking)[0] / a[2]
            assert abs(there - back) <= 1e-9 * max(there, 1)


def test_facets_cover_the_surface() -> None:
    """The projected areas of all facets add up to the surface: the integral of D cos is 1."""
    for alpha in (0.05, 0.3, 1.0):
        cosine = (np.arange(200_000) + 0.5) / 200_000
        density = alpha**2 / (np.pi * (cosine**2 * (alpha**2 - 1) + 1) ** 2)
        assert abs(2 * np.pi * np.mean(density * cosine) - 1) < 1e-4


def brightness(light: Any, material: Material, **parts: Any) -> float:
    scene = Scene(plane().material(material), camera=ABOVE, lights=[light], **parts)
    return float(truth(scene, (1, 1)).color[0, 0, 0])


MATTE = Material((1, 1, 1), specular=0, ambient=0)


def test_brightness_means_the_same_in_both_models() -> None:
    """A white matte surface under a light of intensity 1 has the value 1; a diffuse one of microfacets nearly so."""
    sun = Sun((0, 1, 0))
    assert brightness(sun, MATTE) == 1.0
    mean = 2 / (5.02 * 6.02 * 25.03)
    assert abs(brightness(sun, Material(albedo=(1, 1, 1), roughness=1.0)) - 0.96 / (1 - mean) - 0.01) < 1e-6


def test_a_lamp_with_a_radius_fades_and_ends() -> None:
    def at(height: float, **parts: Any) -> float:
        return brightness(PointLight((0, height, 0), **parts), MATTE)

    for height in (0.5, 1.0, 3.0):
        window = max(1 - (height / 4.0) ** 4, 0) ** 2
        assert abs(at(height, range=4.0) - window / height**2) < 1e-12
        own = (1 - height / 4.0) / (1 + 0.5 * height + 0.25 * height**2)
        assert abs(at(height, range=4.0, attenuation=(1, 0.5, 0.25)) - own) < 1e-12
    assert at(4.0, range=4.0) == at(9.0, range=4.0) == at(5.0, range=4.0, attenuation=(1, 0, 0)) == 0.0


def test_a_spot_shines_into_its_cone() -> None:
    def at(turn: float) -> float:
        lamp = SpotLight((0, 2, 0), (np.sin(turn), -np.cos(turn), 0), half_angle=0.5, blend=0.5, intensity=4)
        return brightness(lamp, MATTE)

    outer, inner = np.cos(0.5), np.cos(0.25)
    assert at(0.0) == at(0.24) == 1.0 and at(0.51) == 0.0
    assert abs(at(0.4) - ((np.cos(0.4) - outer) / (inner - outer)) ** 2) < 1e-12


def test_a_ball_of_light_is_as_bright_as_a_point() -> None:
    for size in (0.1, 1.0):
        assert brightness(SphereLight((0, 3, 0), size, intensity=9), MATTE) == 1.0


def test_what_glows_needs_no_light_and_takes_what_comes() -> None:
    lamp = Material((0.5, 0.5, 0.5), specular=0, ambient=0, emission=(0.1, 2.0, 0.3))
    assert np.allclose(truth(Scene(plane().material(lamp), camera=ABOVE, lights=[]), (1, 1)).color, (0.1, 2, 0.3))
    lit = truth(Scene(plane().material(lamp), camera=ABOVE, lights=[Sun((0, 1, 0))]), (1, 1))
    assert np.allclose(lit.color, (0.6, 2.5, 0.8))


def test_a_pattern_moves_along_with_what_it_is_painted_on() -> None:
    halves = Material(lambda p: step(0.0, p.x), specular=0, ambient=0)
    painted, moved = box(1).material(halves).translate((0.25, 0, 0)), box(1).translate((0.25, 0, 0)).material(halves)
    for node, edge in ((painted, 0.25), (moved, 0.0)):
        made = truth(Scene(node, camera=ABOVE, lights=[Sun((0, 1, 0))]), (48, 36))
        x = (made.position + made.depth[..., None] * made.direction)[..., 0]
        assert np.array_equal(made.color[..., 0][made.hit] > 0, x[made.hit] > edge)
        assert 0 < (made.color[..., 0][made.hit] > 0).mean() < 1


def test_models_mix_in_a_blend_by_their_shares() -> None:
    gold, red = Material(albedo=(1, 0.8, 0.3), metalness=1), Material((1, 0, 0))

    def picture(left: Material, right: Material, k: float) -> Any:
        node = union(
            sphere().material(left).translate((-0.7, 0, 0)), sphere().material(right).translate((0.7, 0, 0)), k=k
        )
        return truth(Scene(node, camera=Camera((0, 0, 6), (0, 0, 0)), lights=[Sun()]), (48, 24)).color

    both, all_gold, all_red = picture(gold, red, 0.0), picture(gold, gold, 0.0), picture(red, red, 0.0)
    assert np.allclose(both[:, :23], all_gold[:, :23]) and np.allclose(both[:, 25:], all_red[:, 25:])
    assert np.isfinite(picture(gold, red, 0.5)).all()


def test_masking_is_a_choice() -> None:
    metal = Material(albedo=(1, 1, 1), metalness=1, roughness=0.7)
    aslant = Camera((0, 1, 4), (0, 0, 0))
    scenes = [
        Scene(plane().material(metal), camera=aslant, lights=[Sun((0, 1, -3))], quality=Quality(masking=masking))
        for masking in ("correlated", "separable")
    ]
    values = [float(truth(scene, (1, 1)).color[0, 0, 0]) for scene in scenes]
    assert values[0] > 1.05 * values[1] > 0


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Material(roughness=1.5), ("roughness = 1.5", ">= 0 and <= 1")),
        (lambda: Material(metalness=-0.1), ("metalness = -0.1",)),
        (lambda: Material(f0=2), ("f0", "<= 1")),
        (lambda: Material(emission=(0, -1, 0)), ("emission", ">= 0")),
        (lambda: Material(shininess=3, roughness=0.5), ("shininess together with roughness",)),
        (lambda: Material((1, 0, 0), albedo=(1, 0, 0)), ("color together with albedo",)),
        (lambda: Material(roughness=lambda p: 2.0 + p.x * p.x), ("roughness: the function gives",)),
        (lambda: Material(roughness=lambda p: p), ("roughness: the function gives a vec3",)),
        (lambda: PointLight((0, 0, 0), intensity=-1), ("intensity = -1",)),
        (lambda: PointLight((0, 0, 0), range=0), ("range = 0",)),
        (lambda: PointLight((0, 0, 0), attenuation=(0, 0, 0)), ("attenuation", "not all zero")),
        (lambda: Sun(softness=-1), ("softness = -1",)),
        (lambda: Sun(penumbra="fuzzy"), ("penumbra = 'fuzzy'", "'two-sided'")),
        (lambda: SpotLight((0, 0, 0), half_angle=4), ("angle = 4",)),
        (lambda: SphereLight((0, 0, 0), 0), ("radius = 0",)),
        (lambda: Quality(masking="smith"), ("masking = 'smith'",)),
    ],
)
def test_what_cannot_be_is_refused_with_the_line(make: Any, words: tuple[str, ...]) -> None:
    refused(make, *words)
