"""Faults that the report must find by itself: a tracer that stops too soon, a clock that lies."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.cost.checks import check, check_clock
from raymarch.cost.settings import Setting
from raymarch.cost.sweep import Sweep, sweep
from raymarch.cost.text import findings
from raymarch.gpu import prepare
from raymarch.scene import quality
from tests.cost.cost_samples import SIZE

SETTINGS = [
    Setting("base", rm.Quality()),
    *(Setting(name, rm.Quality(tracer=name)) for name in quality.TRACERS if name != "auto"),
    *(Setting(f"epsilon {e}", rm.Quality(epsilon=e)) for e in (2.0, 0.5, 0.01)),
    *(Setting(f"refinement {name}", rm.Quality(refinement=name)) for name in quality.REFINEMENTS),
    Setting("few steps", rm.Quality(max_steps=12)),
]


def measured(scene: Any, known: Any, settings: list[Setting], renderer: Any) -> tuple[Sweep, Any]:
    made = sweep(scene, settings, known, renderer, repeats=1)
    made.checks = check(made, scene, renderer)
    return made, [c for c in made.checks if not c.holds and c.name != "clock"]


@pytest.fixture
def renderer():
    with rm.Renderer(SIZE) as made:
        yield made


def test_what_is_sound_passes(scene, known, renderer):
    made, failed = measured(scene, known, SETTINGS, renderer)
    assert not failed, failed
    assert [c.name for c in made.checks] == ["clock", "frame times", "hits"]


@pytest.mark.parametrize("epsilon", [0.01, 0.1, 1.0])
@pytest.mark.parametrize("tracer", ["plain", "auto_relaxed", "bracketing"])
def test_a_tracer_that_stops_at_ten_times_epsilon(scene, known, renderer, monkeypatch, tracer, epsilon):
    right = prepare.assemble

    def wrong(plan, **given):
        made = right(plan, **given)
        near = plan.scene.quality.near(plan.refined)
        changed = [
            type(line)(line.text.replace(f"epsilon_pixels = {near:g}", f"epsilon_pixels = {10 * near:g}"), line.made_by)
            for line in made.body
        ]
        assert [line.text for line in changed] != [line.text for line in made.body]
        return dataclasses.replace(made, body=tuple(changed))

    settings = [Setting("planted", rm.Quality(tracer=tracer, epsilon=epsilon))]
    assert not measured(scene, known, settings, renderer)[1]
    monkeypatch.setattr(prepare, "assemble", wrong)
    renderer._prepared.clear()
    made, failed = measured(scene, known, settings, renderer)
    assert [c.name for c in failed] == ["hits of planted"]
    assert any("CHECK FAILED, hits of planted" in line for line in findings(made))


def test_a_step_that_is_not_asked_is_held_to_where_it_began(scene, known, renderer):
    """With "slope" a hit may lie deeper than epsilon, but not without a sample within epsilon before it."""
    slope = rm.Quality(refinement="slope", epsilon=2.0)
    point = sweep(scene, [Setting("slope", slope)], known, renderer, repeats=1).points[0]
    assert point.errors.pixels_max > 4.0, "some hit lies deep"
    made, failed = measured(scene, known, [Setting("slope", slope)], renderer)
    assert not failed
    early = made.points[0]
    early.depth = np.where(np.isfinite(early.depth), 0.8 * early.depth, early.depth)
    assert [c.name for c in check(made, scene, renderer) if not c.holds and c.name != "clock"] == ["hits of slope"]


@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_a_clock_that_lies_by_a_factor_of_two(renderer, factor):
    honest = renderer.clock.time
    liar = SimpleNamespace(context=renderer.context, clock=SimpleNamespace(kind="gpu timer"))
    liar.clock.time = lambda draw: factor * honest(draw)
    found = check_clock(liar)
    assert not found.holds
    assert "wall clock" in found.words


def test_an_honest_clock_is_believed(renderer):
    """The wall clock inside a wall clock: it can only be too restless a machine that stands against it."""
    found = check_clock(renderer)
    assert found.holds or "could not distinguish" in found.words


def test_frames_that_claim_more_time_than_passed(scene, known, renderer, monkeypatch):
    honest = renderer.clock.time
    monkeypatch.setattr(renderer.clock, "time", lambda draw: 1e4 + honest(draw))
    _, failed = measured(scene, known, SETTINGS[:1], renderer)
    assert [c.name for c in failed] == ["frame times"]
