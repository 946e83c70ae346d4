"""The command line while it imports the package, which takes some tenths of a second.

Ctrl+C then ends the process at once, with code 130 and without a traceback, and no garbage is collected: what is being
imported stays. This is the package's first import. It does nothing in a program that only imports the package.
"""

from __future__ import annotations

import atexit
import gc
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


def begin() -> None:
    """Prepare the process for the imports of a command, until `end` is called."""
    if not is_command():
        return
    gc.disable()
    atexit.register(gc.freeze)  # the interpreter collects garbage as it exits; the process is about to free everything
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, leave)


def end() -> None:
    """Collect garbage again, but not what was imported, and let Ctrl+C raise KeyboardInterrupt again."""
    if is_command():
        gc.freeze()
        gc.enable()
    if signal.getsignal(signal.SIGINT) is leave:
        signal.signal(signal.SIGINT, signal.default_int_handler)


begin()
