"""The command line: render, explain, doctor."""

from raymarch.cli.commands import main

__all__ = ["main"]
