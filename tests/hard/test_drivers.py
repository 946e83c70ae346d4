"""What must not depend on the driver's threads, or on which of the contexts draws."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from collections.abc import Iterator

import pytest

from tests.hard.table import cases
from tests.hard.world import Case, World
from tests.support.required import opened

DRAW = """
import sys
import raymarch as rm
node = rm.union(rm.box((1, 0.6, 0.8)).rotate(0.4, "y"), rm.torus(0.7, 0.15), k=0.1) | rm.plane(offset=-0.6)
quality = rm.Quality(samples=2)
scene = rm.Scene(node, rm.Camera((2, 1.5, 3), (0, 0, 0)), [rm.Sun((1, 2, 1), shadow=True)], quality=quality)
with rm.Renderer((96, 64)) as renderer:
    frame = renderer.render(scene, outputs=("color", "depth", "normal", "iterations"))
for name in ("color", "depth", "normal", "iterations"):
    sys.stdout.buffer.write(frame.array(name).tobytes())
"""

ROWS = (1, 3, 27, 45, 48, 58)
"""Rows that draw little and look at rays, histories and tiles."""


def test_threads_change_no_byte() -> None:
    """llvmpipe shares a picture out among its threads."""
    drawn = set()
    for threads in ("0", "1", "2"):
        known = {**os.environ, "LP_NUM_THREADS": threads}
        drawn.add(
            hashlib.sha256(
                subprocess.run([sys.executable, "-c", DRAW], env=known, check=True, capture_output=True).stdout
            ).hexdigest()
        )
    assert len(drawn) == 1


@pytest.fixture(scope="module")
def other_world() -> Iterator[World]:
    with opened("osmesa") as context, World(context) as made:
        yield made


@pytest.mark.parametrize("case", [case for case in cases() if case.row in ROWS], ids=lambda case: case.id)
def test_a_row_holds_on_osmesa(case: Case, other_world: World) -> None:
    for figure in case.measure(other_world):
        assert figure.holds, f"{figure.quantity}: {figure.measured:g}, at most {figure.limit:g} ({figure.because})"
