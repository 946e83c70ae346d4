"""Look-ups of pictures on exclusive sides of a choice: one for all, with the same values."""

from __future__ import annotations

import numpy as np
import pytest

from raymarch.expr.arrays import evaluator
from raymarch.expr.choices import FEW, merge_reads
from raymarch.expr.node import Expr, const, var
from raymarch.expr.texels import Texels, Wrap
from raymarch.expr.textures import interval, texture
from raymarch.expr.types import FLOAT, VEC2
from raymarch.expr.vocabulary import where
from raymarch.expr.walk import find

AT, WHICH = var("at", VEC2), var("which", FLOAT)


def pictures(count: int, channels: int = 1) -> list[Texels]:
    rng = np.random.default_rng(7)
    wraps: list[Wrap] = ["repeat", "mirror", "clamp"]
    return [Texels(rng.uniform(0.2, 1, (1 + k % 7, 3 + k % 5, channels)), wraps[k % 3]) for k in range(count)]


def chosen(leaves: list[Expr], low: int = 0) -> Expr:
    """A balanced tree of choices by WHICH."""
    if len(leaves) == 1:
        return leaves[0]
    half = len(leaves) // 2
    return where(WHICH - low < half - 0.5, chosen(leaves[:half], low), chosen(leaves[half:], low + half))


def seen(k: int, count: int) -> Expr:
    """The weight of a part: 1 where it is chosen, by the same conditions."""
    return chosen([const(1.0 if i == k else 0.0) for i in range(count)])


def looked_up(data: Texels, k: int, weight: Expr | float = 1.0) -> Expr:
    return texture(data, AT * (1.0 + k), (0.1, 0.02 * k), (0.0, 0.1), weight)


def same_values(old: Expr, new: Expr, count: int) -> None:
    rng = np.random.default_rng(1)
    at, which = rng.uniform(-1, 2, (400, 2)), rng.integers(0, count, 400).astype(float)
    wanted, found = (evaluator([e], [AT, WHICH])(at, which)[0] for e in (old, new))
    np.testing.assert_array_equal(found, wanted)


@pytest.mark.parametrize("channels", [1, 2, 3])
def test_a_choice_between_many_pictures_has_one_look_up(channels: int) -> None:
    tree = chosen([looked_up(data, k, seen(k, 20)) for k, data in enumerate(pictures(20, channels))])
    (merged,) = merge_reads([tree])
    (read,) = find([merged], "texture_in_atlas")
    assert not find([merged], "texture") and read.args[-1] is const(1.0), "the weight of the part that is seen is 1"
    same_values(tree, merged, 20)
    low, high = interval(read)
    assert np.all(low <= 0.0) and np.all(high >= 0.99)


def test_a_leaf_without_a_picture_reads_none() -> None:
    leaves = [looked_up(data, k) if k % 3 else const(0.5) for k, data in enumerate(pictures(20))]
    (merged,) = merge_reads([chosen(leaves)])
    (read,) = find([merged], "texture_in_atlas")
    weight = evaluator([read.args[-1]], [AT, WHICH])(np.zeros((20, 2)), np.arange(20.0))[0]
    np.testing.assert_array_equal(weight, np.arange(20) % 3 > 0)
    same_values(chosen(leaves), merged, 20)


def test_there_are_as_many_look_ups_as_the_leaf_with_most_has() -> None:
    data = pictures(30)
    leaves = [looked_up(data[k], k) * (looked_up(data[k + 10], 1) + looked_up(data[k + 20], 2)) for k in range(10)]
    (merged,) = merge_reads([chosen([*leaves, looked_up(data[0], 5)])])
    assert len(find([merged], "texture_in_atlas")) == 3 and not find([merged], "texture")
    same_values(chosen([*leaves, looked_up(data[0], 5)]), merged, 11)


def test_few_pictures_keep_their_textures() -> None:
    tree = chosen([looked_up(data, k) for k, data in enumerate(pictures(FEW))])
    assert merge_reads([tree]) == [tree]


def test_pictures_of_different_channels_are_in_different_atlases() -> None:
    one, three = pictures(6), pictures(6, 3)
    tree = chosen([looked_up(one[k], k) * looked_up(three[k], k) for k in range(6)])
    (merged,) = merge_reads([tree])
    assert sorted(read.data.channels for read in find([merged], "texture_in_atlas")) == [1, 3]
    same_values(tree, merged, 6)
