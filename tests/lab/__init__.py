"""Drivers of measurements and long runs, each a command from the root of a clone: `python -m tests.lab.NAME`."""
