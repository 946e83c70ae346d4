"""Light and materials against Mitsuba 3; `python -m tests.bench.reference` prints the figures."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

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
        error = compare(renderer.render(ours(name, WIDTH)), theirs(mitsuba, name, WIDTH))
    noise = 0.05 if SCENES[name].samples > 32 else 0.01  # of single pixels, in both pictures
    assert error.mean <= 0.01 and error.median <= noise, error


def test_an_error_would_be_seen(mitsuba: Any, egl: Context) -> None:
    """A picture two percent too bright, or of the other masking, is told from the right one."""
    with rm.Renderer((WIDTH, WIDTH * 3 // 4), context=egl) as renderer:
        known = theirs(mitsuba, "metal", WIDTH)
        right = ours("metal", WIDTH)
        frame = renderer.render(right)
        wrong = renderer.render(rm.Scene(right.node, right.camera, right.lights, right.sky))
        assert compare(frame, known, 1.02).mean > 0.01
        assert compare(wrong, known).median > 2 * compare(frame, known).median
