"""Facts are derived when they are read, those of all nodes of one definition at once."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.sdf.definition import Definition
from raymarch.sdf.pickling import name_of, pickled, remake
from tests.support.node_samples import definitions, samples


def as_numbers(facts: Any) -> list[object]:
    values = [getattr(facts, f.name) for f in fields(facts)]
    return [v.tolist() if isinstance(v, np.ndarray) else as_numbers(v) if is_dataclass(v) else v for v in values]


@pytest.mark.parametrize("dimension", [2, 3])
def test_many_nodes_have_the_facts_of_each(dimension: int) -> None:
    alone = [s.build() for s in samples() if s.definition.dimension == dimension]
    together = [remake(pickled(node)) for node in alone]
    assert sum(node.known_facts is None for node in together) > 0.5 * len(together)
    assert rm.union(*together).facts.lower.shape == (dimension,)
    for one, other in zip(alone, together, strict=True):
        assert other.known_facts is not None
        single = other.definition.derive(other.children, other.params)
        assert as_numbers(one.facts) == as_numbers(other.known_facts) == as_numbers(single), one


def test_constants_beside_parameters() -> None:
    """Intervals of one number, and wider ones, in the same place of nodes of one definition."""
    moved = rm.Param("moved", 0.0, -2.0, 3.0)
    nodes = [rm.box((0.2 * i, 1, 1)).rotate(0.3 * i, (1, i, 2)).translate((i * moved, i, moved)) for i in range(1, 6)]
    nodes += [rm.box(0.1 * i).rotate(moved * i, "x").translate((i, 1.0, 0.0)) for i in range(1, 6)]
    nodes += [rm.box(0.1 * i).rotate(i, (1, i, 0)).translate((i, 1.0, 0.0)) for i in range(1, 6)]
    assert rm.union(*nodes).facts.lower.shape == (3,)
    for node in nodes:
        assert as_numbers(node.facts) == as_numbers(node.definition.derive(node.children, node.params))


def test_a_hidden_bound_keeps_its_spread() -> None:
    """What grows or blends it needs the spread for its box."""
    bound = rm.sphere(1).scale((1, 2, 3))
    hidden = bound.visible(shadow=False)
    assert hidden.exactness == "bound"
    assert hidden.facts.spread == bound.facts.spread
    assert np.array_equal(hidden.round(0.1).bounds, bound.round(0.1).bounds)


def test_nothing_is_derived_until_it_is_read() -> None:
    node = rm.box(1).rotate(0.3, "x").translate((1, 2, 3)) | rm.sphere(1)
    assert all(n.known_facts is None for n in (node, *node.children))
    assert node.bounds[0].shape == (3,)
    assert all(n.known_facts is not None for n in (node, *node.children))


@pytest.mark.parametrize("definition", definitions(), ids=lambda definition: definition.name)
def test_a_definition_is_found_by_the_name_that_a_pickle_keeps(definition: Definition) -> None:
    """Also where a public function of that name stands in front of it."""
    assert name_of(definition)[1] == definition.source.__qualname__
