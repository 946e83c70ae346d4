"""The number of the least of many values, in place of the comparisons between them, for devices whose texts have loops.

A gradient chooses as its minimum does: by a comparison at each step of the fold. Compilers keep the values of all steps
until they are compared, or the results of all comparisons. A loop finds the least value and its number. Each choice is
then one by the number, and where its sides differ in constants only, it reads a row of them.

A comparison counts only where those around it lead to it, and there the number tells it. A fold of which a comparison
counts elsewhere stays.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence, Set
from dataclasses import dataclass, field
from functools import cached_property, partial

from raymarch.expr.alike import NOTHING, Alike, groups_of, link, read_rows, with_rows
from raymarch.expr.function import close_loop
from raymarch.expr.node import Expr, const, simplify, var
from raymarch.expr.operations import operations
from raymarch.expr.types import BOOL, FLOAT
from raymarch.expr.vocabulary import min, where
from raymarch.expr.walk import rebuild, topological

FEWEST = 4
"""Least number of different constants that are a row of a table, not a choice."""

FORMS = 6
"""Largest number of forms between which a number chooses before it reads their rows."""

SPARED = 100
"""Least number of operations of a text that all loops for a fold must spare."""

FARTHEST = 1e30
"""A distance farther than all."""


def numbered(roots: Sequence[Expr]) -> list[Expr]:
    """The roots with the comparisons of long folds told by the number of the least value."""
    roots = list(roots)
    if operations(roots) < SPARED:
        return roots
    for fold in _folds(topological(roots)):
        made = _Numbered(fold, roots).roots() if fold.is_long else None
        if made is not None and operations(roots, turns=False) - operations(made, turns=False) >= SPARED:
            return numbered(made)
    return roots


@dataclass(frozen=True)
class _Fold:
    """A fold that takes the least of some values.

    leaves : the values in order. Of equal ones the first is the least. sides : of each comparison, the numbers of the
    leaves for which it holds, and for which it does not, as bits. inner : the steps before the last.
    """

    root: Expr
    leaves: tuple[Expr, ...]
    sides: Mapping[Expr, tuple[int, int]]
    inner: frozenset[Expr]

    @cached_property
    def groups(self) -> list[Alike]:
        """The leaves that are alike."""
        return groups_of(self.leaves)

    @property
    def is_long(self) -> bool:
        """True if a part of it is worth a loop."""
        return bool(self.groups)


@dataclass(frozen=True, slots=True)
class _Step:
    """A step of a fold: the lesser of two values. Of equal ones it is the first.

    yes : the value that it is where the condition holds.
    """

    first: Expr
    second: Expr
    condition: Expr
    yes: Expr


def _steps(order: Sequence[Expr]) -> dict[Expr, _Step]:
    """The steps of folds: minima that are compared, and values chosen as the lesser, or as that nearer to 0."""
    compared = {node.args: node for node in order if node.op == "le"}
    found = {}
    for node in order:
        if node.type is not FLOAT:
            continue
        if node.op == "min" and node.args in compared:
            found[node] = _Step(node.args[0], node.args[1], compared[node.args], node.args[0])
        elif node.op == "where" and node.args[0].op == "lt":
            condition, yes, no = node.args
            if condition.args == (yes, no) or [_size(yes), _size(no)] == list(condition.args):
                found[node] = _Step(no, yes, condition, yes)
    return found


def _size(value: Expr) -> Expr:
    return simplify("abs", value.type, (value,))


def _folds(order: Sequence[Expr]) -> list[_Fold]:
    """The folds whose comparisons are read, in order of their size. order : arguments first."""
    steps = _steps(order)
    conditions = {step.condition for step in steps.values()}
    inner = {value for step in steps.values() for value in (step.first, step.second)}
    read: set[Expr] = set()
    for node in reversed(order):
        if node not in steps and node not in conditions and (node.op != "abs" or node in read):
            read.update(node.args)
    tops = [node for node in order if node in steps and (node not in inner or node in read)]
    found = [_fold(top, steps, steps.keys() - tops) for top in tops]
    told = [fold for fold in found if fold is not None and not read.isdisjoint(fold.sides)]
    return sorted(told, key=lambda fold: -len(fold.leaves))


def _fold(root: Expr, steps: Mapping[Expr, _Step], below: Set[Expr]) -> _Fold | None:
    """The fold of a step; None if a value stands in it twice. below : the steps that only folds read."""
    bits: dict[Expr, int] = {}
    leaves: list[Expr] = []
    sides: dict[Expr, tuple[int, int]] = {}

    def is_step(node: Expr) -> bool:
        return node is root or (node in below and node.op == root.op)

    def arguments(node: Expr) -> tuple[Expr, ...]:
        return (steps[node].first, steps[node].second) if is_step(node) else ()

    for node in topological([root], arguments):
        if not is_step(node):
            bits[node] = 1 << len(leaves)
            leaves.append(node)
            continue
        step = steps[node]
        first, second = bits[step.first], bits[step.second]
        if first & second:
            return None
        sides[step.condition] = (first, second) if step.yes is step.first else (second, first)
        bits[node] = first | second
    return _Fold(root, tuple(leaves), sides, frozenset(bits) - {root, *leaves})


@dataclass
class _Numbered:
    """Expressions whose choices are by the number of the least value of a fold.

    read : the numbers for which each expression is read, as bits.
    """

    fold: _Fold
    given: Sequence[Expr]
    read: dict[Expr, int] = field(default_factory=dict)

    def roots(self) -> list[Expr] | None:
        """The new expressions; None if the number does not tell all comparisons."""
        if not self._told():
            return None
        least, number = self._least()
        new: dict[Expr, Expr] = {self.fold.root: least}
        for node in topological(self.given, self._arguments):
            if node in new:
                continue
            if node in self.fold.sides:
                new[node] = _holds(*self.fold.sides[node], number)
            elif self._is_choice(node):
                new[node] = _by_number([(k, new[side]) for k, side in self._taken(node).items()], number)
            else:
                new[node] = rebuild(node, tuple(map(new.__getitem__, node.args)))
        return [new[root] for root in self.given]

    def _is_choice(self, node: Expr) -> bool:
        return node.op == "where" and node.args[0] in self.fold.sides

    def _arguments(self, node: Expr) -> tuple[Expr, ...]:
        if node is self.fold.root or node in self.fold.sides:
            return ()
        return tuple(dict.fromkeys(self._taken(node).values())) if self._is_choice(node) else node.args

    def _taken(self, node: Expr) -> dict[int, Expr]:
        """What a choice chooses for each number for which it is read."""
        found = {}
        for k in _numbers(self.read[node]):
            side = node
            while self._is_choice(side):
                side = side.args[1 if self.fold.sides[side.args[0]][0] >> k & 1 else 2]
            found[k] = side
        return found

    def _told(self) -> bool:
        """Find for which numbers each expression is read. False if a comparison or a step is read for others."""
        fold, read = self.fold, self.read
        for root in self.given:
            read[root] = (1 << len(fold.leaves)) - 1
        for node in reversed(topological(self.given)):
            here = read.get(node, 0)
            if node in fold.inner and here:
                return False
            if not here or node is fold.root or node in fold.sides:
                continue
            for k, arg in enumerate(node.args):
                there = here
                if arg in fold.sides:
                    if here & ~(fold.sides[arg][0] | fold.sides[arg][1]):
                        return False
                elif k and self._is_choice(node):
                    there = here & fold.sides[node.args[0]][k - 1]
                read[arg] = read.get(arg, 0) | there
        return True

    def _least(self) -> tuple[Expr, Expr]:
        """The least value and its number: of those that are alike by a loop."""
        fold = self.fold
        place = {leaf: k for k, leaf in enumerate(fold.leaves)}
        inside = {leaf for group in fold.groups for leaf in group.values}
        apart = [Alike((leaf,), partial(_itself, leaf)) for leaf in fold.leaves if leaf not in inside]
        order = sorted([*apart, *fold.groups], key=lambda group: place[group.values[0]])
        numbers = [place[leaf] for group in order for leaf in group.values]
        first_wins = numbers == sorted(numbers)
        least, number = const(FARTHEST), const(0.0)
        for group in order:
            if len(group.values) == 1:
                given = group.values[0], const(float(place[group.values[0]]))
                least, number = given if group is order[0] else self._nearer(*given, least, number, first_wins)
                continue
            index, state = var("index of the alike", FLOAT), (var("least", FLOAT), var("number of the least", FLOAT))
            own = [place[leaf] for leaf in group.values]
            k = _by_number([(i, const(float(j))) for i, j in enumerate(own)], index)
            step = self._nearer(group.at(index), k, *state, first_wins)
            least, number = close_loop(len(own), index, state, step, None, (least, number), kept=True)
        return least, number

    def _nearer(self, value: Expr, k: Expr, least: Expr, number: Expr, first_wins: bool) -> tuple[Expr, Expr]:
        """The least value and its number after one more. first_wins : the values come in the order of their numbers."""
        sizes = (value, least)
        if self.fold.root.op == "where" and self.fold.root.args[0].args[0].op == "abs":
            sizes = (_size(value), _size(least))
        nearer = simplify("lt", BOOL, sizes)
        if not first_wins:
            nearer = nearer | (simplify("le", BOOL, sizes) & (k < number))
        chosen = min(value, least) if self.fold.root.op == "min" else where(nearer, value, least)
        return chosen, where(nearer, k, number)


def _itself(value: Expr, _number: Expr) -> Expr:
    return value


def _numbers(bits: int) -> list[int]:
    return [k for k in range(bits.bit_length()) if bits >> k & 1]


def _holds(yes: int, no: int, number: Expr) -> Expr:
    """Whether a number is one of those on the left. All of one side are smaller than all of the other."""
    if yes < no:
        return number < yes.bit_length() - 0.5
    return number > no.bit_length() - 0.5


def _by_number(choices: Sequence[tuple[int, Expr]], number: Expr) -> Expr:
    """The value of a number, from those of some numbers in order. Values that differ in constants read a row."""
    if all(value is choices[0][1] for _, value in choices):
        return choices[0][1]
    straight = _straight(choices)
    if straight is not None:
        return number + straight
    in_rows = _in_rows(choices, number)
    if in_rows is not None:
        return in_rows
    boundaries = [i for i in range(1, len(choices)) if choices[i][1] is not choices[i - 1][1]]
    at = boundaries[len(boundaries) // 2]
    sides = _by_number(choices[:at], number), _by_number(choices[at:], number)
    return where(number < choices[at][0] - 0.5, *sides)


def _straight(choices: Sequence[tuple[int, Expr]]) -> float | None:
    """What is to be added to a number, where that is its value."""
    if any(value.op != "const" or value.type is not FLOAT for _, value in choices):
        return None
    found = {float(value.data) - k for k, value in choices}
    return found.pop() if len(found) == 1 else None


def _in_rows(choices: Sequence[tuple[int, Expr]], number: Expr) -> Expr | None:
    """The value of a number by rows of constants, where the values are of few forms."""
    kinds: dict[Hashable, dict[int, Expr]] = {}
    values = [value for _, value in choices]
    common = set(topological(values[:1])).intersection(*[topological([value]) for value in values[1:]])
    common -= {node for node in common if node.op == "const"}
    for k, value in choices:
        kinds.setdefault(_form(value, common), {})[k] = value
    most = max(len(set(kind.values())) for kind in kinds.values())
    if None in kinds or len(kinds) > FORMS or most < max(FEWEST, len(kinds)):
        return None
    found, *others = [_of_form(kind, number, common) for kind in kinds.values()]
    if others:
        of = {k: float(i) for i, kind in enumerate(kinds.values()) for k in kind}
        which = _by_number([(k, const(of[k])) for k, _ in choices], number)
        for i, other in enumerate(others):
            found = where(which < i + 0.5, found, other)
    return found


def _form(value: Expr, common: Set[Expr]) -> Hashable:
    """What values must share to differ in constants only; None if they cannot be read in a row."""
    if value.op == "const":
        return None if value.type.is_matrix else ("const", value.type)
    of = link(value, NOTHING, common)
    return None if of is None else (value.type, of.shape, value in common and value)


def _of_form(kind: Mapping[int, Expr], number: Expr, common: Set[Expr]) -> Expr:
    """The value of a number, from values of one form."""
    value = next(iter(kind.values()))
    rows = [_constants(kind.get(k, value), common) for k in range(max(kind) + 1)]
    if value.op == "const":
        return read_rows(rows, number).get(0, value)
    return with_rows(value, NOTHING, rows, number, common=common)


def _constants(value: Expr, common: Set[Expr]) -> tuple[Expr, ...]:
    of = link(value, NOTHING, common)
    assert of is not None
    return (value,) if value.op == "const" else of.constants
