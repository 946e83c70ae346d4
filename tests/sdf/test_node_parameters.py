"""Parameters of nodes: what is refused, and facts that hold over the whole range of a Param."""

from __future__ import annotations

from collections.abc import Callable
from cProfile import Profile
from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.errors import SceneError
from raymarch.expr.arrays import bound
from raymarch.expr.types import VEC3
from raymarch.gpu.context import Context
from raymarch.scene.parameter import Param, time
from raymarch.sdf import Node, box, capsule, cylinder, plane, shell, sphere, torus, union
from raymarch.sdf import domain as domains
from raymarch.sdf.domain import Domain
from tests.support.glsl_harness import run
from tests.support.refusals import refused

POINTS = np.random.default_rng(9).uniform(-3, 3, (3000, 3)).astype(np.float32).astype(np.float64)
NAN, INF = float("nan"), float("inf")

REFUSED: dict[str, tuple[Callable[[], Any], tuple[str, ...]]] = {
    "zero radius": (lambda: sphere(0), ("sphere: radius = 0", "> 0")),
    "negative radius": (lambda: sphere(radius=-1.5), ("radius = -1.5", "> 0")),
    "radius not a number": (lambda: sphere(NAN), ("radius = nan", "> 0")),
    "infinite radius": (lambda: sphere(INF), ("radius = inf", "> 0")),
    "radius beyond float32": (lambda: sphere(1e39), ("1e+39", "> 0")),
    "radius that is 0 in float32": (lambda: sphere(1e-60), ("1e-60", "> 0")),
    "radius a text": (lambda: sphere("big"), ("radius = 'big'", "a number > 0")),
    "radius none": (lambda: sphere(None), ("radius = None", "a number > 0")),
    "radius a vector": (lambda: sphere((1, 2, 3)), ("radius = (1, 2, 3)", "vec3", "a number > 0")),
    "one size of zero": (lambda: box((1, 0, 1)), ("size = (1, 0, 1)", "3 numbers > 0")),
    "two sizes": (lambda: box((1, 2)), ("(1, 2)", "3 numbers > 0")),
    "size of texts": (lambda: box(("1", "2", "3")), ("('1', '2', '3')", "3 numbers")),
    "no direction": (lambda: plane((0, 0, 0)), ("normal = (0, 0, 0)", "not all zero")),
    "direction with NaN": (lambda: plane((NAN, 1, 0)), ("nan", "not all zero")),
    "thick torus": (lambda: torus(1.0, 1.5), ("minor = 1.5", "major = 1.0", "minor <= major")),
    "flat capsule": (lambda: capsule((1, 2, 3), (1, 2, 3)), ("[1. 2. 3.]", "two points")),
    "negative rounding": (lambda: box(1).round(-0.1), ("round: radius = -0.1", ">= 0")),
    "shell of nothing": (lambda: box(1).shell(0.0), ("shell: thickness = 0.0", "> 0")),
    "unknown parameter": (lambda: sphere(size=1), ("no parameter 'size'", "sphere(radius=1.0)")),
    "parameter twice": (lambda: sphere(1.0, radius=2.0), ("'radius' twice", "sphere(radius=1.0)")),
    "too many": (lambda: sphere(1.0, 2.0), ("takes up to 1 argument, 2 were given", "sphere(radius=1.0)")),
    "parameter missing": (lambda: shell(box(1)), ("needs 'thickness'", "shell(")),
    "illegal end of a range": (lambda: sphere(Param("r", 1.0, -0.5, 2.0)), ("between -0.5 and 2.0", "> 0")),
    "range that reaches zero": (lambda: sphere(Param("r", 1.0, 0.0, 2.0)), ("between 0.0 and 2.0", "> 0")),
    "range without a lower end": (lambda: sphere(Param("r", 1.0)), ("between -inf and inf", "> 0")),
    "derived range": (lambda: sphere(1.0 - Param("r", 0.5, 0.0, 1.0)), ("between 0.0 and 1.0", "> 0")),
    "illegal blend range": (
        lambda: union(box(1), sphere(), k=Param("k", 0.1, -0.5, 1.0)),
        ("k = an expression between -0.5 and 1.0", "> 0"),
    ),
    "torus over a range": (
        lambda: torus(1.0, Param("tube", 0.3, 0.1, 1.2)),
        ("minor = an expression between 0.1 and 1.2", "minor <= major"),
    ),
    "never positive": (lambda: sphere(-1.0 - time * time), ("radius", "> 0")),
    "points of a plane": (lambda: box(1).distance((1, 2)), ("(2,)", "(N, 3)")),
    "points of a grid": (lambda: box(1).distance(np.zeros((2, 2, 3))), ("(2, 2, 3)", "(N, 3)")),
}


@pytest.mark.parametrize("name", REFUSED)
def test_refused_with_value_range_and_line(name: str) -> None:
    wrong, words = REFUSED[name]
    refused(wrong, *words)


def test_what_the_registry_refuses_is_not_half_made() -> None:
    with pytest.raises(SceneError):
        sphere(-1)
    assert sphere(1).distance((0, 0, 0)) == -1.0


# Ranges


def test_bounds_hold_over_the_whole_range() -> None:
    radius = Param("radius", 0.5, 0.25, 2.0)
    node = sphere(radius).translate((Param("x", 0.0, -1.0, 3.0), 0.0, 0.0))
    np.testing.assert_allclose(node.bounds, [[-3, -2, -2], [5, 2, 2]])
    for r, x in ((0.25, -1.0), (2.0, 3.0), (1.0, 0.5)):
        with bound({"radius": r, "x": x}, 0.0):
            values = node.distance(POINTS)
        np.testing.assert_allclose(values, np.linalg.norm(POINTS - (x, 0, 0), axis=1) - r, atol=1e-12)


def test_an_open_range_has_open_bounds() -> None:
    node = sphere(Param("radius", 1.0, min=0.5))
    assert np.all(np.isinf(node.bounds))
    assert node.exactness == "exact"


def test_a_vector_parameter() -> None:
    node = box(Param("size", (1.0, 2.0, 3.0), 0.5, (2.0, 3.0, 4.0)))
    np.testing.assert_allclose(node.bounds[1], [1.0, 1.5, 2.0])
    assert node.distance((0, 0, 0)) == -0.5


def test_a_range_makes_exactness_the_worst_of_it() -> None:
    """Two balls that are apart now, but not for all values."""
    near = sphere(0.4) | sphere(0.4).translate((Param("gap", 2.0, 0.5, 3.0), 0, 0))
    apart = sphere(0.4) | sphere(0.4).translate((Param("gap", 2.0, 1.0, 3.0), 0, 0))
    assert (near.exactness, apart.exactness) == ("bound", "exact")


def test_lipschitz_holds_over_the_whole_range() -> None:
    stretched = sphere(0.5).scale((Param("long", 1.0, 1.0, 5.0), 1.0, 1.0))
    assert stretched.facts.spread == 5.0
    assert stretched.round(0.1).bounds[1][0] >= 2.5 + 0.5
    for long in (1.0, 5.0):
        with bound({"long": long}, 0.0):
            slopes = np.linalg.norm(stretched.gradient(POINTS), axis=1)
        assert slopes.max() <= 1 + 1e-12


def test_ends_of_a_capsule_may_meet() -> None:
    """0/0 would be NaN, which min() in a union hides."""
    node = capsule((0, 0, 0), (0, Param("length", 1.0, 0.0, 2.0), 0), 0.5)
    for length in (0.0, 1e-30, 1e-20):
        with bound({"length": length}, 0.0):
            np.testing.assert_allclose(node.distance(POINTS), np.linalg.norm(POINTS, axis=1) - 0.5, atol=1e-12)
            assert np.all(np.isfinite(node.gradient(POINTS)))


def test_time_falls_back_to_the_safe_side() -> None:
    node = sphere(0.5).translate((time, 0, 0))
    assert np.isinf(node.bounds[0][0]) and np.isinf(node.bounds[1][0])
    np.testing.assert_allclose([node.bounds[0][1], node.bounds[1][1]], [-0.5, 0.5])
    with bound({}, 2.0):
        assert node.distance((2, 0, 0)) == -0.5


def test_a_wave_of_time_has_bounds() -> None:
    from raymarch.expr.vocabulary import sin

    node = sphere(1.0 + 0.25 * sin(time))
    np.testing.assert_allclose(node.bounds[1], 1.25)


@pytest.mark.parametrize(
    "node",
    [
        sphere(Param("r", 0.7, 0.1, 2.0)).translate((Param("x", 0.5, -1, 1), time, 0)),
        cylinder(Param("r", 0.7, 0.1, 2.0), 1.5).rotate(Param("turn", 0.3)) - box(Param("r", 0.7, 0.1, 2.0)),
        union(box(1), sphere(0.6).translate((0.6, 0, 0)), k=Param("k", 0.2, 0.05, 1.0)),
        torus(1.0, Param("tube", 0.2, 0.1, 0.5)).mirror("x").scale(Param("s", 1.2, 0.5, 2)),
    ],
)
def test_uniforms_and_literals_give_the_same(egl: Context, node: Node) -> None:
    """A Param set to a value is the number itself, up to rounding: pow(-1, 2) and its like do not differ."""
    given = {"r": 0.4, "x": -0.25, "turn": 1.1, "k": 0.5, "tube": 0.35, "s": 0.75}
    text = node.glsl()
    uniforms = {f"u_{n}": x for n, x in given.items() if f"u_{n};" in text} | {"u_time": 0.5}
    values = run(egl, text, "field({0})", [(VEC3, POINTS)], uniforms=uniforms)
    with bound(given, 0.5):
        np.testing.assert_allclose(values, node.distance(POINTS), atol=16 * 2**-23 * 3)


def test_a_range_does_not_change_the_text() -> None:
    for low, high in ((0.5, 1.0), (0.1, 5.0)):
        assert sphere(Param("r", 0.7, low, high)).glsl() == sphere(Param("r", 0.7, 0.2, 0.9)).glsl()


DOMAINS: dict[str, Domain] = {
    name: kind.__metadata__[0]
    for name, kind in vars(domains).items()
    if hasattr(kind, "__metadata__") and (of := kind.__metadata__[0].type) is not None and not of.is_matrix
}

PLAIN: list[Any] = [
    *(0.3, 1, 1e-37, 1e-30, 1e38, 4e38, -0.5, 0, np.float32(0.3), np.float64(2.0), np.int64(2), np.array(0.7), True),
    *((0.0, 1.0, 0.0), [0.6, 0.8, 0.0], (1, 2, 3), np.array([1, 2, 3]), np.array([0.5, 0.25, 2.0], np.float32)),
    *(
        2.5,
        (1.0, 2.0),
        (2.0, 3),
        (3.0, 4.0, 5.0, 6.0),
        [1.0, NAN, 0.0],
        (1.0, INF, 2.0),
        (1, True, 0),
        (0, 0, 0),
        "a",
        None,
        [[1.0, 2.0]],
        2**70,
    ),
]


@pytest.mark.parametrize("domain", DOMAINS, ids=DOMAINS)
def test_plain_numbers_are_accepted_as_all_others(domain: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """`Domain._plain` is a short cut: without it the values, and what is refused, are the same."""

    def accepted(value: Any) -> Any:
        try:
            return DOMAINS[domain].accept("node", "value", value)
        except SceneError as fault:
            return str(fault)

    quick = list(map(accepted, PLAIN))
    assert sum(DOMAINS[domain]._plain(value) is not None for value in PLAIN) >= 1
    monkeypatch.setattr(Domain, "_plain", lambda self, value: None)
    assert quick == list(map(accepted, PLAIN))


def test_a_node_takes_few_calls() -> None:
    """Scenes of many objects are made of plain numbers, in less than 100 calls of Python for each node."""
    run = Profile()
    run.runcall(lambda: [sphere(0.5 + 0.01 * i).round(0.1).translate((i, 2.0, 3.0)) for i in range(100)])
    calls = sum(each.callcount for each in run.getstats())
    assert calls / 300 < 100


def test_a_direction_has_a_name() -> None:
    """As the axes of `rotate` and `mirror` have."""
    at = np.random.default_rng(3).normal(size=(50, 3))
    for name, axis in {"x": (1, 0, 0), "y": (0, 1, 0), "z": (0, 0, 1)}.items():
        for made in (rm.plane, rm.slab, lambda a: rm.torus().orient(a)):
            np.testing.assert_array_equal(made(name).distance(at), made(axis).distance(at))
    with pytest.raises(SceneError, match=r"normal = 'w'.*'x', 'y' or 'z'"):
        rm.plane("w")


def test_a_flat_shape_in_place_of_a_solid_is_told_what_it_lacks() -> None:
    with pytest.raises(SceneError, match=r"warp of .*circle.*\.extrude\(height\)"):
        rm.circle(0.2).warp(lambda p: 0.1 * p)


def test_a_mirror_image_is_named() -> None:
    """Not the solid with its mirror image, which `mirror` makes."""
    with pytest.raises(SceneError, match=r"diag\(\[-1, 1, 1, 1\]\)"):
        rm.sphere().reflect("x")
    made = rm.sphere().translate((2, 0, 0)).transform(np.diag([-1, 1, 1, 1]))
    np.testing.assert_allclose(made.distance([(-2, 0, 0), (2, 0, 0)]), (-1, 3))
