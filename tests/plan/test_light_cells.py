"""The grid of cells that finds the lights of a point, against all lights."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

import raymarch as rm
from raymarch.plan import lights
from raymarch.plan.light_cells import WIDTH, LightCells, build
from raymarch.scene.light import Light
from raymarch.scene.light_kinds import KINDS
from raymarch.scene.parameter import Values, set_values
from raymarch.truth.light import incoming

EVERYWHERE = (np.full(3, -np.inf), np.full(3, np.inf))


def listed(cells: LightCells, p: NDArray[np.float64]) -> list[int]:
    """The list of a point, found as raymarch/glsl/light/cells.glsl does, in float32."""
    texels = cells.texels.reshape(-1, 4)
    cell = np.floor((np.float32(p) - texels[0, :3]) * texels[0, 3])
    counts = texels[1, :3]
    inside = bool(np.all(cell >= 0) and np.all(cell < counts))
    at = 3 + int(cell[0] + counts[0] * (cell[1] + counts[1] * cell[2])) if inside else 2
    start, length = (int(v) for v in texels[at, :2])
    return [int(v) for v in texels[start : start + length, 0]]


@pytest.mark.parametrize("offset", [0.0, 1e4])
def test_a_list_has_all_lights_that_reach_its_points_and_few_others(offset: float) -> None:
    random = np.random.default_rng(1)
    balls = np.c_[random.uniform(-10, 10, (300, 3)) * (1, 0.1, 1) + offset, random.uniform(0.3, 2, 300)]
    balls[[7, 200], 3] = np.inf
    cells = build(balls, *EVERYWHERE)
    inside = listed(cells, balls[0, :3])
    found = excess = 0
    for p in np.concatenate([random.uniform(-12, 12, (200, 3)) * (1, 0.2, 1) + offset, balls[:200, :3]]):
        reached = np.flatnonzero(np.linalg.norm(p - balls[:, :3], axis=1) < balls[:, 3])
        own = listed(cells, p)
        assert set(reached) <= set(own) and own == sorted(set(own)) and len(own) <= cells.most
        found, excess = found + len(reached), excess + len(own) - len(reached)
    assert inside and excess < 2 * found
    assert listed(cells, np.full(3, 1e9)) == [7, 200]
    assert cells.texels.shape[1] == WIDTH and cells.texels.dtype == np.float32


def test_a_grid_covers_surfaces_only_and_may_be_empty() -> None:
    ball = np.array([[0.0, 0.0, 0.0, 100.0]] * 20)
    near = build(ball, np.array([-1.0, -np.inf, -1.0]), np.array([1.0, 0.0, 1.0]))
    assert (
        listed(near, np.array([0.5, -50.0, 0.5])) == list(range(20)) and listed(near, np.array([0.0, 50.0, 0.0])) == []
    )
    away = build(ball, np.full(3, 1e3), np.full(3, 2e3))
    assert listed(away, np.full(3, 1.5e3)) == [] and away.most >= 1
    endless = build(np.array([[0.0, 0.0, 0.0, np.inf]] * 3), *EVERYWHERE)
    assert listed(endless, np.zeros(3)) == listed(endless, np.full(3, 7.0)) == [0, 1, 2]


def test_crowded_lights_take_larger_cells() -> None:
    """Memory stays bounded where many large balls overlap."""
    balls = np.c_[np.random.default_rng(2).uniform(-1, 1, (600, 3)), np.full(600, 1.0)]
    assert build(balls, *EVERYWHERE).texels.size < 4 * (1 << 22)


def limited(kind: type[Light]) -> Light | None:
    if kind is rm.Sun:
        return None
    return kind(position=(0.3, 1.0, -0.2), range=2.0, intensity=50.0)  # type: ignore[call-arg]


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
def test_no_light_leaves_its_ball(kind: type[Light]) -> None:
    light, values = limited(kind), Values({})
    if light is None:
        assert rm.Sun().reach is None
        return
    assert light.reach is not None and light.replace(range=None).reach is None
    centre, radius = (values.of(value) for value in light.reach)
    towards = np.random.default_rng(3).normal(size=(2000, 3)) * (1, 0.5, 1) - (0, 0.7, 0)
    towards /= np.linalg.norm(towards, axis=1)[:, None]
    for u in ((0.5, 0.5), (0.0, 0.0), (1.0, 0.3)):
        beyond = incoming(light, values, centre + radius * 1.0001 * towards, 100.0, u).radiance
        within = incoming(light, values, centre + 0.3 * radius * towards, 100.0, u).radiance
        assert not np.any(beyond) and np.any(within)


def test_lights_that_move_take_their_cells_along() -> None:
    lamps = [rm.PointLight((k + rm.time, 1.0, 0.0), range=rm.Param("range", 1.0, 0.5, 4.0)) for k in range(12)]
    scene = rm.Scene(rm.plane(), lights=[*lamps, rm.Sun()])
    assert lights.in_cells(scene) and not lights.in_cells(scene.replace(lights=[*lamps[:8], *[rm.Sun()] * 4]))
    found = lights.balls(scene, set_values(scene.parameters, {"range": 2.0}, 0.5))
    np.testing.assert_array_equal(found[:12, 0], np.arange(12) + 0.5)
    np.testing.assert_array_equal(found[:, 3], [2.0] * 12 + [np.inf])
