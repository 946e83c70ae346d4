"""Rays and convex solids: the ends of a line's part in a solid, against the sign of the field along the line."""

from __future__ import annotations

import numpy as np
import pytest

import raymarch as rm
from raymarch.expr.arrays import evaluator
from raymarch.expr.node import var
from raymarch.expr.types import VEC3
from raymarch.sdf.intersections import FARTHEST, NAMES, has_closed_form, interval_of_ray
from tests.lab.closed_form_rays import MOST, RATIOS, SHAPES, errors, trial

ORIGIN, DIRECTION = var("o", VEC3), var("d", VEC3)
TURN = np.array([[0, 2, 0, 0], [0, 0, -2, 0], [2, 0, 0, 0], [0.1, 0.2, 0.3, 1]], float)
SOLIDS = {
    "plane": rm.plane((1, 2, 0.5), 0.3),
    "sphere": rm.sphere(0.7),
    "box": rm.box((1, 0.4, 2)),
    "cylinder": rm.cylinder(0.5, 1.3),
    "capsule": rm.capsule((0.1, 0.2, 0.3), (-0.5, 0.6, 0.1), 0.3),
    "cone": rm.cone(0.9, 1.6),
    "frustum": rm.cone(0.3, 1, 0.8),
    "cone like a cylinder": rm.cone(0.5, 1, 0.5),
    "ellipsoid": rm.ellipsoid((2, 0.2, 1)),
    "placed box": rm.box((1, 0.4, 2)).rotate(0.5, (1, 2, 3)).translate((0.3, 0.1, -0.2)).scale(1.7),
    "placed ellipsoid": rm.ellipsoid((2, 1.2, 0.5)).scale(0.6).translate((1, 0, 0)).material(rm.Material()),
    "transformed cylinder": rm.cylinder(0.3, 0.5).transform(TURN),
    "mirrored cone": rm.cone(0.6, 1.0).transform(np.diag([1.0, -1.0, 1.0, 1.0])),
}


def rays(n: int = 400) -> tuple[np.ndarray, np.ndarray]:
    """Rays in all directions, the first along the axes."""
    random = np.random.default_rng(1)
    o, d = 1.5 * random.normal(size=(n, 3)), random.normal(size=(n, 3))
    d[:60] = np.eye(3)[np.arange(60) % 3] * np.where(np.arange(60) % 2, 1, -1)[:, None]
    o[:60] *= 0.4
    return o, d / np.linalg.norm(d, axis=1)[:, None]


def ends(node: rm.Node, o: np.ndarray, d: np.ndarray) -> np.ndarray:
    found = evaluator([interval_of_ray(node, ORIGIN, DIRECTION)], (ORIGIN, DIRECTION))(o, d)[0]
    return np.broadcast_to(found, (len(o), 2))


def test_every_shape_is_here() -> None:
    assert {node.name for node in SOLIDS.values()} >= set(NAMES)


@pytest.mark.parametrize("name", SOLIDS)
def test_a_line_is_in_the_solid_between_its_ends(name: str) -> None:
    node, (o, d) = SOLIDS[name], rays()
    assert has_closed_form(node)
    found = ends(node, o, d)
    t = np.linspace(-8, 8, 161)
    field = node.distance((o[:, None] + t[:, None] * d[:, None]).reshape(-1, 3)).reshape(len(o), -1)
    between = (t > found[:, :1]) & (t < found[:, 1:])
    assert np.array_equal(field < 0, between) and between.any(axis=1).sum() > 5
    met = found[:, 0] <= found[:, 1]
    for k in (0, 1):
        near = met & (np.abs(found[:, k]) < 100)
        assert np.abs(node.distance(o[near] + found[near, k, None] * d[near])).max() < 1e-13


@pytest.mark.parametrize("name", SOLIDS)
def test_float32_keeps_the_ends_on_the_surface(name: str) -> None:
    """At grazing rays too, and from a hundred times the size away."""
    node, (o, d) = SOLIDS[name], rays()
    for away in (0.0, 100.0):
        wrong = errors(node, (o * 0.3 - away * d).astype(np.float32), d.astype(np.float32))
        assert wrong.max() < MOST


@pytest.mark.parametrize("name", SHAPES)
def test_float32_holds_all_ratios(name: str) -> None:
    """Flat, long and small solids, turned, large and far from the origin; more: tests/lab/closed_form_rays.py."""
    assert max(trial(name, ratio, seed, 32).max() for seed, ratio in enumerate(RATIOS[::2])) < MOST


def test_lines_that_touch_and_miss() -> None:
    ball, cube = rm.sphere(1.0), rm.box(2.0)
    along = np.array([[0.0, 0.0, 1.0]])
    for node in (ball, cube):
        for x, meets in ((0.999999, True), (1.0, True), (1.000001, False)):
            found = ends(node, np.array([[x, 0.0, -5.0]]), along)[0]
            assert (found[0] <= found[1]) == meets, (node, x)
    inside, outside = (ends(rm.plane(), np.array([[0.0, y, 0.0]]), along)[0] for y in (-1.0, 1.0))
    assert inside[0] <= -1e19 and inside[1] >= 1e19
    assert outside[1] < 0 or outside[0] > 1e19
    assert FARTHEST > 1e20


def test_what_has_no_closed_form() -> None:
    for node in (
        rm.torus(),
        rm.box(1).round(0.1),
        rm.sphere().scale((1, 2, 1)),
        rm.sphere().twist(1.0),
        rm.sphere() | rm.box(1),
    ):
        assert not has_closed_form(node)
    assert not has_closed_form(rm.sphere().transform(np.diag([1.0, 2.0, 1.0, 1.0])))
