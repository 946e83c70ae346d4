"""Truths of these tests are kept in a folder of their own."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

import raymarch as rm
from raymarch.cache import VARIABLE
from raymarch.cost.reference import Reference, reference
from tests.cost.cost_samples import SIZE, make_scene


@pytest.fixture(scope="session")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Shared by the processes of a run: what one has computed, the others read."""
    base = tmp_path_factory.getbasetemp()
    folder = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "truths"
    folder.mkdir(exist_ok=True)
    return folder


@pytest.fixture(autouse=True)
def _own_cache(kept: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, str(kept))


@pytest.fixture(scope="session")
def scene() -> rm.Scene:
    return make_scene()


@pytest.fixture
def known(scene: rm.Scene) -> Reference:
    return reference(scene, SIZE, samples=4)
