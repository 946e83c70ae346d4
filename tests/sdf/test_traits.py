"""What an operator declares of itself (`definition.Placing`), held by numbers: of its function as it was traced."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import raymarch
from raymarch.expr.arrays import evaluator
from raymarch.expr.node import Expr, const, var
from raymarch.expr.types import FLOAT
from raymarch.expr.walk import find, substitute
from raymarch.sdf import Node
from raymarch.sdf.booleans import blend_of
from raymarch.sdf.definition import PLACED
from tests.support.node_samples import samples

POINTS = 400

OPERATORS = [s for s in samples() if s.definition.arity != "none"]


class Traced:
    """The function of a node with a free number in place of each evaluation of a child."""

    def __init__(self, node: Node) -> None:
        template = node.definition.template(len(node.children), node.params)
        self.asked: list[Expr] = find([template.body], "apply")
        self.free = [var(f"value {i}", FLOAT) for i in range(len(self.asked))]
        roots = [template.body, *(e.args[0] for e in self.asked)]
        opened = [substitute([root], dict(zip(self.asked, self.free, strict=True)))[0] for root in roots]
        opened = substitute(opened, node.definition.named(template, node.params))
        self.run = evaluator(opened, [template.params[0], *self.free])
        low, high = (np.nan_to_num(side, posinf=2.0, neginf=-2.0) for side in node.bounds)
        self.points = np.random.default_rng(3).uniform(low - 0.3, high + 0.3, (POINTS, node.dimension))
        self.values = np.random.default_rng(4).uniform(-1.0, 2.0, (len(self.free), POINTS))

    def at(self, points: NDArray[np.float64], values: NDArray[np.float64]) -> list[NDArray[np.float64]]:
        """The value of the node, and the point of each evaluation of a child."""
        value, *asked = self.run(points, *values)
        return [np.broadcast_to(value, (POINTS,)), *(np.broadcast_to(q, (POINTS, q.shape[-1])) for q in asked)]

    @property
    def value(self) -> NDArray[np.float64]:
        return self.at(self.points, self.values)[0]

    def factors(self) -> NDArray[np.float64]:
        """How much the value changes with that of the only evaluation; NaN if it is not a multiple of it."""
        once, twice = (self.at(self.points, v)[0] for v in (self.values, 2.0 * self.values))
        return np.where(np.isclose(twice, 2.0 * once, rtol=1e-9, atol=0), once / self.values[0], np.nan)

    def lengths(self, step: float = 1e-3) -> Iterator[NDArray[np.float64]]:
        """By what factor the map to the point of each evaluation changes the lengths of random short steps."""
        way = np.random.default_rng(5).normal(size=self.points.shape)
        way *= step / np.linalg.norm(way, axis=-1, keepdims=True)
        for here, there in zip(*(self.at(p, self.values)[1:] for p in (self.points, self.points + way)), strict=True):
            yield np.linalg.norm(there - here, axis=-1) / step

    def is_here(self) -> bool:
        """Whether every evaluation is at the point itself."""
        return all(np.array_equal(point, self.points) for point in self.at(self.points, self.values)[1:])

    def is_affine(self) -> bool:
        """Whether the point of the only evaluation is an affine map of the point."""
        far = self.points[::-1]
        ends = [self.at(p, self.values)[1] for p in (self.points, far, 0.5 * (self.points + far))]
        return bool(np.allclose(0.5 * (ends[0] + ends[1]), ends[2], atol=1e-9))


def is_rigid(traced: Traced) -> bool:
    (change,) = traced.lengths()
    return bool(np.allclose(traced.factors(), 1.0) and np.allclose(change, 1.0, atol=1e-6)) and traced.is_affine()


def is_scale(traced: Traced) -> bool:
    (change,), factors = traced.lengths(), traced.factors()
    even = np.allclose(factors, factors[0]) and np.allclose(factors * change, 1.0, atol=1e-6)
    return bool(even) and traced.is_affine()


def is_stretch(traced: Traced) -> bool:
    (change,), factors = traced.lengths(), traced.factors()
    return bool(np.allclose(factors, factors[0]) and np.ptp(change) > 0.01) and traced.is_affine()


def is_select(traced: Traced) -> bool:
    """The size of the value is that of some evaluation, and their points are moved without a change of lengths, but
    for steps across the planes where the choice changes."""
    sizes = np.abs(traced.values)
    same = np.any(np.abs(traced.value) == sizes, axis=0).all()
    return bool(same) and all(np.mean(np.abs(change - 1.0) < 1e-6) > 0.95 for change in traced.lengths())


def is_union(traced: Traced) -> bool:
    return len(traced.free) > 1 and traced.is_here() and bool(np.all(traced.value == traced.values.min(axis=0)))


def is_blend(traced: Traced) -> bool:
    """No more than the least value, less where two are close for some points."""
    least = traced.values.min(axis=0)
    return bool(np.all(traced.value <= least + 1e-12) and np.any(traced.value < least - 1e-3))


def is_offset(traced: Traced) -> bool:
    """The value outside of the solid less that of the child is one length."""
    outside = np.abs(traced.values)
    moved = traced.at(traced.points, outside)[0] - outside[0]
    return bool(np.allclose(moved, moved[0])) and traced.is_here()


def is_deform(traced: Traced) -> bool:
    """Lengths change by more than a hundredth, from place to place."""
    (change,) = traced.lengths()
    return bool(np.ptp(change) > 0.01) and not traced.is_affine()


HELD = {
    "rigid": is_rigid,
    "scale": is_scale,
    "stretch": is_stretch,
    "select": is_select,
    "union": is_union,
    "blend": is_blend,
    "offset": is_offset,
    "deform": is_deform,
}


@cache
def nodes() -> list[tuple[str, Node]]:
    return [(sample.definition.name, sample.build()) for sample in OPERATORS]


def built(name: str = "") -> list[tuple[str, Node]]:
    """The samples with a trait, or those without any, with the names of their definitions."""
    return [(called, node) for called, node in nodes() if node.placed_as == name]


traced_of = cache(Traced)


@pytest.mark.parametrize("trait", HELD)
def test_an_operator_is_what_it_declares(trait: str) -> None:
    found = built(trait)
    assert found, f"no operator is {trait!r}"
    for name, node in found:
        assert HELD[trait](traced_of(node)), f"{name} is not {trait!r}: {node}"


@pytest.mark.parametrize("trait", ["rigid", "scale", "stretch", "union", "offset"])
def test_an_operator_declares_what_it_is(trait: str) -> None:
    for name, node in built():
        traced = traced_of(node)
        flat = node.dimension != node.children[0].dimension
        if trait == "union" or (len(traced.asked) == 1 and not flat):
            assert not HELD[trait](traced), f"{name} is {trait!r}, and does not say so: {node}"


def test_a_placed_operator_tells_where_its_child_is() -> None:
    for trait in PLACED:
        for _, node in built(trait):
            point, child, factor = node.definition.placement(node.params)
            at = np.random.default_rng(6).uniform(-1.5, 1.5, (200, node.dimension))
            q, by = evaluator([child, const(1.0) if factor is None else factor], [point])(at)
            wanted = by * node.children[0].distance(np.broadcast_to(q, at.shape)) / node.facts.divisor
            np.testing.assert_allclose(node.distance(at), wanted, atol=1e-12)


def test_a_blend_does_not_act_beyond_its_reach() -> None:
    for _, node in built("blend"):
        if (blend := blend_of(node)) is None:
            continue
        traced = traced_of(node)
        apart = blend.reach * float(blend.width.data) * (1.0 + 1e-9)
        order = np.random.default_rng(7).permuted(np.tile(np.arange(len(traced.free)), (POINTS, 1)), axis=1).T
        values = traced.values[:1] + apart * order
        np.testing.assert_allclose(traced.at(traced.points, values)[0], values.min(axis=0), atol=1e-12)


def names_an_operator(node: ast.AST) -> bool:
    """Whether a piece of code looks a definition up, or compares one with another or with a name."""
    if isinstance(node, ast.Name):
        return node.id in ("definition_of", "REGISTRY")
    return isinstance(node, ast.Compare) and any(
        ast.unparse(part).endswith((".definition", ".definition.name", ".definition.called"))
        for part in (node.left, *node.comparators)
    )


def test_no_layer_above_asks_for_an_operator_by_name() -> None:
    assert names_an_operator(ast.parse("a.definition is union.definition", mode="eval").body)
    package = Path(raymarch.__file__).parent
    above = [file for file in package.rglob("*.py") if "sdf" not in file.relative_to(package).parts]
    found = [
        f"{file.relative_to(package)}:{getattr(node, 'lineno', 0)}"
        for file in above
        for node in ast.walk(ast.parse(file.read_text()))
        if names_an_operator(node)
    ]
    assert found == []
