"""A renderer of small pictures: the shader's text must be one that a driver takes."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from raymarch.gpu import Renderer
from raymarch.gpu.context import Context


@pytest.fixture(scope="session")
def renderer(egl: Context) -> Iterator[Renderer]:
    with Renderer((32, 32), "egl") as made:
        yield made
