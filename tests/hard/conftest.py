"""The suite is a folder of modules that are run as commands too: `python -m tests.hard.table`."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from raymarch.gpu.context import Context

sys.path.insert(0, str(Path(__file__).parents[2]))

from tests.hard.world import World


@pytest.fixture(scope="session")
def world(egl: Context) -> Iterator[World]:
    with World(egl) as made:
        yield made
