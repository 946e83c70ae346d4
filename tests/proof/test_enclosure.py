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
from raymarch.expr.node import Expr, var
from raymarch.expr.types import VEC3
from raymarch.expr.walk import find
from raymarch.proof.enclosure import ENCLOSURES
from raymarch.proof.rays import Rays
from raymarch.proof.span import Span, jumping, stretches
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


@pytest.mark.parametrize("part", [0.0, 0.25, 0.5])
def test_the_hash_of_one_cell_is_one_number(part: float) -> None:
    """Also of a cell and a half, which lies on the border of two."""
    shot, start, end = Rays(np.zeros((3, 3)), np.eye(3)), np.zeros(3), np.full(3, 0.4)
    with stretches(0.5 * end, 0.5 * end):
        body = rm.hash(rm.floor(P + 7.25) + part)
        found: Span = Program([body], [P], ENCLOSURES)(shot.points(np.arange(3), start, end, 0.5 * end))[0]
    assert np.all(found.low == found.high)
