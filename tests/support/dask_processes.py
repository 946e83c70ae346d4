"""A scheduler and workers of Dask as processes of their own, on this machine's loopback."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any, Self

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


class Way:
    """A way to the address of a scheduler that can be cut, as if the scheduler were killed. A context manager."""

    def __init__(self, address: str) -> None:
        scheme, host = address.split("://")
        name, port = host.rsplit(":", 1)
        self._to = name, int(port)
        self._door = socket.create_server(("127.0.0.1", 0))
        self._ends: list[socket.socket] = []
        self._threads: list[threading.Thread] = []
        self.address = f"{scheme}://127.0.0.1:{self._door.getsockname()[1]}"

    def _start(self, run: Callable[..., None], *arguments: Any) -> None:
        self._threads.append(threading.Thread(target=run, args=arguments))
        self._threads[-1].start()

    def _accept(self) -> None:
        with suppress(OSError):
            while True:
                here = self._door.accept()[0]
                there = socket.create_connection(self._to)
                self._ends += here, there
                self._start(self._carry, here, there)
                self._start(self._carry, there, here)

    def _carry(self, here: socket.socket, there: socket.socket) -> None:
        with suppress(OSError):
            while found := here.recv(1 << 16):
                there.sendall(found)
        with suppress(OSError):
            there.shutdown(socket.SHUT_RDWR)

    def cut(self) -> None:
        """End all connections, and accept no more."""
        for each in (self._door, *self._ends):
            with suppress(OSError):
                each.shutdown(socket.SHUT_RDWR)
            each.close()

    def __enter__(self) -> Self:
        self._start(self._accept)
        return self

    def __exit__(self, *_: object) -> None:
        self.cut()
        for thread in self._threads:
            thread.join()


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
