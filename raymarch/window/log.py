"""A log of the window's events as lines of JSON, for scripts."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, TextIO

from raymarch.errors import SceneError


class Log:
    """Writes one line per event and flushes it; without a file it writes nothing."""

    def __init__(self, file: Path | None) -> None:
        self._out: TextIO | None = None
        if file is not None:
            try:
                self._out = file.open("w", encoding="utf-8", buffering=1)
            except OSError as fault:
                raise SceneError(f"cannot write '{file}': {fault.strerror}", legal="a writable file") from None

    def say(self, event: str, **facts: Any) -> None:
        if self._out is not None:
            self._out.write(json.dumps({"event": event, **facts}, default=str) + "\n")

    def close(self) -> None:
        if self._out is not None:
            self._out.close()
