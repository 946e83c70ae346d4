"""Material values of several parts as one: a choice, a mean by weights, or rows of a table."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import reduce
from typing import TypeAlias

import numpy as np

from raymarch.expr.adjoints import add_choices, map_choices
from raymarch.expr.node import Expr, const, var
from raymarch.expr.tables import Table, fetch
from raymarch.expr.vocabulary import get, record, where
from raymarch.expr.walk import find, rebuild, rewrite
from raymarch.sdf.columns import Packing

Term: TypeAlias = tuple[Expr, Expr]
"""The weight of a part and its value."""


class Palette:
    """The constant materials of many objects, as rows of a table."""

    def __init__(self, materials: Sequence[Sequence[Expr]], numbers: Sequence[int]) -> None:
        self.fixed: dict[int, Expr] = {}
        names, values = [], []
        for i, first in enumerate(materials[0]):
            given = [m[i] for m in materials]
            if any(not value.is_constant for value in given) or all(value is first for value in given):
                self.fixed[i] = first
                continue
            names.append(var(f"value {i}", first.type))
            values.append(np.array([value.data for value in given], np.float64))
        self.count = len(materials[0])
        self.packing = Packing(names, 1)
        values.append(np.array(numbers, np.float64))
        self.table = Table(self.packing.table(values, len(materials)), f"{len(materials):,} materials")

    def read(self, row: Expr) -> list[Expr]:
        """The values of a material in order, and its number in the scene."""
        first = row * float(self.packing.texels)
        texels = [fetch(self.table, first + float(i)) for i in range(self.packing.texels)]
        read = iter(self.packing.read(texels))
        return [*(self.fixed[i] if i in self.fixed else next(read) for i in range(self.count)), next(read)]


class RowMaterial:
    """The label of a part whose material is a row of a palette."""

    def __init__(self, palette: Palette, row: Expr) -> None:
        *self.expressions, self.number = palette.read(row)


def chosen_by(terms: Sequence[Term], leaf: Callable[[Sequence[Term]], Expr], default: Expr) -> Expr:
    """The value of the part that decides, as a choice where the weights are; `leaf` joins the values of several."""
    terms = [(weight, value) for weight, value in terms if not (weight.is_constant and float(weight.data) == 0.0)]
    if not terms:
        return default
    first = terms[0][0]
    if first.op == "where" and all(w.op == "where" and w.args[0] is first.args[0] for w, _ in terms):
        yes, no = ([(weight.args[k], value) for weight, value in terms] for k in (1, 2))
        return where(first.args[0], chosen_by(yes, leaf, default), chosen_by(no, leaf, default))
    return leaf(terms)


def mean(terms: Sequence[Term]) -> Expr:
    """The weighted mean of some values; of structs, that of each field."""
    first = terms[0][1]
    if all(value is first for _, value in terms):
        return first
    if first.type.fields:
        names = [name for name, _ in first.type.fields]
        return record(first.type, *[mean([(w, get(value, name)) for w, value in terms]) for name in names])
    total = reduce(add_choices, [weight for weight, _ in terms])
    products = [map_choices(lambda w, v=value: w * v, weight) for weight, value in _summed(terms)]  # type: ignore[misc]
    return reduce(add_choices, products) / (total if total.is_constant else where(total <= 0.0, 1.0, total))


def largest(terms: Sequence[Term]) -> Expr:
    best, result = const(-1.0), const(0.0)
    for weight, value in _summed(terms):
        result = where(best < weight, value, result)
        best = where(best < weight, weight, best)
    return result


def _summed(terms: Sequence[Term]) -> list[Term]:
    """The terms with the weights of equal values added."""
    sums: dict[Expr, Expr] = {}
    for weight, value in terms:
        sums[value] = add_choices(sums[value], weight) if value in sums else weight
    return [(weight, value) for value, weight in sums.items()]


def read_where(values: Sequence[Expr], weight: Expr) -> Sequence[Expr]:
    """The values of a part's material; its textures are read only where its weight is above 0."""
    if weight.is_constant or not find(values, "texture"):
        return values
    visible = map_choices(lambda w: where(w <= 0.0, 0.0, 1.0), weight)

    def rule(node: Expr, args: tuple[Expr, ...]) -> Expr:
        return rebuild(node, (*args[:3], visible * args[3]) if node.op == "texture" else args)

    new = rewrite(values, rule)
    return [new[value] for value in values]
