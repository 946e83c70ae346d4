"""Functions that find the objects of a point through cells, and evaluate them."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from raymarch.errors import Doubt
from raymarch.expr.arrays import Remembered, bound
from raymarch.expr.derivative import companion, gradient, state_gradient
from raymarch.expr.function import Function, loop
from raymarch.expr.node import Expr, const, construct, expr, swizzle, var
from raymarch.expr.partials import zero
from raymarch.expr.tables import MOST, LiveTable, Table, fetch
from raymarch.expr.types import FLOAT, VEC3
from raymarch.expr.vocabulary import all_of, clamp, dot, floor, length, normalize, where
from raymarch.expr.walk import rebuild, rewrite, substitute, topological
from raymarch.plan.bounding import nearer, none_of
from raymarch.plan.cells import Cells
from raymarch.plan.kept_cells import build
from raymarch.plan.lists import PAIRS
from raymarch.plan.narrow import narrow
from raymarch.prices import STANDARD, Prices
from raymarch.scene.legal import solid_at
from raymarch.scene.parameter import Values
from raymarch.scene.reading import exact_distance, read_as_distance, reads_field, touching_glass, touching_materials
from raymarch.scene.scene import Scene, all_nodes
from raymarch.scene.studio import in_studio
from raymarch.sdf.advance import is_implicit
from raymarch.sdf.blends import FAMILIES
from raymarch.sdf.facts import FARTHEST
from raymarch.sdf.labels import seen_labels
from raymarch.sdf.levels import CORRECTED, flush_cut, least_slope, short_tool
from raymarch.sdf.node import Node
from raymarch.sdf.rows import Rows, Slot

TURNS = 256
"""Least bound of the loops over a list and its folds: llvmpipe unrolls loops of few turns, and then executes all turns.
With 20,000 objects a frame took 1.6 times as long with a bound of 8 turns as with one of 12 or 256."""

_KEPT = 4
_built: OrderedDict[tuple[Rows, float, Prices, bool], Located] = OrderedDict()
"""The cells that were built last, by content."""

COINCIDE = 1000
"""Objects of a cell from which they are doubted."""

Carried: TypeAlias = Callable[[int, Expr, Sequence[Expr]], Sequence[Expr]]
Mixed: TypeAlias = Callable[[Expr, Expr, Sequence[Expr], Sequence[Expr]], Sequence[Expr]]


DISTANT = "Quality(integrator='path') or penumbra='sampled' does not read distances"


def misread(scene: Scene, values: Values | None = None) -> list[Doubt]:
    """Doubts about effects that read the field as a distance, where it is shorter or falls to 0 without a surface.

    values : of a frame; without, parameters have their defaults.
    """
    if in_studio(scene):
        return []
    effect = "AmbientOcclusion" if scene.occlusion is not None else ""
    if any(map(reads_field, scene.lights)):
        effect = effect or "a penumbra"
    found = [*_wide_paths(scene), *_inner_faces(scene)]
    if not effect:
        return found
    found += narrow(scene)
    read = read_as_distance(scene, scene.node)
    read = read if values is None else solid_at(read, values)
    if (node := flush_cut(read)) is not None:
        what = f"{node.name} cuts flush with a face, where {effect} reads a membrane of no thickness that is not drawn"
        found.append(Doubt("plan", what, "a tool that reaches beyond the face", where=node.where))
    elif (short := short_tool(read, 0.5 * exact_distance(scene))) is not None:
        what = (
            f"{short[0].name} ends {short[1]:.2g} beyond a face that it cuts, where {effect} reads the end of the tool"
        )
        cure = f"a tool that reaches {0.5 * exact_distance(scene):.2g} beyond the face"
        found.append(Doubt("plan", what, cure, where=short[0].where))
    implicit = next((node for node in all_nodes(scene.node) if is_implicit(node)), None)
    if implicit is not None:
        what = (
            f"{effect} reads an implicit surface as a distance, which it is to first order at the surface only: light"
        )
        found.append(
            Doubt("plan", f"{what} is off by .05 to .2 on average, and by up to .9", DISTANT, where=implicit.where)
        )
    least = least_slope(scene.node)
    if least == 1.0:
        return found
    what = f"{effect} reads a field that is {least:.2g} times the distance near a surface that is scaled or bent"
    so = "this is corrected to first order there, so it is too dark" if least < CORRECTED else "it is too dark there"
    return [*found, Doubt("plan", f"{what}; {so}", DISTANT)]


def _inner_faces(scene: Scene) -> list[Doubt]:
    """The doubt about glass solids that touch, where glass also touches what is no glass, and about solids that touch
    and scatter light below their surface."""
    waxen = scene.path_traced and any(m.scatters for m in scene.materials)
    if waxen and any(all(m.scatters for m in of) for of in touching_materials(scene, scene.node)):
        what = "solids that scatter light below their surface touch at a face, which that light does not pass"
        return [Doubt("plan", what, "solids that overlap a little", where=scene.node.where)]
    if touching_glass(scene, scene.node) != {True, False}:
        return []
    what = "glass solids touch at a face, and glass stands on a face of another material: rays see both faces"
    return [Doubt("plan", what, "glass solids that overlap a little", where=scene.node.where)]


def _wide_paths(scene: Scene) -> list[Doubt]:
    """The doubt about paths whose rays end so early that thin solids pass light."""
    epsilon = scene.quality.epsilon or 0.0
    if not scene.bounces or scene.quality.integrator != "path" or epsilon < 1.0:
        return []
    what = f"Quality(epsilon={epsilon:g}) with bounces: light between thin solids is off by up to 10 %"
    return [Doubt("plan", what, "an epsilon below 1")]


def crowded(found: Sequence[Located]) -> list[Doubt]:
    """Doubts about objects of which no cell tells apart more than `COINCIDE`."""
    most = max((each.cells.most for each in found if not each.rows.live), default=0)
    if most < COINCIDE:
        return []
    what = f"up to {most:,} objects nearly coincide, so that each evaluation there asks all of them"
    cure = "leave out those that others hide, or blend less widely; software drivers end the loops of a pixel after "
    return [Doubt("plan", what, cure + "65,535 turns")]


@dataclass(frozen=True, eq=False)
class Many:
    """The label of a mark that stands for many objects.

    inherited : the material of objects without one. expressions : those of all their materials.
    """

    rows: Rows
    inherited: Any

    @property
    def expressions(self) -> list[Expr]:
        materials = dict.fromkeys(self.inherited if m is None else m for m in self.rows.labels)
        return [value for material in materials for value in material.expressions]


@dataclass(eq=False)
class ObjectsInCells:
    """Evaluates rows through cells; see `raymarch.sdf.lower.Objects`.

    exact : for each of the rows, the distance up to which its field must be exact. prices, branches : of the device.
    """

    exact: Mapping[Rows, float]
    prices: Prices = STANDARD
    branches: bool = False
    _labels: dict[Any, Many] = field(default_factory=dict)

    def located(self, rows: Rows) -> Located:
        """The rows with their cells, which are built once for equal rows."""
        key = (rows, self.exact[rows], self.prices, self.branches)
        if key not in _built:
            with bound({}, 0.0):
                _built[key] = Located(*key)
            while len(_built) > _KEPT:
                _built.popitem(last=False)
        _built.move_to_end(key)
        return _built[key]

    def distance(self, rows: Rows) -> Function:
        return self.located(rows).field

    def label(self, rows: Rows, inherited: Any) -> Many:
        return self._labels.setdefault((rows, inherited), Many(rows, inherited))


class Located:
    """Rows with their cells, and the functions that read them.

    field : the distance, a function of the point; its companion is the gradient.
    found : of a hard union on devices that skip the side of a branch that is not taken, a function of the point: the
        distance, and where the row of the nearest object begins; -1 where the field is a bound only. Others would
        evaluate the gradients of all forms after the distances: costly.py took 7 % longer for a frame, 17 % for the
        first.
    """

    found: Function | None = None

    def __init__(self, rows: Rows, exact: float, prices: Prices = STANDARD, branches: bool = False) -> None:
        """exact : distance up to which the field must be exact. prices, branches : of the device."""
        self.rows, self.cells, self.together = rows, build(rows, exact, prices), prices.forms_together
        self.page, self.counted = MOST, 0.0
        self.pages: list[Table | LiveTable]
        self.texels: Table | LiveTable
        if rows.live:
            now = Remembered(lambda: (_listed(rows, made := build(rows, exact, prices)), made.texels), rows.live)
            self.cells = self.cells.widened(len(rows))
            self.pages = [_live(rows, exact, lambda: now()[0], "lists of objects")]
            self.texels = _live(rows, exact, lambda: now()[1], "cells of objects")
        else:
            self._divide(self.cells)
        p = var("p", VEC3)
        place = _Place(self, p)
        self.point, self.place = p, place
        if rows.family:
            (value,) = self.walk(place, p, None)
        else:
            (value,) = self._nearest(p, None, place.bound)
            if branches:
                told = self._nearest(p, None, place.bound, const(-1.0))
                self.found = Function("objects_found", (p,), construct(*told))
        self.field = Function("objects", (p,), value)
        value, slope = self.walk(place, p, lambda i, entry, read: ())
        state_gradient(self.field, construct(slope, value))

    def _divide(self, cells: Cells) -> None:
        """Tables of the lists and the cells. Float32 numbers `MOST` entries: longer lists are divided into pages, which
        overlap by the longest list."""
        listed = _listed(self.rows, cells)
        self.page = MOST - cells.most
        starts = range(0, len(listed), self.page)
        self.pages = [Table(listed[i : i + MOST], "lists of objects") for i in starts]
        self.counted = float(2 ** int(np.ceil(np.log2(cells.most + 1))))
        texels = cells.texels
        if len(self.pages) > 1:
            own = texels[:, 1] > 0
            page = cells.starts // self.page
            texels = texels.copy()
            texels[own, 0] = cells.starts - page * self.page
            texels[own, 1] += self.counted * page
        self.texels = Table(texels, "cells of objects")

    def walk(self, place: _Place, p: Expr, carried: Carried | None, mixed: Mixed | None = None) -> tuple[Expr, ...]:
        """The union of the objects in the cell of a point: the distance, the gradient, and what else is carried.

        carried : further values of an object: a function of its form, the start of its row, and its columns and slots.
            They and the gradient are those of the nearest object, evaluated once it is known where `found` tells it, or
            mixed in a blend; where the field is a bound only, the gradient of the bound and zeros. None, in a blend,
            for the distance alone.
        mixed : how a blend mixes the further values of two operands, from the partial derivatives of the fold by each;
            None for their sum with the derivatives as weights.
        """
        if self.rows.family:
            value, *others = self._blended(place, p, carried, mixed)
            listed = place.near | (value < place.bound)
            if others:
                others[0] = where(listed, others[0], place.bound_slope)
            return where(listed, value, place.bound), *others
        assert carried is not None
        if self.found is None:
            return self._nearest(p, carried, place.bound, place.bound_slope, *self._zeros(p, carried)[2:])
        found = self.found(p)
        value, entry = swizzle(found, "x"), swizzle(found, "y")
        _, *others = self._leaf(p, where(entry < 0.0, 0.0, entry), carried, range(len(self.rows.forms)))
        none = [place.bound_slope, *(zero(other.type) for other in others[1:])]
        return value, *(where(entry < 0.0, no, other) for no, other in zip(none, others, strict=True))

    def entry(self, place: _Place, at: Expr) -> Expr:
        """The texel of an entry of the list of a cell."""
        found = fetch(self.pages[0], at)
        for number, page in enumerate(self.pages[1:], 1):
            found = where(place.page < number - 0.5, found, fetch(page, at))
        return found

    def _leaf(self, p: Expr, entry: Expr, carried: Carried | None, forms: Sequence[int]) -> list[Expr]:
        """The distance of the object whose row begins at `entry`, the gradient and what else is carried; of one of some
        forms. Of these, only the form of the object is evaluated."""
        stored, per_form = self.rows.stored, []
        for i in forms:
            field, read = self.rows.forms[i].columns.field, stored.read(i, entry)
            columns = read[: len(field.params) - 1]
            if carried is None:
                per_form.append([field(p, *columns)])
            else:
                per_form.append([companion(field)(p, *columns), *carried(i, entry, read)])
        last = per_form[-1]
        for i, values in zip(reversed(forms[:-1]), reversed(per_form[:-1]), strict=True):
            mine = entry < float(stored.first[i + 1])
            last = [where(mine, one, other) for one, other in zip(values, last, strict=True)]
        return last if carried is None else [swizzle(last[0], "w"), swizzle(last[0], "xyz"), *last[1:]]

    # Hard unions

    def _nearest(self, p: Expr, carried: Carried | None, *none: Expr) -> tuple[Expr, ...]:
        """The distance, and what else is carried of the nearest object; with `carried` None the start of its row.

        none : the values of no object, as many as are wanted.

        One loop over the list. Forms beyond the first `together` have loops of their own, with as many each: all forms
        of a loop are evaluated for each object.
        """
        place, count = self.place, len(self.rows.forms)
        groups = [range(i, i + self.together)[: count - i] for i in range(0, count, self.together)]
        if len(groups) == 1:

            def step(_turn: Expr, at: Expr, *best: Expr) -> Sequence[Expr]:
                entry = self.entry(place, at)
                found = self._leaf(p, entry, carried, groups[0])
                return at + 1.0, *nearer([*found, entry][: len(best)], best)

            return loop(max_turns(self.cells), (place.start, *none), step, lambda _turn, at, *_: at >= place.end)[1:]
        state: tuple[Expr, ...] = (place.start, self.entry(place, place.start), *none)
        for group in groups:
            most = float(self.rows.stored.first[group[-1] + 1])

            def turn(_turn: Expr, at: Expr, entry: Expr, *best: Expr, group: Sequence[int] = group) -> Sequence[Expr]:
                found = self._leaf(p, entry, carried, group)
                return at + 1.0, self.entry(place, at + 1.0), *nearer([*found, entry][: len(best)], best)

            def until(_turn: Expr, at: Expr, entry: Expr, *_: Expr, most: float = most) -> Expr:
                return (at >= place.end) | (entry >= most)

            state = loop(max_turns(self.cells), state, turn, until)
        return state[2:]

    # Blends

    def _zeros(self, p: Expr, carried: Carried | None) -> list[Expr]:
        """The values of no object."""
        return [const(FARTHEST)] if carried is None else none_of(self._leaf(p, const(0.0), carried, range(1)))

    def _blended(self, place: _Place, p: Expr, carried: Carried | None, mixed: Mixed | None) -> tuple[Expr, ...]:
        """One loop over the list, with a stack of the values that wait for their partner. After an object, as many
        values are folded as end with it."""
        rows, forms = self.rows, range(len(self.rows.forms))
        a, b, width = var("a", FLOAT), var("b", FLOAT), var("k", FLOAT)
        folded = FAMILIES[rows.family](4).fold(a, b, width)
        by_a, by_b = gradient(folded, a), gradient(folded, b)

        def merge(left: Sequence[Expr], right: Sequence[Expr]) -> list[Expr]:
            known = {a: left[0], b: right[0], width: expr(rows.k)}
            value, wa, wb = substitute([folded, by_a, by_b], known)
            if mixed is not None:
                return [value, *mixed(wa, wb, left[1:], right[1:])]
            return [value, *(wa * x + wb * y for x, y in zip(left[1:], right[1:], strict=True))]

        zeros = self._zeros(p, carried)
        size = len(zeros)

        def step(_turn: Expr, at: Expr, *held: Expr) -> Sequence[Expr]:
            texel = self.entry(place, at)
            value, folds = self._leaf(p, swizzle(texel, "x"), carried, forms), swizzle(texel, "y")

            def join(_turn: Expr, *state: Expr) -> Sequence[Expr]:
                merged = merge(state[size : 2 * size], state[:size])
                return (*merged, *state[2 * size :], *zeros)

            done = loop(max_folds(self.cells), (*value, *held[size:]), join, lambda turn, *_: turn >= folds)
            # The result lies on top of the stack of the next turn.
            return (at + 1.0, *done[:size], *done[:size], *done[size : len(done) - size])

        start = (place.start, *zeros, *(zeros * self.cells.stack))
        final = loop(max_turns(self.cells), start, step, lambda _turn, at, *_: at >= place.end)
        return final[1 : 1 + size]


def with_rows(roots: Sequence[Expr], found: Mapping[Function, Function]) -> list[Expr]:
    """The roots, with distances taken from what also finds the nearest row, where this is called at the same point.

    found : what also finds the row, by the distance; see `Located`.
    """
    called = {(call.data, call.args) for call in topological(roots) if call.op == "call"}

    def rule(node: Expr, args: tuple[Expr, ...]) -> Expr:
        both = found.get(node.data) if node.op == "call" else None
        return swizzle(both(*args), "x") if both and (both, node.args) in called else rebuild(node, args)

    new = rewrite(roots, rule) if found else {root: root for root in roots}
    return [new[root] for root in roots]


def _listed(rows: Rows, cells: Cells) -> NDArray[np.float32]:
    """The texel at which the row of each entry of the lists begins; in a blend, also the number of folds after it."""
    firsts = np.cumsum([0, *map(len, rows.forms)])
    listed = np.zeros((max(1, len(cells.lists)), 2 if rows.family else 1), np.float32)
    texel_of = np.array([rows.stored.texel_of(i, -firsts[i]) for i in range(len(rows.forms))])
    strides = np.array([packing.texels for packing in rows.stored.packings])
    for begin in range(0, len(cells.lists), PAIRS):
        some = cells.lists[begin : begin + PAIRS]
        form_of = np.searchsorted(firsts, some, side="right") - 1
        listed[begin : begin + PAIRS, 0] = texel_of[form_of] + strides[form_of] * some
    if rows.family:
        listed[:, 1] = cells.merges
    return listed


def _live(rows: Rows, exact: float, texels: Callable[[], NDArray[np.float32]], label: str) -> LiveTable:
    """A table of rows that are live."""
    return LiveTable(Remembered(lambda: Table(texels(), label), rows.live), label, rows.name(label, exact))


def max_turns(cells: Cells) -> int:
    """Constant bound of the loops over a list: compilers handle a variable bound badly."""
    return int(np.maximum(cells.most, TURNS))


def max_folds(cells: Cells) -> int:
    """Constant bound of the loop over the folds after an object."""
    return max(int(cells.merges.max(initial=1)), TURNS)


class _Place:
    """The cell of a point.

    start, end, page : its list; in a far cell and outside of the grid that of unbounded objects.
    near : True if it has a list of its own.
    bound : a lower bound of the objects that are not in the list, and `bound_slope` its gradient.
    """

    def __init__(self, located: Located, p: Expr) -> None:
        cells, texels = located.cells, located.texels
        counts = cells.counts.astype(float)
        q = (p - tuple(cells.low)) * (1.0 / cells.size)
        inside = all_of(*[condition for i in range(3) for condition in (q[i] >= 0.0, q[i] < float(counts[i]))])
        cell = clamp(floor(q), 0.0, tuple(counts - 1.0))
        index = dot(cell, (1.0, float(counts[0]), float(counts[0] * counts[1])))
        fine: Expr = const(1.0)
        found = fetch(texels, index)
        for _ in range(cells.depth):
            # Straight text: as a loop with a break, this makes frames half as long again on llvmpipe.
            x, y = swizzle(found, "x"), swizzle(found, "y")
            branch = abs(y) < 0.5
            child = clamp(floor(q * (2.0 * fine)) - 2.0 * cell, 0.0, 1.0)
            index = where(branch, x + dot(child, (1.0, 2.0, 4.0)), index)
            cell, fine = where(branch, 2.0 * cell + child, cell), where(branch, 2.0 * fine, fine)
            found = fetch(texels, index)
        x, y = swizzle(found, "x"), swizzle(found, "y")
        self.near = inside & (y > 0.5)
        first, count = cells.unbounded
        self.page: Expr = const(0.0)
        if len(located.pages) > 1:
            self.page = where(self.near, floor(y * (1.0 / located.counted)), float(first // located.page))
            y, first = y - located.counted * self.page, first % located.page
        self.start = where(self.near, x, float(first))
        self.end = where(self.near, x + y, float(first + count))
        away = p - ((cell + 0.5) * (cells.size / fine) + tuple(cells.low))
        out = p - clamp(p, tuple(cells.inner_low), tuple(cells.inner_high))
        beyond = length(out) * cells.steepness - cells.less
        unlisted = const(FARTHEST) if located.rows.family else cells.need + (cells.cut * cells.size) / fine
        self.bound = where(inside, where(self.near, unlisted, x) - length(away), beyond)
        self.bound_slope = where(inside, -normalize(away), normalize(out) * cells.steepness)


def only_slot(template: Node) -> int | None:
    """The slot that all parts of a form have; None if they differ."""
    labels = seen_labels(template) if template.labelled else {Slot(0)}
    if template.labelled and template.label is None:
        return None  # some parts may have no label
    (first, *others) = labels
    return first.index if not others and isinstance(first, Slot) else None
