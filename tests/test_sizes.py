"""No function is longer than a screen, and no file has more than one reason to change."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
FILES = {file.relative_to(ROOT).as_posix(): file.read_text(encoding="utf-8") for file in ROOT.glob("raymarch/**/*.py")}

LONG_FUNCTION, LONG_FILE = 60, 500

FUNCTIONS = {
    "raymarch/cli/cost.py run": 89,  # two thirds are the table of options
    "raymarch/cli/render.py run": 109,  # the same
    "raymarch/scene/material.py __init__": 82,  # a third is the table of arguments
}
"""Lines of functions that are longer, without docstrings. They may only shrink."""

LONG_FILES: dict[str, int] = {}
"""Lines of files that are longer. They may only shrink."""


DOCSTRING = re.compile(r'\n *""".*?"""', re.DOTALL)


def may_be_long(text: str) -> bool:
    """False if the indented lines after each header of a function are few: then the file need not be parsed."""
    began: list[tuple[int, int]] = []
    for number, line in enumerate([*DOCSTRING.sub("", text).split("\n"), "end"]):
        code = line.lstrip()
        indent = len(line) - len(code)
        while code and code[0] != ")" and began and indent <= began[-1][0]:
            if number - began.pop()[1] > LONG_FUNCTION:
                return True
        if code.startswith(("def ", "async def ")):
            began.append((indent, number))
    return False


def functions(name: str, text: str) -> Iterator[tuple[str, int]]:
    """The functions of a file with their lines, without docstrings."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            lines = (node.end_lineno or 0) - node.lineno + 1
            yield f"{name} {node.name}", lines - sum(map(documented, ast.walk(node)))


def documented(node: ast.AST) -> int:
    """The lines of a docstring."""
    holder = isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef)
    if not holder or ast.get_docstring(node, clean=False) is None:
        return 0
    return (node.body[0].end_lineno or 0) - node.body[0].lineno + 1


def check(found: dict[str, int], limit: int, known: dict[str, int]) -> None:
    """Only the known ones are above a limit, and none of them is longer than is stated."""
    long = {name: lines for name, lines in found.items() if lines > limit}
    assert {name: lines for name, lines in long.items() if lines > known.get(name, 0)} == {}
    assert long.keys() == known.keys(), "what is no longer too long is to be left out"


def test_no_function_is_longer_than_a_screen() -> None:
    pairs = sorted(
        (lines, name) for file, text in FILES.items() if may_be_long(text) for name, lines in functions(file, text)
    )
    check({name: lines for lines, name in pairs}, LONG_FUNCTION, FUNCTIONS)


def test_no_file_is_long() -> None:
    check({name: text.count("\n") for name, text in FILES.items()}, LONG_FILE, LONG_FILES)
