"""The command `raymarch`, run within the test's process."""

from __future__ import annotations

from pathlib import Path

import pytest

from raymarch.cli import main


def run(*args: str) -> int:
    """The exit status of a command."""
    with pytest.raises(SystemExit) as stop:
        main(list(args))
    return int(stop.value.code or 0)


def files(folder: Path) -> set[str]:
    """The names of the files in a folder, without what Python caches."""
    return {p.name for p in folder.iterdir() if p.name != "__pycache__"}
