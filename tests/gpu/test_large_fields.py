"""Fields that take long to compile on a software renderer: said before it begins, and refused beyond a limit."""

from __future__ import annotations

import runpy
from collections.abc import Callable
from pathlib import Path
from unittest import mock

import numpy as np
import pytest

import raymarch as rm
from raymarch.errors import PlanError, SceneWarning
from raymarch.gpu import Renderer, resource_cache
from raymarch.gpu.context import Context
from raymarch.plan import plan


def chain(n: int) -> rm.Node:
    random, node = np.random.default_rng(1), rm.sphere(0.3)
    for i in range(n):
        node = rm.union(node, rm.sphere(0.3 + 0.001 * i).translate(tuple(random.uniform(-2, 2, 3))), k=0.1)
    return node


def star(n: int) -> rm.Node:
    a = 2 * np.pi * np.arange(n) / n
    r = 1 + 0.2 * np.cos(7 * a)
    return rm.polygon(np.stack([r * np.cos(a), r * np.sin(a)], axis=-1)).extrude(0.3)


def costly() -> rm.Node:
    """Twenty solids, each in a branch."""
    return runpy.run_path(str(Path(__file__).parents[2] / "examples/large/costly.py"))["scene"].node  # type: ignore[no-any-return]


@pytest.mark.parametrize(
    ("build", "measured"),
    [
        (lambda: chain(100), 4.5),
        (lambda: chain(200), 16.0),
        (lambda: star(50), 7.0),
        (lambda: star(100), 22.0),
        (costly, 6.5),
    ],
)
def test_the_estimate_is_near_what_was_measured(build: Callable[[], rm.Node], measured: float) -> None:
    assert 0.5 < plan(rm.Scene(build(), quality=rm.Quality(objects="text"))).compile_seconds / measured < 2.0


def test_ordinary_fields_and_loops_compile_soon() -> None:
    assert plan(rm.Scene(rm.union(rm.sphere(), rm.box(1), k=0.2))).compile_seconds < 0.1
    assert plan(rm.Scene(rm.mandelbulb())).compile_seconds < 1.0


def test_a_long_compilation_is_announced_on_the_users_line(egl: Context, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(resource_cache, "LONG", 1e-3)
    scene = rm.Scene(chain(8))
    with Renderer((8, 6), context=egl) as renderer:
        with pytest.warns(
            SceneWarning, match=r"operations in 9 shapes: compiling takes about \d+ s on .*repeat"
        ) as said:
            renderer.render(scene)
        renderer.render(scene)  # nothing is compiled, and nothing said
    assert len(said) == 1 and said[0].filename == __file__


def test_beyond_the_limit_a_field_is_refused_unless_the_limit_is_raised(
    egl: Context, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = rm.Scene(chain(300))
    with Renderer((8, 6), context=egl) as renderer:
        monkeypatch.setenv("RAYMARCH_COMPILE_LIMIT", "30")
        with (
            mock.patch(
                "raymarch.plan.stages.materials_of", side_effect=AssertionError("refused before this is planned")
            ),
            pytest.raises(PlanError, match="RAYMARCH_COMPILE_LIMIT") as caught,
        ):
            renderer.render(scene)
        assert "up to 30 s" in str(caught.value) and __file__ in str(caught.value)
        monkeypatch.setenv("RAYMARCH_COMPILE_LIMIT", "soon")
        with pytest.raises(rm.SceneError, match="'soon'"):
            renderer.render(scene)
