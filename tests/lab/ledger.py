"""The accuracy ledger: errors and evaluations a pixel of every example at every preset.

python -m tests.lab.ledger                # all examples: some minutes; writes tests/ledger.json
python -m tests.lab.ledger --missing      # those without a row
python -m tests.lab.ledger hello village  # some

Only figures that do not depend on time are in it. A test measures them again and names the row that grew.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import raymarch as rm
from raymarch.cost.errors import measure
from raymarch.cost.reference import reference
from raymarch.cost.settings import with_quality
from raymarch.scene import load
from raymarch.scene.quality import PRESETS

ROOT = Path(__file__).parents[2]
FILE = ROOT / "tests" / "ledger.json"
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
SIZE = (160, 90)
GROWTH = 1.05
"""How much more than in the ledger is a fault."""
SLACK = {"evaluations": 0.02, "pixels_p50": 3e-4, "pixels_p99": 3e-4, "normal_p99": 2e-3}
"""What processors that fuse products and sums may differ by: some units in the last place of float32."""
COUNTS = ("missed", "false")
"""Figures that may not grow at all."""


def row(file: Path, preset: str, renderer: rm.Renderer) -> dict[str, Any]:
    """The figures of one example at one preset."""
    scene = with_quality(load(file), rm.Quality.preset(preset))
    frame = renderer.render(scene, outputs=("depth",))
    errors = measure(reference(scene, SIZE, samples=0), frame.depth, frame.normal)
    return {
        "evaluations": round(float(frame.evaluations.mean()), 3),
        "missed": errors.missed,
        "false": errors.false,
        "pixels_p50": round(errors.pixels_p50, 6),
        "pixels_p99": round(errors.pixels_p99, 6),
        "normal_p99": round(errors.normal_p99, 5),
    }


def grown(name: str, known: dict[str, Any], now: dict[str, Any]) -> list[str]:
    """What grew, in words that name the row; empty if nothing did."""
    faults = []
    for figure, before in known.items():
        most = before if figure in COUNTS else before * GROWTH + SLACK[figure]
        if not now[figure] <= most:
            faults.append(f"{name}: {figure} grew from {before} to {now[figure]}, at most {most:.6g}")
    return faults


def read() -> dict[str, dict[str, Any]]:
    """The rows of the ledger; none if it was measured at another size."""
    known = json.loads(FILE.read_text(encoding="utf-8")) if FILE.exists() else {}
    return dict(known["rows"]) if known.get("size") == list(SIZE) else {}


def wanted() -> dict[str, tuple[Path, str]]:
    """The example and the preset of each row, by its name."""
    return {f"{file.stem} {preset}": (file, preset) for file in EXAMPLES for preset in PRESETS}


def missing() -> list[str]:
    """The examples that have not been measured at every preset."""
    known, rows = read(), wanted()
    return list(dict.fromkeys(file.stem for name, (file, _) in rows.items() if name not in known))


def main(arguments: Sequence[str]) -> int:
    rows, names = wanted(), [file.stem for file in EXAMPLES]
    unknown = [a for a in arguments if a != "--missing" and a not in names]
    if unknown:
        print(f"no examples: {', '.join(unknown)}")
        return 2
    if arguments:
        names = [a for a in arguments if a != "--missing"] + (missing() if "--missing" in arguments else [])
    known = {name: found for name, found in read().items() if name in rows}
    with rm.Renderer(SIZE) as renderer:
        for name, (file, preset) in rows.items():
            if file.stem in names:
                known[name] = row(file, preset, renderer)
                print(f"{name}: {known[name]}", flush=True)
    ordered = {name: known[name] for name in rows if name in known}
    FILE.write_text(json.dumps({"size": list(SIZE), "rows": ordered}, indent=1) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
