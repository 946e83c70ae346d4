"""Convex hulls of solids against the nearest means of points, by SciPy."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import nnls
from scipy.spatial import ConvexHull

import raymarch as rm
from raymarch.errors import SceneError

Array = NDArray[np.float64]

AT = np.random.default_rng(7).uniform(-2.2, 2.2, (60, 3))
LOW, HIGH = (0, -1, 0), (1, 1, 0.5)


def distance(*parts: tuple[Any, float]) -> Array:
    """From AT to the hull of parts, each of points and the radius of balls about them; the same for all."""
    points = np.concatenate([np.atleast_2d(np.asarray(c, float)) for c, _ in parts])
    heavy = 1e3  # the weights of a mean of the points sum to 1
    rows = np.vstack([points.T, np.full(len(points), heavy)])
    found = np.array([np.linalg.norm(points.T @ nnls(rows, np.append(p, heavy))[0] - p) for p in AT])
    if np.linalg.matrix_rank(points - points[0], tol=1e-9) == 3:
        faces = ConvexHull(points).equations
        heights = np.max(AT @ faces[:, :3].T + faces[:, 3], axis=1)
        found = np.where(heights < 0, heights, found)
    return found - parts[0][1]


def distance_to_balls(*balls: tuple[Any, float]) -> Array:
    """From AT to the hull of two balls: the least of those to balls between them."""
    (a, ra), (b, rb) = ((np.asarray(c, float), r) for c, r in balls)
    t = np.linspace(0, 1, 4001)[:, None, None]
    return np.min(np.linalg.norm(AT - (a + t * (b - a)), axis=2) - (ra + t[..., 0] * (rb - ra)), axis=0)


def corners(size: Any, at: Any = (0, 0, 0)) -> Array:
    signs = np.array([(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    return signs * np.asarray(size) + np.asarray(at)


def rim(centre: Any, axis: Any, radius: float) -> Array:
    """Points of the edge of a disc."""
    n = np.asarray(axis, float) / np.linalg.norm(axis)
    u = np.cross(n, np.eye(3)[np.argmin(np.abs(n))])
    u /= np.linalg.norm(u)
    a = np.linspace(0, 2 * np.pi, 241)[:, None]
    return np.asarray(centre) + radius * (np.cos(a) * u + np.sin(a) * np.cross(n, u))


BALLS = [(0.0, 0.0, 0.0), (1.5, 0.2, 0.0), (0.3, 1.4, 0.4), (-0.4, 0.3, -1.2), (0.2, 0.3, 0.1)]
BOX = rm.box((1, 2, 0.5)).rotate(0.4, "x").translate((0.5, 0, 0))
TILT = np.array([[1, 0, 0], [0, np.cos(0.4), -np.sin(0.4)], [0, np.sin(0.4), np.cos(0.4)]])


def at(node: rm.Node, *places: Any) -> list[rm.Node]:
    return [node.translate(p) for p in places]


CASES: dict[str, tuple[Callable[[], rm.Node], Callable[[], Array]]] = {
    "equal balls": (lambda: rm.hull(*at(rm.sphere(0.4), *BALLS)), lambda: distance((BALLS, 0.4))),
    "a list, in a union": (
        lambda: rm.hull([rm.union(*at(rm.sphere(0.4), *BALLS[:2])), *at(rm.sphere(0.4), *BALLS[2:])]),
        lambda: distance((BALLS, 0.4)),
    ),
    "three balls": (lambda: rm.hull(*at(rm.sphere(0.3), *BALLS[:3])), lambda: distance((BALLS[:3], 0.3))),
    "balls in a row": (
        lambda: rm.hull(*at(rm.sphere(0.3), LOW, HIGH, (0.5, 0, 0.25))),
        lambda: distance(([LOW, HIGH], 0.3)),
    ),
    "two balls": (
        lambda: rm.hull(rm.sphere(0.6), rm.sphere(0.2).translate((1, 1, 0))),
        lambda: distance_to_balls(((0, 0, 0), 0.6), ((1, 1, 0), 0.2)),
    ),
    "a ball in a ball": (lambda: rm.hull(rm.sphere(1), rm.sphere(0.2)), lambda: distance(((0, 0, 0), 1.0))),
    "equal boxes": (lambda: rm.hull(BOX, BOX), lambda: distance((corners((1, 2, 0.5)) @ TILT.T + (0.5, 0, 0), 0.0))),
    "box and octahedron": (
        lambda: rm.hull(BOX.scale(0.5), rm.octahedron(1).translate((0, 1, 1))),
        lambda: distance(
            (0.5 * (corners((1, 2, 0.5)) @ TILT.T + (0.5, 0, 0)), 0.0),
            (np.add(np.kron([[1], [-1]], np.eye(3)), (0, 1, 1)), 0.0),
        ),
    ),
    "round box and capsule": (
        lambda: rm.hull(rm.rounded_box((1, 1, 2), 0.2), rm.capsule(LOW, HIGH, 0.2), rm.box((2, 0.5, 0.5)).round(0.2)),
        lambda: distance((corners((0.6, 0.6, 1.6)), 0.2), ([LOW, HIGH], 0.2), (corners((2, 0.5, 0.5)), 0.2)),
    ),
    "cylinder and cone on an axis": (
        lambda: rm.hull(rm.cylinder(1, 0.5), rm.cone(0.6, 1.0, 0.2).translate((0, 1, 0))).translate((0.2, 0, 0)),
        lambda: distance(
            *[(rim((0.2, y, 0), (0, 1, 0), r), 0.0) for y, r in ((-0.25, 1.0), (0.25, 1.0), (0.5, 0.6), (1.5, 0.2))]
        ),
    ),
    "cylinders side by side": (
        lambda: rm.hull(*at(rm.cylinder(0.3, 0.8).orient((1, 1, 0)), (0, 0, 0), (0, 0, 1.5), (0.5, -0.5, 1))),
        lambda: distance(
            *[
                (rim(np.asarray(c) + s * np.array([1, 1, 0]) / 2**0.5, (1, 1, 0), 0.3), 0.0)
                for c in ((0, 0, 0), (0, 0, 1.5), (0.5, -0.5, 1))
                for s in (-0.4, 0.4)
            ]
        ),
    ),
    "two cylinders": (
        lambda: rm.hull(*at(rm.cylinder(0.3, 0.8), (0, 0.2, 0), (1, 0.2, 0.5))),
        lambda: distance(*[(rim((x, y, z), (0, 1, 0), 0.3), 0.0) for x, z in ((0, 0), (1, 0.5)) for y in (-0.2, 0.6)]),
    ),
}

BOUNDS = ("equal boxes", "box and octahedron")
"""Of corners alone: exact inside, a bound outside."""


@pytest.mark.parametrize("name", CASES)
def test_hulls_of_solids(name: str) -> None:
    make, known = CASES[name][0](), CASES[name][1]()
    found = make.distance(AT)
    assert np.all(np.sign(found) == np.sign(known)) and np.all(found <= known + 1e-4)
    within = known < 0 if name in BOUNDS else np.full(len(known), True)
    np.testing.assert_allclose(found[within], known[within], atol=1e-4)
    assert make.exactness == ("bound" if name in BOUNDS else "exact")
    low, high = make.bounds
    assert np.all(AT[known < -1e-4] >= low) and np.all(AT[known < -1e-4] <= high)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: rm.hull(rm.torus(), rm.sphere()), r"hull of torus, sphere.*two balls"),
        (lambda: rm.hull(*at(rm.sphere(0.3), *BALLS[:2]), rm.sphere(0.5).translate((0, 2, 0))), "one radius"),
        (lambda: rm.hull(rm.sphere(), rm.box().translate((3, 0, 0))), "one radius"),
        (lambda: rm.hull(rm.sphere(rm.Param("r", 1, 0.5, 2)), rm.sphere()), "of numbers"),
        (lambda: rm.hull(rm.cylinder(1, 1), rm.cylinder(0.5, 1).translate((2, 0, 0))), "side by side"),
        (lambda: rm.hull(rm.cylinder(1, 1), rm.cylinder(1, 1).rotate(1, "x")), "about one axis"),
        (lambda: rm.hull(rm.sphere(), rm.circle()), "a solid"),
        (lambda: rm.hull(rm.sphere(), 3), "a solid"),
        (lambda: rm.rounded_hull(((0, 0, 0), (1, 1, 1), (2, 2, 2))), "one line"),
    ],
)
def test_other_hulls_are_refused(make: Callable[[], Any], words: str) -> None:
    with pytest.raises(SceneError, match=words):
        make()
