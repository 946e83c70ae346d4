"""The scenes of the papers: each draws, and those whose field is certified are held against the float64 truth."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from raymarch.gpu.renderer import Renderer
from raymarch.plan import plan
from raymarch.scene import load
from raymarch.shader import assemble
from raymarch.truth import silhouettes, truth

FOLDER = Path(__file__).parents[2] / "examples" / "papers"
SCENES = sorted(p.stem for p in FOLDER.glob("*.py"))
SIZE = (64, 36)
HELD = {"soft_shadows": SIZE, "smoothing": SIZE}


@pytest.fixture(scope="module")
def renderer() -> Iterator[Renderer]:
    with Renderer(SIZE, "egl") as made:
        yield made


def test_the_papers_figures_are_there() -> None:
    assert {"carpet", "mandelbulb", "lights", "soft_shadows", "array", "smoothing"} <= set(SCENES)


@pytest.mark.parametrize("name", SCENES)
def test_a_scene_of_a_paper_draws(name: str, renderer: Renderer) -> None:
    """Light everywhere finite, something to see, and no speck far brighter than all around it."""
    renderer.resize(SIZE)
    frame = renderer.render(load(FOLDER / f"{name}.py"))
    light = np.minimum(frame.color, 2.0)
    assert np.isfinite(frame.color).all() and frame.color.min() >= 0
    assert light.std() > 0.02
    assert np.asarray(frame.image()).std() > 10


@pytest.mark.parametrize("name", HELD)
def test_a_scene_of_a_paper_is_true(name: str, renderer: Renderer) -> None:
    scene = load(FOLDER / f"{name}.py")
    renderer.resize(HELD[name])
    known = truth(scene, HELD[name])
    found = renderer.render(scene).color
    off = (np.abs(found - known.color) / np.maximum(known.color, 1.0)).max(axis=-1)[~silhouettes(known)]
    assert np.mean(off > 1 / 255) < 0.005 and off.max() < 0.02


def test_sixty_four_lights_are_rows_of_a_texture() -> None:
    scene = load(FOLDER / "lights.py")
    assert len(scene.lights) == 64 and all(light.shadow for light in scene.lights)


def test_the_scene_of_the_first_picture_is_short_and_compiles() -> None:
    file = FOLDER.parent / "showcase" / "lanterns.py"
    assert len(file.read_text().splitlines()) < 60
    scene = load(file)
    assert scene.node.exactness != "estimate"
    assert "gyroid" in assemble(plan(scene)).text()


def test_the_scene_that_shows_bloom_is_short() -> None:
    file = FOLDER.parent / "showcase" / "neon.py"
    assert len(file.read_text().splitlines()) < 40
    (effect,) = load(file).post
    assert effect.LABEL == "bloom"


def test_the_lake_mirrors_its_mountains(renderer: Renderer) -> None:
    """Where the mountains stand against the sky, the water below is darker than where it mirrors the sky only."""
    scene = load(FOLDER.parent / "showcase" / "lake.py")
    assert scene.node.exactness != "estimate"
    renderer.resize((64, 36))
    color = renderer.render(scene).color
    assert np.isfinite(color).all()
    open_water, mirrored = color[24:28, :4].mean(), color[24:28, 20:40].mean()
    assert mirrored < 0.75 * open_water
    assert color[6:8].mean() > color[30:32].mean()  # water reflects a part of the light only


def test_the_pieces_of_chess_are_rows() -> None:
    """As text they would compile for half a minute."""
    found = plan(load(FOLDER.parent / "showcase" / "chess.py"))
    assert found.gathered.data >= 12 and found.gathered.text <= 3


def test_the_plates_sample_lamps_and_reflections() -> None:
    showcase = FOLDER.parent / "showcase"
    assert "power_heuristic" in assemble(plan(load(showcase / "plates.py"))).text()
    assert "power_heuristic" not in assemble(plan(load(showcase / "neon.py"))).text()
