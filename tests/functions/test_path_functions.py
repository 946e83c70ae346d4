"""The ways of light, as single functions: where they go on, with what weight, and what they meet."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from raymarch.expr.function import Function
from raymarch.expr.node import const, var
from raymarch.expr.types import FLOAT, VEC3
from raymarch.expr.vocabulary import clamp
from raymarch.gpu.context import Context
from raymarch.scene.bsdf import Microfacets
from raymarch.scene.light import to_world
from raymarch.scene.reflectance import fresnel_dielectric, sample_cosine, sample_visible_normal
from raymarch.truth.whitted import THROUGHPUT_CUTOFF
from tests.functions.directions import slanted
from tests.support.bsdf import VIEW, even, material, microfacets, sampled
from tests.support.glsl_harness import evaluate, modules, run

ULP = 2.0**-24
LAST = 1 - ULP
"""The largest of the random numbers of a pixel."""

AXES = np.concatenate([np.eye(3), -np.eye(3), [[0.48, 0.64, -0.6], [-0.36, 0.48, 0.8]]])


def test_a_way_is_faint_by_its_brightest_colour(egl: Context) -> None:
    low, high = 0.999 * THROUGHPUT_CUTOFF, 1.001 * THROUGHPUT_CUTOFF
    weights = np.array([[low, low, low], [high, 0, 0], [0, high, 0], [0, 0, high], [1, 1, 1], [0, 0, 0]])
    found = run(egl, modules("path/cutoff"), "float(below_cutoff({0}))", [(VEC3, weights)])
    np.testing.assert_array_equal(found, [1, 0, 0, 0, 0, 1])


def test_all_is_mirrored_beyond_the_critical_angle(egl: Context) -> None:
    cosine, ratio = (a.ravel() for a in np.meshgrid([1e-3, 0.3, 0.6, 0.9, 1.0], [1 / 1.5, 1.5, 4.0]))
    found = evaluate(egl, fresnel_dielectric, [cosine, ratio])
    beyond = np.sqrt(np.maximum(1 - ratio**2 * (1 - cosine**2), 0))
    upright, lying = ratio * cosine, ratio * beyond
    known = 0.5 * (((upright - beyond) / (upright + beyond)) ** 2 + ((cosine - lying) / (cosine + lying)) ** 2)
    np.testing.assert_allclose(found, known, rtol=1e-5, atol=8 * ULP)
    assert np.all(found[(ratio * ratio * (1 - cosine**2)) > 1] == 1.0)


def test_a_tree_follows_what_is_smooth(egl: Context) -> None:
    """All up to a roughness of 0.1, nothing from 0.2 on."""
    rough = var("rough", FLOAT)
    given = {**material(color=(1.0, 1.0, 1.0), metalness=0.0), "roughness": rough}
    (share,) = Microfacets().traced(given, const(1.0))
    found = evaluate(egl, Function("share", (rough,), share), [[0.0, 0.05, 0.1, 0.15, 0.2, 0.5, 1.0]])
    np.testing.assert_allclose(found, [1, 1, 1, 0.5, 0, 0, 0], atol=32 * ULP)
    made = Microfacets().mirrored(given, clamp(VIEW.z, 0.0, 1.0), [const(1.0)])
    found = evaluate(
        egl, Function("mirrored", (VIEW, rough), made), [slanted([1.0, 0.5, 0.0, -0.1, -1.0]), np.zeros(5)]
    )
    known = np.repeat(0.04 + 0.96 * np.array([[0], [0.5], [1], [1], [1]]) ** 5, 3, axis=1)  # away from the eye: edge on
    np.testing.assert_allclose(found[:2], known[:2], rtol=16 * ULP)
    assert np.all(found[2:] <= 1.0)  # no more than the diffuse part leaves, whose fit is 4e-5 above 0 edge on
    np.testing.assert_allclose(found[2:], known[2:], atol=5e-5)


def test_a_basis_is_one_about_each_axis(egl: Context) -> None:
    """Also where one of the two formulas divides by 0."""
    for local in np.eye(3):
        found = evaluate(egl, to_world, [AXES, np.broadcast_to(local, AXES.shape)])
        np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0, rtol=8 * ULP)
        np.testing.assert_allclose(np.sum(found * AXES, axis=1), local[2], atol=8 * ULP)


def test_a_matte_way_leaves_the_surface(egl: Context) -> None:
    """Up to the last random number; its cosine is sqrt(1 - u)."""
    for u in (0.0, 0.5, LAST):
        found = evaluate(egl, sample_cosine, [AXES, np.broadcast_to([u, 0.3], (len(AXES), 2))])
        np.testing.assert_allclose(np.sum(found * AXES, axis=1), np.sqrt(1 - u), atol=8 * ULP)
        assert np.all(np.sum(found * AXES, axis=1) > 0.0)


@pytest.mark.parametrize("alpha", [1e-4, 0.25, 1.0])
def test_a_facet_is_on_the_side_of_the_surface(egl: Context, alpha: float) -> None:
    """Of unit length for all random numbers, also for an eye along the surface or behind it."""
    cosines = np.concatenate([np.linspace(-1, 1, 999), [1e-4, -1e-4, 1e-7, 0.0]])
    views = slanted(cosines)
    for u in (0.0, 2 * ULP, 0.25, 0.5, LAST):
        for turn in (0.0, 0.3, 0.5):
            drawn = np.broadcast_to([turn, u], (len(views), 2))  # as inputs, lest the compiler know them
            up = np.broadcast_to([0.0, 0.0, 1.0], views.shape)
            found = evaluate(egl, sample_visible_normal, [up, views, np.full(len(views), alpha), drawn])
            np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0, rtol=8 * ULP)
            assert np.all(found[:, 2] > 0.0)


def test_a_facet_seen_from_behind_is_that_of_the_surface(egl: Context) -> None:
    """There is none to choose from; a mirror's are all along its normal."""
    for view in ([0.0, 0.0, -1.0], [0.6, 0.0, -0.8]):
        found = evaluate(egl, sample_visible_normal, [[[0.0, 0.0, 1.0]], [view], [0.0001], [[0.3, 0.5]]])
        assert found[0, 2] > 0.99


def glossy(
    egl: Context, views: ArrayLike, drawn: ArrayLike, color: float, metalness: float, roughness: float, f0: float = 0.04
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
    """Directions, weights (red) and whether a way goes on, for eyes and random numbers, (N, 3); z is normal."""
    drawn = np.asarray(drawn)
    given = material(color=(color,) * 3, metalness=metalness, roughness=roughness, f0=(f0,) * 3)
    u = {"direction": drawn[:, 1:], "lobe": drawn[:, 0]}
    direction, weight = (part.astype(np.float64) for part in sampled(egl, Microfacets(), given, views, u))
    return direction, weight[:, 0], weight.any(axis=1)


def numbers(n: int, seed: int = 1) -> NDArray[np.float64]:
    """Random numbers, with their ends among them."""
    found = np.random.default_rng(seed).random((n, 3))
    found[: n // 8] = np.round(found[: n // 8])
    return np.minimum(found, LAST)


@pytest.mark.parametrize("roughness", [0.0, 0.1, 0.5, 1.0])
def test_a_metal_gives_back_no_more_than_it_gets(egl: Context, roughness: float) -> None:
    """In any sample, also where its normal is turned away from the eye: the share that the facets do not hide. A mirror
    gives back all, and no sample is lost to a matte part that it does not have."""
    cosines = np.tile([1.0, 0.5, 0.01, 1e-4, 0.0, -0.01, -0.3, -1.0], 256)
    views = slanted(cosines)
    direction, weight, goes = glossy(egl, views, numbers(2048), 1.0, 1.0, roughness)
    assert np.all(np.isfinite(direction)) and np.all(np.isfinite(weight))
    assert np.all(direction[goes, 2] > 0.0)
    assert np.all((weight[goes] >= 0.0) & (weight[goes] <= 1 + 16 * ULP))
    if roughness == 0.0:
        seen = cosines >= 0.01
        assert goes[seen].all()
        np.testing.assert_allclose(weight[seen], 1.0, rtol=1e-4)  # but for what an alpha of 1e-4 hides
    if roughness == 1.0:
        assert not goes.all()  # some are mirrored into the surface


def test_a_mirror_seen_along_itself_is_one(egl: Context) -> None:
    views = np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.6, 0.8, 0.0]])
    direction, weight, _ = glossy(egl, views, np.full((3, 3), 0.5), 1.0, 1.0, 0.0)
    assert np.all(np.isfinite(direction)) and np.all(np.isfinite(weight))
    np.testing.assert_allclose(direction, -views, atol=1e-3)


def test_both_parts_of_a_surface_are_asked_one_time_in_twenty(egl: Context) -> None:
    """Also where a part is nothing at right angles: for other facets it may be more, and its ways weigh too much."""
    drawn = [[0.04, 0.5, 0.25], [0.96, 0.5, 0.25]]
    up = [[0.0, 0.0, 1.0]] * 2
    mirror = glossy(egl, up, drawn, 1.0, 0.0, 0.0, 0.0)[0]
    assert mirror[0, 2] > 0.9999 and mirror[1, 2] < 0.99
    matte = glossy(egl, up, drawn, 0.0001, 0.0, 0.0, 0.9)[0]
    assert matte[0, 2] > 0.9999 and matte[1, 2] < 0.99


def test_a_surface_of_no_light_at_all_gives_none(egl: Context) -> None:
    """Black and without reflection at right angles, neither part has a share."""
    drawn = numbers(64)
    weight = glossy(egl, np.broadcast_to([0.0, 0.0, 1.0], (64, 3)), drawn, 0.0, 0.0, 0.5, 0.0)[1]
    assert np.all(np.isfinite(weight))


def integral(cosine: float, roughness: float, color: float) -> float:
    """The share of even light that a dielectric gives back, from `microfacets`."""
    c, turn = (a.ravel() for a in np.meshgrid((np.arange(512) + 0.5) / 512, (np.arange(256) + 0.5) * np.pi / 128))
    s = np.sqrt(1 - c * c)
    lights, one = np.stack([s * np.cos(turn), s * np.sin(turn), c], axis=1), np.ones((len(c), 3))
    known = microfacets(
        one * (0, 0, 1),
        one * slanted(cosine),
        lights,
        one * color,
        0 * one,
        roughness * one[:, :1],
        one * 0.04,
        "correlated",
    )
    return float(2 * known.mean())


@pytest.mark.parametrize(
    ("roughness", "cosine", "color"), [(0.5, 1.0, 1.0), (0.5, 0.3, 1.0), (1.0, 0.7, 1.0), (0.8, 0.2, 0.0)]
)
def test_ways_bring_what_the_surface_reflects(egl: Context, roughness: float, cosine: float, color: float) -> None:
    """In a white sky, the mean of the weights is the integral of the reflectance, in float64; and a white surface gives
    back nearly all."""
    n = 2**16
    drawn = (np.arange(n)[:, None] * (0.8191725134, 0.6710436067, 0.5497004779) + 0.5) % 1.0  # even points of a cube
    views = np.broadcast_to(slanted(cosine), (n, 3))
    _, weight, goes = glossy(egl, views, np.minimum(drawn, LAST), color, 0.0, roughness)
    found, known = np.where(goes, weight, 0.0).mean(), integral(cosine, roughness, color)
    np.testing.assert_allclose(found, known, rtol=5e-3)
    if color == 1.0:
        assert 0.9 < found <= 1.0


SECOND = """
struct Ray { vec3 origin; vec3 direction; };
const float epsilon_pixels = 1.0;
const float contact_share = 0.5;
const int secondary_steps = 64;
const float smoothing = 0.3;
const float u_far = 50.0;
uniform vec2 u_ends;
vec2 scene_box(Ray ray, vec2 range) { return vec2(max(range.x, u_ends.x), min(range.y, u_ends.y)); }
"""


OFFSET = 2e-4
"""Two epsilons of one pixel of 1e-4, at a distance of 1: where a ray starts if its first sample proves nothing."""


def met(egl: Context, body: str, start: float, ends: tuple[float, float], side: float) -> list[float]:
    """Whether something is met along z, where, and the evaluations. No residual is negative."""
    after = f"""
        float field(vec3 p) {{ return {body}; }}
        vec4 met(float start) {{
            Hit hit = trace_secondary(Ray(vec3(0.0), vec3(0.0, 0.0, 1.0)), start, 1.0, {side});
            return vec4(hit.found ? 1.0 : 0.0, hit.t, hit.evaluations, hit.residual);
        }}"""
    declared = "float field(vec3 p);\n"
    text = modules(
        "march/widths",
        "march/nearness",
        "march/epsilon",
        "march/contact",
        "march/hit",
        "march/safe_step",
        "march/auto_relaxed",
        "march/advance",
        "march/extrapolate",
        "light/spawn_ray",
        "path/secondary",
        before=SECOND + declared,
        after=after,
    )
    uniforms = {"u_pixel": 1e-4, "u_ends": ends, "u_side": 1.0}
    *found, residual = (float(x) for x in run(egl, text, "met({0})", [(FLOAT, [start])], 4, uniforms)[0])
    assert residual >= 0
    return found


def test_a_second_ray_meets_what_is_in_the_box(egl: Context) -> None:
    found, t, evaluations = met(egl, "abs(p.z - 4.0) - 1.0", 0.01, (0.5, 10.0), 1.0)
    assert found and abs(t - 3) < 1e-4 and evaluations <= 4


def test_a_second_ray_ends_with_the_box(egl: Context) -> None:
    """What is beyond is not asked for, and of an empty range nothing is."""
    found, _, evaluations = met(egl, "abs(p.z - 4.0) - 1.0", 0.01, (0.0, 2.0), 1.0)
    assert not found and evaluations <= 1
    found, _, evaluations = met(egl, "abs(p.z - 4.0) - 1.0", 0.01, (0.0, 0.5 * OFFSET), 1.0)
    assert not found and evaluations == 0


def test_a_second_ray_out_of_steps_meets_what_it_falls_towards(egl: Context) -> None:
    """64 steps end before the wall, and far from the end of a ray beside one."""
    found, t, evaluations = met(egl, "0.05 - 0.004 * p.z", 0.01, (0.0, 30.0), 1.0)
    assert found and abs(t - 12.5) < 1e-2 and evaluations == 64
    found, _, evaluations = met(egl, "0.05 - 0.004 * p.z", 0.01, (0.0, 12.0), 1.0)
    assert not found and evaluations == 64
    found, _, evaluations = met(egl, "0.02", 0.01, (0.0, 30.0), 1.0)
    assert not found and evaluations == 64


def test_a_second_ray_that_starts_deep_in_a_solid_meets_it_at_its_start(egl: Context) -> None:
    """It starts nearer four times, by an eighth each, to meet what lies before its start."""
    found, t, _ = met(egl, "p.z - 3.0", 0.01, (0.0, 10.0), 1.0)
    assert found and t == pytest.approx(OFFSET / 8**4)


def second_evaluations(slope: float, far: float) -> int:
    """How often a ray asks a plane that it leaves: the slope that it expects is -0.7 at first."""
    t, r, expected, count = 0.01, 0.0, -0.7, 0
    while True:
        z = max(r, min(2 * r / (1 - expected), far - t + r))
        if t + min(z, r) > far:
            return count
        ahead, count = 0.02 + slope * (t + z), count + 1
        found = (ahead - r) / z if z > 0 else expected
        empty = z <= r + abs(ahead)
        expected = min(max(0.7 * expected + 0.3 * found, -1.0), 0.999) if empty else -1.0
        t, r = (t + z, ahead) if empty else (t, r)


@pytest.mark.parametrize("slope", [1.0, 0.6, 0.3])
def test_a_second_ray_learns_the_slope_of_the_field(egl: Context, slope: float) -> None:
    """Its first sample, of which no step tells a slope, leaves what it expects as it was."""
    for far in (0.1, 0.3, 1.0, 3.0, 10.0, 30.0):
        found, _, evaluations = met(egl, f"0.02 + {slope} * p.z", 0.01, (0.0, far), 1.0)
        assert not found and evaluations == second_evaluations(slope, far)


def test_glass_thinner_than_where_a_ray_starts_has_an_end(egl: Context) -> None:
    found, t, _ = met(egl, "max(-p.z, p.z - 0.001)", 0.01, (0.0, 0.001), -1.0)
    assert found and abs(t - 0.001) < 2e-4
    found, t, _ = met(egl, "max(-p.z, p.z - 1.0)", 0.01, (0.0, 1.0), -1.0)
    assert found and abs(t - 1) < 2e-4


@pytest.mark.parametrize("plate", [0.3, 0.7, 1.1, 1.6, 2.0])
def test_a_long_step_into_a_wall_does_not_pass_a_thin_plate(egl: Context, plate: float) -> None:
    """A ray that rises from its surface takes long steps, and ends some inside of the wall behind the plate."""
    body = f"min(0.9 * p.z + 0.001, min(abs(p.z - {plate}) - 0.01, 2.5 - p.z))"
    found, t, _ = met(egl, body, 0.01, (0.0, 10.0), 1.0)
    assert found and abs(t - (plate - 0.01)) < 1e-3


@pytest.mark.parametrize(("metalness", "color"), [(1.0, 1.0), (1.0, 0.4), (0.5, 0.8)])
@pytest.mark.parametrize(("roughness", "cosine"), [(0.1, 0.02), (0.3, 0.15), (0.6, 0.9), (1.0, 0.5)])
def test_ways_from_metal_bring_what_it_reflects(
    egl: Context, metalness: float, color: float, roughness: float, cosine: float
) -> None:
    """Also what several facets mirror: the mean of the weights is the integral of the reflectance, in float64."""
    n = 2**16
    given = material(color=(color,) * 3, metalness=metalness, roughness=roughness)
    views = np.broadcast_to(slanted(cosine), (n, 3))
    _, weight = sampled(egl, Microfacets(compensated=True), given, views, even(n, "direction", "lobe", "several"))
    assert np.all(np.isfinite(weight)) and weight.min() >= 0.0
    expected = scattered(cosine, roughness, metalness, color)
    np.testing.assert_allclose(weight[:, 0].astype(np.float64).mean(), expected, rtol=1.5e-2)


def scattered(cosine: float, roughness: float, metalness: float, color: float) -> float:
    """The integral of `microfacets` over all lights, half of them mirrored by facets of GGX, half spread evenly."""
    u, turn = (a.ravel() for a in np.meshgrid((np.arange(512) + 0.5) / 512, 2 * np.pi * (np.arange(256) + 0.5) / 256))
    alpha, eye = roughness**2, slanted(cosine)

    def spread(c: NDArray[np.float64]) -> NDArray[np.float64]:
        s = np.sqrt(1 - c * c)
        return np.stack([s * np.cos(turn), s * np.sin(turn), c], axis=1)

    h = spread(np.sqrt((1 - u) / (1 + (alpha**2 - 1) * u)))
    total = 0.0
    for lights in (2 * (h @ eye)[:, None] * h - eye, spread(np.sqrt(1 - u))):
        middle = lights + eye
        middle /= np.linalg.norm(middle, axis=1, keepdims=True)
        c = middle[:, 2]
        density = alpha**2 / (np.pi * (c * c * (alpha**2 - 1) + 1) ** 2) * c / (4 * np.maximum(middle @ eye, 1e-12))
        one = np.ones((len(u), 3))
        known = microfacets(
            one * (0, 0, 1), one * eye, lights, one * color, one * metalness, one[:, :1] * roughness, one * 0.04,
            "correlated",
        )[:, 0]  # fmt: skip
        seen = (lights[:, 2] > 0) & (middle @ eye > 0)
        total += np.mean(np.where(seen, known / (density + np.maximum(lights[:, 2], 0) / np.pi), 0.0)) / np.pi
    return float(total)
