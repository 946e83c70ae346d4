"""The field at the camera: kept while the camera moves, certified, and the same whatever was drawn before."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import raymarch as rm
from raymarch.expr.arrays import bound
from raymarch.gpu.camera_field import CHEAP, CameraField
from raymarch.gpu.prepare import prepare
from raymarch.plan import plan
from raymarch.scene import load
from raymarch.scene.parameter import Values, set_values
from tests.lab.frame_cpu import expressions_made, moved

EXAMPLES = Path(__file__).parents[2] / "examples"
SIZES = np.random.default_rng(3).uniform(0.2, 0.5, 9)


def blobs(k: float = 0.2, size: rm.Operand = 1.0) -> rm.Node:
    """A union of nine different solids: more than `CHEAP` operations."""
    parts = [rm.torus(1.0, r).rotate(r * 9.0, "x").twist(0.1 * i + 0.1) for i, r in enumerate(SIZES)]
    return rm.union(*[part.translate((3.0 * i - 12.0, 0.0, 0.0)) for i, part in enumerate(parts)], k=k) | rm.box(size)


@pytest.fixture(scope="module")
def ready():
    made = prepare(rm.Scene(blobs()))
    assert made.plan.operations > CHEAP and made.at_camera.lattice
    return made


def places(n: int, low: float = -20.0, high: float = 20.0) -> np.ndarray:
    return np.random.default_rng(7).uniform(low, high, (n, 3))


def test_a_bound_at_the_camera_is_certified_and_tight(ready):
    exact = np.ravel(ready.distance(places(400))[0])
    for position, true in zip(places(400), exact, strict=True):
        found = ready.at_camera.uniforms(Values({}), position, 1e-6)
        value = found["u_start"][3]
        assert found["u_side"] == (-1.0 if true < 0.0 else 1.0)
        assert value <= abs(true)
        assert value >= 0.85 * abs(true) - 1e-4, (position, true)


def test_a_camera_on_its_way_seldom_asks_for_the_field(ready):
    field = CameraField(ready.plan)
    for x in np.linspace(4.0, 8.0, 200):
        field.uniforms(Values({}), np.array([x, 6.0, 3.0]), 1e-6)
    assert field.evaluated <= 25


def test_cells_are_as_large_as_fit_where_the_field_is_bounded_far_away() -> None:
    """A coarse lattice tells little of a repetition, whose field is at most the way to the next cell."""
    made = plan(load(EXAMPLES / "large/city.py"))
    field = CameraField(made)
    assert field.lattice
    for x in np.linspace(-9.0, -8.5, 50):
        found = field.uniforms(Values({}), np.array([x, 7.0, 26.0]), 1e-6)
        assert found["u_start"][3] > 0.4
    assert field.evaluated <= 15


def test_the_start_does_not_depend_on_earlier_frames(ready):
    used = CameraField(ready.plan)
    for position in places(50):
        used.uniforms(Values({}), position, 1e-6)
    for position in places(50)[::7]:
        assert used.uniforms(Values({}), position, 1e-6) == CameraField(ready.plan).uniforms(Values({}), position, 1e-6)


def test_a_changed_parameter_is_seen_at_once():
    made = prepare(rm.Scene(blobs(size=rm.Param("size", 1.0, 0.5, 30.0))))
    assert made.at_camera.lattice
    place = np.array([6.0, 6.0, 3.0])
    for size in (1.0, 8.0, 30.0, 1.0):
        values = set_values(made.plan.parameters, {"size": size})
        with bound(values.params, values.time):
            true = float(np.ravel(made.distance(place[None])[0])[0])
        found = made.at_camera.uniforms(values, place, 1e-6)
        assert found["u_side"] == np.sign(true)
        assert 0.85 * abs(true) <= found["u_start"][3] <= abs(true)


@pytest.mark.parametrize("field", [rm.sphere(1.0), blobs().translate((rm.time, 0, 0)), rm.mandelbulb()])
def test_cheap_moving_and_estimated_fields_are_asked_in_each_frame(field):
    assert not prepare(rm.Scene(field)).at_camera.lattice


@pytest.mark.parametrize("name", ["large/lamps", "showcase/plates"])
def test_a_frame_makes_no_expression(name):
    scene = load(EXAMPLES / f"{name}.py")
    with rm.Renderer((2, 2)) as renderer:
        pose = scene.pose(set_values(renderer.prepared(scene).plan.parameters))
        renderer.render(scene, pose=pose)
        with expressions_made() as made:
            renderer.render(scene, pose=moved(pose, 0.01))
    assert made == [0]
