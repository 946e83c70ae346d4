"""The scenes of examples/large: their objects are what the plan expects, and their pictures show the field."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.plan import plan

FOLDER = Path(__file__).parents[2] / "examples" / "large"

OBJECTS = {"blob": 200, "city": 0, "costly": 20, "forest": 12_000, "lamps": 1024, "molecule": 13_061}
"""Objects as data of each scene; blob is made with fewer than its 6,000."""


@pytest.fixture(scope="module")
def renderer() -> Iterator[rm.Renderer]:
    with rm.Renderer(size=(48, 27)) as made:
        yield made


def made(name: str) -> rm.Scene:
    file = FOLDER / f"{name}.py"
    text = file.read_text(encoding="utf-8").replace("N = 6000", "N = 200")
    known: dict[str, Any] = {"__name__": name, "__file__": str(file)}
    exec(compile(text, str(file), "exec"), known)
    scene: rm.Scene = known["scene"]
    return scene


def test_all_scenes_are_listed() -> None:
    assert sorted(OBJECTS) == sorted(file.stem for file in FOLDER.glob("*.py"))


@pytest.mark.parametrize("name", sorted(OBJECTS))
def test_the_picture_of_a_large_scene_shows_the_surfaces_of_its_field(name: str, renderer: rm.Renderer) -> None:
    """Hits lie on surfaces of the float64 field, and no sample of a ray before its hit lies in a solid."""
    scene = made(name)
    assert plan(scene).gathered.data == OBJECTS[name]
    quick = scene.replace(lights=scene.lights[:8], post=(), camera=scene.camera.replace(aperture=0.0))
    quick = quick.replace(quality=scene.quality.replace(samples=1))
    frame = renderer.render(quick, outputs=("depth",))
    assert np.isfinite(frame.color).all() and np.ptp(frame.color) > 0.05
    hits = np.isfinite(frame.depth)
    assert hits.sum() > 40
    chosen = [np.argwhere(some)[:: max(1, int(some.sum()) // n)] for some, n in ((hits, 30), (~hits, 10))]
    rows, columns = np.concatenate(chosen).T
    depth, found = frame.depth[rows, columns], hits[rows, columns]
    rays = frame.pose.directions(columns, rows, (48, 27))
    width = 2.0 * frame.pose.tan_half_fov / 27
    at = frame.pose.position + depth[found, None] * rays[found]
    assert (np.abs(scene.node.distance(at)) <= 0.2 * width * depth[found]).all()
    ends = np.where(found, depth, 2.0 * depth[found].max())
    for share in (0.5, 0.9, 0.98):
        before = frame.pose.position + share * ends[:, None] * rays
        assert (scene.node.distance(before) > -0.2 * width * ends).all(), "a ray passes a surface"
