"""File watching by watchfiles, and by polling where that does not work (some network drives, a missing folder)."""

from __future__ import annotations

import contextlib
import os
import threading
from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

import watchfiles

Signature: TypeAlias = tuple[Any, ...]

LOOK = 1.0
"""Polling interval in seconds."""


class Watch:
    """Calls back when a file of a list changes, disappears or appears, in its own thread.

    Folders are watched, not files, because many editors save by renaming a new file over the old one.
    """

    def __init__(self, changed: Callable[[], None]) -> None:
        self._changed = changed
        self._files: tuple[str, ...] = ()
        self._last: Signature = ()
        self._lock = threading.Lock()
        self._stop, self._again = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._work, name="watch", daemon=True)

    def files(self, files: Sequence[str]) -> None:
        """Set the files to watch, the scene file first. Files that were watched before keep their last known state."""
        with self._lock:
            wanted = tuple(dict.fromkeys(files))
            if wanted == self._files:
                return
            known = dict(zip(self._files, self._last, strict=False))
            fresh = _signature(wanted)
            # The last entry is the list of modules beside the scene.
            kept = [known.get(file, state) for file, state in zip(wanted, fresh, strict=False)]
            same_scene = self._files[:1] == wanted[:1]
            self._last = (*kept, self._last[-1] if same_scene and self._last else fresh[-1])
            self._files = wanted
        self._again.set()

    def start(self) -> None:
        self._thread.start()

    def stop(self) -> None:
        self._stop.set()
        self._again.set()
        if self._thread.is_alive():
            self._thread.join(3)

    def _work(self) -> None:
        while not self._stop.is_set():
            self._again.clear()
            self._compare()
            folders = {os.path.dirname(file) for file in self._files}
            with contextlib.suppress(OSError, RuntimeError):  # a folder is missing
                for _ in watchfiles.watch(
                    *folders,
                    watch_filter=None,
                    debounce=100,
                    step=20,
                    stop_event=self._again,
                    rust_timeout=int(1e3 * LOOK),
                    yield_on_timeout=True,
                    recursive=False,
                    raise_interrupt=False,
                ):
                    self._compare()
                    if self._stop.is_set() or not all(map(os.path.isdir, folders)):
                        break
            self._again.wait(LOOK / 4)

    def _compare(self) -> None:
        with self._lock:
            now = _signature(self._files)
            if now == self._last:
                return
            self._last = now
        self._changed()


def _signature(files: Sequence[str]) -> Signature:
    """A signature of the files; its last entry lists the modules beside the scene, since one may still be missing."""
    states: list[Any] = []
    for file in files:
        try:
            found = os.stat(file)
            states.append((found.st_mtime_ns, found.st_size, found.st_ino))
        except OSError:
            states.append(None)
    beside: tuple[str, ...] = ()
    if files:
        with contextlib.suppress(OSError):
            beside = tuple(sorted(f for f in os.listdir(os.path.dirname(files[0])) if f.endswith(".py")))
    return (*states, beside)
