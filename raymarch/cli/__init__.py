"""The command line: render, view, explain, cost, doctor."""

from raymarch.cli.app import app, main

__all__ = ["app", "main"]
