"""A person at work, by real events: look about, change a parameter, edit, break, mend, ask, save, leave."""

from __future__ import annotations

import json
import signal
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import raymarch as rm
from tests.support.window_driver import Session, alike
from tests.window.ball import MIDDLE, SCENE, SIZE, drawn, save, scene_of

View = Callable[..., Session]


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

    # More exact, and back: the same picture by another quality.
    mark = session.mark()
    hand.key("x")
    assert session.wait("edited", since=mark)["quality"] == {"max_steps": 2048, "epsilon": 0.02}
    hand.key("Shift_L", "x")
    session.wait("edited", lambda e: e["quality"] == {}, mark)

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


def test_control_c_ends_the_window(view: View) -> None:
    session = view(SCENE, "--size", "320x200")
    session.process.send_signal(signal.SIGINT)
    assert session.end() == 130
    assert session.errors.read_text() == ""


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
