"""A scheduler and workers of Dask as processes of their own, on this machine's loopback."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Self

import psutil

ROOT = Path(__file__).parents[2]
PYTHONPATH = os.pathsep.join(filter(None, (str(ROOT), os.environ.get("PYTHONPATH"))))


def free_port() -> int:
    """A port on which nothing listens."""
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        return int(found.getsockname()[1])


class Processes:
    """A scheduler and workers, each with a nanny. Use it as a context manager, which ends all processes.

    folder : for the workers' files. ttl : seconds after which the scheduler replaces a worker that does not answer.
    """

    def __init__(self, folder: Path, ttl: float = 5.0, environment: Mapping[str, str] | None = None) -> None:
        self.folder, self.port = folder, free_port()
        self.address = f"tcp://127.0.0.1:{self.port}"
        self.environment = {
            **os.environ,
            "PYTHONPATH": PYTHONPATH,
            "PYTHONWARNINGS": "ignore",
            "LP_NUM_THREADS": "1",
            "DASK_DISTRIBUTED__SCHEDULER__WORKER_TTL": f"{ttl:g}s",
            **(environment or {}),
        }
        self.scheduler: subprocess.Popen[bytes] | None = None
        self.nannies: list[subprocess.Popen[bytes]] = []

    def _run(self, module: str, *words: str, **changes: str) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-m", "distributed.cli." + module, *words]
        with (self.folder / f"{module}.log").open("ab") as log:
            return subprocess.Popen(
                command, cwd=self.folder, env=self.environment | changes, stdout=log, stderr=log, start_new_session=True
            )

    def start_scheduler(self) -> None:
        where = ("--host", "127.0.0.1", "--port", str(self.port), "--dashboard-address", "127.0.0.1:0")
        self.scheduler = self._run("dask_scheduler", *where)
        wait_for(lambda: _answers(self.port), 30, "the scheduler to listen")

    def start_worker(self, *words: str, **changes: str) -> subprocess.Popen[bytes]:
        """A nanny with a worker of one thread. words : further options. changes : of the environment."""
        where = ("--nthreads", "1", "--host", "127.0.0.1", "--local-directory", str(self.folder))
        self.nannies.append(self._run("dask_worker", self.address, *where, *words, **changes))
        return self.nannies[-1]

    def kill_scheduler(self) -> None:
        assert self.scheduler is not None
        end(self.scheduler)

    def __enter__(self) -> Self:
        self.start_scheduler()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for process in (*self.nannies, self.scheduler):
            if process is not None:
                end(process)


def worker_of(nanny: subprocess.Popen[bytes]) -> int:
    """The process of a nanny's worker."""
    return next(
        child.pid for child in psutil.Process(nanny.pid).children() if "spawn_main" in " ".join(child.cmdline())
    )


def end(process: subprocess.Popen[bytes]) -> None:
    """Kill a process with all its children."""
    found = []
    with suppress(psutil.NoSuchProcess):
        found = [psutil.Process(process.pid), *psutil.Process(process.pid).children(recursive=True)]
    for each in found:
        with suppress(psutil.NoSuchProcess):
            each.send_signal(signal.SIGKILL)
    process.wait()


def wait_for(holds: object, seconds: float, what: str) -> None:
    """Wait until a function returns something true."""
    stop = time.monotonic() + seconds
    while not holds():  # type: ignore[operator]
        if time.monotonic() > stop:
            raise TimeoutError(f"waited {seconds:g} s for {what}")
        time.sleep(0.05)


def _answers(port: int) -> bool:
    with socket.socket() as tried:
        return tried.connect_ex(("127.0.0.1", port)) == 0
