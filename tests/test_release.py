"""The release: a wheel and an sdist with all files, which work in a new environment and an empty folder."""

from __future__ import annotations

import fnmatch
import os
import shutil
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from importlib.util import cache_from_source
from pathlib import Path

import raymarch as rm

ROOT = Path(rm.__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())


def package_files() -> set[str]:
    """All files of the package, relative to the repository."""
    cached = Path(cache_from_source("x.py")).parent.name
    found = (ROOT / "raymarch").rglob("*")
    return {str(f.relative_to(ROOT)) for f in found if f.is_file() and cached not in f.parts}


def test_the_version_stands_once() -> None:
    assert PROJECT["project"]["dynamic"] == ["version"] and "version" not in PROJECT["project"]
    assert PROJECT["tool"]["setuptools"]["dynamic"]["version"] == {"attr": "raymarch.__version__"}
    literal = f'"{rm.__version__}"'
    holders = [f for f in sorted(package_files()) if f.endswith(".py") and literal in (ROOT / f).read_text()]
    assert holders == ["raymarch/__init__.py"]


def test_the_metadata_are_true() -> None:
    project = PROJECT["project"]
    assert "MIT License" in (ROOT / "LICENSE").read_text() and project["license"] == "MIT"
    assert project["license-files"] == ["LICENSE"] and (ROOT / project["readme"]).is_file()
    assert "urls" not in project  # the project has no site of its own


def test_all_data_files_are_package_data() -> None:
    patterns = PROJECT["tool"]["setuptools"]["package-data"]["raymarch"]
    for file in package_files():
        inside = file.removeprefix("raymarch/")
        if not inside.endswith(".py"):
            assert any(fnmatch.fnmatch(inside, pattern.replace("**/", "*")) for pattern in patterns), inside


def run(*command: str | Path, folder: Path) -> str:
    """What a command prints, in a folder and without this repository on the path of Python."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "PIP_", "VIRTUAL_ENV"))}
    kept |= {name: value for name, value in os.environ.items() if name.startswith("PIP_")}
    done = subprocess.run(list(map(str, command)), cwd=folder, env=kept, capture_output=True, text=True)
    assert done.returncode == 0, f"{command}: {done.stdout}{done.stderr}"
    return done.stdout


def test_a_release_works_in_a_new_environment(tmp_path: Path) -> None:
    """Builds the sdist, the wheel from it, and installs that with its dependencies: needs the network."""
    source, built = tmp_path / "source", tmp_path / "built"
    left_out = shutil.ignore_patterns(".git", "__pycache__", "*.egg-info", "build", ".venv", ".*_cache")
    shutil.copytree(ROOT, source, ignore=left_out)
    built.mkdir()
    run(sys.executable, "-m", "venv", tmp_path / "builder", folder=tmp_path)
    builder = tmp_path / "builder" / "bin" / "python"
    run(builder, "-m", "pip", "install", "-q", *PROJECT["build-system"]["requires"], folder=tmp_path)
    code = f"import setuptools.build_meta as b; print(b.build_sdist({str(built)!r}))"
    run(builder, "-c", code, folder=source)
    (archive,) = built.glob("*.tar.gz")
    run(builder, "-m", "pip", "wheel", "-q", "--no-deps", "-w", built, archive, folder=tmp_path)
    (wheel,) = built.glob("*.whl")
    assert wheel.name == f"raymarch-{rm.__version__}-py3-none-any.whl"
    with zipfile.ZipFile(wheel) as opened:
        names = set(opened.namelist())
        metadata = opened.read(f"raymarch-{rm.__version__}.dist-info/METADATA").decode()
    assert {name for name in names if not name.startswith(f"raymarch-{rm.__version__}.dist-info/")} == package_files()
    assert f"raymarch-{rm.__version__}.dist-info/licenses/LICENSE" in names
    assert "License-Expression: MIT" in metadata and "Project-URL" not in metadata
    with tarfile.open(archive) as opened_archive:
        held = {name.partition("/")[2] for name in opened_archive.getnames()}
    assert {"LICENSE", "README.md", "pyproject.toml", *package_files()} <= held

    run(sys.executable, "-m", "venv", tmp_path / "user", folder=tmp_path)
    tools, empty = tmp_path / "user" / "bin", tmp_path / "empty"
    run(tools / "python", "-m", "pip", "install", "-q", wheel, folder=tmp_path)
    empty.mkdir()
    shutil.copy(ROOT / "examples" / "hello.py", empty)
    assert rm.__version__ in run(tools / "raymarch", "--version", folder=empty)
    run(tools / "raymarch", "render", "hello.py", "-o", "hello.png", "--size", "64x48", folder=empty)
    run(tools / "raymarch", "export", "hello.py", "-o", "hello.html", folder=empty)
    assert "--write-baseline" in run(tools / "raymarch", "cost", "--help", folder=empty)
    made = {f.name: f.stat().st_size for f in empty.iterdir() if f.is_file()}
    assert set(made) == {"hello.py", "hello.png", "hello.html"} and made["hello.html"] > 20_000
