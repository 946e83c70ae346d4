"""`node.raycast` and `node.material_at`: arrays of rays and points."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import raymarch as rm
from raymarch.errors import SceneError
from raymarch.scene import load
from raymarch.scene.parameter import Values

EXAMPLES = Path(rm.__file__).parents[1] / "examples"


def test_rays_of_a_node_are_those_of_the_function() -> None:
    node = rm.sphere(rm.Param("r", 1.0, 0.5, 2.0)).translate((rm.time, 0, 0))
    origins, directions = [(0.5, 0, 5), (0.5, 3, 5), (9, 0, 0)], [(0, 0, -2), (0, 0, -1), (-1, 0, 0)]
    found = node.raycast(origins, directions, time=0.5, params={"r": 1.5})
    np.testing.assert_allclose(found.distance, [3.5, np.inf, 7.0])
    wanted = rm.raycast(node, origins, directions, time=0.5, params={"r": 1.5})
    np.testing.assert_array_equal(found.normal, wanted.normal)
    assert node.raycast((0, 0, 5), (0, 0, -1), far=3).hit.tolist() == [False]


def test_materials_are_those_of_the_hits() -> None:
    scene = load(EXAMPLES / "hello.py")
    pose = scene.pose(Values({}), 16 / 9)
    _, directions = pose.rays(np.arange(0, 640, 7), np.arange(0, 360, 7)[:, None], (640, 360))
    hits = scene.node.raycast(pose.position, directions.reshape(-1, 3))
    assert set(hits.material[hits.hit]) == {1, 2, 3}
    np.testing.assert_array_equal(scene.node.material_at(hits.position[hits.hit]), hits.material[hits.hit])


def test_a_material_moves_with_its_part() -> None:
    gold = rm.Material(color="gold")
    both = rm.union(rm.sphere(1), rm.box().translate((rm.Param("x", 3.0, 0, 9), 0, 0)).material(gold), k=0.1)
    assert rm.Scene(both).materials[1] == gold
    assert both.material_at((3, 0, 0)).shape == () and both.material_at((3, 0, 0)) == 1
    np.testing.assert_array_equal(both.material_at([(3, 0, 0), (0, 0, 1)], params={"x": 9}), [0, 0])
    np.testing.assert_array_equal(both.material_at([(3, 0, 0), (-1, 0, 0), (2.2, 0, 0)]), [1, 0, 1])
    assert rm.sphere().material_at(np.zeros((0, 3))).shape == (0,)


@pytest.mark.parametrize("points", [(1, 2), [(0, 0, np.nan)], np.zeros((2, 2, 3)), "abc"])
def test_wrong_points_are_refused(points: object) -> None:
    with pytest.raises(SceneError, match="material_at: points"):
        rm.sphere().material_at(points)
    with pytest.raises(SceneError, match="raycast: origins"):
        rm.sphere().raycast(points, (0, 0, 1))
    with pytest.raises(SceneError, match=r"raycast: 2 origins, 3 directions"):
        rm.sphere().raycast(np.zeros((2, 3)), np.ones((3, 3)))
    with pytest.raises(SceneError, match="unknown parameter 'x'"):
        rm.sphere().material_at((0, 0, 0), params={"x": 1})


def test_evaluations_of_many_rays_of_hello() -> None:
    """So few that a million rays take seconds: the count does not depend on the machine."""
    from raymarch.truth.field import Field

    scene = load(EXAMPLES / "hello.py")
    pose = scene.pose(Values({}), 16 / 9)
    _, directions = pose.rays(np.arange(0, 640, 4), np.arange(0, 360, 4)[:, None], (640, 360))
    asked = 0
    before = Field._run

    def counted(self: Field, evaluate: object, points: np.ndarray, *more: object) -> object:
        nonlocal asked
        asked += len(points)
        return before(self, evaluate, points, *more)  # type: ignore[arg-type]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Field, "_run", counted)
        scene.node.raycast(pose.position, directions.reshape(-1, 3))
    assert asked < 12 * directions.size / 3
