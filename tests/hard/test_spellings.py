"""The same sets of points, written otherwise; a longer run: python -m tests.lab.spellings."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

import raymarch as rm
from raymarch.gpu.context import Context
from raymarch.gpu.doctor import count_loop
from tests.lab import spellings
from tests.lab.spellings import Court, Spec, Spelling, Variant, disagreements, drawn, look


@pytest.fixture(scope="module")
def court(egl: Context) -> Iterator[Court]:
    made = Court(context=egl, proofs=False)
    yield made
    made.close()


def test_fields_of_all_spellings_have_the_same_sign() -> None:
    compared, found = 0, []
    for seed in range(60, 66):
        n, wrong = disagreements(seed, spellings=3, count=400)
        compared, found = compared + n, found + wrong
    assert compared > 20 and not found, "\n".join(found)


@pytest.mark.parametrize("seed", [2])
def test_pictures_of_two_spellings_are_the_same(court: Court, seed: int) -> None:
    report = look(court, seed, shrink=False)
    assert report is None, report


def test_a_spelling_that_is_another_set_is_found(court: Court, monkeypatch: pytest.MonkeyPatch) -> None:
    def larger(self: Spelling, path: str, exact: bool, *numbers: Any) -> rm.Node:
        return rm.plane((0, 1, 0), numbers[-1] + 0.3 * bool(self.seed))

    monkeypatch.setattr(Spelling, "_plane", larger)
    spec = next(s for s in map(drawn, range(60, 99)) if s.trees[0][2][0] == "plane" and "generic" in s.tags)
    assert court.verdict(spec.changed(trees=spec.trees[:1]), Variant(spelling=1)) is not None


def test_pixels_whose_loops_the_driver_ended_are_not_compared(court: Court, monkeypatch: pytest.MonkeyPatch) -> None:
    """llvmpipe ends the loops of a pixel after 65,535 turns: those of 254 evaluations of a polygon of 258 corners."""
    finer = spellings._finer
    monkeypatch.setattr(spellings, "_finer", lambda points, count: finer(points, 2 * count))
    trees = [("paint", 0, ("plane", -0.3)), ("paint", 0, ("prism", 3, 0.5, 0.4))]
    mirror = {"albedo": (0.8, 0.8, 0.8), "metalness": 1.0, "roughness": 0.0}
    lights = [{"kind": "ball", "radius": 0.2, "intensity": 99.0, "position": (x, 8.0, 5.0)} for x in (-3.0, 3.0)]
    spec = Spec(trees, [mirror], lights, (1.0, 1.0, 2.0), (0.0, 0.0, 0.0), 40.0, bounces=2)
    quality = {"analytic": False, "tracer": "plain", "bounding_volumes": False}
    number = next(n for n in range(1, 99) if Spelling([], n).pick("1:0", 7) == 3)
    data = Variant(number, frozenset({"0:", "0:0", "1:"}), quality=quality)
    assert court.verdict(spec, data) is None
    assert (court.ended > 0) == count_loop(court.renderer.context).is_limited
    court.frame(spec, Variant())
    assert not court.ended_loops(Variant()).any()


def test_a_scene_that_takes_too_long_is_named(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def slow(_court: Court, seed: int, _shrink: bool) -> str | None:
        while seed == 4:
            pass
        return None

    monkeypatch.setattr(spellings, "look", slow)
    assert spellings.pictures(range(3, 6), each=0.05, shrink=False) == 0
    assert "3 scenes, 0 pictures; 0 differ; unfinished: [4]" in capsys.readouterr().out
