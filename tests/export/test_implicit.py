"""Exports of implicit surfaces."""

from __future__ import annotations

from pathlib import Path

import pytest

import raymarch as rm
from tests.support.surfaces import SURFACES


@pytest.mark.parametrize("form", ["glsl", "wgsl", "html", "shadertoy.glsl"])
@pytest.mark.parametrize("name", ["klein", "roman", "lidinoid"])
def test_an_implicit_surface_is_exported(name: str, form: str, tmp_path: Path) -> None:
    """The text has the function of the free way, but WGSL, which also gives the stretch its first value."""
    file = tmp_path / f"made.{form}"
    rm.export(rm.Scene(SURFACES[name].node()), file)
    text = file.read_text()
    assert "expression_free" in text
    assert "stretch_ahead" in text
