"""Ambient occlusion and penumbras read distances: they do not depend on how a solid is written."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.cost.effects import evaluations_of
from raymarch.plan import plan


@pytest.fixture(scope="module")
def renderer() -> Iterator[rm.Renderer]:
    with rm.Renderer(size=(15, 15)) as made:
        yield made


BOX = rm.box(1)
WRITTEN = {
    "sheared": BOX.shear(1.0).shear(-1.0),
    "twist": BOX.twist(2),
    "displace": BOX.displace(1e-3, 500),
    "chamfer": rm.union(BOX, rm.box((0.5, 0.5, 2)), k=0.1, blend="chamfer"),
    "blended": rm.union(BOX.shear(1.0).shear(-1.0), rm.box(0.2), k=0.1),
}


@pytest.mark.parametrize("name", WRITTEN)
def test_a_convex_solid_occludes_nothing_of_itself(renderer: rm.Renderer, name: str) -> None:
    camera = rm.Camera(position=(0, 9, 0.001), target=(0, 0, 0), fov=3)
    scene = rm.Scene(WRITTEN[name], camera, lights=[], sky=rm.Sky((1, 1, 1), light=True))
    dimmed = scene.replace(occlusion=rm.AmbientOcclusion(reach=0.5))
    bright = renderer.render(scene).color
    leaning = 0.12 if name == "displace" else 0.01  # the normals of waves lean by up to 27 degrees
    np.testing.assert_allclose(renderer.render(dimmed).color, bright, rtol=leaning)
    np.testing.assert_allclose(rm.truth(dimmed, size=(3, 3)).color, bright[:3, :3], rtol=leaning)


@pytest.mark.parametrize("penumbra", ["two-sided", "cone", "triangulated"])
def test_a_penumbra_is_as_wide_however_its_solid_is_written(renderer: rm.Renderer, penumbra: str) -> None:
    plate = rm.box((2, 0.4, 2))
    camera = rm.Camera(position=(0, 0.75, 0.001), target=(0, 0, 0), fov=60)
    light = rm.Sun(sun_direction=(0, 1, 0), shadow=True, softness=0.2, penumbra=penumbra)
    found = []
    for solid in (plate, plate.shear(1.0).shear(-1.0), plate.displace(1e-4, 8000)):
        scene = rm.Scene(solid.translate((-1, 1, 0)) | rm.plane(), camera, lights=[light], sky=rm.Sky((0, 0, 0)))
        found.append(renderer.render(scene).color[7, :, 0])
    assert np.ptp(found[0]) > 0.5
    for other in found[1:]:
        np.testing.assert_allclose(other, found[0], atol=0.06)


def test_what_reads_short_distances_is_doubted(renderer: rm.Renderer) -> None:
    scene = rm.Scene(rm.sphere().scale((3, 0.5, 0.5)), occlusion=rm.AmbientOcclusion(), sky=rm.Sky(light=True))
    (doubt,) = [doubt for doubt in renderer.render(scene).doubts() if "AmbientOcclusion" in doubt]
    assert "0.17 times" in doubt
    for plain in (scene.replace(occlusion=None), scene.replace(node=BOX)):
        assert not [doubt for doubt in renderer.render(plain).doubts() if "AmbientOcclusion" in doubt]


def test_an_uneven_scale_is_read_over_its_slope(renderer: rm.Renderer) -> None:
    """To first order at the surface, which is exact beside a cylinder."""
    spelled = [
        (rm.cylinder(0.5, 0.8).scale((2, 0.5, 2)), rm.cylinder(1, 0.4), 0.002),
        (rm.sphere().scale((1, 0.5, 1)), rm.ellipsoid((2, 1, 2)), 0.03),
    ]
    for scaled, exact, error in spelled:
        scene = rm.Scene(exact, rm.Camera((3, 2, 4), (0, 0, 0), fov=30), lights=[], sky=rm.Sky((1, 1, 1), light=True))
        scene = scene.replace(occlusion=rm.AmbientOcclusion(reach=0.5))
        wanted = renderer.render(scene).color
        found = scene.replace(node=scaled)
        assert np.quantile(np.abs(renderer.render(found).color - wanted), 0.95) <= error  # but for silhouettes
        np.testing.assert_allclose(rm.truth(found, size=(15, 15)).color, renderer.render(found).color, atol=0.01)


@pytest.mark.parametrize("flush", ["drilled", "xor"])
def test_a_membrane_that_an_effect_reads_is_doubted(flush: str) -> None:
    """A tool as long as the plate is thick leaves one if it is none that is made longer. A longer one, and rays that
    need a sample inside, do not."""

    def doubts(height: float, **given: object) -> list[str]:
        tool = rm.cone(8, height, top=8)
        node = rm.box((40, 10, 40)) - tool if flush == "drilled" else rm.box((40, 10, 40)) ^ tool
        return [d for d in plan(rm.Scene(node | rm.plane(offset=-20), **given)).warnings if "membrane" in d]

    soft, hard = rm.Sun((1, 2, 1.5), shadow=True, softness=0.1), rm.Sun((1, 2, 1.5), shadow=True)
    (doubt,) = doubts(10, lights=[soft])
    assert "beyond the face" in doubt and __file__ in doubt
    assert doubts(10, occlusion=rm.AmbientOcclusion(), sky=rm.Sky(light=True))
    assert not doubts(10, lights=[hard]) and not doubts(12, lights=[soft])


@pytest.mark.parametrize(("height", "softness", "told"), [(10.5, 0.02, 1), (12, 0.1, 1), (12, 0.02, 0), (20, 0.1, 0)])
@pytest.mark.parametrize("scale", [1.0, 10.0])
def test_a_tool_that_ends_soon_beyond_a_face_is_doubted(
    height: float, softness: float, told: int, scale: float
) -> None:
    """The penumbra reads the end of the tool: of the light below holes it loses 23, 26, 0 and 1 %."""
    light = rm.Sun((0, 1, 0), shadow=True, softness=softness)

    def doubts(tool: rm.Node, light: rm.Light = light) -> list[str]:
        plate = (rm.box((40, 10, 40)) - tool).scale(scale)
        scene = rm.Scene(plate | rm.plane(offset=-20 * scale), lights=[light])
        return [d for d in plan(scene).warnings if "the end of the tool" in d]

    found = doubts(rm.cone(8, height, top=8))
    assert len(found) == told
    assert all(f"ends {0.5 * (height - 10) * scale:.2g} beyond" in d and __file__ in d for d in found)
    assert not doubts(rm.cylinder(8, height))
    assert not doubts(rm.cone(8, height, top=8), light.replace(softness=0))


def test_an_uneven_scale_is_divided_before_a_union_compares_it(renderer: rm.Renderer) -> None:
    """A flat cylinder on a floor. Over the slope of the union, the cylinder hides the floor's nearer surface."""
    renderer.resize((48, 36))
    scene = rm.Scene(
        rm.cylinder(1, 0.4).translate((0, 0.2, 0)) | rm.plane(),
        rm.Camera((3, 2, 4), (0, 0.3, 0), fov=38),
        lights=[],
        sky=rm.Sky((1, 1, 1), light=True),
        occlusion=rm.AmbientOcclusion(reach=0.5),
    )
    scaled = scene.replace(node=rm.cylinder(0.5, 0.8).scale((2, 0.5, 2)).translate((0, 0.2, 0)) | rm.plane())
    error = np.abs(renderer.render(scaled).color - renderer.render(scene).color)
    assert np.quantile(error, 0.99) < 0.05 and error.mean() < 0.005
    reference = rm.truth(scaled, size=renderer.size).color
    found = renderer.render(scaled).color
    renderer.resize((15, 15))
    assert np.quantile(np.abs(found - reference), 0.98) < 0.01


def test_an_implicit_surface_that_an_effect_reads_is_doubted() -> None:
    node = rm.implicit(lambda p: p.x**4 + p.y**4 + p.z**4 - 1, 1.1) | rm.plane(offset=-1)

    def doubts(**given: object) -> list[str]:
        return [d for d in plan(rm.Scene(node, **given)).warnings if "implicit surface" in d]

    (doubt,) = doubts(lights=[rm.Sun((1, 2, 1), shadow=True, softness=0.1)])
    assert "penumbra='sampled'" in doubt and __file__ in doubt
    assert doubts(occlusion=rm.AmbientOcclusion(), sky=rm.Sky(light=True))
    assert not doubts(lights=[rm.Sun((1, 2, 1), shadow=True, softness=0.1, penumbra="sampled")])
    assert not doubts(lights=[rm.Sun((1, 2, 1), shadow=True)])


def test_soft_shadows_of_a_bent_solid_take_the_steps_that_its_slope_proves(renderer: rm.Renderer) -> None:
    """Half of these everywhere take 28 evaluations a pixel at 48x27."""
    node = rm.box((1, 2, 1)).twist(2).translate((0, 1.2, 0)) | rm.plane()
    camera = rm.Camera((1.9, 2.9, 3.8), (0, 1.1, 0))
    scene = rm.Scene(node, camera, [rm.Sun((1, 2, 1), shadow=True, softness=0.1)])
    renderer.resize((48, 27))
    assert evaluations_of(scene, renderer) < 23.0
    renderer.resize((15, 15))


def blinds(width: float, between: float, turn: float = 0.0) -> rm.Node:
    """Three slats side by side, 1 above a floor."""
    slats = rm.box((width, 0.1, 2)).repeat((width + between, None, None), (3, 1, 1))
    return rm.plane() | slats.rotate(turn, "y").translate((0, 1, 0))


@pytest.mark.parametrize(
    ("node", "softness", "told"),
    [
        (blinds(1.0, 0.1), 0.1, "gaps"),
        (blinds(1.0, 0.1, 0.5), 0.1, "gaps"),
        (blinds(1.0, 0.6), 0.1, ""),
        (blinds(1.0, 0.1), 0.02, ""),
        (rm.plane() | rm.capsule((-2, 1, 0), (2, 1, 0), 0.03), 0.1, "rods"),
        (rm.plane() | rm.capsule((-2, 1, 0), (2, 1, 0), 0.03), rm.Param("softness", 0.1, 0.0, 0.5), "rods"),
        (rm.plane() | rm.capsule((-2, 1, 0), (2, 1, 0), 0.3), 0.1, ""),
        (rm.plane() | rm.box(1).translate((0, 1, 0)), 0.3, ""),
        (rm.box(1), 0.3, ""),
    ],
)
def test_penumbras_of_what_is_narrower_than_the_light_are_doubted(node: rm.Node, softness: Any, told: str) -> None:
    sun = rm.Sun((0.1, 1, 0), shadow=True, softness=softness)
    found = [d for d in plan(rm.Scene(node, lights=[sun])).warnings if "narrower" in d]
    assert [told in d and d.endswith("(penumbra='sampled')") for d in found] == [True] * bool(told)
    sampled = rm.Scene(node, lights=[sun.replace(penumbra="sampled")])
    assert not any("narrower" in d for d in plan(sampled).warnings)
