"""The doctor reports what works, what does not, and the cure."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from raymarch.errors import DeviceError
from raymarch.gpu import current
from raymarch.gpu.context import Context, open_context
from raymarch.gpu.doctor import LoopLimit, Report, count_loop, examine


def test_the_backends_of_this_machine(egl: Context, osmesa: Context) -> None:
    reports = examine(("egl", "osmesa"))
    assert [report.backend for report in reports] == ["egl", "osmesa"]
    for report in reports:
        assert report.works and report.error is None and report.cure is None
        assert report.driver is not None and report.limits is not None
        assert report.loops is not None and report.clock is not None
        assert report.clock.verdict.startswith(report.clock.kind)
        assert report.draws is not None and report.draws.startswith(("fragment shaders: ", "compute shaders: "))
        if "llvmpipe" in report.driver.renderer:
            assert report.loops.words == "loops end silently after 65,535 iterations"
            assert report.clock.kind == "wall clock"


def test_a_report_is_plain_json(egl: Context) -> None:
    for report in (*examine(["egl"]), Report("window", works=False, error="no display", cure="xvfb")):
        plain = report.to_dict()
        assert json.loads(json.dumps(plain)) == plain
        assert plain["backend"] == report.backend and (plain["loops"] is None or plain["loops"]["words"])


def test_a_missing_library_is_a_report_with_a_cure(monkeypatch: Any) -> None:
    monkeypatch.setenv("GLCONTEXT_LINUX_LIBEGL", "/nowhere/libEGL.so")
    (report,) = examine(["egl"])
    assert not report.works and report.driver is None
    assert report.error == "/nowhere/libEGL.so not loaded" and "libegl1" in str(report.cure)


@pytest.mark.parametrize(
    ("code", "error"),
    [
        ("os.kill(os.getpid(), signal.SIGSEGV)", "the driver crashed (SIGSEGV)"),
        ("print('zink: no device', file=sys.stderr); os._exit(3)", "the driver crashed (exit code 3): zink: no device"),
    ],
)
def test_a_driver_that_crashes_is_a_line_of_the_report(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, code: str, error: str
) -> None:
    """The process of each backend finds another module in place of the one that opens contexts."""
    folder = tmp_path / "raymarch" / "gpu"
    folder.mkdir(parents=True)
    for made in (folder.parent, folder):
        (made / "__init__.py").write_text("")
    (folder / "doctor.py").write_text(f"import os, signal, sys\ndef _write(backend, file):\n    {code}\n")
    monkeypatch.syspath_prepend(tmp_path)
    for report in examine(["osmesa", "window"]):
        assert not report.works and report.error == error and report.cure


def test_an_unknown_backend_is_refused() -> None:
    with pytest.raises(DeviceError, match=r"'metal'.*egl, osmesa, window"):
        examine(("egl", "metal"))


@pytest.mark.parametrize("iterations", [1, 1000, 65_000])
def test_a_loop_below_every_limit_is_counted_to_its_end(context: Context, iterations: int) -> None:
    limit = count_loop(context, iterations)
    assert limit == LoopLimit(iterations, iterations) and not limit.is_limited
    assert limit.words == f"no loop limit up to {iterations:,}"


def test_examining_leaves_no_context_behind(egl: Context) -> None:
    before = current.current()
    with egl.bound():
        bound = current.current()
        examine(("egl",))
        assert current.current() == bound
    assert current.current() == before
    with open_context("egl") as context, context.bound():
        assert context.gl.error == "GL_NO_ERROR"


def test_a_machine_with_a_display(
    interpreter: Callable[[str, str | None], str], display: str, egl: Context, osmesa: Context
) -> None:
    code = "from raymarch.gpu.doctor import examine; print([report.works for report in examine()])"
    assert interpreter(code, display) == "[True, True, True]"
    assert interpreter(code, None) == "[True, True, False]"
