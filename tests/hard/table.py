"""The table of hard cases: docs/stability.md, from the code and a ledger of measured figures.

python -m tests.hard.table            # measures every case, writes docs/figures/stability.json and the page
python -m tests.hard.table 4 27       # measures some rows anew
python -m tests.hard.table --page     # only writes the page, from the ledger as it is
"""

from __future__ import annotations

import importlib
import json
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from tests.hard import pictures
from tests.hard.long_runs import section
from tests.hard.world import CASES, Case, Figure, World

ROOT = Path(__file__).parents[2]
LEDGER = ROOT / "docs" / "figures" / "stability.json"
PROBE = ROOT / "docs" / "figures" / "probe.json"
PAGE = ROOT / "docs" / "stability.md"

HEAD = """# Hard cases

What goes wrong in sphere tracing, and what this engine measures in each case. Every row is a test in `tests/hard`; the
limit of a quantity follows from the pixel's footprint, from units in the last place (ulp) or from a Lipschitz bound, as
the last column says. Measured on the software renderer (llvmpipe) by `python -m tests.hard.table`, which writes this
page. An epsilon is a tenth of a pixel's width at the hit: see [how it is built](how-it-is-built.md).

"""


def cases() -> list[Case]:
    """All cases, by row."""
    for file in sorted(Path(__file__).parent.glob("rows_*.py")):
        importlib.import_module(f"tests.hard.{file.stem}")
    return sorted(CASES, key=lambda c: c.row)


def ledger() -> dict[str, Any]:
    return dict(json.loads(LEDGER.read_text(encoding="utf-8"))) if LEDGER.exists() else {}


def measured(case: Case, world: World) -> list[dict[str, Any]]:
    """The figures of a case as plain data."""
    return [_plain(figure) for figure in case.measure(world)]


def _plain(figure: Figure) -> dict[str, Any]:
    row = figure._asdict()
    return {name: round_to(value) if isinstance(value, int | float) else value for name, value in row.items()}


def round_to(value: float) -> float:
    """Three digits; whole numbers whole."""
    return float(f"{float(value):.3g}") if value != int(value) or abs(value) < 1e6 else float(value)


def page(rows: Iterable[Case], figures: Mapping[str, Any]) -> str:
    """The whole page."""
    lines = [HEAD + "| # | case | quantity | measured | at most | because |", "|---|---|---|---|---|---|"]
    notes = []
    for case in rows:
        for i, row in enumerate(figures.get(case.id, [])):
            first = f"{case.row} | {case.name}" if i == 0 else " | "
            values = (row["quantity"], _number(row["measured"]), _number(row["limit"]), row["because"])
            lines.append(f"| {first} | " + " | ".join(value.replace("|", "\\|") for value in values) + " |")
        before = f" Before: {case.before}." if case.before else ""
        notes.append(f"{case.row}. **{case.name}**: {case.wrong}{before}")
    return (
        "\n".join([*lines, *probed(), "", *section(), "", *pictures.section(), "", "## What goes wrong", "", *notes])
        + "\n"
    )


PROBED = """## Every node, looked at

The probe draws a scene once more and looks at every value of every node along all rays, and at every slope: see
[views](views.md). `python -m tests.hard.probe` does so for all examples, all kinds of nodes with the samples of their
tests, and the scenes of the cases above. A value that is not finite, an argument outside of its operation's domain and
a slope beyond the promise would be named with their node."""

SCENES = {"examples": "examples", "nodes": "kinds of nodes", "cases": "hard cases"}


def probed() -> list[str]:
    """The part of the page on the probe, from its own ledger."""
    known = json.loads(PROBE.read_text(encoding="utf-8"))
    head = "| scenes of | scenes | nodes | nodes with a value at fault | nodes too steep | steepest |"
    lines = ["", PROBED, "", head, "|---|---|---|---|---|---|"]
    for name, what in SCENES.items():
        row = known.get(name)
        if row is not None:
            figures = [row["scenes"], row["nodes"], row["faults"], row["broken"], f"{row['steepest']:g} of its promise"]
            lines.append(f"| {what} | " + " | ".join(map(str, figures)) + " |")
    return lines


def _number(value: float) -> str:
    if value == int(value) and abs(value) < 1e6:
        return f"{int(value)}"
    return f"{value:.3g}"


def main(arguments: list[str]) -> int:
    known, every = ledger(), cases()
    wanted = {int(a) for a in arguments if a.isdigit()}
    failed = 0
    if "--page" not in arguments:
        with World() as world:
            for case in every:
                if wanted and case.row not in wanted:
                    continue
                known[case.id] = measured(case, world)
                for row in known[case.id]:
                    bad = not row["measured"] <= row["limit"]
                    failed += bad
                    values = f"{row['measured']:g} (at most {row['limit']:g})"
                    print(f"{'BROKEN ' if bad else ''}{case.id}: {row['quantity']}: {values}", flush=True)
        known = {case.id: known[case.id] for case in every if case.id in known}
        LEDGER.write_text(json.dumps(known, indent=1) + "\n", encoding="utf-8")
    PAGE.write_text(page(every, known), encoding="utf-8")
    return 1 if failed else 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
