"""Values that are alike: one text, with rows of constants or a choice of arguments in place of what differs.

Values of equal form differ in constants only. Others have a form in common: a function that is called at two places,
each turned in a way of its own, has one call at a chosen place.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Hashable, Iterable, Mapping, Sequence, Set
from dataclasses import dataclass
from functools import partial
from itertools import count
from typing import TypeAlias

import numpy as np

from raymarch.expr.node import Expr, construct, make, swizzle, var
from raymarch.expr.operations import operations
from raymarch.expr.pieces import literal
from raymarch.expr.tables import Table
from raymarch.expr.types import BOOL, FLOAT, Type, vector
from raymarch.expr.vocabulary import columns, where
from raymarch.expr.walk import rebuild, run, substitute, topological

FEWEST = 6
"""Least number of values whose evaluation is a loop."""

LONG = 30
"""Operations of a value from which two are enough."""

FEW = 8
"""Largest number of values of which each has arguments of its own."""

LONGEST = 256
"""Largest number of rows of four numbers in an array of constants: some drivers refuse much longer ones."""

SPARED = 40
"""Least number of operations of the text that a loop must spare."""

CHOSEN = 0.5
"""Operations that arguments may take to be computed and chosen, as a part of those that a loop spares."""

NOTHING = var("nothing", FLOAT)
"""In place of the value before a step, where there is none."""

Shape: TypeAlias = Hashable


class Rows(Table):
    """A table that is an array of constants in the text, four numbers in a row."""

    __slots__ = ()

    kind = "rows"

    @property
    def declaration(self) -> str:
        """The text of the array."""
        rows = [f"    vec4({', '.join(map(literal, row))})" for row in self.values]
        return f"const vec4 {self.name}[{len(rows)}] = vec4[](\n" + ",\n".join(rows) + ");"


@dataclass(frozen=True, slots=True)
class Link:
    """A value, or a step of a fold: what it is but for its constants, and these in order."""

    shape: Shape
    constants: tuple[Expr, ...]


@dataclass(frozen=True, slots=True)
class Alike:
    """Values that are alike. at : the value of a number, counted from 0."""

    values: tuple[Expr, ...]
    at: Callable[[Expr], Expr]


def groups_of(values: Sequence[Expr]) -> list[Alike]:
    """The values in groups of which each is worth a loop. What is in none is left out."""
    found, others = list[Alike](), list[Expr]()
    for group in _by(_shape, values):
        at = _of_rows(group) if 1 < len(group) <= LONGEST else None
        if at is None:
            others += group
        else:
            found.append(Alike(group, at))
    for group in _by(_main, others):
        at = _of_choices(group) if 1 < len(group) <= FEW else None
        if at is not None:
            found.append(Alike(group, at))
    return found


def _shape(value: Expr) -> Hashable:
    of = link(value, NOTHING)
    return value if of is None else of.shape


def _by(key: Callable[[Expr], Hashable], values: Iterable[Expr]) -> list[tuple[Expr, ...]]:
    found: dict[Hashable, list[Expr]] = {}
    for value in values:
        found.setdefault(key(value), []).append(value)
    return [tuple(group) for group in found.values()]


def _differ(column: tuple[Expr, ...]) -> bool:
    return len(set(column)) > 1


def _worth(group: Sequence[Expr], more: float) -> bool:
    """True if a loop over some values spares enough. more : operations that it takes besides."""
    common = set(topological([group[0]])).intersection(*[topological([value]) for value in group[1:]])
    inputs = {node: var(f"common {k}", node.type) for k, node in enumerate(common) if node.args}
    own = substitute(group[:1], inputs)
    spared = operations(own, turns=False) * (len(group) - 1)
    return spared >= SPARED and more <= CHOSEN * spared and (len(group) >= FEWEST or operations(own) >= LONG)


def _main(value: Expr) -> Hashable:
    """What values must share to have a form in common: the last operation, and the functions called."""
    calls = [node.data for node in topological([value]) if node.op == "call"]
    return (value.op, value.type, frozenset(calls)) if calls else value


def _of_rows(group: Sequence[Expr]) -> Callable[[Expr], Expr] | None:
    """The value of a number, of values that differ in constants only. None if a loop spares too little."""
    rows = [of.constants for of in (link(value, NOTHING) for value in group) if of is not None]
    if len(rows) < len(group) or not any(map(_differ, zip(*rows, strict=True))) or not _worth(group, 0):
        return None
    return partial(with_rows, group[0], NOTHING, rows)


def _of_choices(group: Sequence[Expr]) -> Callable[[Expr], Expr] | None:
    """The value of a number, of values with a form in common. None if a loop spares too little."""
    holes: dict[tuple[Expr, ...], Expr] = {}

    def start(values: tuple[Expr, ...]) -> Generator[tuple[Expr, ...], Expr, Expr]:
        first = values[0]
        columns = list(zip(*[value.args for value in values], strict=False))
        if all(value is first for value in values):
            return first
        same = len({(v.op, v.type, v.data if v.args else v, len(v.args)) for v in values}) == 1
        alike = same and all(len({value.type for value in column}) == 1 for column in columns)
        if not alike or first.op in ("loop", "item"):
            return holes.setdefault(values, var(f"chosen {len(holes)}", first.type))
        args = []
        for column in columns:
            args.append((yield column))
        return make(first.op, first.type, tuple(args), first.data)

    form: Expr = run(tuple(group), start, tuple, {})
    read = set(topological([form]))
    left = {hole: values for values, hole in holes.items() if hole in read}
    apart = [value for values in left.values() for value in values]
    chosen = sum(values[0].type.size * (len(values) - 1) for values in left.values())
    if form in left or not _worth(group, operations(apart, turns=False) + chosen):
        return None
    return partial(_filled, form, left)


def _chosen(values: Sequence[Expr], number: Expr) -> Expr:
    """The value of a number."""
    if all(value.op == "const" and value.type is not BOOL for value in values):
        return read_rows([(value,) for value in values], number)[0]
    found = values[-1]
    for k in range(len(values) - 2, -1, -1):
        found = values[k] if values[k] is found else where(number < k + 0.5, values[k], found)
    return found


def _filled(form: Expr, holes: Mapping[Expr, Sequence[Expr]], number: Expr) -> Expr:
    """A form with the values of a number."""
    return substitute([form], {hole: _chosen(values, number) for hole, values in holes.items()})[0]


# Rows of constants


def link(node: Expr, before: Expr, common: Set[Expr] = frozenset()) -> Link | None:
    """A step from the value `before` to `node`; None if it reads something of a loop. common : what all steps read."""
    numbers: dict[Expr, int] = {before: -1}
    shape: list[Hashable] = []
    constants: list[Expr] = []
    for part in _parts(node, before, common):
        if part.op in ("loop", "item"):
            return None
        below: list[Hashable] = []
        for arg in part.args:
            if _in_rows(arg, before):
                below.append(arg.type)
                constants.append(arg)
            else:
                below.append(numbers.get(arg, arg))
        numbers[part] = len(numbers)
        shape.append((part.op, part.type, part.data, part if not part.args else None, tuple(below)))
    return Link(tuple(shape), tuple(constants))


def _parts(node: Expr, before: Expr, common: Set[Expr]) -> list[Expr]:
    """The expressions of a step, but for constants, the value before it and what all steps read."""
    known = {before} | common
    order = topological([node], lambda e: () if e in known or e.op == "const" else e.args)
    return [part for part in order if part not in known and part.op != "const"]


def _in_rows(arg: Expr, before: Expr) -> bool:
    return arg.op == "const" and arg.type.size <= 4 and not arg.type.is_matrix and arg is not before


def with_rows(
    node: Expr,
    before: Expr,
    rows: Sequence[Sequence[Expr]],
    number: Expr,
    state: Expr = NOTHING,
    common: Set[Expr] = frozenset(),
) -> Expr:
    """A step with its constants from a row. rows : the constants of each step. state : in place of the value before.
    common : as for `link`."""
    held = read_rows(rows, number)
    new: dict[Expr, Expr] = {before: state}
    position = count()
    for part in _parts(node, before, common):
        args = [held.get(next(position), arg) if _in_rows(arg, before) else new.get(arg, arg) for arg in part.args]
        new[part] = rebuild(part, tuple(args))
    return new.get(node, node)


def read_rows(rows: Sequence[Sequence[Expr]], number: Expr) -> dict[int, Expr]:
    """The constants of a row that differ between rows, by their place in the row."""
    varying = [k for k, column in enumerate(zip(*rows, strict=True)) if _differ(column)]
    if not varying:
        return {}
    numbers = np.array([np.concatenate([np.ravel(row[k].data.T) for k in varying]) for row in rows], np.float32)
    filled = np.pad(numbers, ((0, 0), (0, -numbers.shape[1] % 4)))
    tables = [Rows(filled[:, at : at + 4], "rows of constants") for at in range(0, filled.shape[1], 4)]
    flat = [swizzle(make("fetch", table.type, (number,), table), part) for table in tables for part in "xyzw"]
    return {k: _of_numbers(rows[0][k].type, flat) for k in varying}


def _of_numbers(type: Type, flat: list[Expr]) -> Expr:
    """A value made of the first numbers of a list, which are taken from it. A matrix is made by columns."""
    if type.is_matrix:
        return columns(*[_of_numbers(vector(type.size), flat) for _ in range(type.size)])
    taken = [flat.pop(0) for _ in range(type.size)]
    return taken[0] if type is FLOAT else construct(*taken)
