"""`raymarch doctor --check` finds what a driver does wrong, and nothing on this one."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from raymarch.cli.commands import main
from raymarch.cost import device
from raymarch.cost.device import Case, cases, check
from raymarch.gpu.context import Context
from raymarch.gpu.program import Program
from raymarch.gpu.renderer import Renderer

ALL = {f"{case.group}, {case.name}": case for case in cases()}
SOME = [
    "shapes, torus",
    "shapes, gyroid",
    "operators, implicit waves",
    "effects, sky",
    "numbers, 10000 from the origin",
]
FLUSHED = """
float flushed_root(float s) { return s < 6.1e-5 ? 0.0 : sqrt(s); }
float flushed(vec2 v) { return flushed_root(dot(v, v)); }
float flushed(vec3 v) { return flushed_root(dot(v, v)); }
"""
"""Squares below the least normal number of float16 become 0, as where a driver computes with fewer bits."""


@pytest.fixture
def renderer(egl: Context) -> Iterator[Renderer]:
    with Renderer(device.SIZE, context=egl) as made:
        yield made


def test_every_shape_that_needs_no_argument_and_every_group() -> None:
    assert len(ALL) == len(cases()) > 110
    assert {case.group for case in ALL.values()} == {"shapes", "operators", "effects", "numbers"}
    assert all(f"shapes, {name}" in ALL for name in ("sphere", "star", "mandelbulb", "schwarz_p"))


@pytest.mark.parametrize("name", SOME)
def test_this_driver_is_right(renderer: Renderer, name: str) -> None:
    row = check(renderer, ALL[name])
    assert row.holds and row.hits > 300 and not row.fault


@pytest.mark.parametrize(
    ("fault", "caught"),
    [
        (lambda text: text.replace("sin(", "sin(1.02 * "), "operators, implicit waves"),
        (lambda text: text.replace("length(", "1.003 * length("), "shapes, torus"),
        (lambda text: text.replace("u_far;", "u_far_; float u_far = 2.0;"), "numbers, 10000 from the origin"),
        (lambda text: text.replace("length(", "flushed(").replace("\n", FLUSHED, 1), "operators, taper"),
        (lambda text: text + "\n}", "shapes, gyroid"),
    ],
    ids=["sine", "length", "an end of all rays", "numbers that are flushed to zero", "refused"],
)
def test_a_faulty_driver_is_found(
    renderer: Renderer, monkeypatch: pytest.MonkeyPatch, fault: Callable[[str], str], caught: str
) -> None:
    made: Callable[..., None] = Program.__init__

    def wrong(self: Program, context: Context, vertex: str, fragment: str, *more: Any) -> None:
        made(self, context, vertex, fault(fragment), *more)

    assert check(renderer, ALL[caught]).holds
    monkeypatch.setattr(Program, "__init__", wrong)
    with Renderer(device.SIZE, context=renderer.context) as fresh:
        assert not check(fresh, ALL[caught]).holds


def test_the_command_prints_a_table_and_ends_with_1_for_a_fault(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    some = [ALL["shapes, sphere"], ALL["effects, fog"]]
    monkeypatch.setattr(device, "cases", lambda: some)
    with pytest.raises(SystemExit) as ended:
        main(["doctor", "--check"])
    assert ended.value.code == 0
    told = capsys.readouterr().out
    assert "2 of 2 scenes are as in float64" in told and "effects" in told

    def broken() -> Any:
        raise RuntimeError("no such\nscene")

    some.append(Case("shapes", "broken", broken))
    with pytest.raises(SystemExit) as ended:
        main(["doctor", "--check", "--json"])
    assert ended.value.code == 1
    found = json.loads(capsys.readouterr().out)
    assert [row["holds"] for row in found["check"]] == [True, True, False]
    assert found["check"][2]["fault"] == "no such scene" and found["check"][0]["color"] is None
    assert {report["backend"] for report in found["backends"]} == {"egl", "osmesa", "window"}
