"""The command `raymarch`, run within the test's process."""

from __future__ import annotations

import math
from pathlib import Path
from unittest.mock import patch

import pytest

from raymarch.cli import main, progress


def run(*args: str) -> int:
    """The exit status of a command. It logs no progress, however slow the machine is."""
    with patch.object(progress, "QUIET", math.inf), pytest.raises(SystemExit) as stop:
        main(list(args))
    return int(stop.value.code or 0)


def files(folder: Path) -> set[str]:
    """The names of the files in a folder, without what Python caches."""
    return {p.name for p in folder.iterdir() if p.name != "__pycache__"}
