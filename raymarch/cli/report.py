"""What `raymarch render --json` prints: one JSON document on the output, and nothing else there."""

from __future__ import annotations

import json
import math
import time as clock_time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import typer

from raymarch.cli.common import output_to_errors
from raymarch.errors import RaymarchError
from raymarch.export.sequence import Item, Picture
from raymarch.gpu.renderer import Renderer


@dataclass
class Report:
    """What a command has done.

    asked : whether it is printed; nothing is measured for it otherwise. driver : of the renderer that drew.
    files : those that were written. folders : those that were made. pictures : each with its file and what is known.
    """

    asked: bool
    driver: dict[str, str] = field(default_factory=dict)
    files: list[Path] = field(default_factory=list)
    folders: Sequence[Path] = ()
    pictures: list[tuple[Path, dict[str, Any]]] = field(default_factory=list)

    def drawn(self, item: Item, made: Picture | None, seconds: float) -> None:
        """Add a picture; made is None for a file that held it already."""
        found: dict[str, Any] = {
            "name": item.name,
            "time": item.time,
            "size": list(item.size),
            "drawn": made is not None,
        }
        if made is not None:
            counts = made.evaluations
            found |= {
                "milliseconds": made.milliseconds,
                "seconds": seconds,
                "evaluations": None if counts is None else {"mean": float(counts.mean()), "max": float(counts.max())},
                "doubts": [str(doubt) for doubt in made.doubts],
                "lines": list(made.view.lines),
            }
        self.pictures.append((item.file, found))

    def by(self, renderer: Renderer) -> None:
        """Name the renderer that draws."""
        driver = renderer.context.driver
        self.driver = {"backend": renderer.context.backend, "driver": driver.renderer, "clock": renderer.clock.kind}

    def text(self, seconds: float, fault: str) -> str:
        """The document. fault : why the command failed, or ""."""
        pictures = [({"file": str(file)} if file.is_file() else {}) | found for file, found in self.pictures]
        doubts = dict.fromkeys(doubt for picture in pictures for doubt in picture.get("doubts", ()))
        found = {
            "files": [{"file": str(file), "bytes": file.stat().st_size} for file in self.files if file.is_file()],
            "folders": [str(folder) for folder in self.folders if folder.is_dir()],
            "pictures": pictures,
            "doubts": list(doubts),
            **self.driver,
            "seconds": seconds,
            **({"error": fault} if fault else {}),
        }
        return json.dumps(_finite(found), indent=2, allow_nan=False)


def _finite(value: Any) -> Any:
    """The value with null in place of numbers that JSON does not have."""
    if isinstance(value, dict):
        return {name: _finite(each) for name, each in value.items()}
    if isinstance(value, list):
        return [_finite(each) for each in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


@contextmanager
def reported(asked: bool) -> Iterator[Report]:
    """A block whose report is printed at its end, also if it fails. What others print goes to the error stream."""
    report, start, fault = Report(asked), clock_time.perf_counter(), ""
    if not asked:
        yield report
        return
    try:
        with output_to_errors():
            yield report
    except BaseException as failed:
        fault = str(failed) if isinstance(failed, RaymarchError) else f"interrupted by {type(failed).__name__}"
        raise
    finally:
        typer.echo(report.text(clock_time.perf_counter() - start, fault))
