"""Hand out tasks to the workers of a cluster, a few for each worker at a time, and collect what they return.

Dask does the rest: it sends the scene to each worker once, assigns tasks again when a worker is lost, and tries a task
again after a fault of the device.
"""

from __future__ import annotations

import time as clock_time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pkgutil import resolve_name
from typing import Any, Generic, TypeVar

from raymarch.cluster.machines import Machine, accepted
from raymarch.cluster.source import Source
from raymarch.cluster.worker import Job, describe
from raymarch.errors import ClusterError
from raymarch.export.stills import Shot
from raymarch.scene.quality import Quality

U = TypeVar("U")

UNREADABLE = "deserialization of the task graph"
"""Part of Dask's message if the scheduler cannot import what a task consists of."""

AHEAD = 3
"""Tasks for each thread of the workers that are submitted and not yet collected: one is drawn, one waits at the worker,
and the file of one is written."""

RETRIES = 3
"""Times that Dask tries a task again that failed by a fault of the device or of the program."""

REVIVALS = 10
"""Times that a task is tried again after Dask has given it up because too many workers died."""

COUNTED = 2.0
"""Seconds after which the workers are counted again."""

ANSWER = 60.0
"""Seconds to wait for workers to appear, and for the first one to open its context."""

TIMEOUT = 900.0
"""Seconds that a task may take. Compilation alone may take RAYMARCH_COMPILE_LIMIT, 600 seconds."""


@dataclass(frozen=True, slots=True)
class Options:
    """How a cluster draws.

    mixed : accept workers with different drivers or libraries. split : number of shares of each pixel's samples.
    batch : pictures of one task. None: as many as take `TASK` seconds.
    timeout : seconds that a task may take. backend, device : of the workers' OpenGL contexts.
    """

    mixed: bool = False
    split: int = 1
    batch: int | None = None
    timeout: float = TIMEOUT
    backend: str = "auto"
    device: int | None = None


@dataclass(slots=True)
class Log:
    """What happened: pictures and seconds by worker, and the faults.

    pictures, seconds : by the address of the worker.
    lost : workers that were lost. again : tasks that were assigned to another worker after that. workers : now.
    """

    pictures: Counter[str] = field(default_factory=Counter)
    seconds: defaultdict[str, float] = field(default_factory=lambda: defaultdict(float))
    lost: list[str] = field(default_factory=list)
    again: set[str] = field(default_factory=set)
    workers: int = 0

    def lines(self, what: str, spent: float) -> list[str]:
        """The summary, one sentence each."""
        found = [f"{sum(self.pictures.values())} {what} in {spent:.1f} s"]
        for worker, count in sorted(self.pictures.items()):
            found.append(f"  {worker}  {count} {what}, {self.seconds[worker]:.1f} s of work")
        if self.lost:
            workers = f"{len(self.lost)} worker{'s' if len(self.lost) > 1 else ''}"
            found.append(f"  {workers} lost, {len(self.again)} tasks assigned again")
        return found


@contextmanager
def scheduled(client: Any) -> Iterator[None]:
    """A block that uses a client: ClusterError if the scheduler is lost meanwhile.

    Dask raises its own errors and plain OSErrors for that. Other OSErrors of the block, as of a full disk, pass.
    """
    from distributed.client import FutureCancelledError

    try:
        yield
    except (OSError, TimeoutError, FutureCancelledError) as fault:
        library = type(fault).__module__.partition(".")[0]
        if library not in ("distributed", "concurrent", "asyncio", "tornado") and client.status == "running":
            raise
        what = "the connection to the scheduler is lost; what was drawn is kept"
        gone = ClusterError(what, legal="the same command again")
        gone.where = None
        raise gone from fault


@dataclass(slots=True)
class Failed:
    """A task that did not return: the last error, and the tries."""

    message: str


@dataclass(slots=True)
class Cluster(Generic[U]):
    """The workers that a command uses.

    client : a `distributed.Client`. resources : Dask resources that a worker must have, such as {"GPU": 1}.
    log : what happened. used : the kinds of workers that draw, once they are known.
    """

    client: Any
    resources: Mapping[str, float] | None = None
    log: Log = field(default_factory=Log)
    used: list[Machine] = field(default_factory=list)
    _threads: int = 1
    _counted: float = -COUNTED

    @property
    def threads(self) -> int:
        """The number of threads of all workers, at least 1; counted anew every `COUNTED` seconds."""
        now = clock_time.monotonic()
        if now - self._counted > COUNTED:
            threads = self.client.nthreads()
            self.log.workers = len(threads)
            self._threads, self._counted = max(1, sum(threads.values())), now
        return self._threads

    def job(self, quality: Quality, shot: Shot, options: Options, tell: Callable[[str], None]) -> Job:
        """A job for the kinds of workers that may draw, see `accepted`. tell : called with notes."""
        with scheduled(self.client):
            found = self.machines(options.backend, options.device)
        self.used, notes = accepted(found, options.mixed)
        for note in notes:
            tell(note)
        return Job(quality, shot, options.backend, options.device, tuple(self.used), options.timeout)

    def machines(self, backend: str, device: int | None) -> dict[str, Machine | str]:
        """The machine of each worker by its address, or the reason why it cannot draw.

        Workers that do not answer in time are left out; their first task compares them. Raises ClusterError if there
        is no worker, or none answers.
        """
        address = self.client.scheduler.address
        try:
            self.client.wait_for_workers(1, timeout=ANSWER)
        except TimeoutError:
            raise ClusterError(f"the scheduler {address} has no workers", legal=f"dask worker {address}") from None
        wanted = dict(self.resources or {})
        workers = {
            worker: info
            for worker, info in self.client.scheduler_info(n_workers=-1)["workers"].items()
            if all(info.get("resources", {}).get(name, 0) >= value for name, value in wanted.items())
        }
        if not workers:
            needed = ", ".join(f"{name}={value:g}" for name, value in wanted.items())
            raise ClusterError(f"no worker has the resource {needed}", legal=f"dask worker --resources '{needed}' ...")
        installed = self._ask(list(workers), resolve_name, "raymarch.cluster.worker:describe")
        able = [worker for worker, found in installed.items() if callable(found)]
        answers = self._ask(able, describe, backend, device) if able else {}
        found: dict[str, Machine | str] = {
            worker: answers.get(worker, f"no answer in {ANSWER:g} s") if callable(answer) else str(answer)
            for worker, answer in installed.items()
        }
        if not found:
            raise ClusterError(f"none of the {len(workers)} workers answers in {ANSWER:g} s", legal="idle workers")
        if any(isinstance(answer, str) and UNREADABLE in answer for answer in found.values()):
            what = f"the scheduler {address} cannot read the tasks: it has no raymarch, or another version"
            raise ClusterError(what, legal="the same environment for scheduler, workers and command")
        return found

    def _ask(self, workers: Sequence[str], function: Callable[..., Any], *arguments: Any) -> dict[str, Any]:
        """What each worker returns, or a sentence with its error; workers that do not answer in time are left out."""
        from distributed import as_completed

        how = {"pure": False, "resources": self.resources, "allow_other_workers": False}
        asked = {self.client.submit(function, *arguments, workers=[worker], **how): worker for worker in workers}
        found: dict[str, Any] = {}
        with suppress(TimeoutError):
            for future in as_completed(asked, loop=self.client.loop, timeout=ANSWER):
                found[asked[future]] = _answer(future)
        return found

    def alone(self) -> list[str]:
        """The addresses of the workers that are the only one on their host."""
        hosts: dict[str, list[str]] = defaultdict(list)
        with scheduled(self.client):
            known = self.client.scheduler_info(n_workers=-1)["workers"]
        for worker, info in known.items():
            hosts[info["host"]].append(worker)
        return [workers[0] for workers in hosts.values() if len(workers) == 1]

    def send(self, source: Source) -> Any:
        """The future of a scene: a task, so that Dask makes it again if the workers that had it are lost."""
        return self.client.submit(_same, source, key=f"raymarch-scene-{source.digest}")

    def completed(self, units: Iterable[U], start: Callable[[U], Any]) -> Iterator[tuple[U, Any]]:
        """The units with what their tasks returned, in the order of completion; `Failed` if a task did not return.

        start : submits the task of a unit and returns its future. Only `AHEAD` tasks for each thread of the workers
        are submitted at a time, and a result is dropped when the next is asked for. So memory does not grow with the
        number of units. Raises ClusterError if the scheduler is lost.
        """
        from distributed import as_completed
        from distributed.scheduler import KilledWorker

        left = iter(units)
        pending: dict[str, tuple[U, Any]] = {}
        revived: Counter[str] = Counter()
        done = as_completed([], loop=self.client.loop)

        def fill() -> None:
            while len(pending) < AHEAD * self.threads:
                unit = next(left, None)
                if unit is None:
                    return
                future = start(unit)
                pending[future.key] = unit, future
                done.add(future)

        def watch(event: tuple[float, Mapping[str, Any]]) -> None:
            self._watch(event[1], pending)

        with scheduled(self.client):
            try:
                self.client.subscribe_topic("all", watch)
                fill()
                for future in done:
                    unit, _ = pending.pop(future.key)
                    if future.status == "error":
                        fault = future.exception()
                        if isinstance(fault, KilledWorker) and revived[future.key] < REVIVALS:
                            revived[future.key] += 1
                            pending[future.key] = unit, future
                            future.retry()
                            done.add(future)
                            continue
                        result: Any = Failed(_one_line(fault))
                    elif future.status in ("lost", "pending"):  # its worker died before it was collected: repeated
                        pending[future.key] = unit, future
                        done.add(future)
                        continue
                    else:
                        result = future.result()  # raises FutureCancelledError if the scheduler is lost
                    del future
                    yield unit, result
                    del result
                    fill()
            finally:
                with suppress(Exception):  # the scheduler may be gone
                    self.client.unsubscribe_topic("all")

    def _watch(self, event: Mapping[str, Any], pending: Mapping[str, Any]) -> None:
        """Count lost workers and the tasks that they had, from the scheduler's events."""
        if event.get("action") == "remove-worker" and not event.get("expected"):
            self.log.lost.append(str(event.get("worker")))
            tasks = (*event.get("processing-tasks", ()), *event.get("lost-computed-tasks", ()))
            self.log.again.update(key for key in tasks if str(key).startswith("raymarch-draw-"))


def _answer(future: Any) -> Any:
    """What a worker returned, or a sentence with its error."""
    if future.status == "finished":
        return future.result()
    return _one_line(future.exception())


def _one_line(fault: BaseException | None) -> str:
    if isinstance(fault, ModuleNotFoundError):
        return f"the module {fault.name} is not installed there"
    text = " ".join(str(fault).split())
    return f"{type(fault).__name__}: {text}" if text else type(fault).__name__


def _same(source: Source) -> Source:
    return source
