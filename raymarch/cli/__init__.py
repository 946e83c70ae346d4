"""The command line: render, view, explain, cost, prove, export, doctor."""

from raymarch.cli.commands import app, main

__all__ = ["app", "main"]
