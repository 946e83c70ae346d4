"""Long folds as loops over rows of constants: the same values, and text that does not grow with the fold."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest

import raymarch as rm
from raymarch.expr import vocabulary
from raymarch.expr.arrays import evaluator
from raymarch.expr.function import Function
from raymarch.expr.glsl import print_functions
from raymarch.expr.last_reads import eager
from raymarch.expr.node import var
from raymarch.expr.rolled import paired, rolled
from raymarch.expr.types import VEC2
from raymarch.expr.vocabulary import abs, dot, length, min, sqrt, vec2, where
from raymarch.expr.walk import find, topological
from raymarch.gpu.prepare import prepare
from raymarch.plan.device import CLASSES, FORCED, HARDWARE, device_class
from raymarch.sdf.booleans import balanced
from raymarch.sdf.flat import enclosed

P, LINE = var("p", VEC2), var("line", VEC2)
POINTS = np.random.default_rng(7).uniform(-2, 2, (500, 2)).astype(np.float32)
ANGLES = np.linspace(0, 2 * np.pi, 24, endpoint=False)
STAR = np.stack([np.cos(ANGLES), np.sin(ANGLES)], axis=1) * np.where(np.arange(24) % 2, 0.6, 1.2)[:, None]


def least(n):
    found = length(P - (0.3, -0.2))
    for k in range(n):
        found = min(length(P * (1.0 + 0.1 * k) - (0.2 * k, 1.0)) + dot(P, (0.0, 0.1 * k)), found)
    return found


def values(body):
    return evaluator([body], [P], np.float32)(POINTS)[0]


@pytest.mark.parametrize("body", [enclosed(P, STAR), least(40)], ids=["polygon", "minimum"])
def test_a_long_fold_is_a_loop_of_the_same_values(body):
    made = rolled(body)
    assert len(find([made], "loop")) == 1 and not find([body], "loop")
    assert np.array_equal(values(made), values(body))


def test_the_edge_of_a_polygon_is_written_once():
    made = rolled(enclosed(P, STAR))
    (loop,) = find([made], "loop")
    assert loop.data.count == 24 and loop.data.kept
    assert [call.data.name for call in find([made], "call")].count("edge") == 1


@pytest.mark.parametrize(
    "body",
    [least(3), enclosed(P, STAR[:5]), where(P.x < 0.0, length(P), length(P - (1, 1)))],
    ids=["few turns", "few corners", "no fold"],
)
def test_short_folds_stay(body):
    assert rolled(body) is body


def test_values_that_are_read_inside_of_a_fold_stay():
    """A loop would spare nothing: each value is read by another expression."""
    sums, found = length(P), length(P)
    for k in range(12):
        found = min(length(P * (1.0 + 0.1 * k) - (0.2 * k, 1.0)), found)
        sums = sums + found * found
    assert not find([rolled(sums)], "loop")


def test_only_hardware_and_texts_for_its_own_window_have_rows():
    shape = Function("star", (P,), enclosed(P, STAR))
    texts = {
        (branches, web): "\n".join(
            line.text for line in print_functions([shape], branches=branches, rolls=branches, for_web=web).lines()
        )
        for branches in (False, True)
        for web in (False, True)
    }
    assert {key for key, text in texts.items() if "const vec4 u_rows" in text} == {(True, False)}
    assert texts[True, False].count("edge(") == 2  # its definition, and one call
    assert texts[False, False].count("edge(") == 25


def test_pictures_with_rows_are_the_same(monkeypatch):
    scene = rm.Scene(
        rm.polygon([tuple(map(float, corner)) for corner in STAR]).extrude(0.4), lights=[rm.Sun(shadow=True)]
    )
    drawn = []
    for name in ("software", "hardware"):
        monkeypatch.setattr("raymarch.gpu.driver.device_class", lambda _, name=name: CLASSES[name])
        with rm.Renderer((64, 36)) as renderer:
            frame = renderer.render(scene, outputs=("color", "evaluations"))
            drawn.append((frame.color, frame.evaluations))
            text = renderer.prepared(scene).texts["color"]
            assert ("const vec4 u_rows" in text) is (name == "hardware")
    for one, other in zip(*drawn, strict=True):
        assert np.array_equal(one, other)


def test_software_drivers_execute_few_turns_so_no_text_for_them_has_more(monkeypatch):
    monkeypatch.setenv(FORCED, "hardware")
    assert device_class(is_software=False).rolls and not device_class(is_software=True).rolls
    assert device_class(is_software=True).branches


def pairs(n):
    """The least distance to n points, and the least of another value of each."""
    lines = [vec2(length(P - (0.3 * k, 1.0)), dot(P, (1.0, 0.1 * k))) for k in range(n)]
    near = [stretched(line) for line in lines]
    return vec2(balanced([line.x for line in near], min), balanced([line.y * line.x for line in near], min))


stretched = Function("stretched", (LINE,), LINE * dot(LINE, LINE) + sqrt(abs(LINE)))


def test_a_pair_of_minima_is_a_minimum_of_pairs():
    body = pairs(7)
    made = paired(body)
    assert made.op == "min" and made.type is VEC2
    assert np.array_equal(values(made), values(body))
    assert paired(vec2(P.x, length(P))) == vec2(P.x, length(P))


def test_hardware_text_ends_variables_before_it_begins_others():
    """Compilers keep the order of a text, so that a variable which is read at its end keeps a register."""
    shape = Function("shape", (P,), pairs(16))
    most = {}
    for branches in (False, True):
        lines = [line.text for line in print_functions([shape], branches=branches).functions[-1]]
        made = {name: k for k, line in enumerate(lines) for name in re.findall(r"^    \w+ (\w+) = ", line)}
        read = {name: max(k for k, line in enumerate(lines) if re.search(rf"\b{name}\b", line)) for name in made}
        most[branches] = max(sum(made[name] <= k < read[name] for name in made) for k in range(len(lines)))
    assert most[False] >= 16 and most[True] <= 6


def ring(count, fold, shape):
    """Copies of a shape about the origin, as `polar` writes them."""
    turned = [(math.cos(0.4 * k), math.sin(0.4 * k)) for k in range(1, count + 1)]
    places = [P, *(vec2(c * P.x + s * P.y, c * P.y - s * P.x) for c, s in turned)]
    return balanced([shape(at) for at in places], fold)


lobe = Function("lobe", (LINE,), length(LINE - (1.0, 0.2)) * sqrt(abs(LINE.x)) + dot(LINE, LINE) - 1.0)


@pytest.mark.parametrize("fold", [min, vocabulary.max], ids=["min", "max"])
def test_copies_about_an_axis_are_one_loop(fold):
    body = abs(ring(15, fold, lobe)) - 0.1
    made = rolled(body)
    assert [loop.data.count for loop in find([made], "loop")] == [15]
    assert len(find([made], "call")) == 2  # the copy that is not turned, and the others
    assert np.array_equal(values(made), values(body))


def test_a_loop_stands_once_for_all_conditions_of_a_branch():
    shape = rm.capsule((0.3, 0, 0), (1, 0.2, 0), 0.1).polar(13).material(rm.Material(color=(1, 0, 0)))
    solid = shape | rm.torus(0.5, 0.1).material(rm.Material(color=(0, 1, 0))) | rm.plane(offset=-2)
    text = prepare(rm.Scene(solid), ("color",), device=HARDWARE).texts["color"]
    assert text.count("vec4[](") == len(set(re.findall(r"const vec4 (\w+)", text)))
    assert len(re.findall(r"float\(i\) >= 12.0", text)) >= 1


def test_values_are_ended_as_soon_as_may_be():
    """A choice between two points follows its condition, before other points are made."""
    points = [vec2(P.x + k, P.y * k) * dot(P, (k, 1.0)) for k in range(1, 9)]
    pairs = [where(length(a) < length(b), a, b) for a, b in zip(points[::2], points[1::2], strict=True)]
    body = length(pairs[0]) * dot(pairs[1], pairs[2]) + length(pairs[3])
    order = eager(topological([*map(length, points), body]), lambda node: node.args)
    assert set(order) == set(topological([body]))
    place = {node: k for k, node in enumerate(order)}
    assert all(place[arg] < place[node] for node in order for arg in node.args)
    assert place[pairs[0]] < place[points[2]] and place[pairs[1]] < place[points[4]]
