"""The panel by real events."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from window_driver import Session, alike

import raymarch as rm

View = Callable[..., Session]

SCENE = """import raymarch as rm
RADIUS = rm.Param("radius", 1.0, 0.5, 2.0)
TINT = rm.Param("tint", (0.8, 0.2, 0.1), 0, 1)
ball = rm.sphere(RADIUS).material(rm.Material(color=TINT))
scene = rm.Scene(ball | rm.box((4, 0.2, 4)).translate((0, -1.2, 0)), rm.Camera((0, 1, 6), (0, 0, 0)))
"""
SIZE = (640, 400)
RIGHT = slice(310, None)


def drawn(text: str = SCENE, **params: Any) -> Any:
    names: dict[str, Any] = {}
    exec(text, names)
    with rm.Renderer(SIZE) as renderer:
        return np.asarray(renderer.render(names["scene"], params=params).image()).astype(int)


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


def test_without_the_extra_the_window_works_and_says_how_to_get_it(view: View, tmp_path: Path) -> None:
    hidden = tmp_path / "hidden" / "imgui_bundle"
    hidden.mkdir(parents=True)
    (hidden / "__init__.py").write_text("raise ImportError('not installed')\n")
    session = view(SCENE, "--size", "640x400", "--panel", path=hidden.parent)
    assert same(session.settled(), drawn())
    mark = session.mark()
    session.hand.key("Tab")
    assert "pip install 'raymarch[view]'" in session.wait("notice", since=mark)["text"]
