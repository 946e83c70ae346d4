"""Shadows of bodies that are known, as single functions: what comes through, and how often the field is asked."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import raymarch as rm
from raymarch.expr.function import Function
from raymarch.expr.node import expr
from raymarch.expr.types import FLOAT, VEC3
from raymarch.expr.vocabulary import where
from raymarch.gpu.context import Context
from raymarch.scene.ambient_occlusion import NORMAL, POINT
from raymarch.truth.light import _few
from tests.support.glsl_harness import evaluate, modules, run

ULP = 2.0**-24
PIXEL = 0.01
"""The epsilon of a point at distance 1; contact is half of it."""

BEFORE = """
struct Ray { vec3 origin; vec3 direction; };
struct Surface { vec3 p; vec3 normal; float t; };
struct Light { vec3 direction; float distance; vec3 radiance; };
const float epsilon_pixels = 1.0;
const float contact_share = 0.5;
const int shadow_steps = 512;
const float smoothing = 0.3;
int asked = 0;
vec2 scene_box(Ray ray, vec2 range) { return range; }
vec2 scene_cone(Ray ray, vec2 range, float width) { return range; }
vec3 geometric_normal(Surface surface) { return surface.normal; }
float body(vec3 p);
float field(vec3 p) { asked++; return body(p); }
"""
NEARNESS = ("march/widths", "march/nearness", "march/epsilon", "march/contact")
STEPS = ("march/hit", "march/safe_step", "march/auto_relaxed", "march/advance")
KINDS = {
    "light/shadow": "hard_shadow(surface, light)",
    "light/cone": "cone_shadow(surface, light, width)",
    "light/triangulated": "triangulated_shadow(surface, light, width)",
    "light/two_sided": "two_sided_shadow(surface, light, width)",
}
SOFT = [kind for kind in KINDS if kind != "light/shadow"]


def shadows(
    egl: Context,
    kind: str,
    body: str,
    ways: object,
    far: float = 4.0,
    width: float = 0.1,
    radiance: float = 1.0,
    normal: str = "0.0, 0.0, 1.0",
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """What is seen of lights from the origin and how often the field is asked, for each way."""
    after = f"""
        float body(vec3 p) {{ return {body}; }}
        vec2 seen(vec3 way) {{
            Surface surface = Surface(vec3(0.0), vec3({normal}), 1.0);
            Light light = Light(way, {far}, vec3({radiance}));
            float width = {width};
            float share = {KINDS[kind]};
            return vec2(share, float(asked));
        }}"""
    rays = ("light/spawn_ray", "light/shadow_ray", "light/half_chord", "light/clearance", "light/beside_edge")
    text = modules(*NEARNESS, *STEPS, "march/extrapolate", *rays, "light/seven", kind, before=BEFORE, after=after)
    found = run(egl, text, "seen({0})", [(VEC3, ways)], 2, {"u_pixel": PIXEL, "u_side": 1.0})
    return found[:, 0], found[:, 1]


UP = [[0.0, 0.0, 1.0]]


@pytest.mark.parametrize("kind", KINDS)
def test_what_faces_away_or_gets_nothing_asks_for_no_field(egl: Context, kind: str) -> None:
    """Also where the light just grazes."""
    seen, asked = shadows(egl, kind, "p.z", [[0, 0, -1], [0.8, 0, -0.6], [1, 0, -1e-6], [0, 1, 0]])
    assert not seen.any() and not asked.any()
    seen, asked = shadows(egl, kind, "p.z", UP, radiance=0.0)
    assert not seen.any() and not asked.any()


@pytest.mark.parametrize("kind", KINDS)
def test_a_plane_casts_no_shadow_on_itself(egl: Context, kind: str) -> None:
    """Steps grow at least by half, so that few are asked for."""
    seen, asked = shadows(egl, kind, "p.z", [*UP, [0.6, 0, 0.8], [0, 0.8, 0.6]])
    np.testing.assert_allclose(seen, 1.0, rtol=8 * ULP)
    most = np.log(4.0 / (2 * PIXEL)) / np.log(1.5) + 1
    assert asked.min() >= 1 and asked.max() <= most


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_behind_the_light_casts_no_shadow(egl: Context, kind: str) -> None:
    wall = "min(p.z, 5.0 - p.z)"
    assert shadows(egl, kind, wall, UP, far=4.0)[0] == 1.0
    assert shadows(egl, kind, wall, UP, far=6.0)[0] == 0.0


@pytest.mark.parametrize("kind", KINDS)
def test_what_stands_in_the_way_leaves_nothing(egl: Context, kind: str) -> None:
    """Not a little more or less, and without steps after it is known."""
    seen, asked = shadows(egl, kind, "length(p - vec3(0.3, 0.0, 2.0)) - 1.0", [*UP, [0.28, 0, 0.96]])
    assert np.all(seen == 0.0) and asked.max() <= 64


AROUND = [*np.eye(3), *-np.eye(3), [0.05, -0.9987, 0.0], [0.0, -0.9999, 0.0141]]


@pytest.mark.parametrize("way", AROUND, ids=str)
def test_a_disc_that_is_cut_in_halves_gives_half_whatever_its_direction(egl: Context, way: list[float]) -> None:
    """A half-space whose face holds the ray to the middle of the disc."""
    across = np.cross(way, np.roll(way, 1) + 0.1)
    x, y, z = across / np.linalg.norm(across)
    seen, _ = shadows(egl, "light/two_sided", f"dot(p, vec3({x}, {y}, {z}))", [way], normal=", ".join(map(str, way)))
    np.testing.assert_allclose(seen, 0.5, atol=0.012)


def test_a_bound_that_is_flat_where_the_ray_starts_is_no_obstacle(egl: Context) -> None:
    """A twentieth of the distance is less than contact there, and a ray that stopped at that would see no light."""
    assert shadows(egl, "light/shadow", "0.05 * p.z", UP)[0] == 1.0


def evaluations(body: Callable[[float], float], far: float) -> int:
    """How often a hard shadow asks a field along the normal: steps to the expected tangent point of the spheres, at
    0.3 of the last slope and 0.7 of those before, of which the first is that of a plane."""
    t, r, slope, count = 2 * PIXEL, 0.0, 0.999, 0
    while True:
        step = max(r, min(2 * r / (1 - slope), far - t + r))
        if t + min(step, r) >= far:
            return count
        ahead, count = body(t + step), count + 1
        if step > r + abs(ahead):
            slope = -1.0
            continue
        if step > 0:
            slope = min(max(0.7 * slope + 0.3 * (ahead - r) / step, -1.0), 0.999)
        t, r = t + step, ahead


@pytest.mark.parametrize("slope", [1.0, 0.6, 0.0, -0.2])
def test_steps_follow_the_slope_of_the_field(egl: Context, slope: float) -> None:
    """A wall beside the ray comes nearer, stays or leaves."""
    body = f"min(p.z, 0.5 + {slope} * p.z)"
    for far in (2.0, 1.3, 0.9):
        _, asked = shadows(egl, "light/shadow", body, UP, far)
        assert asked[0] == evaluations(lambda t: min(t, 0.5 + slope * t), far)


def test_a_ray_out_of_steps_is_lit_unless_it_comes_nearer(egl: Context) -> None:
    """512 steps along a wall end far before the light: the wall stays beside the ray, or crosses it."""
    assert shadows(egl, "light/shadow", "0.02", UP, far=100.0)[0] == 1.0
    assert shadows(egl, "light/shadow", "0.05 - 0.00002 * p.z", UP, far=5000.0)[0] == 0.0


def test_a_soft_shadow_out_of_steps_is_what_was_seen_unless_the_wall_comes_nearer(egl: Context) -> None:
    """512 steps of 0.02 along a wall end at 10.24, or a bit farther, by longer steps before it reaches into the cone.
    The accelerated march continues the wall up to the light."""
    end, width = 512 * 0.02, 0.1
    beside = {kind: shadows(egl, kind, "0.02", UP, 100.0, width)[0] for kind in SOFT[:2]}
    np.testing.assert_allclose(beside["light/cone"], 0.02 / (width * 100.0), rtol=1e-4)
    assert end <= np.sqrt(0.0003) / (width * beside["light/triangulated"][0]) + 0.01 <= end + 0.1
    for kind, width in zip(SOFT, (0.1, 0.1, 0.01), strict=True):
        assert shadows(egl, kind, "0.05 - 0.00002 * p.z", UP, 5000.0, width)[0] <= 0.001


def test_a_disc_without_width_has_an_edge(egl: Context) -> None:
    """The field is 0 along the edge: half of the light is seen, however thin the disc."""
    np.testing.assert_allclose(shadows(egl, "light/two_sided", "p.x", UP, width=0.0)[0], 0.5, atol=0.002)


@pytest.mark.parametrize("kind", SOFT)
def test_a_wall_along_the_ray_takes_what_it_covers(egl: Context, kind: str) -> None:
    """A wall at h from the ray: its clearance over the disc's radius falls to h / (width far) at the light, which
    the last sample knows to a step. Between two samples h apart, the spheres meet at h sqrt(3/4)."""
    h, far, width = 0.0625, 8.0, 0.02
    seen, _ = shadows(egl, kind, f"{h} - p.x", UP, far, width)
    share = np.sqrt(0.75) if kind == "light/triangulated" else 1.0
    low, high = share * h / (width * far), share * h / (width * (far - 2 * h))
    if kind == "light/two_sided":
        low, high = (0.5 + (r * np.sqrt(1 - r * r) + np.arcsin(r)) / np.pi for r in (low, high))
    slack = 1e-3 if kind == "light/two_sided" else 8 * ULP  # near an end it turns into a straight edge
    assert low * (1 - slack) <= seen[0] <= high * (1 + slack)


def test_what_is_behind_two_samples_is_not_between_them(egl: Context) -> None:
    """The field falls once to less than the way, but more than the disc's 0.4 of it, and then grows nearly as it."""
    field = "p.z < 1.0 ? p.z : 0.3 + 0.99 * (p.z - 1.0)"
    assert shadows(egl, "light/triangulated", field, UP, width=0.4)[0] == 1.0


def test_the_disc_is_lit_on_both_sides_of_an_edge(egl: Context) -> None:
    """A wall whose edge keeps the same share of the disc along the whole way leaves the segment of a circle, for any
    direction of the edge."""
    for r in (-0.95, -0.7, -0.5, -0.2, 0.0, 0.2, 0.5, 0.7, 0.95):
        for turn in (0.0, 0.2, 0.4, 0.52):
            edge = f"{np.cos(turn)} * p.x + {np.sin(turn)} * p.y + {r * 0.1} * p.z"
            seen, asked = shadows(egl, "light/two_sided", edge, UP, width=0.1)
            np.testing.assert_allclose(seen, 0.5 + (r * np.sqrt(1 - r * r) + np.arcsin(r)) / np.pi, atol=0.012)
            assert asked[0] <= 7 * 200


@pytest.mark.parametrize("thickness", [1e-4, 0.01, 0.1])
def test_a_plate_that_is_thin_and_wide_leaves_nothing(egl: Context, thickness: float) -> None:
    """A level plate, seen at a slant; and each plate of two leaves what is between them."""
    ways = [[0.0, 0.0, 1.0], [0.6, 0.0, 0.8]]
    plate = f"(abs(p.z - 2.0) - {thickness / 2})"
    assert np.all(shadows(egl, "light/two_sided", f"min(p.z, {plate})", ways)[0] == 0.0)
    gap = f"min(p.z, max({plate}, 0.1 - abs(p.x)))"  # half a disc's radius on both sides of the middle
    wanted = 2 * (0.5 + (0.5 * np.sqrt(0.75) + np.arcsin(0.5)) / np.pi) - 1
    np.testing.assert_allclose(shadows(egl, "light/two_sided", gap, UP)[0], wanted, atol=0.05)


@pytest.mark.parametrize(
    ("opening", "wanted", "slack"),
    [
        ("length(p.xy) - 0.1", 0.25, 0.04),  # a round hole of half of the disc's radius, in the middle
        ("length(p.xy - vec2(0.08, 0.0)) - 0.06", 0.09, 0.04),  # and a smaller one aside
        ("abs(p.x - 0.08) - 0.06", 0.3486, 0.06),  # a slot beside the middle, from 0.1 to 0.7 of the radius
        ("abs(p.x) - 0.04", 0.2529, 0.04),  # and in the middle
        ("abs(mod(p.x, 0.1) - 0.05) - 0.03", 0.6, 0.18),  # slats: too narrow for a ray of 24 to count in full
    ],
)
def test_holes_and_slots_in_a_thin_plate_leave_their_part_of_the_disc(
    egl: Context, opening: str, wanted: float, slack: float
) -> None:
    """Seven rays leave them alike, so more are asked."""
    plate = f"min(p.z, max(abs(p.z - 2.0) - 0.001, -({opening})))"
    seen, _ = shadows(egl, "light/two_sided", plate, UP, width=0.1)
    np.testing.assert_allclose(seen, wanted, atol=slack)


@pytest.mark.parametrize("half", [0.1, 0.2, 0.3])
@pytest.mark.parametrize("aside", [0.0, 0.3, 0.6])
def test_rods_that_are_thinner_than_the_disc_take_their_part_of_it(egl: Context, half: float, aside: float) -> None:
    """Round rods, of a half width and at a distance from the middle in units of the disc's radius."""
    rod = f"length(vec2({np.cos(0.26)} * p.x + {np.sin(0.26)} * p.y - {0.2 * aside}, p.z - 2.0)) - {0.2 * half}"
    seen, _ = shadows(egl, "light/two_sided", f"min(p.z, {rod})", UP, width=0.1)
    x = np.clip([aside - half, aside + half], -1.0, 1.0)
    wanted = 1.0 - np.ptp(x * np.sqrt(1.0 - x * x) + np.arcsin(x)) / np.pi
    np.testing.assert_allclose(seen, wanted, atol=0.06)


def test_a_ray_along_an_edge_comes_to_what_is_beyond(egl: Context) -> None:
    """The field is 0 all along the edge; steps of its value would stay there."""
    seen, _ = shadows(egl, "light/two_sided", "min(p.x, 1.0 - p.z)", UP, far=16.0, width=0.8)
    assert seen[0] == 0.0


def test_wide_steps_pass_what_is_free(egl: Context) -> None:
    """Nothing within r is nearer to the disc's cone than r - width (s + r); over a plane that is nearly all of r."""
    _, asked = shadows(egl, "light/two_sided", "p.z", UP, far=1e6, width=1e-3)
    assert asked[0] <= np.log(1e6 / (2 * PIXEL)) / np.log(2 - 2e-3) + 1


def test_a_leaving_ray_clears_the_surface_and_stays_on_its_line(egl: Context) -> None:
    """Two epsilons off the surface; lower at grazing angles, where at most two epsilons lie before what the height of
    its start proves empty. Its line is shifted by two epsilons at most, by none where the cosine is a quarter or
    more."""
    rise = np.array([1.0, 0.8, 0.5, 0.25, 0.1, 1e-6, 0.0, -1e-6, -0.5, -1.0])
    ways = np.stack([np.sqrt(1 - rise**2), 0 * rise, rise], axis=1)
    before = """
        struct Ray { vec3 origin; vec3 direction; };
        const float epsilon_pixels = 1.0;
        const float contact_share = 0.5;"""
    after = """
        vec4 left(vec3 way) {
            float start;
            Ray ray = spawn_ray(vec3(0.0), vec3(0.0, 0.0, 1.0), way, 1.0, start);
            return vec4(ray.origin, start);
        }"""
    text = modules(*NEARNESS, "light/spawn_ray", before=before, after=after)
    found = run(egl, text, "left({0})", [(VEC3, ways)], 4, {"u_pixel": PIXEL}).astype(np.float64)
    origin, start = found[:, :3], found[:, 3]
    off = 2 * PIXEL
    assert np.all(np.linalg.norm(origin, axis=1) <= off * (1 + 8 * ULP))
    assert np.all(start <= 2 * off * (1 + 8 * ULP))
    height = (origin + start[:, None] * ways)[:, 2]
    assert np.all((height >= off / 3 * (1 - 8 * ULP))[rise >= 0]) and np.all(height <= off * (1 + 8 * ULP))
    assert np.all((start - height <= off * (1 + 8 * ULP))[rise >= 0])
    np.testing.assert_allclose(height[rise >= 0.5], off, rtol=8 * ULP)
    np.testing.assert_allclose(origin[rise >= 0.25], 0.0, atol=off * 8 * ULP)


@pytest.mark.parametrize(
    ("body", "strength", "known"),
    [
        (lambda p: p.z, 1.0, 1.0),
        (lambda p: 3.0 * p.z, 1.0, 1.0),  # a field that is too steep makes nothing lighter
        (lambda p: 0.5 * p.z, 1.0, 0.5),
        (lambda p: expr(-5.0), 0.5, 0.5),  # deep inside of another body no more is missing than all
        (lambda p: where(p.z < 0.4, -5.0, 9.0 * p.z), 1.0, 1 - 1 / 1.875),  # nor is more than all there elsewhere
        (lambda p: 0.5 * p.z, 8.0, 0.0),
    ],
)
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_openness_is_a_share(egl: Context, body: Any, strength: float, known: float, side: float) -> None:
    occlusion = rm.AmbientOcclusion(4, reach=1.0, strength=strength, decay=0.5)
    visibility = occlusion.visibility(lambda p: side * body(p), expr(side))
    function = Function("visibility", (POINT, NORMAL), visibility)
    found = evaluate(egl, function, [np.zeros((1, 3)), np.array([[0.0, 0.0, 1.0]])])
    np.testing.assert_allclose(found, known, rtol=8 * ULP)


def test_how_far_seven_rays_are_too_few_is_that_of_the_truth(egl: Context) -> None:
    """Also where none of the six is free, and where a solid in the middle is deep."""
    middle, off, total, sided = (a.ravel() for a in np.meshgrid(
        [-0.97, -0.9, -0.85, -0.3, 0.0, 0.1, 0.5, 0.9], [0.0, 1.0, 1.7, 3.0], [0.0, 0.05, 1.0, 2.0], [0.0, 0.6, 1.0]
    ))  # fmt: skip
    before = "float beside_edge(float clear) { return clear; }"
    found = run(egl, modules("light/seven", before=before), "few_of_seven({0}, {1}, {2}, {3})",
                [(FLOAT, values) for values in (middle, off, total, sided)], 1)  # fmt: skip
    np.testing.assert_allclose(found, _few(middle, off, total, sided), atol=1e-5)


@pytest.mark.parametrize("kind", SOFT)
def test_the_widest_disc_is_a_disc(egl: Context, kind: str) -> None:
    """A sine of 1 is taken for 0.999."""
    wall = "p.x + 0.5"
    widest, _ = shadows(egl, kind, wall, UP, width=1.0)
    assert widest == pytest.approx(shadows(egl, kind, wall, UP, width=0.999)[0], abs=1e-6)
