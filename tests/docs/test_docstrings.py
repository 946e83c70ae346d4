"""The examples of public docstrings give what they show, and docstrings name every parameter."""

from __future__ import annotations

import doctest
import inspect
import re
from pathlib import Path
from typing import Any

import pytest

import raymarch as rm
from raymarch.sdf.helptext import SOURCES

METHODS = {f"node.{name}": each for name, each in vars(rm.Node).items() if callable(each) and name[0] != "_"}
FUNCTIONS = {f"rm.{name}": getattr(rm, name) for name in rm.__all__ if callable(getattr(rm, name))}
PUBLIC = {
    name: inspect.getdoc(each) or ""
    for name, each in {**FUNCTIONS, **METHODS}.items()
    if not (inspect.isclass(each) and issubclass(each, Exception))
}
MADE_BY_OTHERS = {
    "rm.Node",
    "rm.Frame",
    "rm.Truth",
    "rm.Hits",
    "rm.Measures",
    "rm.RaySamples",
    "rm.TracerState",
    "rm.Probe",
    "rm.Proof",
    "rm.cost",
}
EXAMPLES = sorted(name for name, text in PUBLIC.items() if ">>>" in text)


@pytest.mark.parametrize("name", EXAMPLES)
def test_an_example_gives_what_it_shows(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)  # some write files
    found = doctest.DocTestParser().get_doctest(PUBLIC[name], {"rm": rm}, name, None, 0)
    runner = doctest.DocTestRunner(verbose=False, optionflags=doctest.NORMALIZE_WHITESPACE)
    shown: list[str] = []
    runner.run(found, out=shown.append)
    assert runner.failures == 0, "".join(shown)


def test_there_are_examples() -> None:
    assert {"rm.render", "rm.union", "node.translate", "rm.Scene", "rm.Camera", "rm.Material"} <= set(EXAMPLES)


def unnamed(name: str) -> list[str]:
    """The parameters that a docstring does not name."""
    each: Any = {**FUNCTIONS, **METHODS}[name]
    own = [q for q in inspect.signature(each).parameters.values() if q.name not in ("self", "node", "nodes", "values")]
    text = PUBLIC[name]
    return [q.name for q in own if not re.search(rf"(^|[\s,`*(]){q.name}([\s,:`.)]|$)", text, re.MULTILINE)]


@pytest.mark.parametrize("name", sorted(PUBLIC.keys() - MADE_BY_OTHERS))
def test_a_docstring_names_every_parameter(name: str) -> None:
    assert PUBLIC[name].strip()
    assert unnamed(name) == []


# The sections of NumPy


NO_ERRORS = {"rm.DirectionSample"}
"""A tuple of three values, which is checked where it is used."""


def section(text: str, title: str) -> list[str]:
    """The lines of a section of a docstring; none if it is not there."""
    match = re.search(rf"^{title}\n-{{3,}}\n(.*?)(?=^\w[\w ]*\n-{{3,}}\n|\Z)", text, re.MULTILINE | re.DOTALL)
    return [line for line in match[1].splitlines() if line] if match else []


def missing(name: str) -> list[str]:
    """What the docstring of a public function, class or method lacks."""
    each: Any = {**FUNCTIONS, **METHODS}[name]
    text, found = PUBLIC[name], []
    signature = inspect.signature(each)
    own = [q.name for q in signature.parameters.values() if q.name != "self"]
    entries = {
        n.strip("* ")
        for line in section(text, "Parameters")
        if not line.startswith(" ") and " : " in line
        for n in line.partition(" : ")[0].split(",")
    }
    needed = set(own) - ({"node"} if name.startswith("node.") else set())
    if needed - entries:
        found.append(f"parameters {sorted(needed - entries)}")
    if not inspect.isclass(each) and signature.return_annotation not in (None, "None") and not section(text, "Returns"):
        found.append("Returns")
    if needed and name not in NO_ERRORS and not section(text, "Raises"):
        found.append("Raises")
    if hasattr(each, "definition") and not section(text, "References"):
        found.append("References")
    return found


def test_nothing_is_missing_in_docstrings() -> None:
    lacks = {name: found for name in sorted(PUBLIC.keys() - MADE_BY_OTHERS) if (found := missing(name))}
    assert not lacks, "\n".join(f"{name}: {', '.join(found)}" for name, found in lacks.items())


def test_sources_stand_in_the_bibliography() -> None:
    """Each work that a shape names has its authors and its year on one line, or on two, of docs/bibliography.md."""
    works = (Path(__file__).parents[2] / "docs" / "bibliography.md").read_text(encoding="utf-8").split("\n- ")
    for source in set(SOURCES.values()):
        authors, year = re.fullmatch(r"(.*?) (\d{4})(?:, .*)?", source).groups()  # type: ignore[union-attr]
        names = re.findall(r"[A-Z]\w+", authors)
        assert any(year in work and all(name in work for name in names) for work in works), source
