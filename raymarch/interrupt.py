"""Ctrl+C while the command line is still being imported: the process ends at once, with the code 130 and no traceback.

The package's first import, because what comes after it takes some tenths of a second. It does nothing in a program
that only imports the package.
"""

from __future__ import annotations

import os
import signal
import sys
from typing import NoReturn

INTERRUPTED = 130
"""The exit code of a command that Ctrl+C ended: 128 and the number of the signal, as shells count."""


def is_command() -> bool:
    """True if this process is the command `raymarch` or `python -m raymarch`."""
    words = sys.orig_argv
    as_module = "-m" in words and words[words.index("-m") + 1 :][:1] == ["raymarch"]
    return as_module or os.path.basename(words[1] if len(words) > 1 else "") == "raymarch"


def leave(*_: object) -> NoReturn:
    """End the process; nothing has been begun that would have to be cleaned up."""
    os._exit(INTERRUPTED)


def watch_imports() -> None:
    """End at once on Ctrl+C, until `watch_no_more`."""
    if is_command() and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, leave)


def watch_no_more() -> None:
    """Give Ctrl+C back to Python: from now on it is a KeyboardInterrupt."""
    if signal.getsignal(signal.SIGINT) is leave:
        signal.signal(signal.SIGINT, signal.default_int_handler)


watch_imports()
