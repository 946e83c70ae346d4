"""Sample nodes of every definition of the package, found through the registry.

A new shape or operator needs nothing here: parameters are drawn from their domains, children are chosen to
be centred, off centre, without symmetry and inexact. Only definitions whose parameters must fit each other in
a way that no domain can say (a matrix and its inverse) are built by a line in SPECIAL.
"""

from __future__ import annotations

import importlib
import inspect
import math
import pkgutil
import zlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import raymarch.sdf
from raymarch.errors import SceneError
from raymarch.expr.arrays import evaluator
from raymarch.expr.derivative import companion
from raymarch.expr.function import Function
from raymarch.expr.types import FLOAT
from raymarch.expr.vocabulary import cos, dot, sin, vec3
from raymarch.scene.material import Material
from raymarch.scene.parameter import time
from raymarch.sdf import (
    Node,
    box,
    capsule,
    difference,
    displace_by,
    intersection,
    material,
    plane,
    repeat,
    repeat_varied,
    shape,
    sketch,
    sphere,
    transform,
    transition,
    union,
    wrap_around,
)
from raymarch.sdf.blends import FAMILIES
from raymarch.sdf.definition import REGISTRY, Definition, cube
from raymarch.sdf.domain import Domain, Positive
from raymarch.sdf.evaluation import field_of
from raymarch.sdf.implicit import implicit, implicit_solid
from raymarch.sdf.node import METHODS
from raymarch.sdf.noise import displaced, lattice_noise
from raymarch.sdf.warps import warp, warped

PACKAGE = Path(raymarch.sdf.__file__).parent
POINTS = 100_000
"""Points at which each sample is looked at."""

for _module in pkgutil.iter_modules([str(PACKAGE)]):
    importlib.import_module(f"raymarch.sdf.{_module.name}")


_OF_THE_PACKAGE = [d for d in REGISTRY.values() if Path(d.where.file).parent == PACKAGE]


def definitions() -> list[Definition]:
    """Those of the package; tests define some too, some of them under the same names."""
    return _OF_THE_PACKAGE


# Children


@shape(exactness="exact", bounds=lambda radius: cube((radius, radius)), symmetry="xy", convex=True, dimension=2)
def specimen_disc(p: Any, radius: Positive = 0.6) -> Any:
    """A flat child for operators."""
    from raymarch.expr.vocabulary import length

    return length(p) - radius


CHILDREN: dict[int, dict[str, Callable[[], Node]]] = {
    3: {
        "brick": lambda: box((0.9, 0.5, 0.7)),
        "ball aside": lambda: sphere(0.4).translate((0.35, 0.2, -0.1)),
        "slanted": lambda: capsule((-0.3, -0.2, 0.05), (0.4, 0.3, 0.2), 0.2),
        "bitten": lambda: box((0.9, 0.6, 0.7)) - sphere(0.35).translate((-0.4, 0.2, 0.1)),
        "stretched": lambda: sphere(0.4).scale((1.7, 0.6, 1.0)).translate((0.2, 0.1, 0.0)),
        "pair": lambda: sphere(0.3).translate((-0.4, 0.0, 0.1)) | sphere(0.25).translate((0.35, 0.1, 0.0)),
    },
    2: {
        "disc": lambda: specimen_disc(0.6),
        "disc aside": lambda: specimen_disc(0.4).translate((0.3, 0.2)),
        "bitten disc": lambda: specimen_disc(0.5) - specimen_disc(0.3).translate((-0.4, 0.1)),
        "stretched disc": lambda: specimen_disc(0.4).scale((1.6, 0.7)).translate((0.1, 0.2)),
    },
}


# Parameters


def draw(domain: Domain, random: np.random.Generator) -> Any:
    """A value of a domain, of moderate size."""
    if domain.type is None:
        return int(random.integers(max(int(domain.low), 1) if domain.low > -np.inf else 1, min(domain.high, 4) + 1))
    if domain.type.is_matrix:
        return np.linalg.qr(random.normal(size=(domain.type.size,) * 2))[0]
    size = domain.type.shape
    if domain.direction:
        return random.normal(size=size)
    low = domain.low if domain.low > -np.inf else -1.0
    high = min(domain.high, max(low + 1.0, 1.2))
    values = random.uniform(low + 0.2 * (high - low), high - 0.05 * (high - low), size)
    return float(values) if domain.type is FLOAT else values


USUAL: dict[str, dict[str, Any]] = {
    "polygon": {"points": ((-0.9, -0.7), (0.8, -0.5), (0.9, 0.6), (0.1, 0.0), (-0.6, 0.8))},
    "polyline": {"points": ((-0.9, -0.5), (-0.3, 0.6), (0.2, -0.3), (0.9, 0.4))},
    "polyline_tube": {"points": ((-0.8, -0.6, 0.3), (-0.3, 0.5, -0.3), (0.2, -0.3, -0.2), (0.8, 0.5, 0.4))},
    "flat_triangle": {"a": (-0.8, -0.6), "b": (0.9, -0.4), "c": (0.1, 0.8)},
    "triangle": {"a": (-0.9, -0.7, 0.2), "b": (0.9, -0.6, -0.1), "c": (0.0, 0.8, 0.1)},
    "quad": {"a": (-0.8, -0.6, 0.1), "b": (0.8, -0.6, 0.1), "c": (0.6, 0.7, -0.1), "d": (-0.6, 0.7, -0.1)},
    "stroke": {"a": (-0.7, -0.4), "b": (0.7, 0.5)},
    "line": {"a": (-0.6, -0.5, -0.2), "b": (0.6, 0.6, 0.3)},
    "bezier": {"a": (-0.8, -0.5), "b": (0.0, 1.2), "c": (0.8, -0.3)},
    "bezier_tube": {"a": (-0.8, -0.5, 0.2), "b": (0.1, 1.1, -0.6), "c": (0.8, -0.4, 0.3)},
}
"""Values of parameters that have no default."""


def usual(definition: Definition) -> Node:
    """A shape with its defaults, and with `USUAL` values where it has none."""
    return definition.make((), (), USUAL.get(definition.name, {}))


def parameters(definition: Definition, variant: int, random: np.random.Generator, shrink: float) -> dict[str, Any]:
    """The usual values for variant 0, else drawn ones; numbers, not vectors, shrink. Data keep their usual value."""
    needed = USUAL.get(definition.name, {})
    given: dict[str, Any] = {}
    for name, domain in definition.domains.items():
        fixed = domain.type is None and domain.holds is not int
        if (name in definition.defaults or name in needed) and (variant == 0 or fixed):
            given |= {name: needed[name]} if name in needed else {}
            continue
        value = draw(domain, random)
        if isinstance(value, float):
            least = max(domain.low, 0.0)
            value = least + (value - least) * shrink ** random.uniform()
        given[name] = value
    return given


# Samples


@dataclass(frozen=True)
class NodeSample:
    """A node to be tested, by the name of its definition and what it is made of."""

    definition: Definition
    name: str
    build: Callable[[], Node]

    @property
    def id(self) -> str:
        return f"{self.definition.name}-{self.name}"


def _drawn(definition: Definition, children: Sequence[Callable[[], Node]], name: str, variant: int) -> NodeSample:
    """A sample with drawn parameters, drawn again and ever smaller until they fit each other and the children."""

    def build() -> Node:
        random = np.random.default_rng(zlib.crc32(f"{definition.name} {name} {variant}".encode()))
        refused: Exception | None = None
        for attempt in range(40):
            given = parameters(definition, min(variant, 1) if attempt == 0 else 1, random, 0.8**attempt)
            try:
                node = definition.make([child() for child in children], (), given)
            except SceneError as error:
                refused = error
                continue
            field = Field(node)
            if node.exactness == "estimate" or np.count_nonzero(field.value(field.draw(random, 4000)) < 0) > 4:
                return node
        raise AssertionError(f"no legal parameters found for {definition.name}: add a line to SPECIAL") from refused

    return NodeSample(definition, f"{name} {variant}", build)


@cache
def makers() -> dict[str, Callable[..., Node]]:
    """Methods of nodes, by the definition that they make, where that has parameters which only the method knows.

    A twist, for one, is made for the radius of its child. Only methods are found that need no argument.
    """
    found: dict[str, Callable[..., Node]] = {}
    for name, method in METHODS.items():
        takes = list(inspect.signature(method).parameters.values())
        plain = [p.kind is p.POSITIONAL_OR_KEYWORD and p.default is not p.empty for p in takes[1:]]
        if takes[0].name == "node" and plain and all(plain):
            for dimension in (3, 2):
                try:
                    made = method(next(iter(CHILDREN[dimension].values()))())
                except SceneError:
                    continue
                if isinstance(made, Node) and made.definition.name != name:
                    found[made.definition.name] = method
    return found


def _made(definition: Definition, child: Callable[[], Node], name: str, variant: int) -> NodeSample:
    """A sample by way of a method, its numbers varied while they are legal."""
    method = makers()[definition.name]
    takes = list(inspect.signature(method).parameters.values())[1:]
    numbers = {p.name: p.default for p in takes if isinstance(p.default, float)}

    def build() -> Node:
        for factor in ((1.0, 0.5, -0.8, 1.4, 0.3, 2.0)[variant % 6], 1.0, 0.2):
            try:
                return method(child(), **{n: value * factor for n, value in numbers.items()})
            except SceneError:
                continue
        raise AssertionError(f"{method.__name__} refuses '{name}': add a line for {definition.name} to SPECIAL")

    return NodeSample(definition, f"{name} {variant}", build)


def _chosen(definition: Definition) -> Iterator[NodeSample]:
    if definition.name in SPECIAL:
        for name, build in SPECIAL[definition.name].items():
            yield NodeSample(definition, name, build)
    elif definition.name in makers():
        for variant, (name, child) in enumerate(CHILDREN[definition.child_dimension].items()):
            yield _made(definition, child, name, variant)
    elif definition.arity == "none":
        for variant in range(2 if definition.domains else 1):
            yield _drawn(definition, (), "shape", variant)
    elif definition.arity == "one":
        kinds = CHILDREN[definition.child_dimension]
        spared = zlib.crc32(definition.name.encode()) % (len(kinds) - 1)  # time is short: each operator leaves one out
        for variant, name in enumerate(kinds):
            if variant != spared + 1:
                yield _drawn(definition, (kinds[name],), name, variant)
    else:
        kinds = CHILDREN[definition.child_dimension]
        names = list(kinds)
        for variant, some in enumerate((names[:2], names[1:3][::-1], names)):
            yield _drawn(definition, [kinds[n] for n in some], f"{len(some)} children", variant)


@cache
def samples() -> list[NodeSample]:
    """All samples of all definitions of the package."""
    return [s for definition in definitions() for s in _chosen(definition)]


_kind, _flat = CHILDREN[3], CHILDREN[2]
_slanting = np.array([[0.8, 0.6, 0.0, 0.0], [-0.6, 0.8, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.3, -0.2, 0.5, 1.0]])
_shearing = np.array([[1.5, 0.4, 0.0, 0.0], [0.0, 0.7, 0.3, 0.0], [0.1, 0.0, -1.0, 0.0], [0.0, 0.4, 0.0, 1.0]])
_breath = 1.3 + 0.4 * cos(time + 0.5)
_sway = 0.4 * sin(time + 0.7)
_swaying = [[1.5, _sway, 0, 0], [0, 0.7 + _sway, 0.3, 0], [0.1, 0, -1.0, 0], [0, 0, 0, 1]]


def _blends(combine: Callable[..., Node], dimension: int, families: Sequence[str]) -> dict[str, Callable[[], Node]]:
    """Each family by its name; its other parameters belong to the family."""
    kinds = list(CHILDREN[dimension].values())
    return {name: lambda name=name: combine(kinds[0](), kinds[1](), kinds[3](), k=0.3, blend=name) for name in families}


_families = list(FAMILIES)

SPECIAL: dict[str, dict[str, Callable[[], Node]]] = {
    "smooth_union": _blends(union, 3, _families),
    "smooth_union_2d": _blends(union, 2, _families[:2]),
    "smooth_intersection": _blends(intersection, 3, ["quadratic", *_families[1::2]]),
    "smooth_intersection_2d": _blends(intersection, 2, _families[:2]),
    "smooth_difference": _blends(difference, 3, _families[::2]),
    "smooth_difference_2d": _blends(difference, 2, _families[:2]),
    "affine": {
        "rigid": lambda: transform(_kind["brick"](), _slanting),
        "rigid bitten": lambda: transform(_kind["bitten"](), _slanting),
        "enlarged": lambda: transform(_kind["slanted"](), np.diag([1.5, 1.5, 1.5, 1.0])),
        "sheared": lambda: transform(_kind["brick"](), _shearing),
        "sheared stretched": lambda: transform(_kind["stretched"](), _shearing),
    },
    "affine_2d": {
        "rigid": lambda: transform(_flat["bitten disc"](), _slanting[np.ix_([0, 1, 3], [0, 1, 3])]),
        "sheared": lambda: transform(_flat["disc aside"](), [[1.5, 0.4, 0.0], [-0.2, 0.7, 0.0], [0.3, 0.1, 1.0]]),
    },
    "linear_map": {
        "sheared": lambda: transform(_kind["brick"](), _swaying),
        "stretched": lambda: transform(_kind["slanted"](), np.diag([_breath, 1.0, _breath, 1.0])),
        "sheared bitten": lambda: transform(_kind["bitten"](), _swaying),
        "sheared stretched": lambda: transform(_kind["stretched"](), _swaying),
    },
    "linear_map_2d": {
        "sheared": lambda: transform(_flat["disc aside"](), [[_breath, 0.4, 0.0], [-0.2, 0.7, 0.0], [0.0, 0.0, 1.0]]),
        "bitten": lambda: transform(_flat["bitten disc"](), np.diag([_breath, 1.0, 1.0])),
    },
    "repeat_cells_2d": {
        "without end": lambda: repeat(_flat["disc"](), 1.5),
        "aside": lambda: repeat(_flat["disc aside"](), (1.0, 1.2), (3, 2)),
        "bitten": lambda: repeat(_flat["bitten disc"](), (1.1, None), (4, 1)),
        "stretched": lambda: repeat(_flat["stretched disc"](), (1.6, 1.0), (None, 3)),
    },
    "varied_cells": {
        "without end": lambda: repeat_varied(lambda index: sphere(0.3 + 0.1 * sin(index.x + 2.0 * index.y)), 1.0),
        "turned bricks": lambda: repeat_varied(
            lambda index: box((0.9, 0.5, 0.7)).rotate(index.x).translate((0.0, 0.1 * index.z, 0.0)),
            (1.6, None, 1.6),
            (3, 1, 2),
        ),
    },
    "closed_outline": {
        "lines and arcs": lambda: (
            sketch((-0.8, -0.6))
            .line_to((0.7, -0.5))
            .arc_through((0.9, 0.1), (0.4, 0.6))
            .line_to((0.1, 0.1))
            .arc_to((-0.6, 0.5), -0.5)
            .fillet(0.1)
            .hole(sketch((-0.4, -0.3)).arc_to((-0.1, -0.3), 0.15).arc_to((-0.4, -0.3), 0.15))
            .close()
        ),
        "table": lambda: (
            sketch((0.8, 0.0))
            .spline_to([(0.3, 0.5), (-0.5, 0.7), (-0.7, -0.3), (0.1, -0.6), (0.8, 0.0)], tolerance=1e-4)
            .close()
        ),
    },
    "displaced": {
        "ripples": lambda: displaced(_kind["ball aside"]()),
        "derived": lambda: displace_by(_kind["slanted"](), lambda p: 0.04 * sin(9.0 * p.x) * cos(7.0 * p.y + p.z)),
        "derived in a box": lambda: displace_by(_kind["brick"](), lambda p: 0.3 * p.x * p.y - 0.1 * p.z * p.z),
        "without end": lambda: displace_by(plane(), lambda p: 0.05 * sin(5.0 * p.x)),
        "noise of a user": lambda: displace_by(
            _kind["stretched"](), lambda p: 0.05 * lattice_noise(4.0 * p), 0.05, 0.2 * math.pi
        ),
    },
    "warped": {
        "waves": lambda: warped(_kind["ball aside"]()),
        "of a user": lambda: warp(_kind["slanted"](), lambda p: 0.06 * sin(5.0 * p.zxy)),
        "in a box": lambda: warp(_kind["brick"](), lambda p: vec3(0.0, 0.3 * p.x * p.x, 0.2 * p.x * p.y)),
        "without end": lambda: warp(plane(), lambda p: 0.05 * cos(6.0 * p.yxx)),
    },
    "wrapped": {
        "slab": lambda: wrap_around(box((6.0, 1.0, 0.4))),
        "balls": lambda: wrap_around(repeat(sphere(0.3), (1.0, None, None), 6), -3.0, 3.0),
        "aside": lambda: wrap_around(_kind["pair"](), -0.9, 1.3),
        "stretched": lambda: wrap_around(_kind["stretched"](), -2.5, 2.0),
        "bitten high": lambda: wrap_around(_kind["bitten"]().translate((0.0, 0.4, 0.2)), -2.0, 2.0),
    },
    "transition_between": {
        "brick to ball": lambda: transition(_kind["brick"](), sphere(0.5), (0.0, -0.2, 0.0), (0.0, 0.2, 0.0)),
        "aslant": lambda: transition(_kind["stretched"](), _kind["bitten"](), (-0.5, -0.1, 0.0), (0.4, 0.3, 0.1)),
        "pair": lambda: transition(_kind["pair"](), _kind["slanted"](), (0.5, 0.0, 0.0), (-0.5, 0.0, 0.0)),
    },
    "implicit_solid": {
        "quadric": lambda: implicit_solid(),
        "tangle cube": lambda: implicit(lambda p: p.x**4 + p.y**4 + p.z**4 - 5 * dot(p, p) + 11.8, 2.6),
        "waves, cut": lambda: implicit(lambda p: sin(3 * p.x) * cos(2 * p.y) + 0.5 * p.z, ((-1, -1, -1.3), (1, 1, 1))),
        "cone": lambda: implicit(lambda p: p.x * p.x + p.z * p.z - p.y * p.y, 1.0, 0.05),
    },
    "labelled": {"brick": lambda: material(_kind["brick"](), Material((0.8, 0.2, 0.1)))},
    "repeat_cells": {
        "without end": lambda: repeat(_kind["brick"](), 1.5),
        "ball aside": lambda: repeat(_kind["ball aside"](), (1.0, None, 1.3), (3, 1, 2)),
        "even count": lambda: repeat(_kind["slanted"](), (1.4, 1.2, None), (4, 2, 1)),
        "bitten": lambda: repeat(_kind["bitten"](), (1.1, 1.0, 1.2), (2, 3, None)),
        "stretched": lambda: repeat(_kind["stretched"](), (1.8, None, None)),
    },
}


# Looking at a node


class Field:
    """A node's field, ready to be evaluated at many points, and where it is worth looking at."""

    def __init__(self, node: Node) -> None:
        self.node = node
        self.definition = definition = field_of(node)
        self._value = evaluator([definition.body], definition.params)
        self.dimension = node.dimension
        low, high = node.bounds
        if node.facts.empty:
            low, high = np.minimum(low, high), np.maximum(low, high)
        finite = np.isfinite(low) & np.isfinite(high)
        extent = float(np.max((high - low)[finite], initial=0.0)) or 2.0
        middle = np.where(finite, 0.5 * (np.where(finite, low, 0) + np.where(finite, high, 0)), 0.0)
        half = np.where(finite, 0.5 * np.where(finite, high - low, 0.0), extent)
        self.size = max(extent, 1e-3)
        """Edge of the solid's box, the unit that errors are measured in."""
        self.low, self.high = middle - half - 0.4 * self.size, middle + half + 0.4 * self.size
        """The region looked at: the box and its surroundings."""

    @cached_property
    def _single(self) -> Callable[..., Any]:
        return evaluator([self.definition.body], self.definition.params, np.float32)

    @cached_property
    def companion(self) -> Function:
        """The function of the gradient and the value."""
        return companion(self.definition)

    @cached_property
    def _whole(self) -> Callable[..., Any]:
        return evaluator([self.companion.body], self.companion.params)

    @cached_property
    def _whole_single(self) -> Callable[..., Any]:
        return evaluator([self.companion.body], self.companion.params, np.float32)

    def value(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.broadcast_to(self._value(points)[0], points.shape[:-1])

    def single(self, points: NDArray[np.float64]) -> NDArray[np.float32]:
        """The value in float32."""
        return np.broadcast_to(self._single(points)[0], points.shape[:-1])

    def gradient(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        return self.whole(points)[..., :-1]

    def whole(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """The gradient, and the value as its last component."""
        return np.broadcast_to(self._whole(points)[0], (*points.shape[:-1], self.dimension + 1))

    def whole_single(self, points: NDArray[np.float64]) -> NDArray[np.float32]:
        """The same in float32."""
        return np.broadcast_to(self._whole_single(points)[0], (*points.shape[:-1], self.dimension + 1))

    def draw(self, random: np.random.Generator, count: int) -> NDArray[np.float64]:
        """Points of the region, float32 numbers."""
        drawn = random.uniform(self.low, self.high, (count, self.dimension))
        return drawn.astype(np.float32).astype(np.float64)

    def surface(
        self, random: np.random.Generator, points: NDArray[np.float64], values: NDArray[np.float64], count: int
    ) -> NDArray[np.float64]:
        """Points on the surface, on segments between points whose values are known."""
        inside, outside = np.flatnonzero(values < 0), np.flatnonzero(values > 0)
        if not len(inside) or not len(outside):
            return np.empty((0, self.dimension))
        a = inside[random.integers(len(inside), size=count)]
        b = outside[random.integers(len(outside), size=count)]
        near = outside[random.integers(len(outside), size=(count, 8))]  # short segments find more of the details
        best = np.argmin(((points[near] - points[a][:, None]) ** 2).sum(axis=-1), axis=1)
        b[::2] = near[np.arange(count), best][::2]
        return self._crossing(points[a], points[b], values[a], values[b])

    def _crossing(
        self, a: NDArray[np.float64], b: NDArray[np.float64], low: NDArray[np.float64], high: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Points of change from `low` < 0 at a to `high` > 0 at b: bisection and regula falsi (Illinois) in turn.

        A share of a segment is found to 2^-38; at a crossing without a jump that takes some eight steps.
        """
        way, low, high = b - a, low.copy(), high.copy()
        bottom, top = np.zeros(len(a)), np.ones(len(a))
        left = np.arange(len(a))
        for step in range(80):
            at, to, under, above = bottom[left], top[left], low[left], high[left]
            guess = 0.5 * (at + to) if step % 4 == 3 else at - under * (to - at) / (above - under)
            found = self.value(a[left] + guess[:, None] * way[left])
            negative = found < 0
            before = np.where(negative, under, above)  # an end that stays counts half from the second time on
            same = np.abs(found) < 0.5 * np.abs(before)
            bottom[left], top[left] = np.where(negative, guess, at), np.where(negative, to, guess)
            low[left] = np.where(negative, found, under * np.where(same, 0.5, 1.0))
            high[left] = np.where(negative, above * np.where(same, 0.5, 1.0), found)
            exact = np.abs(found) <= 1e-13 * self.size
            bottom[left[exact]] = top[left[exact]] = guess[exact]
            left = left[top[left] - bottom[left] > 2.0**-38]
            if not len(left):
                break
        return a + (0.5 * (bottom + top))[:, None] * way


@dataclass(eq=False)
class Seen:
    """A sample's node, with its field at many points."""

    sample: NodeSample
    node: Node
    field: Field
    points: NDArray[np.float64]
    values: NDArray[np.float64]

    @cached_property
    def text(self) -> str:
        """GLSL of the field."""
        return self.node.glsl()

    @cached_property
    def gradients(self) -> NDArray[np.float64]:
        """Of the first 5000 points."""
        return self.field.gradient(self.points[:5000])

    @cached_property
    def surface(self) -> NDArray[np.float64]:
        """2000 points on the surface; none where the solid is empty."""
        return self.field.surface(np.random.default_rng(14), self.points, self.values, 2000)

    @property
    def means(self) -> list[float]:
        """Means of the values, of their sizes, and with two random signs for each point: no other field has them."""
        signs = np.random.default_rng(17).choice([-1.0, 1.0], (2, len(self.values)))
        weighted = [self.values, np.abs(self.values), signs[0] * self.values, signs[1] * np.abs(self.values)]
        return [float(f"{w.mean():.10g}") for w in weighted]


def look_at(sample: NodeSample) -> Seen:
    node = sample.build()
    field = Field(node)
    points = field.draw(np.random.default_rng(11), POINTS)
    return Seen(sample, node, field, points, field.value(points))
