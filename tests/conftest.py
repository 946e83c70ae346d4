"""Fixtures and settings that all tests share."""

from __future__ import annotations

import gc
import os
import re
import signal
from collections.abc import Generator, Iterator
from fnmatch import fnmatchcase, translate
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, settings
from hypothesis.internal.conjecture import providers

from raymarch.gpu.context import Context
from tests.support.required import opened

# The same examples in every run: a red test must be red again for whoever looks into it.
settings.register_profile(
    "repeatable", derandomize=True, deadline=None, database=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("repeatable")
# Hypothesis also draws numbers that it reads in all modules imported so far: two seconds, and other examples for a test
# that runs alone.
providers.is_local_module_file = lambda file: False


gc.disable()  # until all tests are collected

# A shell lets what it starts with `&` ignore SIGINT, and nohup SIGHUP. Commands that tests start would ignore them too.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
if hasattr(signal, "SIGHUP") and signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
    signal.signal(signal.SIGHUP, signal.SIG_DFL)

os.environ["RAYMARCH_MEASURED"] = "off"  # prices that someone has measured here change evaluations

LONG = Path(__file__).parent / "long.txt"


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--all", action="store_true", help="also run the long tests; -m long: these alone")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark the tests of long.txt, and leave long ones out, but for those that the command line names by their id.

    Those of the cluster come last: the audit hook by which it notes the files that a scene reads stays for good, and
    makes the expressions of all later tests slower.
    """
    items.sort(key=lambda item: item.path.parent.name == "cluster")
    lines = LONG.read_text(encoding="utf-8").splitlines()
    patterns = [line for line in lines if line and not line.startswith("#")]
    whole = not config.args or config.args == config.getini("testpaths")
    any_pattern = re.compile("|".join(translate(pattern) for pattern in patterns))
    found: set[str] = set()
    for item in items:
        if any_pattern.match(item.nodeid):
            item.add_marker("long")
            found.update(pattern for pattern in patterns if fnmatchcase(item.nodeid, pattern))
    unknown = [pattern for pattern in patterns if whole and pattern not in found]
    if unknown:
        raise pytest.UsageError(f"{LONG.name}: no test is called {', '.join(unknown)}")
    if config.getoption("--all"):
        return

    def is_left_out(item: pytest.Item) -> bool:
        named = any("::" in argument and item.nodeid.startswith(argument) for argument in config.args)
        return item.get_closest_marker("long") is not None and not named

    left_out = {item for item in items if is_left_out(item)}
    config.hook.pytest_deselected(items=list(left_out))
    items[:] = [item for item in items if item not in left_out]


def pytest_collection_finish() -> None:
    """Modules and tests stay until the end: the garbage collector need not look at them each time that a test asks.

    It is off while they are loaded, and then looks after 50,000 new objects in place of 700.
    """
    gc.freeze()
    gc.set_threshold(50_000, 20, 20)
    gc.enable()


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
