"""The suite is a folder of modules that are run as commands too: `python -m tests.hard.table`."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from raymarch.gpu.context import Context
from tests.hard.world import World


@pytest.fixture(scope="session")
def world(egl: Context) -> Iterator[World]:
    with World(egl) as made:
        yield made
