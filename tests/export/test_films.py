"""Films and sequences: the same bytes each time, and a rerun draws only what is missing or not whole."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import weakref
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image, ImageSequence

import raymarch as rm
from raymarch.export import stills
from raymarch.export.film import write_film
from raymarch.export.sequence import Item, Parts, Runner, frames_of
from raymarch.export.stills import Shot, package
from tests.support.commands import files, run

SCENE = """import raymarch as rm
glow = rm.Param("glow", 0.5, 0, 1)
ball = rm.sphere(0.5).translate((rm.time - 1, 0, 0)).material(rm.Material(color=(1, glow, 0)))
scene = rm.Scene(ball | rm.plane(offset=-0.5), camera=rm.Camera((0, 1, 5), (0, 0, 0)))
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "ball.py").write_text(SCENE)
    return tmp_path


def draw(output: str, *more: str, frames: str = "0:6") -> int:
    return run("render", "ball.py", "-o", output, "--frames", frames, "--fps", "3", "--size", "32x20", *more)


def drawn(capsys: pytest.CaptureFixture[str]) -> int:
    """The number of pictures that a command has drawn."""
    return capsys.readouterr().err.count("ms to draw")


@pytest.mark.parametrize("name", ["film.mp4", "film.webm", "film.gif"])
def test_a_film_has_all_frames_and_the_same_bytes(
    name: str, folder: Path, capfd: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture
) -> None:
    av = pytest.importorskip("av")
    assert draw(name) == 0 and "options" not in capfd.readouterr().err + caplog.text
    first = (folder / name).read_bytes()
    assert files(folder) == {"ball.py", name}
    assert draw(name) == 0 and (folder / name).read_bytes() == first
    with av.open(str(folder / name)) as film:
        pictures = [frame.to_ndarray(format="rgb24").astype(int) for frame in film.decode(video=0)]
        assert film.duration / 1e6 == pytest.approx(2.0, abs=0.02)
    assert len(pictures) == 6 and pictures[0].shape == (20, 32, 3)
    with rm.Renderer((32, 20)) as renderer:
        wanted = renderer.render(rm.Scene(rm.sphere(), camera=rm.Camera((0, 1, 5), (0, 0, 0)))).image()
    assert np.abs(pictures[0][0] - np.asarray(wanted)[0]).mean() < 6  # the sky, in both


def test_colors_of_a_film_are_those_of_the_pictures(folder: Path) -> None:
    av = pytest.importorskip("av")
    camera = "rm.Camera((0, 0, 20), (0, 0, 40))"
    flat = f"import raymarch as rm\nscene = rm.Scene(rm.sphere(9), camera={camera}, lights=[], sky=(0.5, 0.1, 0.02))\n"
    (folder / "ball.py").write_text(flat)
    assert draw("film.mp4", frames="0:2") == 0 and draw("f%d.png", frames="0:1") == 0
    with av.open("film.mp4") as film:
        found = next(film.decode(video=0)).to_ndarray(format="rgb24").astype(int)
    assert np.abs(found - np.asarray(Image.open("f0.png")).astype(int)).max() <= 3


def test_a_rerun_draws_only_what_is_missing_or_not_whole(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert draw("f_%04d.png") == 0 and drawn(capsys) == 6
    before = {name: (folder / name).read_bytes() for name in files(folder)}
    (folder / "f_0001.png").unlink()
    (folder / "f_0003.png").write_bytes(before["f_0003.png"][:-40])
    (folder / "f_0004.png").write_bytes(b"no picture")
    assert draw("f_%04d.png") == 0 and drawn(capsys) == 3
    assert {name: (folder / name).read_bytes() for name in files(folder)} == before
    assert draw("f_%04d.png", frames="4:8") == 0 and drawn(capsys) == 2


def test_frames_after_a_quick_one_are_drawn_at_once(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[bool] = []
    own = Runner.picture

    def picture(self: Runner, item: Item, shot: Shot, progress: Callable[[float], None] | None) -> Any:
        told.append(progress is not None)
        return own(self, item, shot, progress)

    monkeypatch.setattr(Runner, "picture", picture)
    monkeypatch.setattr("raymarch.cli.drawing.QUICK", 1e9)
    assert draw("f_{}.png", frames="0:3") == 0 and told == [True, False, False]
    monkeypatch.setattr("raymarch.cli.drawing.QUICK", 0.0)
    assert draw("g_{}.png", frames="0:2") == 0 and told[3:] == [True, True]


@pytest.mark.parametrize("change", ["--set glow=0.9", "--size 34x20", "--view normal", "--samples 2", "--quality fine"])
def test_another_picture_is_drawn_again(
    change: tuple[str, str], folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert draw("f_%04d.png", frames="0:1") == 0 and draw("f_%04d.png", *change.split(), frames="0:1") == 0
    assert drawn(capsys) == 2


def test_an_edited_scene_is_drawn_again(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert draw("f_%04d.png", frames="0:1") == 0
    for old, new in (("sphere(0.5)", "sphere(0.6)"), ("(0, 1, 5)", "(0, 1, 4)"), ("glow, 0)", "glow, 0.2)")):
        (folder / "ball.py").write_text(SCENE.replace(old, new))
        assert draw("f_%04d.png", frames="0:1") == 0
    assert drawn(capsys) == 4


def test_frames_by_another_state_of_the_package_are_drawn_again(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert package() == f"{rm.__version__} ({package()[-9:]}" and draw("f_%04d.png", frames="0:2") == 0
    monkeypatch.setattr(stills, "package", lambda: f"{rm.__version__} (12345678)")
    assert draw("f_%04d.png", frames="0:2") == 0 and drawn(capsys) == 4
    assert draw("f_%04d.png", frames="0:2") == 0 and drawn(capsys) == 0


KILLED = """
import os, signal, sys
from pathlib import Path
from raymarch.cli import main
replace = Path.replace
def killed(partial, target):
    if target.name.startswith("frame_000003"):
        os.kill(os.getpid(), signal.SIGKILL)
    return replace(partial, target)
Path.replace = killed
main(sys.argv[1:])
"""
"""The command, killed before its fourth picture is whole."""


def test_a_film_that_was_killed_continues_to_the_same_bytes(folder: Path) -> None:
    pytest.importorskip("av")
    assert draw("film.mp4", frames="0:8") == 0
    whole = (folder / "film.mp4").read_bytes()
    (folder / "film.mp4").unlink()
    words = ["render", "ball.py", "-o", "film.mp4", "--frames", "0:8", "--fps", "3", "--size", "32x20"]
    environment = os.environ | {"PYTHONPATH": str(Path(rm.__file__).parents[1])}
    killed = subprocess.run([sys.executable, "-c", KILLED, *words], env=environment, stderr=subprocess.DEVNULL)
    assert killed.returncode == -signal.SIGKILL and not (folder / "film.mp4").exists()
    left = [name.partition("-")[0] for name in sorted(files(folder / "film.mp4.frames"))]
    assert [name for name in left if name[0] != "."] == ["frame_000000", "frame_000001", "frame_000002"]
    assert draw("film.mp4", frames="0:8") == 0
    assert (folder / "film.mp4").read_bytes() == whole and files(folder) == {"ball.py", "film.mp4"}


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("-o", "film.mp4"), "a film 'film.mp4' without --frames (--frames A:B"),
        (("-o", "film.mp4", "--frames", "0:2", "--size", "33x20"), "33x20 for a .mp4 film (even width and height"),
        (("-o", "film.gif", "--frames", "0:2", "--fps", "60"), "fps = 60 for a .gif (from 0.002 to 50: viewers"),
        (("-o", "film.avi", "--frames", "0:2"), "cannot write 'film.avi' (a file ending in .png"),
        (("-o", "film.png", "--frames", "0:2"), "--frames with the output 'film.png' (a film (.mp4, .webm, .gif), or"),
    ],
)
def test_what_is_no_film_is_refused(
    options: tuple[str, ...], message: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run("render", "ball.py", *options) == 2
    assert message in capsys.readouterr().err and files(folder) == {"ball.py"}


# What else is there


@pytest.mark.parametrize("name", ["film.gif", "film.mp4"])
def test_other_files_in_the_folder_of_frames_stay_and_are_named(
    name: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    parts = folder / f"{name}.frames"
    parts.mkdir()
    for other in ("notes.txt", "frame_000000.png", ".raymarch.0123"):
        (parts / other).write_text("mine")
    with pytest.MonkeyPatch.context() as patch, pytest.raises(ZeroDivisionError):
        patch.setattr(import_module("raymarch.export.film"), "_write_gif", lambda *_: [*_[1], 1 / 0])
        patch.setattr(import_module("raymarch.export.film"), "_write_video", lambda *_: [*_[2], 1 / 0])
        draw(name)  # a film that is not completed: its frames stay
    kept = {file.name for file in parts.iterdir()}
    assert len(kept) == 8
    capsys.readouterr()
    assert draw(name, "--view", "normal", frames="0:2") == 0
    assert {file.name for file in parts.iterdir()} == kept  # what begins with .raymarch. was left by a killed command
    assert f"'{name}.frames' keeps 8 files of other runs or of yours: 'frame_000000" in capsys.readouterr().err
    assert draw(name) == 0 and {file.name for file in parts.iterdir()} == {"notes.txt", "frame_000000.png"}


def test_other_files_in_the_folder_of_tiles_stay(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(import_module("raymarch.export.sequence"), "LARGE", 100)
    monkeypatch.setattr(import_module("raymarch.cli.job"), "EDGE", 16)
    command = ("render", "ball.py", "-o", "a.png", "--size", "32x20")
    assert run(*command) == 0 and files(folder) == {"ball.py", "a.png"}
    (folder / "a.png.tiles").mkdir()
    (folder / "a.png.tiles" / "tile_000000_000000.png").write_text("mine")
    assert run(*command) == 0 and "keeps 1 files" in capsys.readouterr().err
    assert [file.read_text() for file in (folder / "a.png.tiles").iterdir()] == ["mine"]
    monkeypatch.setattr(import_module("raymarch.export.sequence"), "draw", lambda *_: 1 / 0)
    (folder / "a.png.tiles" / "tile_000000_000000.png").unlink()
    with pytest.raises(ZeroDivisionError):
        run(*command)
    assert files(folder) == {"ball.py", "a.png"}


def test_two_commands_do_not_write_one_film(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    items = frames_of(Path("film.gif"), range(2), 3, (32, 20))
    with Parts(items, Path("film.gif")):
        assert draw("film.gif") == 2
        assert capsys.readouterr().err == "raymarch: another command is writing 'film.gif' (another name)\n"
    assert draw("film.gif") == 0 and files(folder) == {"ball.py", "film.gif"}


@pytest.mark.parametrize("name", ["a_{{}}.png", "a_%%.png", "a_{:.0e}.png", "a_{0.real.__class__}.png", "%c.png"])
def test_a_name_without_the_number_of_the_frame_is_refused(
    name: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert draw(name, frames="47:49") == 2 and capsys.readouterr().err.count("\n") == 1 and files(folder) == {"ball.py"}


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("film.gif", "--fps", "0.001"), "fps = 0.001 for a .gif (from 0.002 to 50)"),
        (("film.mp4", "--fps", "1e9"), "fps = 1e+09 for a .mp4 (from 0.001 to 1000)"),
        (("f{}.png", "--frames", "0:99999999"), "--frames: 99999999 frames (up to 200000; more in several files)"),
    ],
)
def test_numbers_of_a_film_out_of_range_are_refused(
    options: tuple[str, ...], message: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert draw(*options) == 2 and message in capsys.readouterr().err and files(folder) == {"ball.py"}


@pytest.mark.parametrize("suffix", [".gif", ".mp4"])
def test_a_film_has_one_picture_in_memory(suffix: str, tmp_path: Path) -> None:
    alive: list[weakref.ref[Image.Image]] = []

    def pictures() -> Iterator[Image.Image]:
        for i in range(12):
            picture = Image.new("RGB", (32, 20), (20 * (i // 2), 9, 9))
            alive.append(weakref.ref(picture))
            assert sum(made() is not None for made in alive) <= 2
            yield picture

    write_film(tmp_path / "film", suffix, pictures(), 10)
    with Image.open(tmp_path / "film") if suffix == ".gif" else nullcontext() as film:
        if film is not None:
            shown = [
                (frame.convert("RGB").getpixel((5, 5)), frame.info["duration"])
                for frame in ImageSequence.Iterator(film)
            ]
            assert shown == [((20 * i, 9, 9), 200) for i in range(6)]
