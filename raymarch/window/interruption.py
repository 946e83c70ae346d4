"""Signals that interrupt the window."""

from __future__ import annotations

import signal
import threading
from contextlib import ExitStack
from types import FrameType
from typing import Self

from raymarch.startup import SIGNALS


class Interruption:
    """Handles Ctrl+C, and the other signals that interrupt a command.

    In its context, the first sets `asked`, which the loop checks; the second raises KeyboardInterrupt. An exception at
    the first could occur at any line: in a callback of glfw, which swallows it, or while a lock is held.
    """

    def __init__(self) -> None:
        self.asked = False
        self._before = ExitStack()

    def __enter__(self) -> Self:
        if threading.current_thread() is threading.main_thread():  # other threads cannot handle signals
            for number in SIGNALS:
                if callable(before := signal.getsignal(number)):
                    self._before.callback(signal.signal, number, before)
                    signal.signal(number, self._handle)
        return self

    def __exit__(self, *_: object) -> None:
        self._before.close()

    def _handle(self, number: int, frame: FrameType | None) -> None:
        if self.asked:
            raise KeyboardInterrupt
        self.asked = True
