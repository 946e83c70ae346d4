"""The answer of a sweep, held to pictures that are drawn again; and where the error lies."""

from __future__ import annotations

import re
from dataclasses import replace
from html import unescape

import numpy as np
import pytest

import raymarch as rm
from raymarch.cost.answer import BOUNDS, advice, answers, figures, finest, grouped, sentence
from raymarch.cost.baseline import OWN, Record, summary
from raymarch.cost.effects import Effect
from raymarch.cost.errors import measure
from raymarch.cost.html import as_html, dearest
from raymarch.cost.location import BANDS, location
from raymarch.cost.reference import reference
from raymarch.cost.rivals import candidates
from raymarch.cost.search import Found
from raymarch.cost.settings import Setting, setting
from raymarch.cost.sweep import Sweep, sweep
from raymarch.cost.text import findings
from tests.cost.cost_samples import SIZE, FakeRenderer

EPSILONS = (9.0, 2.0, 0.004)


@pytest.fixture(scope="module")
def drawn(scene, kept) -> Sweep:
    """A sweep by the real renderer."""
    settings = [Setting("base", rm.Quality()), *(setting(rm.Quality(), {"epsilon": e}) for e in EPSILONS)]
    with rm.Renderer(SIZE) as renderer:
        return sweep(scene, settings, reference(scene, SIZE, samples=1), renderer, "scene", repeats=3)


def broken(text: str, made: Sweep, scene: rm.Scene) -> list[str]:
    """The promises of a page that its settings do not keep when they are drawn again."""
    (said,) = re.findall(r'<p class="answer">(.*?)</p>', text)
    cards = re.findall(
        r'(?s)<h2>([^<]*)</h2>\s*<p class="big">([\d.]+).*?<code>(.*?)</code>.*?reaches ([\d.]+) px', text
    )
    bounds = [bounds for bounds, _ in grouped(answers(made))]
    found = []
    with rm.Renderer(SIZE) as renderer:
        for k, (title, milliseconds, code, error) in enumerate(cards):
            quality = eval(unescape(code))
            errors = measure(made.known, renderer.render(scene.replace(quality=quality), outputs=("depth",)).depth)
            limit = min(bounds[k]) if k < len(bounds) else float("inf")
            if not errors.sound or errors.pixels_p99 > limit or figures(errors.pixels_p99) != error:
                found.append(f"{title}: {errors.pixels_p99} px, not {error}")
            if f"{milliseconds} ms" not in said:
                found.append(f"{title}: {milliseconds} ms is not said")
    return found if cards else ["no cards"]


def test_the_answer_holds_when_its_settings_are_drawn_again(drawn, scene):
    text = as_html(drawn)
    assert sentence(drawn) in unescape(text)
    assert len(answers(drawn)) == len(BOUNDS)
    assert not broken(text, drawn, scene)
    coarse = re.sub(
        r"<code>rm\.Quality\(.*?</code>", "<code>rm.Quality(epsilon=9.0, refinement='none')</code>", text, count=1
    )
    assert len(broken(coarse, drawn, scene)) == 1, "another setting does not keep it"


@pytest.fixture
def fake(scene, known) -> Sweep:
    """Errors and times are known: epsilon pixels in 1 / epsilon milliseconds."""
    values = (2.0, 0.4, 0.1, 0.04, 0.02, 0.01)
    settings = [Setting("base", rm.Quality()), *(setting(rm.Quality(), {"epsilon": e}) for e in values)]
    settings += [setting(rm.Quality(), {"samples": 4, "epsilon": 0.3}), Setting("blind", rm.Quality(max_steps=16))]
    return sweep(scene, settings, known, FakeRenderer(known), "fake", repeats=1)


def test_the_fastest_within_each_bound(fake):
    assert [(bound, point.name) for bound, point in answers(fake)] == [(0.5, "epsilon 0.4"), (0.05, "epsilon 0.04")]
    assert finest(fake).name == "epsilon 0.01"
    assert sentence(fake) == (
        "At 64×36 on this machine (ours), a frame of fake takes 2.5 ms within 0.5 px, 25 ms within 0.05 px; "
        "the most exact setting, 0.01 px, takes 100 ms."
    )
    assert advice(fake) == [
        "  within 0.5 px             2.5 ms        0.4 px  rm.Quality(epsilon=0.4)",
        "  within 0.05 px             25 ms       0.04 px  rm.Quality(epsilon=0.04)",
        "  the most exact setting    100 ms       0.01 px  rm.Quality(epsilon=0.01)",
    ]


def test_a_difference_of_times_within_their_intervals_is_not_certain(fake):
    assert as_html(fake).count("10× the time<") == 1
    for point in fake.points:
        point.times = 6 * point.times
    first = next(p for p in fake.points if p.name == "epsilon 0.4")
    first.times = [2.5, 2.5, 2.5, 2.5, 90.0, 90.0]
    assert answers(fake)[0][1] is fake.base, "what is not certain is not recommended"


def test_a_face_that_is_wrong_is_not_hidden_by_a_floor_that_is_right(fake):
    first = next(p for p in fake.points if p.name == "epsilon 0.4")
    first.errors = replace(first.errors, pixels_p999=6.0)
    assert answers(fake)[0][1].error("pixels_p99") == pytest.approx(0.1)
    first.errors = replace(first.errors, pixels_p999=4.9)
    assert answers(fake)[0][1] is first


def test_cheaper_pictures_of_another_kind_are_no_answer(fake):
    assert {p.name for p in fake.points} - {p.name for p in candidates(fake)} == {"blind", "samples 4, epsilon 0.3"}


def test_bounds_that_nothing_meets_are_left_out(fake):
    fake.points = [p for p in fake.points if p.name in ("epsilon 2", "blind")]
    assert not answers(fake)
    assert "no setting draws fake within 0.5 px: the most accurate one, epsilon 2, is within 2 px" in sentence(fake)
    fake.points = fake.points[1:]
    assert "no setting finds every hit" in sentence(fake)
    assert as_html(fake)


def test_the_answer_without_marching_of_an_estimate_and_of_an_animation(fake):
    fake.moment, fake.estimate = 1.5, True
    fake.points = [p for p in fake.points if p.name in ("epsilon 2", "blind")]
    assert "(ours), 1.5 s into the animation, no setting draws" in sentence(fake)
    assert sentence(fake).endswith(
        "Its field is an estimate, which proves neither these hits nor those of the reference."
    )
    fake.points[0].evaluations = 0.0
    fake.points[0].errors = replace(fake.points[0].errors, pixels_p99=0.004, pixels_p999=0.004)
    assert "every ray is solved in closed form, within 0.004 px" in sentence(fake)
    assert as_html(fake).count('class="card"') == 1


def test_one_setting_may_meet_several_bounds(fake):
    fake.points = [p for p in fake.points if p.name == "epsilon 0.01"]
    fake.points[0].errors = replace(fake.points[0].errors, pixels_p99=0.004)
    assert "takes 100 ms within 0.005 px with the scene's own setting; no other is surely" in sentence(fake)


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.000912, "0.00091"), (8.44, "8.4"), (163.2, "163"), (0, "0"), (1234.5, "1234"), (1e-7, "0.0000001")],
)
def test_numbers_are_written_without_exponents(value, text):
    assert figures(value) == text


def test_the_error_is_located(fake, known):
    point = fake.base
    cosine = np.abs((known.normal * known.direction).sum(axis=-1))
    inner = known.hit & ~known.edges
    grazing = inner & (cosine < np.sin(np.radians(BANDS[2]))) & (cosine >= np.sin(np.radians(BANDS[1])))
    row, column = np.argwhere(grazing)[3]
    off = np.where(grazing, 0.3, 0.001)
    off[row, column] = 4.0
    point.depth = known.depth * (1.0 + off * known.pixel)
    found = location(point)
    assert (found.column, found.row) == (column, row)
    assert found.largest == pytest.approx(4.0)
    assert found.bands[1].worst == 1.0
    assert found.bands[1].hits == pytest.approx(grazing.sum() / inner.sum())
    assert "seen at an angle, 10° to 30° between ray and surface: 100% of the worst hundredth" in found.words
    spread = np.flatnonzero(inner)[np.argsort(cosine[inner])][::20]  # all angles alike
    off = np.full(known.depth.size, 0.001)
    off[spread] = 0.3
    point.depth = known.depth * (1.0 + off.reshape(known.depth.shape) * known.pixel)
    assert "evenly" in location(point).words
    point.errors = replace(point.errors, missed=3)
    assert location(point).words.startswith("3 hits are missed")


def test_a_picture_of_sky_alone_has_no_error_and_no_answer(scene):
    empty = scene.replace(camera=rm.Camera(position=(0, 5, 0), target=(0, 9, 0.1)))
    known = reference(empty, SIZE, samples=1)
    assert not known.hit.any()
    made = sweep(empty, [Setting("base", rm.Quality())], known, FakeRenderer(known), "sky", repeats=1)
    assert sentence(made).endswith(
        "a frame of sky takes 10 ms and shows no surface, as the reference does: no hit has an error, and no setting "
        "is recommended."
    )
    assert not answers(made) and not advice(made) and finest(made) is None and not made.front()
    assert made.front("flip_p99")
    assert not [line for line in findings(made) if "front" in line or "every hit" in line]
    text = as_html(made)
    assert "no hit is compared." in text and 'class="card"' not in text
    nothing = Found(rm.Quality(), "base", made.base, made.base.time, "pixels_p99", 1)
    assert nothing.words.startswith("base (advance): no ray hits a surface, as in the reference, 10.00 ms")
    record = Record(SIZE, 0.0, {}, {OWN: {"pixels_p99": None, "missed": 0, "false": 0, "all_evaluations": 0.0}})
    assert summary("sky", record, record.rows, 0) == (
        "sky at 64x36: nothing grew at 1 settings; no hit, 0.0 evaluations per pixel, 0 missed or false hits"
    )


def test_the_dearest_effect_is_named():
    none = np.zeros((1, 1, 3))

    def effect(name: str, times: list[float]) -> Effect:
        made = Effect(name, 1.0, 0, 0, 0.0, 0.0, 0.0, 0, none, none)
        made._differences, made._frames = times, [8.0] * len(times)
        return made

    assert dearest([effect("fog", [1.0] * 7), effect("shadow", [2.0] * 7)]).endswith(
        "shadow costs most: 2 ms, 25% of a frame."
    )
    unsure = [effect(name, [-1.0, 1.0, 2.0]) for name in ("fog", "shadow")]
    assert dearest(unsure) == (
        "No effect has a certain cost in time here; by evaluations, fog costs most: 1 per camera ray."
    )
    assert dearest(unsure[:1]) == (
        "Its one effect, fog, has no certain cost in time here; evaluations: 1 per camera ray."
    )
    assert dearest([effect("fog", [1.0] * 7)]) == "Its one effect, fog, costs 1 ms, 12% of a frame."
    assert dearest([]) == ""
