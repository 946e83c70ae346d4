"""Membranes, where the field falls to 0 and rises again: how a ray in doubt steps and decides, against float64."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from raymarch.expr.types import FLOAT, VEC2, VEC4
from raymarch.gpu.context import Context
from tests.functions.profiles import NEAR, PIXEL, ROUNDING, text_of
from tests.support.glsl_harness import modules, run, run_all

COUNT = 4000
NOISE = 2e-3
UNIFORMS = {"u_pixel": PIXEL, "u_side": 1.0, "march_steps": 9, "u_start": (0.0, 0.0, 0.0, 0.0)}
CALLS = """
March state(vec4 a, vec2 b, bool doubtful) {
    return March(a.x, a.y, doubtful ? -a.z : a.z, a.w, b.x, b.y, true, false);
}
vec4 places(March at) { return vec4(at.t, at.r, at.kept_t, at.kept_r); }
vec4 rates(March at, bool found) { return vec4(at.derivative, at.last_derivative, float(at.passing), float(found)); }
"""


@dataclass
class State:
    """Of rays in doubt: the sample before and the one behind, (N,), and the rates; and a new sample."""

    t: NDArray[Any]
    r: NDArray[Any]
    behind: NDArray[Any]
    kept: NDArray[Any]
    derivative: NDArray[Any]
    last: NDArray[Any]
    new: NDArray[Any]
    value: NDArray[Any]

    def inputs(self) -> list[tuple[Any, NDArray[Any]]]:
        places = np.column_stack([self.t, self.r, self.behind, self.kept])
        return [
            (VEC4, places),
            (VEC2, np.column_stack([self.derivative, self.last])),
            (VEC2, np.column_stack([self.new, self.value])),
        ]


def states() -> State:
    """Half of them still fall; the others have risen, and have 1 to 6 samples left between two that are known."""
    rng = np.random.default_rng(31)
    t, gap = rng.uniform(1, 3, COUNT), 10 ** rng.uniform(-2, -0.5, COUNT)
    falling = np.arange(COUNT) % 2 == 0
    behind = t + gap
    new = np.where(falling, behind + 10 ** rng.uniform(-2, -0.5, COUNT), t + gap * rng.uniform(0.1, 0.9, COUNT))
    r, kept, value = (rng.uniform(low, 1, COUNT) * gap for low in (0.0, -0.2, -0.3))
    value[::3] = NOISE * rng.uniform(-2, 2, len(value[::3]))
    last = 10 ** rng.uniform(-1.5, 0.2, COUNT)
    given = (t, r, behind, kept, rng.integers(1, 7, COUNT), np.where(falling, -last, last), new, value)
    return State(*(np.asarray(values, np.float32).astype(float) for values in given))


def decided(of: State) -> tuple[NDArray[Any], NDArray[Any]]:
    """Places and rates after a sample. The least value lies beside the middle one of three, on the steeper side; a
    field that falls and rises at the steepest rate so far is lowest where both lines meet."""
    falling, inside = of.last < 0, of.value < -NOISE
    x = np.sort([of.t, of.behind, of.new], axis=0)
    order = np.argsort([of.t, of.behind, of.new], axis=0)
    y = np.take_along_axis(np.array([of.r, of.kept, of.value]), order, axis=0)
    slopes = np.diff(y, axis=0) / np.diff(x, axis=0)
    deeper = falling & (slopes[1] < 0)
    right = (deeper | (-slopes[0] > slopes[1])).astype(int)
    each = np.arange(COUNT)
    (a, b), (fa, fb) = (v[[right, right + 1], each] for v in (x, y))
    rate = np.max([-slopes[0], slopes[1], np.abs(of.last)], axis=0)
    left = np.where(falling, 6, of.derivative - 1)
    lowest = 0.5 * (fa + fb - rate * (b - a))
    ends = inside | (~deeper & ((left == 0) | (lowest > -NOISE)))
    slope = np.where(falling, -slopes[1], of.last)
    surface = np.where(falling, x[1] + y[1] / slope, of.t + of.r / slope)
    there = np.where(inside, np.minimum(of.new, surface - of.value / slope), b)
    places = np.where(
        ends,
        [there, np.where(inside, of.value, np.maximum(fb, 0)), 0 * a, fb],
        [a, fa, -b, fb],
    )
    rates = np.where(
        ends,
        [np.clip(rate, 0, 0.999), np.where(inside, -slope, 0), 0 * a + 1, inside],
        [np.where(deeper, of.derivative, left), np.where(deeper, of.last, rate), 0 * a, 0 * a],
    )
    places[3, ends] = 0.0  # not used
    return places.T, rates.T


@pytest.mark.parametrize("ahead", [False, True])
def test_a_sample_of_a_ray_in_doubt_decides_as_its_neighbours_tell(egl: Context, ahead: bool) -> None:
    """A ray that knows how far it is free compares values of the field, and goes on less the noise."""
    of, variants = states(), frozenset({"CUTS", "ADVANCE"} if ahead else {"CUTS"})
    call = f"enters_ahead(at, b.x, {NOISE})" if ahead else f"enters(at, b.x, b.y, {NOISE})"
    after = CALLS + "".join(f"""
    vec4 {name}_after(vec4 a, vec2 d, vec2 b) {{
        March at = state(a, d, true);
        {"value_there = b.y;" if ahead else ""}
        bool found = {call};
        if (!in_doubt(at)) at.kept_r = 0.0;
        return {name};
    }}""".replace(f"return {name}", f"return {given}") for name, given in (
        ("places", "places(at)"), ("rates", "rates(at, found)"), ("approaches", "vec4(APPROACH, 0.0, 0.0, 0.0)")
    ))  # fmt: skip
    text = text_of("bracketing", after=after.replace("APPROACH", "approach" if ahead else "1.0"), variants=variants)
    calls = [(f"{name}_after({{0}}, {{1}}, {{2}})", 4) for name in ("places", "rates", "approaches")]
    places, rates, approaches = run_all(egl, text, calls, of.inputs(), UNIFORMS)
    known_places, known_rates = decided(of)
    ended, inside = known_rates[:, 2] == 1, known_rates[:, 3] == 1
    if ahead:
        r = known_places[:, 1]
        known_places[:, 1] = np.where(ended, np.where(inside, r - NOISE, np.maximum(r - NOISE, 0)), r)
        np.testing.assert_allclose(approaches[:, 0], np.where(inside, -known_rates[:, 1], 1.0), rtol=1e-4)
    assert 0.2 < np.mean(ended) < 0.8 and 0.1 < np.mean(inside) < 0.5
    np.testing.assert_allclose(rates, known_rates, rtol=1e-3, atol=1e-6)
    flat = inside & (np.abs(known_rates[:, 1]) < 0.02)  # there a quotient is rounded by more
    np.testing.assert_allclose(places[~flat], known_places[~flat], rtol=1e-4, atol=1e-5)


def test_a_ray_in_doubt_steps_down_the_slope_then_to_where_both_lines_meet(egl: Context) -> None:
    """To a depth below the surface, no longer than to the end of the sphere and some more. A doubt begins with the
    steepest slope that is known, at least 0.05."""
    of, depth, most = states(), 0.01, 0.02
    after = (
        CALLS
        + f"""
    vec4 stepped(vec4 a, vec2 d) {{ return vec4(doubt_step(state(a, d, true), {depth}, {most}), 0.0, 0.0, 0.0); }}
    vec4 doubted(vec4 a, vec2 d, vec2 b) {{
        March at = state(a, d, false);
        doubt(at, b.x, b.y, d.x * 0.1 - 0.35);
        return vec4(at.t, at.kept_t, at.kept_r, at.last_derivative);
    }}"""
    )
    text = text_of("bracketing", after=after, variants=frozenset({"CUTS"}))
    calls = [("stepped({0}, {1})", 4), ("doubted({0}, {1}, {2})", 4)]
    stepped, doubted = run_all(egl, text, calls, of.inputs(), UNIFORMS)
    down = of.behind + np.minimum((of.kept + depth) / np.abs(of.last), of.kept + depth + most)
    middle = 0.5 * (of.t + of.behind + (of.r - of.kept) / of.last)
    known = np.where(of.last < 0, down, middle) - of.t
    np.testing.assert_allclose(stepped[:, 0], known, rtol=1e-4, atol=1e-5)
    rate = np.max([-of.last, 0.35 - 0.1 * of.derivative, np.full(COUNT, 0.05)], axis=0)
    assert np.mean(rate == 0.05) > 0.1
    np.testing.assert_allclose(doubted, np.column_stack([of.t, -of.new, of.value, -rate]), rtol=1e-5)


@pytest.mark.parametrize("epsilon", [0.0625, 1.0, 100.0])
def test_a_ray_in_doubt_aims_below_the_surface_and_the_noise(egl: Context, epsilon: float) -> None:
    """At seven tenths of a hit's width; at a rounding error from far coordinates on, whatever their sign and axis."""
    places = np.array([sign * size * axis for sign in (1, -1) for size in (0, 10, 1e4) for axis in np.eye(3)])
    t = np.linspace(0.5, 5, len(places))
    after = """
    vec4 depths(vec4 a) {
        Ray ray = Ray(a.xyz, vec3(0.0, 0.0, 1.0));
        return vec4(doubt_depth(ray, hit_widths(ray), a.w), noise_of(ray, a.w), rounding(ray, a.w), 0.0);
    }"""
    text = text_of("bracketing", after=after, variants=frozenset({"CUTS"}))
    share = 0.0625 / epsilon
    text = text.replace("contact_share = 0.0625", f"contact_share = {share}")
    (found,) = run_all(egl, text, [("depths({0})", 4)], [(VEC4, np.column_stack([places, t]))], UNIFORMS)
    size = np.abs(places).max(axis=1)
    ulps = ROUNDING * (size + t)
    noise = min(16 * share, 1.0) * ulps
    np.testing.assert_allclose(found[:, 1], noise, rtol=1e-5)
    np.testing.assert_allclose(found[:, 2], noise, rtol=1e-5)
    np.testing.assert_allclose(found[:, 0], 0.7 * (share * NEAR * t + ulps) + noise, rtol=1e-4)


def test_a_cone_is_never_in_doubt(egl: Context) -> None:
    """It stops before the surface, so it aims at no depth."""
    after = """
    float depth_of(float t) {
        Ray ray = Ray(vec3(0.0), vec3(0.0, 0.0, 1.0));
        return doubt_depth(ray, vec3(0.0, 0.1, 0.1), t);
    }"""
    before = "#define CONE\nstruct Ray { vec3 origin; vec3 direction; };\nuniform float u_pixel;\n"
    before += (
        "float rounding(Ray ray, float t) { return 1.0e-7 * t; }\nfloat hit_width(vec3 widths) { return widths.z; }\n"
    )
    before += "float width_at(vec3 widths, float width, float t) { return width * t; }\n"
    text = modules("march/hit", "march/membrane", before=before, after=after, variants=frozenset({"CONES", "CUTS"}))
    assert not run(egl, text, "depth_of({0})", [(FLOAT, [1.0, 100.0])]).any()
