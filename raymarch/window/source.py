"""Values written into a scene file: only literals that stand there change; comments and form stay."""

from __future__ import annotations

import ast
import difflib
import io
import re
import tokenize
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from raymarch.errors import Location
from raymarch.scene.parameter import Value

DIGITS = 6
"""Significant digits of written numbers."""


@dataclass(frozen=True, slots=True)
class Wanted:
    """A value that an argument of a call in a file shall have.

    call : the name of the called function or class. where : its line. subject : what it is, for messages.
    names : of the argument, any of which may stand there. order : of the positional arguments.
    old, new : the value that it has, and the one that it shall have. label : the first argument of a Param.
    """

    call: str
    where: Location | None
    subject: str
    names: tuple[str, ...]
    order: tuple[str, ...]
    old: Value | None
    new: Value
    label: str | None = None


class Refused(Exception):
    """A value that cannot be written; says why."""


@dataclass(frozen=True, slots=True)
class Draft:
    """Changes of files that are not saved yet: of each file its content now and then, and why other values are not
    written."""

    files: dict[Path, tuple[bytes, bytes]]
    refused: tuple[str, ...]

    def text(self) -> str:
        """The lines that change, before and after."""
        lines = []
        for file, (before, after) in self.files.items():
            old, new = (content.decode(errors="replace").splitlines() for content in (before, after))
            marked = difflib.unified_diff(old, new, n=0, lineterm="")
            lines += [f"{file.name}", *(line for line in marked if not line.startswith(("---", "+++", "@@")))]
        return "\n".join([*lines, *(f"not written: {why}" for why in self.refused)])


def drafted(wanted: Iterable[Wanted]) -> Draft:
    """The changes of the files in which values stand."""
    refused: list[str] = []
    by_file: dict[Path, list[Wanted]] = {}
    for value in wanted:
        if value.where is None or not Path(value.where.file).is_file():
            refused.append(f"{value.subject}: it does not stand in a file")
        else:
            by_file.setdefault(Path(value.where.file), []).append(value)
    files = {}
    for file, values in by_file.items():
        before = file.read_bytes()
        after, reasons = rewritten(before, values)
        refused += reasons
        if after != before:
            files[file] = before, after
    return Draft(files, tuple(refused))


def rewritten(content: bytes, wanted: Sequence[Wanted]) -> tuple[bytes, list[str]]:
    """The content of a file with values in place of literals, and why others are not written."""
    try:
        encoding, _ = tokenize.detect_encoding(io.BytesIO(content).readline)
        text = content.decode(encoding)
        source = Source(text)
    except (SyntaxError, UnicodeDecodeError, ValueError) as fault:
        return content, [f"{value.subject}: the file cannot be read: {fault}" for value in wanted]
    places: dict[tuple[int, int], bytes] = {}
    refused = []
    for value in wanted:
        try:
            found = source.places(value)
            if any(places.get(place, new) != new for place, new in found.items()):
                raise Refused("another value stands in the same place")
            places |= found
        except Refused as fault:
            refused.append(f"{value.subject}: {fault}")
    made = bytearray(source.data)
    for (start, end), new in sorted(places.items(), reverse=True):
        made[start:end] = new
    after = made.decode()
    ast.parse(after)
    return after.encode(encoding), refused


class Source:
    """The text of a file with its syntax tree."""

    def __init__(self, text: str) -> None:
        mark = "\ufeff" if text.startswith("\ufeff") else ""
        self.tree = ast.parse(text[len(mark) :])
        self.data = text.encode()
        lines = re.split(rb"(?<=\n)|(?<=\r)(?!\n)", self.data[len(mark.encode()) :])
        self._starts = [len(mark.encode()), *np.cumsum([len(line) for line in lines]) + len(mark.encode())]
        self._calls = [node for node in ast.walk(self.tree) if isinstance(node, ast.Call)]

    def places(self, wanted: Wanted) -> dict[tuple[int, int], bytes]:
        """The bytes to replace, (start, end), and what replaces them. Raises Refused."""
        found: dict[tuple[int, int], bytes] = {}
        for call in self._called(wanted):
            given = self._argument(call, wanted)
            found |= self._replaced(given, wanted.new)
        return found

    def _called(self, wanted: Wanted) -> list[ast.Call]:
        """The calls that made a value: of a Param all with its name, else the one in its line."""
        named = [call for call in self._calls if _name(call.func) == wanted.call]
        if wanted.label is not None:
            labels = [(call, call.args[0] if call.args else _keyword(call, "name")) for call in named]
            same = [call for call, label in labels if isinstance(label, ast.Constant) and label.value == wanted.label]
            if not same:
                raise Refused("its name is computed")
            return same
        assert wanted.where is not None
        line = wanted.where.line
        inside = [call for call in named if call.lineno <= line <= (call.end_lineno or call.lineno)]
        begun = [call for call in inside if call.lineno == line] or inside
        if len(begun) > 1:
            begun = [call for call in begun if self._has(call, wanted)]
            if not begun:
                raise Refused(f"{wanted.names[0]} does not stand in line {line}")
        if len(begun) != 1:
            many = f"{len(begun)} equal calls of {wanted.call} stand" if begun else f"no {wanted.call} stands"
            raise Refused(f"{many} in line {line}")
        return begun

    def _has(self, call: ast.Call, wanted: Wanted) -> bool:
        try:
            value = self._literal(self._argument(call, wanted))
        except Refused:
            return False
        old: Any = wanted.old
        return not isinstance(value, str) and np.shape(value) == np.shape(old) and np.allclose(value, old)

    def _argument(self, call: ast.Call, wanted: Wanted) -> ast.expr:
        for name in wanted.names:
            if (given := _keyword(call, name)) is not None:
                return given
            at = wanted.order.index(name) if name in wanted.order else len(call.args)
            if at < len(call.args) and not any(isinstance(arg, ast.Starred) for arg in call.args):
                return call.args[at]
        raise Refused(f"{wanted.names[0]} does not stand in line {call.lineno}")

    def _literal(self, node: ast.expr) -> Any:
        """The value of a literal. Raises Refused if it is none, or not at the place that the parser says."""
        try:
            value = ast.literal_eval(node)
        except ValueError:
            raise Refused(f"it is computed in line {node.lineno}: {ast.unparse(node)}") from None
        start, end = self._span(node)
        try:  # Python 3.11 gives wrong places in f-strings
            same = ast.literal_eval(self.data[start:end].decode()) == value
        except (ValueError, SyntaxError):
            same = False
        if not same:
            raise Refused(f"it stands in an f-string in line {node.lineno}")
        return value

    def _span(self, node: ast.expr) -> tuple[int, int]:
        assert node.end_lineno is not None and node.end_col_offset is not None
        start = self._starts[node.lineno - 1] + node.col_offset
        return int(start), int(self._starts[node.end_lineno - 1] + node.end_col_offset)

    def _replaced(self, node: ast.expr, new: Value) -> dict[tuple[int, int], bytes]:
        if isinstance(node, ast.Name):
            node = self._assigned(node)
        if isinstance(node, ast.Tuple | ast.List) and np.shape(new) == (len(node.elts),):
            found: dict[tuple[int, int], bytes] = {}
            for part, value in zip(node.elts, np.atleast_1d(new), strict=True):
                found |= self._replaced(part, float(value))
            return found
        value = self._literal(node)
        if not isinstance(value, int | float | str | tuple | list) or isinstance(value, bool):
            raise Refused(f"{ast.unparse(node)} in line {node.lineno} is no number")
        if not isinstance(value, str) and np.shape(value) in ((), np.shape(new)) and _equal(value, new):
            return {}
        return {self._span(node): written(new, value).encode()}

    def _assigned(self, name: ast.Name) -> ast.expr:
        """The literal of a name that is assigned once in the file, and read once."""
        names = [node for node in ast.walk(self.tree) if isinstance(node, ast.Name) and node.id == name.id]
        made = [node for node in names if not isinstance(node.ctx, ast.Load)]
        if len(names) - len(made) > 1:
            raise Refused(f"{name.id} is read in several places")
        hidden = any(name.id in _bound(node) for node in ast.walk(self.tree))
        for statement in self.tree.body:
            if isinstance(statement, ast.Assign) and not hidden and statement.targets == made:
                return statement.value
        raise Refused(f"it is computed in line {name.lineno}: {name.id}")


def _name(function: ast.expr) -> str:
    return function.attr if isinstance(function, ast.Attribute) else getattr(function, "id", "")


def _bound(node: ast.AST) -> tuple[str | None, ...]:
    """The names that a node sets otherwise than by an assignment: arguments, functions, imports, patterns."""
    if isinstance(node, ast.arg):
        return (node.arg,)
    if isinstance(node, ast.MatchMapping):
        return (node.rest,)
    return getattr(node, "name", None), getattr(node, "asname", None)


def _keyword(call: ast.Call, name: str) -> ast.expr | None:
    return next((keyword.value for keyword in call.keywords if keyword.arg == name), None)


def _equal(old: Any, new: Value) -> bool:
    return bool(np.all(np.abs(np.asarray(new) - old) <= 0.5 * 10.0**-DIGITS * np.abs(new)))


def written(new: Value, old: Any = 0.0) -> str:
    """A value as Python; an integer stays one where it may."""
    if isinstance(new, tuple):
        return f"({', '.join(written(v) for v in new)})"
    rounded = float(f"{new:.{DIGITS}g}")
    return str(int(rounded)) if isinstance(old, int) and rounded.is_integer() else repr(rounded)
