"""Fixtures of the window's tests: a display, and windows on it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.support.required import skip_or_fail
from tests.support.window_driver import Session, serve_display


@pytest.fixture(scope="session")
def display() -> Iterator[str]:
    """The name of an X display with a screen of 1000 x 700 pixels."""
    try:
        with serve_display() as name:
            yield name
    except OSError as fault:
        skip_or_fail(str(fault))


@pytest.fixture
def view(display: str, tmp_path: Path) -> Iterator[Callable[..., Session]]:
    """Opens windows on scenes given as text; they are closed at the end whatever happens."""
    opened: list[Session] = []

    def start(
        text: str, *options: str, name: str = "scene.py", moving: bool = False, path: Path | None = None
    ) -> Session:
        scene = tmp_path / name
        scene.write_text(text)
        session = Session(display, tmp_path, scene, *options, moving=moving, path=path)
        opened.append(session)
        return session

    yield start
    for session in opened:
        session.kill()
