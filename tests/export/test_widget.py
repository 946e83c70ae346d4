"""The widget of a notebook: its state and that of the page follow each other."""

from __future__ import annotations

import base64
import json
import re
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.errors import SceneError
from raymarch.export import notebook
from tests.export.test_pages import browsing
from tests.support import chromium

SIZE = (720, 400)

HOST = """<!DOCTYPE html><body style="margin: 0"><div id="fault"></div><script type="module">
import widget from "data:text/javascript;base64,MODULE";
const values = DATA, listeners = {}, el = document.createElement("div");
window.saved = [];
window.model = {
  get: (name) => values[name],
  set: (name, value) => {
    if (JSON.stringify(values[name]) === JSON.stringify(value)) return;
    values[name] = value;
    for (const act of listeners["change:" + name] ?? []) act();
  },
  save_changes: () => window.saved.push(structuredClone(values)),
  on: (event, act) => (listeners[event] ??= []).push(act),
  off: (event, act) => { listeners[event] = listeners[event].filter((other) => other !== act); },
};
document.body.append(el);
window.close_widget = widget.render({ model, el });
window.frame = el.querySelector("iframe");
const wait = () => { if (frame.contentWindow.raymarch) window.raymarch = frame.contentWindow.raymarch;
  else setTimeout(wait, 20); };
wait();
</script></body>"""


def moving() -> rm.Scene:
    gap = rm.Param("gap", 0.5, 0.0, 1.0)
    tint = rm.Param("tint", (0.5, 0.25, 0.125), 0, 1)
    ball = rm.sphere(0.5).translate((gap, 0.1 * rm.sin(rm.time), 0)).material(rm.Material(color=tint))
    return rm.Scene(ball)


@pytest.fixture
def widget(monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.setattr(notebook, "in_notebook", lambda: True)
    return rm.show(moving(), SIZE, params={"gap": 0.75})


def test_parameters_are_checked_where_they_are_set(widget: Any) -> None:
    assert widget.params == {"gap": 0.75, "tint": [0.5, 0.25, 0.125]}
    seen: list[Any] = []
    widget.observe(lambda change: seen.append(change["new"]), "params")
    widget.params = {"gap": 0.25}
    assert widget.params == seen[-1] == {"gap": 0.25, "tint": [0.5, 0.25, 0.125]}
    for wrong, message in (({"gap": 2.0}, "parameter 'gap' = 2"), ({"gab": 0.5}, "unknown parameter 'gab'")):
        with pytest.raises(SceneError, match=message):
            widget.params = wrong
    assert widget.params["gap"] == 0.25


def test_python_draws_the_present_state(widget: Any) -> None:
    widget.params, widget.time = {"gap": 0.1}, 0.4
    wanted = rm.render(moving(), (48, 36), 0.4, {"gap": 0.1})
    np.testing.assert_array_equal(np.asarray(widget.render((48, 36))), np.asarray(wanted))


def test_where_no_widget_can_be_it_is_a_picture(widget: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    data, _ = widget._repr_mimebundle_()
    assert data["image/png"].startswith(b"\x89PNG") and "application/vnd.jupyter.widget-view+json" in data
    monkeypatch.setattr(notebook, "find_spec", lambda name: None)
    assert type(rm.show(moving(), SIZE)).__name__ == "Live"
    monkeypatch.undo()
    assert type(rm.show(moving(), SIZE)).__name__ == "Live"
    monkeypatch.setattr(notebook, "in_notebook", lambda: True)
    lights = [rm.PointLight((rm.time, i, 3)) for i in range(9)]
    assert type(rm.show(rm.Scene(rm.sphere(), lights=lights), SIZE)).__name__ == "Live"


def test_a_kernel_shows_it(tmp_path: Path) -> None:
    """A cell of a real kernel: the widget's view, and the picture for what has no widgets."""
    nbclient, nbformat = pytest.importorskip("nbclient"), pytest.importorskip("nbformat")
    pytest.importorskip("ipykernel")
    cells = ["import raymarch as rm\nview = rm.show(rm.sphere(), (32, 24))\nview", "view.time = 2.0\nprint(view.time)"]
    cells.append("size = 1\nrm.sphere(-size)")
    book = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(cell) for cell in cells])
    options = {"allow_errors": True, "resources": {"metadata": {"path": str(tmp_path)}}}
    nbclient.NotebookClient(book, timeout=120, **options).execute()
    still, shown = book.cells[0].outputs
    assert {"application/vnd.jupyter.widget-view+json", "image/png"} <= set(shown["data"])
    assert book.cells[1].outputs[0]["text"] == "2.0\n"
    # Where the notebook is converted, the picture before the widget stays; the widget's script hides it.
    assert re.fullmatch(
        r'<img class="raymarch-\w+" alt=.* src="data:image/png;base64,[^"]+">', still["data"]["text/html"]
    )
    # An error is one line, which names the cell and its line.
    (error,) = book.cells[2].outputs
    assert error["traceback"] == ["SceneError: Cell In[3], line 2: sphere: radius = -1 (a number > 0)"]


def posted(page: chromium.Browser) -> None:
    """Wait until the page has posted its state twice, and its messages have been taken on both sides."""
    frame = "frame.contentWindow"
    page.run(f"new Promise((done) => {frame}.setTimeout(() => {frame}.setTimeout(() => setTimeout(done), 110), 110))")


class TestInABrowser:
    pytestmark = browsing

    @pytest.fixture
    def page(self, tmp_path: Path, widget: Any) -> Iterator[chromium.Browser]:
        code = files("raymarch.export").joinpath("widget.js").read_bytes()
        state = {name: getattr(widget, name) for name in ("page", "params", "time", "playing", "view", "orbit", "pan")}
        data = json.dumps({**state, "playing": False, "size": SIZE}).replace("<", "\\u003c")
        text = HOST.replace("MODULE", base64.b64encode(code).decode()).replace("DATA", data)
        (tmp_path / "host.html").write_text(text)
        with chromium.Browser(*SIZE) as browser:
            browser.open(tmp_path / "host.html")
            browser.until("raymarch.state.playing === false && raymarch.state.params.u_gap === 0.75")
            posted(browser)
            yield browser
            assert not browser.messages

    def test_both_follow_each_other(self, page: chromium.Browser) -> None:
        # From the model to the page.
        assert page.run("[raymarch.state.params.u_gap, raymarch.state.playing]") == [0.75, False]
        page.run("model.set('params', {gap: 0.125, tint: [1, 0, 0]}), model.set('view', 'depth'), model.set('time', 3)")
        page.until("raymarch.state.time === 3 && raymarch.state.view === 1")
        found = page.run("[raymarch.state.params.u_gap, raymarch.state.params.u_tint, raymarch.state.view]")
        assert found == [0.125, [1, 0, 0], 1]
        assert page.run("frame.contentDocument.querySelector('input[data-param=gap]').valueAsNumber") == 0.125

        # From the page to the model, by a key on the slider and by the mouse.
        page.run(
            "saved.length = 0, frame.focus(), frame.contentDocument.querySelector('input[data-param=gap]').focus()"
        )
        page.call("Input.dispatchKeyEvent", type="keyDown", key="End", code="End", windowsVirtualKeyCode=35)
        page.run("scrollTo(0, 0)")
        page.drag((500, 200), (550, 200))
        page.until("model.get('orbit')[0] === raymarch.state.orbit[0] && model.get('orbit')[0]")
        posted(page)
        assert page.run("model.get('params')") == {"gap": 1, "tint": [1, 0, 0]}
        assert page.run("model.get('orbit')[0]") == pytest.approx(-3.2 * 50 / 400)
        count = page.run("saved.length")
        assert count > 0

        # Neither answers what it was told.
        page.run("model.set('pan', [0.5, 0])")
        page.until("raymarch.state.pan[0] === 0.5")
        posted(page)
        assert page.run("raymarch.state.pan") == [0.5, 0] and page.run("saved.length") == count
        page.run("close_widget(), model.set('time', 9)")
        posted(page)
        assert page.run("raymarch.state.time") == 3

    def test_the_sliders_are_below_the_picture_and_the_wheel_scrolls(self, page: chromium.Browser) -> None:
        """With Ctrl it zooms."""
        places = page.run(
            "['canvas', 'panel'].map((id) => { const r = frame.contentDocument.getElementById(id)"
            ".getBoundingClientRect(); return [r.top, r.bottom]; })"
        )
        assert places[0] == pytest.approx([0, SIZE[1]], abs=2) and places[1][0] >= places[0][1] - 1
        slider = "frame.contentDocument.querySelector('input[data-param=gap]')"
        assert page.run(f"{slider}.getBoundingClientRect().width") > 100
        page.run("document.body.style.height = '3000px'")
        for modifiers in (0, 2):
            wheel = {"type": "mouseWheel", "x": 300, "y": 100, "deltaX": 0, "deltaY": 60, "modifiers": modifiers}
            page.call("Input.dispatchMouseEvent", **wheel)
            page.until("raymarch.state.orbit[2] > 0" if modifiers else "scrollY > 0")
            assert (page.run("scrollY") > 0) and (page.run("raymarch.state.orbit[2]") > 0) == (modifiers == 2)
