"""What a march hands on: its state in two texels, and the cones that a pixel may lie in."""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray

from raymarch.expr.types import VEC2, VEC4
from raymarch.gpu.context import Context
from raymarch.gpu.targets import Target
from tests.support.glsl_harness import modules, run

RAY = "struct Ray { vec3 origin; vec3 direction; };\n"


def test_a_state_comes_back_from_its_texels_as_it_was(egl: Context) -> None:
    """All flags, and as many fallbacks as a ray can have."""
    flags = np.array(list(itertools.product((0, 1), repeat=6)))
    rng = np.random.default_rng(5)
    a = np.column_stack([rng.normal(size=(64, 3)) * 1e3, np.tile([0, 1, 511, 60000], 16)]).astype(np.float32)
    b = np.column_stack([rng.normal(size=(64, 2)), rng.integers(0, 65536, (64, 2))]).astype(np.float32)
    c = rng.normal(size=(64, 4)).astype(np.float32)
    after = """
    vec4 way(vec4 a, vec4 b, vec4 c, vec4 flags, vec2 more, float part) {
        March at = March(a.x, a.y, c.y, c.z, a.z, c.x, flags.x > 0.5, flags.y > 0.5);
        Hit hit = Hit(flags.z > 0.5, flags.w > 0.5, b.x, b.y, b.z, b.w, a.w);
        vec4 march = packed_march(at, hit, more.y > 0.5), found = packed_hit(hit), rest = packed_more(at);
        at = unpack_march(march, rest);
        hit = unpack_hit(march, found);
        if (part == 0.0) return vec4(at.t, at.r, at.derivative, hit.fallbacks);
        if (part == 1.0) return vec4(hit.t, hit.residual, hit.iterations, hit.evaluations);
        if (part == 2.0) return vec4(at.last_derivative, at.kept_t, at.kept_r, c.w);
        if (part == 3.0) return vec4(at.refining, at.passing, hit.done, hit.found);
        return vec4(more.x, flag(march, 32.0), 0.0, 0.0);
    }"""
    text = modules("march/hit", "march/state", before=RAY, after=after)
    more = flags[:, 4:]
    inputs = [(VEC4, a), (VEC4, b), (VEC4, c), (VEC4, flags[:, :4]), (VEC2, more)]
    for part, known in enumerate((a, b, c, flags[:, :4], np.column_stack([more, 0 * more]))):
        found = run(egl, text, f"way({{0}}, {{1}}, {{2}}, {{3}}, {{4}}, {part}.0)", inputs, 4)
        np.testing.assert_array_equal(found, known)


CARRY = """
vec4 carried(float t) {
    March at = start_march(Ray(vec3(0.0), vec3(0.0, 0.0, 1.0)), t);
    vec2 spent = vec2(0.0);
    bool open = carry_on(at, spent);
    return vec4(open, at.t, at.derivative, spent.x);
}"""


def _carried(
    egl: Context, cones: NDArray[np.float32], count: int, t: float, cell: float, own: float, footprint: float
) -> NDArray[np.float32]:
    """What the pixels of a row take over from a row of cones: whether open, distance, slope, steps."""
    with_cones = Target(egl, (len(cones), 1))
    try:
        with_cones.write(cones[None])
        uniforms = {
            "u_carried": with_cones,
            "u_carried_cell": (cell, 1.0 if cell else 0.0),
            "u_cell": (own, 1.0),
            "u_footprint": (footprint, 0.0),
        }
        text = modules("march/hit", "march/start_published", "march/carry", before=RAY, after=CARRY)
        return run(egl, text, f"carried({t})", [(VEC2, np.zeros((count, 2)))], 4, uniforms)
    finally:
        with_cones.release()


def _cones(count: int) -> NDArray[np.float32]:
    """Texels of cones: distance (negative: free to the end), slope, steps, evaluations."""
    free = np.where(np.arange(count) % 7 == 3, -1.0, 2 + (np.arange(count) * 29 % 31) / 8)
    return np.column_stack([free, free / 16, np.arange(count), np.arange(count)]).astype(np.float32)


def test_a_pixel_goes_on_where_the_least_of_its_cones_ends(egl: Context) -> None:
    """Cells of 2.5 pixels: the middle pixel of five lies in two, and is free as far as both are."""
    cones = _cones(14)
    found = _carried(egl, cones, 35, 0.0, 2.5, 1.0, 0.5)
    for x, (open_, t, slope, spent) in enumerate(found):
        cells = cones[np.unique([int((x + 0.001) / 2.5), int((x + 0.999) / 2.5)])]
        ends = cells[cells[:, 0] >= 0]
        assert open_ == bool(len(ends)), x
        if len(ends):
            assert (t, slope) == tuple(ends[np.argmin(ends[:, 0]), :2]), x
        assert spent == cells[:, 2].mean()


def test_a_ray_never_goes_back_to_where_a_cone_ended(egl: Context) -> None:
    """Its own range may begin later, at the scene's box."""
    found = _carried(egl, _cones(8), 8, 4.0, 1.0, 1.0, 0.0)
    known = _cones(8)[:, 0]
    np.testing.assert_array_equal(found[:, 1], np.where(known < 0, 1e30, np.maximum(known, 4.0)).astype(np.float32))


def test_without_cones_a_ray_begins_where_its_range_does(egl: Context) -> None:
    found = _carried(egl, np.zeros((3, 4), np.float32), 4, 4.0, 0.0, 1.0, 0.5)
    np.testing.assert_array_equal(found, np.tile(np.float32([1, 4, -1, 0]), (4, 1)))


def test_the_last_pixels_of_a_large_picture_lie_in_its_last_cone(egl: Context) -> None:
    """Cells divide no picture exactly: their last edge, rounded, may lie beyond the last cell of coarser cones."""
    f = np.float32
    for pixels, count, coarse in ((16384, 1020, 300), (16384, 1008, 300), (16384, 970, 300)):
        own, cell = f(pixels / count), f(pixels / coarse)
        cones = np.tile(f([5, 0.5, 1, 1]), (coarse, 1))
        found = _carried(egl, cones, count, 0.0, float(cell), float(own), float(f(0.5) * own))
        np.testing.assert_array_equal(found, np.tile(f([1, 5, 0.5, 1]), (count, 1)))


BEGINS = """
bool stands;
float there;
vec2 marched;
vec2 range_of(Ray ray) { return marched; }
bool carry_on(inout March at, inout vec2 spent) {
    at.t = max(at.t, there);
    spent += vec2(6.0, 2.0);
    return stands;
}
"""


def test_a_ray_begins_where_its_cones_end_if_that_is_in_its_range(egl: Context) -> None:
    """Whether something can be met: cones say so, and neither their end nor the range may be empty."""
    after = """
    vec4 begun_on(vec4 a) {
        stands = a.x > 0.5;
        there = a.y;
        marched = a.zw;
        March at;
        vec2 range;
        Hit hit = no_hit(0.0);
        bool open = begins(Ray(vec3(0.0), vec3(0.0, 0.0, 1.0)), hit, at, range);
        return vec4(open, at.t, range.y, hit.iterations);
    }"""
    text = modules("march/hit", "march/start_published", before=RAY) + modules(
        "march/begin", before=BEGINS, after=after, variants=frozenset({"CONES"})
    )
    given = np.array(list(itertools.product((0, 1), (1.0, 4.0, 9.0, 30.0), (0.0, 5.0), (3.0, 10.0))))
    for share in (1.0, 0.0):
        found = run(egl, text, "begun_on({0})", [(VEC4, given)], 4, {"u_spent": share})
        stands, there, low, high = given.T
        asked = low <= high
        begin = np.where(asked, np.maximum(low, there), low)
        np.testing.assert_array_equal(found[:, 0] == 1, (stands == 1) & asked & (begin <= high))
        np.testing.assert_array_equal(found[:, 1:], np.column_stack([begin, high, np.where(asked, 6 * share, 0)]))


def test_a_pixel_on_the_edge_of_two_cells_takes_one(egl: Context) -> None:
    """Its ray has no width, and lies in both."""
    cones = _cones(14)
    found = _carried(egl, cones, 35, 0.0, 2.5, 1.0, 0.0)
    cells = np.minimum(((np.arange(35) + 0.5) / 2.5).astype(int), 13)
    known = cones[cells]
    np.testing.assert_array_equal(found[:, 0] == 1, known[:, 0] >= 0)
    np.testing.assert_array_equal(found[known[:, 0] >= 0, 1], known[known[:, 0] >= 0, 0])
    np.testing.assert_array_equal(found[:, 3], known[:, 2])
