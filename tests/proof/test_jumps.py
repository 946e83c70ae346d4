"""Enclosures of stretches over jumps: floors, choices of a neighbour and cuts of angles."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.expr.evaluate import Program
from raymarch.expr.node import Expr, var
from raymarch.expr.types import VEC3
from raymarch.proof.enclosure import ENCLOSURES
from raymarch.proof.parts import Operands
from raymarch.proof.rays import Rays, Stretch
from raymarch.proof.span import jumping, stretches
from raymarch.scene.parameter import Values


def test_operations_that_jump_keep_their_numbers() -> None:
    """Where a choice falls on a constant for all stretches, the operation behind it does not jump, but is counted."""
    p = var("p", VEC3)
    chosen: Expr = rm.where(p.x < 0.0, 0.3, p.x)
    program = Program(
        [rm.floor(chosen) + rm.fract(p.y) + rm.mod(chosen, 0.7) + rm.atan2(chosen, chosen)], [p], ENCLOSURES
    )
    counts = []
    for first in (-5.0, -0.5, 0.5):
        origins, zero = np.array([[first, 0.2, 0.1]]), np.zeros(1)
        with stretches(zero, zero + 0.1), jumping() as jumps:
            program(Rays(origins, np.array([[1.0, 0.0, 0.0]])).points(np.zeros(1, np.int64), zero, zero + 0.1, zero))
        counts.append(len(jumps))
    assert counts == [counts[0]] * 3 and counts[0] == 5


def tower(cell: Any) -> rm.Node:
    return rm.box((0.4, 0.5 + rm.hash(cell), 0.6))


@pytest.mark.parametrize(
    "node",
    [
        rm.repeat_varied(tower, (1.0, None, 1.0), (7, 1, 7)),
        rm.star(7, 0.8).extrude(0.4).repeat((2.0, 2.1, None), (3, 3, 1)),
        rm.box((0.3, 0.2, 0.5)).translate((0.7, 0.0, 0.0)).polar(5),
    ],
    ids=lambda node: node.name,
)
def test_both_sides_of_jumps_hold_the_field(node: rm.Node) -> None:
    """Short stretches over jumps: those of cells, of which neighbour is nearer, and of angles."""
    random = np.random.default_rng(5)
    n, steps = 3000, 9
    origins = random.uniform(-1.5, 1.5, (n, 3))
    directions = random.normal(size=(n, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    end = np.exp2(random.uniform(-12, 0, n))
    operands = Operands(node, Values({}, 0.0), "camera", whole=False)
    at = Stretch(np.arange(n), np.zeros(n, np.int64), np.zeros(n), end)
    range_, middle, _ = operands.enclose(Rays(origins, directions), at, 0.5 * end)
    points = origins + (end * np.linspace(0, 1, steps)[:, None])[..., None] * directions
    values = node.distance(points.reshape(-1, 3)).reshape(steps, n)
    noise = 1e-12
    assert ((range_[0] <= values.min(axis=0) + noise) & (range_[1] >= values.max(axis=0) - noise)).all()
    assert ((middle[0] <= values[steps // 2] + noise) & (middle[1] >= values[steps // 2] - noise)).all()
    narrow = range_[1] - range_[0] < 4.0 * end
    assert np.mean(narrow) > 0.9, np.mean(narrow)
