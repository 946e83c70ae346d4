"""`raymarch render --json`, folders that a command makes, and --strict with frames."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import raymarch
from tests.support.commands import files, run

ROOT = Path(raymarch.__file__).parents[1]

AWAY = """
import raymarch as rm

print("a scene may print")
scene = rm.Scene(rm.sphere().translate((4 * rm.time, 0, 0)), camera=rm.Camera((0, 0, 5), (0, 0, 0)))
"""

SMALL = ("--size", "32x18")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    (tmp_path / "away.py").write_text(AWAY)
    monkeypatch.chdir(tmp_path)
    yield tmp_path


def document(capfd: pytest.CaptureFixture[str]) -> dict[str, Any]:
    """The document on the output, which holds nothing else."""
    found: dict[str, Any] = json.loads(capfd.readouterr().out)
    return found


def test_a_picture_in_a_new_folder(folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert run("render", "away.py", "-o", "new/dir/a.png", *SMALL, "--json", "--view", "nonfinite") == 0
    found = document(capfd)
    assert found["files"] == [{"file": "new/dir/a.png", "bytes": (folder / "new/dir/a.png").stat().st_size}]
    assert found["folders"] == ["new", "new/dir"] and found["doubts"] == [] and "error" not in found
    (picture,) = found["pictures"]
    assert picture["file"] == "new/dir/a.png" and picture["size"] == [32, 18] and picture["time"] == 0.0
    assert 0 < picture["evaluations"]["mean"] <= picture["evaluations"]["max"] and picture["milliseconds"] > 0
    assert picture["lines"] and picture["drawn"] and picture["seconds"] <= found["seconds"]


def test_frames_that_are_drawn_already_and_doubts(folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
    arguments = ("render", "away.py", "-o", "f_{}.png", *SMALL, "--frames", "2:4", "--fps", "2", "--json")
    for drawn in (True, False):
        assert run(*arguments) == 0
        found = document(capfd)
        assert [p["drawn"] for p in found["pictures"]] == [drawn] * 2 and [p["time"] for p in found["pictures"]] == [
            1,
            1.5,
        ]
        assert len(found["files"]) == 2 * drawn
        assert ("nothing is visible" in str(found["doubts"])) == drawn


def test_a_film_is_one_file(folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert run("render", "away.py", "-o", "film.gif", *SMALL, "--frames", "0:2", "--json") == 0
    found = document(capfd)
    assert [each["file"] for each in found["files"]] == ["film.gif"] and len(found["pictures"]) == 2
    assert all("file" not in picture for picture in found["pictures"])


@pytest.mark.parametrize("target", ["new/f_{}.png", "new/film.gif"])
def test_an_empty_frame_of_a_strict_animation(target: str, folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """Its frame is named; the frames before it stay, a film is not written."""
    arguments = ("render", "away.py", "-o", target, *SMALL, "--frames", "1:6", "--fps", "2", "--strict", "--json")
    assert run(*arguments) == 2
    found = document(capfd)
    assert found["error"].startswith("frame 3, at time 1.5: nothing is visible")
    assert len(found["pictures"]) == 2 and not (folder / "new/film.gif").exists()
    assert files(folder / "new") == ({"f_1.png", "f_2.png"} if target.endswith(".png") else {"film.gif.frames"})


def test_strict_takes_no_frame_that_was_drawn_without_its_checks(folder: Path) -> None:
    arguments = ("render", "away.py", "-o", "f_{}.png", *SMALL, "--frames", "3:4", "--fps", "2")
    assert run(*arguments) == 0 and run(*arguments) == 0
    assert run(*arguments, "--strict") == 2


def test_a_cluster_has_no_report(folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert run("render", "away.py", "--json", "--cluster", "local:1") == 2
    assert document(capfd)["error"].startswith("--json with --cluster")


@pytest.mark.parametrize("target", ["new/a.xyz", "new/a.png"])
def test_a_command_that_fails_leaves_no_folder(target: str, folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert run("render", "away.py", "-o", target, "--time", "9", *SMALL, "--strict", "--json") == 2
    found = document(capfd)
    assert found["error"] and not found["files"] and not found["folders"] and files(folder) == {"away.py"}
    assert run("export", "away.py", "-o", "new/a.stl") == 2 and files(folder) == {"away.py"}


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
def test_a_terminated_command_leaves_no_file_that_is_half_written(folder: Path) -> None:
    text = f"{AWAY}scene = scene.replace(node=rm.mandelbulb(), quality=rm.Quality(samples=64))\n"
    (folder / "away.py").write_text(text)
    command = [sys.executable, "-m", "raymarch", "render", "away.py", "-o", "new/f_{}.exr", "--frames", "0:50"]
    options = ["--size", "64x48", "--layers", "--json"]
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    process = subprocess.Popen([*command, *options], env=environment, stdout=subprocess.PIPE, text=True)
    end = time.monotonic() + 180
    while not (folder / "new/f_0.exr").exists() and time.monotonic() < end:
        time.sleep(0.05)
    process.send_signal(signal.SIGTERM)
    found = json.loads(process.communicate()[0])
    assert process.returncode == 130 and found["error"] == "interrupted by KeyboardInterrupt"
    assert {each["file"] for each in found["files"]} == {f"new/{name}" for name in files(folder / "new")}
