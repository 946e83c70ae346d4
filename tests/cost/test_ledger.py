"""No example loses accuracy or takes more evaluations than the ledger says."""

from __future__ import annotations

import json

import pytest

import raymarch as rm
from raymarch.scene import load
from raymarch.scene.quality import PRESETS, PROMISED
from tests.lab.ledger import EXAMPLES, FILE, SIZE, grown, row, wanted

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


@pytest.mark.parametrize("figure", ["evaluations", "pixels_p99", "missed"])
def test_growth_is_named(figure):
    known = {"evaluations": 20.0, "missed": 0, "false": 0, "pixels_p50": 1e-4, "pixels_p99": 0.01, "normal_p99": 0.1}
    assert not grown("hall fine", known, known | {"evaluations": 20.9, "pixels_p99": 0.0105})
    worse = known | {figure: known[figure] * 1.07 + 0.4 * (figure == "missed") + 5e-4}
    (fault,) = grown("hall fine", known, worse)
    assert fault.startswith(f"hall fine: {figure} grew from")
    assert len(grown("hall fine", known, known | {figure: float("nan")})) == 1
