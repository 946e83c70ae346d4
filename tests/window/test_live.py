"""The panel, the keys and the file at the same time, by real events in one window."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from tests.support.window_driver import Session

SCENE = """import raymarch as rm
RADIUS = rm.Param("radius", 1.0, 0.5, 2.0)
ball = rm.sphere(RADIUS).material(rm.Material(color="tomato", ambient=0, specular=0))
floor = rm.box((4, 0.2, 4)).translate((0, -1.2, 0))
open(__file__ + ".runs", "a").write("x")
scene = rm.Scene(ball | floor, camera=rm.Camera((0, 1, 6), (0, 0, 0)), lights=[rm.Sun((0, 1, 6))])
"""
TOMATO = (255, 99, 71)
BALL = (470, 320)
"""A pixel of the ball, in the middle of what the panel leaves free."""


@pytest.fixture(scope="module")
def shared(display: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Session]:
    folder = tmp_path_factory.mktemp("window")
    (folder / "scene.py").write_text(SCENE)
    session = Session(display, folder, folder / "scene.py", "--size", "640x640", "--panel")
    session.wait("watching")
    yield session
    session.kill()


@pytest.fixture
def session(shared: Session) -> Session:
    """The window on the scene as it is, with the panel, nothing moved and no message."""
    shared.hand.move(*BALL)
    shared.hand.key("Escape")
    if (shared.folder / "scene.py").read_text() != SCENE:
        shared.wait("loaded", since=shared.save(SCENE))
    shared.hand.key("r")
    shared.settled()
    return shared


def pixel(picture: Any, at: tuple[int, int]) -> tuple[int, ...]:
    return tuple(int(v) for v in picture[at[1], at[0]])


def near(seen: tuple[int, ...], wanted: tuple[int, ...], most: int = 3) -> bool:
    return max(abs(a - b) for a, b in zip(seen, wanted, strict=True)) <= most


def shown_panel(session: Session, *names: str) -> None:
    """Open sections of the panel, unless they are open."""
    for name, inside in zip(names[::2], names[1::2], strict=True):
        if inside not in session.places():
            mark = session.mark()
            session.hand.click(*session.item(name))
            session.wait("items", lambda e, inside=inside: inside in e["at"], mark)
    session.hand.move(*BALL)


def test_a_file_runs_once_for_each_edit(session: Session) -> None:
    """And at the start, when a trial only warms shaders."""
    runs = session.folder / "scene.py.runs"
    assert runs.read_text() == "x"
    for count, color in enumerate(("gold", "navy"), 2):
        mark = session.save(SCENE.replace("tomato", color))
        session.wait("loaded", since=mark)
        assert len(runs.read_text()) == count


def test_tab_never_reaches_the_fields_of_the_panel(session: Session) -> None:
    hand, mark = session.hand, session.mark()
    hand.click(*session.item("Camera"))
    hand.click(*session.item("Camera"))
    hand.move(*BALL)
    for _ in range(2):
        hand.key("Tab")
        session.settled()
    assert [e["shown"] for e in session.events()[mark:] if e["event"] == "panel"] == [False, True]
    hand.key("h")
    session.wait("key", lambda e: e["name"] == "h", mark)
    hand.key("h")


def test_typing_a_number_does_not_fly(session: Session) -> None:
    """Ctrl and a click make a slider a field of text."""
    hand, before = session.hand, session.settled()
    hand.hold("Control_L")
    hand.click(*session.item("radius"))
    hand.let_go("Control_L")
    time.sleep(0.5)  # the field takes all keys: no event tells that it is there
    mark = session.mark()
    for name in ("w", "h"):
        hand.hold(name)
        time.sleep(0.2)
        hand.let_go(name)
    hand.move(*BALL)
    hand.key("Escape")  # leaves the field
    time.sleep(0.5)
    assert np.array_equal(session.settled()[210:, 300:], before[210:, 300:])
    assert not [e for e in session.events()[mark:] if e["event"] == "key" and e["name"] == "w"]


def test_a_key_pressed_with_control_does_not_fly_after_it(session: Session) -> None:
    hand, before, mark = session.hand, session.settled(), session.mark()
    for act, name in ((hand.hold, "Control_L"), (hand.hold, "s"), (hand.let_go, "Control_L")):
        act(name)
    session.wait("saved", since=mark)
    session.settled()
    hand.let_go("s")
    hand.key("Escape")
    assert np.array_equal(session.settled()[:, 300:], before[:, 300:])


def test_swatches_are_as_the_picture(session: Session) -> None:
    shown_panel(session, "Materials", "edit material 1")
    seen = session.settled()
    assert near(pixel(seen, BALL), TOMATO)
    assert near(pixel(seen, session.item("swatch material 1")), TOMATO)
    hand = session.hand
    hand.click(*session.item("edit material 1"))
    session.wait("items", lambda e: "swatch material 1 color" in e["at"], session.mark() - 40)
    hand.move(*BALL)
    seen = session.settled()
    assert near(pixel(seen, session.item("swatch material 1 color")), TOMATO)

    # Another colour in the panel, then one in the file: the newer one wins, and a notice says so.
    x, y = session.item("material 1 color")
    mark = session.mark()
    hand.drag((x - 55, y), (x - 125, y), pause=0.15)
    session.wait("param", lambda e: e["name"] == "material 1 color", mark)
    hand.move(*BALL)
    seen = session.settled()
    assert pixel(seen, BALL)[0] < 240 and "file material 1 color" in session.places()
    assert near(pixel(seen, BALL), pixel(seen, session.item("swatch material 1")))
    mark = session.save(SCENE.replace('"tomato"', '"gold"'))
    session.wait("notice", lambda e: "material 1 color: the file's" in e["text"], mark)
    seen = session.settled()
    assert near(pixel(seen, BALL), (255, 215, 0)) and "file material 1 color" not in session.places()

    # One click returns from the panel to the file.
    hand.drag((x - 55, y), (x - 125, y), pause=0.15)
    hand.move(*BALL)
    assert not near(pixel(session.settled(), BALL), (255, 215, 0))
    hand.click(*session.item("file material 1 color"))
    hand.move(*BALL)
    assert near(pixel(session.settled(), BALL), (255, 215, 0))
    hand.click(*session.item("drop materials"))


def test_escape_closes_the_error(session: Session) -> None:
    red = (92, 14, 14)
    mark = session.save("scene = 1\n")
    session.wait("failed", since=mark)
    assert np.any(np.all(session.settled() == red, axis=-1))
    session.hand.key("Escape")
    assert not np.any(np.all(session.settled() == red, axis=-1))
    mark = session.save("scene = 2\n")
    session.wait("failed", since=mark)
    assert np.any(np.all(session.settled() == red, axis=-1))


def test_a_sequence_of_a_still_scene_is_one_picture(session: Session) -> None:
    before, mark = {*session.folder.iterdir()}, session.mark()
    session.hand.key("Shift_L", "p")
    session.wait("saved", since=mark)
    session.settled()
    (made,) = {*session.folder.iterdir()} - before
    assert made.suffix == ".png"
    session.wait("notice", lambda e: "does not depend on time" in e["text"], mark)


def test_a_parameter_that_comes_back_has_its_value(session: Session) -> None:
    hand = session.hand
    hand.key("n")
    mark = session.mark()
    for _ in range(4):
        hand.key("Right")
    value = session.wait("param", lambda e: e["value"] > 1.1, mark)["value"]
    hand.key("Escape")
    big = session.settled()[210:, 300:]
    session.wait("loaded", since=session.save(SCENE.replace("sphere(RADIUS)", "sphere(1)")))
    assert not np.array_equal(session.settled()[210:, 300:], big)
    session.wait("loaded", since=session.save(SCENE))
    assert value > 1.1 and np.array_equal(session.settled()[210:, 300:], big)
