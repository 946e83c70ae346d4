"""Enclosures along rays, against values at points of the stretches."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

import raymarch as rm
from raymarch.expr.arrays import evaluator
from raymarch.expr.evaluate import Program
from raymarch.expr.function import loop
from raymarch.expr.node import Expr, var
from raymarch.expr.raw import RawFunction, raw
from raymarch.expr.types import VEC3
from raymarch.expr.walk import find
from raymarch.proof.enclosure import ENCLOSURES
from raymarch.proof.parts import Operands
from raymarch.proof.rays import Rays, Stretch
from raymarch.proof.span import Span, jumping, still, stretches
from raymarch.scene.parameter import Values
from raymarch.sdf.lower import Lowering
from raymarch.sdf.node import Node
from tests.support.node_samples import NodeSample, samples
from tests.support.random_trees import trees

P = var("p", VEC3)
COUNT = 60


def rays(seed: int, reach: float) -> tuple[Rays, NDArray[np.float64], NDArray[np.float64]]:
    random = np.random.default_rng(seed)
    origins = random.uniform(-reach, reach, (COUNT, 3))
    directions = random.normal(size=(COUNT, 3))
    directions[:6] = np.repeat(np.eye(3), 2, axis=0) * np.tile([1.0, -1.0], 3)[:, None]
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return Rays(origins, directions), np.zeros(COUNT), reach * np.exp2(random.uniform(-30, 1, COUNT))


def enclosed(body: Expr, point: Expr, seed: int, reach: float, rounding: float = 0.0) -> None:
    """Ranges hold all values; slopes all differences; at the centre, the value."""
    shot, start, end = rays(seed, reach)
    centre = start + (end - start) * np.random.default_rng(seed).random(COUNT)
    every = np.arange(COUNT)
    with stretches(centre - start, end - centre):
        found: Span = Program([body], [point], ENCLOSURES)(shot.points(every, start, end, centre))[0]
        with jumping() as jumps:
            Program([body], [point], ENCLOSURES)(shot.points(every, start, end, centre))
        assert all(jump.shape == (COUNT,) for jump in jumps)
    run = evaluator([body], [point])
    shares = np.concatenate([np.linspace(0, 1, 17), np.random.default_rng(seed + 1).random(8)])
    t = start[:, None] + (end - start)[:, None] * shares
    points = shot.origins[:, None] + t[..., None] * shot.directions[:, None]
    values = np.broadcast_to(run(points.reshape(-1, 3))[0], COUNT * len(shares)).reshape(COUNT, -1)
    noise = np.asarray(
        (1e-13 + rounding) * (np.abs(values) + reach) + 1e-13
    )  # of the values, which are not rounded outwards
    low, high = (np.broadcast_to(end, COUNT)[:, None] for end in found.range)
    wrong = np.isfinite(values) & ((values < low - noise) | (values > high + noise))
    assert not wrong.any(), f"{wrong.sum()} values outside"
    if found.slope is None:
        return
    rise, length = np.diff(values, axis=1)[:, :16], np.diff(t, axis=1)[:, :16]
    error = (noise[:, 1:17] + noise[:, :16]) * 4.0
    least, most = (np.broadcast_to(end, COUNT)[:, None] * length for end in found.slope)
    wrong = np.isfinite(rise) & ((rise < least - error) | (rise > most + error))
    assert not wrong.any(), f"{wrong.sum()} slopes outside"


@pytest.mark.parametrize("sample", [s for s in samples() if s.definition.dimension == 3], ids=lambda s: s.id)
def test_every_node_is_enclosed(sample: NodeSample) -> None:
    field = Lowering(rays="camera").field(sample.build())
    # the rows of instances are float32 numbers in a table, which the reference replaces by those of the user
    enclosed(field.body, field.params[0], 3, 2.0, 2.0**-22 if find([field.body], "fetch") else 0.0)


@settings(max_examples=15, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
@given(trees, st.integers(0, 1000))
def test_random_trees_are_enclosed(tree: Node, seed: int) -> None:
    field = Lowering(rays="camera").field(tree)
    enclosed(field.body, field.params[0], seed, 3.0)


@pytest.mark.parametrize("ends", [(-0.6, 0.9), ((-0.5, -9.0, 0.1), (0.5, 9.0, 0.1)), (0.9, -0.6)])
def test_a_point_less_where_it_is_clamped_to_is_0_inside(ends: tuple[rm.Vec3Like, rm.Vec3Like]) -> None:
    """Also of ends in the wrong order, of which a clamp takes the second one."""
    beyond = P - rm.clamp(P, *(rm.vec3(*end) if isinstance(end, tuple) else end for end in ends))
    for seed, part in enumerate((beyond.x, beyond.y, beyond.z, rm.dot(beyond, beyond))):
        enclosed(part, P, seed, 1.5)
    random = np.random.default_rng(4)
    shot, length = Rays(random.uniform(-0.4, 0.4, (9, 3)), random.uniform(-0.1, 0.1, (9, 3))), np.ones(9)
    with stretches(0.5 * length, 0.5 * length):
        points = shot.points(np.arange(9), 0.0 * length, length, 0.5 * length)
        found: Span = Program([beyond.x], [P], ENCLOSURES)(points)[0]
    if ends[0] != 0.9:
        assert np.all(found.low == 0.0) and np.all(found.high == 0.0)


@pytest.mark.parametrize("part", [0.0, 0.25, 0.5])
def test_the_hash_of_one_cell_is_one_number(part: float) -> None:
    """Also of a cell and a half, which lies on the border of two."""
    shot, start, end = Rays(np.zeros((3, 3)), np.eye(3)), np.zeros(3), np.full(3, 0.4)
    with stretches(0.5 * end, 0.5 * end):
        body = rm.hash(rm.floor(P + 7.25) + part)
        found: Span = Program([body], [P], ENCLOSURES)(shot.points(np.arange(3), start, end, 0.5 * end))[0]
    assert np.all(found.low == found.high)


def test_newtons_method_is_narrow_where_two_roots_coincide() -> None:
    """At points as near to one place of the curve as to the next one: centres of its curvature, and beside them."""
    a, b, c = np.array([[0.141, 0.339, -0.392], [-0.174, 0.059, 1.077], [-0.046, 0.017, 0.214]])
    t, bend = np.linspace(0.02, 0.98, 200)[:, None], 2.0 * (a - 2.0 * b + c)
    on, way = a + 2.0 * t * (b - a) + 0.5 * t * t * bend, 2.0 * (b - a) + t * bend
    speed = np.sum(way * way, axis=1, keepdims=True)
    across = bend - way * (way @ bend)[:, None] / speed
    centre = on + across * speed / np.sum(across * across, axis=1, keepdims=True)
    off = 10.0 ** np.random.default_rng(8).uniform(-17.0, -2.0, (4, 200, 1))
    places = np.concatenate([centre, *(centre + off * [[[1.0]], [[-1.0]], [[1.0]], [[-1.0]]] * across)])
    tube, zero = rm.bezier_tube(a, b, c, 0.2), np.zeros(len(places))
    made = Operands(tube, Values({}, 0.0), "camera", whole=False)
    work = Stretch(np.arange(len(places)), np.zeros(len(places), np.int64), zero, zero)
    _, (low, high), _ = made.enclose(Rays(places, np.zeros_like(places)), work, zero)
    value = tube.distance(places)
    assert np.all((low <= value + 1e-14) & (value <= high + 1e-14))
    assert np.max(high - low) < 1e-4


def test_boxes_of_glsl_of_the_user_hold_the_values_of_its_twin() -> None:
    x = var("x", VEC3)
    waves = raw(RawFunction("waves", "", lambda p: np.sin(3.0 * p[:, 0]) * p[:, 1], 1.0, 7.0), x)
    random = np.random.default_rng(5)
    middle, half = random.uniform(-2.0, 2.0, (200, 3)), 10.0 ** random.uniform(-9.0, -0.3, (200, 1))
    with stretches(np.zeros(200), np.zeros(200)):
        found: Span = Program([waves], [x], ENCLOSURES)(still((middle - half, middle + half)))[0]
    points = middle + half * random.uniform(-1.0, 1.0, (500, 1, 3))
    values = evaluator([waves], [x])(points.reshape(-1, 3))[0].reshape(500, 200)
    assert np.all((found.low <= values) & (values <= found.high))
    assert np.all(found.high - found.low < 2.01 * 7.0 * 3.0**0.5 * half[:, 0] + 1e-7)


@pytest.mark.parametrize("limit", [1e-3, 0.3, 9.0])
def test_loops_of_boxes_hold_the_results_of_all_their_points(limit: float) -> None:
    """Of boxes that take many numbers of turns, some of them all turns."""

    def body(i: Expr, q: Expr, step: Expr) -> list[Expr]:
        after = rm.vec2(q.x - (q.x * q.x - q.y) / rm.max(2.0 * q.x, 0.1), q.y + 0.1 * rm.sin(q.x + i))
        return [after, rm.length(after - q)]

    x = var("x", VEC3)
    root, last = loop(9, [rm.vec2(x.x, x.y), x.z], body, until=lambda i, q, step: step < limit)
    result = rm.vec3(root.x, root.y, last)
    random = np.random.default_rng(9)
    middle, half = random.uniform(0.2, 3.0, (200, 3)), 10.0 ** random.uniform(-16.0, -0.5, (200, 1))
    with stretches(np.zeros(200), np.zeros(200)):
        found: Span = Program([result], [x], ENCLOSURES)(still((middle - half, middle + half)))[0]
    points = middle + half * random.uniform(-1.0, 1.0, (300, 1, 3))
    values = evaluator([result], [x])(points.reshape(-1, 3))[0].reshape(points.shape)
    assert np.all((found.low - 1e-13 <= values) & (values <= found.high + 1e-13))
    narrow = half[:, 0] < 1e-9
    assert np.median((found.high - found.low)[narrow] / half[narrow]) < 40.0
