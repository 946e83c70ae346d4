"""The ways of light, as single functions: where they go on, with what weight, and what they meet."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from raymarch.expr.types import FLOAT, VEC2, VEC3, VEC4
from raymarch.gpu.context import Context
from raymarch.truth.light import microfacets
from raymarch.truth.whitted import THROUGHPUT_CUTOFF, reflectance
from tests.functions.directions import slanted
from tests.support.glsl_harness import modules, run

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
    found = run(
        egl, modules("path/fresnel_dielectric"), "fresnel_dielectric({0}, {1})", [(FLOAT, cosine), (FLOAT, ratio)]
    )
    np.testing.assert_allclose(found, reflectance(cosine, ratio), rtol=1e-5, atol=8 * ULP)
    assert np.all(found[(ratio * ratio * (1 - cosine**2)) > 1] == 1.0)


SURFACE = "struct Surface { vec3 p; vec3 normal; vec3 view; float t; Material material; };\n"
DRAWN = "uniform float u_roughness;\nvec3 u_now;\nfloat random_of_pixel(int dimension) { return u_now[dimension]; }\n"


def test_a_tree_follows_what_is_smooth(egl: Context) -> None:
    """All up to a roughness of 0.1, nothing from 0.2 on."""
    text = modules("material/physical") + modules("light/fresnel", "path/mirror", before=SURFACE)
    rough = np.array([0.0, 0.05, 0.1, 0.15, 0.2, 0.5, 1.0])
    found = run(egl, text, "mirror_weight(Material(vec3(1), 0.0, {0}, vec3(0.04)))", [(FLOAT, rough)])
    np.testing.assert_allclose(found, [1, 1, 1, 0.5, 0, 0, 0], atol=32 * ULP)
    call = "mirror_reflectance(Surface(vec3(0), vec3(0, 0, 1), {0}, 1.0, Material(vec3(1), 0.0, 0.0, vec3(0.04))))"
    found = run(egl, text, call, [(VEC3, slanted([1.0, 0.5, 0.0, -0.1, -1.0]))], 3)
    known = 0.04 + 0.96 * np.array([0, 0.5, 1, 1, 1]) ** 5  # away from the eye as edge on
    np.testing.assert_allclose(found, np.repeat(known[:, None], 3, axis=1), rtol=16 * ULP)


def test_a_basis_is_one_about_each_axis(egl: Context) -> None:
    """Also where one of the two formulas divides by 0."""
    for local in np.eye(3):
        call = f"to_world({{0}}, vec3({local[0]}, {local[1]}, {local[2]}))"
        found = run(egl, modules("path/lobes"), call, [(VEC3, AXES)], 3)
        np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0, rtol=8 * ULP)
        np.testing.assert_allclose(np.sum(found * AXES, axis=1), local[2], atol=8 * ULP)


def test_a_matte_way_leaves_the_surface(egl: Context) -> None:
    """Up to the last random number; its cosine is sqrt(1 - u)."""
    for u in (0.0, 0.5, LAST):
        call = f"sample_cosine({{0}}, vec2({u!r}, 0.3))"
        found = run(egl, modules("path/lobes"), call, [(VEC3, AXES)], 3)
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
            call = f"sample_visible_normal(vec3(0, 0, 1), {{0}}, {alpha}, {{1}})"
            found = run(egl, modules("path/lobes"), call, [(VEC3, views), (VEC2, drawn)], 3)
            np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0, rtol=8 * ULP)
            assert np.all(found[:, 2] > 0.0)


def test_a_facet_seen_from_behind_is_that_of_the_surface(egl: Context) -> None:
    """There is none to choose from; a mirror's are all along its normal."""
    for view in ([0.0, 0.0, -1.0], [0.6, 0.0, -0.8]):
        found = run(
            egl,
            modules("path/lobes"),
            "sample_visible_normal(vec3(0, 0, 1), {0}, 0.0001, vec2(0.3, 0.5))",
            [(VEC3, [view])],
            3,
        )
        assert found[0, 2] > 0.99


GLOSSY = (
    "light/fresnel",
    "light/correlated",
    "light/albedo_f90",
    "light/interface_transmittance",
    "path/lobes",
    "path/glossy",
)


def glossy(
    egl: Context, material: str, views: ArrayLike, drawn: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
    """Directions, weights (red) and whether a way goes on, for eyes and random numbers, (N, 3); z is normal."""
    after = f"""
        vec4 gone(vec3 view, vec3 drawn) {{
            u_now = drawn;
            vec3 direction = vec3(0.0), weight = vec3(1.0);
            Surface surface = Surface(vec3(0.0), vec3(0.0, 0.0, 1.0), view, 1.0, {material});
            bool goes = sample_microfacet(surface, 0, direction, weight);
            return vec4(direction, goes ? weight.r : -1.0);
        }}"""
    text = modules("material/physical") + modules(*GLOSSY, before=SURFACE + DRAWN, after=after)
    inputs = [(VEC3, views), (VEC3, drawn)]
    found = run(egl, text, "gone({0}, {1})", inputs, 4, {"u_roughness": 0.0}).astype(np.float64)
    return found[:, :3], found[:, 3], found[:, 3] != -1.0


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
    direction, weight, goes = glossy(egl, f"Material(vec3(1), 1.0, {roughness}, vec3(0.04))", views, numbers(2048))
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
    direction, weight, _ = glossy(egl, "Material(vec3(1), 1.0, u_roughness, vec3(0.04))", views, np.full((3, 3), 0.5))
    assert np.all(np.isfinite(direction)) and np.all(np.isfinite(weight))
    np.testing.assert_allclose(direction, -views, atol=1e-3)


def test_both_parts_of_a_surface_are_asked_one_time_in_twenty(egl: Context) -> None:
    """Also where a part is nothing at right angles: for other facets it may be more, and its ways weigh too much."""
    drawn = [[0.04, 0.5, 0.25], [0.96, 0.5, 0.25]]
    up = [[0.0, 0.0, 1.0]] * 2
    mirror = glossy(egl, "Material(vec3(1), 0.0, 0.0, vec3(0))", up, drawn)[0]
    assert mirror[0, 2] > 0.9999 and mirror[1, 2] < 0.99
    matte = glossy(egl, "Material(vec3(0.0001), 0.0, 0.0, vec3(0.9))", up, drawn)[0]
    assert matte[0, 2] > 0.9999 and matte[1, 2] < 0.99


def test_a_surface_of_no_light_at_all_gives_none(egl: Context) -> None:
    """Black and without reflection at right angles, neither part has a share."""
    drawn = numbers(64)
    weight = glossy(egl, "Material(vec3(0), 0.0, 0.5, vec3(0))", np.broadcast_to([0.0, 0.0, 1.0], (64, 3)), drawn)[1]
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
    _, weight, goes = glossy(
        egl, f"Material(vec3({color}), 0.0, {roughness}, vec3(0.04))", views, np.minimum(drawn, LAST)
    )
    found, known = np.where(goes, weight, 0.0).mean(), integral(cosine, roughness, color)
    np.testing.assert_allclose(found, known, rtol=5e-3)
    if color == 1.0:
        assert 0.9 < found <= 1.0


SECOND = """
struct Ray { vec3 origin; vec3 direction; };
const float epsilon_pixels = 1.0;
const float contact_share = 0.5;
const int secondary_steps = 64;
const float u_far = 50.0;
uniform vec2 u_ends;
vec2 scene_box(Ray ray, vec2 range) { return vec2(max(range.x, u_ends.x), min(range.y, u_ends.y)); }
"""


def met(egl: Context, body: str, start: float, ends: tuple[float, float], side: float) -> list[float]:
    """Whether something is met along z, where, and the evaluations."""
    after = f"""
        float field(vec3 p) {{ return {body}; }}
        vec3 met(float start) {{
            Hit hit = trace_secondary(Ray(vec3(0.0), vec3(0.0, 0.0, 1.0)), start, 1.0, {side});
            return vec3(hit.found ? 1.0 : 0.0, hit.t, hit.evaluations);
        }}"""
    declared = "float field(vec3 p);\n"
    text = modules(
        "march/widths",
        "march/nearness",
        "march/epsilon",
        "march/contact",
        "march/hit",
        "march/safe_step",
        "march/extrapolate",
        "path/secondary",
        before=SECOND + declared,
        after=after,
    )
    uniforms = {"u_pixel": 1e-4, "u_ends": ends, "u_side": 1.0}
    return [float(x) for x in run(egl, text, "met({0})", [(FLOAT, [start])], 3, uniforms)[0]]


def test_a_second_ray_meets_what_is_in_the_box(egl: Context) -> None:
    found, t, evaluations = met(egl, "abs(p.z - 4.0) - 1.0", 0.01, (0.5, 10.0), 1.0)
    assert found and abs(t - 3) < 1e-4 and evaluations <= 4


def test_a_second_ray_ends_with_the_box(egl: Context) -> None:
    """What is beyond is not asked for, and of an empty range nothing is."""
    found, _, evaluations = met(egl, "abs(p.z - 4.0) - 1.0", 0.01, (0.0, 2.0), 1.0)
    assert not found and evaluations <= 1
    found, _, evaluations = met(egl, "abs(p.z - 4.0) - 1.0", 0.01, (0.0, 0.001), 1.0)
    assert not found and evaluations == 0


def test_glass_thinner_than_where_a_ray_starts_has_an_end(egl: Context) -> None:
    found, t, _ = met(egl, "max(-p.z, p.z - 0.001)", 0.01, (0.0, 0.001), -1.0)
    assert found and abs(t - 0.001) < 2e-4
    found, t, _ = met(egl, "max(-p.z, p.z - 1.0)", 0.01, (0.0, 1.0), -1.0)
    assert found and abs(t - 1) < 2e-4


METAL = (
    *("light/missing_correlated", "light/missing_mean_correlated", "light/multiscatter_albedo", "light/fresnel"),
    *(
        "light/correlated",
        "light/albedo_f90",
        "light/interface_transmittance",
        "path/lobes",
        "path/glossy",
        "path/metal",
    ),
)


@pytest.mark.parametrize(("metalness", "color"), [(1.0, 1.0), (1.0, 0.4), (0.5, 0.8)])
@pytest.mark.parametrize(("roughness", "cosine"), [(0.1, 0.02), (0.3, 0.15), (0.6, 0.9), (1.0, 0.5)])
def test_ways_from_metal_bring_what_it_reflects(
    egl: Context, metalness: float, color: float, roughness: float, cosine: float
) -> None:
    """Also what several facets mirror: the mean of the weights is the integral of the reflectance, in float64."""
    n = 2**16
    drawn = (np.arange(n)[:, None] * (0.8191725134, 0.6710436067, 0.5497004779, 0.4503599627) + 0.5) % 1.0
    after = f"""
        vec4 gone(vec3 view, vec4 drawn) {{
            u_now = drawn;
            vec3 direction = vec3(0.0), weight = vec3(1.0);
            Material material = Material(vec3({color}), {metalness}, {roughness}, vec3(0.04));
            Surface surface = Surface(vec3(0.0), vec3(0.0, 0.0, 1.0), view, 1.0, material);
            bool goes = from_metal(surface, 0, direction, weight);
            return vec4(direction, goes ? weight.r : 0.0);
        }}"""
    numbers = "vec4 u_now;\nfloat random_of_pixel(int dimension) { return u_now[dimension == 6 ? 3 : dimension]; }\n"
    text = modules("material/physical") + modules(*METAL, before=SURFACE + numbers, after=after)
    views = np.broadcast_to(slanted(cosine), (n, 3))
    found = run(egl, text, "gone({0}, {1})", [(VEC3, views), (VEC4, np.minimum(drawn, LAST))], 4).astype(np.float64)
    assert np.all(np.isfinite(found)) and found[:, 3].min() >= 0.0
    expected = scattered(cosine, roughness, metalness, color)
    np.testing.assert_allclose(found[:, 3].mean(), expected, rtol=1.5e-2)


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
