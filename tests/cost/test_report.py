"""Figures, error maps and the HTML page."""

from __future__ import annotations

import base64
import io
import itertools
import json
import re
import sys
from copy import deepcopy
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest
from PIL import Image

import raymarch as rm
from raymarch.cost.checks import Check
from raymarch.cost.html import as_html
from raymarch.cost.maps import WRONG, flip_map, footprint_map, under_map
from raymarch.cost.pictures import Pictures
from raymarch.cost.plots import by_steps, figure, save
from raymarch.cost.reference import reference
from raymarch.cost.settings import Setting, axes, grid
from raymarch.cost.sweep import Sweep, sweep
from raymarch.cost.text import findings, lights_of, worth
from raymarch.errors import CostError
from tests.cost.cost_samples import SIZE, FakeRenderer


@pytest.fixture
def made(made_once) -> Sweep:
    return deepcopy(made_once)


@pytest.fixture(scope="module")
def made_once(scene, kept) -> Sweep:
    known = reference(scene, SIZE, samples=4)
    names = ("tracer", "max_steps", "epsilon", "normals", "shadow_steps")
    few = {"tracer": ("plain", "enhanced", "advance"), "max_steps": (16, 64, 512), "epsilon": (0.5, 0.02)}
    chosen = [axis for axis in axes(given=few) if axis.name in names]
    found = sweep(scene, grid(scene, chosen), known, FakeRenderer(known), name="a <b> & c", repeats=6)
    found.checks = [Check("clock", True, "agrees"), Check("hits of front", False, "5 % lie <too> far")]
    return found


@pytest.fixture(scope="module")
def drawn(made_once):
    return figure(made_once)


def test_a_figure_is_drawn(drawn, made):
    with Image.open(io.BytesIO(save(drawn))) as picture:
        assert picture.size[0] > 1500
        colors = len(picture.convert("RGB").getcolors(picture.width * picture.height))
    assert colors > 50
    made = replace(made, name="$\\frac$\x1b\udcff")  # of a scene file
    assert save(figure(made, "flip_p99"), "svg").lstrip().startswith(b"<?xml")


def test_the_figure_marks_front_presets_and_base(drawn, made):
    axes_of_front = drawn.axes[0]
    labels = axes_of_front.get_legend_handles_labels()[1]
    assert {"front", "the scene's own"} <= set(labels)
    assert {"draft", "normal", "fine", "exact"} <= {t.get_text() for t in axes_of_front.texts}
    (front,) = [line for line in axes_of_front.lines if line.get_label() == "front"]
    assert list(front.get_xdata()) == pytest.approx([p.time.value for p in made.front()])
    assert any("N*" in t.get_text() for t in drawn.axes[1].texts)


def test_ticks_are_plain_numbers_and_nothing_is_cut_off(drawn):
    drawn.draw_without_rendering()
    axes_of_front = drawn.axes[0]
    ticks = [t.get_text() for axis in (axes_of_front.xaxis, axes_of_front.yaxis) for t in axis.get_ticklabels()]
    assert len(ticks) > 4
    assert all(re.fullmatch(r"\d+(\.\d+)?", t) for t in ticks), ticks
    whole = drawn.bbox.get_points()
    for axes_drawn in drawn.axes:
        box = axes_drawn.get_tightbbox().get_points()
        assert np.all(box[0] >= whole[0] - 1) and np.all(box[1] <= whole[1] + 1)
    boxes = [t.get_window_extent() for t in axes_of_front.texts]
    assert len(boxes) >= 4
    assert not any(a.overlaps(b) for a, b in itertools.combinations(boxes, 2)), "names cover each other"


def test_curves_by_steps_hold_the_base_too(made):
    curves = by_steps(made)
    assert list(curves["plain"][-1].setting.quality.tracer) == list("plain")
    assert made.base in curves["advance"]  # what the plan chooses for its scene
    for points in curves.values():
        steps = [p.setting.quality.max_steps for p in points]
        assert steps == sorted(set(steps))


def test_a_figure_without_a_sound_point(scene, known):
    blind = [Setting("blind", rm.Quality(max_steps=16))]
    assert save(figure(sweep(scene, blind, known, FakeRenderer(known), repeats=1)))


class Reader(HTMLParser):
    """Checks that tags are closed in order, and keeps what is loaded from elsewhere."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.loaded: list[str] = []

    def handle_starttag(self, tag, attrs):
        given = dict(attrs)
        source = given.get("src") or (tag != "a" and given.get("href")) or ""  # a link loads nothing
        if source and not source.startswith(("data:", "#")):
            self.loaded.append(source)
        if tag not in ("meta", "img", "input"):
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def content(text: str) -> dict:
    """The data of a page."""
    (found,) = re.findall(r'<script id="data" type="application/json">(.*?)</script>', text, re.DOTALL)
    return json.loads(found)


def test_the_report_is_one_file(made):
    text = as_html(made)
    reader = Reader()
    reader.feed(text)
    assert not reader.open
    assert not reader.loaded
    assert "default-src 'none'" in text, "the browser itself refuses requests"
    links = re.sub(r'<a href="https://[^"]*">', "", text)  # a link loads nothing
    assert not re.search(r"url\(|@import|fetch\(|https?:", links)
    assert "a &lt;b&gt; &amp; c" in text
    assert "<b>" not in re.sub(r"(?s)<script.*?</script>", "", text)
    assert "FAILED" in text
    assert "5 % lie &lt;too&gt; far" in text
    assert "llvmpipe" not in text, "it tells of the driver that drew, not of this one"
    assert "renderer: ours" in text


def test_the_page_holds_every_setting_with_its_pictures(made):
    data = content(as_html(made))
    assert len(data["points"]) == len(made.points)
    for point, given in zip(data["points"], made.points, strict=True):
        assert point["costs"]["ms"] == given.time.value
        assert point["errors"]["pixels_p99"] == (None if given.errors.pixels == 0 else given.errors.pixels_p99)
        for kind in ("picture", "map", "flip"):
            _, _, coded = data["pictures"][point[kind]].partition("data:image/webp;base64,")
            with Image.open(io.BytesIO(base64.b64decode(coded))) as picture:
                assert picture.size == SIZE
                shown = np.asarray(picture.convert("RGB"))
        assert np.array_equal(shown, flip_map(given.known, given.difference))
    assert as_html(made).isascii() is False, "no letter is escaped"


def test_the_tables_of_the_page_have_every_setting(made):
    text = as_html(made)
    tables = re.findall(r'(?s)<table class="sortable">(.*?)</table>', text)
    rows = [len(re.findall("<tr", table)) - 1 for table in tables]
    light = lights_of(made, "pixels_p99")  # the scene's own stands in both tables
    assert len(light) > 1
    assert rows == [len(made.points) - len(light) + 1, len(light)]
    assert len(re.findall('<tr class="front"', tables[0])) == len(made.front())


def test_pictures_that_do_not_fit_are_reduced_and_keep_the_errors():
    noise = np.random.default_rng(1)
    own, other = (noise.integers(0, 200, (40, 64, 3), np.uint8) for _ in range(2))
    other[7, 9] = WRONG
    kept = Pictures(most=9000)
    assert [kept.add(own), kept.add(other, important=False, peaks=True), kept.add(own)] == [0, 1, 0]
    sizes = []
    for uri in kept.uris():
        with Image.open(io.BytesIO(base64.b64decode(uri.partition(",")[2]))) as picture:
            sizes.append(picture.size)
            pixels = np.asarray(picture.convert("RGB"))
    assert sizes[0] == (64, 40)
    assert sizes[1][0] < 64
    assert np.all(pixels == WRONG, axis=-1).sum() == 1


def test_maps_show_where_and_how_much(known):
    depth = known.depth * (1.0 + known.pixel)
    row, column = np.argwhere(known.hit)[0]
    depth[row, column] = np.inf
    shown = footprint_map(known, depth)
    assert tuple(shown[row, column]) == WRONG
    right = footprint_map(known, known.depth)
    other = tuple(np.argwhere(known.hit)[-1])
    assert int(shown[other].sum()) > int(right[other].sum()) + 100
    none = np.zeros(known.depth.shape)
    assert np.array_equal(flip_map(known, none), under_map(known)), "without an error the picture is seen"
    none[3, 4] = 0.9
    assert np.argwhere((flip_map(known, none) != under_map(known)).any(axis=-1)).tolist() == [[3, 4]]


@pytest.mark.parametrize(("module", "make"), [("matplotlib", figure), ("jinja2", as_html)])
def test_without_a_library_it_says_what_to_install(made, monkeypatch, module, make):
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(CostError, match=rf"{module} .*pip install jinja2 matplotlib"):
        make(made)


def test_only_what_makes_a_difference_is_worth_having(made):
    front = made.front()
    kept = worth(front, "pixels_p99")
    assert kept[0] is front[0]
    for a, b in itertools.pairwise(kept):
        assert b.error("pixels_p99") <= 0.9 * a.error("pixels_p99")
    assert any("the scene's own setting" in line for line in findings(made))


def test_the_part_of_the_cpu_is_named_beside_that_of_the_drawing(made):
    base = replace(made.base, times=[2.0, 3.0, 2.5], wholes=[3.0, 4.5, 3.75])
    assert base.cpu == 1.25
    told = findings(replace(made, points=[base, *made.points[1:]]))
    assert "of its frames, drawing takes 2.50 ms, and the CPU 1.25 ms before and between" in told
