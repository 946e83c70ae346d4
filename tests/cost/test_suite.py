"""The comparison over three scenes: its arithmetic with known errors and times, and one small run in earnest."""

from __future__ import annotations

import re
from copy import deepcopy
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from raymarch.cost.checks import Check
from raymarch.cost.plots import blank, plain_ticks, save
from raymarch.cost.reference import Reference, reference
from raymarch.cost.sweep import sweep
from raymarch.errors import CostError
from raymarch.gpu.renderer import Renderer
from tests.cost.cost_samples import SIZE, FakeRenderer, make_scene
from tests.lab import accuracy, suite, suite_plots
from tests.lab.accuracy import claims, page
from tests.lab.suite import (
    SCENES,
    TRACERS,
    Measured,
    Scale,
    Suite,
    count_as_published,
    find_scenes,
    key,
    march_settings,
    product_settings,
)
from tests.lab.suite_plots import figure_3, figure_5, fronts

SCALE = Scale((64, 36), 6, (8, 64, 128), ("plain", "enhanced"), (64, 128))
ERRORS = dict(zip(TRACERS, (4.0, 3.0, 3.0, 2.0, 1.5, 1.0, 0.5), strict=True))
TIMES = {"single": 10.0, "two": 8.0, "four": 12.0, "six": 13.0, "cone": 6.0}


def known_suite(scene, known) -> Suite:
    """Errors by tracer and steps, times by schedule, each frame 10 % slower than the one before it."""
    found = []
    marched = sweep(scene, march_settings(SCALE), known, FakeRenderer(known), repeats=6, output="depth")
    produced = sweep(scene, product_settings(scene, SCALE.size), known, FakeRenderer(known), repeats=6)
    for k, name in enumerate(SCENES):
        march, product = (replace(deepcopy(one), name=name) for one in (marched, produced))
        for p in march.points:
            quality = p.setting.quality
            p.errors = replace(p.errors, p1_apart=(k + 1) * ERRORS[quality.tracer] / quality.max_steps)
            p.times = [TIMES[quality.schedule] * 1.1**turn for turn in range(6)]
        product.checks = [Check("clock", True, "agrees")]
        alike = replace(deepcopy(march), name=name)
        for p in alike.points:
            p.errors = replace(p.errors, p1_apart=p.errors.p1_apart * (0.5 if p.tracer == "relaxed_again" else 1.0))
        undone = {t: _undone(known.depth.shape, n) for t, n in (("relaxed_again", 4.0), ("enhanced", 0.8))}
        found.append(Measured(name, march, alike, product, undone))
    return Suite(tuple(found), SCALE, 1)


def _undone(shape: tuple[int, ...], number: float) -> np.ndarray:
    """Half of the rays have ended; the others took all eight steps, of which some were undone."""
    found = np.zeros((2, *shape))
    found[0, : shape[0] // 2], found[1, : shape[0] // 2] = 8.0, number
    return found


@cache
def suite_once(scene, known) -> Suite:
    return known_suite(scene, known)


@pytest.fixture
def made(scene, known_once) -> Suite:
    return deepcopy(suite_once(scene, known_once))


@pytest.fixture(scope="module")
def known_once(scene) -> Reference:
    return reference(scene, SIZE)


def test_all_that_p1_compares_is_measured():
    names = {s.name for s in march_settings(SCALE)}
    assert {key(t, "single", n) for t in TRACERS for n in SCALE.steps} <= names
    assert {key("enhanced", s, 128) for s in ("two", "four", "six", "cone")} <= names
    assert len(names) == len(march_settings(SCALE))


def test_ratios_are_of_the_same_turn(made):
    ratio = made.ratio(("enhanced", "two"), ("enhanced", "single"), 64, "time")
    assert (ratio.value, ratio.low, ratio.high) == pytest.approx((0.8, 0.8, 0.8)), "what slows both cancels"
    assert ratio.confidence > 0.95
    assert made.ratio(("enhanced", "single"), ("plain", "single"), 8, "error").value == pytest.approx(0.5)
    assert made.ratio(("enhanced", "two"), ("plain", "single"), 64, "product").value == pytest.approx(0.4)


def test_claims_say_what_was_measured(made):
    rows = [line.split(" | ") for line in claims(made).splitlines()[2:]]
    assert len(rows) == 7
    said = {row[0].strip("| "): (row[1], row[2].strip(" |")) for row in rows}
    assert said["enhanced is up to 1.5 times better than relaxed in error x time"][0].startswith("0.75 times")
    assert "if an undone step counts as a step of its own, 1.50 times" in claims(made)
    assert "worse at 3" in said["enhanced is better than relaxed at every number of steps"][1]
    assert "of its own: 8: 0.67" in said["enhanced is better than relaxed at every number of steps"][0]
    assert said["enhanced is better than plain from 64 steps on"][1] == "yes"
    assert said["on the fractal enhanced and relaxed are on par"][1] == "relaxed is better"
    assert said["two resolutions save enhanced up to 20 % of its time"] == ("20% [20%, 20%] at 64 steps", "yes")
    assert said["not in the paper: one converged pass of cones, in time"][0].startswith("40%")
    assert said["enhanced rarely repeats a step"][0] == (
        "10.0% of the steps 17 to 24 that rays took, relaxed 50.0%; if rays that have ended count as 0, 5.0%, "
        "relaxed 25.0%"
    )


def test_claims_can_fail(made):
    for scene in made.scenes:
        for p in (*scene.march.points, *scene.published.points):
            if p.setting.quality.tracer == "enhanced":
                p.times = [9.0 * t for t in p.times]
            if p.setting.quality.schedule == "two":
                p.times = [2.0 * t for t in p.times]
    said = claims(made)
    assert "at 0 of 3, worse at 3" in said
    assert "| no |" in said
    assert "relaxed is better" in said


def test_the_page_has_tables_and_figures(made):
    text = page(made, {"tracers": "a.png", "oversteps": "b.png", "fronts": "c.png"})
    assert re.findall(r"!\[[^]]*\]\(([abc]\.png)\)", text) == ["a.png", "b.png", "c.png"]
    for name in SCENES:
        assert f"### {name}" in text
    assert text.count("| draft |") == text.count("| exact |") == 3
    assert "ours" in text, "the driver"
    assert "nan" not in text
    for line in text.splitlines():
        if line.startswith("|"):
            assert line.endswith("|")


def test_the_figures(made):
    for draw in (figure_3, figure_5, fronts):
        assert save(draw(made)).startswith(b"\x89PNG")
    left = figure_3(made).axes[0]
    curve = next(line for line in left.lines if line.get_label() == "enhanced")
    assert list(curve.get_ydata()) == pytest.approx([0.5, 0.5, 0.5])


def test_in_earnest(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "examples").mkdir()
    for name in SCENES:
        (tmp_path / "examples" / f"{name}.py").write_text("import raymarch as rm\nscene = rm.sphere() | rm.plane()\n")
    small = Scale((24, 14), 1, (8, 16), ("enhanced",), (16,))
    monkeypatch.setattr(accuracy, "QUICK", small)
    few = ("plain", "relaxed_again", "enhanced")
    for place in (suite, accuracy, suite_plots):
        monkeypatch.setattr(place, "TRACERS", few)
    for name, values in (("EPSILONS", (0.1,)), ("PAIRED", ("plain",)), ("PRESETS", {"normal": {}})):
        monkeypatch.setattr(suite, name, values)
    accuracy.main(["--quick", "--scenes", "examples", "-o", "page.md"])
    assert "claim" in capsys.readouterr().out
    text = (tmp_path / "page.md").read_text()
    shown = re.findall(r"\((pictures/[^)]*)\)", text)
    assert sorted(p.name for p in (tmp_path / "pictures").iterdir()) == sorted(s.split("/")[1] for s in shown)
    assert len(shown) == 3


def test_a_page_in_no_folder_is_refused_before_measuring(tmp_path, capsys):
    with pytest.raises(SystemExit) as stop:
        accuracy.main(["-o", str(tmp_path / "nowhere" / "a.md")])
    assert stop.value.code == 2
    assert "nowhere" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_without_scenes_nothing_is_written(tmp_path):
    with pytest.raises(CostError, match="--scenes FOLDER"):
        accuracy.main(["--scenes", str(tmp_path), "-o", str(tmp_path / "a.md")])
    assert not list(tmp_path.iterdir())


def test_a_missing_scene_is_named(tmp_path):
    with pytest.raises(CostError, match=r"mandelbulb\.py"):
        find_scenes(tmp_path)


@pytest.mark.parametrize("tracer", ["relaxed_again", "enhanced"])
def test_an_undone_step_and_the_plain_one_that_replaces_it_are_one_step(tracer):
    """A ray of N steps as P1 counts them is a ray of N + u evaluations, of which u were undone, bit for bit."""
    scene, size, steps = make_scene(), (48, 27), 12
    qualities = [replace(suite.BARE, tracer=tracer, max_steps=n) for n in range(steps, 2 * steps + 1)]
    with Renderer(size) as renderer:
        frames = [renderer.render(scene.replace(quality=q), outputs=("depth",)) for q in qualities]
    with Renderer(size) as renderer:
        count_as_published(renderer, scene, qualities[:1])
        found = renderer.render(scene.replace(quality=qualities[0]), outputs=("depth",))
    undone = found.fallbacks
    assert undone.max() >= 3
    assert np.all(found.iterations - undone <= steps) and np.all((found.iterations - undone == steps) | found.done)
    same = compared = 0
    for row, column in np.argwhere(~found.done):
        other = frames[undone[row, column]]
        if other.iterations[row, column] == steps + undone[row, column]:  # rising rays take more than the limit there
            compared += 1
            same += other.reach[row, column] == found.reach[row, column]
    assert same == compared > 100


def test_ticks_of_a_short_axis_differ():
    """Those of village in docs/accuracy.md were 0.000045 five times."""
    axes = blank(6.0, 5.0).subplots()
    axes.set(yscale="log", ylim=(4.46e-5, 4.62e-5))
    plain_ticks(axes.yaxis)
    axes.figure.draw_without_rendering()
    shown = [tick.get_text() for tick in axes.get_yticklabels()]
    assert len(shown) > 4 and len(set(shown)) == len(shown) and "0.0000452" in shown
