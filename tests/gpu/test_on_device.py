"""The command for a device, as far as a software renderer goes."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from raymarch.gpu.context import Context
from tests.gpu import device as on_device


def test_it_measures_and_writes_json(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert on_device.main(["--json", str(tmp_path / "a.json"), "--examples", "hello", "csg"]) == 0
    found = json.loads((tmp_path / "a.json").read_text())
    assert set(found["examples"]) == {"hello", "csg"} and len(found["contexts"]) == 3
    for row in found["examples"].values():
        assert row["missed"] == row["false"] == 0 and row["depth_p99"] < 1e-3 and row["compile_ms"]["color"] > 0
    table = capsys.readouterr().out
    assert "hello" in table and "float32 errors in ulp" in table


def test_float32_is_as_the_hand_says(egl: Context) -> None:
    found = on_device.float32(egl)
    assert all(0 <= value <= 4 for name, value in found["ulp"].items() if name != "sin_absolute")
    assert found["ulp"]["sin_absolute"] < 1e-3


def test_a_missed_hit_is_no_success() -> None:
    row = {"certified": True, "missed": 0, "false": 0}
    assert on_device.sound({"examples": {"a": row}})
    assert not on_device.sound({"examples": {"a": row, "b": {**row, "missed": 1}}})
    assert on_device.sound({"examples": {"b": {**row, "false": 2, "certified": False}}})
