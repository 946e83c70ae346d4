"""Open a cluster: workers on this machine, or those of a scheduler."""

from __future__ import annotations

import atexit
import logging
import os
import re
import signal
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from multiprocessing import resource_tracker
from typing import Any

from raymarch.errors import ClusterError
from raymarch.files import import_optional

CONNECT = 10.0
"""Seconds to wait for a scheduler to answer."""

FAILURES = 10
"""Deaths of workers after which Dask gives up a task that each of them was assigned, on a local cluster.

Dask counts a death for all tasks that were assigned to the worker, not only for the one that it ran. Its default is 3.
"""

START, STARTS = 300.0, 3
"""Seconds that a local worker may take to start, and times that a local cluster is started if one of them dies."""

LOGGERS = ("distributed", "tornado", "bokeh", "asyncio")
"""How the names of loggers begin that tell of Dask; some have levels of their own."""

LEGAL = "local, local:N with N workers, or tcp://HOST:PORT"


def check_address(address: str) -> int | None:
    """The number of local workers; None for the address of a scheduler. ClusterError for anything else."""
    local = re.fullmatch(r"local(?::(\d{1,4}))?", address)
    if local is not None and local[1] is None:
        return os.cpu_count() or 1
    if local is not None and int(local[1]) > 0:
        return int(local[1])
    if local is None and re.fullmatch(r"(tcp|tls|ws|wss|ucx)://[^/\s:]+(:\d{1,5})?", address):
        return None
    raise ClusterError(f"--cluster {address}", legal=LEGAL)


@contextmanager
def connected(address: str, timeout: float) -> Iterator[Any]:
    """A `distributed.Client` for an address. A local cluster is closed at the end.

    timeout : seconds after which a local worker that does not answer is replaced. Raises ClusterError if the scheduler
    does not answer.
    """
    distributed = import_optional("--cluster", "distributed", "cluster", ClusterError)
    number = check_address(address)
    if number is not None:
        with _local(distributed, number, timeout) as client:
            yield client
        return
    with _quiet():
        try:
            client = distributed.Client(address, timeout=CONNECT, set_as_default=False)
        except (OSError, TimeoutError, ValueError):
            raise ClusterError(
                f"no Dask scheduler answers at {address}", legal="the address that `dask scheduler` prints"
            ) from None
        try:
            yield client
        finally:
            with suppress(Exception):  # the scheduler may be gone
                client.close(timeout=2)


@contextmanager
def _local(distributed: Any, number: int, timeout: float) -> Iterator[Any]:
    """Workers on this machine, each a process with one thread for tasks and its share of the cores for Mesa."""
    import dask

    import_optional("--cluster local", "cryptography", "cluster", ClusterError)
    threads = max(1, (os.cpu_count() or 1) // number)
    settings = {
        "distributed.scheduler.allowed-failures": FAILURES,
        "distributed.scheduler.worker-ttl": f"{timeout:g}s",  # a hung worker is replaced
        "distributed.admin.tick.limit": "1h",  # a draw blocks a worker's event loop
    }
    options = {
        "n_workers": number,
        "threads_per_worker": 1,
        "dashboard_address": "localhost:0",
        "silence_logs": logging.CRITICAL,
        "security": distributed.Security.temporary(),  # others on this machine could run code as its user
        "env": {"LP_NUM_THREADS": os.environ.get("LP_NUM_THREADS", str(threads))},
        "death_timeout": START,
    }
    with (
        _quiet(),
        dask.config.set(settings),
        _loop() as loop,
        _started(distributed.LocalCluster, {**options, "loop": loop}) as cluster,
        distributed.Client(cluster, set_as_default=False, direct_to_workers=True) as client,
    ):
        yield client


@contextmanager
def _loop() -> Iterator[Any]:
    """An event loop whose thread blocks SIGINT, and with it the processes that it starts.

    Ctrl+C reaches all processes of a terminal. The command handles it, and ends the workers.
    """
    from distributed.utils import LoopRunner

    runner, before = LoopRunner(asynchronous=False), None
    if sys.platform != "win32":
        resource_tracker.ensure_running()  # which Python would start in that thread, and unblock signals there
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        runner.start()
    finally:
        if sys.platform != "win32" and before is not None:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
    try:
        yield runner.loop
    finally:
        runner.stop()


def _started(kind: Any, options: Mapping[str, Any]) -> Any:
    """A local cluster, all of whose workers have started. ClusterError if one dies each time."""
    for left in reversed(range(STARTS)):
        try:
            return kind(**options)
        except Exception as fault:  # Dask raises errors of many kinds here
            if not left:
                cause = fault.__cause__ or fault
                reason = " ".join(str(cause).split()) or type(cause).__name__
                raise ClusterError(f"the workers do not start: {reason}", legal="raymarch doctor") from fault
        except KeyboardInterrupt:
            # Dask would close it at exit, which fails for a cluster that is not whole. Its processes end with this one.
            from distributed.deploy import spec

            atexit.unregister(spec.close_clusters)
            raise
    raise AssertionError


@contextmanager
def _quiet() -> Iterator[None]:
    """A block in which Dask does not log: what matters is in the summary and in the errors."""
    names = [name for name in logging.root.manager.loggerDict if name.startswith(LOGGERS)]
    loggers = [logging.getLogger(name) for name in names]
    levels = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL + 1)
    try:
        yield
    except KeyboardInterrupt:  # the command ends, and Dask's threads after it
        loggers.clear()
        raise
    finally:
        for logger, level in zip(loggers, levels, strict=False):
            logger.setLevel(level)
