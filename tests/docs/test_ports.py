"""The page of ported pieces: its numbers of lines, and that no piece is longer than its model."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest

PAGE = Path(__file__).parents[2] / "docs" / "ports.py"
SPEC = importlib.util.spec_from_file_location("ports", PAGE)
assert SPEC is not None and SPEC.loader is not None
ports = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(ports)


def test_the_numbers_of_lines_are_those_of_the_code() -> None:
    codes, stated = ports.pieces(), ports.stated()
    assert len(codes) >= 30 and {name: here for name, (_, here) in stated.items()} == {
        name: ports.lines(code) for name, code in codes.items()
    }


@pytest.mark.parametrize("name", ports.stated())
def test_no_piece_is_longer_than_its_model(name: str) -> None:
    there, here = ports.stated()[name]
    assert there is None or here <= there


def test_lines_are_counted_without_blank_ones_comments_and_imports() -> None:
    assert ports.lines("import raymarch as rm\n\n# a ball\nball = rm.sphere(1)  # round\nscene = ball\n") == 2
