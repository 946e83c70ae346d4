"""The user's editor, at a line of a file."""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
from pathlib import Path

IN_A_TERMINAL = frozenset("vi vim nvim nano pico micro hx helix kak emacsclient ed joe ne mcedit less".split())
"""Editors without a window of their own."""

COLONS = frozenset("subl sublime_text zed atom lapce".split())
"""Editors that take FILE:LINE."""

GOTO = frozenset("code code-insiders codium cursor windsurf".split())
"""Visual Studio Code and its relatives: -g FILE:LINE. Others take +LINE FILE."""


def command(file: Path, line: int) -> list[str] | None:
    """The command that opens a file at a line: VISUAL, EDITOR unless it needs a terminal, or VS Code; None without."""
    given = [shlex.split(os.environ.get(name, "")) for name in ("VISUAL", "EDITOR")]
    words = next((w for w in given if w and Path(w[0]).name not in IN_A_TERMINAL), None)
    if words is None:
        words = next(([name] for name in sorted(GOTO) if shutil.which(name)), None)
    if words is None:
        return None
    name = Path(words[0]).stem
    if name in GOTO:
        return [*words, *([] if "-g" in words or "--goto" in words else ["-g"]), f"{file}:{line}"]
    return [*words, f"{file}:{line}"] if name in COLONS else [*words, f"+{line}", str(file)]


def opened(file: Path, line: int) -> str:
    """Open a file at a line; returns what was done, or why not."""
    found = command(file.absolute(), line)
    if found is None:
        return "no editor: set VISUAL to one with a window of its own, such as 'code'"
    try:
        subprocess.Popen(found, stdin=subprocess.DEVNULL, start_new_session=True)
    except OSError as fault:
        return f"cannot run {found[0]}: {fault.strerror}"
    return f"{file.name}:{line} in {Path(found[0]).name}"
