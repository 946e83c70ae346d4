"""Unions, intersections and differences: their values, their blends, and what their text is."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from raymarch.expr import const
from raymarch.expr.arrays import evaluator
from raymarch.expr.function import trace
from raymarch.expr.types import FLOAT, VEC3
from raymarch.gpu.context import Context
from raymarch.scene import Param
from raymarch.sdf import Node, box, capsule, difference, intersection, sphere, torus, union
from raymarch.sdf.blends import FAMILIES, smooth_min
from tests.support.glsl_harness import run
from tests.support.refusals import refused

POINTS = np.random.default_rng(1).uniform(-2, 2, (4000, 3))
A = box((1.0, 0.8, 1.2))
B = sphere(0.6).translate((0.5, 0.2, 0.1))
C = capsule((-1, 0, 0), (0, 1, 0.5), 0.2)


def values(*nodes: Node) -> np.ndarray:
    return np.array([node.distance(POINTS) for node in nodes])


# Hard


def test_a_node_has_no_truth_value() -> None:
    """`a and b` would be b, and `not a` False: a solid would be lost without a word."""
    for make in (lambda: A and B, lambda: A or B, lambda: not A, lambda: bool(A & B), lambda: any([A, B])):
        refused(make, "use a & b")
    assert [A] and A is not None and A in (A, B)


def test_values() -> None:
    a, b, c = values(A, B, C)
    np.testing.assert_array_equal(union(A, B, C).distance(POINTS), np.min([a, b, c], axis=0))
    np.testing.assert_array_equal(intersection(A, B, C).distance(POINTS), np.max([a, b, c], axis=0))
    np.testing.assert_array_equal(difference(A, B, C).distance(POINTS), np.max([a, -b, -c], axis=0))


@pytest.mark.parametrize(
    ("infix", "called", "method"),
    [
        (lambda: A | B, lambda: union(A, B), lambda: A.union(B)),
        (lambda: A & B, lambda: intersection(A, B), lambda: A.intersection(B)),
        (lambda: A - B, lambda: difference(A, B), lambda: A.difference(B)),
    ],
)
def test_three_ways_to_write_it(
    infix: Callable[[], Node], called: Callable[[], Node], method: Callable[[], Node]
) -> None:
    assert infix().glsl() == called().glsl() == method().glsl()


@pytest.mark.parametrize("combine", [union, intersection])
@pytest.mark.parametrize("order", [(1, 0, 2), (2, 1, 0), (1, 2, 0)])
def test_the_order_of_operands_changes_nothing(combine: Callable[..., Node], order: tuple[int, ...]) -> None:
    """A tie is decided the same way as well: min and max do not know who was first."""
    parts = (A, B, C)
    straight, turned = combine(*parts), combine(*[parts[i] for i in order])
    np.testing.assert_array_equal(straight.distance(POINTS), turned.distance(POINTS))
    np.testing.assert_array_equal(straight.bounds, turned.bounds)
    assert straight.exactness == turned.exactness


@pytest.mark.parametrize(
    "node", [box(1.0), sphere(0.5).translate((1, 0, 0)), A - B, A.union(B, k=0.2).rotate(0.3), torus().repeat(3.0)]
)
@pytest.mark.parametrize("combine", [union, intersection])
def test_a_solid_united_with_itself_has_its_own_text(combine: Callable[..., Node], node: Node) -> None:
    assert combine(node, node).glsl() == node.glsl()
    assert combine(node, node, node).glsl() == node.glsl()
    assert combine(node, node).exactness == node.exactness


def test_an_equal_copy_is_computed_once() -> None:
    assert (sphere(0.5) | sphere(0.5)).glsl().count("sphere(p") == 1


def test_a_solid_without_itself_is_empty() -> None:
    assert np.all((A - A).distance(POINTS) >= 0)


def test_nested_unions_are_one() -> None:
    d = sphere(0.3).translate((0, -1, 0))
    assert ((A | B) | (C | d)).glsl() == union(A, B, C, d).glsl() == (((A | B) | C) | d).glsl()
    assert ((A & B) & C).glsl() == intersection(A, B, C).glsl()


def test_exactness_of_unions() -> None:
    apart = sphere(0.4) | sphere(0.4).translate((1.0, 0, 0))
    touching = sphere(0.5) | sphere(0.5).translate((1.0, 0, 0))
    overlapping = sphere(0.6) | sphere(0.6).translate((1.0, 0, 0))
    assert [n.exactness for n in (apart, touching, overlapping)] == ["exact", "bound", "bound"]
    assert (A & B).exactness == (A - B).exactness == "bound"


def test_sign_where_solids_overlap() -> None:
    """Inside both, the union's distance is only a bound, but its sign is right."""
    a, b = values(A, B)
    assert np.all((union(A, B).distance(POINTS) < 0) == ((a < 0) | (b < 0)))
    assert np.all((intersection(A, B).distance(POINTS) < 0) == ((a < 0) & (b < 0)))
    assert np.all((difference(A, B).distance(POINTS) < 0) == ((a < 0) & (b > 0)))


def test_bounds() -> None:
    apart = sphere(0.5).translate((-2, 0, 0))
    low, high = union(apart, B).bounds
    np.testing.assert_allclose(low, [-2.5, -0.5, -0.5])
    np.testing.assert_allclose(high, [1.1, 0.8, 0.7])
    np.testing.assert_array_equal((A - B).bounds, A.bounds)
    assert (sphere(0.5) & apart).facts.empty
    assert not (A & B).facts.empty


def test_one_operand_is_itself() -> None:
    assert union(A) is A
    assert difference(A) is A
    assert intersection(A, k=0.3) is A


# Smooth

_random = np.random.default_rng(2)
FIRST, SECOND = _random.uniform(-2, 2, (2, 5000))


def blend(a: Any, b: Any, k: float) -> np.ndarray:
    value = evaluator([smooth_min.body], smooth_min.params)(a, b, np.full(np.shape(a), k))[0]
    return np.asarray(value)


@pytest.mark.parametrize("k", [1e-4, 0.3, 2.0, 50.0])
def test_smooth_minimum(k: float) -> None:
    value, hard = blend(FIRST, SECOND, k), np.minimum(FIRST, SECOND)
    assert np.all(value <= hard)
    assert np.all(hard - value <= k / 4 + 1e-12)
    far = np.abs(FIRST - SECOND) >= k
    np.testing.assert_array_equal(value[far], hard[far])
    np.testing.assert_allclose(blend(FIRST, FIRST, k), FIRST - k / 4, atol=1e-12 * k)
    np.testing.assert_array_equal(value, blend(SECOND, FIRST, k))


def test_smooth_minimum_is_no_steeper_than_its_operands() -> None:
    other = _random.uniform(-2, 2, (2, 5000))
    rise = np.abs(blend(FIRST, SECOND, 0.5) - blend(*other, 0.5))
    assert np.all(rise <= np.max(np.abs(other - [FIRST, SECOND]), axis=0) + 1e-12)


def test_smooth_operations_come_near_the_hard_ones() -> None:
    for combine in (union, intersection, difference):
        off = combine(A, B, k=0.2).distance(POINTS) - combine(A, B).distance(POINTS)
        assert 0.01 < np.abs(off).max() <= 0.05 + 1e-12


def test_a_smooth_union_adds_and_a_smooth_cut_takes_away() -> None:
    assert np.all(union(A, B, k=0.3).distance(POINTS) <= union(A, B).distance(POINTS))
    assert np.all(intersection(A, B, k=0.3).distance(POINTS) >= intersection(A, B).distance(POINTS))
    assert np.all(difference(A, B, k=0.3).distance(POINTS) >= difference(A, B).distance(POINTS))


@pytest.mark.parametrize("zero", [0, 0.0, -0.0, np.float64(0), np.int64(0), const(0.0)])
@pytest.mark.parametrize("combine", [union, intersection, difference])
def test_k_zero_is_the_hard_operation(combine: Callable[..., Node], zero: Any) -> None:
    """The smooth formula divides by k: the solid would vanish and no NaN would be seen."""
    assert combine(A, B, C, k=zero).glsl() == combine(A, B, C).glsl()


@pytest.mark.parametrize("combine", [union, intersection, difference])
def test_a_parameter_may_make_k_zero(egl: Context, combine: Callable[..., Node]) -> None:
    """The solid of the hard operation, in float64 and in GLSL; also where both distances are equal, and far away."""
    k = Param("k", 0.0, 0, 1)
    points = np.concatenate([POINTS, np.repeat(POINTS[:400, :1], 3, axis=1), 1e4 * POINTS[:400]])
    hard = combine(A, A.translate((0.3, 0.3, 0.3)) | B).distance(points)
    for name in FAMILIES:
        node = combine(A, A.translate((0.3, 0.3, 0.3)) | B, k=k, blend=name)
        inner = np.where((hard < 0) == (combine is union), np.sqrt(0.5), 1.0)  # those that measure the diagonal
        for found, off in (
            (node.distance(points), 1e-12),
            (run(egl, node.glsl(), "field({0})", [(VEC3, points)], uniforms={"u_k": 0.0}), 1e-6),
        ):
            assert np.all(np.isfinite(found)), name
            scaled = found * node.facts.divisor
            assert np.all(np.abs(hard) * (1 - off) - off <= np.abs(scaled)), name
            assert np.all(np.abs(scaled) * inner <= np.abs(hard) * (1 + off) + off), name
            assert np.all((scaled < 0) == (hard < 0), where=np.abs(hard) > off), name
    refused(lambda: combine(A, B, k=Param("k", 0.5, -1, 1)), "between -1", "> 0")


def test_many_equal_operands_stay_within_the_bounds() -> None:
    """512 equal distances, k = .3: a tree of nine levels grows the solid by 9 k / 4 = .675."""
    blended = union(*[sphere(0.5) for _ in range(512)], k=0.3)
    np.testing.assert_allclose(blended.distance((0.0, 0.0, 0.0)), -0.5 - 0.675, atol=1e-12)
    low, high = blended.bounds
    np.testing.assert_allclose([low, high], [[-1.175] * 3, [1.175] * 3])
    np.testing.assert_allclose(blended.distance((1.175, 0, 0)), 0.0, atol=1e-12)


def test_the_order_in_a_smooth_chain_stays_within_the_bounds() -> None:
    random = np.random.default_rng(5)
    parts = [sphere(0.3).translate(tuple(random.normal(0, 0.4, 3))) for _ in range(12)]
    hard = union(*parts).distance(POINTS)
    first = union(*parts, k=0.4)
    for _ in range(4):
        turned = union(*[parts[i] for i in random.permutation(12)], k=0.4)
        np.testing.assert_array_equal(turned.bounds, first.bounds)
        off = hard - turned.distance(POINTS)
        assert np.all((off >= 0) & (off <= 4 * 0.1))
        inside = POINTS[turned.distance(POINTS) < 0]
        assert np.all((inside >= turned.bounds[0]) & (inside <= turned.bounds[1]))


def test_bounds_of_a_blend_hold_where_an_operand_rises_slowly() -> None:
    """A stretched ball reads .1 at a distance of 1: what is blended onto it reaches ten times as far."""
    long = sphere(0.5).scale((10.0, 1.0, 1.0))
    for grown in (union(long, long.translate((0, 0.1, 0)), k=1.0), long.round(0.25), long.shell(0.5)):
        tip = np.linspace(5.0, 20.0, 2000)[:, None] * (1, 0, 0)
        reach = tip[grown.distance(tip) < 0].max()
        assert 7.0 < reach <= grown.bounds[1][0]


def test_smooth_operations_of_two_do_not_know_who_was_first() -> None:
    for combine in (union, intersection):
        np.testing.assert_allclose(
            combine(A, B, k=0.3).distance(POINTS), combine(B, A, k=0.3).distance(POINTS), atol=1e-15
        )


# Refusals

REFUSED: dict[str, tuple[Callable[[], Any], tuple[str, ...]]] = {
    "negative k": (lambda: union(A, B, k=-0.1), ("k = -0.1", ">= 0")),
    "k not a number": (lambda: union(A, B, k=float("nan")), ("nan", ">= 0")),
    "infinite k": (lambda: union(A, B, k=float("inf")), ("inf", "finite")),
    "k a vector": (lambda: intersection(A, B, k=(0.1, 0.2, 0.3)), ("(0.1, 0.2, 0.3)", "a number")),
    "k a text": (lambda: difference(A, B, k="wide"), ("'wide'", "a number")),
    "unknown blend": (lambda: union(A, B, k=0.1, blend="power"), ("'power'", "'quadratic'")),
    "nothing": (lambda: union(), ("no nodes", "one node or more")),
    "a number as a node": (lambda: union(A, 3.0), ("3.0 (float)", "nodes")),
    "only a number": (lambda: intersection(3.0), ("3.0 (float)", "nodes")),
    "a list of nodes": (lambda: union([A, B]), ("(list)", "nodes")),
    "or a number": (lambda: A | 3.0, ("3.0 (float)", "two nodes")),
    "minus nothing": (lambda: A - None, ("None", "two nodes")),
}


@pytest.mark.parametrize("name", REFUSED)
def test_refused_with_value_range_and_line(name: str) -> None:
    wrong, words = REFUSED[name]
    refused(wrong, *words)


def test_every_blend_is_offered_by_name() -> None:
    assert "quadratic" in FAMILIES
    for name in FAMILIES:
        assert union(A, B, k=0.1, blend=name).distance((0, 0, 0)) < 0


@pytest.mark.parametrize("blend", FAMILIES)
@pytest.mark.parametrize("far", [1e6, 1e17])
def test_a_far_operand_leaves_the_near_one_its_digits(blend: str, far: float) -> None:
    """In float32; 1e17 is the distance to a solid that is hidden from a kind of rays."""
    a = np.linspace(-1.0, 1.0, 41, dtype=np.float32)
    fold = FAMILIES[blend](4).fold
    blended = trace("blended", lambda x, y: fold(x, y, 0.3), (("x", FLOAT), ("y", FLOAT)))
    single = evaluator([blended.body], blended.params, np.float32)
    away = np.full_like(a, far)
    for given in ((a, away), (away, a)):
        assert np.abs(single(*given)[0] - a).max() < 1e-7


# Chains


def ribs(n: int) -> list[Node]:
    """A plate and ribs that stand on it at right angles, far from each other."""
    return [box((100, 4, 20)), *(box((4, 20, 10)).translate((-42 + 12 * i, 8, 0)) for i in range(n))]


FILLETS: dict[str, Callable[[Any, Any], Any]] = {
    "round": lambda u, v: np.hypot(1 - u, 1 - v) >= 1,
    "chamfer": lambda u, v: u + v <= 1,
    "circular_geometric": lambda u, v: (
        np.hypot(*[np.maximum(0.25 / (2**0.5 - 1) - w, 0) for w in (u, v)]) >= (0.25 / (2**0.5 - 1))
    ),
    "quadratic": lambda u, v: np.maximum(1 - np.abs(u - v), 0) ** 2 / 4 >= np.minimum(u, v),
}
"""The points of a joint of width 1, by the distances u, v > 0 from its two walls."""


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize("n", [1, 2, 8])
def test_a_blend_in_a_chain_has_its_own_width(family: str, n: int) -> None:
    """Whatever was blended before: each rib of a chain has the joint that it has alone."""
    plate, *others = ribs(n)
    chain = plate
    for rib in others:
        chain = union(chain, rib, k=1, blend=family)
    u, v = np.random.default_rng(2).uniform(0.01, 1.2, (2, 500))
    for i in range(0, n, 3):
        points = np.stack([-40 + 12 * i + u, 2 + v, 0 * u], axis=1)
        alone = union(plate, others[i], k=1, blend=family).distance(points)
        found = chain.distance(points)
        if family not in ("root", "exponential"):  # they act at all distances
            np.testing.assert_array_equal((found <= 0)[np.abs(alone) > 1e-6], (alone <= 0)[np.abs(alone) > 1e-6])
        if family in FILLETS:
            assert np.mean((found <= 0) != FILLETS[family](u, v)) <= 0.004  # on the surface
    if family in ("round", "circular_geometric", "chamfer"):
        at_once = union(plate, *others, k=1, blend=family)
        assert chain.facts.divisor <= max(at_once.facts.divisor * (1 + 1e-9), 1 + 2**0.5)


@pytest.mark.parametrize("family", ["round", "chamfer", "columns", "circular_geometric"])
@pytest.mark.parametrize(
    "between",
    [
        lambda node: node,
        lambda node: node - sphere(0.3).translate((0, -0.5, 2.5)),
        lambda node: node.translate((1, 0, 0)).rotate(0.0, "y").translate((-1, 0, 0)),
        lambda node: node.mirror((0, 0, 1)).scale(2.0).scale(0.5),
        lambda node: node & box(12.0),
        lambda node: node.round(0.1).offset(-0.1),
    ],
)
def test_a_cut_into_a_blended_solid_has_its_own_width(family: str, between: Callable[[Node], Node]) -> None:
    """A blend of blends: the legs of a groove are those that a plain block has."""
    groove = box((1, 4, 20)).translate((0, 2, 0))
    block = between(union(box((10, 2, 10)), box((2, 1, 2)).translate((4, -1, 4)), k=0.5, blend=family))
    u, v = np.random.default_rng(3).uniform(0.001, 0.6, (2, 400))
    points = np.stack([0.5 + u, 1 - v, 1.0 + 0 * u], axis=1)
    found = difference(block, groove, k=0.5, blend="chamfer").distance(points)
    assert np.mean((found > 0) != (u + v < 0.5)) <= 0.01
