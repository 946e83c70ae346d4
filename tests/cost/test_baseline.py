"""Baselines: what grew since they were recorded is named, and fails."""

from __future__ import annotations

import json
import os

import pytest

from raymarch.cost.baseline import grown
from raymarch.scene.quality import PRESETS
from tests.support import commands
from tests.support.commands import files

HELLO = """import raymarch as rm
scene = rm.Scene(rm.union(rm.sphere(rm.Param("size", 1.0, 0.5, 2.0)), rm.plane(offset=-1), k=1e-3){more})
"""
QUICK = ("--size", "32x18")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "hello.py").write_text(HELLO.format(more=""))
    return tmp_path


def run(*args: str) -> int:
    return commands.run("cost", "hello.py", *args)


def test_a_baseline_holds_until_the_scene_costs_more(folder, capsys):
    assert run(*QUICK, "--set", "size=1.5", "--write-baseline", "base.json") == 0
    assert "hello at 32x18: recorded at 5 settings" in capsys.readouterr().out
    stored = json.loads((folder / "base.json").read_text())["scenes"]["hello"]
    assert (stored["size"], stored["params"], set(stored["rows"])) == ([32, 18], {"size": 1.5}, {"own", *PRESETS})
    assert files(folder) == {"hello.py", "base.json"}

    assert run("--check", "base.json") == 0, "at the size and the parameters of the baseline"
    assert "nothing grew at 5 settings" in capsys.readouterr().out

    (folder / "hello.py").write_text(HELLO.format(more=", lights=[rm.Sun(shadow=True)]"))
    assert run("--check", "base.json") == 1
    said = capsys.readouterr().out.splitlines()
    assert len(said) == 2, "the shadow alone costs more"
    assert said[0].startswith("hello own: all_evaluations grew from ") and "(+" in said[0]
    assert said[1].startswith("hello at 32x18: 1 figure grew; ")

    (folder / "hello.py").write_text(HELLO.format(more=", quality=rm.Quality(epsilon=9.0, refinement='none')"))
    assert run("--check", "base.json") == 1
    assert "hello own: pixels_p99 grew from " in capsys.readouterr().out

    (folder / "other.py").write_text(HELLO.format(more=""))
    assert commands.run("cost", "other.py", *QUICK, "--write-baseline", "base.json") == 0
    assert set(json.loads((folder / "base.json").read_text())["scenes"]) == {"hello", "other"}


ROWS = {name: {"missed": 0, "false": 0, "evaluations": 9.0, "pixels_p50": 0.1, "pixels_p99": 0.2, "normal_p99": None}
        for name in ("own", *PRESETS)}  # fmt: skip
ROWS["own"]["all_evaluations"] = 12.0


@pytest.mark.parametrize(
    ("content", "args", "says"),
    [
        (None, (), "cannot read 'base.json': No such file"),
        ("{", (), "base.json': "),
        ("[]", (), "base.json': it is broken"),
        ('{"format": 1, "scenes": {"hello": {"size": [1, 1]}}}', (), "base.json': it is broken"),
        ('{"format": 9, "scenes": {}}', (), "format 1"),
        ('{"format": 1, "scenes": {}}', (), "no scene 'hello'"),
        ("rows", ("--size", "64x36"), "(32, 18), as in the baseline"),
        ("rows", ("--html", "a.html"), "together with --html"),
        ("rows", ("--effects",), "together with --effects"),
        ("rows", ("--write-baseline", "b.json"), "one of them"),
    ],
)
def test_wrong_input_says_so(folder, capsys, content, args, says):
    if content == "rows":
        scene = {"size": [32, 18], "time": 0.0, "params": {}, "rows": ROWS}
        content = json.dumps({"format": 1, "scenes": {"hello": scene}})
    if content is not None:
        (folder / "base.json").write_text(content)
    assert run("--check", "base.json", *args) == 2
    assert says in " ".join(capsys.readouterr().err.split())
    assert files(folder) <= {"hello.py", "base.json"}


@pytest.mark.parametrize(
    ("before", "after", "says"),
    [
        ('"size": [32, 18]', '"size": [1e999, 18]', "1e999 is no finite number"),
        ('"size": [32, 18]', '"size": ["32", 18]', "size = '32'"),
        ('"evaluations": 9.0', '"evaluations": "9"', "own: evaluations = '9'"),
        (
            '"evaluations": 9.0',
            '"evaluations": 9.0, "seconds": 1',
            "another version wrote it, with the figures of 'own'",
        ),
        ('"rows": {', '"rows": {"best": {}, ', "another version wrote it, with the settings 'best, own"),
        ('"params": {}', '"params": {"width": 1}', "unknown parameter 'width'"),
        ('"params": {}', '"params": {"size": "1"}', "parameter 'size' = '1'"),
        ('"params": {}', '"params": ' + 100_000 * "[", "it is broken (RecursionError"),
        ('"time": 0.0', '"time": 1' + 400 * "0", "time = "),
    ],
)
def test_a_hostile_baseline_is_named(folder, capsys, before, after, says):
    scene = {"size": [32, 18], "time": 0.0, "params": {}, "rows": ROWS}
    text = json.dumps({"format": 1, "scenes": {"hello": scene}})
    (folder / "base.json").write_text(text.replace(before, after, 1))
    assert run("--check", "base.json") == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert says in line and "base.json" in line


@pytest.mark.skipif(os.name == "nt", reason="folders cannot be read elsewhere")
def test_a_folder_is_no_baseline(folder, capsys):
    assert run("--check", ".") == 2
    assert "directory" in capsys.readouterr().err


@pytest.mark.parametrize("figure", ["evaluations", "pixels_p99", "missed"])
def test_growth_is_named(figure):
    known = {"evaluations": 20.0, "missed": 0, "false": 0, "pixels_p50": 1e-4, "pixels_p99": 0.01, "normal_p99": 0.1}
    assert not grown("hall fine", known, known | {"evaluations": 20.9, "pixels_p99": 0.0105})
    worse = known | {figure: known[figure] * 1.07 + 0.4 * (figure == "missed") + 5e-4}
    (fault,) = grown("hall fine", known, worse)
    assert fault.startswith(f"hall fine: {figure} grew from")
    assert len(grown("hall fine", known, known | {figure: None})) == 1
    assert not grown("hall fine", known | {figure: None}, known | {figure: None})
