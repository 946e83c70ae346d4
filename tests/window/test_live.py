"""The panel, the keys and the file at the same time, by real events in one window."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from raymarch.proof import COLORS
from raymarch.proof.search import CONTRADICTED
from raymarch.window.inputs import help_text
from tests.support.window_driver import PATIENCE, Session

SCENE = """import raymarch as rm
RADIUS = rm.Param("radius", 1.0, 0.5, 2.0)
ball = rm.sphere(RADIUS).material(rm.Material(color="tomato", ambient=0, specular=0))
floor = rm.box((4, 0.2, 4)).translate((0, -1.2, 0))
open(__file__ + ".runs", "a").write("x")
scene = rm.Scene(ball | floor, camera=rm.Camera((0, 1, 6), (0, 0, 0)), lights=[rm.Sun((0, 1, 6))])
"""
STEEP = """
@rm.shape(exactness="bound", bounds=lambda: ((-1, -1, -1), (1, 1, 1)))
def steep(p):
    "A ball whose field is too steep."
    return 8 * (rm.length(p) - 1)

"""
TOMATO = (255, 99, 71)
BALL = (470, 320)
"""A pixel of the ball, in the middle of what the panel leaves free."""


@pytest.fixture(scope="module")
def shared(display: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Session]:
    folder = tmp_path_factory.mktemp("window")
    (folder / "scene.py").write_text(SCENE)
    editor = folder / "editor"
    editor.write_text(f'#!/bin/sh\necho "$@" > {folder}/opened.new; mv {folder}/opened.new {folder}/opened\n')
    editor.chmod(0o755)
    os.environ["VISUAL"] = str(editor)
    session = Session(display, folder, folder / "scene.py", "--size", "640x640", "--panel")
    session.wait("watching")
    del os.environ["VISUAL"]
    yield session
    session.kill()


@pytest.fixture
def session(shared: Session) -> Session:
    """The window on the scene as it is, with the panel, nothing moved and no message."""
    shared.hand.move(*BALL)
    shared.hand.key("Escape")
    if (shared.folder / "scene.py").read_text() != SCENE:
        shared.settled()  # else the key may stop the run of the file
        shared.wait("loaded", since=shared.save(SCENE))
    click(shared, "defaults")
    shared.hand.move(*BALL)
    shared.hand.key("r")
    shared.settled()
    return shared


def pixel(picture: Any, at: tuple[int, int]) -> tuple[int, ...]:
    return tuple(int(v) for v in picture[at[1], at[0]])


def near(seen: tuple[int, ...], wanted: tuple[int, ...], most: int = 3) -> bool:
    return max(abs(a - b) for a, b in zip(seen, wanted, strict=True)) <= most


def click(session: Session, name: str) -> None:
    """Click an item of the panel, at the speed of a hand: the toolkit sees press and release in frames of their own."""
    at = session.item(name)
    session.hand.drag(at, at, steps=1, pause=0.08)


def shown_panel(session: Session, *names: str) -> None:
    """Open sections of the panel, unless they are open."""
    for name, inside in zip(names[::2], names[1::2], strict=True):
        if inside not in session.places():
            mark = session.mark()
            click(session, name)
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
    click(session, "Camera")
    click(session, "Camera")
    hand.move(*BALL)
    for _ in range(2):
        hand.key("Tab")
        session.settled()
    assert [e["shown"] for e in session.events()[mark:] if e["event"] == "panel"] == [False, True]
    hand.key("h")
    session.wait("key", lambda e: e["name"] == "h", mark)
    hand.key("h")


def test_the_proof_over_the_picture(session: Session) -> None:
    """Green where hits are proved, from the centre outwards, and judged anew when the camera moves."""
    hand, mark = session.hand, session.mark()
    before = pixel(session.hand.see(), BALL)
    hand.key("t")
    session.wait("proof", lambda e: e["share"] > 0.5, mark)
    green = np.array(pixel(session.settled(), BALL), int) - before
    assert green[0] < -40 and green[1] > green[0] + 30
    mark = session.mark()
    hand.drag((600, 600), (560, 600), steps=2)
    session.wait("proof", lambda e: e["share"] < 0.5, mark)
    hand.key("t")


def test_a_wrong_fact_is_red(session: Session) -> None:
    """A field that is eight times as steep as it states: rays go through the ball."""
    mark = session.save(SCENE.replace("rm.sphere(RADIUS)", "steep()").replace("ball =", f"{STEEP}ball ="))
    session.wait("loaded", since=mark)
    session.settled()
    mark = session.mark()
    session.hand.key("t")
    session.wait("proof", lambda e: e["share"] > 0.5, mark)
    picture = session.settled()
    red = np.all(np.abs(picture.astype(int) - COLORS[CONTRADICTED]) <= 3, axis=-1)
    assert red[220:420, 370:570].sum() > 200 and not red[:, :300].any()
    session.hand.key("t")


def test_typing_a_number_does_not_fly(session: Session) -> None:
    """Ctrl and a click make a slider a field of text."""
    hand, before = session.hand, session.settled()
    hand.move(*session.item("radius"))
    for act in (lambda: hand.hold("Control_L"), hand.press, hand.release, lambda: hand.let_go("Control_L")):
        act()
        time.sleep(0.15)
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
    mark = session.mark()
    click(session, "edit material 1")
    session.wait("items", lambda e: "swatch material 1 color" in e["at"], mark)
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
    click(session, "file material 1 color")
    hand.move(*BALL)
    assert near(pixel(session.settled(), BALL), (255, 215, 0))
    click(session, "drop materials")


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
    value = session.raised(4)
    assert value > 1.1
    hand.key("Escape")
    big = session.settled()[210:, 300:]
    session.wait("loaded", since=session.save(SCENE.replace("sphere(RADIUS)", "sphere(1)")))
    assert not np.array_equal(session.settled()[210:, 300:], big)
    session.wait("loaded", since=session.save(SCENE))
    assert np.array_equal(session.settled()[210:, 300:], big)


def test_values_are_written_into_the_file(session: Session) -> None:
    """Shown before they are saved. The file is then the newer one, and the picture stays."""
    hand, file = session.hand, session.folder / "scene.py"
    hand.key("n")
    mark = session.mark()
    assert session.raised(5) > 1.14
    hand.key("Escape")
    before = session.settled()
    hand.key("F2")
    text = session.wait("draft", since=mark)["text"]
    assert '+RADIUS = rm.Param("radius", 1.15, 0.5, 2.0)' in text and file.read_text() == SCENE
    assert not np.array_equal(session.settled()[300:340, 300:], before[300:340, 300:])
    mark = session.mark()
    hand.key("F2")
    session.wait("wrote", since=mark)
    session.wait("loaded", since=mark)
    assert file.read_text() == SCENE.replace('"radius", 1.0', '"radius", 1.15')
    hand.key("Escape")
    assert np.array_equal(session.settled()[:, 300:], before[:, 300:])
    assert "file radius" not in session.places()


def test_undo_and_redo(session: Session) -> None:
    hand, before = session.hand, session.settled()[:, 300:]
    x, y = session.item("radius")
    pictures = []
    for right in (20, 45):
        mark = session.mark()
        hand.drag((x - 60, y), (x + right, y), pause=0.1)
        session.wait("param", since=mark)
        hand.move(*BALL)
        pictures.append(session.settled()[:, 300:])
        time.sleep(1.1)  # another change, not the same one
    for keys, wanted in (
        (("Control_L", "z"), pictures[0]),
        (("Control_L", "z"), before),
        (("Control_L", "Shift_L", "z"), pictures[0]),
        (("Control_L", "y"), pictures[1]),
        (("Control_L", "z"), pictures[0]),
        (("Control_L", "z"), before),
    ):
        mark = session.mark()
        hand.key(*keys)
        session.wait("returned", since=mark)
        assert np.array_equal(session.settled()[:, 300:], wanted), keys


def test_full_screen_and_back(session: Session) -> None:
    hand = session.hand
    for size in ([1000, 700], [640, 640]):
        mark = session.mark()
        hand.key("F11")
        session.wait("resize", lambda e, size=size: e["size"] == size, mark)
        session.settled()


def test_the_line_of_an_error_opens_in_the_editor(session: Session) -> None:
    hand, opened = session.hand, session.folder / "opened"

    def line() -> str:
        until = time.monotonic() + PATIENCE
        while not opened.exists() and time.monotonic() < until:
            time.sleep(0.02)
        text = opened.read_text()
        opened.unlink()
        return text

    mark = session.save(SCENE.replace("(4, 0.2, 4)", "(4, -0.2, 4)"))
    session.wait("failed", since=mark)
    hand.key("g")
    assert line() == f"+4 {session.folder}/scene.py\n"
    mark = session.save(SCENE)
    session.wait("loaded", since=mark)
    hand.click(*BALL)
    session.wait("truth", since=mark)
    hand.key("g")
    assert line() == f"+3 {session.folder}/scene.py\n"


def test_the_title_tells_the_state(session: Session) -> None:
    session.settled()
    assert "complete, 1 sample" in session.hand.title()


def test_the_help_has_four_groups(session: Session) -> None:
    before = session.settled()
    session.hand.key("h")
    shown = session.settled()
    assert np.mean(np.any(shown != before, axis=-1)) > 0.1
    session.hand.key("h")
    assert [line for line in help_text().splitlines() if line and "\t" not in line] == [
        "Camera",
        "View",
        "Time and parameters",
        "File",
    ]


def test_the_panel_is_narrow_and_remembers_it(view: Callable[..., Session], display: str) -> None:
    """Also which sections are open, in the user's folder of settings."""
    session = view(SCENE, "--size", "640x640", "--panel")
    hand = session.hand
    mark = session.mark()
    hand.key("Shift_L", "Tab")
    session.wait("panel", lambda e: e["narrow"], mark)
    seen = session.settled()
    assert near(pixel(seen, (250, 30)), pixel(seen, (600, 30))), "the picture begins beside the narrow panel"
    hand.close_window()
    assert session.end() == 0
    kept = json.loads((session.folder / "config" / "raymarch" / "window.json").read_text())
    assert kept["narrow"] is True and kept["opened"]["View"] is True and kept["opened"]["Frame"] is False
    again = Session(display, session.folder, session.folder / "scene.py", "--size", "640x640", "--panel")
    try:
        assert near(pixel(again.settled(), (250, 30)), pixel(seen, (600, 30)))
    finally:
        again.kill()
