"""The command line: render, explain, cost, doctor."""

from raymarch.cli import cost  # noqa: F401 - its command registers itself
from raymarch.cli.commands import main

__all__ = ["main"]
