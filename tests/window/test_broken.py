"""A sample of broken edits; all of them: `python -m tests.lab.window_broken`."""

from __future__ import annotations

from pathlib import Path

from tests.lab.window_broken import run
from tests.support.breakage import INSERTED, PARTS_BROKEN, REPLACED, WHOLE, breaks


def test_broken_edits_keep_the_picture_and_name_the_line(display: str, tmp_path: Path) -> None:
    score = run(display, tmp_path, 24)
    assert score.edits == 24 and not score.lost and not score.wrong, str(score)


def test_all_kinds_take_their_turn() -> None:
    kinds = {*REPLACED, *INSERTED, *WHOLE, *PARTS_BROKEN}
    assert {b.kind for b in breaks(len(kinds))} == kinds
    assert len({b.scene + b.parts.encode() for b in breaks(200)}) > len(kinds)
