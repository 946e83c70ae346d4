"""Generate docs/proofs.md from the ledgers in docs/figures: measurements of each node, and the seeded faults.

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
SDF = Path(raymarch.sdf.__file__).parent
COLUMNS = (
    "node", "samples", "exactness", "divisor", "float32", "gradient", "slope", "looseness", "usual", "box", "outside",
    "inside", "over", "broken",
)  # fmt: skip

for _module in pkgutil.iter_modules([str(SDF)]):
    importlib.import_module(f"raymarch.sdf.{_module.name}")


def names() -> list[str]:
    """The names of all nodes of the package, including flat twins."""
    return sorted(d.name for d in REGISTRY.values() if Path(d.where.file).parent == SDF)


def ledger(name: str) -> dict[str, Any]:
    return json.loads((HERE / "figures" / f"{name}.json").read_text(encoding="utf-8"))


def short(value: float | None, digits: int = 3) -> str:
    if value is None:
        return "—"
    return "0" if value == 0 else f"{value:.{digits}g}"


def shown(name: str) -> str:
    """The name that a user calls, and the definition's own where it differs."""
    called = REGISTRY[name].called
    return f"`{called}`" if called == name else f"`{called}`, {name}"


def row(name: str, found: dict[str, Any]) -> str:
    kinds = found["exactness"] if found["best"] == found["exactness"] else f"{found['best']}, {found['exactness']}"
    twin = short(found["twin"], 2) + ("" if found["twin_limit"] == 16 else f" of {short(found['twin_limit'])}")
    cells = [
        shown(name), str(found["samples"]), kinds, short(found["divisor"]), twin, short(found["gradient"], 1),
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
        f"- {len(rows)} nodes, {sum(r['samples'] for r in rows.values())} samples, "
        f"**{sum(r['violations'] for r in rows.values())} violations**.",
        f"- Looseness: median {np.median(list(loose.values())):.3f}, largest {loose[worst]:.3f} ({shown(worst)}).",
        f"- Usual looseness at the surface: median {np.median(list(usual.values())):.3f}, "
        f"largest {usual[rough]:.3f} ({shown(rough)}).",
        f"- Difference of GLSL in float32 from float64: at most {rows[off]['twin']:.2f} ulp of "
        f"{rows[off]['twin_limit']:g} ({shown(off)}).",
    ]


GUIDE = """
Each node is tested in several samples: with random parameters, and operators on children that are centred, off-centre,
asymmetric, and inexact. A row shows the worst of them. Estimates have no bound on slope or distance. In addition,
`tests/sdf/test_node_pictures.py` compares a picture of each node with the float64 reference.

The facts (exactness, divisor, Lipschitz constant, box, spread) are defined in
[how it is built](how-it-is-built.md#facts).

- **node**: the name that a user calls, and after it the name of the definition where that differs: `union` is several
  definitions, by its blend and dimension.
- **samples**: the number of samples.
- **exactness**: the best and the weakest of the samples.
- **divisor**: the largest divisor of the field, see `Facts.divisor`.
- **float32**: difference of the GLSL in float32 on the driver from float64, at 100,000 points per sample, in ulp of
  max(abs(p), size). At most 16 unless stated; for an estimate, the 98th percentile.
- **gradient**: largest difference of the symbolic gradient from float64 central differences, where the field is
  smooth.
- **slope**: the steepest of a million pairs of points and of the gradients, relative to the Lipschitz bound: at most
  1.
- **looseness**: Lipschitz constant / steepest slope found. At 1 the constant is the smallest possible; at 2 steps are
  half as long as they could be.
- **usual**: Lipschitz constant / median slope at the surface; above 1 for fields whose slope varies.
- **box**: distance of a side of the box from an exact shape, in % of its size: at most 1.
- **outside, inside**: deficit of an exact field relative to the distance to the surface, in % of the size. The
  distance comes from an independent search on the surface, accurate to 0.02 %. At most 0.05.
- **over**: excess of a field over the distance to the nearest of 2,000 points of its surface, in % of its size.
- **broken**: points, pairs and samples that violate one of these, the symmetry, or the box.
"""


KINDS = {
    "lipschitz": "a field that is too steep is not divided by its Lipschitz constant",
    "margin": "a side of a box is 3 % short, or a box does not grow with a blend",
    "look-up": "a neighbouring copy is not evaluated",
    "sign": "a plus replaces a minus, or a minus is missing",
    "clamp": "one side of a min or max, a clamp or an abs is missing",
    "factor": "a factor or a divisor is missing",
    "claim": "declared: exact, convex, symmetric, or spread 1",
}


FAULTS = """
## Seeded faults

This table measures the tests. `python -m tests.lab.node_faults` changes each definition by one fault at a time, at most
three times for each kind of fault, and runs the tests that every node has to pass.

**{caught} of {seeded} were detected, {share:.1f} %**; {promise} of them, {promised:.1f} % of all, because a fact was
violated ("by a fact"). The others make a different field whose facts hold, such as a union without one child or a blend
with another curve. They are detected because the field differs from a recorded one ("by the record"). A change that
alters no value and no fact is not counted ("no fault"), and neither is a smaller box that provably contains the solid.

"""


MISSED = """The faults below were not detected. Most of the declared facts happen to be true for the samples, and the
boxes of the fractals are larger than necessary, so that a smaller one still contains the solid:"""


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
    text += ["| kind | fault | by a fact | by the record | not detected | no fault |", "|---|---|---|---|---|---|"]
    for kind, what in KINDS.items():
        c = kinds.get(kind, dict.fromkeys(total, 0))
        name = "false fact" if kind == "claim" else kind
        text.append(f"| {name} | {what} | {c['promise']} | {c['record']} | {c['missed']} | {c['none']} |")
    return [*text, "", MISSED, "", *[f"- {line}" for line in found["missed"]]]


def page() -> str:
    """The text of docs/proofs.md."""
    known = set(names())
    rows = {name: found for name, found in sorted(ledger("nodes").items()) if name in known}
    text = [
        "# Measured facts of all nodes",
        "",
        "After this page you can judge how well the facts of a node (exactness, Lipschitz bound, box) hold and how",
        "tight they are. `python docs/proofs.py` generates it from `docs/figures/nodes.json`, which",
        "`python -m tests.lab.measure` writes, and from `docs/figures/faults.json`.",
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
