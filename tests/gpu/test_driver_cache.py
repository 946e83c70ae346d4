"""The driver's disk cache: with it off, a first frame is as long in the second run as in the first."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

import raymarch as rm
from raymarch.gpu.driver_cache import SWITCHES, without_driver_cache

DRAWN = """
import sys
import raymarch as rm
from raymarch.gpu import driver_cache
from contextlib import nullcontext
with driver_cache.without_driver_cache() if sys.argv[1] == "off" else nullcontext():
    with rm.Renderer((32, 18)) as renderer:
        renderer.render(rm.torus())
        print(driver_cache.is_off(), renderer.context.driver.renderer)
"""


def drawn(how: str, folder: Path) -> tuple[str, list[Path]]:
    """What a new process says that draws with the cache in a folder, and what is there then."""
    given = {n: v for n, v in os.environ.items() if n not in SWITCHES}
    given |= {"MESA_SHADER_CACHE_DIR": str(folder), "MESA_GLSL_CACHE_DIR": str(folder)}
    done = subprocess.run([sys.executable, "-c", DRAWN, how], env=given, capture_output=True, text=True, check=True)
    return done.stdout, [file for file in folder.rglob("*") if file.is_file()]


def test_nothing_is_written_and_the_frame_says_so(tmp_path: Path) -> None:
    said, files = drawn("on", tmp_path / "on")
    if "llvmpipe" not in said:
        pytest.skip("a driver of another kind")
    assert said.startswith("False") and files, "with the cache, there are files"
    said, files = drawn("off", tmp_path / "off")
    assert said.startswith("True") and files == []


def test_the_environment_is_as_before() -> None:
    before = dict(os.environ)
    with without_driver_cache():
        assert all(os.environ[name] == value for name, value in SWITCHES.items())
        with rm.Renderer((8, 8)) as renderer:
            renderer.render(rm.sphere())
    assert dict(os.environ) == before
