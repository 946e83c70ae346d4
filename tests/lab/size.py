"""How large the package is, and what one number crosses on its way to the shader.

    python -m tests.lab.size

Prints for each package of `raymarch/` the lines and the tokens of Python (without comments, docstrings and ends of
lines) and the lines of GLSL, the files above 500 lines and the functions above 60, and then the files, functions and
calls between `rm.sphere(1.37)` with a Sun and the shader text, in a process that holds such a scene.
"""

from __future__ import annotations

import ast
import sys
import tokenize
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from types import FrameType
from typing import Any

import raymarch as rm
from raymarch.gpu.prepare import Prepared, prepare

ROOT = Path(rm.__file__).parent

LONG_FILE, LONG_FUNCTION = 500, 60

LEFT_OUT = {
    *(tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENCODING),
    tokenize.ENDMARKER,
}


def docstrings(tree: ast.Module) -> set[tuple[int, int]]:
    """The places of strings that are statements: docstrings, also of attributes."""
    return {
        (node.lineno, node.col_offset)
        for node in ast.walk(tree)
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
    }


def tokens(file: Path) -> int:
    """The number of tokens of a file, without comments, docstrings and ends of lines."""
    left_out = docstrings(ast.parse(file.read_text()))
    with file.open("rb") as source:
        return sum(t.type not in LEFT_OUT and t.start not in left_out for t in tokenize.tokenize(source.readline))


def functions(file: Path) -> Iterator[tuple[str, int]]:
    """The functions of a file, and the number of lines of each."""
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            yield node.name, (node.end_lineno or node.lineno) - node.lineno + 1


def crossed(name: str = "sphere") -> tuple[int, int, int]:
    """Files, functions and calls of the package from a solid with a light to the shader text."""
    calls: Counter[tuple[str, str, int]] = Counter()

    def count(frame: FrameType, event: str, _: Any) -> None:
        code = frame.f_code
        if event == "call" and code.co_filename.startswith(str(ROOT)):
            calls[code.co_filename, code.co_qualname, code.co_firstlineno] += 1

    def draw() -> Prepared:
        return prepare(rm.Scene(getattr(rm, name)(1.37), lights=[rm.Sun()]))

    held = draw()  # what it remembers lives as long
    sys.setprofile(count)
    try:
        draw()
    finally:
        sys.setprofile(None)
    del held
    return len({file for file, *_ in calls}), len(calls), sum(calls.values())


def main() -> None:
    rows: dict[str, Counter[str]] = {}
    for file in sorted((*ROOT.rglob("*.py"), *ROOT.rglob("*.glsl"))):
        parts = file.relative_to(ROOT).parts
        row = rows.setdefault(parts[0] if len(parts) > 1 else "(top)", Counter())
        lines = len(file.read_text().splitlines())
        row["GLSL" if file.suffix == ".glsl" else "lines"] += lines
        if file.suffix == ".py":
            row["tokens"] += tokens(file)
    rows["all"] = sum(rows.values(), Counter())
    print(f"{'package':10} {'lines':>7} {'tokens':>8} {'GLSL':>6}")
    for package, row in sorted(rows.items(), key=lambda each: each[1]["tokens"]):
        print(f"{package:10} {row['lines']:7,} {row['tokens']:8,} {row['GLSL']:6,}")
    for file in sorted(ROOT.rglob("*.py")):
        place, lines = file.relative_to(ROOT), len(file.read_text().splitlines())
        if lines > LONG_FILE:
            print(f"{place}: {lines} lines")
        for function, lines in functions(file):
            if lines > LONG_FUNCTION:
                print(f"{place}: {function} has {lines} lines")
    files, crossing, calls = crossed()
    print(f"rm.sphere(1.37) with a Sun, to the shader text: {files} files, {crossing} functions, {calls:,} calls")


if __name__ == "__main__":
    main()
