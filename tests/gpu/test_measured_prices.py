"""Prices measured on a driver: where they are kept, when they are used, and what they change."""

from __future__ import annotations

import json
import warnings
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.cli.commands import main
from raymarch.cli.doctor import _show_prices
from raymarch.cost import prices as measuring
from raymarch.cost.prices import Bench, Times, measure
from raymarch.errors import DeviceError, SceneWarning
from raymarch.gpu import measured_prices
from raymarch.gpu.context import Context
from raymarch.gpu.doctor import ClockReport, LoopLimit, Report
from raymarch.gpu.driver import Driver
from raymarch.gpu.measured_prices import Measured, file_of, keep, of_driver, replaced
from raymarch.plan import plan
from raymarch.plan.device import HARDWARE, SOFTWARE, as_plain, of_plain
from raymarch.prices import NEVER, STANDARD, Prices
from raymarch.shader import assemble

PLACES = np.random.default_rng(3).uniform(-2, 2, (50, 3))
BALLS = rm.Scene(rm.union(*(rm.sphere(0.1 + 1e-3 * i).translate(p) for i, p in enumerate(PLACES))))
DRIVER = Driver("llvmpipe (of a test)", "Mesa", "4.5", True)


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("RAYMARCH_CACHE", str(tmp_path))
    monkeypatch.delenv("RAYMARCH_MEASURED", raising=False)
    monkeypatch.delenv("RAYMARCH_DEVICE_CLASS", raising=False)
    return tmp_path


def measured(driver: Driver = DRIVER, **prices: float) -> Measured:
    return Measured(driver.renderer, driver.version, rm.__version__, "software", "2026-01-02", prices, {})


class Fake(Bench):
    """A bench whose clock knows what each side takes: milliseconds of a frame, by the prices that force it."""

    def __init__(self, milliseconds: Any, jitter: float = 0.0) -> None:
        self.context: Any = SimpleNamespace(driver=DRIVER)
        self.device, self.milliseconds, self.jitter = SOFTWARE, milliseconds, jitter
        self.random = np.random.default_rng(1)

    def times(self, scene: rm.Scene, sides: Sequence[Prices], size: Any = None, rounds: Any = None) -> Times:
        frame = [self.milliseconds(len(scene.node.children), prices) for prices in sides]
        noise = self.random.uniform(-self.jitter, self.jitter, (15, len(sides)))
        return Times(np.zeros((3, len(sides))), np.array(frame) * np.exp(noise))

    def sizes(self, scene: rm.Scene, prices: Prices) -> Any:
        return measuring.SIZES[:3]

    def evaluations(self, scene: rm.Scene, prices: Prices) -> float:
        return 1e6


@pytest.mark.parametrize(("nanoseconds", "sizes"), [(1e2, measuring.SIZES[2:]), (1e5, measuring.SIZES[:3])])
def test_a_slow_driver_draws_smaller_pictures(egl: Context, nanoseconds: float, sizes: Any) -> None:
    ball = rm.Scene(rm.sphere())
    bench = Bench(egl, SOFTWARE, lambda draw: 1e-6 * nanoseconds * 24 * 14)
    assert bench.sizes(ball, STANDARD) == sizes


def rows_cost(objects: int) -> Any:
    """A frame of a scene as rows takes as long as so many objects of text."""
    return lambda count, prices: 0.1 * (objects if prices.look_up == 0.0 else count)


@pytest.mark.parametrize(("objects", "rows"), [(100, False), (15, True)])
def test_a_clock_that_makes_rows_dear_changes_the_plan(objects: int, rows: bool) -> None:
    assert plan(BALLS).gathered.rows, "the class makes rows of 50"
    made, (look_up,) = measure(Fake(rows_cost(objects)), "2026-01-02", stages=[measuring._objects])
    assert not look_up.kept and made.prices == {"look_up": look_up.value}
    device = measured_prices.with_prices(SOFTWARE, made)
    assert bool(plan(BALLS, device=device).gathered.rows) == rows


@pytest.mark.parametrize(("share", "never"), [(0.9, True), (1.1, False)])
def test_closed_forms_that_are_dearer_at_every_size_are_never_chosen(share: float, never: bool) -> None:
    def cost(count: int, prices: Prices) -> float:
        return count * (share if prices.closed_form == NEVER else 1.0)

    made, (closed,) = measure(Fake(cost), "2026-01-02", stages=[measuring._closed_forms])
    assert (closed.value == NEVER) == never and not closed.kept
    prices = replaced(Prices(), made.prices)
    assert (prices.closed_forms == 0) == never, "a scene of one ball marches it"
    keep(made, DeviceError)
    assert DRIVER.device_class.prices == prices, "the file is read"


@pytest.mark.parametrize("stage", [measuring._boxes, measuring._objects, measuring._cones])
def test_what_pays_at_no_measured_size_is_never_paid(stage: Any) -> None:
    def dear(count: int, prices: Prices) -> float:
        return 2.0 if 0.0 in (prices.skip, prices.look_up, prices.draw) else 1.0

    made, (price,) = measure(Fake(dear), "2026-01-02", stages=[stage])
    assert made.prices == {price.name: NEVER}


def test_a_price_that_noise_hides_is_that_of_the_class() -> None:
    made, (look_up,) = measure(Fake(rows_cost(40), jitter=3.0), "2026-01-02", stages=[measuring._objects])
    assert made.prices == {} and made.kept == {"look_up": look_up.kept} and look_up.standard == STANDARD.look_up


def test_prices_of_one_driver_are_used_by_no_other() -> None:
    keep(measured(look_up=4000.0), DeviceError)
    assert DRIVER.device_class.prices.look_up == 4000.0 and "2026-01-02" in DRIVER.device_class.measured
    assert DRIVER.class_alone == SOFTWARE
    for other in (replace(DRIVER, renderer="softpipe"), replace(DRIVER, version="4.6")):
        assert other.device_class is SOFTWARE
    assert replace(DRIVER, is_software=False).device_class is HARDWARE, "measured for another class"


@pytest.mark.parametrize("value", ["off", "0"])
def test_the_environment_ignores_them(monkeypatch: pytest.MonkeyPatch, value: str) -> None:
    keep(measured(look_up=4000.0), DeviceError)
    monkeypatch.setenv("RAYMARCH_MEASURED", value)
    assert DRIVER.device_class is SOFTWARE


@pytest.mark.parametrize(
    "content",
    [
        "",
        "[]",
        "{",
        '{"renderer": 1}',
        json.dumps({**measured_prices.asdict(measured(look_up=4000.0)), "renderer": "softpipe"}),
        json.dumps(measured_prices.asdict(measured(look_up=-1.0))),
        json.dumps(measured_prices.asdict(measured(unknown=1.0))),
    ],
)
def test_a_broken_file_is_ignored_with_one_line(content: str) -> None:
    keep(measured(look_up=4000.0), DeviceError)
    file = file_of(DRIVER.renderer, DRIVER.version)
    assert file is not None
    file.write_text(content)
    measured_prices._read.cache_clear()
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        assert DRIVER.device_class is SOFTWARE and DRIVER.device_class is SOFTWARE
    (line,) = (str(each.message) for each in said if each.category is SceneWarning)
    assert str(file) in line and "ignored" in line and "\n" not in line


def test_a_folder_that_cannot_be_written_is_said_before_anything_is_measured(
    cache: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(measuring, "measure", None)
    (cache / "prices").write_text("no folder")
    assert run("doctor", "--measure") == 2
    assert str(cache / "prices") in (told := capsys.readouterr().err) and "RAYMARCH_CACHE" in told
    monkeypatch.setenv("RAYMARCH_CACHE", "")
    assert run("doctor", "--measure") == 2
    assert "RAYMARCH_CACHE is empty" in capsys.readouterr().err


def test_the_command_measures_and_keeps(cache: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("doctor", "--measure") == 0
    assert [*(cache / "prices").iterdir()] and "operation" in capsys.readouterr().out


def run(*arguments: str) -> Any:
    with pytest.raises(SystemExit) as stop:
        main(list(arguments))
    return stop.value.code or 0


def test_a_renderer_plans_by_the_prices_of_its_driver(egl: Context) -> None:
    alone = egl.driver.class_alone
    keep(replace(measured(egl.driver, look_up=4000.0), device=alone.name), DeviceError)
    with rm.Renderer((16, 9), context=egl) as renderer:
        assert not renderer.prepared(BALLS).plan.gathered.rows
        renderer.resources.device = alone
        assert renderer.prepared(BALLS).plan.gathered.rows, "as workers of a cluster do"


def test_commands_say_where_prices_are_from(
    egl: Context, cache: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    clock = ClockReport("wall clock", "")
    report = Report("egl", True, None, None, egl.driver, egl.limits, LoopLimit(1, 1), clock, "fragment shaders")
    monkeypatch.setattr("raymarch.cli.doctor.examine", lambda: [report])
    (cache / "scene.py").write_text("import raymarch as rm\nscene = rm.sphere()\n")
    file = str(cache / "scene.py")
    run("explain", file)
    assert "those of the class software" in capsys.readouterr().out
    kept = keep(measured(egl.driver, skip=300.0), DeviceError)
    run("explain", file)
    assert f" prices measured on {egl.driver.renderer}, 2026-01-02" in " ".join(capsys.readouterr().out.split())
    run("explain", file, "--json")
    assert json.loads(capsys.readouterr().out)["device"]["prices"]["skip"] == 300.0
    run("doctor", "--json")
    (known,) = (each["prices"] for each in json.loads(capsys.readouterr().out) if each["backend"] == "egl")
    assert known["used"] and known["file"] == str(kept) and known["prices"] == {"skip": 300.0}
    monkeypatch.setenv("RAYMARCH_MEASURED", "")  # so that it is restored
    run("explain", file, "--no-measured", "--json")
    assert json.loads(capsys.readouterr().out)["device"]["prices"]["skip"] == STANDARD.skip
    run("doctor")
    told = " ".join(capsys.readouterr().out.split())
    assert "ignored, as RAYMARCH_MEASURED says" in told and kept.name in told


def test_what_was_measured_is_a_table_with_units_and_reasons(capsys: pytest.CaptureFixture[str]) -> None:
    stages = [partial(_yields, name, [0.9, 1.0, 1.1]) for name in measuring.MEANING]
    made, found = measure(Fake(None), "2026-01-02", stages=stages)
    assert {each.name for each in found} == set(measuring.MEANING) and not made.kept
    noisy = replace(found[0], kept="too noisy: 1 to 9", value=5.0)
    _show_prices([noisy, *found[1:]])
    head, titles, first, second, *rest = capsys.readouterr().out.splitlines()
    assert head == "measured prices" and titles.split() == ["measured", "interval", "class", "used", "unit"]
    assert first.split() == [*"operation 5 0.9 to 1.1 0.05 0.05".split(), *measuring.MEANING["operation"].split()]
    assert second.split()[:7] == "compile 1 0.9 to 1.1 1.2 1".split() and "operation: that of the class" in rest[6]
    assert max(map(len, [titles, first, second, *rest])) <= 120


def _yields(name: str, values: list[float], bench: Bench, prices: Prices) -> Any:
    yield name, np.array(values)


def test_progress_is_told_after_each_scene(egl: Context) -> None:
    bench, shares = Bench(egl, SOFTWARE, clock=lambda draw: 1e4), list[float]()

    def stage(bench: Bench, prices: Prices) -> Any:
        for _ in range(measuring.SCENES):
            bench.times(rm.Scene(rm.sphere()), [prices])
        yield "skip", np.array([1.0])

    measure(bench, "2026-01-02", shares.append, [stage, stage])
    assert np.allclose(shares, [0, 1 / 6, 2 / 6, 3 / 6, 3 / 6, 4 / 6, 5 / 6, 1.0])


def test_a_class_with_prices_goes_to_another_process_as_it_is() -> None:
    device = measured_prices.with_prices(SOFTWARE, measured(look_up=4000.0, lights=3))
    there = of_plain(json.loads(json.dumps(as_plain(device))))
    assert there == device and isinstance(there.prices.lights, int)
    assert assemble(plan(BALLS, device=there)).text() == assemble(plan(BALLS, device=device)).text()


def test_forced_prices_decide() -> None:
    dear = replaced(STANDARD, {"draw": 1.0})
    assert plan(BALLS, size=(64, 36)).marching.cones is False
    one = rm.Scene(rm.torus().twist(0.3))
    assert plan(one, size=(64, 36), device=replace(SOFTWARE, prices=dear)).marching.cones
    assert of_driver("none", "0", SOFTWARE) is SOFTWARE
