"""Hand-written GLSL, one concern a file. A header says what each module needs and gives."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from importlib.resources import files


@dataclass(frozen=True, slots=True)
class Module:
    """One file: its name ("march/plain"), what it needs and gives, the first sentence of its header, its lines."""

    name: str
    needs: frozenset[str]
    gives: frozenset[str]
    summary: str
    lines: tuple[str, ...]


@cache
def load(name: str) -> Module:
    """A module by name; KeyError if there is none, ValueError if its header is not whole."""
    source = files(__name__).joinpath(*f"{name}.glsl".split("/"))
    if not source.is_file():
        raise KeyError(f"no GLSL module '{name}'")
    lines = tuple(source.read_text(encoding="utf-8").rstrip("\n").split("\n"))
    header = [line[2:].strip() for line in lines if line.startswith("//")]
    fields = {key: _field(header, key) for key in ("needs", "gives")}
    if any(value is None for value in fields.values()) or not fields["gives"]:
        raise ValueError(f"GLSL module '{name}' lacks a 'needs:' or 'gives:' line")
    return Module(name, frozenset(fields["needs"] or ()), frozenset(fields["gives"] or ()), header[0], lines)


def _field(header: Iterable[str], key: str) -> list[str] | None:
    for line in header:
        if line.startswith(f"{key}:"):
            return line.partition(":")[2].split()
    return None
