"""The figures of the README are those of the ledger and of the code. The first page of the site has none."""

from __future__ import annotations

import inspect
import json
import re
import statistics

import pytest

from tests.docs.test_docs import ROOT
from tests.support.node_samples import definitions

PAGES = {"README.md": ROOT / "README.md"}
NUMBERS = "no one two three four five six seven eight nine ten eleven twelve".split()


def claim(page: str, heading: str) -> str:
    """The row of a table whose first cell is a bold heading."""
    rows = re.findall(r"^\| \*\*(.+?)\*\* \| (.+) \|$", PAGES[page].read_text(encoding="utf-8"), re.MULTILINE)
    return dict(rows)[heading]


@pytest.mark.parametrize("page", PAGES)
def test_the_error_is_tested_on_so_many_scenes(page: str) -> None:
    rows = json.loads((ROOT / "tests" / "ledger.json").read_text())["rows"]
    scenes = {name.rpartition(" ")[0] for name in rows}
    assert f"on {NUMBERS[len(scenes)]} example scenes" in claim(page, "0.05 px")
    certified = [row for name, row in rows.items() if name.endswith(" normal") and row.get("pixels_p99") is not None]
    assert len(certified) >= 5 and all(row["pixels_p99"] <= 0.05 for row in certified)


@pytest.mark.parametrize("page", PAGES)
def test_a_shape_takes_so_many_lines(page: str) -> None:
    sources = [inspect.getsource(shape.source) for shape in definitions() if shape.arity == "none"]
    lines = statistics.median(sum(bool(line.strip()) for line in source.splitlines()) for source in sources)
    assert len(sources) >= 80
    assert claim(page, f"{lines:.0f} lines").startswith(f"Median length of the {len(sources)} shapes")


@pytest.mark.parametrize("page", PAGES)
def test_the_time_of_a_frame_is_that_of_the_page_of_graphics_cards(page: str) -> None:
    rows = re.findall(
        r"^\| hello \| [\d.]+ \| ([\d.]+) \| \d+ \|$", (ROOT / "docs" / "gpu.md").read_text(), re.MULTILINE
    )
    assert len(rows) == 1 and "1920x1080" in claim(page, f"{rows[0]} ms")


def ratios(tracer: str) -> tuple[str, str]:
    """The least and the greatest ratio to N* in a row of the table of tracers, with one digit."""
    page = (ROOT / "docs" / "marching.md").read_text(encoding="utf-8")
    (row,) = re.findall(rf"^\| `{tracer}` \| (.+\(.+\)) \|$", page, re.MULTILINE)
    found = [float(ratio) for ratio in re.findall(r"\(([0-9.]+)\)", row)]
    assert len(found) == 4
    return f"{min(found):.1f}", f"{max(found):.1f}"


@pytest.mark.parametrize("page", PAGES)
def test_evaluations_are_those_of_the_table_of_tracers(page: str) -> None:
    least, most = ratios("advance")
    words = claim(page, f"{least} to {most} ×")
    for tracer in ("bracketing", "plain"):
        assert "{} to {} times".format(*ratios(tracer)) in words


def test_the_first_page_of_the_site_claims_no_figure() -> None:
    text = (ROOT / "docs" / "index.md").read_text(encoding="utf-8")
    assert not re.findall(r"\d", re.sub(r"```.*?```|\(.*?\)|SDFs?|float64", "", text, flags=re.DOTALL))
