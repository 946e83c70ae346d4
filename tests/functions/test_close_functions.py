"""What a ray does close to a surface: its next step, and what becomes of a sample, against float64.

The references state the rules of march/loop and march/bracketing for many states at once, most of which a march comes
to once in thousands of rays.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from raymarch.expr.types import VEC4
from raymarch.gpu.context import Context
from tests.functions.profiles import CONTACT, NEAR, PIXEL, ROUNDING, text_of
from tests.support.glsl_harness import run_all

COUNT = 6000
FAR = 20.0
LEAP = 0.0875 * PIXEL
UNIFORMS = {"u_pixel": PIXEL, "u_side": 1.0, "march_steps": 9, "u_start": (0.0, 0.0, 0.0, 0.0)}
AFTER = """
const Ray ray = Ray(vec3(0.0), vec3(0.0, 0.0, 1.0));
March last_of(vec4 a, vec4 b) {
    return March(a.x, a.y, a.z, a.w, b.x, b.y, mod(b.z, 2.0) == 1.0, b.z >= 2.0);
}
vec4 stepped(vec4 a, vec4 b, vec4 c) {
    March at = last_of(a, b);
    float leap = 0.0;
    float z = close_step(ray, hit_widths(ray), at, step_length(at, 20.0), leap);
    return vec4(step_length(at, 20.0), z, leap, is_close(at, close_width(hit_widths(ray)) * at.t));
}
bool confirmed(vec4 a, vec4 b, vec4 c, out March at, out bool empty) {
    March last = last_of(a, b);
    float t = last.t + c.x;
    float behind = BEHIND;
    float derivative = (c.y - last.r) / c.x;
    KNOWN
    empty = c.x <= last.r + behind + c.w;
    at = last;
    move(at, empty, t, c.y, derivative);
    return confirm(ray, hit_widths(ray), last, at, c.x, t, c.y, behind, empty, derivative, 0.5);
}
vec4 places(vec4 a, vec4 b, vec4 c) {
    March at;
    bool empty;
    bool found = confirmed(a, b, c, at, empty);
    return vec4(at.t, at.r, at.kept_t, at.kept_r);
}
vec4 rates(vec4 a, vec4 b, vec4 c) {
    March at;
    bool empty;
    bool found = confirmed(a, b, c, at, empty);
    return vec4(at.derivative, at.last_derivative, (at.refining ? 1.0 : 0.0) + (at.passing ? 2.0 : 0.0),
        (found ? 1.0 : 0.0) + (empty ? 2.0 : 0.0));
}
"""
KNOWN = "way_behind = behind; by_distance = b.w > 0.5;"
THERE = " value_there = c.y;"


class States(SimpleNamespace):
    """Arrays (N,) of the states and samples of rays. `after` gives a copy with some changed."""

    def after(self, **changed: Any) -> States:
        return States(**{**vars(self), **changed})

    def of(self, *names: str) -> NDArray[np.float64]:
        return np.column_stack([getattr(self, name) for name in names]).astype(float)


def states(doubts: bool, ahead: bool) -> States:
    """Searching and refining, near surfaces and not, on both sides, with spheres that are kept or not."""
    rng = np.random.default_rng(41)
    t = rng.uniform(0.5, 4, COUNT)
    wide = NEAR * t

    def around(share: float) -> NDArray[np.float64]:
        """Values from a hundredth of a hit's width to many widths, a share of them below 0."""
        found = wide * 10 ** rng.uniform(-2, 2, COUNT)
        return np.where(rng.random(COUNT) < share, -found, found)

    refining = rng.random(COUNT) < 0.4
    r = np.where(refining, around(0.4), around(0.0))
    small = np.where(rng.random(COUNT) < 0.3, rng.uniform(-3, 3, COUNT) * ROUNDING * t, r)
    r = np.where(rng.random(COUNT) < 0.2, small, r)
    last = np.where(rng.random(COUNT) < 0.2, 0, rng.uniform(-1, 0.6, COUNT))
    kept_t = np.where(
        refining, t - np.abs(around(0.0)), np.where(rng.random(COUNT) < 0.5, 0, t + np.abs(4 * around(0.0)))
    )
    kept_t = np.where(refining & (rng.random(COUNT) < 0.4), t, kept_t)
    kept_r = np.where(refining, np.where(kept_t == t, r, np.abs(around(0.0))), around(0.4))
    if doubts:
        doubtful = ~refining & (rng.random(COUNT) < 0.2)
        kept_t = np.where(doubtful, -t - np.abs(around(0.0)), kept_t)
    step = np.abs(around(0.0))
    given = {
        "t": t, "r": r, "kept_t": kept_t, "kept_r": kept_r, "last": last,
        "derivative": np.where(rng.random(COUNT) < 0.2, -1, rng.uniform(-1, 0.9, COUNT)),
        "flags": refining + 2.0 * (rng.random(COUNT) < 0.3), "by": 1.0 * (rng.random(COUNT) < 0.5),
        "z": np.where((rng.random(COUNT) < 0.05) & (kept_t != t), 0.0, step), "value": around(0.3),
        "leap": np.where(rng.random(COUNT) < 0.5, 0.0, LEAP * t),
    }  # fmt: skip
    given["next"] = np.where(rng.random(COUNT) < 0.1, rng.uniform(-3, 3, COUNT) * ROUNDING * t, around(0.3))
    if ahead:
        given["behind"] = np.abs(given["next"]) * rng.uniform(0.5, 1.5, COUNT)
    found = States(**{name: np.asarray(values, np.float32).astype(float) for name, values in given.items()})
    found.refining, found.passing = found.flags % 2 == 1, found.flags >= 2
    return found


def near_of(at: States, t: NDArray[Any]) -> NDArray[Any]:
    return np.where(at.passing, CONTACT + ROUNDING, NEAR + ROUNDING) * t


def noise_of(t: NDArray[Any]) -> NDArray[Any]:
    return ROUNDING * t


def depth_of(t: NDArray[Any]) -> NDArray[Any]:
    return (0.7 * (CONTACT + ROUNDING) + ROUNDING) * t


def firsts(at: States, ahead: bool) -> NDArray[np.bool_]:
    """A ray begins on a face of the scene's box where the field is 0 but for its noise."""
    return (at.r <= 0) & (at.r >= -2 * noise_of(at.t)) if ahead else np.abs(at.r) <= noise_of(at.t)


def lengths(at: States) -> NDArray[Any]:
    """To where the next sphere is expected to touch, at least the distance; into the gap before a kept sphere."""
    low = at.kept_t - np.abs(at.kept_r) - at.t
    z = np.minimum(2 * at.r / (1 - at.derivative), FAR - at.t + at.r)
    return np.maximum(at.r, np.where((at.kept_t > 0) & (z >= low), 0.5 * (at.r + low), z))


def further(at: States, z: NDArray[Any], most: NDArray[Any], ahead: bool) -> NDArray[Any]:
    """What a step near a surface may be longer: so that at most `most` stays unproven, and not beyond the surface."""
    m = np.where(at.last == 0, -1, at.last)
    more = 0.95 * most / (1 - at.derivative)
    found = np.where(m < 0, np.minimum(np.maximum(at.r / -m - z, 0), more), more)
    none = (at.last == 0) | (at.kept_t != 0) | (at.r <= 0) | (at.r > 3 * most) | (ahead & (at.derivative == -1))
    return np.where(none, 0, found)


@pytest.mark.parametrize("ahead", [False, True])
@pytest.mark.parametrize("doubts", [False, True])
def test_a_step_close_to_a_surface_is_that_of_its_state(egl: Context, doubts: bool, ahead: bool) -> None:
    at = states(doubts, ahead)
    (found,) = run_all(egl, text(doubts, ahead), [("stepped({0}, {1}, {2})", 4)], inputs(at), UNIFORMS)
    most = LEAP * at.t
    z = lengths(at)
    more = further(at, z, most, ahead)
    longest = (2 * at.r + 0.95 * most) / (1 - at.last)
    down = np.where(at.last < 0, -at.last, 1)
    width = np.maximum(NEAR + ROUNDING, 3 * LEAP) * at.t
    close = at.refining | (at.r + np.minimum(at.last, 0) * (at.r + width) < width)
    if doubts:
        depth = depth_of(at.t)
        behind = -at.kept_t - at.t
        doubtful, first = at.kept_t < 0, firsts(at, ahead)
        slope = np.where(at.last == 0, 1, at.last)
        reach = 0.375 * (NEAR + ROUNDING) * at.t
        doubt = behind + np.minimum((at.kept_r + depth) / -slope, at.kept_r + depth + reach)
        doubt = np.where(at.last > 0, 0.5 * (behind + (at.r - at.kept_r) / slope), doubt)
        secant = np.where(at.last < 0, np.minimum((at.r + depth) / down, depth + longest), at.r)
        search = np.where(first, depth, np.maximum(z, ROUNDING * at.t) + more)
        known = np.where(doubtful, doubt, np.where(at.refining, secant, search))
        leap = np.where(first, 1e30, np.where(at.refining | (more != 0), most, 0))
        close |= doubtful
        unknown = doubtful & (at.last == 0)
    else:
        secant = np.where(at.last < 0, np.minimum(at.r / down, longest), at.r)
        known = np.where(at.refining, secant, z + more)
        leap = np.where(at.refining | (more != 0), most, 0)
        unknown = np.zeros(COUNT, bool)
    np.testing.assert_allclose(found[:, 0], z, rtol=1e-5, atol=1e-7)
    np.testing.assert_allclose(found[~unknown, 1], known[~unknown], rtol=2e-4, atol=1e-7)
    np.testing.assert_allclose(found[:, 2], leap, rtol=1e-5)
    np.testing.assert_array_equal(found[:, 3] == 1, close)


def text(doubts: bool, ahead: bool) -> str:
    variants = frozenset((["CUTS"] if doubts else []) + (["ADVANCE"] if ahead else []))
    after = AFTER.replace("KNOWN", (KNOWN + (THERE if doubts else "")) if ahead else "").replace(
        "BEHIND", "c.z" if ahead else "abs(c.y)"
    )
    return text_of("bracketing", after=after, variants=variants)


def inputs(at: States) -> list[tuple[Any, NDArray[Any]]]:
    third = "behind" if hasattr(at, "behind") else "value"
    return [
        (VEC4, at.of("t", "r", "kept_t", "kept_r")),
        (VEC4, at.of("derivative", "last", "flags", "by")),
        (VEC4, at.of("z", "next", third, "leap")),
    ]


def moved(at: States, t: NDArray[Any], rise: NDArray[Any], empty: NDArray[np.bool_], ahead: bool) -> States:
    """A search goes to a sample, or keeps its sphere; where a sphere reaches a kept one, the ray goes on behind it."""
    low = at.kept_t - np.abs(at.kept_r)
    met = empty & (at.kept_t > t) & (t + at.next >= low) & (at.kept_r > 0)
    to = np.where(met, at.kept_t, t)
    short = np.minimum(at.next, at.behind) if ahead else at.next
    expected = np.where(empty, np.clip(0.7 * at.derivative + 0.3 * rise, -1, 0.999), -1)
    return at.after(
        t=np.where(empty, to, at.t),
        r=np.where(empty, np.where(met, at.kept_r, at.next), at.r),
        kept_r=np.where(empty, at.kept_r, short),
        kept_t=np.where(empty, np.where(low > to, at.kept_t, 0), t),
        last=np.where(empty & ~met, rise, 0),
        derivative=np.where(at.by == 1, expected, -1) if ahead else expected,
    )


def settled(mask: NDArray[np.bool_], yes: States, no: States) -> States:
    return States(**{name: np.where(mask, value, vars(no)[name]) for name, value in vars(yes).items()})


@pytest.mark.parametrize("ahead", [False, True])
@pytest.mark.parametrize("doubts", [False, True])
def test_a_sample_close_to_a_surface_is_taken_for_what_it_proves(egl: Context, doubts: bool, ahead: bool) -> None:
    """Where a surface may be a membrane, a sample that is not inside begins a doubt, down the steepest slope so far."""
    last = states(doubts, ahead)
    if doubts:
        last = last.after(kept_t=np.where(last.kept_t < 0, 0, last.kept_t))
    calls = [("places({0}, {1}, {2})", 4), ("rates({0}, {1}, {2})", 4)]
    places, rates = run_all(egl, text(doubts, ahead), calls, inputs(last), UNIFORMS)
    behind = last.behind if ahead else np.abs(last.next)
    t = (last.t + last.z).astype(np.float32).astype(float)
    first = firsts(last, ahead) & doubts
    still = (last.z == 0) | (first & (last.next > 0))
    rise = (last.next - last.r) / np.where(last.z == 0, 1, last.z)
    empty = last.z <= last.r + behind + last.leap
    at = moved(last, t, rise, empty, ahead)
    at = at.after(last=np.where(still, last.derivative, at.last))
    expected = np.where(last.by == 1, last.derivative, -1) if ahead else last.derivative
    at = at.after(derivative=np.where(still, expected, at.derivative))
    rise = np.where(still, last.derivative, rise)
    between = last.refining & (last.r < 0)
    whole = np.where(t == last.kept_t, 1, t - last.kept_t)
    rise = np.where(between & (last.next < 0), (last.next - last.kept_r) / whole, rise)
    proven = empty | between
    near = proven & (last.next < np.where(last.refining, np.abs(last.r), near_of(last, t)))
    passed = last.refining & ~near
    begins = doubts & near_the_noise(last, t, near, proven, first, ahead) & (last.refining | first | (rise < 0))
    unproven = doubts & near_the_noise(last, t, near, proven, first, ahead)
    near &= ~unproven
    touches = passed & (np.abs(last.r) <= (CONTACT + ROUNDING) * last.t) & (not doubts)
    certain = (last.z <= last.r + behind) | first
    follows = certain & (last.next >= 0) & (~last.refining | (last.t == last.kept_t))
    kept_t = np.where(follows, t, np.where(last.refining, last.kept_t, last.t))
    kept_r = np.where(follows, last.next, np.where(last.refining, last.kept_r, last.r))
    taken = at.after(
        t=np.where(near, t, kept_t), r=np.where(near, last.next, kept_r), kept_t=np.where(near, kept_t, 0),
        kept_r=kept_r, derivative=np.where(proven, last.derivative, -1), last=np.where(near, rise, 0),
        flags=near + 2.0 * (last.passing | passed),
    )  # fmt: skip
    at = settled(touches, last, settled(near | passed, taken, at))
    rate = 0.5 if ahead else 1.0
    steepest = np.max([-last.last * rate, -rise * rate, np.full(COUNT, 0.05)], axis=0)
    leaves = ahead & (last.r > 0) & (last.t + last.r < t)  # it is free up to there
    before = last.after(t=np.where(leaves, last.t + last.r, last.t), r=np.where(leaves, noise_of(t), last.r))
    at = settled(begins, before.after(kept_t=-t, kept_r=last.next, last=-steepest), at)
    limits = (
        np.where(rise < 0, np.minimum(CONTACT + ROUNDING, -rise * 0.375 * (NEAR + ROUNDING)), CONTACT + ROUNDING) * t
    )
    if doubts:
        limits = np.maximum(limits, 2 * depth_of(t if ahead else last.t))
    found = touches | (near & ~begins & (np.abs(last.next) <= limits))
    assert 0.1 < np.mean(near) < 0.9 and 0.05 < np.mean(found) < 0.9
    assert (0.02 < np.mean(begins) < 0.5) if doubts else (0.02 < np.mean(touches) < 0.5)
    clear = np.abs(np.abs(last.next) - limits) > 1e-3 * limits
    assert np.mean(clear) > 0.99
    taken_for = found + 2.0 * (proven | begins | ((near | passed) & ~touches))
    np.testing.assert_array_equal(rates[clear, 3], taken_for[clear])
    np.testing.assert_array_equal(rates[clear, 2], at.flags[clear])
    np.testing.assert_allclose(places[clear], at.of("t", "r", "kept_t", "kept_r")[clear], rtol=1e-5, atol=1e-9)
    np.testing.assert_allclose(rates[clear, :2], at.of("derivative", "last")[clear], rtol=1e-3, atol=1e-4)


def near_the_noise(
    last: States,
    t: NDArray[Any],
    near: NDArray[np.bool_],
    proven: NDArray[np.bool_],
    first: NDArray[np.bool_],
    ahead: bool,
) -> NDArray[np.bool_]:
    """Whether a sample proves no surface: of two outside of the solid, the second one near it."""
    if not ahead:
        noise, depth = noise_of(last.t), depth_of(last.t)
        return near & (last.next >= -noise) & (last.r >= -noise) & (last.next <= 2 * depth)
    low = np.where(near, last.next, np.where(proven & (last.refining | first), last.next, np.inf))
    return (low <= 2 * depth_of(t)) & (last.next >= -noise_of(t)) & (last.r >= -2 * noise_of(last.t))


SKIPPED = """
vec4 skipped(vec4 a, vec4 b, vec4 c) {
    vec3 widths = hit_widths(ray);
    float width = close_width(widths);
    March last = last_of(a, b);
    float t = last.t + c.x;
    float behind = BEHIND;
    float derivative = (c.y - last.r) / c.x;
    KNOWN
    bool far_off = is_far(c.y, derivative, width_at(2.0 * widths, 2.0 * width, t));
    bool skips = far_off && c.x <= last.r + behind + LEAST;
    March at = last;
    follow(at, t, c.y, derivative);
    float z = free_step(at);
    March whole;
    bool empty;
    bool close = is_close(last, width_at(widths, width, last.t)) || at.t + z > 20.0;
    bool found = confirmed(a, b, vec4(c.xyz, LEAST), whole, empty);
    found = found || !empty || is_close(whole, width_at(widths, width, t));
    bool same = at == whole && z == step_length(whole, 20.0);
    return vec4(close, skips, found, same);
}
"""


@pytest.mark.parametrize("ahead", [False, True])
@pytest.mark.parametrize("doubts", [False, True])
def test_a_turn_that_skips_what_is_close_leaves_the_same_state(egl: Context, doubts: bool, ahead: bool) -> None:
    rng = np.random.default_rng(43)
    at = states(doubts, ahead)
    t, width = at.t, np.maximum(NEAR, 3 * LEAP) * at.t
    r = width * 10 ** rng.uniform(0, 2.5, COUNT)
    z = r * rng.uniform(1, 4, COUNT)
    fallen = np.where(
        rng.random(COUNT) < 0.5, rng.uniform(-1, 1, COUNT) * z, width * 10 ** rng.uniform(-1, 1, COUNT) - r
    )
    following = r + np.clip(fallen, -z, z)
    free = at.after(r=r, z=z, next=following, kept_t=0 * t, kept_r=0 * t, last=rng.uniform(-1, 0.9, COUNT), flags=0 * t)
    if ahead:
        free = free.after(behind=np.abs(following) * rng.uniform(0.9, 1.5, COUNT))
    after = (AFTER + SKIPPED).replace("KNOWN", (KNOWN + (THERE if doubts else "")) if ahead else "")
    after = after.replace("LEAST", "least_leap(last.t)" if doubts else "0.0")
    variants = frozenset(("SKIPS", *["CUTS"] * doubts, *["ADVANCE"] * ahead))
    shader = text_of("bracketing", after=after.replace("BEHIND", "c.z" if ahead else "abs(c.y)"), variants=variants)
    (found,) = run_all(egl, shader, [("skipped({0}, {1}, {2})", 4)], inputs(free), UNIFORMS)
    close, skips, taken, same = (found == 1).T
    asked = ~close & skips
    assert 0.1 < asked.mean() < 0.9 and (~close & taken).mean() > 0.02
    assert not taken[asked].any() and same[asked].all()
    assert (~close & ~skips & ~taken).mean() < 0.1, "most turns that only search skip the rest"
