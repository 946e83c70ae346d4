"""The command line: render, explain, doctor."""

from raymarch.cli.main import main

__all__ = ["main"]
