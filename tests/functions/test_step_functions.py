"""How long a tracer's next step is, and what it remembers of those before."""

from __future__ import annotations

import numpy as np
import pytest

from raymarch.expr.types import FLOAT
from raymarch.gpu.context import Context
from tests.functions.fields import FAR, MANY, assert_true, everything, random
from tests.functions.profiles import Profiles, march, plane, text_of
from tests.support.glsl_harness import modules, run


def test_relaxed_steps_end_for_good_or_for_one_step(egl: Context) -> None:
    """Keinert goes on with plain steps after the first that was too long; Balint and Valasek relax again."""
    of = everything()[: 4 * MANY]
    once, again = (march(egl, text_of(tracer), of, far=FAR) for tracer in ("relaxed", "relaxed_again"))
    plain = march(egl, text_of("plain"), of, far=FAR)
    assert once.fallbacks.max() == 1 and again.fallbacks.max() > 1
    free = once.fallbacks == 0
    assert np.all((again.evaluations == once.evaluations)[free])
    assert np.mean(once.evaluations[free]) < 0.95 * np.mean(plain.evaluations[free])


def test_the_front_asks_hardly_anything_twice(egl: Context) -> None:
    """Nothing up to the front, and next to nothing of what the kept sphere has proven: so that it takes less than the
    tracer that forgets where a step led that was too long. On a wall of slope -1 the sphere inside the wall touches the
    front, and rounding decides whether the step is undone: such a ray may ask for the front again, twice at most."""
    of = random(np.random.default_rng(6), 8 * MANY)
    front, forgets = (march(egl, text_of(tracer, "refine_none"), of, far=FAR) for tracer in ("bracketing", "enhanced"))
    assert np.all(front.wasted <= 2) and np.all(front.done | (front.twice == 0))
    assert np.sum(front.known) < 0.007 * np.sum(front.evaluations)
    assert np.mean(front.evaluations) < np.mean(forgets.evaluations)
    steep = march(egl, text_of("bracketing", "refine_none"), of, far=FAR, slope=1.02)
    assert np.all(steep.wasted <= 2)


def test_a_wall_met_head_on_ends_the_gap_before_it(egl: Context) -> None:
    """Where the sphere inside the wall touches the front but for rounding, no number lies between: it must not be asked
    for again and again until the steps run out."""
    rng = np.random.default_rng(8)
    count = 8 * MANY
    slopes = np.full((count, 7), -1.0)
    slopes[:, 0] = rng.uniform(0, 1, count)
    of = Profiles.of(rng.uniform(0.1, 2, (count, 7)), slopes, 10 ** rng.uniform(-2, 0, count))
    got = march(egl, text_of("bracketing"), of, far=FAR)
    assert_true(of, got, FAR, 512)
    assert np.all(got.done & got.found)
    assert got.evaluations.max() < 100


@pytest.mark.parametrize("tracer", ["enhanced", "auto_relaxed", "bracketing"])
def test_a_slope_of_cones_is_forgotten(egl: Context, tracer: str) -> None:
    """It may be above 1, by the width of the cone; a ray that recedes still ends soon."""
    slope = np.linspace(0.9, 1, 400)
    of = plane(slope, np.tile([1e-3, 1e-2, 0.1, 0.3], 100))
    got = march(egl, text_of(tracer), of, far=200.0, slope=1.02)
    assert_true(of, got, 200.0, 512)
    assert got.evaluations.max() <= 12


@pytest.mark.parametrize("tracer", ["relaxed", "enhanced", "auto_relaxed"])
def test_a_step_is_never_shorter_than_the_distance(egl: Context, tracer: str) -> None:
    """Whatever the slope: cones hand on slopes above 1. From inside the ray steps back by no more than it is deep."""
    slope, r = (a.ravel() for a in np.meshgrid([-1, -0.5, 0, 0.5, 0.999, 1.0, 1.02, 1.5], [1e-4, 0.1, 3.0]))
    inputs = [(FLOAT, r), (FLOAT, slope)]
    found = run(egl, text_of(tracer), "step_length(March(5.0, {0}, 0.0, 0.0, {1}, {1}, false, false), 20.0)", inputs)
    assert np.all(found >= r.astype(np.float32)) and np.all(found <= np.float32(15 + r))
    if tracer == "enhanced":  # where the ray recedes the plane is never met
        assert np.all(found[(slope >= 1) & (r > 1e-3)] >= 15)
    inputs = [(FLOAT, -r), (FLOAT, np.minimum(slope, 0.999))]
    back = run(egl, text_of(tracer), "step_length(March(5.0, {0}, 0.0, 0.0, {1}, {1}, false, true), 20.0)", inputs)
    assert np.all(back >= -1.6 * r.astype(np.float32) - 1e-6) and np.all(back < 0)


@pytest.mark.parametrize("tracer", ["enhanced", "auto_relaxed"])
def test_a_slope_that_no_distance_has_is_not_believed(egl: Context, tracer: str) -> None:
    """Rounding and estimates have slopes beyond 1; steps would turn round."""
    before, slope = (a.ravel() for a in np.meshgrid([-1, 0, 0.9, 1.0], [-7.0, -1.0, 0.5, 1.0, 1.1, 7.0, 1e6]))
    found = run(egl, text_of(tracer), "averaged_derivative({0}, {1})", [(FLOAT, before), (FLOAT, slope)])
    assert np.all(np.abs(found) <= 1)
    assert tracer == "enhanced" or np.all(found <= np.float32(0.999))


@pytest.mark.parametrize(("variants", "pixel"), [({"ESTIMATE"}, 0.05), ({"ESTIMATE", "ORTHOGRAPHIC"}, 0.01)])
def test_a_step_of_an_estimate_is_at_most_a_pixel_longer(egl: Context, variants: set[str], pixel: float) -> None:
    """Spheres of an estimate prove nothing, so a longer step must not pass what is larger than a pixel."""
    slope, r = (a.ravel() for a in np.meshgrid([-1, -0.5, 0, 0.5, 0.999], [1e-4, 0.1, 3.0]))
    factor = "" if "ORTHOGRAPHIC" in variants else " * t"
    before = f"const float smoothing = 0.3;\nfloat pixel_at(float t) {{ return 0.01{factor}; }}"
    names = ("march/hit", "march/bracketing")
    text = modules(*names, before=before, variants=frozenset(variants))
    call = "step_length(March(5.0, {0}, 0.0, 0.0, {1}, {1}, false, false), 20.0)"
    found = run(egl, text, call, [(FLOAT, r), (FLOAT, slope)])
    free = np.minimum(2 * r / (1 - slope), 15 + r)
    assert np.allclose(found, np.minimum(free, r + pixel), rtol=1e-5)
    assert np.any(free > r + pixel) and np.any(free < r + pixel)
