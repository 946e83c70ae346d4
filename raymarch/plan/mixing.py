"""Material values of several parts as one: a choice, a mean by weights, or rows of a table."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import reduce
from typing import TypeAlias

import numpy as np

from raymarch.expr.adjoints import add_choices, map_choices
from raymarch.expr.choices import FEW, merge_reads
from raymarch.expr.derivative import share_values
from raymarch.expr.function import Function, loop
from raymarch.expr.node import Expr, const, var
from raymarch.expr.tables import Table, fetch
from raymarch.expr.types import FLOAT, Type, struct
from raymarch.expr.vocabulary import get, parts_of, record, where
from raymarch.expr.walk import find, free_variables, rebuild, rewrite
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


def mean_in_turn(terms: Sequence[Term]) -> Expr:
    """The same mean, in a loop over the parts whose weight is above 0.

    A turn evaluates the part of an index, as the choice of one of them. So one look-up reads the pictures of all parts,
    where a sum has one for each, and drivers take a time to compile that grows faster than their number.
    """
    type = terms[0][1].type
    columns = [[get(value, name) for _, value in terms] for name, _ in type.fields] or [[value for _, value in terms]]
    differing = [i for i, column in enumerate(columns) if any(value is not column[0] for value in column)]
    wanted = [columns[i] for i in differing]
    index, weights = var("part", FLOAT), [weight for weight, _ in terms]
    if len(wanted) == 1:
        values = list(wanted[0])
    else:
        mixed = struct(f"Mixed{type.name}", tuple(type.fields[i] for i in differing))
        values = [record(mixed, *row) for row in zip(*wanted, strict=True)]
    (body,) = share_values(merge_reads([_of_index(index, values)]))
    part = Function("part_of_blend", (index, *(v for v in free_variables([body]) if v is not index)), body)

    def following(at: Expr) -> Expr:
        found = const(float(len(terms)))
        for k in reversed(range(len(terms))):
            found = where((weights[k] > 0.0) & (at < k - 0.5), float(k), found)
        return found

    def step(_i: Expr, at: Expr, *sums: Expr) -> Sequence[Expr]:
        value, weight = part(at, *part.params[1:]), _of_index(at, weights)
        each = [value] if len(wanted) == 1 else list(parts_of(value))
        return [following(at), *(total + weight * v for total, v in zip(sums, each, strict=True))]

    start = [following(const(-1.0)), *(const(np.zeros(column[0].type.shape)) for column in wanted)]
    _, *sums = loop(len(terms), start, step, until=lambda _i, at, *_sums: at > len(terms) - 0.5)
    total = reduce(add_choices, weights)
    whole = total if total.is_constant else where(total <= 0.0, 1.0, total)
    means = dict(zip(differing, [each / whole for each in sums], strict=True))
    found = [means.get(i, column[0]) for i, column in enumerate(columns)]
    return record(type, *found) if type.fields else found[0]


def _of_index(index: Expr, values: Sequence[Expr], first: int = 0) -> Expr:
    """The value of an index, by a balanced tree of choices."""
    if all(value is values[0] for value in values):
        return values[0]
    half = len(values) // 2
    return where(
        index < first + half - 0.5,
        _of_index(index, values[:half], first),
        _of_index(index, values[half:], first + half),
    )


def blended(unread: Mapping[Expr, Expr], terms: Sequence[Term]) -> Expr:
    """The mean of some values: a sum, or a loop if they read many pictures.

    unread : the values without a condition on their weight, by those whose textures are read where it is above 0.
    """
    if len({node.data for node in find([value for _, value in terms], "texture")}) <= FEW:
        return mean(terms)
    return mean_in_turn([(weight, unread.get(value, value)) for weight, value in terms])


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


def same_constants(values: Sequence[Expr]) -> dict[int, Expr]:
    """The parts of structs that are one constant in all, by their place."""
    if any(value.op != "record" for value in values):
        return {}
    columns = enumerate(zip(*[value.args for value in values], strict=True))
    return {k: parts[0] for k, parts in columns if parts[0].op == "const" and len(set(parts)) == 1}


def whole(type: Type, values: Sequence[Expr], same: Mapping[int, Expr]) -> Expr:
    """The value whose parts are some values and, at their places, some constants."""
    rest = iter(values)
    parts = [same[k] if k in same else next(rest) for k in range(max(len(type.fields), 1))]
    return record(type, *parts) if type.fields else parts[0]
