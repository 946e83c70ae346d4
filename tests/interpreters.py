"""Run `tests/support/smoke.py` on each interpreter that is found, and with the lowest versions of all dependencies.

`python -m tests.interpreters [--no-lowest]` needs uv, which makes an environment for each. It prints what it finds, and
the exit status is 1 if one of them fails.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
LEAST = (3, 11)
"""The lowest version that pyproject.toml allows."""

EXTRAS = ("mesh", "report", "video", "exr", "tiff", "cluster")
"""The extras that the lowest versions are tried with. `view`, `jupyter` and `reference` need large packages; see
docs/contributing.md for all."""


def found() -> dict[tuple[int, ...], Path]:
    """The interpreters of pyenv and those on PATH, by their version."""
    pyenv = Path(os.environ.get("PYENV_ROOT") or Path.home() / ".pyenv")
    files = sorted(pyenv.glob("versions/*/bin/python3"))
    for folder in os.get_exec_path():
        files += sorted(Path(folder).glob("python3.[0-9]*"))
    by_version: dict[tuple[int, ...], Path] = {}
    for file in files:
        if not file.suffix[1:].rstrip("t").isdigit() and file.name != "python3":
            continue  # python3.12-config
        done = subprocess.run(
            [file, "-c", "import sys; print(*sys.version_info[:3])"], capture_output=True, text=True, check=False
        )
        if done.returncode == 0:
            by_version.setdefault(tuple(map(int, done.stdout.split())), file)
    return dict(sorted(by_version.items()))


def tried(python: Path, folder: Path, *options: str) -> str:
    """Why the smoke tests fail in an environment of their own; empty if they pass."""
    kept = {name: value for name, value in os.environ.items() if name not in ("VIRTUAL_ENV", "PYTHONDONTWRITEBYTECODE")}
    kept |= {"PYTHONPATH": str(ROOT), "RAYMARCH_CACHE": str(folder / "cache")}
    own = folder / "bin" / "python"
    for command in (
        ["uv", "venv", "--quiet", "--no-project", "--python", python, folder],
        ["uv", "pip", "install", "--quiet", "--python", own, "-r", ROOT / "pyproject.toml", *options],
        [own, ROOT / "tests" / "support" / "smoke.py"],
    ):
        done = subprocess.run(
            list(map(str, command)), env=kept, cwd=folder.parent, stdout=subprocess.PIPE, stderr=subprocess.STDOUT
        )
        if done.returncode:
            return done.stdout.decode(errors="replace")[-4000:]
    return ""


def cases(lowest: bool) -> Iterator[tuple[str, Path, tuple[str, ...]]]:
    """What is tried: its name, the interpreter, and options of the installation."""
    for version, file in found().items():
        name = ".".join(map(str, version))
        if version < LEAST:
            print(f"Python {name} ({file}): raymarch needs {'.'.join(map(str, LEAST))}")
        elif version[:2] == sys.version_info[:2]:
            print(f"Python {name} ({file}): all tests run on {'.'.join(map(str, sys.version_info[:3]))}")
        else:
            yield f"Python {name} ({file})", file, ()
    if lowest:
        extras = tuple(option for extra in EXTRAS for option in ("--extra", extra))
        yield "lowest versions", Path(sys.executable), ("--resolution", "lowest-direct", *extras)


def main(words: list[str]) -> int:
    if shutil.which("uv") is None:
        print("there is no uv: neither other interpreters nor the lowest versions are tried")
        return int("CI" in os.environ)
    failed = 0
    with tempfile.TemporaryDirectory() as folder:
        for i, (name, python, options) in enumerate(cases("--no-lowest" not in words)):
            fault = tried(python, Path(folder, str(i)), *options)
            print(f"{name}: {fault or 'the commands work'}", flush=True)
            failed += bool(fault)
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
