"""Two-sided penumbras of gaps and rods that are narrower than the light's disc are doubted, and others are not."""

from __future__ import annotations

import numpy as np
import pytest

import raymarch as rm
from raymarch.plan.narrow import narrow

SLANTED = (0.63, 0.61, 0.48)


def told(node: rm.Node, to_light: tuple[float, float, float], softness: float) -> list[str]:
    """What is doubted of solids about (0, 2, 0) above a floor."""
    sun = rm.Sun(to_light, shadow=True, softness=softness)
    scene = rm.Scene(node.translate((0, 2, 0)) | rm.plane(), lights=[sun])
    return [what for doubt in narrow(scene) for what in ("gaps", "rods") if what in str(doubt)]


def slabs(gap: float, thickness: float) -> rm.Node:
    """Two slabs, with a gap between them along z."""
    slab, at = rm.box((16, thickness, 22)), 8 + 0.5 * gap
    return slab.translate((at, 0, 0)) | slab.translate((-at, 0, 0))


def test_a_deep_gap_that_the_light_meets_aslant_is_doubted() -> None:
    """No ray to the middle of the disc passes it, but those to its border do."""
    disc = 0.24 * 2.0 / SLANTED[1]
    assert told(slabs(1.5 * disc, 1.2), SLANTED, 0.24) == ["gaps"]
    assert told(slabs(6.0 * disc, 1.2), SLANTED, 0.24) == []


@pytest.mark.parametrize("turn", [0.0, 0.4, np.pi / 4])
def test_a_rod_is_doubted_however_it_is_turned_about_its_length(turn: float) -> None:
    """Its sides are beside the light's direction, or lean from it on both sides."""

    def rod(wide: float) -> rm.Node:
        return rm.box((wide, wide, 4)).rotate(turn, "z")

    assert told(rod(0.1), (0, 1, 0), 0.1) == ["rods"]
    assert told(rod(1.0), (0, 1, 0), 0.1) == []


@pytest.mark.parametrize("tilt", [0.0, 0.5, 1.0])
def test_a_wide_solid_is_not_doubted(tilt: float) -> None:
    to_light = (float(np.sin(tilt)), float(np.cos(tilt)), 0.0)
    for node in (rm.sphere(1.0), rm.box((3, 1, 3)), rm.box((3, 0.3, 3))):
        assert told(node, to_light, 0.05) == []


def test_a_light_below_a_wide_lid_divides_by_nothing() -> None:
    """The suite turns warnings of NumPy into errors: rays upwards meet nothing, infinitely far away."""
    lid = rm.box((2, 0.2, 2)).translate((0, 1.4, 0))
    scene = rm.Scene(lid | rm.plane(), lights=[rm.SphereLight((0, 1, 0), 0.3, shadow=True)])
    assert narrow(scene) == []
