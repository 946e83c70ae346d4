"""Samples of what runs for long as a command: watertight solids, a soak, and seeded faults."""

from __future__ import annotations

import ast
import sys

import pytest

from raymarch import glsl
from tests.hard.world import World
from tests.lab import glsl_faults, python_faults
from tests.lab.seeded import reads, replace_code, tree_of
from tests.lab.soak import soak
from tests.lab.watertight import Count, shoot


@pytest.mark.parametrize("first", [1, 51])
def test_no_ray_goes_through_a_closed_solid(world: World, first: int) -> None:
    """Four solids are shot at. Estimates are passed over: which seeds make one changes with every new shape."""
    count, size = Count(), (64, 48)
    for seed in range(first, first + 50):
        if count.rays < 4 * size[0] * size[1]:
            shoot(world, seed, size, count)
    assert count.rays == 4 * size[0] * size[1]
    assert count.hits > 1000 and count.lost == 0
    assert count.grazing <= 0.01 * count.hits


def test_nothing_grows(world: World) -> None:
    before, after = soak(world, 16)
    assert after.objects <= before.objects + 30  # programs: caches are full after 32 of them
    assert after.files <= before.files


def test_a_seeded_fault_is_read_while_it_lasts() -> None:
    fault = next(glsl_faults.faults_of("march/enclosing"))
    before = glsl.load(fault.module).lines
    with reads(fault.file, fault.number, fault.text):
        spoiled = glsl.load(fault.module).lines
    assert spoiled != before and spoiled[fault.number - 1] == fault.text
    assert glsl.load(fault.module).lines == before


def test_a_function_gets_the_code_of_another_tree() -> None:
    tree = tree_of(sys.modules[__name__])
    next(value for value in ast.walk(tree) if isinstance(value, ast.Constant) and value.value == 41).value = 42
    replace_code(sys.modules[__name__], tree, ["to_spoil"])
    assert to_spoil() == 42


def to_spoil() -> int:
    return 41


def test_nearly_all_faults_of_the_ledgers_are_noticed() -> None:
    """If this fails after an edit of GLSL: python -m tests.lab.glsl_faults asks about the lines that are new."""
    known = glsl_faults.ledger()
    names = {fault.name for fault in glsl_faults.every([])}
    assert len(names & set(known["noticed"])) >= 0.9 * len(names)
    assert set(known["none"]) <= set(known["noticed"])
    for ledger, share in ((known, glsl_faults.NOTICED), (python_faults.ledger(), 0.99)):
        noticed, _, missed = glsl_faults.counts(ledger)
        assert noticed >= share * (noticed + missed)
