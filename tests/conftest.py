"""Fixtures and settings that all tests share."""

from __future__ import annotations

import os
from collections.abc import Generator, Iterator
from typing import Any

import pytest
from hypothesis import HealthCheck, settings

from raymarch.gpu.context import Context
from tests.support.required import opened

# The same examples in every run: a red test must be red again for whoever looks into it.
settings.register_profile(
    "repeatable", derandomize=True, deadline=None, database=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("repeatable")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo[None]) -> Generator[None, Any, Any]:
    """CI installs all that the tests need, so there a skipped test is a failed one, unless it is marked `may_skip`."""
    report = yield
    needed = item.get_closest_marker("may_skip") is None
    if os.environ.get("CI") and needed and report.skipped and not hasattr(report, "wasxfail"):
        report.outcome = "failed"
        report.longrepr = f"skipped although CI is set: {report.longrepr}"
    return report


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Name the nodes whose figures are not recorded; this is no failure."""
    from tests.support.records import unmeasured

    if names := unmeasured():
        terminalreporter.write_line(f"no figures of {', '.join(names)}: run python -m tests.lab.renew")


@pytest.fixture(scope="session")
def egl() -> Iterator[Context]:
    """A context without a screen."""
    with opened("egl") as context:
        yield context


@pytest.fixture(scope="session")
def mitsuba() -> Any:
    module = pytest.importorskip("mitsuba")
    module.set_variant("scalar_rgb")
    return module
