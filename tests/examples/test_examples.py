"""Every example renders, and is held against the float64 truth."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from raymarch.gpu.renderer import Renderer
from raymarch.scene import load
from raymarch.scene.parameter import set_values
from raymarch.scene.quality import NORMALS
from raymarch.truth import Truth, silhouettes, truth
from tests.support.compared import compare

FOLDER = Path(__file__).parents[2] / "examples"
EXAMPLES = sorted(p.stem for p in FOLDER.glob("*.py"))
SIZE = (80, 45)
SIZES = {"village": (64, 36), "primitives": (64, 36), "mandelbulb": (48, 27), "textures": (48, 27), "csg": (240, 135)}
"""Smaller where the truth takes long; larger where much of the picture is silhouettes."""
ESTIMATES = ["mandelbulb"]
PROVEN = [name for name in EXAMPLES if name not in ESTIMATES]
CAMERAS = ["mandelbulb", "primitives", "village"]
"""Those with a camera whose rays all hit, and one that sees a horizon."""
TRACERS = ("plain", "relaxed", "relaxed_again", "enhanced", "auto_relaxed", "bracketing")


def size_of(name: str) -> tuple[int, int]:
    return SIZES.get(name, SIZE)


@cache
def expected(name: str) -> Truth:
    return truth(load(FOLDER / f"{name}.py"), size=size_of(name))


@pytest.fixture(scope="module")
def opened():
    with Renderer(SIZE) as made:
        yield made


@pytest.fixture
def renderer(opened, request):
    opened.resize(size_of(request.node.callspec.params.get("name", "hello")))
    return opened


def test_the_examples_are_there():
    assert {"hello", "csg", "columns", *CAMERAS} <= set(EXAMPLES)
    assert len((FOLDER / "hello.py").read_text().splitlines()) <= 10


@pytest.mark.parametrize("name", EXAMPLES)
def test_only_fractals_are_estimates(name):
    assert (load(FOLDER / f"{name}.py").node.exactness == "estimate") == (name in ESTIMATES)


@pytest.mark.parametrize("name", PROVEN)
def test_geometry_against_truth(name, renderer):
    frame = renderer.render(load(FOLDER / f"{name}.py"), outputs=("depth", "normal"))
    found = compare(frame.depth, frame.normal, expected(name))
    width, height = size_of(name)
    assert found.compared > 0.1 * width * height
    assert found.missed_hits == 0
    assert found.false_hits == 0
    assert found.depth_p99 <= 1e-3
    assert found.normal_p95 <= 0.5


@pytest.mark.parametrize("name", PROVEN)
def test_color_against_truth(name, renderer):
    """Away from edges. A shadow's border is an edge too: its pixels are few, the rest agrees to 8 bits."""
    frame = renderer.render(load(FOLDER / f"{name}.py"))
    known = expected(name)
    inner = ~silhouettes(known)
    difference = np.abs(frame.color - known.color).max(axis=-1)[inner]
    assert np.mean(difference > 1 / 255) < 0.01
    assert np.percentile(difference, 95) <= 1 / 255


def pairs():
    """Each example with every second tracer, and each tracer with every second example; the others are long."""
    for i, name in enumerate(PROVEN):
        for k, tracer in enumerate(TRACERS):
            yield pytest.param(name, tracer, marks=[pytest.mark.long] if (i + k) % 2 else [])


@pytest.mark.parametrize(("name", "tracer"), list(pairs()))
def test_no_tracer_misses_a_hit(name, tracer, renderer):
    scene = load(FOLDER / f"{name}.py")
    scene = scene.replace(quality=type(scene.quality)(tracer=tracer))
    frame = renderer.render(scene, outputs=("depth",))
    found = compare(frame.depth, None, expected(name))
    assert found.missed_hits == 0
    assert found.false_hits == 0
    assert found.depth_p99 <= 1e-3


@pytest.mark.parametrize("normals", NORMALS)
def test_the_other_normals_are_near(normals, renderer):
    scene = load(FOLDER / "hello.py")
    scene = scene.replace(quality=type(scene.quality)(normals=normals))
    frame = renderer.render(scene, outputs=("depth", "normal"))
    assert compare(frame.depth, frame.normal, expected("hello")).normal_p95 <= 0.5


def test_hello_needs_few_evaluations():
    """A peer's shader for such a scene takes 117 evaluations a pixel."""
    scene = load(FOLDER / "hello.py")
    scene = scene.replace(quality=type(scene.quality)(tracer="plain"))
    with Renderer((640, 360)) as renderer:
        assert renderer.render(scene, outputs=("evaluations",)).evaluations.mean() <= 40


@pytest.mark.parametrize("name", ESTIMATES)
def test_a_ray_on_an_estimate_ends_near_its_surface(name, renderer):
    """Where the field, in float64, is far below a pixel: in front of a fractal its detail casts no shadows."""
    scene = load(FOLDER / f"{name}.py")
    frame = renderer.render(scene, outputs=("depth",))
    known = expected(name)
    assert np.array_equal(np.isfinite(frame.depth), known.hit)
    points = known.position + frame.depth[..., None] * known.direction
    field = scene.node.distance(points.reshape(-1, 3)).reshape(frame.depth.shape)
    pixels = field / (frame.depth * scene.pose(set_values(scene.parameters, {}, 0.0)).pixel(size_of(name)[1]))
    assert pixels.max() <= 0.5 * 1.01
    assert np.median(np.abs(pixels)) <= 0.1 / 16.0


@pytest.mark.parametrize("name", CAMERAS)
def test_one_camera_sees_hits_alone_and_one_a_horizon(name, renderer):
    scene = load(FOLDER / f"{name}.py")
    assert np.isfinite(renderer.render(scene, outputs=("depth",)).depth).all()
    renderer.resize((80, 45))
    known = truth(scene, (80, 45), params={"horizon": 1}, outputs=("normal",))
    found = compare(renderer.render(scene, params={"horizon": 1}, outputs=("depth",)).depth, None, known)
    assert 0.4 < known.hit.mean() < 0.9
    assert found.missed_hits == found.false_hits == 0


@pytest.mark.parametrize("name", PROVEN)
def test_egl_and_osmesa_agree(name, renderer):
    scene = load(FOLDER / f"{name}.py")
    with Renderer(size_of(name), "egl") as one, Renderer(size_of(name), "osmesa") as other:
        pictures = [np.asarray(r.render(scene).image(), np.int16) for r in (one, other)]
    off_edges = ~silhouettes(expected(name))
    assert np.abs(pictures[0] - pictures[1])[off_edges].max() <= 1
