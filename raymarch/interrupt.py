"""Ctrl+C while the command line is being imported: the process exits at once, with code 130 and without a traceback.

This is the package's first import, because the following ones take some tenths of a second. It does nothing in a
program that only imports the package.
"""

from __future__ import annotations

import os
import signal
import sys
from typing import NoReturn

INTERRUPTED = 130
"""Exit code after Ctrl+C: 128 + the number of the signal, as shells have it."""


def is_command() -> bool:
    """True if this process is the command `raymarch` or `python -m raymarch`."""
    words = sys.orig_argv
    as_module = "-m" in words and words[words.index("-m") + 1 :][:1] == ["raymarch"]
    return as_module or os.path.basename(words[1] if len(words) > 1 else "") == "raymarch"


def leave(*_: object) -> NoReturn:
    """Exit the process; there is nothing to clean up yet."""
    os._exit(INTERRUPTED)


def watch_imports() -> None:
    """Exit at once on Ctrl+C, until `watch_no_more` is called."""
    if is_command() and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, leave)


def watch_no_more() -> None:
    """Restore Python's handler: Ctrl+C raises KeyboardInterrupt again."""
    if signal.getsignal(signal.SIGINT) is leave:
        signal.signal(signal.SIGINT, signal.default_int_handler)


watch_imports()
