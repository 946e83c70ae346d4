"""Where a ray's range begins and ends, and how near is near enough, at the ends of their ranges."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from numpy.typing import NDArray

from raymarch.expr.types import FLOAT, VEC2, VEC3
from raymarch.gpu.context import Context
from tests.support.glsl_harness import modules, run

ULP = 2.0**-24
FAR = 100.0
STRUCT = "struct Ray { vec3 origin; vec3 direction; };\n"
CLIPPING = ("march/steep", "march/below", "march/above", "march/clip_to_box")
CLIP = modules(*CLIPPING, before=STRUCT)
CLIP_OF_CONES = modules(*CLIPPING, before=STRUCT + "const float u_cone = 0.0;\n", variants=frozenset({"CONES"}))
BOX = "clip_to_box(Ray(vec3({1}, 0.0, 0.0), vec3({2}, 0.0, 0.0)), {0}, vec3(-0.5, -1.0, -1.0), vec3(1.0))"
DIRECTIONS = np.array([0.0, -0.0, 1e-30, -1e-30, 1e-12, -1e-12, 0.25, -0.25, 1.0, -1.0])
PLACES = np.array([-3.0, -1.0, -0.25, 0.5, 0.75, 2.0, 1e6, -1e6])
RANGES = np.array([(0.0, FAR), (2.0, 5.0), (50.0, FAR)])
_ALL = list(itertools.product(RANGES, PLACES, DIRECTIONS))
RANGE, ORIGIN, DIRECTION = (np.array([case[i] for case in _ALL]) for i in range(3))


def _clipped(upper: float | None, lower: float | None) -> NDArray[np.float64]:
    """The part of each range in which a ray is between planes; (1, 0) where there is none."""
    found = RANGE.copy()
    for end, sign in ((upper, 1.0), (lower, -1.0)):
        if end is None:
            continue
        way, room = sign * DIRECTION, sign * (end - ORIGIN)  # it is between while t way <= room
        parallel = np.abs(way) < 1e-20
        t = room / np.where(parallel, 1.0, way)
        found[:, 1] = np.where(~parallel & (way > 0), np.minimum(found[:, 1], t), found[:, 1])
        found[:, 0] = np.where(~parallel & (way < 0), np.maximum(found[:, 0], t), found[:, 0])
        found[parallel & (room < 0)] = (1.0, 0.0)
    found[found[:, 0] > found[:, 1]] = (1.0, 0.0)
    return found


@pytest.mark.parametrize(
    ("text", "call", "upper", "lower"),
    [
        (CLIP, "below({0}, {1}, {2}, 1.0)", 1.0, None),
        (CLIP, "above({0}, {1}, {2}, -0.5)", None, -0.5),
        (CLIP, BOX, 1.0, -0.5),
        (CLIP_OF_CONES, BOX, 1.0, -0.5),
    ],
)
def test_a_range_is_cut_to_where_the_ray_is_inside(
    egl: Context, text: str, call: str, upper: float | None, lower: float | None
) -> None:
    """Rays along the planes, towards them, away from them; from inside, from far outside and beyond."""
    inputs = [(VEC2, RANGE), (FLOAT, ORIGIN), (FLOAT, DIRECTION)]
    found, known = run(egl, text, call, inputs, 2), _clipped(upper, lower)
    empty = known[:, 0] > known[:, 1]
    np.testing.assert_array_equal(found[:, 0] > found[:, 1], empty)
    np.testing.assert_allclose(found[~empty], known[~empty], rtol=8 * ULP)
    assert np.sum(empty) > 50 and np.sum(~empty) > 50


PIXEL, NEAR, SHARE, CONE, CONE_SHARE = 0.002, 0.1, 0.0625, 0.01, 0.25
CONSTANTS = f"""
const float epsilon_pixels = {NEAR};
const float contact_share = {SHARE};
const float cone_share = {CONE_SHARE};
"""
WIDTHS = {
    "march/widths": ("", NEAR * PIXEL, SHARE * NEAR * PIXEL),
    "march/widths before cones": ("", NEAR * PIXEL, SHARE * NEAR * PIXEL),
    "march/widths of a cone": ("#define CONE\n", CONE_SHARE * CONE, CONE_SHARE * CONE),
}


@pytest.mark.parametrize("name", list(WIDTHS))
def test_the_widths_of_a_ray_bound_a_fraction_of_a_pixel_and_rounding(egl: Context, name: str) -> None:
    """2 ulp of the largest coordinate of each point on the ray, or of the distance; at most twice that."""
    define, near, contact = WIDTHS[name]
    needed = "uniform float u_cone;\n" if "cone" in name else ""
    after = "vec3 widths(vec3 o, vec3 d) { return hit_widths(Ray(o, d)); }"
    variants = frozenset({"CONES"} if "cone" in name else ())
    before = define + needed + STRUCT + CONSTANTS
    text = modules("march/widths", before=before, after=after, variants=variants)
    rng = np.random.default_rng(6)
    origins = rng.normal(size=(60, 3)) * 10.0 ** rng.uniform(-3, 6, (60, 1))
    directions = rng.normal(size=(60, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    for pixel in (1.0, 0.0):  # and a picture whose pixels have no width: rounding alone
        uniforms = {"u_pixel": PIXEL * pixel} | ({"u_cone": CONE * pixel} if needed else {})
        found = run(egl, text, "widths({0}, {1})", [(VEC3, origins), (VEC3, directions)], 3, uniforms)
        for t in (0.0, 1e-3, 5.0, 1e5):
            size = np.abs(origins + t * directions).max(axis=1)
            largest = np.abs(origins).max(axis=1) + t
            for width, column in ((near, 1), (contact, 2)):
                reach = found[:, 0] + found[:, column] * t
                least = np.maximum(width * pixel * t, 4 * ULP * np.maximum(size, t))
                assert np.all(reach >= least * (1 - 1e-5))
                assert np.all(reach <= (width * pixel * t + 4 * ULP * largest) * (1 + 1e-5))


def test_the_widths_of_an_orthographic_ray_are_a_fraction_of_a_pixel_and_rounding(egl: Context) -> None:
    """As above, but that the fraction of a pixel is the same at each distance."""
    after = "vec3 widths(vec3 o, vec3 d) { return hit_widths(Ray(o, d)); }"
    orthographic = frozenset({"ORTHOGRAPHIC"})
    text = modules("march/widths", before=STRUCT + CONSTANTS, after=after, variants=orthographic)
    largest = np.repeat([1e-3, 7.0, 1e6], 6)
    origins = largest[:, None] * np.tile(np.vstack([np.eye(3), -np.eye(3)]), (3, 1))
    for pixel in (PIXEL, 0.0):
        inputs = [(VEC3, origins), (VEC3, np.roll(origins, 1, axis=1))]
        found = run(egl, text, "widths({0}, {1})", inputs, 3, {"u_pixel": pixel})
        np.testing.assert_allclose(found[:, 0], 4 * ULP, rtol=8 * ULP)
        for column, share in ((1, NEAR), (2, NEAR * SHARE)):
            np.testing.assert_allclose(found[:, column], share * pixel + 4 * ULP * largest, rtol=8 * ULP)
    text = modules("march/widths", "march/nearness", before=STRUCT + CONSTANTS, variants=orthographic)
    for t, known in ((0.0, NEAR * PIXEL), (9.0, NEAR * PIXEL), (1e6, 4e6 * ULP)):
        found = run(
            egl, text, "nearness({0}, {1}, 0.1)", [(VEC3, np.zeros((1, 3))), (FLOAT, [t])], 1, {"u_pixel": PIXEL}
        )
        np.testing.assert_allclose(found, known, rtol=8 * ULP)


@pytest.mark.parametrize("kind", ["scaled", "varied"])
def test_a_scaled_step_is_at_least_an_ulp_of_the_way(egl: Context, kind: str) -> None:
    """A step back, from inside, is as long as it is deep."""
    constants = "const float step_scale = 1e-6;\nconst float step_variation = 0.0;\n"
    random = "float random_of_pixel(int k) { return 0.5; }\n"
    text = modules("march/widths", f"march/safe_step_{kind}", before=STRUCT + CONSTANTS + constants + random)
    r, t = np.array([1e-3, 1e-3, 1e-9, 0.0, -1e-3, -1e-9]), np.array([0.0, 5.0, 5.0, 5.0, 5.0, 5.0])
    known = np.where(r > 0, np.maximum(1e-6 * r, 2 * ULP * t), 1e-6 * r)
    np.testing.assert_allclose(run(egl, text, "safe_step({0}, {1})", [(FLOAT, r), (FLOAT, t)]), known, rtol=8 * ULP)


def test_a_range_that_encloses_two_holds_both(egl: Context) -> None:
    text = modules("march/enclosing")
    cases = [((1, 4), (2, 3), (1, 4)), ((2, 3), (1, 4), (1, 4)), ((1, 2), (3, 4), (1, 4)), ((1, 2), (1, 0), (1, 2)),
             ((3, 4), (1, 0), (3, 4))]  # fmt: skip
    a, b, known = (np.array([case[k] for case in cases], float) for k in range(3))
    np.testing.assert_array_equal(run(egl, text, "enclosing({0}, {1})", [(VEC2, a), (VEC2, b)], 2), known)


@pytest.mark.parametrize("axis", range(3))
def test_each_axis_of_a_box_cuts_a_range(egl: Context, axis: int) -> None:
    """A ray that is fast along an axis leaves there first, and one that is slow along it enters there last."""
    ray = f"Ray(vec3(-2.0), vec3({', '.join('{1}' if k == axis else '{2}' for k in range(3))}))"
    call = f"clip_to_box({ray}, {{0}}, vec3(-1.0), vec3(1.0))"
    inputs = [(VEC2, [(0.0, FAR)] * 2), (FLOAT, [2.0, 1.0]), (FLOAT, [1.0, 2.0])]
    np.testing.assert_allclose(run(egl, CLIP, call, inputs, 2), [[1.0, 1.5]] * 2, rtol=8 * ULP)


@pytest.mark.parametrize(("name", "share"), [("epsilon", 1.0), ("contact", SHARE)])
def test_near_a_surface_is_a_fraction_of_a_pixel_but_no_less_than_rounding(
    egl: Context, name: str, share: float
) -> None:
    """2 ulp of the largest of the coordinates and the distance, whichever that is and whatever its sign."""
    names = [f"march/{module}" for module in ("widths", "nearness", name)]
    text = modules(*names, before=STRUCT + CONSTANTS)
    places = [sign * size * np.eye(3)[i] for sign in (1, -1) for size in (1e-3, 7.0, 1e6) for i in range(3)]
    p = np.array([*places, *places, (0, 0, 0), (0, 0, 0)])
    t = np.array([0.0] * len(places) + [3.0] * len(places) + [0.0, 5.0])
    for pixel in (1.0, 0.0):
        found = run(egl, text, f"{name}({{0}}, {{1}})", [(VEC3, p), (FLOAT, t)], uniforms={"u_pixel": PIXEL * pixel})
        rounding = 4 * ULP * np.maximum(np.abs(p).max(axis=1), t)
        np.testing.assert_allclose(found, np.maximum(share * NEAR * PIXEL * pixel * t, rounding), rtol=8 * ULP)
