"""A progress bar on the error stream."""

from __future__ import annotations

import time as clock_time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager

from raymarch.cli.common import errors


@contextmanager
def bar(what: str, total: float) -> Iterator[Callable[[float], None]]:
    """A progress bar on the error stream, if that is a terminal; it appears after one second of work."""
    start = clock_time.perf_counter()
    with ExitStack() as stack:
        update: Callable[[float], None] | None = None

        def report(done: float) -> None:
            nonlocal update
            slow = clock_time.perf_counter() - start > 1.0 and done < total
            if update is None and slow and errors.is_interactive:
                update = stack.enter_context(_shown(what, total))
            if update is not None:
                update(done)

        yield report


@contextmanager
def _shown(what: str, total: float) -> Iterator[Callable[[float], None]]:
    from rich.progress import Progress, TextColumn  # takes time, and most work ends before it is needed

    columns = (*Progress.get_default_columns()[:-1], TextColumn("{task.elapsed:.0f} s"))
    with Progress(*columns, console=errors, transient=True) as shown:
        task = shown.add_task(what, total=total)
        yield lambda done: shown.update(task, completed=done)
