"""The window's side of trials: starts, queries, watches, kills and restarts the trial process."""

from __future__ import annotations

import contextlib
import json
import os
import re
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any, TypeAlias

from raymarch.errors import is_users

Answer: TypeAlias = dict[str, Any]

FORKS = sys.platform.startswith("linux")
"""Whether a trial is a fork. Other systems' libraries do not survive one, or there is none."""

Started: TypeAlias = "tuple[subprocess.Popen[str], SimpleQueue[Answer]]"

GLANCE = 0.02
"""Seconds between two checks whether a trial must end."""

UNANSWERED = 5.0
"""Seconds after which a process that has not begun is killed without a query of its line."""

WHERE = 3.0
"""Most seconds in which a trial tells its line: a busy machine may not run it for as long."""


class Trials:
    """Runs one trial at a time. To be used from one thread.

    forks : whether one process serves all trials, each in a fork of it; otherwise each trial has a process of its own,
        of which one more than is needed is kept ready.
    """

    def __init__(self, forks: bool = FORKS) -> None:
        self._forks = forks
        self._spare: Started | None = None
        self._process: subprocess.Popen[str] | None = None
        self._answers: SimpleQueue[Answer] = SimpleQueue()
        self._number = 0
        self._child: int | None = None
        self._begun = False
        handle, self._trace = tempfile.mkstemp(prefix="raymarch-trace-")
        os.close(handle)

    def run(
        self,
        scene: str,
        params: dict[str, Any],
        size: tuple[int, int],
        known: Mapping[str, Any],
        over: Callable[[], str | None],
    ) -> Answer | None:
        """Try a scene file; see `raymarch.window.trial.examine` for the answer.

        known : "constants" and "clicks", the window's programs; see `raymarch.window.constants.Constants`. "lights",
            the packed `LightMemory` of the scene. Of a scene that is loaded, "packed" and "read": then the file does
            not run.
        over : polled; returns the reason to end the trial early, or None. "changed" gives no answer (None),
            any other reason is the error, with the line where the file was.
        """
        self._settle()
        self._number += 1
        asked = {"scene": scene, "params": params, "size": size, "trace": self._trace, **known}
        self._ask({"id": self._number, **asked})
        self._begun, deadline = False, time.monotonic() + UNANSWERED
        while True:
            reason = over()
            if reason == "changed" or (reason is not None and (self._begun or time.monotonic() > deadline)):
                where = self._kill(ask=reason != "changed")
                return None if reason == "changed" else _failure(scene, reason, where)
            try:
                answer = self._answers.get(timeout=GLANCE)
            except Empty:
                continue
            if answer.get("gone") and self._process is None:
                continue  # an earlier process, killed by us
            if answer.get("gone"):
                return _failure(scene, self._gone(), None)
            if answer.get("id") != self._number:
                continue
            if "pid" in answer:
                self._child = answer["pid"]
            elif "begun" in answer:
                self._begun = True
            elif "ended" in answer:
                self._child = None
                return _failure(scene, _death(answer["ended"]), None)
            elif "ok" in answer:
                return answer

    def close(self) -> None:
        self._kill(ask=False)
        self._reap()
        if self._spare is not None:
            _end(self._spare[0])
            self._spare = None
        Path(self._trace).unlink(missing_ok=True)

    def _settle(self) -> None:
        """End the remaining work of an earlier trial (it may warm the cache for clicks)."""
        self._kill_child()
        if self._process is not None and self._process.poll() is not None:
            self._reap()

    def _kill_child(self) -> None:
        child, self._child = self._child, None
        if child is None or self._process is None:
            return
        if not self._forks:
            self._reap()
            return
        if sys.platform != "win32":
            with contextlib.suppress(OSError, IndexError, ValueError):
                # The process ID of a finished trial may belong to another process now.
                parent = int(Path(f"/proc/{child}/stat").read_text().rpartition(")")[2].split()[1])
                if parent == self._process.pid:
                    os.kill(child, signal.SIGKILL)

    def _ask(self, request: Answer) -> None:
        for _ in range(2):
            if self._process is None:
                self._start()
            assert self._process is not None and self._process.stdin is not None
            try:
                self._process.stdin.write(json.dumps(request) + "\n")
                self._process.stdin.flush()
                return
            except OSError:
                self._reap()

    def _start(self) -> None:
        self._child = None
        self._process, self._answers = self._spare or _started(self._forks)
        self._spare = None if self._forks else _started(self._forks)

    def _gone(self) -> str:
        """How the process ended."""
        process = self._process
        self._reap()
        if self._forks or process is None:
            return "the scene file ended its process"
        return _death(process.returncode)

    def _reap(self) -> None:
        process, self._process, self._child = self._process, None, None
        if process is not None:
            _end(process)

    def _kill(self, *, ask: bool) -> tuple[str, int] | None:
        """End the running trial. Returns the user's line that it was executing."""
        where = None
        if self._child is None and self._process is not None:
            self._await_child()
        if self._child is not None:
            where = self._ask_where(self._child) if ask else None
            self._kill_child()
        elif self._process is not None:
            self._reap()
        return where

    def _await_child(self) -> None:
        """Wait briefly until a newly requested trial reports its process ID."""
        with contextlib.suppress(Empty):
            for _ in range(3):
                answer = self._answers.get(timeout=0.3)
                if answer.get("id") == self._number and "pid" in answer:
                    self._child = answer["pid"]
                    return

    def _ask_where(self, child: int) -> tuple[str, int] | None:
        """The user's line that a trial is at, by its own traceback; None if it does not answer."""
        if not hasattr(signal, "SIGUSR1"):
            return None
        with contextlib.suppress(OSError):
            until = time.monotonic() + WHERE
            while time.monotonic() < until:  # it may be between two lines of the user's, or on the way to the first
                os.truncate(self._trace, 0)
                os.kill(child, signal.SIGUSR1)
                time.sleep(GLANCE)
                for file, line in re.findall(r'File "(.+?)", line (\d+)', Path(self._trace).read_text()):
                    if is_users(file):
                        return file, int(line)
        return None


def _started(forks: bool) -> Started:
    """Start a trial process. Returns it and the queue of its answers."""
    root = str(Path(__file__).parents[2])
    paths = [root, *filter(None, os.environ.get("PYTHONPATH", "").split(os.pathsep))]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(paths), "OPENBLAS_NUM_THREADS": "1"}
    answers: SimpleQueue[Answer] = SimpleQueue()
    process = subprocess.Popen(
        [sys.executable, "-m", "raymarch.window.trial", *([] if forks else ["--once"])],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env=environment,
        start_new_session=True,  # Ctrl+C in the shell is the window's to handle
    )

    def read() -> None:
        assert process.stdout is not None
        for line in process.stdout:
            with contextlib.suppress(json.JSONDecodeError):
                answers.put(json.loads(line))
        answers.put({"gone": True})

    threading.Thread(target=read, name="trial answers", daemon=True).start()
    return process, answers


def _end(process: subprocess.Popen[str]) -> None:
    """Kill a process if it runs, and close our ends of its pipes."""
    if process.poll() is None:
        process.kill()
    process.wait()
    for stream in (process.stdin, process.stdout):
        if stream is not None:
            with contextlib.suppress(OSError):
                stream.close()


def _failure(scene: str, what: str, where: tuple[str, int] | None) -> Answer:
    file, line = where or (scene, 1)
    return {"ok": False, "ms": {}, "files": [], "error": {"what": what, "legal": "", "file": file, "line": line}}


def _death(code: int) -> str:
    if code < 0:
        try:
            name = signal.Signals(-code).name
        except ValueError:
            name = str(-code)
        return f"the scene file crashed Python or the driver ({name})"
    return f"the scene file ended its process with code {code}"
