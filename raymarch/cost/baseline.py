"""Baselines: errors and evaluations of scenes, recorded in a file and compared with a later measurement.

Only figures that do not depend on time are in it, so another machine of the same driver gives the same figures.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from raymarch.cost.effects import evaluations_of
from raymarch.cost.errors import measure
from raymarch.cost.reference import Reference
from raymarch.errors import CostError
from raymarch.expr.convert import integer, real, short
from raymarch.files import read_json, reading
from raymarch.scene.quality import PRESETS
from raymarch.scene.scene import Scene

FORMAT = 1
OWN = "own"
"""Name of the row of the scene's own quality; the others are named after presets."""
GROWTH = 1.05
"""How many times the recorded figure is allowed."""
SLACK = {
    "evaluations": 0.02,
    "all_evaluations": 0.02,
    "pixels_p50": 3e-4,
    "pixels_p99": 3e-4,
    "normal_p99": 2e-3,
}
"""What is allowed in addition: processors that fuse products and sums differ by some units in the last place."""
OF_ALL_RAYS = "all_evaluations"
"""The figure that only the scene's own quality has."""
COUNTS = ("missed", "false")
"""Figures that may not grow at all."""
MOST = 1 << 14
"""Maximum number of pixels of a picture along an edge."""
LEGAL = "a file that raymarch cost --write-baseline wrote"

Row = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Record:
    """What was measured of a scene: size, time and parameters of the picture, and the figures of each setting."""

    size: tuple[int, int]
    time: float
    params: Mapping[str, Any]
    rows: Mapping[str, Row]


def row_of(
    scene: Scene, known: Reference, renderer: Any, time: float = 0.0, params: Mapping[str, Any] | None = None
) -> Row:
    """The figures of one setting: evaluations of primary rays and errors. None where nothing could be compared."""
    frame = renderer.render(scene, time, params, outputs=("depth",))
    errors = measure(known, frame.depth, frame.normal)
    return {
        "evaluations": round(float(frame.evaluations.mean()), 3),
        "missed": errors.missed,
        "false": errors.false,
        "pixels_p50": _rounded(errors.pixels_p50, 6),
        "pixels_p99": _rounded(errors.pixels_p99, 6),
        "normal_p99": _rounded(errors.normal_p99, 5),
    }


def measured(
    scene: Scene, known: Reference, renderer: Any, time: float = 0.0, params: Mapping[str, Any] | None = None
) -> dict[str, Row]:
    """The rows of a scene: its own quality with the evaluations of all its rays, and every preset."""
    rows = {OWN: row_of(scene, known, renderer, time, params)}
    rows[OWN][OF_ALL_RAYS] = round(evaluations_of(scene, renderer, time, params), 3)
    for preset in PRESETS:
        changed = scene.replace(quality=scene.quality.to_preset(preset))
        rows[preset] = row_of(changed, known, renderer, time, params)
    return rows


def grown(name: str, known: Mapping[str, Any], now: Mapping[str, Any]) -> list[str]:
    """What grew, in words that name the row; empty if nothing did."""
    faults = []
    for figure, before in known.items():
        value = now[figure]
        if before is None and value is None:
            continue
        most = 0.0 if before is None else before if figure in COUNTS else before * GROWTH + SLACK[figure]
        if value is None or not value <= most:
            change = f" (+{value / before - 1:.0%})" if before and value else ""
            faults.append(f"{name}: {figure} grew from {before} to {value}{change}, at most {most:.6g}")
    return faults


def summary(name: str, record: Record, now: Mapping[str, Row], faults: int) -> str:
    """One line: what was compared, and the figures of the scene's own quality with their change."""
    before, own = record.rows[OWN], now[OWN]

    def change(figure: str) -> str:
        compared = before is not own and before[figure] and own[figure]
        return f" ({own[figure] / before[figure] - 1:+.0%})" if compared else ""

    verdict = (
        f"{faults} figure{'s' if faults > 1 else ''} grew" if faults else f"nothing grew at {len(record.rows)} settings"
    )
    width, height = record.size
    error = "no hit" if own["pixels_p99"] is None else f"{own['pixels_p99']} px{change('pixels_p99')}"
    return (
        f"{name} at {width}x{height}: {verdict}; {error}, "
        f"{own['all_evaluations']:.1f} evaluations per pixel{change('all_evaluations')}, "
        f"{own['missed'] + own['false']} missed or false hits"
    )


def read(file: Path) -> dict[str, Record]:
    """The records of a baseline by scene. CostError if the file is not one."""
    stored = read_json("baseline", file, LEGAL, CostError)
    with reading("baseline", file, LEGAL, CostError):
        if stored["format"] != FORMAT:
            raise CostError(f"another version wrote it, format {short(stored['format'])}", legal=f"format {FORMAT}")
        return {str(name): _record(values) for name, values in stored["scenes"].items()}


def _record(values: Any) -> Record:
    width, height = (integer("size", side, 1, MOST) for side in values["size"])
    rows = values["rows"]
    _check_names("settings", rows, (OWN, *PRESETS))
    for name, row in rows.items():
        _check_names(f"figures of '{name}'", row, [f for f in (*COUNTS, *SLACK) if name == OWN or f != OF_ALL_RAYS])
        for figure, value in row.items():
            if value is not None:
                real(f"{name}: {figure}", value, 0.0)
    return Record((width, height), real("time", values["time"]), dict(values["params"]), rows)


def _check_names(what: str, given: Mapping[str, Any], known: Sequence[str]) -> None:
    if given.keys() != set(known):
        raise CostError(f"another version wrote it, with the {what} {short(', '.join(given))}", legal=", ".join(known))


def as_text(records: Mapping[str, Record]) -> str:
    scenes = {name: asdict(record) for name, record in sorted(records.items())}
    return json.dumps({"format": FORMAT, "scenes": scenes}, indent=1, allow_nan=False) + "\n"


def _rounded(value: float, digits: int) -> float | None:
    return None if value != value else round(value, digits)
