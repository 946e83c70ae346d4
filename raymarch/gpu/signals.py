"""Signals that wait while C code runs that calls Python."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import Any


@contextmanager
def deferred() -> Iterator[None]:
    """Signals wait until the end of the block, where their handlers are called.

    moderngl calls Python for each uniform of a new program, and does not check the result: an exception of a handler,
    such as KeyboardInterrupt, would end the process. A mask is no substitute, because the signal may reach another
    thread of the process; the handler then still runs in the main thread.
    """
    if threading.current_thread() is not threading.main_thread():  # handlers run in the main thread only
        yield
        return
    came: list[int] = []
    handlers: dict[int, Any] = {number: signal.getsignal(number) for number in sorted(signal.valid_signals())}
    try:
        with ExitStack() as restored:
            for number, handler in handlers.items():
                if callable(handler):
                    restored.callback(signal.signal, number, handler)
                    signal.signal(number, lambda which, _: came.append(which))
            yield
    finally:
        with ExitStack() as called:  # all, even if one raises
            for which in reversed(came):
                called.callback(handlers[which], which, None)
