"""No value of any node is at fault, and none is steeper than promised: a short part of `python -m tests.lab.probe`."""

from __future__ import annotations

import json

import numpy as np
import pytest

import raymarch as rm
from raymarch.gpu.context import Context
from raymarch.gpu.probe import probe_with
from raymarch.scene.file import load
from tests.hard.table import PROBE
from tests.lab.probe import ROOT, SETS, faults_in_numpy, sheet
from tests.support.node_samples import NodeSample, definitions, samples


def points() -> np.ndarray:
    """Near and far, on axes and planes of symmetry, and on a grid whose lines meet edges and borders of cells."""
    random = np.random.default_rng(8)
    drawn = random.uniform(-2, 2, (200, 3)) * 10 ** random.uniform(-3, 2, (200, 1))
    grid = random.integers(-8, 9, (200, 3)) / 8
    flat = random.uniform(-2, 2, (100, 3)) * random.integers(0, 2, (100, 3))
    return np.concatenate([drawn, grid, flat, np.zeros((1, 3))])


FIRST = {sample.definition.name: sample for sample in reversed(samples())}
"""A sample of each definition."""


@pytest.mark.parametrize("sample", FIRST.values(), ids=lambda sample: sample.definition.name)
def test_no_value_and_no_gradient_of_a_node_is_at_fault(sample: NodeSample) -> None:
    assert faults_in_numpy(sample, points()) == []


def test_every_node_is_among_them() -> None:
    assert set(FIRST) == {definition.name for definition in definitions()}


@pytest.mark.parametrize("name", ["hello", "papers/carpet"])
def test_examples_are_sound(name: str, egl: Context) -> None:
    with rm.Renderer((48, 32), context=egl) as renderer:
        found = probe_with(renderer, load(ROOT / "examples" / f"{name}.py"))
    assert found.sound, str(found)


def test_nodes_are_sound_on_the_device(egl: Context) -> None:
    chosen = [FIRST[name] for name in ("torus", "gyroid")]
    with rm.Renderer((48, 32), context=egl) as renderer:
        found = probe_with(renderer, sheet(chosen))
    assert found.sound and len(found.reports) > 6, str(found)


def test_all_scenes_were_sound_when_they_were_last_looked_at() -> None:
    known = json.loads(PROBE.read_text(encoding="utf-8"))
    assert set(known) == set(SETS)
    for row in known.values():
        assert row["scenes"] > 10 and row["faults"] == 0 and row["broken"] == 0
