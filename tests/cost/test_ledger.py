"""No example loses accuracy or takes more evaluations than the ledger says."""

from __future__ import annotations

import json

import pytest

import raymarch as rm
from raymarch.cost.baseline import grown
from raymarch.scene import load
from raymarch.scene.quality import PRESETS, PROMISED
from tests.lab.ledger import EXAMPLES, FILE, SIZE, row, wanted

LEDGER = json.loads(FILE.read_text())
CASES = [(file, preset) for file in EXAMPLES for preset in PRESETS]


@pytest.fixture(scope="module")
def renderer():
    with rm.Renderer(SIZE) as made:
        yield made


def test_the_ledger_has_every_example_and_preset():
    assert set(LEDGER["rows"]) == set(wanted()), "run python -m tests.lab.renew"
    assert LEDGER["size"] == list(SIZE)


@pytest.mark.parametrize(("file", "preset"), CASES, ids=[f"{f.stem}-{p}" for f, p in CASES])
def test_nothing_grew(file, preset, renderer):
    name = f"{file.stem} {preset}"
    now = row(file, preset, renderer)
    faults = grown(name, LEDGER["rows"][name], now)
    assert not faults, "; ".join(faults)
    if load(file).node.exactness != "estimate":
        assert now["pixels_p99"] <= PROMISED[preset], "what the preset promises"
        assert (now["missed"], now["false"]) == (0, 0)
