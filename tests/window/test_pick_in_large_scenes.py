"""Picks in scenes of many objects: the same answers as from the whole scene, from the objects near the ray only."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.scene.parameter import Values
from raymarch.truth.narrow import along_ray
from raymarch.truth.rays import camera_rays
from raymarch.window.pick import Pick, picked, verified

SIZE = (8, 6)


def things(count: int) -> list[rm.Node]:
    random = np.random.default_rng(5)
    red = rm.Material(color=(1, 0, 0))
    found = []
    for i in range(count):
        made = rm.box((0.6, 0.3, 0.4)).rotate(random.uniform(0, 3), "y") if i % 2 else rm.torus(0.3, 0.1)
        found.append(made.translate(tuple(random.uniform(-3, 3, 3))))
    return [node.material(red) if i % 3 else node for i, node in enumerate(found)]


def pick(scene: rm.Scene, i: int, depth: float = np.inf) -> Pick:
    values = Values({})
    pose = scene.pose(values, SIZE[0] / SIZE[1])
    rays = camera_rays(pose, *SIZE)
    origin, ray = rays.at(np.array([i]), np.zeros(1))[0], rays.directions[i]
    texels: dict[str, Any] = {name: np.zeros((1, 1)) for name in ("material", "iterations", "evaluations")}
    texels |= {"depth": np.full((1, 1), depth), "normal": np.zeros((1, 1, 3))}
    return verified(picked(1, (0, 0), texels, origin, ray), scene, values, origin, ray, pose)


@pytest.mark.parametrize("position", [(2.0, 3.0, 9.0), (0.1, 0.2, 0.3)])
@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
def test_a_pick_is_the_reference_of_the_whole_scene(projection: str, position: tuple[float, float, float]) -> None:
    camera = rm.Camera(position, (0, 0, 0), projection=projection)
    node = rm.union(rm.plane(offset=-3.0), *things(60), rm.union(*things(4), k=0.2).translate((1, 0, 1)))
    scene = rm.Scene(node.material(rm.Material(color=(0, 1, 0))) | rm.sphere(rm.Param("r", 0.3, 0.1, 1)), camera)
    known = rm.truth(scene, SIZE, outputs=("depth", "normal"))
    assert known.hit.sum() > 10
    for i in range(0, SIZE[0] * SIZE[1], 3):
        found = pick(scene, i)
        assert found.true is not None and found.true_normal is not None
        assert found.true == pytest.approx(known.depth.ravel()[i], rel=1e-12)
        assert np.allclose(found.true_normal, known.normal.reshape(-1, 3)[i], atol=1e-9)


def test_a_pick_asks_the_objects_near_its_ray() -> None:
    scene = rm.Scene(rm.union(*things(400)), rm.Camera((2, 3, 9), (0, 0, 0)))
    pose = scene.pose(Values({}), 1.0)
    near = along_ray(scene.node, pose, pose.position, pose.view, Values({}))
    assert 0 < len(near.children) < 40
    away = along_ray(scene.node, pose, pose.position, -pose.view, Values({}))
    assert len(away.children) == 1, "a union needs an operand"
    alone = rm.sphere() & rm.box(1)
    assert along_ray(alone, pose, pose.position, pose.view, Values({})) is alone


def test_a_pick_names_the_part_and_its_line() -> None:
    many = rm.union(*things(50))
    ball = rm.sphere(0.5).translate((0, 0, 5))
    found = pick(rm.Scene(many | ball, rm.Camera((0, 0, 9), (0, 0, 0), fov=5)), 20)
    assert found.part == "sphere" and found.where == ball.children[0].where


@pytest.mark.parametrize("count", [50, 3000])
def test_a_pick_of_instances_names_them(count: int) -> None:
    """Also where the instances have materials, and more of them than the reference takes the materials of."""
    random = np.random.default_rng(0)
    colors = random.uniform(0, 1, (count, 3))
    made = rm.instances(rm.sphere(0.2), random.uniform(-3, 3, (count, 3)), colors)
    scene = rm.Scene(made | rm.sphere(0.5).translate((0, 0, 5)), rm.Camera((0, 0, 9), (0, 0, 0)))
    for i in range(SIZE[0] * SIZE[1]):
        found = pick(scene, i)
        if found.part == "instances":
            break
    assert found.part == "instances" and found.where == made.where
