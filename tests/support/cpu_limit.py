"""A limit on the CPU time of a part of a long run."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any


class LateError(Exception):
    """The limit was reached."""


def _late(*_args: Any) -> None:
    raise LateError


@contextmanager
def cpu_limit(seconds: float) -> Iterator[None]:
    """Raise `LateError` after so many CPU seconds of this process. Only in the main thread, and not within another."""
    earlier = signal.signal(signal.SIGPROF, _late)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, earlier)
