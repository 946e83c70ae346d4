"""`raymarch view` by real events: what the screen shows, and what the command answers."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import raymarch as rm
from raymarch.cli import main
from raymarch.window.toolkit import find
from tests.support.window_driver import PATIENCE, ROOT, Hand, Session, alike

View = Callable[..., Session]
Capture = pytest.CaptureFixture[str]

SCENE = """
import raymarch as rm
scene = rm.Scene(
    rm.sphere(1).material(rm.Material(color=(0.8, 0.2, 0.1))) | rm.box((4, 0.2, 4)).translate((0, -1, 0)),
    camera=rm.Camera(position=(0, 1, 5), target=(0, 0, 0)),
)
"""


def scene_of() -> rm.Scene:
    namespace: dict[str, rm.Scene] = {}
    exec(SCENE, namespace)
    return namespace["scene"]


def command(*arguments: str, display: str | None) -> subprocess.CompletedProcess[str]:
    environment = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY")}
    environment["PYTHONPATH"] = str(ROOT)
    if display:
        environment["DISPLAY"] = display
    line = [sys.executable, "-m", "raymarch", "view", *arguments]
    return subprocess.run(line, env=environment, capture_output=True, text=True, timeout=PATIENCE)


def refused(capfd: Capture, *arguments: str) -> str:
    """The one line of complaint about a command that opens no window."""
    with pytest.raises(SystemExit) as stop:
        main(["view", *arguments])
    assert stop.value.code == 2
    complaint = capfd.readouterr().err
    assert complaint.count("\n") == 1
    return complaint


def test_the_window_shows_what_render_draws_at_every_size(view: View) -> None:
    """A still picture gathers samples; while the window changes its size, no frame of another size is shown."""
    session = view(SCENE, "--size", "200x120", "--samples", "4")
    scene = scene_of()
    smooth = rm.Scene(scene.node, scene.camera, quality=rm.Quality(samples=4))
    seen = session.settled()
    assert alike(seen, np.asarray(rm.render(smooth, (200, 120))).astype(int))
    assert np.abs(seen - np.asarray(rm.render(scene, (200, 120))).astype(int)).max() > 20, "edges are not smooth"
    samples = [e["samples"] for e in session.events() if e["event"] == "frame" and not e["moving"]]
    assert samples == sorted(samples) and samples[-1] == 4
    for size in ((300, 220), (150, 90)):
        mark = session.mark()
        session.hand.resize(*size)
        session.wait("resize", lambda e, size=size: e["size"] == list(size), mark)
        assert alike(session.settled(), np.asarray(rm.render(smooth, size)).astype(int))
    mark = session.mark()
    for i in range(12):
        session.hand.resize(200 + 10 * i, 150 + 7 * (i % 3))
    session.wait("resize", lambda e: e["size"] == [310, 150 + 14], mark)
    session.settled()
    size = [200, 120]
    for event in session.events():
        size = event["size"] if event["event"] == "resize" else size
        if event["event"] == "frame":
            share = event["size"][0] / size[0]
            assert abs(event["size"][1] - share * size[1]) <= 1
    session.hand.close_window()
    assert session.end() == 0
    assert session.complaints() == ""
    assert session.events()[-1]["event"] == "closed"


def test_a_scene_that_compiles_for_long_is_shown_as_a_preview_first(view: View) -> None:
    """Meanwhile another process compiles it; then the window shows what render draws."""
    text = SCENE.replace("    camera=", "    lights=[rm.Sun((1, 2, 1), shadow=True, softness=0.3)],\n    camera=")
    session = view(text, "--size", "200x120")
    events = session.events()
    first = next(e for e in events if e["event"] == "frame")
    assert first["preview"] and not first["whole"]
    assert [e["event"] for e in events if e["event"] in ("reloading", "loaded")] == ["reloading", "loaded"]
    namespace: dict[str, rm.Scene] = {}
    seen = session.settled()
    exec(text, namespace)
    assert alike(seen, np.asarray(rm.render(namespace["scene"], (200, 120))).astype(int))
    session.hand.close_window()
    assert session.end() == 0 and session.complaints() == ""


def test_windows_of_one_pixel_across_live(view: View) -> None:
    """With the panel, whose parts have no room, and after a change of size."""
    session = view(SCENE, "--size", "1x300", "--samples", "2")
    for size in ((1, 300), (300, 1), (1, 1), (40, 30)):
        mark = session.mark()
        if session.hand.size != size:
            session.hand.resize(*size)
            session.wait("resize", lambda e, size=size: e["size"] == list(size), mark)
        session.settled()
        assert session.hand.size == size
    session.hand.close_window()
    assert session.end() == 0 and session.complaints() == ""


def test_a_dense_screen_gets_more_pixels(display: str, view: View) -> None:
    hand = Hand(display)
    hand.set_resource("Xft.dpi:\t192\n")
    try:
        session = view(SCENE, "--size", "200x120")
        opened = session.wait("open")
        assert opened["density"] == 2.0 and opened["size"] == [400, 240]
        assert alike(session.settled(), np.asarray(rm.render(scene_of(), (400, 240))).astype(int))
    finally:
        hand.set_resource("")
        hand.done()


def test_a_demo_of_a_scene_that_is_gone_says_so(view: View) -> None:
    session = view(SCENE, "--size", "160x90", "--demo-seconds", "5")
    session.wait("watching")
    mark = session.mark()
    (session.folder / "scene.py").unlink()
    session.wait("failed", since=mark)
    assert session.end() == 2
    assert session.complaints().startswith("raymarch: ") and "scene.py" in session.complaints()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("import raymarch as rm\nscene = rm.sphere(-1)\n", "scene.py:2: sphere: radius = -1"),
        ("scene = (\n", "scene.py:1: SyntaxError"),
        ("x = 1\n", "scene.py:1: the file defines no 'scene'"),
    ],
)
def test_a_bad_scene_opens_no_window(tmp_path: Path, capfd: Capture, text: str, words: str) -> None:
    file = tmp_path / "scene.py"
    file.write_text(text)
    assert words in refused(capfd, str(file))


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--size", "0x9"), "--size 0x9"),
        (("--budget", "0"), "--budget 0"),
        (("--time", "nan"), "--time nan"),
        (("--set", "radius=9"), "parameter 'radius' = 9 (a number >= 0.5 and <= 2)"),
        (("--set", "other=1"), "unknown parameter 'other'"),
        (("--settings", "deep.json"), "--settings: cannot read 'deep.json': it is broken (RecursionError"),
        (("--settings", "other.json"), "--settings: cannot use 'other.json': these settings cannot be used: KeyError"),
        (("--cost", "deep.json"), "--cost: cannot read 'deep.json': it is broken (RecursionError"),
        (("--cost", "other.json"), "--cost: cannot use 'other.json': these measurements cannot be used"),
        (("--settings", "none.json"), "--settings: cannot read 'none.json'"),
    ],
)
def test_bad_options_are_refused(
    tmp_path: Path, capfd: Capture, monkeypatch: pytest.MonkeyPatch, arguments: tuple[str, ...], words: str
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("deep.json").write_text(100_000 * "[")
    Path("other.json").write_text("{}")
    file = tmp_path / "scene.py"
    file.write_text("import raymarch as rm\nscene = rm.sphere(rm.Param('radius', 1, 0.5, 2))\n")
    assert words in refused(capfd, str(file), *arguments)


def test_without_a_display_it_says_so(tmp_path: Path) -> None:
    file = tmp_path / "scene.py"
    file.write_text(SCENE)
    done = command(str(file), display=None)
    assert done.returncode == 2
    assert "DISPLAY" in done.stderr and "desktop" in done.stderr and done.stderr.count("\n") == 1


def test_without_glfw_it_says_so(tmp_path: Path, capfd: Capture, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "scene.py").write_text(SCENE)
    monkeypatch.setitem(sys.modules, "glfw", None)
    words = refused(capfd, str(tmp_path / "scene.py"))
    assert "glfw cannot be imported" in words and "pip install glfw" in words


def test_without_the_extra_there_is_no_panel(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "imgui_bundle", None)
    assert find() is None
