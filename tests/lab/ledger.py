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
from raymarch.cost.baseline import row_of
from raymarch.cost.reference import reference
from raymarch.scene import load
from raymarch.scene.quality import PRESETS

ROOT = Path(__file__).parents[2]
FILE = ROOT / "tests" / "ledger.json"
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
SIZE = (160, 90)


def row(file: Path, preset: str, renderer: rm.Renderer) -> dict[str, Any]:
    """The figures of one example at one preset."""
    scene = load(file).replace(quality=rm.Quality.preset(preset))
    return row_of(scene, reference(scene, SIZE, samples=0), renderer)


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
