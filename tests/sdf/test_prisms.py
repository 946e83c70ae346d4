"""Differences of prisms along one axis are one prism: the same solid, whose field is the distance beyond rims."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.spatial import cKDTree

import raymarch as rm
from raymarch.sdf.prisms import MEASURED, with_prisms

PLATE = rm.box((40, 10, 40))
TALL, SHIFT = rm.Param("tall", 5.0, 1.0, 10.0), rm.Param("shift", 0.0, -10.0, 10.0)
CORNER = rm.polygon([(0, 0), (6, 0), (0, 9)])
RED, BLUE = rm.Material(color="red"), rm.Material(color="blue")
POINTS = np.random.default_rng(0).uniform(-30, 30, (20_000, 3))

CUT = {
    "hole": PLATE - rm.cylinder(8, 10),
    "moved": PLATE.translate((1, 2, 3)) - rm.cylinder(8, 14).translate((1, 2, 5)),
    "turned": PLATE.rotate(0.7, (1, 2, 3)) - (rm.cylinder(8, 10) | rm.box((4, 10, 30))).rotate(0.7, (1, 2, 3)),
    "slot": PLATE - rm.box((4, 10, 30)).rotate(0.3, "y").translate((5, 0, 3)),
    "slot along x": rm.box((6, 30, 40)).rotate(0.2, "x") - rm.box((6, 20, 4)).rotate(0.8, "x").translate((0, 3, 4)),
    "through the border": PLATE - rm.cylinder(8, 12).translate((18, 0, 3)),
    "several": PLATE - rm.cylinder(3, 12).translate((10, 0, 0)) - rm.cylinder(2, 12) - rm.box((30, 11, 3)),
    "blind holes beside": PLATE - rm.cylinder(4, 5).translate((-10, 5, -9)) - rm.cylinder(3, 12).translate((9, 0, 0)),
    "ring": PLATE - (rm.cylinder(14, 12) - rm.cylinder(8, 12)),
    "two plates": (PLATE | PLATE.translate((20, 0, 20))) - rm.cylinder(8, 12),
    "scaled": rm.box((0.04, 0.01, 0.04)).scale(1000) - rm.cylinder(0.008, 0.02).scale(1000),
    "disc": rm.cylinder(15, 6) - rm.box((4, 6, 40)),
    "extrusions": CORNER.scale(3).extrude(10) - CORNER.extrude(20).rotate(np.pi, "x").translate((4, 12, 0)),
    "turned over": (CORNER.scale(3).extrude(10) - CORNER.extrude(20).rotate(np.pi, "y").translate((7, 3, 0))).rotate(2),
    "mirrored": CORNER.extrude(9).transform(np.diag([1, -1, 1, 1])) - CORNER.extrude(20).translate((1, -4, 1)),
    "parameter across": PLATE - rm.cylinder(8, 12).translate((SHIFT, 0, 2 * SHIFT)),
    "parameter along": rm.box((40, TALL, 40)).translate((0, SHIFT, 0)) - rm.cylinder(8, TALL).translate((0, SHIFT, 0)),
    "parameter through": rm.box((40, TALL, 40)) - rm.cylinder(8, 2 * TALL).translate((0, 0.25 * TALL, 0)),
    "spinning": PLATE.rotate(SHIFT, "y") - rm.box((4, 11, 30)).translate((3, 0, 0)).rotate(2 * SHIFT, (0, -2, 0)),
    "material": PLATE.material(RED) - rm.cylinder(8, 12),
    "material of a part": PLATE.material(RED).translate((1, 2, 3)) - rm.cylinder(8, 18),
    "material of a tool": PLATE - rm.cylinder(8, 12).material(RED),
    "materials": PLATE.material(BLUE)
    - rm.cylinder(8, 12).material(RED)
    - rm.cylinder(3, 30).translate((13, 0, 0))
    - rm.box(6).translate((-13, 5, 0)).material(RED),
}

LEFT = {
    "blind": PLATE - rm.cylinder(8, 9.9),
    "ball": rm.sphere(20) - rm.cylinder(8, 99),
    "smooth": rm.difference(PLATE, rm.cylinder(8, 12), k=1),
    "leaning": PLATE - rm.cylinder(8, 30).rotate(0.1, "x"),
    "tilting": PLATE.rotate(SHIFT, "x") - rm.cylinder(8, 30),
    "moving end": PLATE - rm.cylinder(8, 12).translate((0, SHIFT, 0)),
    "stretched": PLATE - rm.cylinder(8, 30).scale((1, 2, 3)),
    "hidden": PLATE - rm.cylinder(8, 30).visible(shadow=False),
    "of two heights": (PLATE | rm.box((10, 20, 10)).translate((20, 0, 0))) - rm.cylinder(4, 20).translate((20, 0, 0)),
}


VALUES = {
    "parameter across": [{"shift": -7.0}, {"shift": 4.0}],
    "parameter along": [{"shift": -7.0, "tall": 9.0}, {"shift": 4.0, "tall": 2.0}],
    "parameter through": [{"tall": 9.0}, {"tall": 2.0}],
    "spinning": [{"shift": -7.0}, {"shift": 4.0}],
}


@pytest.mark.parametrize("name", CUT)
def test_a_prism_is_the_same_solid_and_a_larger_field(name: str) -> None:
    node = CUT[name]
    prism = with_prisms(node)
    assert prism is not node
    for values in VALUES.get(name, [{}]):
        before, after = node.distance(POINTS, params=values), prism.distance(POINTS, params=values)
        assert (after >= before - 1e-9).all() and (after - before)[before > 0].max() > 0.1
        np.testing.assert_array_equal(before < -1e-9, after < -1e-9)
        near = POINTS[np.abs(after) < 1.0]
        np.testing.assert_array_equal(prism.material_at(near, params=values), node.material_at(near, params=values))


@pytest.mark.parametrize("name", LEFT)
def test_others_are_left(name: str) -> None:
    assert with_prisms(LEFT[name]) is LEFT[name]


@pytest.mark.parametrize("name", ["hole", "moved", "slot", "material of a tool"])
def test_the_field_is_the_distance_outside(name: str) -> None:
    """To points inside of the solid, which are .4 apart."""
    node = CUT[name]
    along = np.arange(-25.8, 26.0, 0.4)
    grid = np.stack(np.meshgrid(along, along[abs(along) < 9], along), -1).reshape(-1, 3)
    far = POINTS[node.distance(POINTS) > 1.0]
    nearest = cKDTree(grid[node.distance(grid) < 0]).query(far)[0]
    found = with_prisms(node).distance(far)
    assert (found <= nearest).all() and (nearest - found).max() < 0.7  # the diagonal of a cell of points
    assert (nearest - node.distance(far)).max() > 1.0


def test_many_differences_and_deep_trees() -> None:
    holes = PLATE
    for x, z in np.random.default_rng(1).uniform(-20, 20, (MEASURED - 1, 2)):
        holes = holes - rm.cylinder(0.5, 11).translate((x, 0, z))
    assert with_prisms(holes).name == "transform"
    deep: Any = rm.cylinder(1, 30)
    for _ in range(1500):
        deep = deep.rotate(0.001, "y")
    assert with_prisms(PLATE - deep).name == "difference"
    many = rm.union(*[PLATE - rm.cylinder(1 + i / 1e3, 11) for i in range(MEASURED + 1)])
    assert with_prisms(many) is many
