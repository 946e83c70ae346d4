"""Seeds faults into every definition of the package and counts how many of them the generic tests notice.

python -m tests.lab.node_faults                  # all: some minutes; writes docs/figures/faults.json
python -m tests.lab.node_faults torus gyroid     # of some nodes, in words

Of each node and each kind of fault a few are drawn, always the same ones. Told apart and not counted is what is no
fault: a formula that gives the same value at each of the 100,000 points of every sample, facts that do not differ, a
smaller box that is proved to hold the solid, a symmetry that the samples do have.
"""

from __future__ import annotations

import json
import sys
import warnings
import zlib
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from raymarch.sdf import Node
from raymarch.sdf.definition import Definition
from tests.lab.mutation import Fault, fact_faults, formula_faults, rebuilt
from tests.sdf import test_every_node as promises
from tests.support.node_samples import POINTS, Field, NodeSample, Seen, definitions, samples

LEDGER = Path(__file__).parents[2] / "docs" / "figures" / "faults.json"
FACTS = ("exactness", "divisor", "lower", "upper", "symmetry", "spread", "convex")
EACH = 3
"""Faults of a kind in one definition; four times as many look-ups."""

CHECKS: list[Callable[[Seen], None]] = [
    promises.solid_lies_within_its_bounds,
    promises.no_side_of_the_box_cuts_the_solid,
    promises.never_steeper_than_promised,
    promises.small_values_lie_near_the_bounds,
    promises.symmetry_is_symmetry,
    promises.what_is_called_convex_is_convex,
    promises.every_child_counts,
    promises.special_points,
    promises.shapes_do_not_know_their_unit,
    promises.distance_is_never_larger_than_to_the_surface,
    promises.bounds_of_exact_shapes_are_tight,
    promises.exact_distance_is_the_distance,
]
"""The generic tests that a fault in a definition can turn red, quick ones first."""


@dataclass
class Subject:
    """A definition with its samples, built and looked at while it was right."""

    definition: Definition
    seen: list[Seen]
    _names: list[str] = field(default_factory=list)


def look(sample: NodeSample, node: Node) -> Seen:
    """As `look_at`, at a node that is there already."""
    seen = Field(node)
    points = seen.draw(np.random.default_rng(11), POINTS)
    return Seen(sample, node, seen, points, seen.value(points))


def subject(definition: Definition) -> Subject:
    chosen = [x for x in samples() if x.definition is definition]
    return Subject(definition, [look(x, x.build()) for x in chosen])


def faults_of(about: Subject, each: int) -> Iterator[Fault]:
    """Some of each kind."""
    definition = about.definition
    kinds: dict[str, list[Fault]] = defaultdict(list)
    parts = [(n.definition.template(len(n.children), n.params).body, n) for n in _parts(about)]
    body = max((body for body, _ in parts), key=lambda e: sum(1 for _ in formula_faults(definition, e)))
    for fault in formula_faults(definition, body):
        kinds[fault.kind].append(fault)
    for fault in fact_faults(definition, [n for _, n in parts]):
        kinds[fault.kind].append(fault)
    random = np.random.default_rng(zlib.crc32(definition.name.encode()))
    for kind, some in kinds.items():
        few = 4 * each if kind == "look-up" else each  # few definitions have any
        for k in sorted(random.permutation(len(some))[:few]):
            yield some[k]


def _parts(about: Subject) -> list[Node]:
    """The nodes of the definition in its samples; a sample may wrap it in others."""
    found = []
    for s in about.seen:
        pending = [s.node]
        while pending:
            node = pending.pop()
            if node.definition is about.definition:
                found.append(node)
            pending.extend(node.children)
    return found


def verdict(fault: Fault, about: Subject) -> str:
    """What becomes of a fault: "promise" or "record", by which of the tests it was noticed; "none"; "missed"."""
    harmless = True
    recorded = False
    for right in about.seen:
        try:
            with fault.seeded():
                wrong = look(right.sample, rebuilt(right.node))
                if _harmless(fault, right, wrong):
                    continue
                harmless = False
                recorded |= fault.formula and not np.allclose(
                    right.means, wrong.means, rtol=1e-8, atol=1e-8 * right.field.size
                )
                for check in CHECKS:
                    check(wrong)
        except Exception as error:
            return f"promise: {type(error).__name__} in {_where(error)}"
    return "none" if harmless else "record" if recorded else "missed"


def _harmless(fault: Fault, right: Seen, wrong: Seen) -> bool:
    """No fault at all, as far as this sample goes."""
    if fault.formula:
        return _equal(right, wrong)
    before, after = right.node.facts, wrong.node.facts
    values = [(getattr(before, f), getattr(after, f)) for f in FACTS]
    if all(np.array_equal(a, b) for a, b in values):
        return True
    if fault.kind == "margin":
        return holds_the_solid(right, after.lower, after.upper)
    if fault.what.startswith("symmetric"):
        mirrored = right.points * np.where(np.arange(right.node.dimension) == "xyz".index(fault.what[-1]), -1.0, 1.0)
        return bool(np.all(np.abs(right.field.value(mirrored) - right.values) <= 1e-12 * right.field.size))
    return False


def holds_the_solid(s: Seen, low: Any, high: Any) -> bool:
    """Proof that no interior point lies between a box and the right one around it, by cells ever smaller.

    The middle of a cell whose value is more than half its diagonal is the middle of an empty cell, for a field that is
    no steeper than 1.
    """
    outer_low, outer_high = s.node.bounds
    if s.node.exactness == "estimate" or not s.node.facts.bounded:
        return False
    for axis in range(s.node.dimension):
        for near, far in ((low[axis], outer_low[axis]), (high[axis], outer_high[axis])):
            bottom, top = outer_low.copy(), outer_high.copy()
            bottom[axis], top[axis] = min(near, far), max(near, far)
            if near != far and not _empty(s.field, bottom, top):
                return False
    return True


def _empty(field: Field, low: Any, high: Any) -> bool:
    middles, half = 0.5 * (low + high)[None], 0.5 * (high - low)
    for _ in range(18):
        values = field.value(middles)
        if np.any(values < 0):
            return False
        middles = middles[values <= np.linalg.norm(half)]
        if not len(middles):
            return True
        if len(middles) > 200_000:
            return False
        axis = int(np.argmax(half))
        half[axis] *= 0.5
        step = np.where(np.arange(len(half)) == axis, half, 0.0)
        middles = np.concatenate([middles - step, middles + step])
    return False


def _equal(right: Seen, wrong: Seen) -> bool:
    if not np.array_equal(right.points, wrong.points):
        return False
    return bool(np.all(np.abs(right.values - wrong.values) <= 1e-12 * right.field.size))


def _where(error: BaseException) -> str:
    names, trace = [], error.__traceback__
    while trace is not None:
        names.append(trace.tb_frame.f_code.co_name)
        trace = trace.tb_next
    return next((n for n in names if n in {check.__name__ for check in CHECKS}), names[-1])


def run(names: list[str], each: int, show: Callable[[str], None]) -> dict[str, Any]:
    """Counts for each kind of fault, and in words what was noticed by no promise and what not at all."""
    counts: dict[str, Counter[str]] = defaultdict(Counter)
    lines: dict[str, list[str]] = {"record": [], "missed": []}
    for definition in definitions():
        if names and definition.name not in names:
            continue
        about = subject(definition)
        for fault in faults_of(about, each):
            with warnings.catch_warnings(), np.errstate(all="ignore"):
                warnings.simplefilter("ignore")
                found = verdict(fault, about)
            outcome = found.partition(":")[0]
            counts[fault.kind][outcome] += 1
            line = f"{definition.name}: {fault.what}"
            if outcome in lines:
                lines[outcome].append(line)
            show(f"{fault.kind}: {line} -> {found}")
    kinds = {kind: {o: c[o] for o in ("promise", "record", "missed", "none")} for kind, c in sorted(counts.items())}
    return {"kinds": kinds, **lines}


def shares(found: dict[str, Any]) -> tuple[int, int, int]:
    """How many faults there were, how many a promise noticed, and how many a promise or the record."""
    promise, record, missed = (sum(c[o] for c in found["kinds"].values()) for o in ("promise", "record", "missed"))
    return promise + record + missed, promise, promise + record


def main(arguments: list[str]) -> int:
    found = run(arguments, EACH, lambda line: print(line, flush=True))
    for kind, c in found["kinds"].items():
        print(kind, c)
    seeded, promise, caught = shares(found)
    print(f"{seeded} faults; noticed by a promise {promise}, by that or the record {caught}")
    if not arguments:
        LEDGER.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    return 0 if caught >= 0.95 * seeded else 1


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
