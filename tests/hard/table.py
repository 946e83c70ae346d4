"""The table of hard cases: docs/stability.md, from the code and a ledger of measured figures.

python -m tests.hard.table            # measures every case, writes docs/figures/stability.json and the page
python -m tests.hard.table 4 27       # measures some rows again
python -m tests.hard.table --page     # only writes the page, from the present ledger
"""

from __future__ import annotations

import importlib
import json
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from tests.hard import pictures, proved
from tests.hard.world import CASES, Case, Figure, World
from tests.lab.long_runs import section

ROOT = Path(__file__).parents[2]
LEDGER = ROOT / "docs" / "figures" / "stability.json"
PROBE = ROOT / "docs" / "figures" / "probe.json"
PAGE = ROOT / "docs" / "stability.md"

HEAD = """# Hard cases

After this page you can look up the failure modes of sphere tracing, how large each error is here, and why it is
bounded.

Every row is a test in `tests/hard`. The column "because" gives the source of the limit: the pixel's footprint, units in
the last place (ulp) or a Lipschitz bound. `python -m tests.hard.table` measures the rows on the software renderer
(llvmpipe) and writes this page. In the table, an epsilon is the length 0.1 * pixel width at the hit: see [how it is
built](how-it-is-built.md#numbers). "Proved" is the share of the pixels whose hits intervals prove within 0.05 pixels,
of the first frames that the case draws with its depths: see [a picture with a proof](theory.md#a-picture-with-a-proof).
A dash means that a case draws none, or estimates, of which intervals prove next to none. What is not proved is open,
unless it is said to be contradicted.

"""


def cases() -> list[Case]:
    """All cases, by row."""
    for file in sorted(Path(__file__).parent.glob("rows_*.py")):
        importlib.import_module(f"tests.hard.{file.stem}")
    return sorted(CASES, key=lambda c: c.row)


def ledger() -> dict[str, Any]:
    return dict(json.loads(LEDGER.read_text(encoding="utf-8"))) if LEDGER.exists() else {}


def measured(case: Case, world: World) -> list[dict[str, Any]]:
    """The figures of a case as JSON data."""
    return [_plain(figure) for figure in case.measure(world)]


def _plain(figure: Figure) -> dict[str, Any]:
    row = figure._asdict()
    return {name: round_to(value) if isinstance(value, int | float) else value for name, value in row.items()}


def round_to(value: float) -> float:
    """The value rounded to three digits; integers stay as they are."""
    return float(f"{float(value):.3g}") if value != int(value) or abs(value) < 1e6 else float(value)


def page(rows: Iterable[Case], figures: Mapping[str, Any]) -> str:
    """The text of the page."""
    lines = [HEAD + "| # | case | quantity | measured | at most | because | proved |", "|---|---|---|---|---|---|---|"]
    notes, proofs = [], proved.ledger()
    for case in rows:
        for i, row in enumerate(figures.get(case.id, [])):
            first = f"{case.row} | {case.name}" if i == 0 else " | "
            values = (row["quantity"], _number(row["measured"]), _number(row["limit"]), row["because"])
            share = proved.share(case, proofs) if i == 0 else ""
            lines.append(f"| {first} | " + " | ".join(value.replace("|", "\\|") for value in (*values, share)) + " |")
        before = f" Before: {case.before}." if case.before else ""
        notes.append(f"{case.row}. **{case.name}**: {case.wrong}{before}")
    return (
        "\n".join([*lines, *probed(), "", *section(), "", *pictures.section(), "", "## Failure modes", "", *notes])
        + "\n"
    )


PROBED = """## The probe on every node

The probe renders a scene again and checks every value and every slope of every node along all rays: see
[views](views.md#the-probe). `python -m tests.lab.probe` does so for all examples, for all kinds of nodes with the
samples of their tests, and for the scenes of the cases above. It reports the node of a value that is not finite, of
an argument outside of its operation's domain, and of a slope beyond the Lipschitz bound."""

SCENES = {"examples": "examples", "nodes": "kinds of nodes", "cases": "hard cases"}


def probed() -> list[str]:
    """The section on the probe, from its own ledger."""
    known = json.loads(PROBE.read_text(encoding="utf-8"))
    head = "| scenes of | scenes | nodes | nodes with a fault | nodes too steep | steepest, relative to its bound |"
    lines = ["", PROBED, "", head, "|---|---|---|---|---|---|"]
    for name, what in SCENES.items():
        row = known.get(name)
        if row is not None:
            figures = [row["scenes"], row["nodes"], row["faults"], row["broken"], f"{row['steepest']:g}"]
            lines.append(f"| {what} | " + " | ".join(map(str, figures)) + " |")
    return lines


def _number(value: float) -> str:
    if value == int(value) and abs(value) < 1e6:
        return f"{int(value)}"
    return f"{value:.3g}"


def main(arguments: list[str]) -> int:
    known, proofs, every = ledger(), proved.ledger(), cases()
    wanted = {int(a) for a in arguments if a.isdigit()}
    failed = 0
    if "--page" not in arguments:
        with proved.Proving() as world:
            for case in every:
                if wanted and case.row not in wanted:
                    continue
                known[case.id] = measured(case, world)
                proofs[case.id] = world.proved()
                for row in known[case.id]:
                    bad = not row["measured"] <= row["limit"]
                    failed += bad
                    values = f"{row['measured']:g} (at most {row['limit']:g})"
                    print(f"{'BROKEN ' if bad else ''}{case.id}: {row['quantity']}: {values}", flush=True)
        known = {case.id: known[case.id] for case in every if case.id in known}
        proved.write({case.id: proofs[case.id] for case in every if proofs.get(case.id)})
        LEDGER.write_text(json.dumps(known, indent=1) + "\n", encoding="utf-8")
    PAGE.write_text(page(every, known), encoding="utf-8")
    return 1 if failed else 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
