"""Every row of the table of hard cases holds, and the page shows the ledger."""

from __future__ import annotations

import pytest

from tests.hard.table import PAGE, cases, ledger, page, round_to
from tests.hard.world import Case, World


@pytest.mark.parametrize("case", cases(), ids=lambda case: case.id)
def test_hard_case(case: Case, world: World) -> None:
    figures = list(case.measure(world))
    for figure in figures:
        assert figure.holds, f"{figure.quantity}: {figure.measured:g}, at most {figure.limit:g} ({figure.because})"
    known = [(row["quantity"], row["limit"], row["because"]) for row in ledger()[case.id]]
    assert [(f.quantity, round_to(f.limit), f.because) for f in figures] == known, "run python -m tests.hard.table"


def test_the_page_is_that_of_code_and_ledger() -> None:
    assert page(cases(), ledger()) == PAGE.read_text(encoding="utf-8"), "run python -m tests.hard.table"
    assert set(ledger()) == {case.id for case in cases()}
    broken = [
        (name, row["quantity"]) for name, rows in ledger().items() for row in rows if row["measured"] > row["limit"]
    ]
    assert not broken


def test_every_row_is_there() -> None:
    assert sorted({case.row for case in cases()}) == list(range(1, 93))
