"""A fractal of one's own: known ones are rebuilt from the folds, and what is not a fold is refused."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.expr.vocabulary import abs as absolute
from raymarch.expr.vocabulary import vec3, where
from raymarch.sdf import ball_fold, box_fold, fold_fractal, plane_fold
from tests.support.refusals import refused

POINTS = np.random.default_rng(10).uniform(-1.4, 1.4, (4000, 3))


def mandelbox(z: Any, growth: Any, p: Any) -> Any:
    z, growth = ball_fold(box_fold(z), growth)
    return 2.0 * z + p, 2.0 * growth + 1.0


def sierpinski(z: Any, growth: Any, p: Any) -> Any:
    for normal in ((1, 1, 0), (1, 0, 1), (0, 1, 1)):
        z = plane_fold(z, normal)
    return 2.0 * z - 1.0, 2.0 * growth


def menger(z: Any, growth: Any, p: Any) -> Any:
    """Twenty of twenty-seven cubes: sort the coordinates, then step out, but along the smallest only from a corner."""
    z = absolute(z)
    for normal in ((1, -1, 0), (1, 0, -1), (0, 1, -1)):
        z = plane_fold(z, normal)
    z = 3.0 * z - vec3(2.0, 2.0, 0.0)
    return vec3(z.x, z.y, where(z.z > 1.0, z.z - 2.0, z.z)), 3.0 * growth


def test_the_mandelbox_is_made_of_folds() -> None:
    points = 4.0 * POINTS
    known = rm.mandelbox(2.0, 8).distance(points)
    np.testing.assert_allclose(fold_fractal(mandelbox, None, 6.0, 8, 10.0).distance(points), known, rtol=1e-12)


def test_the_sponge_is_made_of_cubes() -> None:
    made = fold_fractal(menger, rm.box(2.0), 1.0, 3)
    known = rm.menger(2.0, 3).distance(POINTS)
    clear = np.abs(known) > 1e-6
    np.testing.assert_array_equal(made.distance(POINTS)[clear] < 0, known[clear] < 0)
    assert made.exactness == "estimate" and made.lipschitz == np.inf
    np.testing.assert_array_equal(made.bounds, ([-1, -1, -1], [1, 1, 1]))


def test_the_pyramid_is_made_of_tetrahedra() -> None:
    made, known = fold_fractal(sierpinski, rm.sierpinski(2.0, 1), 1.0, 3), rm.sierpinski(2.0, 4).distance(POINTS)
    clear = np.abs(known) > 1e-6
    np.testing.assert_array_equal(made.distance(POINTS)[clear] < 0, known[clear] < 0)


def test_a_fold_may_read_parameters() -> None:
    turn = rm.Param("turn", 0.3, 0.0, 1.0)
    node = fold_fractal(lambda z, g, p: (2.0 * absolute(z) - turn, 2.0 * g), rm.sphere(1.0), 2.0, 4)
    assert "turn" in rm.Scene(node).parameters
    assert np.all(np.isfinite(node.distance(POINTS)))


def test_outside_of_its_bounds_there_is_nothing() -> None:
    node = fold_fractal(lambda z, g, p: (z, g), rm.sphere(2.0), ((-1, 0, -1), (1, 1, 1)), 1)
    assert node.distance([0, -0.5, 0]) == pytest.approx(0.5)
    assert node.distance([0, 0.5, 0]) == pytest.approx(-0.5)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: fold_fractal(3), "a function"),
        (lambda: fold_fractal(lambda z, g, p: z).glsl(), "(z, growth)"),
        (lambda: fold_fractal(lambda z, g, p: (g, z)).glsl(), "a vec3 and a float"),
        (lambda: fold_fractal(mandelbox, bounds=-1.0), "a number > 0"),
        (lambda: fold_fractal(mandelbox, bounds=(1, 2)), "two corners"),
        (lambda: fold_fractal(mandelbox, iterations=0), ">= 1"),
        (lambda: fold_fractal(mandelbox, bailout=0.0), "> 0"),
        (lambda: fold_fractal(mandelbox, rm.circle()), "3D"),
    ],
)
def test_what_cannot_be_is_refused(make: Any, says: str) -> None:
    refused(make, says)
