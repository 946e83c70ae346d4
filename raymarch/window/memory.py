"""What the window remembers from one session to the next: the width of the panel and its open sections."""

from __future__ import annotations

import json
import os
from contextlib import suppress
from pathlib import Path
from typing import Any


def place() -> Path:
    """The file of the user's settings."""
    return Path(os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config") / "raymarch" / "window.json"


def recall() -> tuple[bool, dict[str, bool]]:
    """Whether the panel is narrow, and the sections that are open; nothing if that cannot be read."""
    try:
        found: Any = json.loads(place().read_text(encoding="utf-8"))
        opened = {name: value for name, value in found["opened"].items() if isinstance(value, bool)}
        return found["narrow"] is True, opened
    except (OSError, ValueError, RecursionError, KeyError, TypeError, AttributeError):
        return False, {}


def remember(narrow: bool, opened: dict[str, bool]) -> None:
    """Remember it for the next session, if the folder can be written."""
    file = place()
    with suppress(OSError):
        file.parent.mkdir(parents=True, exist_ok=True)
        fresh = file.with_suffix(f".{os.getpid()}")
        fresh.write_text(json.dumps({"narrow": narrow, "opened": opened}), encoding="utf-8")
        fresh.replace(file)
