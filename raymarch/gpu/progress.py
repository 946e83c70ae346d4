"""How long a picture still takes: an estimate from the work that is done, in terminals and notebooks."""

from __future__ import annotations

import sys
import time as clock_time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from raymarch.scene.scene import in_notebook

LEAST = 2.0
"""Seconds of work after which the time left is estimated."""

OFTEN = 0.5
"""Seconds between two texts."""


def time_left(elapsed: float, share: float) -> str:
    """The time left as text, if the rest takes as long for its share as what is done; "" if too little is done."""
    if elapsed < LEAST or not 0.0 < share < 1.0:
        return ""
    seconds = round(elapsed * (1.0 - share) / share)
    minutes, hours = seconds // 60, seconds // 3600
    if hours:
        return f"{hours} h {minutes % 60:02d} min left"
    return f"{minutes} min {seconds % 60:02d} s left" if minutes else f"{seconds} s left"


@contextmanager
def told() -> Iterator[Callable[[float], None] | None]:
    """A function that shows the share of a picture that is done and the time left, on one line of the error stream
    that vanishes at the end; None where nobody looks: neither a terminal nor a notebook."""
    stream = sys.stderr
    if not in_notebook() and not (stream is not None and stream.isatty()):
        yield None
        return
    start, last, width = clock_time.perf_counter(), 0.0, 0

    def show(share: float) -> None:
        nonlocal last, width
        now = clock_time.perf_counter() - start
        if now - last >= OFTEN and (left := time_left(now, share)):
            last = now
            text = f"{100 * share:3.0f} %, {left}"
            stream.write("\r" + text.ljust(width))
            stream.flush()
            width = max(width, len(text))

    try:
        yield show
    finally:
        if width:
            stream.write("\r" + " " * width + "\r")
            stream.flush()
