"""The scenes of examples/large: they load, their objects are what the plan expects, and a ray through them hits.

Their pictures take seconds each; those of the gallery show them.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.plan import gather
from raymarch.scene.parameter import set_values

FOLDER = Path(__file__).parents[2] / "examples" / "large"

OBJECTS = {"blob": 200, "city": 0, "costly": 0, "forest": 12_000, "lamps": 1024, "molecule": 13_061}
"""Objects as data of each scene; blob is made with fewer than its 6,000."""


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
def test_a_large_scene_has_its_objects_and_something_to_see(name: str) -> None:
    scene = made(name)
    assert gather.gather(scene.node, scene.quality.objects, 0.0).data == OBJECTS[name]
    pose = scene.pose(set_values(scene.parameters, {}, 0.0), 16 / 9)
    rays = pose.directions(np.linspace(16.0, 47.0, 8), np.linspace(9.0, 26.0, 8)[:, None], (64, 36)).reshape(-1, 3)
    t = np.zeros(len(rays))
    for _ in range(60):
        values = scene.node.distance(pose.position + t[:, None] * rays)
        assert np.isfinite(values).all()
        assert (values > 0.0).all(), "the camera is inside of a solid, or a step passes a surface"
        t += 0.999 * values
        if (values < 1e-2 * t).any():
            return
    pytest.fail("no ray hits anything")
