"""Groups of operands that differ in numbers: one enclosure, of the ranges of their numbers, bounds them all."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from raymarch.expr.evaluate import Program
from raymarch.proof.folds import ends_of, span_of
from raymarch.proof.rays import Whole, picked
from raymarch.proof.rounding import Array
from raymarch.proof.span import still, stretches

EACH = 8
"""Groups in a group."""

ROWS = 1 << 12
"""Groups evaluated at once: their arrays then stay in the CPU cache."""

Form = tuple[Program, Sequence[Array], Whole]
"""A program of a point and numbers, the numbers of each operand, (n, ...), and the operands, (n,)."""


@dataclass(frozen=True, eq=False)
class _Tree:
    """The operands of one form. order : the operands. levels : of each the ranges of numbers; first the operands."""

    program: Program
    order: Whole
    levels: Sequence[Sequence[tuple[Array, Array]]]
    sizes: Sequence[int]

    @classmethod
    def of(cls, program: Program, columns: Sequence[Array], operands: Whole) -> _Tree:
        n = len(operands)
        order = close(np.concatenate([np.zeros((n, 1)), *(c.reshape(n, -1) for c in columns)], axis=1))
        sorted_ = [picked(column, order) for column in columns]
        levels, sizes = [[(column, column) for column in sorted_]], [n]
        while sizes[-1] > EACH:
            first = np.arange(0, sizes[-1], EACH)
            least, most = np.minimum.reduceat, np.maximum.reduceat
            above = [(least(low, first), most(high, first)) for low, high in levels[-1]]
            levels.append([(np.asfortranarray(low), np.asfortranarray(high)) for low, high in above])
            sizes.append(len(first))
        return cls(program, operands[order], levels, sizes)

    def enclose(
        self, level: int, ends: Sequence[Array], owner: Whole, group: Whole, before: Array, behind: Array
    ) -> Array:
        """The ends of the values of all operands in N groups, each on one of some stretches, (2 or 6, N)."""
        result = np.empty((len(ends), len(owner)))
        for i in range(0, len(owner), ROWS):
            own, which = owner[i : i + ROWS], group[i : i + ROWS]
            numbers = [still((picked(low, which), picked(high, which))) for low, high in self.levels[level]]
            with stretches(before[own], behind[own]):
                found = self.program(span_of([picked(end, own) for end in ends]), *numbers)[0]
            result[:, i : i + ROWS] = ends_of(found, len(own))[: len(result)]
        return result


class Groups:
    """The groups of the operands of some forms."""

    def __init__(self, forms: Sequence[Form]) -> None:
        self._trees = [_Tree.of(*form) for form in forms]

    def walk(
        self,
        ends: Sequence[Array],
        before: Array,
        behind: Array,
        divides: Callable[[Whole, Array, int], NDArray[np.bool_]],
    ) -> tuple[Whole, Whole, Array]:
        """The operands of all groups that are divided: the stretch of each, the operand and its ends there.

        ends, before, behind : of N stretches, or of boxes. divides : says of groups and operands, by their stretches,
        their ends there and how many operands they hold at most, which are divided, or are kept.
        """
        n, found = len(before), []
        kept = [(np.zeros(0, np.int64),) * 2 for _ in self._trees]
        for level in reversed(range(max(len(tree.sizes) for tree in self._trees))):
            for number, tree in enumerate(self._trees):
                top = len(tree.sizes) - 1
                if level > top:
                    continue
                if level == top:
                    owner = np.repeat(np.arange(n), tree.sizes[top])
                    group = np.tile(np.arange(tree.sizes[top]), n)
                else:
                    owner = np.repeat(kept[number][0], EACH)
                    group = (kept[number][1][:, None] * EACH + np.arange(EACH)).ravel()
                    there = group < tree.sizes[level]
                    owner, group = owner[there], group[there]
                values = tree.enclose(level, ends, owner, group, before, behind)
                divided = divides(owner, values, EACH**level)
                kept[number] = owner[divided], group[divided]
                if level == 0:
                    found.append((owner[divided], tree.order[group[divided]], values[:, divided]))
        return (
            np.concatenate([each[0] for each in found]),
            np.concatenate([each[1] for each in found]),
            np.concatenate([each[2] for each in found], axis=1),
        )


def close(numbers: Array, each: int = EACH) -> Whole:
    """An order in which operands of close numbers are neighbours, (n,): halves along the widest axis, in turn. The
    halves are powers of 2, so that groups do not straddle them. numbers : (n, columns). each : neighbours without an
    order."""
    order = np.arange(len(numbers))
    pending = [(0, len(numbers))]
    while pending:
        first, last = pending.pop()
        if last - first <= each:
            continue
        rows = order[first:last]
        own = numbers[rows]
        axis = np.argmax(own.max(axis=0) - own.min(axis=0))
        half = 1 << (last - first - 1).bit_length() - 1
        order[first:last] = rows[np.argpartition(own[:, axis], half - 1)]
        pending += [(first, first + half), (first + half, last)]
    return order
