"""Samples of what runs for long as a command: watertight solids, a soak, and the tests on seeded faults."""

from __future__ import annotations

import pytest

from tests.hard.world import World
from tests.lab.seeded import FUNCTIONS, ROOT, TESTS, files_on_functions
from tests.lab.soak import soak
from tests.lab.watertight import Count, shoot


@pytest.mark.parametrize("seeds", [(1, 2, 3, 4), (5, 6, 7, 8)], ids=["1-4", "5-8"])
def test_no_ray_goes_through_a_closed_solid(world: World, seeds: tuple[int, ...]) -> None:
    count = Count()
    for seed in seeds:
        shoot(world, seed, (64, 48), count)
    assert count.hits > 1000 and count.lost == 0
    assert count.grazing <= 0.01 * count.hits


def test_nothing_grows(world: World) -> None:
    before, after = soak(world, 16)
    assert after.objects <= before.objects + 30  # programs: caches are full after 32 of them
    assert after.files <= before.files


def test_the_tests_on_seeded_faults_exist() -> None:
    for folder in FUNCTIONS:
        for file in (*TESTS[folder], *files_on_functions(folder)):
            assert (ROOT / "tests" / file).is_file(), file
