"""Tracers on fields along a ray whose surfaces are known, against float64.

What holds them: a sphere proves what lies in it free, so that no surface is passed; a ray looks for its surface within
a tenth of a pixel and has met it within a sixteenth of that; no value is asked for again and again.
"""

from __future__ import annotations

import numpy as np
import pytest

from raymarch.gpu.context import Context
from tests.functions.fields import FAR, MANY, assert_true, everything
from tests.functions.profiles import (
    CONTACT,
    NEAR,
    PIXEL,
    ROUNDING,
    TRACED,
    TRACERS,
    Profiles,
    contact,
    last_steps,
    march,
    plane,
    text_of,
)

LONG = ("enhanced", "auto_relaxed", "bracketing")
"""The tracers whose steps go to where the spheres touch."""


@pytest.mark.parametrize("tracer", TRACERS)
def test_a_tracer_meets_the_first_surface(egl: Context, tracer: str) -> None:
    of = everything()
    got = march(egl, text_of(tracer), of, far=FAR)
    assert_true(of, got, FAR, 512)


@pytest.mark.parametrize("tracer", TRACERS)
def test_on_a_plane_the_evaluations_are_known(egl: Context, tracer: str) -> None:
    """A plain step leaves 1 - s of the distance to a plane of slope -s, one that touches (1 - s) / (1 + s). From a
    tenth of a pixel on the slope leads onto the plane, in steps that leave less than a tenth of a pixel unproven. Long
    steps begin with plain ones, to learn the slope."""
    slope = np.linspace(0.02, 0.98, 400)
    of = plane(-slope, np.tile([1e-2, 0.1, 0.3, 1], 100))
    got = march(egl, text_of(tracer), of, far=60.0)
    assert_true(of, got, 60.0, 512)
    assert np.all(got.found & got.done)
    shares, last = np.log(NEAR * of.root() / of.values[:, 0]), last_steps(slope)
    plain = 1 + np.ceil(shares / np.log1p(-slope))
    touching = 1 + np.ceil(shares / (np.log1p(-slope) - np.log1p(slope)))
    if tracer == "varied":
        plain = 1 + np.ceil(shares / np.log1p(-0.5 * slope))
    if tracer in ("plain", "varied"):
        assert np.all(np.abs(got.evaluations - plain - last) <= np.maximum(3, 1 + NEAR / PIXEL / slope))
        assert np.mean(got.evaluations - plain - last) < 1
    elif tracer == "relaxed":
        assert np.all(got.evaluations <= plain + last + 3)
    if tracer in LONG:
        assert np.all(got.evaluations <= plain + last + 2)
        assert np.mean(got.evaluations - touching - last) < 5
    if tracer == "auto_relaxed":  # the last long step leads onto the plane itself, where that is steep enough to tell
        assert np.all((got.evaluations <= touching + last + 2)[slope > 0.3])
    assert np.all(got.fallbacks <= {"plain": 0, "varied": 0, "enhanced": 0, "relaxed": 1}.get(tracer, 30))


@pytest.mark.parametrize("tracer", TRACERS)
def test_a_ray_that_recedes_ends_soon(egl: Context, tracer: str) -> None:
    """No long step may be taken for one that was too long, and none leads far beyond the end."""
    slope = np.linspace(0.05, 1, 400)
    of = plane(slope, np.tile([1e-2, 0.1, 0.3, 1], 100))
    got = march(egl, text_of(tracer), of, far=FAR)
    assert_true(of, got, FAR, 512)
    assert np.all(got.done & ~got.found)
    part = 0.5 if tracer == "varied" else 1.0
    plain = 1 + np.ceil(np.log1p(slope * FAR / of.values[:, 0]) / np.log1p(part * slope))
    assert np.all(got.evaluations <= plain + (tracer == "bracketing"))
    if tracer in ("relaxed", "relaxed_again"):
        assert np.all(got.evaluations <= 2 + np.ceil(np.log1p(slope * FAR / of.values[:, 0]) / np.log1p(1.6 * slope)))
    if tracer in LONG:
        assert got.evaluations[slope > 0.9].max() <= (7 if tracer == "enhanced" else 9)
    late = march(egl, text_of(tracer), of, begin=FAR - 1e-3, far=FAR)
    assert np.all(late.asked == 1) and np.all(late.done & ~late.found)


@pytest.mark.parametrize("tracer", TRACERS)
def test_a_ray_that_runs_out_of_steps_ends_at_its_last_sample(egl: Context, tracer: str) -> None:
    """It shows the surface that it is near, and never the sky."""
    of = everything()[: 2 * MANY]
    got = march(egl, text_of(tracer), of, far=FAR, steps=3)
    assert_true(of, got, FAR, 3)
    out = ~got.done
    assert np.mean(out) > 0.5
    assert np.all(got.found[out])
    alone = out & (got.residual > 2 * NEAR * FAR)
    assert np.all(got.evaluations[alone] == 3)
    if tracer == "plain":
        t = np.zeros(len(of))
        for _ in range(2):
            t = t + of.at(t)
        np.testing.assert_allclose(got.t[alone], t[alone], rtol=1e-5)


@pytest.mark.parametrize("tracer", TRACERS)
def test_a_ray_beside_a_wall_looks_for_it_once(egl: Context, tracer: str) -> None:
    """It runs along it where it looks for a surface, and never comes to where it meets one."""
    rng = np.random.default_rng(3)
    lengths, slopes = np.full((MANY, 7), 0.005), np.zeros((MANY, 7))
    height = 0.9 * NEAR * rng.uniform(0.4, 1, MANY)
    lengths[:, 0], slopes[:, 0] = 1 - height, -1
    lengths[:, 2], slopes[:, 2:] = 9 * height, 1
    of = Profiles.of(lengths, slopes, np.ones(MANY))
    got = march(egl, text_of(tracer), of, far=FAR)
    assert_true(of, got, FAR, 512)
    assert np.all(got.done & ~got.found)
    never = text_of(tracer).replace(f"epsilon_pixels = {NEAR / PIXEL:g}", f"epsilon_pixels = {CONTACT / PIXEL:g}")
    never = never.replace("contact_share = 0.0625", "contact_share = 1.0")
    without = march(egl, never, of, far=FAR)
    assert np.all(without.done & ~without.found)
    assert np.mean(got.evaluations - without.evaluations) <= 6
    assert np.all(got.evaluations - without.evaluations <= 9)


@pytest.mark.parametrize("tracer", TRACERS)
def test_from_inside_the_inner_wall_is_met(egl: Context, tracer: str) -> None:
    of = everything()[:MANY]
    outside = march(egl, text_of(tracer), of, far=FAR)
    inside = march(egl, text_of(tracer), Profiles(of.places, -of.values), far=FAR, side=-1)
    for name in ("t", "residual", "iterations", "evaluations", "done", "found", "fallbacks"):
        np.testing.assert_array_equal(getattr(inside, name), getattr(outside, name))


@pytest.mark.parametrize(("scale", "camera"), [(1.0, ""), (0.7, ""), (1.0, "ORTHOGRAPHIC")])
def test_plain_steps_on_an_estimate_are_never_taken_back(egl: Context, scale: float, camera: str) -> None:
    """An estimate may fall by more than the distance: a step may end inside, from where its surface is looked for."""
    rng = np.random.default_rng(4)
    slope = rng.uniform(0.5, 1.4, MANY)
    of = plane(-slope, rng.uniform(0.1, 3, MANY))
    got = march(egl, text_of("plain", scale=scale, variants=frozenset({camera})), of, far=FAR)
    assert np.all(got.done & got.found) and np.all(got.fallbacks == 0)
    width = contact(got.t) if not camera else CONTACT + 8 * ROUNDING * (1 + got.t)
    assert np.all(np.abs(of.at(got.t)) <= width) and np.all(got.residual >= 0)


@pytest.mark.parametrize("tracer", ["plain", "bracketing"])
def test_the_widths_of_an_orthographic_ray_do_not_grow(egl: Context, tracer: str) -> None:
    """A plane is looked for within a tenth of a pixel at each distance, and met within a sixteenth of that."""
    slope = np.tile(np.linspace(0.2, 0.98, 100), 4)
    of = plane(-slope, np.repeat([1e-2, 0.3, 3, 30], 100))
    text = text_of(tracer, variants=frozenset({"ORTHOGRAPHIC"}))
    got = march(egl, text, of, far=400.0)
    assert np.all(got.found & got.done)
    rounding = 8 * ROUNDING * (1 + of.root())
    assert np.all(np.abs(of.at(got.t)) <= CONTACT + rounding)
    assert np.all(got.residual <= CONTACT + rounding)
    if tracer == "plain":
        plain = 1 + np.ceil(np.log(NEAR / of.values[:, 0]) / np.log1p(-slope))
        assert np.all(np.abs(got.evaluations - plain - last_steps(slope)) <= 3)
        out = march(egl, text, of, far=400.0, steps=4)
        assert 0.02 < np.mean(out.done) < 0.9 and np.all(out.found)


PASSES = """
vec4 traced(vec4 a, vec4 b, vec4 c, vec4 d, vec4 e) {
    given(a, b, c, d);
    Ray ray = Ray(vec3(0.0), vec3(0.0, 0.0, 1.0));
    March at = start_march(ray, e.x);
    Hit hit = no_hit(e.x);
    hit.done = false;
    for (int k = 0; k < 100 && !hit.done; k++) march(ray, at, hit, e.y);
    if (e.z == 0.0) return vec4(hit.t, hit.residual, hit.iterations, hit.evaluations);
    if (e.z == 1.0) return vec4(hit.done, hit.found, hit.fallbacks, asked);
    return vec4(furthest, twice, wasted, known);
}
"""


@pytest.mark.parametrize("tracer", TRACERS)
@pytest.mark.parametrize("steps", [1, 6])
def test_a_march_in_pieces_is_the_whole_march(egl: Context, tracer: str, steps: int) -> None:
    """Its state holds all that it needs: the same points are asked, and the same bits come out."""
    of = everything()[: 6 * MANY]
    whole = march(egl, text_of(tracer), of, far=FAR, steps=100 * steps)
    parts = march(egl, text_of(tracer, after=PASSES), of, far=FAR, steps=steps)
    assert np.mean(parts.done) > 0.7
    for name in ("t", "residual", "iterations", "evaluations", "done", "found", "fallbacks", "asked", "furthest"):
        np.testing.assert_array_equal(getattr(parts, name), getattr(whole, name), name)


def test_an_empty_range_is_not_looked_at(egl: Context) -> None:
    of, text = everything()[:MANY], text_of("plain", after=TRACED)
    got = march(egl, text, of, begin=3.0, far=2.0)
    assert np.all(got.asked == 0) and np.all(got.evaluations == 0) and np.all(got.done & ~got.found)
    other = march(egl, text, of, far=FAR)
    np.testing.assert_array_equal(other.t, march(egl, text_of("plain"), of, far=FAR).t)


@pytest.mark.parametrize("tracer", ["plain", "bracketing"])
def test_the_known_sphere_at_the_camera_saves_an_evaluation(egl: Context, tracer: str) -> None:
    """A gradient that is wrong may cost steps, but no surface."""
    of = everything()[:MANY]
    of = Profiles(of.places, np.maximum(of.values, 0.1 * of.values[:, :1]))
    of = Profiles(of.places * (1 / of.values[:, :1]), of.values / of.values[:, :1])  # 1 at the camera
    without = march(egl, text_of(tracer), of, far=FAR)
    for gradient in (-1.0, 0.3, 1.0):
        got = march(egl, text_of(tracer), of, far=FAR, start=(0.0, 0.0, gradient, 1.0))
        np.testing.assert_array_equal(got.found, without.found)
        np.testing.assert_allclose(got.t[got.found], without.t[got.found], atol=2 * NEAR * FAR)
        if tracer == "plain":
            np.testing.assert_array_equal(got.evaluations, without.evaluations - 1)
    beyond = march(egl, text_of(tracer), of, begin=2.0, far=FAR, start=(0.0, 0.0, -1.0, 1.0))
    np.testing.assert_array_equal(beyond.t, march(egl, text_of(tracer), of, begin=2.0, far=FAR).t)


def test_on_a_plane_the_last_step_leaves_rounding(egl: Context) -> None:
    slope = np.linspace(0.1, 0.98, 400)
    of = plane(-slope, np.tile([1e-2, 0.1, 0.3, 1], 100))
    got = march(egl, text_of("bracketing"), of, far=60.0)
    assert np.all(got.found)
    np.testing.assert_allclose(got.t, of.root(), rtol=2e-6 / slope.min(), atol=1e-6)
