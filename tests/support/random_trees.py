"""Random trees of nodes, drawn by Hypothesis from every definition of the package."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Sequence

import numpy as np
from hypothesis import strategies as st

from raymarch.errors import SceneError
from raymarch.expr.node import Expr
from raymarch.expr.vocabulary import sin
from raymarch.scene import Material
from raymarch.sdf import Node, repeat, sphere, transform
from tests.support.node_samples import SPECIAL, Field, definitions, parameters

OWN: dict[str, Callable[[Node, np.random.Generator], Node]] = {
    "affine": lambda node, random: transform(node, _affine(random)),
    "repeat_cells": lambda node, random: repeat(
        node, node.facts.size * random.uniform(1.0, 1.6, 3) + 1e-3, tuple(int(n) for n in random.integers(1, 5, 3))
    ),
    "labelled": lambda node, random: node.material(Material()),
    "warped": lambda node, random: node.warp(_waves(random)),
    "displaced": lambda node, random: _displaced(node, _waves(random)),
    "sheared": lambda node, random: node.shear(random.uniform(-1.0, 1.0), *random.permutation(list("xyz"))[:2]),
}
"""How operators with a line in SPECIAL, or whose vectors must fit each other, are applied to any node."""


def _waves(random: np.random.Generator) -> Callable[[Expr], Expr]:
    """A vec3 of waves, which change by at most 0.9 a unit of length, or of a polynomial that has no limit."""
    size, phase, along = random.uniform(0.02, 0.2), random.uniform(-3, 3), "".join(random.choice(list("xyz"), 3))
    if random.random() < 0.3:
        return lambda p: size * (getattr(p, along) * p.yzx + 0.5 * p)
    frequency = random.uniform(0.3, 0.9) / size / 3.0**0.5
    return lambda p: size * sin(frequency * getattr(p, along) + phase)


def _displaced(node: Node, waves: Callable[[Expr], Expr]) -> Node:
    return node.displace_by(lambda p: waves(p).x)


def _affine(random: np.random.Generator) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, :3] = np.eye(3) + 0.5 * random.normal(size=(3, 3))
    matrix[3, :3] = random.normal(size=3)
    return matrix


USABLE = [
    d for d in definitions() if d.dimension == d.child_dimension == 3 and (d.name not in SPECIAL or d.name in OWN)
]
BY_ARITY = {arity: [d for d in USABLE if d.arity == arity] for arity in ("none", "one", "many")}


def made(name: str, children: Sequence[Node], seed: int) -> Node:
    """A node of a definition with drawn parameters; where none of some attempts fits, its first child, or a ball."""
    random = np.random.default_rng(zlib.crc32(f"{name} {seed}".encode()))
    definition = next(d for d in USABLE if d.name == name)
    for attempt in range(6):
        try:
            if name in OWN:
                return OWN[name](children[0], random)
            given = parameters(definition, min(seed + attempt, 1), random, 0.8**attempt)
            return definition.make(children, (), given)
        except SceneError:  # the child is too large, or has no end, or parameters do not fit each other
            continue
    return children[0] if children else sphere(0.5)


def names(arity: str) -> st.SearchStrategy[str]:
    return st.sampled_from([d.name for d in BY_ARITY[arity]])


seeds = st.integers(0, 200)
shapes = st.builds(lambda name, seed: made(name, [], seed), names("none"), seeds)


def grown(children: st.SearchStrategy[Node]) -> st.SearchStrategy[Node]:
    one = st.builds(lambda name, child, seed: made(name, [child], seed), names("one"), children, seeds)
    many = st.builds(made, names("many"), st.lists(children, min_size=2, max_size=3), seeds)
    return one | one | many


trees = shapes
for _ in range(8):
    trees = shapes | grown(trees)
deep_trees = grown(trees)


def looked_at(node: Node) -> tuple[Field, np.ndarray, np.ndarray]:
    field = Field(node)
    points = field.draw(np.random.default_rng(1), 2000)
    return field, points, field.value(points)
