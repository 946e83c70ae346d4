"""Which scenes are marched by how far rays are free, by default."""

from __future__ import annotations

from pathlib import Path

import pytest

import raymarch as rm
from raymarch.plan import plan
from raymarch.scene import load

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.mark.parametrize(
    "name", ["columns", "showcase/plates", "papers/lights", "papers/smoothing", "papers/carpet", "showcase/lake"]
)
def test_scenes_whose_solids_are_all_known_along_rays_take_it(name: str) -> None:
    marching = plan(load(EXAMPLES / f"{name}.py"), size=(320, 180)).marching
    assert marching.tracer == "advance" and "times the operations of the distance" in marching.tracer_reason


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("csg", "which is more than it saves"),
        ("village", "takes long to compile"),
        ("showcase/neon", "of capped_torus nothing but the distance"),
        ("papers/frosted", "inside of solids too"),
        ("large/city", "of repeat_varied nothing but the distance"),
        ("papers/glass", "inside of solids too"),
        ("large/costly", "can be checked"),
        ("papers/array", "takes long to compile"),
    ],
)
def test_scenes_that_lose_time_by_it_do_not(name: str, why: str) -> None:
    marching = plan(load(EXAMPLES / f"{name}.py"), size=(320, 180)).marching
    assert marching.tracer == "bracketing" and why in marching.tracer_reason


def test_objects_in_cells_beside_a_convex_solid_take_it() -> None:
    marching = plan(load(EXAMPLES / "showcase/chess.py"), size=(320, 180)).marching
    assert marching.tracer == "advance" and "up to the boxes of others" in marching.tracer_reason
    assert not marching.free


def test_carved_solids_take_it() -> None:
    carved = rm.box(1) - rm.sphere(0.62).translate((0.1, 0, 0))
    for node in (carved | rm.rounded_box(1, 0.1).translate((2, 0, 0)), rm.box(1) ^ rm.box(1).translate((0.5, 0, 0))):
        marching = plan(rm.Scene(node), size=(320, 180)).marching
        assert marching.tracer == "advance" and not marching.free


def test_a_displaced_solid_is_known_along_rays_up_to_its_shell_only() -> None:
    """Below the shell rays would step by the divided value, and take twice the evaluations of bracketing."""
    marching = plan(rm.Scene(rm.sphere().displace_by_noise(0.25, 4.0) | rm.box(1)), size=(320, 180)).marching
    assert marching.tracer == "bracketing" and "of displace_by_noise nothing but the distance" in marching.tracer_reason


def test_flat_fields_are_marched_by_distance() -> None:
    """An ellipsoid a millionth as high as wide: its values are smaller than their rounding error far from it."""
    scene = rm.Scene(rm.sphere().scale((1, 1e-6, 1)), quality=rm.Quality(analytic=False))
    for tracer in ("auto", "advance"):
        marching = plan(scene.replace(quality=scene.quality.replace(tracer=tracer))).marching
        assert marching.tracer == "bracketing" and "flat" in marching.tracer_reason


@pytest.mark.parametrize(
    ("height", "blend", "standalone", "tracer"),
    [
        (6.0, 0.0, False, "advance"),
        (0.2, 0.0, False, "bracketing"),
        (6.0, 0.1, False, "bracketing"),
        (6.0, 0.0, True, "bracketing"),
    ],
)
def test_steep_height_maps_that_are_only_placed_and_united_take_it(
    height: float, blend: float, standalone: bool, tracer: str
) -> None:
    land = rm.heightmap([[0, 1, 0], [1, 0, 1], [0, 1, 0.5]], height=height).rotate(0.4, "y")
    scene = rm.Scene(rm.union(land, rm.sphere(), k=blend) | rm.plane(offset=-1))
    assert plan(scene, size=(320, 180), standalone=standalone).marching.tracer == tracer


def test_a_scene_without_marched_solids_asks_nothing() -> None:
    assert plan(rm.Scene(rm.sphere() | rm.plane(offset=-1))).marching.tracer == "bracketing"
