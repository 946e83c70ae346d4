"""The ledger of the last runs of the long commands, docs/figures/long_runs.json, and their section of the page."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

LEDGER = Path(__file__).parents[2] / "docs" / "figures" / "long_runs.json"

HEAD = """## Long runs

These commands take minutes or hours; CI runs a short sample of each. The table shows the last runs with `--keep`:

"""

FOUND = """
Findings:

- **Shallow dips.** Within an epsilon of a surface, the last steps of a ray follow the slope and prove nothing. On a
  wavy wall they may step over a dip that is less than an epsilon (a tenth of a pixel) deep, and end pixels farther
  along the ray. `watertight` counts such rays. They limit the claim that nothing is in front of a hit.
- **Rounding.** The fuzz test used to allow a field 64 ulp, an arbitrary number. The float32 error is now bounded at
  each point by a running bound of the rounding errors (`tests/hard/rounding.py`): 3 ulp of its size for a box, 7,000
  for the deepest of 25 random trees, 20 for half of them. The driver is within the bound everywhere.
- **Single functions.** Tests of single functions at the ends of their ranges (`tests/functions`) found errors that no
  picture had shown. The bracketing tracer stalled in front of a wall at normal incidence (2 of 1,000 profiles). A ray
  that ran out of steps took a sample deep inside a solid as its nearest. A slice read undefined values where rays run
  along it. A history with a value that is not finite turned black, or counted as ten samples. A black surface divided
  0 by 0, which this driver hides. Sixteen guards that no input reaches were removed. Of three more, in the march, one
  changed no bit of 108,000 rays, and two change fewer than one ray in 600, none of them wrongly.
- **Seeded faults.** `glsl_faults` takes out a clamp, guard, choice or absolute value of a line of GLSL, of conditional
  lines and templates too. It asks the tests that draw with the line, those of single functions first, at most 3 CPU
  seconds of others. All were tried in November 2026. What pictures do not show, tests of functions do: a step and a
  sample close to a surface for 6,000 states, rays past membranes and thin sheets, the notes of `rm.plot_ray`. Where
  a line decides only what a ray costs, its evaluations are a figure of the test.
  `python_faults` does so with 40 random faults of the functions that plan and
  assemble shaders. Both found holes, which have tests now: the edges of orthographic rays, points of a lens, points of
  the earlier frame, shadows and secondary rays that run out of steps, pictures without finite light, and the reasons of
  text for objects. `docs/figures/glsl_faults.json` names each fault that nothing notices, and says why some are none.
- **Random scenes.** Of 5,007 scenes four were reported, and all are explained. Three solids are provably empty; their
  inverted bounding box was taken for a size by a relation (an empty part now causes a warning with its line). The
  fourth has a whole volume of zeros, an elongated wave through the origin, where the field has no slope and so no
  normal. 1,200 more scenes after the changes showed nothing.
- **Memory.** Evaluation at many points kept every intermediate value for all points at once. Points are now evaluated
  in blocks.
- **Waves of time.** sin(x + time) in a user's own function moved in steps of 2 s after a year; see row 36.
- **cProfile.** Profiling a program while it built a scene broke the program. Scenes can be profiled now.
"""


def kept() -> dict[str, Any]:
    return dict(json.loads(LEDGER.read_text(encoding="utf-8"))) if LEDGER.exists() else {}


def keep(name: str, **figures: Any) -> None:
    """Replace the figures of the last run by those of this one."""
    LEDGER.write_text(json.dumps({**kept(), name: figures}, indent=1) + "\n", encoding="utf-8")


def section() -> list[str]:
    """The section of the page."""
    lines, known = [HEAD + "| run | figure | |", "|---|---|---|"], kept()
    for name, figures in known.items():
        for i, (quantity, value) in enumerate(figures.items()):
            if not isinstance(value, list):
                shown = f"{value:,}" if isinstance(value, int) else value
                lines.append(f"| {f'`python -m tests.lab.{name}`' if i == 0 else ''} | {quantity} | {shown} |")
    for name, figures in known.items():
        for quantity, value in figures.items():
            if isinstance(value, list) and value:
                lines += ["", f"`{name}`, {quantity}:", "", *(f"- {item}" for item in value)]
    return [*lines, FOUND.rstrip("\n")]
