"""Makes docs/proofs.md from the ledgers in docs/figures: what was measured for each node, and the seeded faults.

python docs/proofs.py
"""

from __future__ import annotations

import importlib
import json
import pkgutil
from pathlib import Path
from typing import Any

import numpy as np

import raymarch.sdf
from raymarch.sdf.definition import REGISTRY

HERE = Path(__file__).parent
ROOM = Path(raymarch.sdf.__file__).parent
COLUMNS = (
    "node", "samples", "exactness", "divisor", "twin", "gradient", "slope", "looseness", "usual", "box", "outside",
    "inside", "over", "broken",
)  # fmt: skip

for _module in pkgutil.iter_modules([str(ROOM)]):
    importlib.import_module(f"raymarch.sdf.{_module.name}")


def names() -> list[str]:
    """All nodes of the package, flat twins too."""
    return sorted(d.name for d in REGISTRY.values() if Path(d.where.file).parent == ROOM)


def ledger(name: str) -> dict[str, Any]:
    return json.loads((HERE / "figures" / f"{name}.json").read_text(encoding="utf-8"))


def missing() -> list[str]:
    """Nodes that have not been measured."""
    rows = ledger("nodes")
    return [name for name in names() if name not in rows]


def short(value: float | None, digits: int = 3) -> str:
    if value is None:
        return "—"
    return "0" if value == 0 else f"{value:.{digits}g}"


def row(name: str, found: dict[str, Any]) -> str:
    kinds = found["exactness"] if found["best"] == found["exactness"] else f"{found['best']}, {found['exactness']}"
    twin = short(found["twin"], 2) + ("" if found["twin_limit"] == 16 else f" of {short(found['twin_limit'])}")
    cells = [
        f"`{name}`", str(found["samples"]), kinds, short(found["divisor"]), twin, short(found["gradient"], 1),
        "—" if found["slope"] is None else f"{found['slope']:.4f}", short(found["looseness"]), short(found["usual"]),
        short(found["margin"], 1), short(found["short_outside"], 1), short(found["short_inside"], 1),
        short(found["over"], 1), str(found["violations"]),
    ]  # fmt: skip
    return f"| {' | '.join(cells)} |"


def summary(rows: dict[str, dict[str, Any]]) -> list[str]:
    loose = {name: r["looseness"] for name, r in rows.items() if r["looseness"] is not None}
    usual = {name: r["usual"] for name, r in rows.items() if r["usual"] is not None}
    worst, rough = max(loose, key=loose.__getitem__), max(usual, key=usual.__getitem__)
    off = max(rows, key=lambda name: rows[name]["twin"] / rows[name]["twin_limit"])
    return [
        f"- {len(rows)} nodes, {sum(r['samples'] for r in rows.values())} samples of them, "
        f"**{sum(r['violations'] for r in rows.values())} promises broken**.",
        f"- Looseness: median {np.median(list(loose.values())):.3f}, largest {loose[worst]:.3f} (`{worst}`).",
        f"- Usual looseness at the surface: median {np.median(list(usual.values())):.3f}, "
        f"largest {usual[rough]:.3f} (`{rough}`).",
        f"- Twins: largest difference {rows[off]['twin']:.2f} ulp of {rows[off]['twin_limit']:g} (`{off}`).",
    ]


GUIDE = """
Each node is looked at in several samples: with drawn parameters, and operators on children that are centred, aside,
without symmetry, and inexact. A row has the worst of them. Estimates promise no slope and no distance. Besides, a
picture of each node is held against the float64 truth, in `tests/sdf/test_node_pictures.py`.

- samples: how many. exactness: the best and the weakest of them. divisor: the largest, see `Facts.divisor`.
- twin: GLSL in float32 on the driver against float64, at 100,000 points a sample, in ulp of max(|p|, size). At most 16
  unless stated; of an estimate, the 98th percentile.
- gradient: symbolic against float64 central differences, the largest difference where the field is smooth.
- slope: the steepest of a million pairs of points and of the gradients, in units of what is promised: at most 1.
- looseness: promised / steepest found. usual: promised / the median slope at the surface; above 1 for fields whose
  slope varies from place to place.
- box: how far a side of the box is from an exact shape, in % of its size: at most 1.
- outside, inside: by how much an exact field is less than the distance to the surface, in % of the size. The distance
  is found by another way, a search on the surface, itself good to 0.02 %. Allowed is 0.05 %.
- over: by how much a field is more than the way to the nearest of 2,000 points of its surface, in % of its size.
- broken: points, pairs and samples at which one of these, the symmetry, or the box was not as promised.
"""


KINDS = {
    "lipschitz": "a field that is too steep not divided by its Lipschitz factor",
    "margin": "a side of a box 3 % short, a box that does not grow with a blend",
    "look-up": "a copy next door not asked",
    "sign": "plus for minus, a minus left out",
    "clamp": "one side of a min or max, a clamp, an abs left out",
    "factor": "a factor or a divisor left out",
    "claim": "exact, convex, symmetric or of no spread, where it is not",
}


FAULTS = """
## Seeded faults

`python tests/sdf/faults.py` breaks every definition on purpose, at most three times for each kind of fault, and runs
the tests that every node has to pass.

**{caught} of {seeded} were noticed, {share:.1f} %**; {promise} of them, {promised:.1f} % of all, because a promise was
broken. The others make another field that keeps all of its promises: a union that leaves out a child, a blend of
another curve. They are noticed because the field is not the one that was measured. No fault, and not counted, is what
changes no value and no fact, and a smaller box that is proved to hold the solid.

"""


MISSED = """Not noticed; most of these claims hold for the samples by chance, and the fractals' boxes are larger than
they need be:"""


def faults() -> list[str]:
    """The table of seeded faults."""
    found = ledger("faults")
    kinds = found["kinds"]
    total = {o: sum(c[o] for c in kinds.values()) for o in ("promise", "record", "missed", "none")}
    seeded = total["promise"] + total["record"] + total["missed"]
    caught = seeded - total["missed"]
    text = FAULTS.format(
        caught=caught,
        seeded=seeded,
        share=100 * caught / seeded,
        promise=total["promise"],
        promised=100 * total["promise"] / seeded,
    ).splitlines()
    text += ["| kind | what | by a promise | by the record | not noticed | no fault |", "|---|---|---|---|---|---|"]
    for kind, what in KINDS.items():
        c = kinds.get(kind, dict.fromkeys(total, 0))
        text.append(f"| {kind} | {what} | {c['promise']} | {c['record']} | {c['missed']} | {c['none']} |")
    return [*text, "", MISSED, "", *[f"- {line}" for line in found["missed"]]]


def page() -> str:
    """docs/proofs.md."""
    known = set(names())
    rows = {name: found for name, found in sorted(ledger("nodes").items()) if name in known}
    text = ["# What was measured", "", "Made by `python docs/proofs.py` from `docs/figures/nodes.json`, which"]
    text += [
        "`python tests/sdf/measure.py` writes, and `docs/figures/faults.json`.",
        "",
        *summary(rows),
        *GUIDE.splitlines(),
        "",
    ]
    text += [f"| {' | '.join(COLUMNS)} |", "|" + "---|" * len(COLUMNS)]
    text += [row(name, found) for name, found in rows.items()]
    text += faults()
    return "\n".join(text) + "\n"


def main() -> None:
    (HERE / "proofs.md").write_text(page(), encoding="utf-8")


if __name__ == "__main__":
    main()
