"""What happens in the window as lines of JSON, for scripts."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, TextIO

from raymarch.errors import SceneError


class Log:
    """Writes one line for each event, at once; without a file it writes nothing."""

    def __init__(self, file: Path | None) -> None:
        self._out: TextIO | None = None
        if file is not None:
            try:
                self._out = file.open("w", encoding="utf-8", buffering=1)
            except OSError as fault:
                raise SceneError(
                    f"cannot write '{file}': {fault.strerror}", legal="a file that can be written"
                ) from None

    def say(self, event: str, **facts: Any) -> None:
        if self._out is not None:
            self._out.write(json.dumps({"event": event, **facts}, default=str) + "\n")

    def close(self) -> None:
        if self._out is not None:
            self._out.close()
