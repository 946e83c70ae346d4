"""The command for a device, as far as a software renderer goes."""

from __future__ import annotations

import importlib.util
import json
import sys
from pathlib import Path
from typing import Any

import pytest

from raymarch.gpu.context import Context

FILE = Path(__file__).with_name("on_device.py")


@pytest.fixture(scope="module")
def command() -> Any:
    spec = importlib.util.spec_from_file_location("on_device", FILE)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["on_device"] = module
    spec.loader.exec_module(module)
    return module


def test_it_measures_and_writes_json(command: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert command.main(["--json", str(tmp_path / "a.json"), "--examples", "hello", "csg"]) == 0
    found = json.loads((tmp_path / "a.json").read_text())
    assert set(found["examples"]) == {"hello", "csg"} and len(found["contexts"]) == 3
    for row in found["examples"].values():
        assert row["missed"] == row["false"] == 0 and row["depth_p99"] < 1e-3 and row["compile_ms"]["color"] > 0
    table = capsys.readouterr().out
    assert "hello" in table and "float32 errors in ulp" in table


def test_float32_is_as_the_hand_says(command: Any, egl: Context) -> None:
    found = command.float32(egl)
    assert all(0 <= value <= 4 for name, value in found["ulp"].items() if name != "sin_absolute")
    assert found["ulp"]["sin_absolute"] < 1e-3


def test_a_missed_hit_is_no_success(command: Any) -> None:
    row = {"certified": True, "missed": 0, "false": 0}
    assert command.sound({"examples": {"a": row}})
    assert not command.sound({"examples": {"a": row, "b": {**row, "missed": 1}}})
    assert command.sound({"examples": {"b": {**row, "false": 2, "certified": False}}})
