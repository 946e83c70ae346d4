"""Work that follows the drawing in other threads: files are encoded while the next picture is drawn."""

from __future__ import annotations

import queue
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from itertools import chain
from pathlib import Path
from typing import Any, Protocol

from PIL import Image

from raymarch.errors import RaymarchError, SceneError
from raymarch.export.film import write_film
from raymarch.files import written

AHEAD = 2
"""Most pictures that wait in memory."""


class Later(Protocol):
    """Runs a job later. before : what may run at any time before the job, in any thread; the job repeats it if it
    fails."""

    def __call__(self, job: Callable[[], None], before: Callable[[], object] | None = None) -> None: ...


@contextmanager
def in_order() -> Iterator[Later]:
    """Yields a function that runs jobs in a thread, one after another in their order; what precedes them runs in two
    threads.

    It waits while `AHEAD` jobs are unfinished. The first error of a job ends the jobs after it, and is raised by the
    next call or at the end of the block. The block ends when all jobs have ended.
    """
    jobs: deque[Future[None]] = deque()
    failed = False

    def work(job: Callable[[], None], begun: Future[object] | None) -> None:
        nonlocal failed
        if failed:
            return
        try:
            if begun is not None:
                begun.exception()  # waits: what fails there fails again in the job, which knows its file
            job()
        except BaseException:
            failed = True
            raise

    def run(job: Callable[[], None], before: Callable[[], object] | None = None) -> None:
        while len(jobs) >= AHEAD:
            jobs.popleft().result()
        jobs.append(threads.submit(work, job, None if before is None else encoders.submit(before)))

    with ThreadPoolExecutor(1, "raymarch writer") as threads, ThreadPoolExecutor(2, "raymarch encoder") as encoders:
        yield run
        while jobs:
            jobs.popleft().result()


class _Stopped(Exception):
    """The film is not wanted any more."""


@contextmanager
def film(
    target: Path, folder: Path, fps: float, error: type[RaymarchError] = SceneError
) -> Iterator[Callable[[Any], None]]:
    """Write a film in a thread. Yields a function that adds a picture, as an image or as the path of its file.

    The film is complete at the end of the block. Until then it is in the folder of its pictures. If the block raises,
    no film is left.
    """
    arriving: queue.Queue[Any] = queue.Queue(AHEAD)

    def pictures() -> Iterator[Image.Image]:
        while True:
            picture = arriving.get()
            if picture is None:
                return
            if picture is _Stopped:
                raise _Stopped
            yield Image.open(picture) if isinstance(picture, Path) else picture

    def write() -> None:
        found = pictures()
        first = next(found)  # without a picture there is no folder
        with written(target, error, folder) as unfinished:
            write_film(unfinished, target.suffix.lower(), chain([first], found), fps)

    def put(entry: Any) -> None:
        while not writing.done():  # the thread ends early if it cannot write
            with suppress(queue.Full):
                arriving.put(entry, timeout=0.1)
                break

    def add(picture: Any) -> None:
        put(picture)
        if writing.done():
            writing.result()  # raises its error

    with ThreadPoolExecutor(1, "raymarch film") as threads:
        writing = threads.submit(write)
        try:
            yield add
            put(None)
        except BaseException:
            put(_Stopped)
            raise
        writing.result()
