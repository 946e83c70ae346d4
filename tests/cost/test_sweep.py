"""Settings, medians, the front, and a sweep under a clock of our own."""

from __future__ import annotations

import itertools
import json
from dataclasses import replace

import numpy as np
import pytest

import raymarch as rm
from raymarch.cost.settings import AXES, Axis, Setting, axes, grid, parse_values
from raymarch.cost.statistics import median
from raymarch.cost.sweep import Sweep, pareto, sweep
from raymarch.cost.text import as_csv, as_dict, as_json, findings
from raymarch.errors import CostError
from tests.cost.cost_samples import FakeRenderer

# Medians


@pytest.mark.parametrize(
    ("count", "low", "high", "confidence"), [(6, 1, 6, 0.96875), (9, 2, 8, 0.9609), (25, 8, 18, 0.9567)]
)
def test_the_interval_of_a_median(count, low, high, confidence):
    """Ranks as tables of order statistics have them."""
    found = median([float(v) for v in range(count, 0, -1)])
    assert (found.low, found.high) == (low, high)
    assert found.confidence == pytest.approx(confidence, abs=1e-4)


def test_few_values_say_how_sure_they_are():
    assert median([3.0]).confidence == 0.0
    found = median([1.0, 5.0, 2.0])
    assert (found.value, found.low, found.high, found.confidence) == (2.0, 1.0, 5.0, 0.75)
    assert median([1.0, 2.0]).value == 1.5
    with pytest.raises(ValueError, match="no values"):
        median([])


def test_the_interval_holds_the_median_as_often_as_it_says():
    random = np.random.default_rng(3)
    held = 0
    for _ in range(2000):
        found = median(random.exponential(size=9).tolist())
        held += found.low <= np.log(2) <= found.high
    assert held / 2000 == pytest.approx(0.961, abs=0.015)


# The front


def test_the_front_is_what_nobody_beats():
    random = np.random.default_rng(5)
    points = [tuple(p) for p in random.integers(0, 12, (60, 2))]
    front = pareto(points, lambda p: p[0], lambda p: p[1])
    for p in points:
        beaten = any((q[0] <= p[0] and q[1] < p[1]) or (q[0] < p[0] and q[1] <= p[1]) for q in points)
        assert beaten != (p in front)
    assert [p[0] for p in front] == sorted({p[0] for p in front})


def test_nan_is_never_on_the_front():
    points = [(1.0, float("nan")), (2.0, 1.0), (float("nan"), 0.0)]
    assert pareto(points, lambda p: p[0], lambda p: p[1]) == [(2.0, 1.0)]


# Settings


def test_the_grid_has_the_base_first_and_no_setting_twice(scene):
    found = grid(scene, axes())
    assert found[0].name == "base"
    assert found[0].quality == scene.quality
    drawn = {(s.quality, s.frames, s.scale, s.variations) for s in found}
    assert len(drawn) == len(found) == len({s.name for s in found})
    tracers = {(s.quality.tracer, s.quality.max_steps) for s in found}
    assert {("plain", 16), ("bracketing", 128)} <= tracers
    assert any(s.quality.epsilon == 2.0 and s.quality.tracer == "auto" for s in found)


def test_what_comes_to_the_same_is_tried_once():
    estimate = rm.Scene(rm.mandelbulb())
    names = [s.name for s in grid(estimate, [Axis("tracer", ("plain", "bracketing", "relaxed"), crossed=True)])]
    assert names == ["base", "draft", "fine", "exact", "plain"]


def test_crossed_axes_are_combined(scene):
    asked = axes(["epsilon", "normals"], {"epsilon": (1.5, 2.0)})
    found = {(s.quality.epsilon, s.quality.normals) for s in grid(scene, asked) if s.name.startswith("epsilon")}
    assert found == set(itertools.product((1.5, 2.0), rm.scene.quality.NORMALS))


def test_refused_combinations_are_left_out(scene):
    found = grid(scene, axes(["tracer", "omega"], {"omega": (0.5, 1.5)}))
    assert {(s.quality.tracer, s.quality.omega) for s in found if not s.preset} == {("relaxed", 1.5), ("enhanced", 0.5)}


def test_every_default_axis_is_legal_where_there_is_such_a_field():
    names = list(rm.Quality.__dataclass_fields__)
    for axis in AXES:
        if axis.name in names:
            assert parse_values(axis.name, ",".join(map(str, axis.values))) == axis.values


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: axes(["speed"]), "speed"),
        (lambda: axes(None, {"speed": (1,)}), "speed"),
        (lambda: axes(["omega"]), "without values"),
        (lambda: parse_values("max_steps", "16,0"), "1 to 60000"),
        (lambda: parse_values("tracer", "fast"), "auto_relaxed"),
        (lambda: parse_values("tracer", " , "), "without values"),
        (lambda: parse_values("speed", "1"), "epsilon"),
    ],
)
def test_wrong_axes_are_refused(call, says):
    with pytest.raises(CostError, match=says):
        call()


# A sweep with a renderer and a clock of our own


def fake_sweep(scene, known, repeats=9, seed=1) -> tuple[Sweep, FakeRenderer]:
    base = rm.Quality(epsilon=4.0)
    qualities = [base, replace(base, epsilon=1.0), replace(base, epsilon=2.0), replace(base, max_steps=16)]
    qualities.append(replace(base, normals="central"))
    settings = [Setting(str(i), q) for i, q in enumerate(qualities)]
    renderer = FakeRenderer(known)
    return sweep(scene, settings, known, renderer, repeats=repeats, seed=seed), renderer


def test_first_frames_are_no_part_of_the_time(scene, known):
    made, _ = fake_sweep(scene, known)
    assert [p.time.value for p in made.points] == pytest.approx([0.25, 1, 0.5, 0.25, 0.25])
    assert [(p.first_ms, p.compile_ms) for p in made.points] == [(1000.0, 30.0)] * 5


def test_the_settings_take_turns_in_random_order(scene, known):
    orders = []
    for seed in (1, 1, 2):
        _, renderer = fake_sweep(scene, known, seed=seed)
        timed = renderer.calls[-45:]
        turns = [timed[i : i + 5] for i in range(0, 45, 5)]
        assert all(len(set(turn)) == 5 for turn in turns)
        assert len({tuple(turn) for turn in turns}) > 4
        orders.append(timed)
    assert orders[0] == orders[1] != orders[2]


def test_programs_are_kept_so_that_no_turn_compiles(scene, known):
    _, renderer = fake_sweep(scene, known)
    assert renderer.kept >= 20


def test_missed_hits_are_never_traded(scene, known):
    made, _ = fake_sweep(scene, known)
    assert [p.name for p in made.front()] == ["0", "2", "1"]
    assert made.points[3].error("pixels_p99") == np.inf
    assert any("1 settings have missed" in line for line in findings(made))


def test_json_is_complete_and_plain(scene, known):
    made, _ = fake_sweep(scene, known)
    data = json.loads(as_json(made))
    assert data == json.loads(json.dumps(as_dict(made)))
    assert data["environment"]["driver"]["renderer"] == "ours"
    assert {"date", "clock", "versions", "machine"} <= data["environment"].keys()
    assert (data["seed"], data["repeats"], data["size"]) == (1, 9, list(known.size))
    point = data["points"][1]
    assert point["on_front"]
    assert point["quality"]["epsilon"] == 1.0
    assert point["errors"]["pixels_p99"] == pytest.approx(1.0)
    assert point["milliseconds"]["confidence"] >= 0.95
    assert len(point["milliseconds"]["all"]) == 9
    assert data["points"][3]["errors"]["pixels_p99"] is None


def test_csv_has_a_line_for_each_setting(scene, known):
    made, _ = fake_sweep(scene, known)
    lines = as_csv(made).splitlines()
    assert len(lines) == 6
    assert {"name", "errors.pixels_p99", "milliseconds.median", "quality.tracer"} <= set(lines[0].split(","))


@pytest.mark.parametrize(("settings", "repeats"), [(0, 9), (1, 0)])
def test_nothing_to_measure_is_refused(scene, known, settings, repeats):
    some = [Setting("base", rm.Quality())][:settings]
    with pytest.raises(ValueError, match="at least one"):
        sweep(scene, some, known, FakeRenderer(known), repeats=repeats)
