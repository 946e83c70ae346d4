"""The functions of the probe, at the ends of their ranges: which faults it keeps, and which slopes it compares."""

from __future__ import annotations

import numpy as np
import pytest

from raymarch.expr.types import FLOAT, VEC2, VEC4
from raymarch.gpu.context import Context
from tests.support.glsl_harness import modules, run

ULP = 2.0**-24
STRIDE = 32
EVERY = np.full(128, 2**32 - 1, np.uint32)

NOTES = """
vec4 kept(vec2 codes) {
    note(vec2(codes.x, 5.0), vec3(1.0));
    note(vec2(codes.y, 6.0), vec3(2.0));
    note(vec2(codes.x, 7.0), vec3(3.0));
    return vec4(noted(), noted_place().x);
}
"""

ASKED = """
uniform int u_node;
vec4 slopes_between(vec4 a, vec4 b, vec2 cells) {  // points and what a node gave there
    watch();
    record_value(a.w, a.xyz, cells.x, u_node);
    compare(a.xyz);
    record_value(b.w, b.xyz, cells.y, u_node);
    compare(b.xyz);
    return steepest();
}
vec4 place_between(vec4 a, vec4 b) {
    slopes_between(a, b, vec2(0.0));
    return steepest_place();
}
"""


def kept(egl: Context, codes: list[tuple[float, float]], heard: np.ndarray = EVERY) -> np.ndarray:
    """Code, value and number of the faults, and the place, for two codes: the first is noted once more at the end."""
    return run(egl, modules("probe/note", after=NOTES), "kept({0})", [(VEC2, codes)], 4, {"u_site_mask": heard})


def only(*sites: int) -> np.ndarray:
    heard = np.zeros(128, np.uint32)
    for site in sites:
        heard[site // 32] |= np.uint32(1) << np.uint32(site % 32)
    return heard


def test_the_first_fault_is_kept_and_all_are_counted(egl: Context) -> None:
    found = kept(egl, [(33, 65), (0, 65), (33, 0), (0, 0), (-1, 65), (-40, -40)])
    assert found.tolist() == [[33, 5, 3, 1], [65, 6, 1, 2], [33, 5, 2, 1], [0] * 4, [65, 6, 1, 2], [0] * 4]


def test_silenced_nodes_are_passed_over(egl: Context) -> None:
    """Site 0 is the surface; a code without fault is of site 0 too, and must not be taken for it."""
    codes = [(4 + STRIDE * a, 4 + STRIDE * b) for a, b in ((1, 2), (2, 1), (31, 32), (32, 31), (0, 63))]
    assert kept(egl, codes, only(1, 32, 0))[:, 0].tolist() == [c + 4 for c in (32, 32, 1024, 1024, 0)]
    assert not kept(egl, codes, only(3, 30, 33, 64)).any()
    assert not kept(egl, [(0.0, -3.0)], only(0)).any()


def test_nodes_beyond_the_last_bit_share_it(egl: Context) -> None:
    """4096 nodes have a bit; those after are heard if the last one is, whatever else is silenced."""
    codes = [(STRIDE * site + 1.0, 0.0) for site in (4094, 4095, 4096, 5000, 8191, 100_000)]
    assert kept(egl, codes, only(4095))[:, 2].tolist() == [0, 2, 2, 2, 2, 2]
    assert kept(egl, codes, EVERY ^ only(4095))[:, 2].tolist() == [2, 0, 0, 0, 0, 0]


def slopes(egl: Context, a: np.ndarray, b: np.ndarray, cells: object = (0, 0), node: int = 4) -> np.ndarray:
    """The slopes of nodes 4 to 7, after one of them was asked at two points."""
    given = [(VEC4, a), (VEC4, b), (VEC2, np.broadcast_to(np.asarray(cells, float), (len(a), 2)))]
    text = modules("temporal/finite", "probe/watch", after=ASKED)
    return run(egl, text, "slopes_between({0}, {1}, {2})", given, 4, {"u_first": 4, "u_node": node})


@pytest.mark.parametrize("node", [3, 4, 5, 6, 7, 8])
def test_slopes_are_those_of_float64_each_in_its_own_component(egl: Context, node: int) -> None:
    random = np.random.default_rng(node)
    a, b = random.normal(size=(2, 500, 4)).astype(np.float32).astype(float)
    apart = np.linalg.norm((b - a)[:, :3], axis=1)
    scale = np.maximum(np.abs(a), np.abs(b)).max(axis=1)
    known = np.maximum(np.abs((b - a)[:, 3]) - 16 * ULP * scale, 0) / apart
    found = slopes(egl, a, b, node=node)
    for k in range(4):
        expected = known if k == node - 4 else 0 * known
        np.testing.assert_allclose(found[:, k], expected, rtol=16 * ULP, atol=float((8 * ULP * scale / apart).max()))
    assert np.all(found >= 0)


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_points_nearer_than_their_coordinates_allow_are_not_compared(egl: Context, axis: int, sign: int) -> None:
    """2^-10 of the largest coordinate of either: at 1024, two points 1 - 2^-11 apart are too near, for the other end
    alone they would be far enough. The values are not large."""
    far, near = np.zeros((2, 2, 4))
    far[:, axis] = sign * 1024
    near[:, axis] = sign * (1024 - np.array([1 - 2.0**-11, 1 + 2.0**-11]))
    near[:, 3] = 0.5
    for a, b in ((far, near), (near, far)):
        found = slopes(egl, a, b)[:, 0]
        assert found[0] == 0 and found[1] == pytest.approx(0.5, rel=0.02)


@pytest.mark.parametrize("value", [1024.0, -1024.0])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_points_nearer_than_their_values_allow_are_not_compared(egl: Context, axis: int, value: float) -> None:
    there, origin = np.zeros((2, 2, 4))
    there[:, axis], there[:, 3] = (1 - 2.0**-11, 1 + 2.0**-11), value
    moved = np.copy(origin)
    moved[:, axis] = there[:, axis]
    still = np.copy(origin)
    still[:, 3] = value
    for a, b in ((origin, there), (there, origin), (moved, still), (still, moved)):
        found = slopes(egl, a, b)[:, 0]
        assert found[0] == 0 and found[1] == pytest.approx(1024, rel=0.001)


def test_what_is_not_comparable_has_no_slope(egl: Context) -> None:
    a = np.array([[1.0, 2, 3, 4], [0, 0, 0, 0], [1, 0, 0, 0], [1, 0, 0, 0], [1, 0, 0, 0]])
    b = np.array([[1.0, 2, 3, 9], [0, 0, 0, 0], [3, 0, 0, np.nan], [3, np.inf, 0, 1], [3, 0, 0, -np.inf]])
    assert not slopes(egl, a, b).any(), "one point twice, the origin, and what is not finite"
    there = np.array([[3.0, 0, 0, 8.0]] * 2)
    assert slopes(egl, a[2:4], there, [(2, 3), (2, 2)])[:, 0] == pytest.approx([0, 4], rel=1e-6), "cells that differ"


def test_the_place_is_that_of_the_steepest_of_the_first_node(egl: Context) -> None:
    text = modules("temporal/finite", "probe/watch", after=ASKED)
    a, b = [(1.0, 0, 0, 0), (1, 2, 3, 4)], [(1.0, 4, 0, 2), (1, 2, 3, 4)]
    for node, known in ((4, [1, 4, 0, 4]), (5, [0] * 4)):
        uniforms = {"u_first": 4, "u_node": node}
        found = run(egl, text, "place_between({0}, {1})", [(VEC4, a), (VEC4, b)], 4, uniforms)
        assert found.tolist() == [known, [0] * 4]


def test_the_steepest_of_many_is_kept_and_its_place_with_it(egl: Context) -> None:
    """A walk along x whose slope rises and falls again: |x| < 1 has slope 3, the rest 1."""
    text = modules(
        "temporal/finite",
        "probe/watch",
        after="""vec4 walked(float start) {
            watch();
            for (int i = 0; i < 8; i++) {
                float x = start + float(i);
                record_value(x + 2.0 * clamp(x, -1.0, 1.0), vec3(x, 0.0, 0.0), 0.0, 4);
                compare(vec3(x, 0.0, 0.0));
            }
            return vec4(steepest().x, steepest_place().x, steepest_place().w, steepest().y);
        }""",
    )
    found = run(egl, text, "walked({0})", [(FLOAT, [-4.0, 2.0])], 4, {"u_first": 4})
    assert found[:, 0] == pytest.approx([3, 1], rel=1e-4) and found[:, 2:].tolist() == [[1, 0]] * 2
    assert found[0, 1] in (0, 1)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("where", ["value", "p.x", "p.y", "p.z"])
def test_an_answer_that_is_not_finite_is_as_if_never_given(egl: Context, where: str, bad: float) -> None:
    """The two answers beside it are compared with each other."""
    text = modules(
        "temporal/finite",
        "probe/watch",
        after=f"""uniform float u_bad;
        vec4 interrupted(float x) {{
            watch();
            record_value(0.0, vec3(x), 0.0, 4);
            compare(vec3(x));
            vec3 p = vec3(x, x, x + 0.5);
            float value = 1.0;
            {where} = u_bad;
            record_value(value, p, 0.0, 4);
            compare(p);
            record_value(4.0, vec3(x, x, x + 1.0), 0.0, 4);
            compare(vec3(x, x, x + 1.0));
            return steepest();
        }}""",
    )
    found = run(egl, text, "interrupted({0})", [(FLOAT, [0.0, 1.0])], 4, {"u_first": 4, "u_bad": bad})
    assert found == pytest.approx(np.array([[4, 0, 0, 0]] * 2), rel=1e-5)
