"""The stops between fast and exact: from presets, and from a measured front."""

from __future__ import annotations

import json
from typing import Any

import pytest

import raymarch as rm
from raymarch.cost.settings import Setting, setting
from raymarch.cost.sweep import sweep
from raymarch.cost.text import as_json
from raymarch.errors import SceneError
from raymarch.scene.quality import PRESETS, PROMISED, Quality
from raymarch.window.accuracy import measured_stops, nearest, next_stop, preset_stops
from raymarch.window.edits import Edits
from tests.cost.cost_samples import SIZE, FakeRenderer, make_scene


def test_presets_keep_what_is_not_marching() -> None:
    own = Quality(samples=4, tracer="plain", epsilon=0.3)
    stops = preset_stops()
    assert [s.name for s in stops] == list(PRESETS) and [s.error for s in stops] == list(PROMISED.values())
    scene = rm.Scene(rm.sphere(), quality=own)
    for stop in stops:
        assert Edits(quality=stop.changes(own)).apply(scene).quality == own.to_preset(stop.name)
    assert stops[0].words == "draft: error up to 0.5 px"


def test_the_keys_go_from_stop_to_stop() -> None:
    stops = preset_stops()
    assert nearest(stops, Quality(tracer="plain")) is None
    assert next_stop(stops, Quality(tracer="plain"), 1) == 2
    assert next_stop(stops, Quality(), 1) == 2
    assert next_stop(stops, Quality.preset("exact"), 1) == 3
    assert next_stop(stops, Quality.preset("draft"), -1) == 0


@pytest.fixture(scope="module")
def stored() -> Any:
    """A measurement whose errors and times are known: epsilon pixels in 1 / epsilon milliseconds."""
    scene = make_scene()
    from raymarch.cost.reference import reference

    known = reference(scene, SIZE, samples=1)
    settings = [Setting("base", Quality()), Setting("fine", Quality.preset("fine"), preset="fine")]
    changes = ({"epsilon": 2.0}, {"epsilon": 1.9}, {"samples": 4, "epsilon": 0.5}, {"max_steps": 16})
    settings += [setting(Quality(), change) for change in changes]
    return json.loads(as_json(sweep(scene, settings, known, FakeRenderer(known), repeats=1)))


def test_a_measured_front_is_read_from_its_file(stored: Any) -> None:
    stops = measured_stops(stored)
    assert [s.name for s in stops] == ["epsilon 2", "base", "fine"]
    assert stops[0].words == "epsilon 2: error 2 px, 0.5 ms at 64x36"
    assert nearest(stops, Quality(epsilon=2.0)) == 0


@pytest.mark.parametrize("content", [[], {}, {"points": []}, {"points": [{}], "size": [1, 1]}])
def test_other_files_are_refused(content: Any) -> None:
    with pytest.raises(SceneError, match="raymarch cost --json"):
        measured_stops(content)


@pytest.mark.parametrize(
    ("name", "value"),
    [("errors", {"pixels_p99": "inf", "missed": 0, "false": 0}), ("errors", []), ("milliseconds", {"median": -1.0})],
)
def test_figures_that_are_none_are_refused(stored: Any, name: str, value: Any) -> None:
    points = [{**point, name: value} for point in stored["points"]]
    with pytest.raises(SceneError, match="these measurements cannot be used"):
        measured_stops({**stored, "points": points})


def test_a_front_without_hits_is_refused(stored: Any) -> None:
    blind = [p for p in stored["points"] if p["quality"]["max_steps"] == 16]
    with pytest.raises(SceneError, match="finds every hit"):
        measured_stops({**stored, "points": blind})
