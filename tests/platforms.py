"""Type checks: in full for this system, and for others what they lack.

`python -m tests.platforms` runs mypy on the package. For Windows, macOS and this system it then checks the modules that
import something of the system, each without what they import of the package. What is wrong on another system alone is
an error.
"""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
SYSTEMS = ("win32", "darwin")

OF_THE_SYSTEM = frozenset(
    """asyncio ctypes errno faulthandler fcntl grp mmap msvcrt multiprocessing os platform pty pwd resource select
    selectors shutil signal socket stat subprocess sys tempfile termios threading time tty winreg""".split()
)
"""Modules of Python that differ between systems."""


def asking() -> list[str]:
    """The files of the package that import a module of the system."""
    found = []
    for file in sorted((ROOT / "raymarch").rglob("*.py")):
        names = set()
        for step in ast.walk(ast.parse(file.read_bytes())):
            if isinstance(step, ast.Import):
                names |= {alias.name.partition(".")[0] for alias in step.names}
            elif isinstance(step, ast.ImportFrom) and not step.level:
                names.add((step.module or "").partition(".")[0])
        if names & OF_THE_SYSTEM:
            found.append(str(file.relative_to(ROOT)))
    return found


def faults(system: str, files: list[str]) -> set[str]:
    """The errors of some files on a system, with all but Python's own modules unknown."""
    lax = ("--follow-imports=skip", "--ignore-missing-imports", "--config-file=", "--python-version=3.11")
    lax += (f"--cache-dir={os.devnull}",)  # the full check keeps its own
    command = (sys.executable, "-m", "mypy", "--platform", system, *lax, "--no-error-summary", *files)
    return set(subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False).stdout.splitlines())


def main() -> int:
    status = subprocess.run((sys.executable, "-m", "mypy"), cwd=ROOT, check=False).returncode
    files = asking()
    here = faults(sys.platform, files)
    for system in SYSTEMS:
        for fault in sorted(faults(system, files) - here):
            print(f"{system}: {fault}")
            status = 1
    return status


if __name__ == "__main__":
    sys.exit(main())
