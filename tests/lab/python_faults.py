"""Seeds faults into the Python functions that plan and assemble shaders, and counts how many the tests notice.

python -m tests.lab.python_faults              # 40 of them, as the ledger has them
python -m tests.lab.python_faults --missed     # those of the ledger that nothing noticed, anew
python -m tests.lab.python_faults --uses FILE  # as of tests.lab.glsl_faults

A fault swaps two arguments, negates or moves a comparison, drops a part of a condition, takes one branch for both,
moves an integer by 1, turns + into -, or spoils a call in a text of GLSL: a clamp, floor or sign is left out. Faults
in what is raised are left out. The tests that call the function are asked.
"""

from __future__ import annotations

import ast
import importlib
import json
import sys
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.lab.glsl_faults import UNNOTICED, counts
from tests.lab.long_runs import keep
from tests.lab.seeded import ENOUGH, ROOT, Bench, functions_in, modules_of, replace_code, run, tree_of

LEDGER = ROOT / "docs" / "figures" / "python_faults.json"
PACKAGES = ("plan", "shader")
COUNT = 40

TURNED: dict[type[ast.AST], type[ast.AST]] = {
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.And: ast.Or,
    ast.Or: ast.And,
}
CALLS = ("max(", "min(", "clamp(", "abs(", "-")


@dataclass(frozen=True)
class Fault:
    """A function with one node of its tree changed. place : its place among all nodes and changes of the function."""

    module: str
    function: str
    place: int
    what: str

    @property
    def name(self) -> str:
        return f"{self.module.removeprefix('raymarch.')}: {self.function}: {self.what}"


def changes(node: ast.AST) -> Iterator[Callable[[], ast.AST]]:
    """The faults that a node can have: each changes it, and returns what takes its place."""
    match node:
        case ast.Compare(ops=[op]) if type(op) in TURNED:
            yield lambda: ast.Compare(node.left, [TURNED[type(op)]()], node.comparators)
        case ast.BinOp(op=ast.Add() | ast.Sub(), right=right) if not isinstance(right, ast.Constant | ast.JoinedStr):
            yield lambda: ast.BinOp(node.left, TURNED[type(node.op)](), node.right)
        case ast.BoolOp(op=op, values=values):
            yield lambda: ast.BoolOp(TURNED[type(op)](), values)
            yield lambda: values[0]
        case ast.UnaryOp(op=ast.Not(), operand=operand):
            yield lambda: operand
        case ast.IfExp(body=body, orelse=other):
            yield lambda: body
            yield lambda: other
        case ast.If(body=body, orelse=other) if not any(isinstance(step, ast.Raise) for step in body):
            yield lambda: ast.If(ast.Constant(True), body, other)
            yield lambda: ast.If(ast.Constant(False), body, other)
        case ast.Constant(value=int(value)) if not isinstance(value, bool):
            yield lambda: ast.Constant(value + 1)
        case ast.Constant(value=str(value)) if "(" in value or ";" in value:
            for call in CALLS:
                if call in value:
                    yield lambda call=call: ast.Constant(value.replace(call, call.strip("maxinclpbs-"), 1))
        case ast.Call(args=[first, second, *rest]) if ast.dump(first) != ast.dump(second) and not any(
            isinstance(given, ast.Starred) for given in (first, second)
        ):
            yield lambda: ast.Call(node.func, [second, first, *rest], node.keywords)


def nodes(tree: ast.AST) -> Iterator[tuple[ast.AST, str, int | None, ast.AST]]:
    """All nodes below one but those of annotations, of docstrings and of what is raised: parent, field, index, node."""
    for name, value in ast.iter_fields(tree):
        if name in ("annotation", "returns", "decorator_list"):
            continue
        listed = value if isinstance(value, list) else [value]
        for k, inner in enumerate(listed):
            if not isinstance(inner, ast.AST) or isinstance(inner, ast.Raise | ast.Assert):
                continue
            if isinstance(inner, ast.Expr) and isinstance(inner.value, ast.Constant):
                continue
            yield tree, name, k if isinstance(value, list) else None, inner
            yield from nodes(inner)


def faults_of(module: str) -> Iterator[Fault]:
    """All faults of the functions of a module."""
    tree = tree_of(importlib.import_module(module))
    for scope, function in functions_in(tree):
        place = 0
        for _, _, _, node in nodes(function):
            for change in changes(node):
                before, after = ast.unparse(node), ast.unparse(ast.fix_missing_locations(change()))
                shown = f"{_short(before)} -> {_short(after, before)}"
                yield Fault(module, scope, place, shown)
                place += 1


def _short(text: str, other: str = "") -> str:
    """The first line of a text, from a little before the place where it differs from another."""
    lines, others = text.split("\n"), other.split("\n")
    return lines[0] if len(lines) == 1 or lines[0] != others[0] else lines[0] + " ..."


def seeded(fault: Fault) -> None:
    """Put a fault in place, for good."""
    module = importlib.import_module(fault.module)
    tree = tree_of(module)
    function = dict(functions_in(tree))[fault.function]
    place = 0
    for parent, name, k, node in list(nodes(function)):
        for change in changes(node):
            if place == fault.place:
                new = ast.copy_location(change(), node)
                if k is None:
                    setattr(parent, name, new)
                else:
                    getattr(parent, name)[k] = new
                replace_code(module, tree, [fault.function])
                return
            place += 1
    raise AssertionError(f"no such fault: {fault.name}")


def drawn() -> list[Fault]:
    """Those of the ledger that can still be seeded, and others in an order that edits elsewhere do not change."""
    found = {fault.name: fault for folder in PACKAGES for name in modules_of(folder) for fault in faults_of(name)}
    kept = [name for name in ledger()["noticed"] if name in found]
    others = sorted(set(found) - set(kept), key=lambda name: zlib.crc32(name.encode()))
    return [found[name] for name in [*kept, *others][:COUNT]]


def ledger() -> dict[str, Any]:
    return dict(json.loads(LEDGER.read_text(encoding="utf-8"))) if LEDGER.exists() else {"noticed": {}, "none": {}}


def main(given: list[str]) -> int:
    uses = Path(given.pop(given.index("--uses") + 1)) if "--uses" in given else None
    faults = drawn()
    known = ledger()
    asked = [fault for fault in faults if fault.name not in known["noticed"]]
    if "--missed" in given:
        asked = [fault for fault in faults if known["noticed"].get(fault.name, "missed") in UNNOTICED]
    longest = 10 * ENOUGH if "--missed" in given else ENOUGH

    def work(bench: Bench) -> None:
        for fault in asked:
            names = bench.ordered(bench.calling(f"{fault.module}:{fault.function}"), fault.module)
            found = bench.verdict(lambda fault=fault: seeded(fault), names) if names else "no test calls it"
            bench.note(fault.module, found)
            print(f"{fault.name} => {found}", flush=True)
            known["noticed"][fault.name] = found
            kept = {what: {f.name: of[f.name] for f in faults if f.name in of} for what, of in known.items()}
            LEDGER.write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")

    run(work, recorded=uses, longest=longest)
    seen, none, missed = counts(ledger())
    figures = {"tried, of all": len(faults), "noticed": seen, "no faults: they change nothing": none, "missed": missed}
    keep("python_faults", **figures)
    print(f"{seen} of {seen + missed} noticed; {none} more are none")
    return 0 if seen >= 0.99 * (seen + missed) else 1


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
