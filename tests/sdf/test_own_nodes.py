"""A user's own shapes and operators: written like the package's, refused like them, compiled like them."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import raymarch as rm
import raymarch.expr.vocabulary as v
from raymarch.errors import SceneError
from raymarch.expr import Expr, loop
from raymarch.expr.types import VEC3
from raymarch.gpu.context import Context
from raymarch.sdf import Node, box, operator, plane, shape, sphere
from raymarch.sdf.definition import EVERYWHERE, REGISTRY, cube
from raymarch.sdf.domain import Angle, Count, Length, NonNegative, Positive, Size3, Vec3
from tests.support.glsl_harness import assert_es, run

POINTS = np.random.default_rng(3).uniform(-2, 2, (3000, 3)).astype(np.float32).astype(np.float64)


@pytest.fixture(autouse=True)
def _registry_as_before() -> Iterator[None]:
    before = dict(REGISTRY)
    yield
    REGISTRY.clear()
    REGISTRY.update(before)


def on_device(egl: Context, node: Node) -> NDArray[np.float32]:
    return run(egl, node.glsl(), "field({0})", [(VEC3, POINTS)])


def assert_twin(egl: Context, node: Node, ulps: float = 16) -> None:
    values, twin = node.distance(POINTS), on_device(egl, node)
    np.testing.assert_allclose(twin, values, atol=ulps * 2**-23 * 2, rtol=0)
    assert_es(node.glsl(), "field({0})", [VEC3])


# Shapes


def test_a_shape_in_five_lines(egl: Context) -> None:
    @shape(exactness="exact", bounds=lambda radius: cube(radius))
    def ball(p: Any, radius: Positive = 1.0) -> Any:
        """Ball."""
        return v.length(p) - radius

    node = ball(0.75)
    assert (node.exactness, node.lipschitz) == ("exact", 1.0)
    np.testing.assert_array_equal(node.bounds, [[-0.75] * 3, [0.75] * 3])
    np.testing.assert_allclose(node.distance(POINTS), np.linalg.norm(POINTS, axis=1) - 0.75)
    np.testing.assert_allclose(node.gradient((0, 3, 4)), [0, 0.6, 0.8])
    assert node.glsl() == (
        "float ball(vec3 p, float radius) {\n    return length(p) - radius;\n}\n\n"
        "float field(vec3 p) {\n    return ball(p, 0.75);\n}\n"
    )
    assert_twin(egl, node)
    assert ball().name == "ball"
    assert (node | sphere().translate((1, 0, 0))).rotate(0.3).distance((0, 0, 0)) == -0.75


def test_it_is_registered_and_looks_like_a_function() -> None:
    @shape(exactness="exact", bounds=lambda size, offset: EVERYWHERE)
    def own(p: Any, size: Size3 = (1.0, 2.0, 3.0), offset: Length = 0.0) -> Any:
        """Own shape.

        size : extents."""
        return v.length(p - size) - offset

    assert REGISTRY["own"].doc.startswith("Own shape.")
    assert list(inspect.signature(own).parameters) == ["size", "offset"]
    assert own.__doc__ is not None
    assert own.__name__ == "own"


@pytest.mark.parametrize("name", ["sample", "input", "length", "main", "half", "texture", "unit"])
def test_names_that_glsl_has_taken(egl: Context, name: str) -> None:
    """A shape called `sample` with a parameter called `input`; a shape called like what it calls."""
    space: dict[str, Any] = {"v": v, "shape": shape, "cube": cube, "Positive": Positive}
    code = (
        f"@shape(exactness='bound', bounds=lambda input, {name}_: cube(2.0 * input))\n"
        f"def {name}(p, input: Positive = 0.5, {name}_: Positive = 0.3):\n"
        "    output = v.length(p) - input\n"
        f"    sampler = v.max(output, v.dot(p, v.normalize(p + 0.01)) - {name}_) * 0.5\n"
        "    return sampler + 0.25 * v.min(sampler, output)\n"
    )
    exec(compile(code, __file__, "exec"), space)
    node = space[name](0.6) | space[name](0.4, 0.2).translate((1, 0, 0))
    assert_twin(egl, node)


def test_a_steep_field_is_divided_by_its_steepness(egl: Context) -> None:
    @shape(exactness="bound", bounds=lambda radius, slope: cube(radius), lipschitz=lambda radius, slope: 1.0 + slope)
    def steep(p: Any, radius: Positive = 1.0, slope: NonNegative = 2.0) -> Any:
        return (1.0 + slope) * (v.length(p) - radius)

    node = steep()
    assert node.lipschitz == 1.0
    np.testing.assert_allclose(node.distance(POINTS), np.linalg.norm(POINTS, axis=1) - 1.0, atol=1e-14)
    assert_twin(egl, node)


def test_a_flat_field_says_that_it_is_flat() -> None:
    @shape(exactness="bound", bounds=lambda: cube(1.0), lipschitz=0.25)
    def gentle(p: Any) -> Any:
        return 0.25 * (v.length(p) - 1.0)

    assert gentle().lipschitz == 0.25
    assert (gentle() | box(1)).lipschitz == 1.0
    assert gentle().translate((1, 0, 0)).scale(2.0).lipschitz == 0.25


def test_an_estimate_promises_nothing() -> None:
    @shape(exactness="estimate", bounds=lambda power: cube(1.2))
    def bulb(p: Any, power: Positive = 8.0) -> Any:
        def step(i: Expr, z: Expr, dr: Expr) -> Any:
            r, theta, phi = v.length(z), v.acos(z.z / v.max(v.length(z), 1e-9)), v.atan2(z.y, z.x)
            direction = v.vec3(
                v.sin(power * theta) * v.cos(power * phi), v.sin(power * theta) * v.sin(power * phi), 0.0
            )
            grown = v.pow(r, power) * (direction + v.vec3(0.0, 0.0, v.cos(power * theta))) + p
            return grown, power * v.pow(r, power - 1.0) * dr + 1.0

        z, dr = loop(4, (p, 1.0), step, until=lambda i, z, dr: v.length(z) > 2.0)
        r = v.max(v.length(z), 1e-6)
        return 0.5 * v.log(r) * r / dr

    node = bulb()
    assert node.exactness == "estimate"
    assert node.lipschitz == np.inf
    assert (node | sphere()).exactness == "estimate"
    assert np.all(np.isfinite(node.distance(POINTS)))
    assert np.all(np.isfinite(node.gradient(POINTS)))


def test_unannotated_parameters_take_any_finite_value() -> None:
    @shape(exactness="exact", bounds=lambda centre, radius: (centre - radius, centre + radius))
    def somewhere(p, centre=(1.0, 0.0, 0.0), radius=0.5):
        return v.length(p - centre) - radius

    assert somewhere().distance((1, 0, 0)) == -0.5
    with pytest.raises(SceneError, match="radius = nan"):
        somewhere(radius=np.nan)


def test_whole_number_parameters_are_python_numbers(egl: Context) -> None:
    @shape(exactness="bound", bounds=lambda count: EVERYWHERE)
    def fence(p: Any, count: Count = 3) -> Any:
        return v.min(*[v.length(p - (float(i), 0.0, 0.0)) - 0.3 for i in range(count + 1)])

    assert fence(5).glsl().count("length") == 6
    assert fence(2).distance((2, 0, 0)) == -0.3
    assert_twin(egl, fence(4))


# Operators


def test_an_operator_in_five_lines(egl: Context) -> None:
    @operator(exactness="exact", bounds=lambda child, offset: child.box + offset)
    def moved(p: Any, child: Any, offset: Vec3) -> Any:
        return child(p - offset)

    node = moved(box((1, 2, 3)), (0.5, 0, 0))
    np.testing.assert_allclose(node.bounds, [[0, -1, -1.5], [1, 1, 1.5]])
    assert node.exactness == "exact"
    assert_twin(egl, node)
    assert list(inspect.signature(moved).parameters) == ["node", "offset"]


def test_exactness_is_never_better_than_the_childs() -> None:
    @operator(exactness="exact", bounds=lambda child: child.box)
    def same(p: Any, child: Any) -> Any:
        return child(p)

    assert same(sphere()).exactness == "exact"
    assert same(sphere() - box(1)).exactness == "bound"


def test_an_operator_that_asks_its_child_twice_calls_it(egl: Context) -> None:
    @operator(bounds=lambda child, gap: (child.lower - gap, child.upper + gap))
    def twins(p: Any, child: Any, gap: Positive = 0.5) -> Any:
        return v.min(child(p - v.vec3(gap, 0.0, 0.0)), child(p + v.vec3(gap, 0.0, 0.0)))

    node = twins(box(0.4).rotate(0.3) - sphere(0.2))
    assert node.glsl().count("float difference_field(vec3 p)") == 1
    assert_twin(egl, node)


def test_an_operator_that_bends_space_divides_by_its_steepness() -> None:
    """Twist: L = (kr + sqrt(k^2 r^2 + 4)) / 2 with the largest radius of the child's box."""

    def slope(child: Any, rate: Any) -> Any:
        corner = v.max(abs(child.lower), abs(child.upper))
        kr = abs(rate) * v.length(corner.xz)
        return child.lipschitz * 0.5 * (kr + v.sqrt(kr * kr + 4.0))

    def twisted_box(child: Any, rate: Any) -> Any:
        reach = v.length(v.max(abs(child.lower.xz), abs(child.upper.xz)))
        return v.vec3(-reach, child.lower.y, -reach), v.vec3(reach, child.upper.y, reach)

    @operator(bounds=twisted_box, lipschitz=slope)
    def own_twist(p: Any, child: Any, rate: Angle) -> Any:
        q = v.rotation2(p.xz, rate * p.y)
        return child(v.vec3(q.x, p.y, q.y))

    node = own_twist(box((1.0, 2.0, 0.4)), 1.5)
    assert node.facts.divisor > 1.2
    pairs = POINTS.reshape(-1, 2, 3) * 0.4
    rise = np.abs(node.distance(pairs[:, 0]) - node.distance(pairs[:, 1]))
    assert np.all(rise <= np.linalg.norm(pairs[:, 0] - pairs[:, 1], axis=1))
    inside = POINTS[node.distance(POINTS) < 0]
    assert np.all((inside >= node.bounds[0]) & (inside <= node.bounds[1]))
    with pytest.raises(SceneError, match="no finite Lipschitz bound"):
        own_twist(plane(), 1.5)


def test_the_childs_point_may_be_constant() -> None:
    @operator(bounds=lambda child: EVERYWHERE, lipschitz=2.0)
    def relative(p: Any, child: Any) -> Any:
        return v.length(p) - child((0.0, 0.0, 0.0)) * child(p)

    assert relative(sphere(0.5)).distance((1, 0, 0)) == (1 + 0.5 * 0.5) / 2


# Facts that are missing or wrong

WRONG: dict[str, tuple[Callable[[], Any], tuple[str, ...]]] = {
    "no bounds": (
        lambda: shape(exactness="exact")(lambda p: v.length(p)),
        ("states no bounds", "exactness"),
    ),
    "no exactness": (lambda: shape(bounds=lambda: cube(1))(lambda p: v.length(p)), ("states no exactness",)),
    "unknown exactness": (
        lambda: shape(exactness="perfect", bounds=lambda: cube(1))(lambda p: v.length(p)),
        ("'perfect'", "'exact', 'bound' or 'estimate'"),
    ),
    "operator without bounds": (lambda: operator()(lambda p, child: child(p)), ("states no bounds",)),
    "bounds of one number": (
        lambda: shape(exactness="exact", bounds=lambda r: r)(lambda p, r=1.0: v.length(p) - r)(),
        ("bounds gives", "(lower, upper)", "cube(half)"),
    ),
    "bounds of three numbers": (
        lambda: shape(exactness="exact", bounds=lambda: (1, 1, 1))(lambda p: v.length(p) - 1)(),
        ("bounds gives (1, 1, 1)",),
    ),
    "operator without child": (
        lambda: operator(bounds=lambda child: child.box)(lambda p: p),
        ("too few parameters", "a point p and a child"),
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_node_without_facts_does_not_load(name: str) -> None:
    wrong, words = WRONG[name]
    with pytest.raises(SceneError) as caught:
        wrong()
    for word in words:
        assert word in str(caught.value)
    assert caught.value.where is not None
    assert caught.value.where.file == __file__


def test_a_shape_must_give_one_number() -> None:
    @shape(exactness="exact", bounds=lambda: cube(1.0))
    def wide(p: Any) -> Any:
        return abs(p)

    with pytest.raises(SceneError, match="wide gives a vec3") as caught:
        wide().glsl()
    assert caught.value.where is not None
    assert caught.value.where.file == __file__


def test_a_definition_may_not_ask_its_point_for_a_decision() -> None:
    @shape(exactness="exact", bounds=lambda: cube(1.0))
    def deciding(p: Any) -> Any:
        line = inspect.currentframe()
        assert line is not None
        lines.append(line.f_lineno + 1)
        return v.length(p) if p.x > 0 else 1.0

    lines: list[int] = []
    with pytest.raises(SceneError, match="no truth value") as caught:
        deciding().distance((0, 0, 0))
    assert caught.value.where is not None
    assert (caught.value.where.file, caught.value.where.line) == (__file__, lines[0])


def test_a_child_is_asked_at_points() -> None:
    @operator(bounds=lambda child: child.box)
    def flat(p: Any, child: Any) -> Any:
        return child(p.xy)

    with pytest.raises(SceneError, match="evaluates its child at a vec2"):
        flat(sphere()).distance((0, 0, 0))


@pytest.mark.parametrize("infinite", [False, True])
def test_constants_without_a_value_are_refused_with_the_line(infinite: bool) -> None:
    @shape(exactness="bound", bounds=lambda: cube(1.0))
    def cracked(p: Any) -> Any:
        zero = v.vec3(0.0, 0.0, 0.0).x
        return v.length(p) - 1.0 / zero if infinite else v.length(p) / zero - 1.0

    with pytest.raises(SceneError, match="cracked holds inf" if infinite else "cracked divides by 0.0") as caught:
        cracked().distance((0, 0, 0))
    assert caught.value.where is not None and caught.value.where.file == __file__


def test_a_child_inside_a_loop_is_refused_in_words() -> None:
    @operator(bounds=lambda child: child.box)
    def looping(p: Any, child: Any) -> Any:
        return loop(3, (1.0,), lambda i, d: (v.min(d, child(p + i)),))[0]

    with pytest.raises(SceneError, match="looping evaluates its child inside a loop") as caught:
        looping(sphere()).distance((0, 0, 0))
    assert caught.value.where is not None
    assert caught.value.where.file == __file__


def test_a_check_of_its_own() -> None:
    def check(inner: Any, outer: Any) -> None:
        if float(inner.data) >= float(outer.data):
            raise SceneError(f"ring: inner = {float(inner.data)}", legal="inner < outer")

    @shape(exactness="bound", bounds=lambda inner, outer: cube(outer), check=check)
    def ring(p: Any, inner: Positive = 0.5, outer: Positive = 1.0) -> Any:
        return v.max(v.length(p) - outer, inner - v.length(p))

    assert ring().distance((0.75, 0, 0)) == -0.25
    with pytest.raises(SceneError, match=r"inner = 2\.0"):
        ring(2.0)


def test_redefining_keeps_the_nodes_made_before() -> None:
    def define(scale: float) -> Callable[..., Node]:
        @shape(exactness="bound", bounds=lambda: cube(1.0))
        def again(p: Any) -> Any:
            return scale * v.length(p) - scale

        return again

    first = define(1.0)()
    second = define(0.5)()
    assert REGISTRY["again"] is second.definition
    assert first.distance((3, 0, 0)) == 2.0
    assert second.distance((3, 0, 0)) == 1.0
    both = (first | second).glsl()
    assert "float again(" in both
    assert "float again2(" in both


@pytest.mark.parametrize("fact", ["bounds", "lipschitz", "spread", "convex", "exactness", "symmetry", "check"])
def test_a_function_of_facts_with_other_parameters_is_refused_with_its_line(fact: str) -> None:
    given: dict[str, Any] = {"exactness": "exact", "bounds": lambda radius: cube(radius), fact: lambda r: cube(r)}
    with pytest.raises(SceneError, match=rf"test_own_nodes.py:\d+: ball: {fact} takes \(r\) \(it receives radius\)"):

        @rm.shape(**given)
        def ball(p: Any, radius: float = 1.0) -> Any:
            return v.length(p) - radius


def test_a_parameter_without_a_range_is_told_to_state_it() -> None:
    with pytest.raises(SceneError, match=r"a number > 0; Param 'r' needs min=\)"):
        rm.sphere(rm.Param("r", 1))
    with pytest.raises(SceneError, match=r"Param 'r' needs min= and max=\)"):
        rm.sphere(rm.Param("r", 1) * 2)


def test_a_union_of_flat_and_solid_names_both() -> None:
    with pytest.raises(SceneError, match=r"union of a 2D field \(circle\) and a 3D field \(box\) \(all 2D or all 3D\)"):
        rm.union(rm.circle(), rm.box(1))
