"""What depends on time alone is worked out in float64, once a frame, and the field stays the same."""

from __future__ import annotations

import numpy as np
import pytest

import raymarch as rm
from raymarch.expr.arrays import bound, evaluator
from raymarch.expr.vocabulary import cos, sin
from raymarch.plan import plan
from raymarch.plan.hoisting import with_hoisted
from raymarch.scene.parameter import set_values
from raymarch.shader import assemble

SIZE = rm.Param("size", 0.5, 0.1, 2.0)


def ripples(amplitude: float) -> rm.Node:
    return rm.box(2.0).displace_by(lambda p: amplitude * sin(5.0 * p.x + rm.time), amplitude, 5.0 * amplitude)


NODES = {
    "turned": rm.box(1).rotate(3.0 * rm.time, (1, 2, 3)),
    "moved": rm.sphere().translate((sin(rm.time), rm.time * SIZE, 0)),
    "grown": rm.sphere(0.5 + 0.1 * sin(rm.time)) | rm.torus().rotate(rm.time),
    "waves": ripples(0.02).rotate(0.5 * rm.time),
    "beats": rm.box(2.0).displace_by(lambda p: 0.02 * sin(p.x * rm.time), 0.02, 0.1),
    "thrice": rm.box(2.0).displace_by(lambda p: 0.02 * cos(3.0 * (p - 2.0 * rm.time).y), 0.02, 0.06),
    "copies": rm.box(0.3).rotate(rm.time).translate((0.2, 0, 0)).repeat(1.5, 3),
}


@pytest.mark.parametrize("name", NODES)
@pytest.mark.parametrize("time", [0.0, 1.3, 1e5])
def test_the_field_is_the_same(name: str, time: float) -> None:
    made = plan(rm.Scene(NODES[name], rm.Camera((0, 1, 4), (0, 0, 0))))
    values = set_values(made.parameters, {}, time)
    points = np.random.default_rng(1).normal(size=(100, 3))
    with bound(values.params, time):
        known = NODES[name].distance(points)
    then = with_hoisted(made.hoisted, values)
    with bound(then.params, time):
        found = evaluator([made.field.body], made.field.params)(points)[0]
    np.testing.assert_allclose(found, known, atol=1e-12)


@pytest.mark.parametrize("name", ["waves", "thrice"])
def test_a_wave_keeps_its_digits_for_years(name: str) -> None:
    """Time met the point as a float32 of whole seconds after a year."""
    time = 3e7 + 0.3
    made = plan(rm.Scene(NODES[name], rm.Camera((0, 1, 4), (0, 0, 0))))
    values = set_values(made.parameters, {}, time)
    points = np.random.default_rng(1).normal(size=(100, 3)).astype(np.float32)
    with bound(values.params, time):
        known = NODES[name].distance(points)
    then = with_hoisted(made.hoisted, values)
    with bound(then.params, time):
        found = evaluator([made.field.body], made.field.params, np.float32)(points)[0]
    np.testing.assert_allclose(found, known, atol=64 * 2.0**-23)


def test_nothing_but_time_that_meets_the_point_is_left_to_the_shader() -> None:
    turned, beats = (assemble(plan(rm.Scene(NODES[name]))) for name in ("turned", "beats"))
    assert not turned.uses_time and beats.uses_time
    assert any(name.startswith("hoisted") for name in turned.parameters)


def test_a_scene_without_time_hoists_nothing() -> None:
    made = plan(rm.Scene(rm.sphere(SIZE).rotate(SIZE)))
    assert not made.hoisted and set(made.parameters) == {"size"}
    assert set(assemble(made).parameters) == {"size"}


def test_waves_of_shared_and_of_many_terms_are_planned() -> None:
    """Each term is looked at once, and none by recursion."""

    def shared(p: rm.Expr) -> rm.Expr:
        x = p.x
        for k in range(40):
            x = x + 0.3 * (x - p.y * (k + 1))
        return 0.01 * sin(x + rm.time)

    def many(p: rm.Expr) -> rm.Expr:
        return 0.01 * sin(sum((p.x * (k + 1) for k in range(1500)), rm.time + 0))

    for wave in (shared, many):
        assert plan(rm.Scene(rm.sphere().material(rm.Material(color=lambda p, w=wave: 0.5 + w(p))))).hoisted is not None
