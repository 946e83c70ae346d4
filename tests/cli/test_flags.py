"""A flag has one meaning, and stands on every command where it has that."""

from __future__ import annotations

from pathlib import Path

import pytest

from raymarch.cli.commands import COMMANDS, load
from tests.support.commands import run

DRAWING = {"render", "view", "cost", "explain", "prove"}
FLAGS = {
    "--size": DRAWING,
    "--time": {*DRAWING, "export"},
    "--set": {*DRAWING, "export"},
    "--quality": {"render", "view", "explain", "export", "prove"},
    "--samples": {"render", "view"},
    "--reference-samples": {"cost"},
    "--tolerance": {"prove", "export"},
    "--error": {"render"},
    "--within": {"render"},
    "--backend": {"render", "cost", "doctor"},
    "--strict": {"render", "prove"},
}
"""Flags, and the commands that have them."""

ELSEWHERE = {"cost": "it compares settings"}
"""Commands that draw, without --quality, and why."""


def test_flags_stand_on_the_commands_where_they_have_a_meaning() -> None:
    options = {name: {flag for q in load(name).params for flag in q.opts} for name in COMMANDS}
    found = {flag: {name for name, known in options.items() if flag in known} for flag in FLAGS}
    found["--backend"].add("doctor")  # which tries them all
    assert found == FLAGS
    assert DRAWING - FLAGS["--quality"] == ELSEWHERE.keys()


@pytest.mark.parametrize("flag", ["--size", "--set", "--quality"])
def test_a_flag_takes_the_same_everywhere(flag: str) -> None:
    forms = {q.metavar for name in FLAGS[flag] for q in load(name).params if flag in q.opts}
    assert len(forms) == 1


def test_explain_shows_the_values_that_are_set(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("a.py").write_text(
        "import raymarch as rm\nlift = rm.Param('lift', 0.5, 0, 1)\n"
        "scene = rm.Scene(rm.sphere(), rm.Camera((0, lift, 5), (0, lift, 0)))\n"
    )
    assert run("explain", "a.py", "--set", "lift=0.25", "--time", "2", "--quality", "exact") == 0
    shown = capfd.readouterr().out
    rows = {line[:30].strip(): line[30:].strip() for line in shown.splitlines()}
    assert (rows["lift"], rows["time"], rows["camera position"]) == ("0.25", "2", "0, 0.25, 5")
    for wrong, told in (("--set", "lift=3"), "'lift' = 3"), (("--quality", "best"), "draft, normal"):
        assert run("explain", "a.py", *wrong) == 2
        assert told in capfd.readouterr().err


TYPED = """
render a.py --width 320 | use --size WxH
render a.py --resolution 64x36 | use --size WxH
render a.py -s 64x36 | use --size WxH
export a.py -o a.stl --resolution 64 | use --cells N
render a.py --spp 4 | use --samples N
cost a.py --samples 4 | use --reference-samples N
explain a.py --samples 4 | use --quality NAME
render a.py --frame 3 | use --time SECONDS
render a.py --duration 3 | use --frames A:B
render a.py --out a.png | use -o FILE
render a.py a.png | use -o a.png
export a.py a.stl | Missing option '-o'
export a.py --format stl | use -o FILE
render a.py -D radius=2 | use --set NAME=VALUE
render a.py --transparent | use --alpha
render a.py --background black | use in the scene: rm.Scene(node, sky=...)
render a.py --camera 0,0,5 | rm.Camera(eye, target)
render a.py --gpu | use --backend NAME
render a.py --threads 4 | use --cluster local
render a.py --preset fine | use --quality NAME
render a.py --max-error 1px | use --error 0.5px
prove a.py --accuracy 1px | use --tolerance 0.05px
prove a.py --within 1px | use --tolerance 0.05px
view a.py --watch | the window reloads a saved file
render a.py --qualty fine | use --quality
render a.py --nothing-like-it | No such option: --nothing-like-it (raymarch render --help)
preview a.py | use raymarch view SCENE.py
run a.py | use raymarch view SCENE.py
film a.py | --frames 0:90
info | use raymarch doctor
mesh a.py | use raymarch export SCENE.py -o a.stl
bench a.py | use raymarch cost SCENE.py
new a.py | scene = rm.sphere()
help | use raymarch --help
version | use raymarch --version
rendr a.py | render
a.py | raymarch render a.py, or raymarch view a.py
"""
"""What people of other programs type, and what the message says."""


@pytest.mark.parametrize("row", TYPED.strip().splitlines(), ids=lambda row: row.partition(" | ")[0])
def test_wrong_usage_is_told_what_to_type(row: str, capfd: pytest.CaptureFixture[str]) -> None:
    typed, _, told = row.partition(" | ")
    assert run(*typed.split()) == 2
    message = capfd.readouterr().err
    assert told in message and message.count("\n") == 1
