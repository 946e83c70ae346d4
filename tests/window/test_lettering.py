"""What messages look like: source code with carets, notices, the list of parameters, the picked point."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import raymarch as rm
from raymarch.errors import SceneError
from raymarch.gpu.scale import Scale
from raymarch.scene.file import load
from raymarch.scene.parameter import Values
from raymarch.window import lettering
from raymarch.window.inputs import help_text
from raymarch.window.lettering import CARET, lettered
from raymarch.window.messages import FADE, LISTED, Message, messages_of, parameters
from raymarch.window.news import Excerpt, Fault
from tests.window.test_commands import model_of, press

BROKEN = (
    ("rm.sphere() | rm.sphere(-1) | rm.box()", "rm.sphere(-1)"),
    ("rm.sphere().translate((0, 1)) | rm.box()", "rm.sphere().translate((0, 1))"),
    ("'\u00e4\u00f6' and rm.torus(minor=0)", "rm.torus(minor=0)"),
    ("rm.sphere(radius=nothing)", "nothing"),
    ("rm.sphere(1 / 0) | rm.box()", "1 / 0"),
    ("rm.sphere(", "("),
    ("rm.sphere(1 2)", "1 2"),
)
"""Lines of a scene file, and the part that is wrong."""


@pytest.mark.parametrize(("source", "wrong"), BROKEN)
def test_carets_stand_below_what_is_wrong(tmp_path: Path, source: str, wrong: str) -> None:
    """Also after characters of several bytes, and after the error went through a process."""
    file = tmp_path / "scene.py"
    file.write_text(f"import raymarch as rm\nif True:\n    scene = {source}\n", encoding="utf-8")
    with pytest.raises(SceneError) as caught:
        load(file)
    fault = Fault.of(caught.value)
    excerpt = fault.excerpt
    assert excerpt is not None and excerpt.source[excerpt.start : excerpt.end] == wrong
    line, carets = excerpt.lines(100)
    assert line == f"3 | scene = {source}" and carets.index("^") == line.index(wrong, 8)
    assert carets.strip() == "^" * len(wrong)


def test_long_lines_are_cut_around_the_fault() -> None:
    source = "a" * 90 + "WRONG" + "b" * 90
    for start, end in ((90, 95), (0, 3), (180, 185), (0, 185), (0, 0)):
        line, *carets = Excerpt(12, source, start, end).lines(40)
        assert len(line) == 40 and line.startswith("12 | ") and (len(carets) == (end > start))
        if (start, end) == (90, 95):
            at = carets[0].index("^")
            assert line[at : at + 5] == "WRONG" and line[5] == line[-1] == "\u2026"
    assert Excerpt(1, "short").lines(4) == ["1 | short"], "no less than some characters"


def test_code_is_monospaced_and_fits(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also with a font of letters of different widths, as where no monospaced one is installed."""
    for found in (True, False):
        if not found:
            monkeypatch.setattr(lettering, "monospaced", lambda points: None)
        lettering.cell_of.cache_clear()
        cell = lettering.cell_of(14)
        for text in ("iiiiiiiiii", "MMMMMMMMMM"):
            image = lettered(Message("f.py:1\nwrong", "error", code=Excerpt(1, text, 9, 10)), (400, 200), 1.0)
            assert image.shape[1] <= 400
            columns = np.flatnonzero((np.abs(image.astype(int) - CARET).max(axis=2) < 40).any(axis=0))
            assert len(columns) and abs(columns.mean() - (7 + 13.5 * cell)) < 0.5 * cell, (found, text)
    lettering.cell_of.cache_clear()


def test_the_help_stands_in_two_columns_where_it_is_too_high() -> None:
    """At 640 x 360 its letters are at least 11 pixels high."""
    message = Message(help_text(), "note", "middle")
    high, low = (lettered(message, size, 1.0).shape for size in ((640, 800), (640, 360)))
    assert high[0] > 500 and low[0] < 0.75 * high[0] and low[1] <= 640
    assert lettered(message, (640, 360), 11 / 14).shape[0] <= 360


def test_a_notice_replaces_the_one_before() -> None:
    model = model_of()
    press(model, "v", "v", "v")
    assert [m.text for m in messages_of(model, 0.0)] == [f"view: {model.state.view}"]


def test_the_list_of_parameters_fades_and_returns() -> None:
    model = model_of()
    press(model, "n")
    begun = model.listed_at

    def shown(after: float) -> list[float]:
        return [m.opacity for m in messages_of(model, begun + after) if "radius" in m.text]

    assert shown(LISTED - 0.1) == [1.0] and shown(LISTED + 1.5 * FADE) == [0.4] and shown(LISTED + 4 * FADE) == []
    press(model, "right")
    assert model.listed_at > begun and [m.opacity for m in messages_of(model, model.listed_at)] == [1.0]
    message = Message("text", opacity=0.4)
    assert lettered(message, (100, 100), 1.0)[..., 3].max() == 102


def test_of_many_parameters_those_beside_the_selected_one_are_listed() -> None:
    text = "import raymarch as rm\nps = [rm.Param(f'p{i}', 0.1 * i, 0, 9) for i in range(60)]\n"
    model = model_of(text + "scene = rm.Scene(rm.union(*(rm.sphere(1 + p) for p in ps)))\n")
    for at, first, last, rest in ((0, 0, 8, "0 more above, 51 below"), (30, 26, 34, "26 more above, 25 below")):
        model.state.selected = f"p{at}"
        lines = parameters(model).splitlines()
        assert len(lines) == 10 and lines[-1].strip() == rest
        assert f" p{first}\t" in lines[0] and f" p{last}\t" in lines[8] and lines[at - first].startswith(f"> p{at}\t")


def test_ranges_in_words() -> None:
    for ends, words in (((0, 2), "0 to 2"), ((0, None), ">= 0"), ((None, 2), "<= 2"), ((None, None), "any value")):
        assert rm.Param("x", 1.0, *ends).data.range == words


def test_a_material_is_named_with_its_colour() -> None:
    text = """import raymarch as rm
tint = rm.Param("tint", (1.0, 0.0, 0.0), 0, 1)
gold = rm.Material(color=(1.0, 0.5, 0.0))
ball = rm.sphere().material(rm.Material(color=tint))
many = rm.Material(color=rm.checker((0, 0, 0), (1, 1, 1)))
scene = rm.Scene(ball | rm.box().material(gold) | rm.torus().material(many))
"""
    model = model_of(text)
    found = [model.state.named_material(i)[1] for i in range(1, 4)]
    assert set(found) == {(255, 0, 0), (255, 188, 0), None}, "a pattern has no colour of its own"
    assert model.state.named_material(-1) == ("", None)
    square = lettered(Message("material\t\u25a0 gold", swatch=(255, 188, 0)), (300, 100), 1.0)
    assert np.sum((square[..., :3] == (255, 188, 0)).all(axis=2)) > 100


@pytest.mark.parametrize(
    "camera", [rm.Camera(position=(3, 2, 6)), rm.Camera(position=(3, 2, 6), height=4.0, projection="orthographic")]
)
def test_the_place_of_a_point_in_a_picture(camera: rm.Camera) -> None:
    """The inverse of the rays through pixels; none behind the camera."""
    size = (64, 36)
    pose = rm.Scene(rm.sphere(), camera=camera).pose(Values({}, 0.0), 64 / 36)
    origins, directions = pose.rays(np.array([5, 40]), np.array([30, 2]), size)
    for origin, direction, place in zip(origins, directions, ((5, 30), (40, 2)), strict=True):
        assert pose.place(origin + 7.0 * direction, size) == pytest.approx(place, abs=1e-9)
    assert pose.orthographic or pose.place(pose.position - pose.view, size) is None


def test_ticks_of_counts_are_whole() -> None:
    for high in (0.7, 1.0, 2.0, 3.3, 17.0, 4321.0):
        ticks = Scale("steps", 0.0, high, whole=True).ticks
        assert all(v == int(v) for v in ticks) and ticks[0] == 0
    assert any(v != int(v) for v in Scale("steps", 0.0, 2.0).ticks)
