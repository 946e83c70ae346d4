"""Light and materials against Mitsuba 3; `python -m tests.bench.reference` prints the figures."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.gpu.context import Context

sys.path.insert(0, str(Path(__file__).parents[2]))
from tests.bench.reference import SCENES, compare, ours, theirs

WIDTH = 32


@pytest.fixture(scope="module")
def mitsuba() -> Any:
    module = pytest.importorskip("mitsuba")
    module.set_variant("scalar_rgb")
    return module


@pytest.mark.parametrize("name", SCENES)
def test_our_light_is_mitsubas(name: str, mitsuba: Any, egl: Context) -> None:
    """The mean light within a percent; single pixels, where a shadow's border does not cross them, as well."""
    with rm.Renderer((WIDTH, WIDTH * 3 // 4), context=egl) as renderer:
        found = renderer.render(ours(name, WIDTH)).color
    error = compare(found, theirs(mitsuba, name, WIDTH))
    assert error.mean <= 0.01 and error.median <= 0.01, error


def test_an_error_would_be_seen(mitsuba: Any, egl: Context) -> None:
    """A picture two percent too bright, or of the other masking, is told from the right one."""
    with rm.Renderer((WIDTH, WIDTH * 3 // 4), context=egl) as renderer:
        known = theirs(mitsuba, "metal", WIDTH)
        right = ours("metal", WIDTH)
        color = renderer.render(right).color
        other = rm.Scene(right.node, right.camera, right.lights, right.sky)
        wrong = renderer.render(other).color
    assert compare(1.02 * np.asarray(color), known).mean > 0.01
    assert compare(wrong, known).median > 2 * compare(color, known).median
