"""Python's recursion limit, lowered: code that recurses fails on a graph of some hundred nodes."""

from __future__ import annotations

import inspect
import sys
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def few_calls(count: int = 120) -> Iterator[None]:
    """At most so many calls within each other, for the block."""
    before = sys.getrecursionlimit()
    sys.setrecursionlimit(len(inspect.stack(0)) + count)
    try:
        yield
    finally:
        sys.setrecursionlimit(before)
