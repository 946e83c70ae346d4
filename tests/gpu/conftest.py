"""Real contexts for the tests. A backend that does not open fails the run under CI and skips elsewhere."""

from __future__ import annotations

import os
import select
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

import raymarch.errors
from raymarch.errors import DeviceError
from raymarch.gpu.context import Context, open_context

ROOT = Path(raymarch.errors.__file__).parents[1]


def skip_or_fail(reason: str) -> None:
    """CI installs all that is needed, so there a missing piece is a fault; a user's machine may lack it."""
    if os.environ.get("CI"):
        pytest.fail(reason)
    pytest.skip(reason)


def opened(backend: str) -> Context:
    try:
        return open_context(backend)
    except DeviceError as error:
        skip_or_fail(str(error))
        raise


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
def egl() -> Iterator[Context]:
    with opened("egl") as context:
        yield context


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
    if shutil.which("Xvfb") is None:
        skip_or_fail("Xvfb is not installed: install the package xvfb")
    read_end, write_end = os.pipe()
    command = ["Xvfb", "-displayfd", str(write_end), "-screen", "0", "64x64x24", "-nolisten", "tcp"]
    server = subprocess.Popen(command, pass_fds=(write_end,), stderr=subprocess.DEVNULL)
    os.close(write_end)
    try:
        ready, _, _ = select.select([read_end], [], [], 20)
        number = os.read(read_end, 16).decode().strip() if ready else ""
        if not number:
            skip_or_fail("Xvfb did not start")
        yield f":{number}"
    finally:
        os.close(read_end)
        server.terminate()
        server.wait()


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
            [sys.executable, "-W", "error", "-c", code], env=environment, capture_output=True, text=True, timeout=60
        )
        assert done.returncode == 0, done.stderr
        return done.stdout.strip()

    return run
