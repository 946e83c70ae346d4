"""The last steps towards a surface, on fields along a ray that are known, against float64."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from raymarch.expr.types import FLOAT, VEC4
from raymarch.glsl import VARIANTS
from raymarch.gpu.context import Context
from tests.functions.profiles import CONTACT, NEAR, PIXEL, Profiles, contact, deepest, last_steps, text_of
from tests.support.glsl_harness import run

AFTER = """
vec4 settled(vec4 a, vec4 b, vec4 c, vec4 d, float slope, float part) {
    given(a, b, c, d);
    Ray ray = Ray(vec3(0.0), vec3(0.0, 0.0, 1.0));
    Hit hit = no_hit(0.0);
    float t = 1.0;
    float r = march_distance(ray, t);
    asked = 0.0;
    furthest = 0.0;
    March at = BEGIN;
    march(ray, at, hit, 3.0);
    return part == 0.0 ? vec4(hit.t, hit.residual, hit.found, asked) : vec4(furthest, twice, hit.done, hit.evaluations);
}
"""
REFINING = "March(t, r, t, r, -1.0, slope, true, false)"
INSIDE = "March(t, r, t - 1.1 * r / slope, -0.1 * r, -1.0, slope, true, false)"
SEARCHING = "March(t, 0.0, 0.0, 0.0, slope, 0.0, false, false)"
MANY = 3000


def _settled(
    egl: Context,
    kind: str,
    of: Profiles,
    slope: NDArray[np.float64],
    start: str = REFINING,
    variants: frozenset[str] = frozenset(),
) -> NDArray[np.float64]:
    """Distance, residual, found, evaluations, furthest, twice at a place, done, counted evaluations: (8, N)."""
    inputs = [*((VEC4, given) for given in of.halves()), (FLOAT, slope)]
    uniforms = {"u_pixel": PIXEL, "u_side": 1.0, "u_start": (0.0, 0.0, 0.0, 0.0), "march_steps": 512}
    call = "settled({{0}}, {{1}}, {{2}}, {{3}}, {{4}}, {}.0)"
    text = text_of("plain", kind, AFTER.replace("BEGIN", start), variants=variants)
    found = [run(egl, text, call.format(part), inputs, 4, uniforms) for part in (0, 1)]
    return np.hstack(found).T.astype(float)


def _around(first: NDArray[np.float64], lengths: NDArray[np.float64], slopes: NDArray[np.float64]) -> Profiles:
    """Fields whose third knot is at distance 1, where the value is `first`; parts before it have the first slope."""
    before = np.full((len(first), 2), 0.5)
    lengths = np.hstack([before, lengths])
    slopes = np.hstack([np.repeat(slopes[:, :1], 2, axis=1), slopes])
    return Profiles.of(lengths, slopes, first - slopes[:, 0])


def _random(rng: np.random.Generator) -> tuple[Profiles, NDArray[np.float64]]:
    """Kinks from a hundredth of a pixel on, from outside and inside, with slopes that may mislead."""
    first = NEAR * rng.uniform(-1, 1, MANY)
    slopes = rng.uniform(-1, 0.3, (MANY, 5))
    slopes[rng.random((MANY, 5)) < 0.2] = -1
    of = _around(first, PIXEL * 10 ** rng.uniform(-2, 1, (MANY, 5)), slopes)
    told = np.where(rng.random(MANY) < 0.7, slopes[:, 0], rng.uniform(-1, 1, MANY))
    told[:100] = 0
    return of, told


@pytest.mark.parametrize("camera", ["perspective", "ORTHOGRAPHIC"])
def test_what_is_settled_is_met_and_nothing_gets_worse(egl: Context, camera: str) -> None:
    """Orthographic widths are those of distance 1 everywhere."""
    variants, alike = frozenset({camera}) & VARIANTS, camera == "ORTHOGRAPHIC"
    of, told = _random(np.random.default_rng(1))
    t, residual, found, asked, _, _, done, evaluations = _settled(egl, "refine", of, told, variants=variants)
    hit, wide = (found == 1) & (done == 1), np.ones(MANY) if alike else t
    assert np.all(residual[hit] <= contact(wide)[hit])
    assert np.all(np.abs(of.at(t))[hit] <= deepest(wide)[hit])
    assert np.all(asked == evaluations)
    outside = of.at(np.ones(MANY)) > 0
    assert np.mean(done[outside]) > 0.99
    assert np.all(t[outside] >= 1 - 0.5 * NEAR)
    assert np.mean(found) > 0.6


@pytest.mark.parametrize("told", [-1.0, -0.3, -0.05, -1e-3, -1e-30, 0.0, 0.5, 1.0])
def test_a_slope_that_misleads_does_not_hide_a_wall(egl: Context, told: float) -> None:
    """A wall met head on is right ahead by the distance itself: a plain step meets it, whatever the slope said."""
    first = NEAR * np.linspace(0.1, 1, 200)
    depth = PIXEL * np.linspace(0.2, 4, 200)
    lengths = np.tile(np.array([1.0, 1, 1, 1, 1]), (200, 1))
    lengths[:, 0] = depth
    of = _around(first, lengths, np.tile(np.array([-1.0, -0.1, 0, 0, 0]), (200, 1)))
    t, _, found, asked, furthest, *_ = _settled(egl, "refine", of, np.full(200, told))
    assert np.all(found == 1)
    np.testing.assert_allclose(t, 1 + first, atol=CONTACT + 4e-7)
    assert np.all(asked <= 8)
    assert np.all(
        furthest <= 1 + 0.0875 * PIXEL + 2 * first + 1e-6
    )  # from sphere to sphere, but for a tenth of a pixel


def test_a_post_on_a_wall_is_not_leapt_through(egl: Context) -> None:
    """The slope of the wall leads to its far end; a post that stands on the way is wider than what a step leaves
    unproven, however near the ray is to the wall."""
    slope = -(10 ** np.linspace(-4, -2.3, 200))
    wide = PIXEL * np.linspace(0.12, 6, 200)
    lengths = np.column_stack([np.full(200, 1.2 * PIXEL), wide / 2, wide / 2, np.full((200, 2), 1.0)])
    ones = np.ones(200)
    slopes = np.column_stack([slope, -ones, ones, slope, slope])
    of = _around(np.full(200, 0.9 * NEAR), lengths, slopes)
    t, _, found, *_ = _settled(egl, "refine", of, slope)
    assert np.all(of.least(t)[found == 1] >= -CONTACT - 4e-7)


def test_on_a_plane_the_steps_are_known(egl: Context) -> None:
    """One if its slope is steep, and as many as leave no more unproven than they may; from inside one."""
    slope = -np.linspace(0.15, 1, 100)
    for first, start in ((0.9 * NEAR, REFINING), (-0.9 * NEAR, INSIDE)):
        of = _around(np.full(100, first), np.ones((100, 5)), np.repeat(slope[:, None], 5, axis=1))
        t, residual, found, asked, *_ = _settled(egl, "refine", of, slope, start)
        assert np.all(found == 1)
        assert np.all(asked <= (last_steps(-slope) if first > 0 else 1)) and np.all(asked[-slope > 0.6] == 1)
        np.testing.assert_allclose(t, 1 - first / slope, rtol=0, atol=4e-6)
        assert np.all(residual <= CONTACT)


@pytest.mark.parametrize("camera", ["perspective", "ORTHOGRAPHIC"])
@pytest.mark.parametrize("kind", ["refine_slope", "refine_none"])
def test_what_is_not_proven_ends_at_once(egl: Context, kind: str, camera: str) -> None:
    """One step along the slope, no longer than the way so far, and none where the ray does not fall; or no step."""
    of, told = _random(np.random.default_rng(2))
    told[:5] = (-1e-30, -1e-12, -1e-9, 0.0, 1.0)
    t, residual, found, asked, _, _, done, _ = _settled(egl, kind, of, told, SEARCHING, frozenset({camera}) & VARIANTS)
    first = of.at(np.ones(MANY))
    assert np.all(asked == 1) and np.all(found == 1) and np.all(done == 1)
    np.testing.assert_allclose(residual, np.abs(first), atol=4e-7)
    falls = (told < 0) & (kind == "refine_slope")
    steps = np.where(falls, first / np.where(falls, -told, 1), 0)
    np.testing.assert_allclose(t, 1 + np.minimum(steps, 1), rtol=1e-3, atol=1e-5)
