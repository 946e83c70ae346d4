"""One renderer of small pictures for all forms."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from raymarch.gpu import Renderer
from raymarch.gpu.context import Context


@pytest.fixture(scope="session")
def renderer(egl: Context) -> Iterator[Renderer]:
    with Renderer((64, 48), context=egl) as made:
        yield made
