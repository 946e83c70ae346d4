"""Presets, --error and --within: what is claimed is held against the truth here once more."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

import raymarch as rm
from raymarch.cost import search as searching
from raymarch.cost.errors import check_followed, measure
from raymarch.cost.reference import reference
from raymarch.cost.search import LADDER, REPEATS, for_error, for_time, parse_error, parse_time
from raymarch.cost.settings import grid
from raymarch.errors import CostError, SceneError
from raymarch.plan.presets import meanings
from raymarch.scene.quality import PRESETS, PROMISED
from tests.cost.cost_samples import SIZE, FakeRenderer

# Presets


def test_each_preset_promises_less_error_than_the_one_before():
    assert list(PRESETS) == list(PROMISED) == ["draft", "normal", "fine", "exact"]
    assert sorted(PROMISED.values(), reverse=True) == list(PROMISED.values())
    nearness = [rm.Quality.preset(name).near(refined=True) for name in PRESETS]
    assert sorted(nearness, reverse=True) == nearness
    assert rm.Quality.preset("normal") == rm.Quality()


def test_an_unknown_preset_is_refused():
    with pytest.raises(SceneError, match="'draft', 'normal', 'fine', 'exact'"):
        rm.Quality.preset("best")


def test_a_preset_changes_the_marching_alone():
    own = rm.Quality(
        integrator="whitted", samples=4, temporal="accumulate", masking="separable", tracer="plain", epsilon=2
    )
    own = replace(own, rays="interpolated", shadow_steps=9, light_samples=3, assume_certified=True)
    fine = rm.Quality.preset("fine")
    kept = {
        "integrator": "whitted",
        "samples": 4,
        "temporal": "accumulate",
        "masking": "separable",
        "rays": "interpolated",
    }
    assert own.to_preset("fine") == replace(fine, **kept, shadow_steps=9, light_samples=3, assume_certified=True)
    assert replace(rm.Quality(), steps_per_pass=64).to_preset("fine") == replace(fine, steps_per_pass=64)
    assert rm.Quality(tracer="plain").to_preset("normal") == rm.Quality()
    scene = rm.Scene(rm.sphere(), quality=own.to_preset("fine"))
    assert [m.name for m in meanings(scene) if m.own] == ["fine"]
    assert {s.quality for s in grid(scene, [], SIZE) if s.preset} == {own.to_preset(name) for name in PRESETS}


def test_presets_keep_their_promise_where_every_pixel_has_an_edge():
    scene, size = rm.Scene(rm.gyroid() & rm.sphere(2)), (128, 72)
    known = reference(scene, size, samples=0)
    assert known.edge_width < 1.0
    with rm.Renderer(size) as renderer:
        for name, promised in PROMISED.items():
            frame = renderer.render(scene.replace(quality=rm.Quality.preset(name)), outputs=("depth",))
            reached = measure(known, frame.depth)
            assert reached.apart, name
            assert reached.sound, name
            assert reached.pixels_p99 <= promised, name


# Targets


@pytest.mark.parametrize(
    ("text", "meant"),
    [
        ("0.5px", ("pixels_p99", 0.5)),
        ("0.5", ("pixels_p99", 0.5)),
        (0.5, ("pixels_p99", 0.5)),
        (" 2 px", ("pixels_p99", 2.0)),
        (".25px", ("pixels_p99", 0.25)),
        ("1e-3px", ("pixels_p99", 1e-3)),
        ("flip:0.05", ("flip_p99", 0.05)),
    ],
)
def test_an_error_is_read(text, meant):
    assert parse_error(text) == meant


@pytest.mark.parametrize("text", ["", "px", "0px", "-1px", "flip", "flip:0", "flip:2", "flip:0.1px", "nanpx"])
def test_no_error_is_refused(text):
    with pytest.raises(CostError, match=re.escape(repr(text))):
        parse_error(text)


def test_a_time_is_read():
    assert [parse_time(t) for t in ("16ms", "16", 16, "0.5 ms", "1.5s")] == [16, 16, 16, 0.5, 1500]
    for text in ("", "ms", "0ms", "-3ms", "fast", "16 hours"):
        with pytest.raises(CostError, match="16ms"):
            parse_time(text)


@pytest.mark.parametrize(
    ("use", "what"),
    [
        (lambda given: for_error(given, "1px"), "for_error"),
        (lambda given: rm.Quality.for_time(given, "1ms"), "for_time"),
    ],
)
def test_a_node_is_no_scene(use, what):
    with pytest.raises(SceneError, match=rf"{what} of <sphere.*\(\w*\) \(a Scene\)"):
        use(rm.sphere())


# With errors and times that are known


@pytest.fixture
def few_tracers(monkeypatch):
    """Known errors and times are those of an epsilon; all tracers and schedules are tried in earnest below."""
    monkeypatch.setattr(searching, "TRACERS", ("auto", "plain"))
    monkeypatch.setattr(searching, "SCHEDULES", ("single",))


@pytest.mark.usefixtures("few_tracers")
@pytest.mark.parametrize(("target", "epsilon"), [("2.1px", 2.0), ("0.3px", 0.2), ("0.05px", 0.05), ("0.003px", 0.002)])
def test_the_fastest_that_keeps_the_error(scene, known, target, epsilon):
    found = for_error(scene, target, SIZE, renderer=FakeRenderer(known))
    assert found.quality.epsilon == epsilon
    assert found.error == pytest.approx(epsilon)
    assert found.time.value == pytest.approx(1 / epsilon)


@pytest.mark.usefixtures("few_tracers")
@pytest.mark.parametrize(("target", "epsilon"), [("0.5ms", 2.0), ("12ms", 0.1), ("999ms", 0.002)])
def test_the_most_exact_that_keeps_the_time(scene, known, target, epsilon):
    found = for_time(scene, target, SIZE, renderer=FakeRenderer(known))
    assert found.quality.epsilon == epsilon
    assert found.time.value <= parse_time(target)


@pytest.mark.usefixtures("few_tracers")
def test_what_nothing_keeps_is_refused_with_the_best(scene, known):
    with pytest.raises(CostError, match=r"within 0\.002 px"):
        for_error(scene, "0.001px", SIZE, renderer=FakeRenderer(known))
    with pytest.raises(CostError, match=r"in 0\.4 ms.*epsilon 2, takes 0\.5"):
        for_time(scene, "0.4ms", SIZE, renderer=FakeRenderer(known))


@pytest.mark.usefixtures("few_tracers")
def test_a_picture_must_keep_the_error_with_what_the_truth_may_be_off_by(scene, known, monkeypatch):
    """The renderer draws the true picture itself, so that all of the error is the truth's."""
    renderer = FakeRenderer(known)
    doubt = {4: 0.2, 16: 0.1}
    monkeypatch.setattr(searching, "TRUTH_SAMPLES", tuple(doubt))
    monkeypatch.setattr(searching, "picture_doubt", lambda found: doubt[found.samples])
    asked = []
    monkeypatch.setattr(searching, "reference", lambda *args: asked.append(args[4]) or replace(known, samples=args[4]))
    assert for_error(scene, "flip:0.7", SIZE, renderer=renderer).error == pytest.approx(0.2)
    assert asked == [4]
    assert for_error(scene, "flip:0.3", SIZE, renderer=renderer).error == pytest.approx(0.1)
    assert asked == [4, 4, 16]
    with pytest.raises(CostError, match=r"has a noise of FLIP 0\.1"):
        for_error(scene, "flip:0.09", SIZE, renderer=renderer)


@pytest.mark.usefixtures("few_tracers")
@pytest.mark.parametrize(("search", "target"), [(for_error, "0.3px"), (for_time, "12ms")])
def test_the_rays_a_pixel_of_the_scene_are_measured_and_kept(scene, known, search, target):
    renderer = FakeRenderer(known)
    found = search(scene.replace(quality=rm.Quality(samples=3)), target, SIZE, renderer=renderer)
    assert found.quality.samples == 3
    assert {q.samples for q in renderer.calls} == {3}
    assert "samples" not in found.name


@pytest.mark.usefixtures("few_tracers")
def test_a_picture_takes_no_fewer_rays_than_the_scene(scene, known, monkeypatch):
    monkeypatch.setattr(searching, "TRUTH_SAMPLES", (4,))  # how many the reference takes is tested above
    renderer = FakeRenderer(known)
    found = for_error(scene.replace(quality=rm.Quality(samples=5)), "flip:0.5", SIZE, renderer=renderer)
    assert found.quality.samples == 5
    with pytest.raises(CostError):
        for_error(scene.replace(quality=rm.Quality(steps_per_pass=64)), "flip:1e-9", SIZE, renderer=renderer)


@pytest.mark.usefixtures("few_tracers")
def test_there_is_no_true_picture_of_light_that_goes_random_ways(known):
    def glass(integrator):
        return rm.Scene(rm.sphere().material(rm.Material(transmission=1.0)), quality=rm.Quality(integrator=integrator))

    with pytest.raises(CostError, match=r"no path tracer.*integrator='whitted'.*in pixels"):
        for_error(glass("path"), "flip:0.5", SIZE, renderer=FakeRenderer(known))
    for_error(glass("path"), "0.3px", SIZE, renderer=FakeRenderer(reference(glass("path"), SIZE, samples=0)))
    check_followed(glass("whitted"))


class Blind(FakeRenderer):
    """Misses hits wherever epsilon is above a tenth."""

    def render(self, scene, time=0.0, params=None, outputs=("color",)):
        lost = scene.quality.near(refined=True) > 0.1
        seen = scene.replace(quality=replace(scene.quality, max_steps=16)) if lost else scene
        return super().render(seen, time, params, outputs)


@pytest.mark.usefixtures("few_tracers")
def test_missed_hits_are_never_traded(scene, known):
    assert for_error(scene, "2px", SIZE, renderer=Blind(known)).quality.epsilon == 0.1
    assert for_time(scene, "20ms", SIZE, renderer=Blind(known)).quality.epsilon in (0.1, 0.05)
    with pytest.raises(CostError, match="finds every hit"):
        for_time(scene, "9ms", SIZE, renderer=Blind(known))


class Late(FakeRenderer):
    """Slower once the sweep is over."""

    def render(self, scene, time=0.0, params=None, outputs=("color",)):
        frame = super().render(scene, time, params, outputs)
        if len(self.calls) > (REPEATS + 2) * len(LADDER):
            frame.milliseconds *= 1.5
        return frame


@pytest.mark.usefixtures("few_tracers")
def test_a_time_that_is_not_kept_a_second_time_is_given_up(scene, known):
    found = for_time(scene, "12ms", SIZE, renderer=Late(known))
    assert found.quality.epsilon == 0.2
    assert found.time.value == pytest.approx(7.5)


# In earnest

SCENES = {
    "twist": lambda: rm.Scene(rm.box((0.8, 2, 0.8)).twist(1.2)),
    "gyroid": lambda: rm.Scene(rm.gyroid() & rm.sphere(2)),
    "floor": lambda: rm.Scene(rm.ellipsoid() | rm.plane(offset=-1.2)),
}


FEW = (2.0, 0.5, 0.1, 0.02, 0.004)
"""Every second epsilon: fewer programs to compile."""


def try_few(monkeypatch):
    """Fewer settings: each compiles its programs."""
    monkeypatch.setattr(searching, "LADDER", FEW)
    monkeypatch.setattr(searching, "TRACERS", ("auto", "plain"))
    monkeypatch.setattr(searching, "SCHEDULES", ("single",))


@pytest.mark.parametrize("target", ["1px", "0.005px"])
@pytest.mark.parametrize("name", SCENES)
def test_the_error_is_kept(name, target, monkeypatch):
    """With all epsilons, tracers and schedules for one scene; with fewer for the others."""
    if name != "floor":
        try_few(monkeypatch)
    scene, size = SCENES[name](), (64, 36)
    found = for_error(scene, target, size)
    known = reference(scene, size, samples=0)
    with rm.Renderer(size) as renderer:
        depth = renderer.render(scene.replace(quality=found.quality), outputs=("depth",)).depth
    reached = measure(known, depth)
    assert reached.sound
    assert reached.pixels_p99 <= parse_error(target)[1]
    assert reached.pixels_p99 == found.error
    assert f"{found.error:.3g} px" in found.words


def test_by_the_picture(monkeypatch):
    try_few(monkeypatch)
    scene, size = rm.Scene(rm.sphere()), (48, 27)
    loose, tight = for_error(scene, "flip:0.5", size), None
    assert loose.metric == "flip_p99"
    assert loose.error <= 0.5
    assert 0.0 < loose.doubt < loose.error
    assert "uncertainty of the reference" in loose.words
    with pytest.raises(CostError, match="reference picture has a noise of FLIP"):
        tight = for_error(scene, "flip:0.00001", size)
    assert tight is None


def test_quality_asks_whoever_measures(scene, monkeypatch):
    monkeypatch.setattr(searching, "LADDER", FEW)
    found = rm.Quality.for_error(scene, "0.5px", size=SIZE)
    assert isinstance(found, rm.Quality)
    assert found.near(refined=True) >= 0.5
    slow = rm.Quality.for_time(scene, "60s", size=SIZE)
    assert slow.near(refined=True) <= 0.01
    with pytest.raises(CostError, match=r"'1em' \(a distance in pixels"):
        rm.Quality.for_error(scene, "1em")


def test_an_estimate_that_shows_nothing_off_silhouettes(monkeypatch):
    try_few(monkeypatch)
    monkeypatch.setattr(searching, "LADDER", (2.0, 0.1))
    scene = rm.Scene(rm.mandelbulb(), camera=rm.Camera(position=(1.2, 1, 1.6), target=(0, 0, 0)))
    found = for_time(scene, "60s", (48, 27))
    assert np.isfinite(found.error)
    assert "with silhouettes" in found.words


def test_an_empty_picture_has_no_error(monkeypatch):
    try_few(monkeypatch)
    away = rm.Scene(rm.sphere(), camera=rm.Camera(position=(0, 0, 5), target=(0, 0, 9)))
    assert for_error(away, "0.5px", (16, 9)).error == 0.0
