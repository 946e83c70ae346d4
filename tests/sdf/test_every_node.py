"""What every node promises, tested on every definition of the package: see `node_samples`.

Each promise is a function that reads a fact from the node and holds it against the field itself, evaluated in float64.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial, reduce
from itertools import groupby
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from raymarch.errors import SceneError
from raymarch.expr.function import Function
from raymarch.expr.glsl import print_functions
from raymarch.expr.types import VECTORS
from raymarch.gpu.context import Context
from raymarch.sdf import Node
from tests.support.glsl_harness import ES, assert_valid, run_all, shader, text_of
from tests.support.node_samples import POINTS, SPECIAL, Field, NodeSample, Seen, definitions, look_at, samples
from tests.support.records import measured
from tests.support.surface_search import (
    length,
    lowest_on_plane,
    nearest_distance,
    smooth_differences,
    thorough_distance,
    unit,
)

ULP = float(np.finfo(np.float32).eps)


PROMISES: list[Callable[[Seen], None]] = []
"""What is held against the field of each sample, in this order."""


@dataclass(frozen=True)
class Driven:
    """A sample's field as the driver runs its text, at the first points: values, and gradients with values."""

    values: NDArray[np.float32]
    gradients: NDArray[np.float32]


ON_THE_DRIVER: list[Callable[[Seen, Driven], None]] = []
"""What is held against the text that is printed, as the driver runs it."""


def promise(check: Callable[[Seen], None]) -> Callable[[Seen], None]:
    PROMISES.append(check)
    return check


def promise_on_the_driver(check: Callable[[Seen, Driven], None]) -> Callable[[Seen, Driven], None]:
    ON_THE_DRIVER.append(check)
    return check


def by_definition() -> Iterator[Any]:
    """The samples of each definition; drawn ones between the first and the last are long."""
    for definition, some in groupby(samples(), key=lambda sample: sample.definition):
        drawn = list(some)
        between = [] if definition.name in SPECIAL else drawn[1:-1]
        yield pytest.param([s for s in drawn if s not in between], id=definition.name)
        if between:
            yield pytest.param(between, id=f"{definition.name}-between", marks=pytest.mark.long)


@pytest.mark.parametrize("chosen", list(by_definition()))
def test_promises(chosen: list[NodeSample], egl: Context) -> None:
    """All promises of each sample: they share its points, values, surface and gradients. Each broken one is told."""
    broken: list[Exception] = []
    names: list[str] = []

    def told(name: str, check: Callable[[], None]) -> None:
        try:
            check()
        except Exception as fault:
            fault.add_note(name)
            broken.append(fault)
            names.append(name)

    seen = [look_at(sample) for sample in chosen]
    driven: list[Driven | None] = [None] * len(seen)

    def drive() -> None:
        driven[:] = run_on_the_driver(seen, egl)

    told("the driver takes the text", drive)
    texts: dict[str, str] = {}
    for s, there in zip(seen, driven, strict=True):
        for check in PROMISES:
            told(f"{s.sample.id}: {check.__name__}", partial(check, s))
        for check_there in ON_THE_DRIVER if there else ():
            told(f"{s.sample.id}: {check_there.__name__}", partial(check_there, s, there))
        texts[s.sample.id] = shader(s.text, "field({0})", [VECTORS[s.node.dimension]], 1, ES)
    told("the text serves ES", partial(assert_valid, texts))
    if broken:
        raise ExceptionGroup("; ".join(names), broken)


DRIVEN = 25_000
"""Points at which the driver evaluates each sample."""
TOGETHER = 4
"""Samples in one program: a picture has room for their values and their gradients."""


def run_on_the_driver(seen: Sequence[Seen], egl: Context) -> Iterator[Driven]:
    """The fields of some samples of one definition and their gradients, in as few programs as may be."""
    for k in range(0, len(seen), TOGETHER):
        some = seen[k : k + TOGETHER]
        pairs = [
            [Function(f"{f.name}_{i}", f.params, f.body, f.names) for f in (s.field.definition, s.field.companion)]
            for i, s in enumerate(some)
        ]
        text = print_functions([f for pair in pairs for f in pair])
        calls = [(f"{slope.name}({{{i}}})", slope.type.size) for i, (_, slope) in enumerate(pairs)]
        calls.append((", ".join(f"{field.name}({{{i}}})" for i, (field, _) in enumerate(pairs)), len(pairs)))
        inputs = [(VECTORS[s.node.dimension], s.points[:DRIVEN]) for s in some]
        *slopes, values = run_all(egl, text_of(text), calls, inputs, samples=text.samples)
        values = values.reshape(DRIVEN, len(some))
        yield from (Driven(values[:, i], slope) for i, slope in enumerate(slopes))


TOLERANCE = 2e-3
"""How near the search for the nearest point of the surface comes, in units of the solid's size."""

TWIN_ULPS: dict[str, tuple[float, str]] = {}
"""Definitions whose float32 twin may be off by more than 16 ulp, and why."""


def few_wrong(node: Node) -> float:
    """The share of points at which an estimate may be off: at the edge of a fractal an iteration magnifies rounding."""
    return 0.02 if node.exactness == "estimate" else 0.0


MEASURED = measured()


@promise
def the_field_is_the_one_that_was_measured(s: Seen) -> None:
    """docs/proofs.md tells of these very fields; one that is another than it was has to be looked at again.

    A new node has no figures yet: there is nothing to compare, and the end of the run says so.
    """
    name, sample = s.sample.definition.name, s.sample.name
    if name not in MEASURED:
        return
    found = MEASURED[name]["means"].get(sample)
    again = f"run `python -m tests.lab.renew {name}`, and look at its picture"
    assert found is not None, f"{name} ({sample}) has not been measured: {again}"
    loose = 1e-5 if s.node.exactness == "estimate" else 1e-8  # where an iteration magnifies rounding
    np.testing.assert_allclose(s.means, found, rtol=loose, atol=loose * s.field.size, err_msg=again)


def test_every_definition_has_samples() -> None:
    assert {sample.definition.name for sample in samples()} == {d.name for d in definitions()}
    assert len(definitions()) >= 22


@promise_on_the_driver
def glsl_is_the_twin(s: Seen, there: Driven) -> None:
    """float32 on the driver against float64, within 16 ulp of the coordinates or of the solid's size."""
    points = s.points[:DRIVEN]
    error = np.abs(there.values - s.values[:DRIVEN])
    ulps, _ = TWIN_ULPS.get(s.sample.definition.name, (16.0, ""))
    allowed = ulps * ULP * np.maximum(np.abs(points).max(axis=1), s.field.size)
    wrong = ~(error <= allowed)
    assert wrong.mean() <= few_wrong(s.node), (
        f"{wrong.sum()} of {DRIVEN} points differ, worst by {np.nanmax(error / allowed) * ulps:.1f} ulp "
        f"at {points[np.argmax(np.nan_to_num(error / allowed, nan=np.inf))]}"
    )


def least_smooth(node: Node) -> float:
    """The share of points away from kinks that a test needs; estimates of fractals are rough nearly everywhere."""
    return 0.05 if node.exactness == "estimate" else 0.5


@promise
def gradient_equals_central_differences(s: Seen) -> None:
    points = s.points[:2000]
    central, smooth = smooth_differences(s.field, points, 1e-6 * s.field.size, 1e-4)
    gradient = s.gradients[: len(points)]
    assert np.all(np.isfinite(gradient))
    assert smooth.mean() > least_smooth(s.node), "too few points are smooth to tell anything"
    wrong = np.abs(gradient - central).max(axis=1)[smooth] > 2e-5
    assert wrong.mean() <= few_wrong(s.node), s.points[:2000][smooth][wrong]
    np.testing.assert_allclose(s.node.gradient(points[:5]), gradient[:5], atol=1e-12)


@promise_on_the_driver
def gradient_on_the_driver(s: Seen, there: Driven) -> None:
    points = s.points[:4000]
    _, smooth = smooth_differences(s.field, points, 1e-4 * s.field.size, 2e-2)
    assert smooth.mean() > least_smooth(s.node), "too few points are smooth to tell anything"
    error = np.abs(there.gradients[: len(points), :-1] - s.gradients[: len(points)]).max(axis=1)[smooth]
    assert np.mean(~(error < 1e-4)) <= 0.005 + few_wrong(s.node), f"off by up to {error.max():.3g}"


@promise
def normals_on_the_surface_survive_float32(s: Seen) -> None:
    """On the surface itself, where sign * sqrt(d^2) and the like would divide rounding errors by rounding errors."""
    points = s.surface[:400].astype(np.float32).astype(np.float64)
    gradient = s.field.gradient(points)
    smooth = np.linalg.norm(gradient, axis=1) > 0.1  # of a shorter one the direction is lost in float32 anyway
    random = np.random.default_rng(17)
    reach = np.array((2e-5, 1e-6) * 4)[:, None, None]  # creases nearby; two pieces that part at a flat angle, very near
    steps = reach * s.field.size * unit(random.normal(size=(len(reach), *points.shape)))
    beside = s.field.gradient((points + steps).reshape(-1, s.node.dimension)).reshape(steps.shape)
    turned = np.linalg.norm(unit(beside) - unit(gradient), axis=-1)
    smooth &= np.all((turned < 1e-3) & (np.linalg.norm(beside, axis=-1) > 0.1), axis=0)
    if s.node.exactness == "estimate" and not np.any(smooth):
        return  # the surface of a fractal may be nothing but creases
    assert smooth.mean() > 0.02
    single = s.field.whole_single(points)[:, :-1]
    error = np.linalg.norm(unit(single.astype(np.float64)) - unit(gradient), axis=1)[smooth]
    assert np.mean(~(error < 1e-3)) <= few_wrong(s.node), points[smooth][np.argmax(error)]


@promise
def never_steeper_than_promised(s: Seen) -> None:
    """Pairs of points, far apart and close together; and the gradient itself."""
    if s.node.exactness == "estimate":
        assert s.node.lipschitz == np.inf
        return
    random = np.random.default_rng(12)
    limit = s.node.lipschitz
    assert 0 < limit <= 1
    half = POINTS // 2
    points, values = s.points[:half], s.values[:half]
    steps = unit(random.normal(size=(20_000, s.node.dimension)))
    near = points[:20_000] + s.field.size * 10 ** random.uniform(-5, -0.5, (20_000, 1)) * steps
    for other, there in ((s.points[half:], s.values[half:]), (near, s.field.value(near))):
        distance = length(other - points[: len(other)])
        rise = np.abs(there - values[: len(other)])
        rounding = 64 * np.finfo(np.float64).eps * (np.abs(points).max() + s.field.size)
        worst = np.argmax(rise - limit * distance)
        assert rise[worst] <= limit * distance[worst] * (1 + 1e-9) + rounding, (points[worst], other[worst])
    slopes = length(s.gradients)
    assert slopes.max() <= limit * (1 + 1e-9)


@promise
def special_points(s: Seen) -> None:
    """The origin, axes, corners and middles of the box: no 0/0, no root of 0 with an infinite slope."""
    low, high = (
        np.where(np.isfinite(b), b, e) for b, e in zip(s.node.bounds, (s.field.low, s.field.high), strict=True)
    )
    marks = np.stack([low, high, 0.5 * (low + high), np.zeros_like(low), 1.5 * high - 0.5 * low], axis=-1)
    points = np.stack(np.meshgrid(*marks, indexing="ij"), axis=-1).reshape(-1, s.node.dimension)
    for whole, rounding in ((s.field.whole, 1e-9), (s.field.whole_single, 1e-4)):
        both = whole(points)
        assert np.all(np.isfinite(both)), points[~np.isfinite(both).all(axis=1)]
        if s.node.exactness != "estimate":
            assert np.linalg.norm(both[:, :-1], axis=1).max() <= s.node.lipschitz + rounding


@promise
def shapes_do_not_know_their_unit(s: Seen) -> None:
    """All lengths a million times as large or as small: the field as well. An absolute epsilon would show."""
    definition = s.sample.definition
    if definition.arity != "none" or s.node.exactness == "estimate":
        return  # no shape, or an iteration with a size of its own
    if any(d.type is None and d.holds is not int for d in definition.domains.values()):
        return  # static lengths cannot be scaled here
    lengths = {
        name for name, domain in definition.domains.items() if domain.unit == "length" and domain.type is not None
    }
    if any(d.unit != "length" and n not in definition.defaults for n, d in definition.domains.items()):
        return  # not all parameters have a unit
    points, values = s.points[:3000], s.values[:3000]
    for scale in (1e-6, 1e6):
        given = {name: value * scale if name in lengths else value for name, value in s.node.params.items()}
        field = Field(definition.make((), (), given))
        np.testing.assert_allclose(field.value(scale * points), scale * values, atol=1e-9 * scale * s.field.size)
        twin = field.single(scale * points)
        error = np.abs(twin - scale * values) / (scale * np.maximum(np.abs(points).max(axis=1), s.field.size))
        assert error.max() <= 64 * ULP, scale


@promise
def solid_lies_within_its_bounds(s: Seen) -> None:
    low, high = s.node.bounds
    assert low.shape == high.shape == (s.node.dimension,)
    assert np.all(low <= high)
    slack = 1e-9 * s.field.size
    inside = s.points[s.values < 0]
    if s.node.exactness == "estimate" and len(inside) == 0:
        return  # an estimate may be positive everywhere
    assert len(inside) > 10, "no interior found: give the definition a line in SPECIAL"
    assert np.all((inside >= low - slack) & (inside <= high + slack))
    # Around it as well, farther out than the region looked at so far.
    random = np.random.default_rng(13)
    far = random.uniform(s.field.low - 2 * s.field.size, s.field.high + 2 * s.field.size, s.points[:10_000].shape)
    outside = np.any((far < low - slack) | (far > high + slack), axis=1)
    assert np.all(s.field.value(far[outside]) > 0)


@lru_cache(maxsize=1)
def lowest_on_sides(s: Seen) -> dict[tuple[int, float], float]:
    """The smallest value on each finite side of the box, by its axis and its place."""
    sides = [(axis, float(bounds[axis])) for axis in range(s.node.dimension) for bounds in s.node.bounds]
    return {side: lowest_on_plane(s.field, *side) for side in sides if np.isfinite(side[1])}


@promise
def no_side_of_the_box_cuts_the_solid(s: Seen) -> None:
    """A cap that the points above are too few to meet."""
    if not s.node.facts.empty:
        for side, lowest in lowest_on_sides(s).items():
            assert lowest >= -1e-9 * s.field.size, side


@promise
def small_values_lie_near_the_bounds(s: Seen) -> None:
    """What is grown or blended relies on it: a field that rises slowly reaches far."""
    spread = s.node.facts.spread
    assert spread >= 1.0
    assert s.node.exactness != "exact" or spread == 1.0
    low, high = s.node.bounds
    outside = reduce(np.maximum, np.maximum(low - s.points, s.points - high).T, 0.0)
    assert np.all(outside <= spread * np.maximum(s.values, 1e-12) + 1e-9 * s.field.size)


@promise
def what_is_called_convex_is_convex(s: Seen) -> None:
    if not s.node.facts.convex:
        return  # not known to be convex
    inside = np.concatenate([s.points[s.values < 0][:20_000], s.surface])
    random = np.random.default_rng(16)
    middles = 0.5 * np.concatenate([inside + random.permutation(inside), s.surface + random.permutation(s.surface)])
    assert s.field.value(middles).max() <= 1e-10 * s.field.size


@promise
def bounds_of_exact_shapes_are_tight(s: Seen) -> None:
    if s.sample.definition.arity != "none" or s.node.exactness != "exact":
        return  # no exact shape
    for side, lowest in lowest_on_sides(s).items():
        assert lowest <= 0.01 * s.field.size, side


@promise
def distance_is_never_larger_than_to_the_surface(s: Seen) -> None:
    """For exact nodes and bounds alike: the surface, found by bisection, is at least as far as the field says."""
    if s.node.exactness == "estimate":
        return  # an estimate promises nothing
    assert len(s.surface) == 2000
    distances, nearest = cKDTree(s.surface).query(s.points[:5000])
    excess = np.abs(s.values[:5000]) - distances
    worst = np.argmax(excess)
    assert excess[worst] <= 1e-9 * s.field.size, (s.points[worst], s.surface[nearest[worst]], s.values[worst])


@promise
def exact_distance_is_the_distance(s: Seen) -> None:
    """Inside and outside, against the nearest point of the surface by search."""
    if s.node.exactness != "exact":
        return  # not exact
    if s.sample.definition.arity != "none" and not s.node.facts.bounded:
        return  # an endless lattice has more surface than the search can sample; its copies are tested one by one
    random = np.random.default_rng(15)
    margin = np.minimum(s.points - s.field.low, s.field.high - s.points).min(axis=1)
    known = np.abs(s.values) < 0.5 * margin  # the nearest surface lies well in the region looked at
    queries = np.concatenate([s.points[known & (s.values > 0)][:120], s.points[known & (s.values < 0)][:120]])
    values = np.abs(s.field.value(queries))
    distances = nearest_distance(s.field, random, s.surface, queries, values + TOLERANCE * s.field.size)
    for k in np.argsort(values - distances)[:8]:  # where most is missing, a nearer piece may have been overlooked
        if distances[k] - values[k] > TOLERANCE * s.field.size:
            distances[k] = min(distances[k], thorough_distance(s.field, random, queries[k], distances[k]))
    missing = distances - values
    worst = np.argmax(missing)
    assert missing[worst] <= TOLERANCE * s.field.size, (
        f"at {queries[worst]} the field says {values[worst]}, the surface is {distances[worst]} away"
    )


@promise
def every_child_counts(s: Seen) -> None:
    """Any child that is moved a little changes the field somewhere: none is forgotten."""
    node, points = s.node, s.points[:20_000]
    if len(node.children) > 2:
        return  # one of many may be hidden by the others
    for k, child in enumerate(node.children):
        moved = child.translate(0.02 * s.field.size * np.array([1.0, 0.7, -0.5])[: child.dimension])
        children = (*node.children[:k], moved, *node.children[k + 1 :])
        try:
            facts = node.definition.derive(children, node.params)
        except SceneError:
            continue  # made for a child that stands where this one does
        other = Field(Node(node.definition, children, node.params, facts)).value(points)
        assert np.abs(other - s.values[: len(points)]).max() > 1e-6 * s.field.size, f"child {k} is without effect"


@promise
def symmetry_is_symmetry(s: Seen) -> None:
    points = s.points[:10_000]
    for axis in s.node.facts.symmetry:
        mirrored = points * np.where(np.arange(s.node.dimension) == "xyz".index(axis), -1.0, 1.0)
        np.testing.assert_allclose(s.field.value(mirrored), s.values[:10_000], atol=1e-12 * s.field.size)


@promise
def equal_nodes_have_equal_text(s: Seen) -> None:
    assert s.sample.build().glsl() == s.text


@promise
def one_point_is_like_many(s: Seen) -> None:
    node: Node = s.node
    points, many = s.points[:3], s.values[:3]
    assert node.distance(points[0]).shape == ()
    np.testing.assert_allclose(node.distance(points), many, atol=1e-13 * s.field.size)
    np.testing.assert_allclose([s.field.value(p) for p in points], many, atol=1e-13 * s.field.size)
    assert node.distance(points[:0]).shape == (0,)
    assert node.gradient(points[:0]).shape == (0, node.dimension)


@promise
def definition_is_documented(s: Seen) -> None:
    assert len(s.sample.definition.doc.strip()) > 5
