"""The command line while it imports the package, which takes some tenths of a second, and its handlers of signals.

Ctrl+C, SIGTERM and SIGHUP end a command with code 130: during the imports at once, then by KeyboardInterrupt. No
garbage is collected during the imports: what is being imported stays. This is the package's first import. It does
nothing in a program that only imports the package.
"""

from __future__ import annotations

import atexit
import gc
import os
import signal
import sys
import time
from contextlib import suppress
from typing import Any, NoReturn

INTERRUPTED = 130
"""Exit code after Ctrl+C: 128 + the number of the signal, as shells have it."""


def is_command() -> bool:
    """True if this process is the command `raymarch` or `python -m raymarch`."""
    words = sys.orig_argv
    as_module = "-m" in words and words[words.index("-m") + 1 :][:1] == ["raymarch"]
    return as_module or os.path.basename(words[1] if len(words) > 1 else "") == "raymarch"


SIGNALS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))
"""The signals that interrupt a command, unless the shell has it ignore them."""

unfinished: set[str] = set()
"""Files that are being written; see `raymarch.files.written`."""

_interrupted: float | None = None


def leave(*_: object) -> NoReturn:
    """Exit the process; there is nothing to clean up."""
    os._exit(INTERRUPTED)


def interrupt(*_: object) -> None:
    """Raise KeyboardInterrupt. More than a second later, while the command cleans up or where the exception was lost,
    remove unfinished files and exit the process."""
    global _interrupted
    now = time.monotonic()
    if _interrupted is None:
        _interrupted = now
        raise KeyboardInterrupt
    if now - _interrupted > 1.0:
        for name in list(unfinished):
            with suppress(OSError):
                os.unlink(name)
        leave()


def interrupt_again() -> None:
    """Raise KeyboardInterrupt if it was raised before, and lost: some packages catch it while they are imported."""
    if _interrupted is not None:
        raise KeyboardInterrupt


def _handle(before: tuple[object, ...], handler: Any) -> None:
    for number in SIGNALS:
        if signal.getsignal(number) in before:
            signal.signal(number, handler)


def begin() -> None:
    """Prepare the process for the imports of a command, until `end` is called."""
    if not is_command():
        return
    gc.disable()
    atexit.register(gc.freeze)  # the interpreter collects garbage as it exits; the process is about to free everything
    _handle((signal.default_int_handler, signal.SIG_DFL), leave)


def end() -> None:
    """Collect garbage again, but not what was imported, and let signals raise KeyboardInterrupt."""
    if is_command():
        gc.freeze()
        gc.enable()
    _handle((leave,), interrupt)


def close() -> None:
    """Let signals exit at once again: the command is done, and an exception has no use while the interpreter exits."""
    _handle((interrupt,), leave)


begin()
