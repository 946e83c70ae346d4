"""The explorer page in a browser: real events of the mouse and the keyboard."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

import raymarch as rm
from raymarch.cost.html import as_html
from raymarch.cost.reference import reference
from raymarch.cost.settings import Setting, setting
from raymarch.cost.sweep import sweep
from tests.cost.cost_samples import SIZE, FakeRenderer
from tests.support import chromium

pytestmark = [
    pytest.mark.may_skip,
    pytest.mark.skipif(chromium.find() is None, reason="no Chromium is installed: install the package chromium"),
]

SHOWN = "document.getElementById('shown').firstChild.textContent"
OVER = "document.querySelector('#split .over')"


@pytest.fixture(scope="module")
def page(scene, kept, tmp_path_factory) -> Iterator[chromium.Browser]:
    known = reference(scene, SIZE, samples=1)
    settings = [Setting("base", rm.Quality()), *(setting(rm.Quality(), {"epsilon": e}) for e in (2.0, 0.4, 0.01))]
    settings += [setting(rm.Quality(), {"tracer": "plain", "epsilon": 0.2}), Setting("blind", rm.Quality(max_steps=16))]
    file = tmp_path_factory.mktemp("page") / "cost.html"
    file.write_text(as_html(sweep(scene, settings, known, FakeRenderer(known), repeats=1)), encoding="utf-8")
    with chromium.Browser(1280, 1600) as made:
        made.call("Network.enable")
        made.open(file)
        yield made


def point(page: chromium.Browser, name: str) -> tuple[float, float]:
    """The position of a setting in the window."""
    mark = f"document.querySelector('.point[aria-label^=\"{name},\"] .mark').getBoundingClientRect()"
    x, y = (page.run(f"{mark}.{a} + {mark}.{b} / 2") for a, b in (("x", "width"), ("y", "height")))
    return x, y


def press(page: chromium.Browser, key: str) -> None:
    for kind in ("keyDown", "keyUp"):
        page.call(
            "Input.dispatchKeyEvent", type=kind, key=key, text="\r" if key == "Enter" and kind == "keyDown" else ""
        )


def test_pointing_shows_and_clicking_compares(page):
    for name, place in (("epsilon 0.4", "a"), ("epsilon 0.01", "b")):
        x, y = point(page, name)
        page.call("Input.dispatchMouseEvent", type="mouseMoved", x=x + 6, y=y - 4)
        assert page.run(SHOWN) == name
        assert page.run("document.getElementById('shown-picture').naturalWidth") == SIZE[0]
        page.run("raymarch.state.chosen = []") if place == "a" else None
        page.drag((x, y), (x, y))
        assert page.run(f"document.getElementById('{place}').selectedOptions[0].textContent").startswith(name)
    assert page.run("document.querySelectorAll('.point.chosen').length") == 2
    assert page.run(f"{OVER}.alt + document.querySelector('#split img').alt") == "A: epsilon 0.4B: epsilon 0.01"
    page.run("document.getElementById('split').scrollIntoView(); 0")
    box = "document.getElementById('split').getBoundingClientRect()"
    x, y, width = (page.run(f"{box}.{name}") for name in ("x", "y", "width"))
    page.drag((round(x + 0.5 * width), round(y + 60)), (round(x + 0.25 * width), round(y + 60)))
    assert page.run(f"parseFloat({OVER}.style.clipPath.split(' ')[1])") == pytest.approx(75.0, abs=0.3)


def test_the_keyboard_goes_from_point_to_point(page):
    page.run("document.querySelector('.point[tabindex=\"0\"]').focus()")
    order = []
    press(page, "Home")
    for _ in range(5):
        order.append(page.run(SHOWN))
        press(page, "ArrowRight")
    assert order == ["epsilon 2", "epsilon 0.4", "plain, epsilon 0.2", "base", "epsilon 0.01"]
    assert page.run(SHOWN) == "epsilon 2", "after the last comes the first"
    before = page.run("raymarch.state.chosen.slice()")
    press(page, "Enter")
    assert page.run("raymarch.state.chosen.slice()") != before
    assert page.run("document.activeElement.ariaPressed") == "true"


def select(page: chromium.Browser, name: str, value: str) -> None:
    node = f"document.getElementById({name!r})"
    page.run(f"{node}.value = {value!r}; {node}.dispatchEvent(new Event('change'))")


def test_axes_and_filters(page):
    def marks() -> int:
        return page.run("document.querySelectorAll('.point').length")

    plain = "[...document.querySelectorAll('#tracers label')].find(l => l.textContent.includes('plain')).click()"
    assert marks() == 5, "one that misses hits is not plotted"
    select(page, "error", "wrong")
    assert marks() == 6
    assert "missed and false hits" in page.run("document.getElementById('plot').textContent")
    select(page, "error", "pixels_p99")
    page.run(plain)
    assert marks() == 4
    page.run(plain)
    assert marks() == 5


@pytest.mark.parametrize(("width", "height"), [(1280, 720), (390, 844)])
def test_nothing_is_cut_off(page, width, height):
    page.resize(width, height, mobile=width < 500)
    page.until(f"document.documentElement.clientWidth === {width}")
    assert page.run("document.documentElement.scrollWidth") <= width
    beyond = page.run(
        "(() => { const s = document.getElementById('plot').getBoundingClientRect(), out = []; "
        "for (const t of document.querySelectorAll('#plot text')) { const b = t.getBoundingClientRect(); "
        "if (b.width && (b.left < s.left - 1 || b.right > s.right + 1 || b.bottom > s.bottom + 1)) "
        "out.push(t.textContent); } return out; })()"
    )
    assert beyond == []


def test_it_is_usable_without_seeing_it(page):
    """Every control has a name, and every picture a description."""
    unnamed = page.run(
        "[...document.querySelectorAll('button, select, input, [role=button], [role=group], [role=region]')]"
        ".filter(n => !(n.ariaLabel || n.textContent.trim() || n.labels?.length)).map(n => n.outerHTML.slice(0, 80))"
    )
    assert unnamed == []
    assert page.run("[...document.querySelectorAll('img')].filter(i => i.src && !i.alt).length") == 0


def test_no_fault_and_no_request(page):
    assert not page.messages
    assert page.run("performance.getEntriesByType('resource').filter(r => !r.name.startsWith('data:')).length") == 0
