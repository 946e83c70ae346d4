"""The command line: render, view, explain, cost, doctor."""

from raymarch.cli import cost, view  # noqa: F401 - their commands register themselves
from raymarch.cli.commands import main

__all__ = ["main"]
