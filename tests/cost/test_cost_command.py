"""`raymarch cost` as a user meets it."""

from __future__ import annotations

import csv
import json
import sys
from dataclasses import replace

import pytest
from PIL import Image

import raymarch as rm
from raymarch.cli import cost
from raymarch.gpu.renderer import Renderer
from raymarch.scene.file import load
from raymarch.scene.quality import Quality
from tests.support import commands
from tests.support.commands import files

HELLO = """import raymarch as rm
scene = rm.Scene(rm.union(rm.sphere(rm.Param("size", 1.0, 0.5, 2.0)), rm.plane(offset=-1), k=1e-3))
"""
QUICK = ("--size", "32x18", "--repeats", "1", "--reference-samples", "1")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "hello.py").write_text(HELLO)
    return tmp_path


def run(*args: str) -> int:
    return commands.run("cost", *args)


def test_table_json_and_csv(folder, capsys):
    asked = ("--axis", "epsilon=0.1,2", "--cross", "epsilon", "--json", "a.json", "--csv", "a.csv", "--set", "size=1.5")
    assert run("hello.py", *QUICK, *asked) == 0
    said = capsys.readouterr().out
    for word in ("hello, 32x18", "At 32×18 on this machine", "epsilon 2", "missed", "N*", "Pareto front by pixels_p99"):
        assert word in said
    data = json.loads((folder / "a.json").read_text())
    assert [p["name"] for p in data["points"]] == ["base", "draft", "fine", "exact", "epsilon 2"]
    rows = list(csv.DictReader((folder / "a.csv").read_text().splitlines()))
    assert [float(r["evaluations"]) for r in rows] == [p["evaluations"] for p in data["points"]]
    assert files(folder) == {"hello.py", "a.json", "a.csv"}


def test_the_proof_of_its_own_setting(folder, capsys):
    """Its figures are those of `rm.prove`, with the time and the parameters of the sweep."""
    asked = ("--cross", "epsilon", "--axis", "epsilon=0.1", "--prove", "--json", "a.json", "--set", "size=1.5")
    assert run("hello.py", *QUICK, *asked) == 0
    proof = json.loads((folder / "a.json").read_text())["proof"]
    assert proof["words"] in capsys.readouterr().out and proof["size"] == [32, 18]
    known = rm.prove(load(folder / "hello.py"), size=(32, 18), params={"size": 1.5})
    assert (proof["proved"], proof["contradicted"]) == (known.proved, 0) and proof["share"] > 0.99


def test_what_is_shown_and_what_only_by_all(folder, capsys, monkeypatch):
    measure, measured = cost._Bench.sweep, []

    def once(*given):
        if not measured:
            measured.append(measure(*given))
            for point in measured[0][0].points:  # no clock decides which settings are dominated
                point.times = [1.0 if point.name == "draft" else 2.0]
        return measured[0]

    monkeypatch.setattr(cost._Bench, "sweep", once)
    asked = ("--cross", "tracer,max_steps", "--axis", "max_steps=3,512", "--axis", "tracer=plain,bracketing")
    assert run("hello.py", *QUICK, *asked) == 0
    assert "plain, 3 steps" not in capsys.readouterr().out
    assert run("hello.py", *QUICK, *asked, "--all") == 0
    assert "plain, 3 steps" in capsys.readouterr().out


def test_plot_and_report(folder):
    assert run("hello.py", *QUICK, "--cross", "epsilon", "--plot", "a.png", "--html", "a.html") == 0
    with Image.open("a.png") as picture:
        assert picture.format == "PNG"
    assert (folder / "a.html").read_text().startswith("<!doctype html>")
    assert files(folder) == {"hello.py", "a.png", "a.html"}


def test_without_matplotlib_nothing_is_measured_in_vain(folder, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    assert run("hello.py", *QUICK, "--plot", "a.png") == 2
    assert "pip install jinja2 matplotlib" in " ".join(capsys.readouterr().err.split())
    assert files(folder) == {"hello.py"}


@pytest.mark.parametrize(
    ("args", "says"),
    [
        (("none.py",), "none.py"),
        (("hello.py", "--size", "32"), "--size 32"),
        (("hello.py", "--by", "beauty"), "pixels_p99"),
        (("hello.py", "--prove", "--effects"), "--effects"),
        ((), "SCENE.py"),
        (("hello.py", "--suite"), "--suite"),
        (("hello.py", "--reference-samples", "5"), "square"),
        (("hello.py", "--reference-samples", "-1"), "square"),
        (("hello.py", "--cross", "speed"), "speed"),
        (("hello.py", "--axis", "speed=1"), "speed"),
        (("hello.py", "--axis", "epsilon"), "NAME=VALUE"),
        (("hello.py", "--axis", "epsilon=0.1,99"), "0.001 to 10"),
        (("hello.py", "--json", "a.txt"), ".json"),
        (("hello.py", "--csv", "nowhere/a.csv"), "nowhere"),
        (("hello.py", "--plot", "a.gif"), ".png or .svg or .pdf"),
        (("hello.py", "--html", "a.txt"), ".html"),
        (("hello.py", "--set", "speed=1"), "speed"),
        (("hello.py", "--set", "size=9"), "<= 2"),
        (("hello.py", "--repeats", "0"), "repeats"),
    ],
)
def test_wrong_input_says_so_and_leaves_nothing(folder, capsys, args, says):
    assert run(*args) == 2
    assert says in " ".join(capsys.readouterr().err.split())
    assert files(folder) == {"hello.py"}


def test_flip_is_refused_where_light_goes_random_ways(folder, capsys):
    own = "scene = rm.Scene(scene.node, bounces=2)\n"
    (folder / "hello.py").write_text(HELLO + own)
    assert run("hello.py", *QUICK, "--by", "flip_mean") == 2
    assert "Quality(integrator='whitted')" in " ".join(capsys.readouterr().err.split())


# raymarch render --quality, --error, --within


def draw(*args: str) -> int:
    return commands.run("render", "hello.py", "--size", "32x18", "-o", "a.png", *args)


@pytest.mark.parametrize("name", ["draft", "normal", "fine", "exact"])
def test_a_preset_is_drawn(folder, name):
    assert draw("--quality", name) == 0
    assert files(folder) == {"hello.py", "a.png"}


@pytest.fixture
def drawn(monkeypatch):
    """The qualities that anything is drawn with, in turn."""
    seen, render = [], Renderer.render

    def spy(self, scene, *args, **named):
        seen.append(scene.quality)
        return render(self, scene, *args, **named)

    monkeypatch.setattr(Renderer, "render", spy)
    return seen


def test_a_preset_leaves_what_is_not_marching_as_the_scene_has_it(folder, drawn):
    own = 'scene = scene.replace(quality=rm.Quality(integrator="whitted", samples=4))\n'
    (folder / "hello.py").write_text(HELLO + own)
    assert draw("--quality", "fine") == 0
    assert drawn == [replace(Quality.preset("fine"), integrator="whitted", samples=4)]


@pytest.fixture
def short_ladder(monkeypatch):
    """Whether all settings are tried is tested in test_search.py."""
    monkeypatch.setattr("raymarch.cost.search.LADDER", (2.0, 0.1))


@pytest.mark.usefixtures("short_ladder")
@pytest.mark.parametrize("asked", [("--error", "0.5px"), ("--within", "60s")])
def test_samples_are_measured_and_kept(folder, drawn, asked):
    assert draw("--samples", "2", *asked) == 0
    assert {q.samples for q in drawn} == {2}


@pytest.mark.usefixtures("short_ladder")
def test_what_was_reached_is_stated(folder, capsys):
    assert draw("--error", "0.5px") == 0
    said = capsys.readouterr().err
    assert "0.5px: " in said
    assert "no hit missed" in said
    assert draw("--within", "60s") == 0
    assert "60s: " in capsys.readouterr().err


@pytest.mark.usefixtures("short_ladder")
@pytest.mark.parametrize(
    ("args", "says"),
    [
        (("--quality", "best"), "draft, normal, fine, exact"),
        (("--error", "0.5em"), "0.5px"),
        (("--error", "1e-9px"), "no setting is within this error"),
        (("--within", "soon"), "16ms"),
        (("--within", "0.0001ms"), "no setting that finds every hit"),
        (("--within", "9ms", "--error", "1px"), "one of them"),
        (("--quality", "fine", "--error", "1px"), "one of them"),
    ],
)
def test_what_cannot_be_had_is_refused(folder, capsys, args, says):
    assert draw(*args) == 2
    assert says in " ".join(capsys.readouterr().err.split())
    assert files(folder) == {"hello.py"}
