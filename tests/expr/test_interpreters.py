"""What some interpreters do wrong, and others do not."""

from __future__ import annotations

import symtable
from collections.abc import Iterator
from pathlib import Path

import raymarch

COMPREHENSIONS = {"listcomp", "setcomp", "dictcomp"}


def shadowed(table: symtable.SymbolTable) -> Iterator[tuple[int, str]]:
    """Line and name of each comprehension that reads a global name which another one of the same function binds.

    Python 3.12.0 to 3.12.3 put comprehensions into the function around them, and take such a name for a local one.
    """
    inner = table.get_children()
    own = [child for child in inner if child.get_name().strip("<>") in COMPREHENSIONS]
    bound = {symbol.get_name() for child in own for symbol in child.get_symbols() if symbol.is_local()}
    for child in own:
        for symbol in child.get_symbols():
            if symbol.is_global() and symbol.get_name() in bound:
                yield child.get_lineno(), symbol.get_name()
    for child in inner:
        yield from shadowed(child)


def found(text: str) -> list[tuple[int, str]]:
    return list(shadowed(symtable.symtable(text, "text.py", "exec")))


def test_the_pattern_is_found() -> None:
    text = "def f(a):\n    b = {n: type for n, type in a}\n    return [type(x) for x in b]\n"
    assert found(text) == [(3, "type")]
    assert found(text.replace("type(x)", "str(x)")) == []
    assert found(f"class A:\n    def g(self):\n        {text.replace(chr(10), chr(10) + '        ')}") == [(5, "type")]


def test_no_comprehension_reads_a_global_name_that_another_binds() -> None:
    wrong = []
    for file in sorted(Path(raymarch.__file__).parent.rglob("*.py")):
        text = file.read_text()
        if " for " in text:
            wrong += [f"{file}:{line}: {name}" for line, name in found(text)]
    assert wrong == []
