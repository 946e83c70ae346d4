"""Files that change while the window is open: edited, broken, endless, gone."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import pytest

from raymarch.window.reload import Fault
from tests.support.window_driver import PATIENCE, Session, alike
from tests.window.ball import MIDDLE, SCENE, drawn, save, scene_of

View = Callable[..., Session]


def test_an_imported_module_is_followed_too(view: View, tmp_path: Path) -> None:
    (tmp_path / "parts.py").write_text("COLOR = (0.9, 0.1, 0.1)\n")
    text = (
        "import raymarch as rm\nfrom parts import COLOR\nscene = rm.Scene(rm.sphere().material(rm.Material(COLOR)))\n"
    )
    session = view(text, "--size", "320x200")
    session.wait("watching")
    mark = session.mark()
    (tmp_path / "parts.py").write_text("COLOR = (0.1, 0.9, 0.1)\n")
    session.wait("loaded", since=mark)
    red, green = session.settled()[100, 160, :2]
    assert green > red
    mark = session.mark()
    (tmp_path / "parts.py").write_text("COLOR = \n")
    failed = session.wait("failed", since=mark)
    assert (Path(failed["file"]).name, failed["line"]) == ("parts.py", 1)
    (tmp_path / "parts.py").unlink()
    session.wait("failed", lambda e: "parts" in e["what"], mark)
    (tmp_path / "parts.py").write_text("COLOR = (0.1, 0.9, 0.1)\n")
    session.wait("loaded", since=mark)


HANGS = {
    "a loop": ("while True:\n    pass\n", (2, 3)),
    "a loop that holds on": ("while True:\n    try:\n        while True: pass\n    except: pass\n", (4,)),
    "a sleep": ("import time\ntime.sleep(1000)\n", (3,)),
    "a loop of C code": ("import itertools\nany(itertools.repeat(False))\n", (3,)),
}


def test_a_file_that_is_dropped_is_opened(view: View, tmp_path: Path) -> None:
    session = view(SCENE, "--size", "320x200")
    session.settled()
    other = tmp_path / "other scene.py"
    other.write_text(SCENE.replace("(0.8, 0.2, 0.1)", "(0.1, 0.8, 0.2)").replace("(0, 1, 6)", "(0, 2, 6)"))
    mark = session.mark()
    session.hand.drop(other)
    session.wait("loaded", since=mark)
    assert alike(session.settled(), drawn(scene_of(other.read_text())))
    mark = session.mark()
    other.write_text(SCENE)  # the new file is followed, the old one no more
    session.wait("loaded", since=mark)
    mark = session.mark()
    session.hand.drop(session.folder / "scene.txt")
    assert "drop a scene file" in session.wait("notice", since=mark)["text"]


def test_an_edit_that_leaves_the_shader_alone_compiles_nothing(view: View) -> None:
    """A comment, the camera, the default of a parameter, a number that was edited before: not so another shape."""
    session = view(SCENE, "--size", "320x200")
    for edited, compiles in (
        (SCENE + "# a comment\n", 0),
        (SCENE.replace("position=(0, 1, 6)", "position=(1, 2, 6)"), False),
        (SCENE.replace('"radius", 1.0', '"radius", 1.2'), False),
        (SCENE.replace("-1.2", "-1.3"), True),
        (SCENE.replace("-1.2", "-1.35"), False),  # it is a uniform now
        (SCENE.replace("-1.2", "-1.35").replace("(0, 0, 0)", "(0, 0.25, 0)"), False),
        (SCENE.replace("ball | floor", "ball"), True),
    ):
        mark = save(session, edited)
        assert bool(session.wait("loaded", since=mark)["compiled"]) == compiles, edited
        assert alike(session.settled(), drawn(scene_of(edited), None))


def test_escape_does_not_spoil_a_scene_that_is_shown(view: View) -> None:
    """While it is tried out in the background, to find what it reads."""
    session = view(SCENE, "--size", "320x200")
    for _ in range(3):
        session.hand.key("Escape")
    session.wait("watching")
    assert not [e for e in session.events() if e["event"] == "failed"]


def test_a_message_calls_a_file_as_the_current_folder_does(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "scene.py").write_text("one\ntwo\n")
    fault = Fault("it is wrong", "right", str(tmp_path / "scene.py"), 2)
    assert fault.text() == f"{tmp_path}/scene.py:2\n2 | two\nit is wrong\n(right)"
    monkeypatch.chdir(tmp_path)
    assert fault.text() == "scene.py:2\n2 | two\nit is wrong\n(right)"


def test_what_hangs_can_be_stopped(view: View) -> None:
    session = view(SCENE, "--size", "320x200")
    start = session.settled()
    for name, (text, lines) in HANGS.items():
        mark = save(session, f"import raymarch as rm\n{text}{SCENE}")
        session.wait("reloading", since=mark)
        session.hand.key("Escape")
        failed = session.wait("failed", since=mark)
        assert "stopped after" in failed["what"], name
        assert failed["line"] in lines and Path(failed["file"]).name == "scene.py", (name, failed)
    mark = save(session, SCENE + "while True:\n    pass\n")
    session.wait("reloading", since=mark)
    mark = save(session, SCENE)  # the next save takes the place of what hangs
    session.wait("loaded", since=mark)
    assert alike(session.settled(), start)


def processes() -> dict[int, int]:
    """The parent of each process."""
    found = {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                found[int(entry.name)] = int((entry / "stat").read_text().rpartition(")")[2].split()[1])
            except OSError:  # it has ended meanwhile
                continue
    return found


def test_a_killed_window_leaves_no_process(view: View) -> None:
    session = view(SCENE, "--size", "320x200")
    session.wait("watching")
    mark = save(session, "while True:\n    pass\n")
    session.wait("reloading", since=mark)
    parents = processes()
    children = {pid for pid, parent in parents.items() if parent == session.process.pid}
    children |= {pid for pid, parent in parents.items() if parent in children}
    assert children
    session.process.kill()
    session.process.wait()
    until = time.monotonic() + PATIENCE
    while children & processes().keys() and time.monotonic() < until:
        time.sleep(0.05)
    assert not children & processes().keys()


CRASHES = {
    "sys.exit": "import sys\nsys.exit(3)\n",
    "os._exit": "import os\nos._exit(3)\n",
    "a crash": "import ctypes\nctypes.string_at(0)\n",
    "a deep recursion": "def f(): return f()\nf()\n",
    "all of the memory": "x = [0] * 10**13\n",
}


def test_a_scene_that_ends_or_crashes_python_leaves_the_window(view: View) -> None:
    session = view(SCENE, "--size", "320x200")
    start = session.settled()
    for name, text in CRASHES.items():
        mark = save(session, f"import raymarch as rm\n{text}")
        failed = session.wait("failed", since=mark)
        assert Path(failed["file"]).name == "scene.py", name
    mark = save(session, SCENE)
    session.wait("loaded", since=mark)
    assert alike(session.settled(), start)


def test_a_scene_that_is_deleted_comes_back(view: View) -> None:
    session = view(SCENE, "--size", "320x200")
    session.settled()
    mark = session.mark()
    (session.folder / "scene.py").unlink()
    failed = session.wait("failed", since=mark)
    assert "cannot read scene file" in failed["what"]
    mark = session.mark()
    session.hand.drag(MIDDLE, (100, 100))
    session.settled()
    mark = save(session, SCENE)
    session.wait("loaded", since=mark)


def test_a_parameter_outside_its_new_range_is_moved_into_it(view: View) -> None:
    session = view(SCENE, "--size", "320x200", "--set", "radius=1.9")
    session.settled()
    mark = save(session, SCENE.replace("1.0, 0.5, 2.0", "1.0, 0.5, 1.5"))
    session.wait("loaded", since=mark)
    assert session.wait("notice", since=mark)["text"] == "radius = 1.9 lies outside its new range; it is 1.5 now"
    assert alike(session.settled()[120:], drawn(scene_of(SCENE), 1.5)[120:])
