"""A person at work in a real window, by real events: look about, change, edit, break, mend, ask, save, leave."""

from __future__ import annotations

import json
import signal
from collections.abc import Callable
from pathlib import Path

import av
import numpy as np
from PIL import Image

import raymarch as rm
from tests.support.window_driver import Session, alike
from tests.window.ball import MIDDLE, SCENE, SIZE, drawn, scene_of

View = Callable[..., Session]
BELOW = slice(110, None)
"""Rows below the notices."""


def test_a_session(view: View) -> None:
    session = view(SCENE, "--size", "320x200")
    hand = session.hand
    assert alike(session.settled(), drawn(scene_of(SCENE)))

    # Orbit, come nearer, fly: the picture changes, and the copied line is the camera that draws it.
    for act in (
        lambda: hand.drag(MIDDLE, (220, 130)),
        lambda: hand.wheel(2),
        lambda: (hand.hold("s"), session.wait("frame", since=session.mark()), hand.let_go("s")),
    ):
        before = hand.see()
        act()
        assert not np.array_equal(session.settled(), before)
    mark = session.mark()
    hand.key("c")
    line = session.wait("notice", since=mark)["text"].removeprefix("copied ")
    camera: rm.Camera = eval(line, {"rm": rm})

    # A parameter: no plan and no compile, and the picture is the true one.
    compiled = session.events()[-1].get("compiled") or session.wait("frame")["compiled"]
    hand.key("n")
    mark = session.mark()
    value = session.raised(5)
    assert value > 1.14
    hand.key("Escape")
    seen = session.settled()
    assert session.wait("frame", lambda e: e["whole"], mark)["compiled"] == compiled
    assert alike(seen[BELOW], drawn(scene_of(SCENE, camera), value)[BELOW])

    # Edit: camera and parameter stay.
    marched = "    ball | floor, quality=rm.Quality(analytic=False),"  # so that a picked ray evaluates the field
    edited = SCENE.replace("(0.8, 0.2, 0.1)", "(0.1, 0.3, 0.9)").replace("    ball | floor,", marched)
    mark = session.save(edited)
    session.wait("loaded", since=mark)
    seen = session.settled()
    assert alike(seen[BELOW], drawn(scene_of(edited, camera), value)[BELOW])

    # Break: the picture stays, goes on moving, and the message says where.
    mark = session.save(edited.replace("(4, 0.2, 4)", "(4, -0.2, 4)"))
    failed = session.wait("failed", since=mark)
    assert (Path(failed["file"]).name, failed["line"]) == ("scene.py", 5)
    assert "size" in failed["what"] and "-0.2" in failed["what"]
    hand.drag(MIDDLE, (120, 100))
    broken = session.settled()
    assert np.any(broken[:90] != seen[:90])
    assert np.any(np.all(broken[-40:] == (92, 14, 14), axis=-1)), "no message lies over the picture"

    # Mend: the message goes.
    mark = session.save(edited)
    session.wait("loaded", since=mark)
    assert not np.any(np.all(session.settled() == (92, 14, 14), axis=-1))

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

    # Save the picture and the settings.
    hand.key("p")
    saved = session.wait("saved", since=mark)
    picture = np.asarray(Image.open(session.folder / saved["file"])).astype(int)
    assert alike(picture, drawn(scene_of(edited), value))
    mark = session.mark()
    hand.key("Control_L", "s")
    settings = json.loads((session.folder / session.wait("saved", since=mark)["file"]).read_text())
    assert settings["params"] == {"radius": value}

    # Drop another file, and leave.
    other = session.folder / "other scene.py"
    other.write_text(SCENE.replace("(0, 1, 6)", "(0, 2, 6)"))
    mark = session.mark()
    hand.drop(other)
    session.wait("loaded", since=mark)
    hand.key("Control_L", "q")
    assert session.end() == 0
    assert session.complaints() == ""
    assert not [e for e in session.events() if e["event"] == "closed" and e["code"]]


def test_a_scene_that_moves(view: View, tmp_path: Path) -> None:
    """Opened with settings; paused and stepped; its loop saved as a sequence; ended by Ctrl+C in the shell."""
    text = SCENE.replace("ball | floor", "ball.translate((rm.time, 0, 0)) | floor")
    camera = {"position": [1, 1, 6], "target": [0, 0, 0], "up": [0, 1, 0], "fov": 40.0}
    settings = {"camera": camera, "params": {"radius": 1.4}, "time": 0.0, "view": "final"}
    (tmp_path / "kept.json").write_text(json.dumps(settings))
    session = view(text, "--size", "320x200", "--settings", "kept.json", "--time", "20", moving=True)
    hand = session.hand
    session.wait("frame", lambda e: e["n"] > 2)  # the first is shown before the clock runs
    hand.key("space")
    assert session.wait("time", lambda e: not e["playing"])["time"] > 20
    for name in ("Home", "period", "period", "period", "l"):
        hand.key(name)
    mark = session.mark()
    hand.key("Shift_L", "p")
    saved = session.wait("saved", since=mark)
    files = sorted((session.folder / saved["file"]).iterdir())
    assert saved["count"] == 3 and [f.name for f in files] == [f"frame-{i:04d}.png" for i in range(3)]
    scene = scene_of(text, rm.Camera((1, 1, 6), (0, 0, 0), fov=40))
    with rm.Renderer(SIZE) as renderer:
        for i, file in enumerate(files):
            assert alike(Image.open(file), renderer.render(scene, i / 30, {"radius": 1.4}).image())
    # The same as a film, which has the same pictures.
    mark = session.mark()
    hand.key("Control_L", "p")
    film = session.folder / session.wait("saved", since=mark)["file"]
    with av.open(film) as container:
        frames = [frame.to_ndarray(format="rgb24").astype(int) for frame in container.decode(video=0)]
    assert film.suffix == ".mp4" and len(frames) == 3 and not (session.folder / "scene-2").exists()
    assert np.abs(frames[2] - np.asarray(Image.open(files[2]).convert("RGB"), int)).mean() < 3
    session.process.send_signal(signal.SIGINT)
    assert session.end() == 130
    assert session.complaints() == ""


def test_the_panel_and_a_split_picture(view: View) -> None:
    session = view(SCENE, "--size", "640x400", "--panel")
    hand, beside = session.hand, np.s_[150:, 256:]

    def expected(radius: float) -> np.ndarray:
        with rm.Renderer((384, 400)) as renderer:
            frame = renderer.render(scene_of(SCENE), params={"radius": radius})
            return np.asarray(frame.image()).astype(int)[150:]

    # The picture is centred in what the panel leaves free; a slider moves it and compiles nothing.
    assert alike(session.settled()[beside], expected(1.0))
    compiled = session.wait("frame")["compiled"]
    x, y = session.item("radius")
    mark = session.mark()
    hand.drag((x - 60, y), (x + 20, y))
    seen = session.settled()
    moved = [e["value"] for e in session.events()[mark:] if e["event"] == "param"]
    assert moved and alike(seen[beside], expected(moved[-1]))
    assert [e for e in session.events() if e["event"] == "frame"][-1]["compiled"] == compiled
    hand.move(x, y)
    hand.wheel(-3)  # the panel's
    assert alike(session.settled()[beside], seen[beside])

    # Beside the most exact setting the picture is nearly the same, and the divider is drawn and dragged.
    hand.key("k")
    split = session.settled()
    line = np.all(split[150:] == 255, axis=-1).all(axis=0)
    assert np.flatnonzero(line).tolist() == [448]
    off_line = np.delete(split[beside], slice(187, 197), axis=1)
    assert alike(off_line, np.delete(seen[beside], slice(187, 197), axis=1))
    hand.drag((448, 300), (540, 300))
    at = (540 - 256) / 384
    assert not np.array_equal(session.settled()[150:, 535:545], split[150:, 535:545])

    # Beside the reference, with the errors over the picture: both are computed tile by tile.
    hand.key("k"), hand.key("o")
    session.wait("compare", lambda e: e["over"] == "errors" and e["side"] == "truth")
    mark = session.mark()
    hand.resize(400, 300)  # 200 x 300 pixels beside the panel
    session.wait("reference", lambda e: e["share"] == 1.0, mark)
    with rm.Renderer((200, 300)) as renderer:
        frame = renderer.render(scene_of(SCENE), params={"radius": moved[-1]})
        rendered = np.asarray(frame.image()).astype(int)
    rows, divider = slice(150, 205), 200 + round(200 * at)
    compared = session.settled()[rows].astype(int)
    assert np.abs(compared[:, divider + 3 :] - rendered[rows, divider - 197 :]).mean() < 4  # the same scene in float64
    assert compared[:, 250 : divider - 3].mean() < 0.7 * rendered[rows, 50 : divider - 203].mean()  # dimmed: no error

    # Hidden, the panel leaves the whole window.
    hand.key("k"), hand.key("o"), hand.key("Tab")
    with rm.Renderer((400, 300)) as renderer:
        whole = np.asarray(renderer.render(scene_of(SCENE), params={"radius": moved[-1]}).image()).astype(int)
    assert alike(session.settled()[215:], whole[215:])  # below the messages
    assert session.complaints() == ""


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
        mark = session.save(edited)
        assert bool(session.wait("loaded", since=mark)["compiled"]) == compiles, edited
        assert alike(session.settled(), drawn(scene_of(edited), None))
