"""A person at work, by real events: look about, change a parameter, edit, break, mend, ask, save, leave."""

from __future__ import annotations

import json
import os
import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from window_driver import PATIENCE, Session, alike

import raymarch as rm

View = Callable[..., Session]

SCENE = """import raymarch as rm

RADIUS = rm.Param("radius", 1.0, 0.5, 2.0)
ball = rm.sphere(RADIUS).material(rm.Material(color=(0.8, 0.2, 0.1)))
floor = rm.box((4, 0.2, 4)).translate((0, -1.2, 0))
scene = rm.Scene(
    ball | floor,
    camera=rm.Camera(position=(0, 1, 6), target=(0, 0, 0)),
)
"""
SIZE = (320, 200)
MIDDLE = (160, 100)


def save(session: Session, text: str) -> int:
    """Save as editors do: a new file is renamed over the old one. The log's mark before that."""
    mark = session.mark()
    fresh = session.folder / "scene.py.new"
    fresh.write_text(text)
    os.replace(fresh, session.folder / "scene.py")
    return mark


def drawn(scene: rm.Scene, radius: float | None = 1.0) -> Any:
    """The picture with a value of the parameter; None is its default."""
    with rm.Renderer(SIZE) as renderer:
        params = {} if radius is None else {"radius": radius}
        return np.asarray(renderer.render(scene, params=params).image()).astype(int)


def scene_of(text: str, camera: rm.Camera | None = None) -> rm.Scene:
    namespace: dict[str, Any] = {}
    exec(text, namespace)
    scene: rm.Scene = namespace["scene"]
    return scene if camera is None else rm.Scene(scene.node, camera)


def test_a_session(view: View) -> None:
    session = view(SCENE, "--size", "320x200")
    hand = session.hand
    start = session.settled()
    assert alike(start, drawn(scene_of(SCENE)))

    # Orbit, pan, come nearer, fly: the picture changes, and the copied line is the camera that draws it.
    for act in (
        lambda: hand.drag(MIDDLE, (220, 130)),
        lambda: hand.drag(MIDDLE, (170, 90), button=2),
        lambda: hand.wheel(2),
        lambda: (hand.hold("s"), session.wait("frame", since=session.mark()), hand.let_go("s")),
    ):
        before, mark = hand.see(), session.mark()
        act()
        assert not np.array_equal(session.settled(), before)
    mark = session.mark()
    hand.key("c")
    line = session.wait("notice", since=mark)["text"].removeprefix("copied ")
    hand.key("h"), hand.key("h")
    camera: rm.Camera = eval("rm." + line, {"rm": rm})

    # A parameter: no plan and no compile, and the picture is the true one.
    compiled = session.events()[-1].get("compiled") or session.wait("frame")["compiled"]
    hand.key("n")
    mark = session.mark()
    for _ in range(5):
        hand.key("Right")
    value = session.wait("param", lambda e: e["value"] > 1.14, mark)["value"]
    hand.key("Escape")
    seen = session.settled()
    assert session.wait("frame", lambda e: e["whole"], mark)["compiled"] == compiled
    bottom = slice(100, None)  # notices stand above for a while
    assert alike(seen[bottom], drawn(scene_of(SCENE, camera), value)[bottom])

    # Edit: camera and parameter stay.
    edited = SCENE.replace("(0.8, 0.2, 0.1)", "(0.1, 0.3, 0.9)")
    mark = save(session, edited)
    session.wait("loaded", since=mark)
    seen = session.settled()
    assert alike(seen[bottom], drawn(scene_of(edited, camera), value)[bottom])

    # Break: the picture stays, goes on moving, and the message says where.
    mark = save(session, edited.replace("(4, 0.2, 4)", "(4, -0.2, 4)"))
    failed = session.wait("failed", since=mark)
    assert (Path(failed["file"]).name, failed["line"]) == ("scene.py", 5)
    assert "size" in failed["what"] and "-0.2" in failed["what"]
    mark = session.mark()
    hand.drag(MIDDLE, (120, 100))
    broken = session.settled()
    assert np.any(broken[:90] != seen[:90])
    assert np.any(np.all(broken[-40:] == (92, 14, 14), axis=-1)), "no message lies over the picture"
    hand.drag((120, 100), MIDDLE)

    # Mend: the message goes.
    mark = save(session, edited)
    session.wait("loaded", since=mark)
    seen = session.settled()
    assert not np.any(np.all(seen == (92, 14, 14), axis=-1))

    # Ask: the ball, its line, and what is true.
    mark = session.mark()
    hand.key("r")
    session.settled()
    hand.click(*MIDDLE)
    pick, truth = session.wait("pick", since=mark), session.wait("truth", since=mark)
    assert (truth["part"], truth["line"], Path(truth["file"]).name) == ("sphere", 4, "scene.py")
    ray = np.array([0, -1, -6]) / np.sqrt(37)
    distance = np.sqrt(37) - value
    assert abs(truth["distance"] - distance) < 2e-2 and abs(pick["distance"] - truth["distance"]) < 1e-3
    assert np.allclose(pick["position"], np.array([0, 1, 6]) + pick["distance"] * ray, atol=0.05)
    assert np.allclose(pick["normal"], -ray, atol=0.05) and pick["evaluations"] > 0

    # Save the picture and the settings, and leave.
    hand.key("p")
    saved = session.wait("saved", since=mark)
    picture = np.asarray(Image.open(session.folder / saved["file"])).astype(int)
    assert alike(picture, drawn(scene_of(edited), value))
    mark = session.mark()
    hand.key("Control_L", "s")
    settings = json.loads((session.folder / session.wait("saved", since=mark)["file"]).read_text())
    assert settings["params"] == {"radius": value}
    hand.key("Control_L", "q")
    assert session.end() == 0
    assert session.errors.read_text() == ""
    assert not [e for e in session.events() if e["event"] == "closed" and e["code"]]


def test_settings_open_as_they_were_saved(view: View, tmp_path: Path) -> None:
    camera = {"position": [1, 1, 6], "target": [0, 0, 0], "up": [0, 1, 0], "fov": 40.0}
    settings = {"camera": camera, "params": {"radius": 1.4}, "time": 0.0, "view": "final"}
    (tmp_path / "kept.json").write_text(json.dumps(settings))
    session = view(SCENE, "--size", "320x200", "--settings", "kept.json")
    expected = drawn(scene_of(SCENE, rm.Camera((1, 1, 6), (0, 0, 0), fov=40)), 1.4)
    assert alike(session.settled(), expected)


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


def test_focus_turns_about_what_is_under_the_cursor(view: View) -> None:
    session = view(SCENE, "--size", "320x200")
    session.settled()
    mark = session.mark()
    session.hand.move(175, 90)
    session.hand.key("f")
    point = session.wait("focus", since=mark)["point"]
    assert np.isclose(np.linalg.norm(point), 1.0, atol=0.01)  # of the ball
    session.settled()
    mark = session.mark()
    session.hand.click(*MIDDLE)
    assert np.allclose(session.wait("pick", since=mark)["position"], point, atol=0.03)
    before = session.hand.see()
    session.hand.drag(MIDDLE, (190, 100))
    session.settled()
    mark = session.mark()
    session.hand.click(*MIDDLE)
    assert np.allclose(session.wait("pick", since=mark)["position"], point, atol=0.03)
    assert not np.array_equal(before, session.hand.see())


def test_a_loop_is_saved_as_a_sequence(view: View) -> None:
    text = SCENE.replace("ball | floor", "ball.translate((rm.time, 0, 0)) | floor")
    session = view(text, "--size", "320x200", moving=True)
    hand = session.hand
    for name in ("space", "Home", "period", "period", "period"):
        hand.key(name)
    hand.key("l")
    mark = session.mark()
    hand.key("Shift_L", "p")
    saved = session.wait("saved", since=mark)
    files = sorted((session.folder / saved["file"]).iterdir())
    assert saved["count"] == 3 and [f.name for f in files] == [f"frame-{i:04d}.png" for i in range(3)]
    scene = scene_of(text)
    with rm.Renderer(SIZE) as renderer:
        for i, file in enumerate(files):
            assert alike(Image.open(file), renderer.render(scene, i / 30).image())


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
    """A comment, the camera, the default of a parameter; a number in the scene is another shader."""
    session = view(SCENE, "--size", "320x200")
    for edited, compiles in (
        (SCENE + "# a comment\n", 0),
        (SCENE.replace("position=(0, 1, 6)", "position=(1, 2, 6)"), False),
        (SCENE.replace('"radius", 1.0', '"radius", 1.2'), False),
        (SCENE.replace("-1.2", "-1.3"), True),
    ):
        mark = save(session, edited)
        assert bool(session.wait("loaded", since=mark)["compiled"]) == compiles, edited
        assert alike(session.settled(), drawn(scene_of(edited), None))


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


def test_control_c_ends_the_window(view: View) -> None:
    session = view(SCENE, "--size", "320x200")
    session.process.send_signal(signal.SIGINT)
    assert session.end() == 130
    assert session.errors.read_text() == ""


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


def test_time_plays_pauses_and_steps(view: View) -> None:
    text = SCENE.replace("ball | floor", "ball.translate((rm.time, 0, 0)) | floor")
    session = view(text, "--size", "320x200", moving=True)
    hand = session.hand
    hand.key("space")
    paused = session.wait("time", lambda e: not e["playing"])
    assert paused["time"] > 0
    mark = session.mark()
    hand.key("Home")
    session.wait("time", lambda e: e["time"] == 0, mark)
    session.settled()
    hand.key("period")
    assert np.isclose(session.wait("time", lambda e: e["time"] > 0, mark)["time"], 1 / 30)
    hand.key("comma")
    assert np.isclose(session.wait("time", lambda e: e["time"] == 0, mark)["time"], 0)


@pytest.mark.parametrize("name", ["depth", "normal", "slice", "boxes"])
def test_other_views_show_what_render_shows(view: View, name: str, tmp_path: Path) -> None:
    from raymarch.gpu.views import VIEWS, picture

    session = view(SCENE, "--size", "320x200")
    session.settled()
    for _ in range(list(VIEWS).index(name)):
        mark = session.mark()
        session.hand.key("v")
        session.wait("notice", since=mark)
    seen = session.settled()
    scene = scene_of(SCENE)
    with rm.Renderer(SIZE) as renderer:
        expected = np.asarray(picture(renderer.render(scene, outputs=VIEWS[name]), name, scene).convert("RGB"))
    aside = np.s_[:, 160:]  # a notice for each view on the way stands on the left
    assert alike(seen[aside], expected[aside])
