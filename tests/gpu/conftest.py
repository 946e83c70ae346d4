"""Real contexts for the tests. A backend that does not open fails the run under CI and skips elsewhere."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

import raymarch.errors
from raymarch.gpu.context import Context
from tests.support.required import opened, skip_or_fail
from tests.support.window_driver import serve_display

ROOT = Path(raymarch.errors.__file__).parents[1]


@pytest.fixture(autouse=True)
def no_gl_errors(request: pytest.FixtureRequest) -> Iterator[None]:
    """OpenGL keeps an error until somebody asks, so each test asks at its end."""
    names = {"egl", "osmesa", "context"} & set(request.fixturenames)
    contexts: list[Context] = [request.getfixturevalue(name) for name in sorted(names)]
    yield
    for context in contexts:
        with context.bound():
            assert context.gl.error == "GL_NO_ERROR"


@pytest.fixture(scope="session")
def osmesa() -> Iterator[Context]:
    with opened("osmesa") as context:
        yield context


@pytest.fixture(params=["egl", "osmesa"])
def context(request: pytest.FixtureRequest) -> Context:
    """Each of the contexts without a screen; the other one lives on in the same process."""
    found: Context = request.getfixturevalue(request.param)
    return found


@pytest.fixture(scope="session")
def display() -> Iterator[str]:
    """The name of a real X display, served by Xvfb for as long as the tests run."""
    try:
        with serve_display("64x64x24") as name:
            yield name
    except OSError as fault:
        skip_or_fail(str(fault))


@pytest.fixture
def interpreter() -> Callable[[str, str | None], str]:
    """Runs Python code in a process of its own, with the display or without any, and returns what it prints.

    glfw serves one platform in a process, and the test process has OSMesa on it.
    """

    def run(code: str, display: str | None) -> str:
        environment = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY")}
        environment["PYTHONPATH"] = str(ROOT)
        if display:
            environment["DISPLAY"] = display
        done = subprocess.run(
            [sys.executable, "-W", "error", "-c", code], env=environment, capture_output=True, text=True, timeout=180
        )
        assert done.returncode == 0, done.stderr
        return done.stdout.strip()

    return run
