"""What the long commands found: a ledger of their last runs, docs/figures/long_runs.json, and a part of the page."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

LEDGER = Path(__file__).parents[2] / "docs" / "figures" / "long_runs.json"

HEAD = """## Long runs

Commands that take minutes or hours; CI runs a short sample of each. The last runs that were kept, with `--keep`:

"""

FOUND = """
What they found:

- **Shallow dips.** From an epsilon on, the last steps of a ray follow the slope, and prove nothing: on a wavy wall they
  may leap over a dip that is less than an epsilon (a tenth of a pixel) deep, and end pixels farther along the ray. Such
  rays are counted by `watertight`; they are the bound of what "nothing is in front of a hit" means.
- **Rounding.** The 64 ulp that the fuzz allowed a field were chosen. What float32 may lose is now worked out for each
  point, as a running bound of the rounding errors (`tests/hard/rounding.py`): 3 ulp of its size for a box, 7,000 for
  the deepest of 25 random trees, 20 for half of them; the driver is within it everywhere.
- **Single functions.** Asked alone at the ends of their ranges (`tests/functions`), they showed what no picture had:
  the front's tracer stood still before a wall met head on (2 of 1,000 profiles); a ray that ran out of steps took a
  sample deep inside a solid for its nearest; a slice held values from nowhere where rays run along it; a history with
  a value that is not finite turned black, or counted as ten samples; a black surface divided 0 by 0, which this
  driver hides. Eleven guards that no input reaches are gone; of three more, in the march, one changed no bit of
  108,000 rays, and two change fewer than one ray in 600, none of them wrongly.
- **Random scenes.** Of 5,007, four were reported, and are explained: three solids that are provably empty, whose box
  lies inside out, which a relation took for a size (a part that is empty is now warned of with its line); and a whole
  volume of zeros, a wave through the origin that is elongated, where the field has no slope and so no normal. 1,200
  more, drawn after the changes, showed nothing.
- **Memory.** Values at many points held every step between, for all points at once; they are taken in blocks.
- **Waves of time.** sin(x + time) in a user's own function moved in steps of 2 s after a year; row 36.
- **cProfile.** A program that was profiled while it built a scene broke; a scene may be profiled now.
"""


def kept() -> dict[str, Any]:
    return dict(json.loads(LEDGER.read_text(encoding="utf-8"))) if LEDGER.exists() else {}


def keep(name: str, **figures: Any) -> None:
    """Put the figures of a run in the place of those of the last one."""
    LEDGER.write_text(json.dumps({**kept(), name: figures}, indent=1) + "\n", encoding="utf-8")


def section() -> list[str]:
    """The part of the page."""
    lines, known = [HEAD + "| run | figure | |", "|---|---|---|"], kept()
    for name, figures in known.items():
        for i, (quantity, value) in enumerate(figures.items()):
            if not isinstance(value, list):
                shown = f"{value:,}" if isinstance(value, int) else value
                lines.append(f"| {f'`python -m tests.hard.{name}`' if i == 0 else ''} | {quantity} | {shown} |")
    for name, figures in known.items():
        for quantity, value in figures.items():
            if isinstance(value, list) and value:
                lines += ["", f"`{name}`, {quantity}:", "", *(f"- {item}" for item in value)]
    return [*lines, FOUND.rstrip("\n")]
