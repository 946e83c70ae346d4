"""Some of the seeded faults: the tests of every node must notice them. All of them: python -m tests.lab.node_faults."""

from __future__ import annotations

import pytest

from raymarch.expr.node import var
from raymarch.expr.types import FLOAT
from raymarch.expr.vocabulary import max, sqrt
from tests.lab.mutation import replaced
from tests.lab.node_faults import faults_of, run, shares, subject, verdict
from tests.support.node_samples import definitions

SOME = (
    "smooth_union",
    "polar_sectors",
    "box",
    "torus",
    "repeat_cells",
    "twist_about_y",
    "straight_extrusion",
    "pyramid",
    "moon",
    "scale_axes",
)


def test_faults_are_noticed() -> None:
    shown: list[str] = []
    found = run(list(SOME), 1, shown.append)
    seeded, promise, caught = shares(found)
    assert seeded >= 40, shown
    assert caught >= 0.95 * seeded, found["missed"]
    assert promise >= 0.85 * seeded, found["record"]
    assert set(found["kinds"]) == {"claim", "clamp", "factor", "lipschitz", "look-up", "margin", "sign"}


@pytest.mark.parametrize("name", ["sphere", "polar_sectors"])
def test_what_is_right_passes(name: str) -> None:
    """Without a fault no check may fail, and when a fault is over nothing of it is left."""
    definition = next(d for d in definitions() if d.name == name)
    about = subject(definition)
    before = [s.node.glsl() for s in about.seen]
    for fault in list(faults_of(about, 1))[:2]:
        verdict(fault, about)
    after = subject(definition)
    assert [s.node.glsl() for s in after.seen] == before
    assert [s.means for s in after.seen] == [s.means for s in about.seen]


def test_one_operation_is_replaced() -> None:
    a, b = var("a", FLOAT), var("b", FLOAT)
    inner = max(a, b)
    assert replaced(sqrt(inner) + inner, inner, lambda args: args[0]) is sqrt(a) + a
