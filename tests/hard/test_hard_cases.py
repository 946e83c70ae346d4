"""Every row of the table of hard cases holds, and the page shows the ledger."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

import raymarch as rm
from tests.hard import proved
from tests.hard.table import PAGE, cases, ledger, page, round_to
from tests.hard.world import Case, World


@pytest.mark.parametrize("case", cases(), ids=lambda case: case.id)
def test_hard_case(case: Case, world: World) -> None:
    figures = list(case.measure(world))
    for figure in figures:
        assert figure.holds, f"{figure.quantity}: {figure.measured:g}, at most {figure.limit:g} ({figure.because})"
    if case.row == 60 and not world.context.driver.is_software:
        return  # it counts the calls of OpenGL, which depend on the driver
    known = [(row["quantity"], row["limit"], row["because"]) for row in ledger()[case.id]]
    assert [(f.quantity, round_to(f.limit), f.because) for f in figures] == known, "run python -m tests.hard.table"


RAYS = (2, 3, 4, 5, 6, 8, 16, 23, 25, 26, 27, 30, 35, 47, 57, 58, 59, 81, 83, 86, 88)
"""Rows of rays that are drawn by the world alone, and soon."""


@pytest.mark.filterwarnings("ignore::raymarch.errors.SceneWarning")
@pytest.mark.parametrize("case", [case for case in cases() if case.row in RAYS], ids=lambda case: case.id)
def test_rays_that_ask_how_far_they_are_free(case: Case, world: World, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(world, "tracer", "advance")
    for figure in case.measure(world):
        assert figure.holds, f"{figure.quantity}: {figure.measured:g}, at most {figure.limit:g} ({figure.because})"


def test_the_page_is_that_of_code_and_ledger() -> None:
    assert page(cases(), ledger()) == PAGE.read_text(encoding="utf-8"), "run python -m tests.hard.table"
    assert set(ledger()) == {case.id for case in cases()}
    broken = [
        (name, row["quantity"]) for name, rows in ledger().items() for row in rows if row["measured"] > row["limit"]
    ]
    assert not broken


def test_every_row_is_there() -> None:
    assert sorted({case.row for case in cases()}) == list(range(1, 93))


@pytest.mark.parametrize("case", [case for case in cases() if case.row in (1, 2, 3, 27)], ids=lambda case: case.id)
def test_the_share_that_is_proved_is_that_of_the_ledger(case: Case) -> None:
    with proved.Proving() as world:
        list(case.measure(world))
        found = world.proved()
    assert found is not None and found["proved"] == found["pixels"] > 6000 and found == proved.ledger()[case.id]


def test_a_hit_that_is_moved_is_no_longer_proved() -> None:
    """The judge asks the frame's own depths."""
    with proved.Proving() as world:
        frame = world.draw(rm.Scene(rm.sphere()))
        kept = world.kept.copy()
        assert world.proved() == {
            "frames": 1,
            "pixels": frame.depth.size,
            "proved": frame.depth.size,
            "contradicted": 0,
        }
        (scene, _, how) = next(iter(kept.values()))
        world.kept[0] = scene, _Moved(frame.depth + 0.01, frame.size), how  # type: ignore[assignment]
        assert world.proved()["contradicted"] > 500  # type: ignore[index]


@dataclass
class _Moved:
    depth: np.ndarray
    size: tuple[int, int]


def test_contradicted_hits_are_explained() -> None:
    found = {name for name, row in proved.ledger().items() if row["contradicted"]}
    assert found == proved.EXPLAINED.keys()
