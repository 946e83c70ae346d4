"""The examples of public docstrings give what they show, and docstrings name every parameter."""

from __future__ import annotations

import doctest
import inspect
import re
from typing import Any

import pytest

import raymarch as rm

METHODS = {f"node.{name}": each for name, each in vars(rm.Node).items() if callable(each) and name[0] != "_"}
FUNCTIONS = {f"rm.{name}": getattr(rm, name) for name in rm.__all__ if callable(getattr(rm, name))}
PUBLIC = {
    name: inspect.getdoc(each) or ""
    for name, each in {**FUNCTIONS, **METHODS}.items()
    if not (inspect.isclass(each) and issubclass(each, Exception))
}
MADE_BY_OTHERS = {"rm.Node", "rm.Frame", "rm.Truth", "rm.Hits", "rm.Probe", "rm.Proof", "rm.cost"}
EXAMPLES = sorted(name for name, text in PUBLIC.items() if ">>>" in text)


@pytest.mark.parametrize("name", EXAMPLES)
def test_an_example_gives_what_it_shows(name: str) -> None:
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
