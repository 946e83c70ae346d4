"""Progress on the error stream: a bar that vanishes at the end, or lines where the stream is no terminal."""

from __future__ import annotations

import time as clock_time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import Any

from raymarch.cli.common import errors
from raymarch.gpu.progress import time_left

LEFT = "{task.fields[left]}"

QUIET = 10.0
"""Seconds between two lines of progress in a log."""


def logged() -> Callable[[str, float], None]:
    """A function that prints a step and the share that is done, but at most one line every `QUIET` seconds.

    Work whose share falls has several rounds, of a number that is not known: then no time left is estimated.
    """
    start = last = clock_time.perf_counter()
    reached, rounds = 0.0, 1

    def tell(what: str, share: float) -> None:
        nonlocal last, reached, rounds
        rounds, reached = rounds + (share < reached), share
        if clock_time.perf_counter() - last >= QUIET:
            last = clock_time.perf_counter()
            left = time_left(last - start, share) if rounds == 1 else ""
            words = f"{100 * share:3.0f} %  {what}{left and ', '}{left}"
            errors.print(words, markup=False, highlight=False)

    return tell


@contextmanager
def _shown(total: float, *columns: str, since: float = 0.0, **fields: Any) -> Iterator[Callable[..., None]]:
    """A bar with columns of `rich.progress` by name, or their text; yields what updates it. since : seconds that the
    work has taken before."""
    from rich import progress  # takes time, and most work ends before it is needed

    made = (getattr(progress, name)() if name.isalpha() else progress.TextColumn(name) for name in columns)
    with progress.Progress(*made, console=errors, transient=True) as bar:
        task = bar.add_task(fields.pop("description", ""), total=total, **fields)
        bar.tasks[-1].start_time = bar.get_time() - since
        yield lambda **changes: bar.update(task, **changes)


@contextmanager
def bar(what: str, total: float) -> Iterator[Callable[[float], None]]:
    """A progress bar that appears after one second of work, or `logged` where the error stream is no terminal."""
    start, log = clock_time.perf_counter(), logged()
    with ExitStack() as stack:
        update: Callable[..., None] | None = None

        def report(done: float) -> None:
            nonlocal update
            spent = clock_time.perf_counter() - start
            if update is None and spent > 1.0 and done < total and errors.is_interactive:
                columns = ("{task.description}", "BarColumn", "{task.percentage:>3.0f}%", "{task.elapsed:.0f} s", LEFT)
                update = stack.enter_context(_shown(total, *columns, since=spent, description=what, left=""))
            if update is not None:
                update(completed=done, left=time_left(spent, done / total))
            elif not errors.is_interactive:
                log(what, done / total)

        yield report


@contextmanager
def watched() -> Iterator[Callable[[str, float], None]]:
    """A progress bar with a description of the current step, or `logged` where the error stream is no terminal."""
    if not errors.is_interactive:
        yield logged()
        return
    columns = ("BarColumn", "{task.percentage:>3.0f} %", "TimeElapsedColumn", "{task.fields[what]}")
    with _shown(1.0, *columns, what="") as update:
        yield lambda what, share: update(completed=share, what=what)


@contextmanager
def counted(total: int, what: str) -> Iterator[Callable[[int], None]]:
    """A progress bar with counts, workers and the time left, if the error stream is a terminal."""
    if not errors.is_interactive:
        yield lambda workers: None
        return
    columns = ("BarColumn", "MofNCompleteColumn", "{task.description}", "TimeRemainingColumn")
    with _shown(total, *columns, description=what) as update:
        yield lambda workers: update(advance=1, description=f"{what}, {workers} workers")
