"""Every example renders, and is held against the float64 truth."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from raymarch.gpu.renderer import Renderer
from raymarch.scene import load
from raymarch.scene.quality import NORMALS
from raymarch.truth import Truth, compare, silhouettes, truth

FOLDER = Path(__file__).parents[2] / "examples"
EXAMPLES = sorted(p.stem for p in FOLDER.glob("*.py"))
SIZE = (320, 180)
CERTIFIED = ("plain", "relaxed", "relaxed_again", "enhanced", "auto_relaxed", "front")


@cache
def expected(name: str) -> Truth:
    return truth(load(FOLDER / f"{name}.py"), size=SIZE)


@pytest.fixture(scope="module")
def renderer():
    with Renderer(SIZE) as made:
        yield made


def test_the_examples_are_there():
    assert {"hello", "csg", "columns"} <= set(EXAMPLES)
    assert len((FOLDER / "hello.py").read_text().splitlines()) <= 10


@pytest.mark.parametrize("name", EXAMPLES)
def test_geometry_against_truth(name, renderer):
    frame = renderer.render(load(FOLDER / f"{name}.py"), outputs=("depth", "normal"))
    found = compare(frame.depth, frame.normal, expected(name))
    assert found.compared > 0.1 * SIZE[0] * SIZE[1]
    assert found.missed_hits == 0
    assert found.false_hits == 0
    assert found.depth_p99 <= 1e-3
    assert found.normal_p95 <= 0.5


@pytest.mark.parametrize("name", EXAMPLES)
def test_color_against_truth(name, renderer):
    """Away from edges. A shadow's border is an edge too: its pixels are few, the rest agrees to 8 bits."""
    frame = renderer.render(load(FOLDER / f"{name}.py"))
    known = expected(name)
    inner = ~silhouettes(known)
    difference = np.abs(frame.color - known.color).max(axis=-1)[inner]
    assert np.mean(difference > 1 / 255) < 0.01
    assert np.percentile(difference, 95) <= 1 / 255


@pytest.mark.parametrize("tracer", CERTIFIED)
@pytest.mark.parametrize("name", EXAMPLES)
def test_no_tracer_misses_a_hit(name, tracer, renderer):
    scene = load(FOLDER / f"{name}.py")
    scene.quality = type(scene.quality)(tracer=tracer)
    frame = renderer.render(scene, outputs=("depth",))
    found = compare(frame.depth, None, expected(name))
    assert found.missed_hits == 0
    assert found.false_hits == 0
    assert found.depth_p99 <= 1e-3


@pytest.mark.parametrize("normals", NORMALS)
def test_the_other_normals_are_near(normals, renderer):
    scene = load(FOLDER / "hello.py")
    scene.quality = type(scene.quality)(normals=normals)
    frame = renderer.render(scene, outputs=("depth", "normal"))
    assert compare(frame.depth, frame.normal, expected("hello")).normal_p95 <= 0.5


def test_hello_needs_few_evaluations():
    """A peer's shader for such a scene takes 117 evaluations a pixel."""
    scene = load(FOLDER / "hello.py")
    scene.quality = type(scene.quality)(tracer="plain")
    with Renderer((640, 360)) as renderer:
        assert renderer.render(scene, outputs=("evaluations",)).evaluations.mean() <= 40


@pytest.mark.parametrize("name", EXAMPLES)
def test_egl_and_osmesa_agree(name, renderer):
    scene = load(FOLDER / f"{name}.py")
    with Renderer(SIZE, "egl") as one, Renderer(SIZE, "osmesa") as other:
        pictures = [np.asarray(r.render(scene).image(), np.int16) for r in (one, other)]
    off_edges = ~silhouettes(expected(name))
    assert np.abs(pictures[0] - pictures[1])[off_edges].max() <= 1
