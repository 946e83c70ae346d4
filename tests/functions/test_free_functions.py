"""Rays that know how far they are free, membranes, and the notes of samples, on fields that are known along a ray."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from raymarch.expr.types import FLOAT, VEC4
from raymarch.gpu.context import Context
from tests.functions.fields import FAR, MANY, everything
from tests.functions.profiles import NEAR, PIXEL, ROUNDING, Marched, Profiles, contact, deepest, march, text_of
from tests.support.glsl_harness import run

SEARCHES, REFINES, UNDONE, STARTS = range(4)


def sheets(depth: NDArray[np.float64], seed: int = 5) -> Profiles:
    """The field falls to minus a depth and rises again, at slopes of all sizes; behind that there is anything."""
    rng = np.random.default_rng(seed)
    count = len(depth)
    down, up = 10 ** rng.uniform(-1, 0, (2, count))
    there = rng.uniform(0.3, 3, count)
    lengths, slopes = 10 ** rng.uniform(-2, 0, (count, 7)), rng.uniform(-1, 1, (count, 7))
    lengths[:, 0], lengths[:, 1], lengths[:, 2] = (
        there * rng.uniform(0.1, 0.9, count),
        there,
        rng.uniform(0.01, 1, count),
    )
    before = np.where(rng.random(count) < 0.5, -1, 1) * np.abs(slopes[:, 0])
    low = down * there - depth <= before * lengths[:, 0] + 0.05
    slopes[:, 0] = np.where(low, -np.abs(before), before)
    slopes[:, 1], slopes[:, 2] = -down, up
    return Profiles.of(lengths, slopes, down * there - depth - slopes[:, 0] * lengths[:, 0])


def behind(of: Profiles) -> NDArray[np.float64]:
    """The first surface behind the membrane; infinite if none."""
    values = of.values.copy()
    values[:, 2] = np.maximum(values[:, 2], 1e-5)
    return Profiles(of.places, values).root()


AHEAD = [
    frozenset({"ADVANCE"}),
    frozenset({"ADVANCE", "CUTS"}),
    frozenset({"CUTS"}),
    frozenset({"CUTS", "ORTHOGRAPHIC"}),
]


def name_of(argument: str | frozenset[str]) -> str:
    """The name of an argument in a test's: the same in each process."""
    return argument if isinstance(argument, str) else " ".join(sorted(argument)) or "plain"


@pytest.mark.parametrize("variants", AHEAD, ids=name_of)
def test_what_is_known_ahead_and_doubts_lose_no_surface(egl: Context, variants: frozenset[str]) -> None:
    """Rays that know more than a sphere take far fewer samples than those of spheres, and meet the same."""
    of = everything()
    got = march(egl, text_of("bracketing", variants=variants), of, far=FAR)
    met, wide = got.found & got.done, got.t if "ORTHOGRAPHIC" not in variants else np.maximum(got.t, 1.0)
    assert np.all(np.abs(of.at(got.t))[met] <= deepest(wide)[met])
    assert "CUTS" not in variants or np.mean(np.abs(of.at(got.t))[met] / wide[met]) < 0.003 * NEAR
    assert np.all(of.least(got.t)[met] >= -deepest(wide)[met])
    limits = deepest(wide) if "CUTS" in variants else contact(wide)  # a sample in doubt aims below the surface
    assert np.all(got.residual[met] <= limits[met]) and np.all(got.residual >= 0)
    assert np.all(got.evaluations == got.asked) and np.all(got.evaluations == got.iterations)
    assert np.all(of.root_of_cut()[got.done & ~got.found] > FAR * (1 - 1e-6))
    assert np.mean(got.evaluations) < (7 if "ADVANCE" in variants else 16)
    assert np.sum(~got.done) <= 3


@pytest.mark.parametrize("variants", AHEAD[1:], ids=name_of)
def test_a_membrane_is_no_surface_and_a_sheet_is_one(egl: Context, variants: frozenset[str]) -> None:
    """A field that falls to 0 and rises again has no surface there; a solid thinner than a hit's width has one."""
    text = text_of("bracketing", variants=variants)
    of = sheets(np.zeros(2 * MANY))
    got, known = march(egl, text, of, far=FAR), behind(of)
    assert np.all(got.done) and np.all(got.found == (known < FAR))
    wide = 2e-3 if "ORTHOGRAPHIC" not in variants else 4e-3
    np.testing.assert_allclose(got.t[got.found], known[got.found], rtol=wide)
    depth = PIXEL * 10 ** np.random.default_rng(6).uniform(-1.5, 1, 2 * MANY)
    thin = sheets(depth, 7)
    got = march(egl, text, thin, far=FAR)
    assert np.all(got.done & got.found)
    met = np.abs(got.t - thin.root()) <= 0.02 * PIXEL * FAR
    assert np.mean(met) > 0.997
    assert np.mean(got.evaluations) < (8 if "ADVANCE" in variants else 24)


@pytest.mark.parametrize("camera", ["perspective", "ORTHOGRAPHIC"])
def test_steps_that_are_free_reach_the_surface_and_stop_there(egl: Context, camera: str) -> None:
    """Where every solid tells how far a ray is free; a ray that begins inside stays where it is."""
    variants = frozenset({"ADVANCE"} | ({camera} if camera == "ORTHOGRAPHIC" else set()))
    of = everything()
    text = text_of("free", variants=variants)
    got = march(egl, text, of, far=FAR)
    met = got.found & got.done
    assert np.all(of.root_of_cut()[got.done & ~got.found] > FAR * (1 - 1e-6))
    assert np.all(got.done | (got.iterations == 512))
    assert np.all(got.residual >= 0) and np.all(got.evaluations == got.asked)
    wide = np.maximum(got.t, 1.0) if camera == "ORTHOGRAPHIC" else got.t
    assert np.all(np.abs(of.at(got.t)[met]) <= contact(wide)[met] + 0.25 * NEAR * wide[met])
    assert np.all(got.residual[met] <= contact(wide)[met])
    begin = 2.0
    inside = Profiles(of.places, of.values - (of.at(np.full(len(of), begin)) + 0.01)[:, None].astype(np.float32))
    got = march(egl, text, inside, begin=begin, far=FAR)
    assert np.all(got.found) and np.all(got.evaluations == 1)
    np.testing.assert_allclose(got.residual, 0.01, rtol=1e-2)
    width = NEAR * 0.0625 * (begin if camera == "perspective" else 1.0) + 4 * ROUNDING * begin
    assert np.all((got.t >= begin) & (got.t <= begin + width))


NOTES = """
vec4 noted(vec4 a, vec4 b, vec4 c, vec4 d, float number) {
    given(a, b, c, d);
    kept_number = int(number);
    Ray ray = Ray(vec3(0.0), vec3(0.0, 0.0, 1.0));
    March at = start_march(ray, 0.0);
    Hit hit = no_hit(0.0);
    march(ray, at, hit, 20.0);
    return vec4(kept_sample.xyz, kept_sample.w + 8.0 * float(samples_taken));
}
"""


def notes(egl: Context, of: Profiles, tracer: str, variants: frozenset[str], most: int) -> NDArray[np.float64]:
    """The first samples of each ray: distance, how far it is free ahead and by the value alone, kind; and how many
    there are: (N, most, 5)."""
    text = text_of(tracer, after=NOTES, variants=variants | {"NOTED"})
    inputs = [(VEC4, np.repeat(half, most, axis=0)) for half in of.halves()]
    inputs += [(FLOAT, np.tile(np.arange(most), len(of)))]
    uniforms = {"u_pixel": PIXEL, "u_side": 1.0, "march_steps": 512, "u_start": (0.0, 0.0, 0.0, 0.0)}
    found = run(egl, text, "noted({0}, {1}, {2}, {3}, {4})", inputs, 4, uniforms).reshape(len(of), most, 4)
    count = np.floor(np.maximum(found[..., 3:], 0) / 8)
    return np.concatenate([found[..., :3], found[..., 3:] - 8 * count, count], axis=2).astype(float)


NOTED = [("bracketing", v) for v in (frozenset(), *AHEAD[:3])] + [("free", AHEAD[0])]


@pytest.mark.parametrize(("tracer", "variants"), NOTED, ids=name_of)
def test_notes_tell_what_became_of_each_sample(egl: Context, tracer: str, variants: frozenset[str]) -> None:
    """As many as the evaluations, with the field's values. Where no surface is near, those of steps that were undone
    are as many as the fallbacks; a sample that goes on refining is near a surface, and others are none of both."""
    of = everything()[: MANY // 2]
    got = march(egl, text_of(tracer, variants=variants), of, far=FAR)
    few = got.evaluations < 30
    of, got = of[few], Marched(**{name: value[few] for name, value in vars(got).items()})
    found = notes(egl, of, tracer, variants, 31)
    t, ahead, alone, kind, count = np.moveaxis(found, 2, 0)
    np.testing.assert_array_equal(count[:, 0], got.evaluations + 1)
    taken = np.arange(31) < count
    assert np.all(kind[:, 0] == STARTS) and np.all((kind[:, 1:] != STARTS) | ~taken[:, 1:])
    field = np.array([of.at(t[:, k]) for k in range(31)]).T
    level = ROUNDING * t if "ADVANCE" in variants else 0 * t
    samples = taken & (np.arange(31) > 0)
    np.testing.assert_allclose(np.abs(alone)[samples], np.abs(field - level)[samples], rtol=1e-4, atol=4e-6)
    assert np.all(ahead[samples] >= alone[samples] - 1e-6)
    near = field < 1.01 * (NEAR * t)
    refines, undone = (samples & (kind == k) for k in (REFINES, UNDONE))
    assert np.all(near[refines]) and (tracer == "free" or refines.sum() > 100)
    aside = ~np.any(near & samples, axis=1)
    np.testing.assert_array_equal(undone.sum(axis=1)[aside], got.fallbacks[aside])
    assert np.all(undone.sum(axis=1) >= got.fallbacks) and (tracer == "free") == (undone.sum() == 0)
    searches = samples & (kind == SEARCHES)
    later = searches[:, :-1] & samples[:, 1:]
    assert np.all(t[:, 1:][later] > t[:, :-1][later] - 1e-3)  # only a step that was undone leads back
