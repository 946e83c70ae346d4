"""One renderer for all tests of pictures; it is resized, which is cheaper than another context."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from raymarch.gpu import Renderer
from raymarch.gpu.context import Context


@pytest.fixture(scope="session")
def session_renderer(egl: Context) -> Iterator[Renderer]:
    with Renderer((160, 120), "egl") as made:
        yield made


@pytest.fixture
def renderer(session_renderer: Renderer) -> Renderer:
    """At 160 x 120, whatever the test before did."""
    if session_renderer.size != (160, 120):
        session_renderer.resize((160, 120))
    return session_renderer
