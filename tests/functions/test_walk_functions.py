"""Walks of light in a ball of a medium that scatters, as a single function: what leaves it, and with what weight."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from raymarch.expr.types import FLOAT, VEC3
from raymarch.gpu.context import Context
from tests.support.glsl_harness import modules, run_all

COUNT = 3000
BEFORE = """
struct Ray { vec3 origin; vec3 direction; };
const float epsilon_pixels = 0.1;
const float contact_share = 0.0625;
uint seed;
float asked = 0.0;
float random_of_pixel(int i) {
    uint x = (seed * 2654435761u + uint(i)) * 2246822519u;
    x = (x ^ (x >> 15)) * 3266489917u;
    x = (x ^ (x >> 13)) * 668265263u;
    return float((x ^ (x >> 16)) >> 8) / 16777216.0;
}
float field(vec3 p) {
    asked += 1.0;
    return length(p) - 1.0;
}
"""
EXIT = """
Hit trace_secondary(Ray ray, float start, float travelled, float side) {
    float along = dot(ray.origin, ray.direction);
    Hit hit = no_hit(0.0);
    hit.found = true;
    hit.t = sqrt(along * along + 1.0 - dot(ray.origin, ray.origin)) - along;
    return hit;
}
"""
AFTER = """
Ray ray;
Hit hit;
vec4 walked(float number, vec3 albedo, vec3 radius, vec3 weight, bool rest) {
    seed = uint(number);
    asked = 0.0;
    Walk walk = Walk(vec3(0.25, 0.5, 0.75), albedo, radius, weight);
    bool leaves = walk_below(walk, vec3(0.0, 0.0, 1.0), vec3(0.0, 0.0, 1.0), 1.0, 16, ray, hit);
    return rest ? vec4(float(leaves), asked, 0.0, 0.0) : vec4(walk.weight, 0.0);
}
"""


def walked(
    egl: Context, albedo: ArrayLike, radius: ArrayLike, weight: ArrayLike = (1.0, 1.0, 1.0)
) -> tuple[NDArray[np.float64], NDArray[np.bool_], NDArray[np.float64]]:
    """The weights, whether the walk leaves, and how often the field is asked, of 3,000 walks."""
    names = ("march/widths", "march/nearness", "march/epsilon", "march/hit", "light/spawn_ray")
    text = modules(*names, before=BEFORE) + EXIT + modules("path/subsurface", after=AFTER)
    inputs = [(FLOAT, np.arange(COUNT))]
    inputs += [(VEC3, np.broadcast_to(np.asarray(v, float), (COUNT, 3))) for v in (albedo, radius, weight)]
    calls = [(f"walked({{0}}, {{1}}, {{2}}, {{3}}, {rest})", 4) for rest in ("false", "true")]
    weights, rest = run_all(egl, text, calls, inputs, {"u_pixel": 1e-4, "u_side": 1.0})
    return weights[:, :3].astype(float), rest[:, 0] == 1, rest[:, 1].astype(float)


@pytest.mark.parametrize("radius", [0.3, 0.05, 0.01])
def test_all_light_leaves_a_white_medium(egl: Context, radius: float) -> None:
    """As much as came, in each single walk, whether it scatters or leaps; but for those of more than 128 turns."""
    weights, leaves, asked = walked(egl, (1, 1, 1), (radius,) * 3)
    assert np.mean(leaves) > 0.9 and asked.max() <= 128
    np.testing.assert_allclose(weights[leaves], 1.0, rtol=1e-3)


PRICES = dict(
    zip(
        itertools.permutations((0.3, 0.05, 0.01)), (14.458, 14.825333, 14.416333, 14.416667, 14.77, 14.686), strict=True
    )
)
"""Mean turns of a walk, of colours with these mean free paths."""


@pytest.mark.parametrize("radius", PRICES, ids=str)
def test_colours_walk_together_and_none_gets_more_light_than_came(egl: Context, radius: tuple[float, ...]) -> None:
    """In the mean: a walk is of one colour, and weighs more for the others. A colour leaps where all do, or where it
    is far beyond its own free path."""
    weights, leaves, asked = walked(egl, (1, 1, 1), radius)
    found = np.where(leaves[:, None], weights, 0.0)
    slack = 4 * found.std(axis=0) / np.sqrt(COUNT)
    assert np.all(found.mean(axis=0) <= 1 + slack) and np.all(found.mean(axis=0) >= 0.9 - slack)
    assert np.mean(asked) == pytest.approx(PRICES[radius], rel=1e-4)


@pytest.mark.parametrize("axis", range(3))
def test_light_leaves_where_it_came_if_no_colour_walks_far(egl: Context, axis: int) -> None:
    """All free paths are below the precision of hits, or else the longest one decides; one of 0 is a thousandth."""
    radius = np.zeros(3)
    weights, leaves, asked = walked(egl, (0.9, 0.9, 0.9), radius + 1e-7)
    np.testing.assert_allclose(weights, np.tile([0.25, 0.5, 0.75], (COUNT, 1)), rtol=1e-6)
    assert leaves.all() and not asked.any()
    radius[axis] = 0.05
    weights, leaves, asked = walked(egl, (0.9, 0.9, 0.9), radius)
    assert np.all(asked > 0) and np.all(np.isfinite(weights)) and np.mean(weights[leaves, axis]) > 0.3


def test_a_walk_without_light_stays_without(egl: Context) -> None:
    """No share of a colour is then defined."""
    weights, _, _ = walked(egl, (0.9, 0.9, 0.9), (0.1, 0.05, 0.02), (0, 0, 0))
    assert not weights.any() and np.all(np.isfinite(weights))
