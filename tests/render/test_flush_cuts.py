"""Cuts that are flush with a face leave no membrane; thin skins, sheets and shells stay."""

from __future__ import annotations

import numpy as np
import pytest

import raymarch as rm
from raymarch.plan import plan
from tests.lab.flush_cuts import (
    ALL_GLASS,
    CASES,
    FLOOR,
    GLASS,
    HALF,
    PIXEL,
    camera,
    differences,
    drilled,
    random_case,
    shells,
)

SHORT = (
    *("plate .001", "each far", "shadow", "mirror", "xor", "xor of itself", "complement of a union"),
    *("touching glass", "touching glass of many", "glass instances", "endless glass cells"),
)
AHEAD = ("extruded", "itself", "glass cells")
ADVANCE = rm.Quality(tracer="advance")
ALLOWED = 2
"""Pixels whose ray passes an edge within the error of a hit."""


@pytest.fixture
def small(renderer: rm.Renderer) -> rm.Renderer:
    renderer.resize((64, 36))
    return renderer


@pytest.mark.parametrize("name", SHORT)
def test_no_membrane_is_drawn(name: str, small: rm.Renderer) -> None:
    flush, clear, given = CASES[name]
    shader, truth = differences(small, flush, clear, **given)
    assert max(shader) <= ALLOWED and max(truth) <= 1


@pytest.mark.parametrize("name", AHEAD)
def test_no_membrane_is_drawn_by_rays_that_ask_how_far_they_are_free(name: str, small: rm.Renderer) -> None:
    flush, clear, given = CASES[name]
    quality = given.get("quality", ADVANCE).replace(tracer="advance")
    shader, _ = differences(small, flush, clear, **{**given, "quality": quality})
    assert max(shader) <= ALLOWED


def test_no_membrane_of_random_tools_is_drawn(small: rm.Renderer) -> None:
    """More: python -m tests.lab.flush_cuts."""
    flush, clear, given = random_case(4)
    shader, truth = differences(small, flush, clear, **given)
    assert max(shader) <= ALLOWED and max(truth) <= 1


def test_a_tool_moves_through_the_face(small: rm.Renderer) -> None:
    """A skin of a hundredth of a pixel is drawn, one of no thickness is not."""
    deep = rm.Param("deep", 10.0, 8.0, 12.0)
    scene = rm.Scene(rm.box((40, 10, 40)) - rm.cylinder(8, 1).scale((1, deep, 1)), camera(), lights=[])
    height, width = small.size[1], small.size[0]
    hit = {}
    for value in (10.0 - 0.05 * PIXEL, 10.0, 10.0 + 0.002 * PIXEL, 11.0):
        frame = small.render(scene, params={"deep": value}, outputs=("depth",))
        hit[value] = bool(np.isfinite(frame.depth[height // 2, width // 2]))
    assert list(hit.values()) == [True, False, False, False]


@pytest.mark.parametrize("tracer", ["bracketing", "advance"])
@pytest.mark.parametrize("name", ["box", "sheet", "turned sheet"])
def test_what_is_a_thousandth_of_a_pixel_thick_is_drawn(name: str, tracer: str, small: rm.Renderer) -> None:
    node = shells(2.5e-3)[name]
    shader, _ = differences(small, node, node, lights=[], quality=rm.Quality(tracer=tracer))
    assert max(shader) <= ALLOWED


def test_a_shell_is_hit_in_front(small: rm.Renderer) -> None:
    """A sample in the rear half of a thin shell does not put the hit there, where the normal is that of the cavity."""
    node = shells(2.5e-3)["box"]
    for tracer in ("bracketing", "advance"):
        shader, _ = differences(small, node, node, quality=rm.Quality(tracer=tracer))
        assert shader[2] <= 8


def test_a_disc_without_thickness_beside_a_cut_is_drawn(small: rm.Renderer) -> None:
    scene = rm.Scene(rm.disc(20, 0.0) | (rm.box(10) - rm.sphere(6)).translate((0, 20, 0)), camera(), lights=[])
    assert "CUTS" not in plan(scene).variants
    shown = np.isfinite(small.render(scene, outputs=("depth",)).depth)
    hit = rm.truth(scene, small.size).hit
    assert hit.sum() > 300 and shown[hit].all()


def test_glass_that_stands_on_a_floor_shows_the_floor() -> None:
    """Glass that touches glass is one solid; what it stands on is a surface. With both, a doubt says so."""
    half = HALF.material(GLASS)
    pair = half.translate((-5, 0, 0)) | half.translate((5, 0, 0))
    floor = rm.plane(offset=-10)
    overlapping = half.translate((-4.9, 0, 0)) | half.translate((5, 0, 0))
    for node, cuts, doubted in (
        (pair | FLOOR, True, False),
        (half | floor, False, False),
        (pair | floor, False, True),
        (overlapping | floor, False, False),
        (HALF.translate((-5, 0, 0)) | HALF.translate((5, 0, 0)) | floor, False, False),
    ):
        made = plan(rm.Scene(node, camera(), **ALL_GLASS))
        assert ("CUTS" in made.variants) == cuts
        assert any("glass solids touch" in doubt for doubt in made.warnings) == doubted


TILE = rm.Material(color=(0.8, 0.5, 0.3))
PEARL = rm.sphere(6).material(rm.Material(color=(0.9, 0.2, 0.1)))


@pytest.mark.parametrize(
    "name, integrator",
    [
        ("a cut elsewhere", "whitted"),
        ("a cut elsewhere", "path"),
        ("a pearl", "whitted"),
        ("a sunken block", "whitted"),
    ],
)
def test_rays_in_glass_see_what_it_touches(name: str, integrator: str, small: rm.Renderer) -> None:
    """As with a gap of a five hundredth of a pixel. A cut leaves faces that are none; these are surfaces."""
    ball, block = rm.sphere(14).material(GLASS), rm.box(20).material(GLASS)
    tile, drill = rm.plane(offset=-10).material(TILE), drilled().translate((0, 0, -60))
    deeper = rm.plane(offset=-9).material(TILE)
    touching, apart = {
        "a cut elsewhere": (block | tile | drill, block | rm.plane(offset=-10.001).material(TILE) | drill),
        "a pearl": ((ball - PEARL) | PEARL, (ball - rm.sphere(6.001)) | PEARL),
        "a sunken block": ((block - deeper) | deeper, (block - rm.plane(offset=-8.999)) | deeper),
    }[name]
    quality = rm.Quality(integrator=integrator, samples=16 if integrator == "path" else 1)
    seen, wanted = (
        small.render(rm.Scene(node, camera(), lights=[rm.Sun()], bounces=4, quality=quality)).color
        for node in (touching, apart)
    )
    noise = 0.01 if integrator == "path" else 1e-3
    assert np.all(np.abs(np.mean(seen - wanted, axis=(0, 1))) < noise)


def test_wax_that_touches_wax_is_doubted() -> None:
    """Walks below its surface end at the face between: a seam that no solid in one piece has."""
    wax = rm.Material(albedo=(0.9, 0.5, 0.4), subsurface=1, subsurface_radius=3)
    for apart, doubted in ((5.0, True), (4.9, False)):
        pair = (HALF.translate((-apart, 0, 0)) | HALF.translate((apart, 0, 0))).material(wax)
        scene = rm.Scene(pair, camera(), bounces=2)
        assert any("touch at a face" in doubt for doubt in plan(scene).warnings) == doubted
        assert not any("touch at a face" in doubt for doubt in plan(scene.replace(bounces=0)).warnings)
