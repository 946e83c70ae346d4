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
    "--quality": {"render", "explain", "export", "prove"},
    "--samples": {"render", "view"},
    "--reference-samples": {"cost"},
    "--tolerance": {"prove", "export"},
    "--error": {"render"},
    "--within": {"render"},
    "--backend": {"render", "cost", "doctor"},
    "--strict": {"render", "prove"},
}
"""Flags, and the commands that have them."""

ELSEWHERE = {"view": "the window chooses its own settings", "cost": "it compares settings"}
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
