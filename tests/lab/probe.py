"""Every node of every example, every kind of node and every scene of the hard cases, looked at while it is drawn.

python -m tests.lab.probe               # all, some minutes; writes docs/figures/probe.json and docs/stability.md
python -m tests.lab.probe examples      # or nodes, or cases: one of the three, written too

A value that is not finite or out of its domain, or a slope beyond its promise, is printed with its node; exit code 1.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import raymarch as rm
from raymarch.expr.arrays import evaluator
from raymarch.expr.derivative import companion
from raymarch.expr.faults import KINDS, decoded, first_fault
from raymarch.gpu import Frame
from raymarch.gpu.probe import Probe, probe_with
from raymarch.gpu.reports import SURFACE, sentences
from raymarch.scene.file import load
from raymarch.sdf.lower import Lowering
from tests.hard.table import PAGE, PROBE, cases, ledger, page
from tests.hard.world import World
from tests.support.node_samples import NodeSample, samples

ROOT = Path(__file__).parents[2]
SHEET = 8
"""Nodes in one scene of the catalogue."""


@dataclass
class Tally:
    """What a set of scenes came to."""

    scenes: int = 0
    nodes: int = 0
    faults: int = 0
    broken: int = 0
    steepest: float = 0.0

    def add(self, found: Probe) -> None:
        self.scenes += 1
        for report in found.reports:
            self.nodes += report.name != SURFACE
            self.faults += report.faults > 0
            self.broken += report.broken
            if report.slope is not None:
                self.steepest = max(self.steepest, report.slope / report.promise)

    def plain(self) -> dict[str, Any]:
        return {**vars(self), "steepest": round(self.steepest, 4)}


# Scenes


def examples() -> Iterator[tuple[str, rm.Scene]]:
    """All files of examples/, those of the papers too."""
    for file in sorted((ROOT / "examples").rglob("*.py")):
        yield str(file.relative_to(ROOT)), load(file)


def solid_of(node: rm.Node) -> rm.Node:
    """A solid with an end, of any node."""
    if node.dimension == 2:
        node = node.extrude(0.5)
    return node & rm.box((3.0, 3.0, 3.0))


def sheet(some: Sequence[NodeSample]) -> rm.Scene:
    """A scene of some samples in rows of four, with a shadow."""
    parts = []
    for k, sample in enumerate(some):
        parts.append(solid_of(sample.build()).translate((4.0 * (k % 4) - 6.0, 0.0, 4.0 * (k // 4) - 2.0)))
    camera = rm.Camera((3.0, 7.0, 16.0), (0.0, 0.0, 0.0), fov=45)
    return rm.Scene(rm.union(*parts), camera, lights=[rm.Sun((1, 3, 2), shadow=True)])


def nodes() -> Iterator[tuple[str, rm.Scene]]:
    """All samples of all nodes of the catalogue."""
    every = samples()
    for first in range(0, len(every), SHEET):
        some = every[first : first + SHEET]
        yield f"{some[0].id} to {some[-1].id}", sheet(some)


class Recorder(World):
    """Remembers the scenes that are drawn."""

    def __init__(self) -> None:
        super().__init__()
        self.scenes: dict[int, rm.Scene] = {}

    def draw(self, scene: rm.Scene, *args: Any, **how: Any) -> Frame:
        self.scenes[id(scene)] = scene
        return super().draw(scene, *args, **how)


def hard_cases() -> Iterator[tuple[str, rm.Scene]]:
    """The scenes that the rows of the hard cases draw by `World.draw`."""
    for each in cases():
        with Recorder() as world:
            list(each.measure(world))
        for k, scene in enumerate(world.scenes.values()):
            yield f"{each.id} scene {k}", scene


SETS: dict[str, Callable[[], Iterator[tuple[str, rm.Scene]]]] = {
    "examples": examples,
    "nodes": nodes,
    "cases": hard_cases,
}


# Without a driver


def faults_in_numpy(sample: NodeSample, points: np.ndarray) -> list[str]:
    """What goes wrong at some points (N, 3) in the field of a sample and in its gradient, in float32; the twin of the
    shader."""
    made: list[rm.Node] = []
    field = Lowering(sites=made).field(sample.build())
    at = points[:, : field.params[0].type.size].astype(np.float32)
    found = []
    for body in (field.body, companion(field).body):
        fault = first_fault([body])
        if fault is None:
            continue
        codes = np.atleast_2d(evaluator([fault], field.params, np.float32)(at)[0])[:, 0]
        for number in np.unique(codes[codes > 0]):
            kind, site = decoded(float(number))
            found.append(
                f"{sample.id}: {KINDS[kind]} at {made[site - 1].name}, {np.count_nonzero(codes == number)} points"
            )
    return found


def main(arguments: Sequence[str]) -> int:
    wrong = False
    for name in arguments or SETS:
        tally = Tally()
        for place, scene in SETS[name]():
            with rm.Renderer((96, 64), "egl") as renderer:
                found = probe_with(renderer, scene)
            tally.add(found)
            for sentence in sentences(found.reports):
                print(f"BROKEN {place}: {sentence}", flush=True)
            print(f"{name} {tally.scenes}: {place}: {len(found.reports) - 1} nodes", flush=True)
            wrong |= not found.sound
        known = {**json.loads(PROBE.read_text(encoding="utf-8")), name: tally.plain()}
        print(f"{name}: {known[name]}", flush=True)
        PROBE.write_text(json.dumps(known, indent=1) + "\n", encoding="utf-8")
        PAGE.write_text(page(cases(), ledger()), encoding="utf-8")
    return 1 if wrong else 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
