"""The panel by real events."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import raymarch as rm
from raymarch.window.theme import ACCENT
from tests.support.window_driver import Session, alike

View = Callable[..., Session]

SCENE = """import raymarch as rm
RADIUS = rm.Param("radius", 1.0, 0.5, 2.0)
TINT = rm.Param("tint", (0.8, 0.2, 0.1), 0, 1)
ball = rm.sphere(RADIUS).material(rm.Material(color=TINT))
scene = rm.Scene(ball | rm.box((4, 0.2, 4)).translate((0, -1.2, 0)), rm.Camera((0, 1, 6), (0, 0, 0)))
"""
SIZE = (640, 400)
RIGHT = slice(310, None)


def drawn(text: str = SCENE, time: float = 0.0, **params: Any) -> Any:
    names: dict[str, Any] = {}
    exec(text, names)
    with rm.Renderer(SIZE) as renderer:
        return np.asarray(renderer.render(names["scene"], time, params).image()).astype(int)


def same(seen: Any, expected: Any) -> bool:
    """Beside the panel and below notices."""
    return alike(seen[150:, RIGHT], expected[150:, RIGHT])


def test_sliders_switches_and_editors(view: View) -> None:
    session = view(SCENE, "--size", "640x400", "--panel")
    hand = session.hand
    assert same(session.settled(), drawn())
    compiled = session.wait("frame")["compiled"]

    # A slider: the picture follows, the camera stays, and nothing is compiled.
    x, y = session.item("radius")
    mark = session.mark()
    hand.drag((x - 60, y), (x + 20, y))
    seen = session.settled()
    moved = [e["value"] for e in session.events()[mark:] if e["event"] == "param"]
    assert moved and same(seen, drawn(radius=moved[-1]))
    frames = [e for e in session.events() if e["event"] == "frame"]
    assert frames[-1]["compiled"] == compiled

    # The wheel over the panel is the panel's.
    hand.move(x, y)
    hand.wheel(-3)
    assert same(session.settled(), seen.astype(int))

    # What was moved, as Python.
    mark = session.mark()
    hand.click(*session.item("copy parameters"))
    assert session.wait("notice", since=mark)["text"].startswith('copied\nrm.Param("radius", ')

    # The lights, taken over; one more; its shadow. Then as the file says.
    for name in ("Parameters", "View", "Lights"):  # the first two are closed
        session.settled()
        hand.click(*session.item(name))
    session.settled()
    for name in ("edit lights", "shadow 1", "remove 1", "add PointLight"):
        mark = session.mark()
        hand.click(*session.item(name))
        edited = session.wait("edited", since=mark)
        after = session.settled()
    assert edited["lights"] == ["PointLight"] and not same(after, seen.astype(int))
    mark = session.mark()
    hand.click(*session.item("copy lights"))
    text = session.wait("notice", since=mark)["text"]
    assert "rm.PointLight(position=" in text
    mark = session.mark()
    hand.click(*session.item("drop lights"))
    assert session.wait("edited", since=mark)["lights"] is None
    session.settled()

    # Hidden, the panel takes no events.
    hand.key("Tab")
    hidden = session.settled()
    assert same(hidden, seen.astype(int)) and np.abs(hidden[200, :300].astype(int) - hidden[200, 300]).min() == 0
    hand.drag((100, 200), (160, 200))
    assert not same(session.settled(), seen.astype(int))
    assert session.errors.read_text() == ""


def test_materials_time_views_quality_and_figures(view: View) -> None:
    text = SCENE.replace("rm.sphere(RADIUS)", "rm.sphere(RADIUS).translate((0.2 * rm.time, 0, 0))")
    session = view(text, "--size", "640x400", "--panel", moving=True)
    hand = session.hand

    def logged(event: str, act: Callable[[], None]) -> dict[str, Any]:
        mark = session.mark()
        act()
        return session.wait(event, since=mark)

    def unfold(*names: str) -> None:
        for name in names:
            hand.click(*session.item(name))
            session.settled()

    # Time: paused by the key, then moved by its slider; the picture is that of the moment it says.
    hand.key("space")
    session.settled()
    x, y = session.item("time")
    moment = logged("scrub", lambda: hand.drag((x - 20, y), (x + 10, y)))["time"]
    seen = session.settled()
    moment = [e["time"] for e in session.events() if e["event"] == "scrub"][-1]
    assert moment > 0 and same(seen, drawn(text, moment))

    # A material: its colour becomes sliders; one is moved.
    unfold("Parameters", "View", "Time", "Materials")
    logged("edited", lambda: hand.click(*session.item("edit material 1")))
    session.settled()
    x, y = session.item("material 1 specular")
    name = logged("param", lambda: hand.drag((x - 20, y), (x - 50, y)))["name"]
    assert name == "material 1 specular" and not same(session.settled(), seen.astype(int))
    edited = logged("notice", lambda: hand.click(*session.item("copy materials")))["text"]
    assert "material_1 = rm.Material(" in edited and "specular=" in edited and "scene.py:4" in edited
    assert logged("edited", lambda: hand.click(*session.item("drop materials")))["materials"] == []
    assert same(session.settled(), seen.astype(int))

    # Another tracer, and another view: the second of each list.
    unfold("Materials", "Quality")
    x, y = session.item("quality tracer")
    hand.click(x, y)
    session.settled()
    assert logged("edited", lambda: hand.click(x, y + 44))["quality"]["tracer"] != "auto"
    unfold("Quality", "View")
    x, y = session.item("view")
    hand.click(x, y)
    session.settled()
    assert logged("view", lambda: hand.click(x, y + 44))["name"] != "final"
    session.settled()

    # The graph has bars for the scene's part of each frame; the plan opens.
    unfold("View", "Frame", "Plan")
    shown = session.settled()[:, : session.item("Frame")[0]]
    bars = np.all(np.abs(shown.astype(int) - [round(255 * c) for c in ACCENT]) <= 2, axis=-1)
    assert bars.sum() > 50
    assert session.errors.read_text() == ""


def test_edits_stay_over_a_file_that_changes(view: View) -> None:
    session = view(SCENE, "--size", "640x400", "--panel")
    session.wait("watching")
    session.hand.click(*session.item("Lights"))
    session.settled()
    session.hand.click(*session.item("edit lights"))
    session.settled()
    mark = session.mark()
    session.hand.click(*session.item("remove 1"))
    session.wait("edited", lambda e: e["lights"] == [], mark)
    dark = session.settled()
    compiled = []
    for height in ("-1.25", "-1.3", "-1.35"):
        mark = session.mark()
        (session.folder / "scene.py").write_text(SCENE.replace("-1.2", height))
        compiled.append(session.wait("loaded", since=mark)["compiled"] > 0)
        assert session.settled()[200, RIGHT].mean() < 1.2 * dark[200, RIGHT].mean()  # the light is still away
    assert compiled == [True, False, False]


def test_without_the_extra_the_window_works_and_says_how_to_get_it(view: View, tmp_path: Path) -> None:
    hidden = tmp_path / "hidden" / "imgui_bundle"
    hidden.mkdir(parents=True)
    (hidden / "__init__.py").write_text("raise ImportError('not installed')\n")
    session = view(SCENE, "--size", "640x400", "--panel", path=hidden.parent)
    assert same(session.settled(), drawn())
    mark = session.mark()
    session.hand.key("Tab")
    assert "pip install 'raymarch[view]'" in session.wait("notice", since=mark)["text"]
