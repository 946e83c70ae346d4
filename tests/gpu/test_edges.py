"""Anti-aliasing of edges by distance, judged by closed forms of the covered area and by many samples."""

from __future__ import annotations

import numpy as np
import pytest

import raymarch as rm
from raymarch.errors import PlanError, SceneError
from raymarch.gpu.part import PicturePart
from raymarch.gpu.prepare import prepare
from raymarch.plan import plan
from raymarch.scene.quality import TRACERS

SIZE = (48, 32)
EDGES = rm.Quality(edges="distance")
ALONG = rm.Camera(position=(0, 0, 4), target=(0, 0, 0), fov=40)


def glowing(node, light=1.0):
    """A solid whose colour is known: it shines, and no light falls on it."""
    return node.material(rm.Material(color=(0, 0, 0), emission=(light, light, light)))


def scene_of(node, camera=ALONG, quality=EDGES, **other):
    return rm.Scene(node, camera=camera, lights=[], sky=(0, 0, 0), quality=quality, **other)


def drawn(scene, size=SIZE, params=None):
    with rm.Renderer(size) as renderer:
        return renderer.render(scene, params=params).color[..., 0].astype(float)


def area_inside(inside, size=SIZE, fine=32):
    """The share of each pixel that lies inside a figure of the picture; `inside` takes pixels from its middle."""
    width, height = size
    x = (np.arange(width * fine) + 0.5) / fine - width / 2
    y = (np.arange(height * fine) + 0.5) / fine - height / 2
    covered = inside(x[None, :], y[:, None]).astype(float)
    return covered.reshape(height, fine, width, fine).mean((1, 3))


def disc(radius, at=(0.0, 0.0), size=SIZE):
    return area_inside(lambda x, y: np.hypot(x - at[0], y - at[1]) < radius, size)


def pixels_of(tangent, fov=40.0, height=SIZE[1]):
    """A length on the picture in pixels from the tangent of its angle."""
    return tangent / np.tan(np.radians(fov) / 2) * height / 2


RADIUS = pixels_of(1 / np.sqrt(16 - 1))
"""Radius in pixels of the silhouette of a unit sphere seen from a distance of 4."""


def test_a_sphere_covers_its_disc():
    assert np.abs(drawn(scene_of(glowing(rm.sphere(1)))) - disc(RADIUS)).max() < 0.05


def test_a_sphere_covers_its_disc_before_another_solid():
    wall = rm.box((40, 40, 1)).translate((0, 0, -3))
    found = drawn(scene_of(glowing(rm.sphere(1)) | glowing(wall, 0.25)))
    assert np.abs(found - (0.25 + 0.75 * disc(RADIUS))).max() < 0.05


def test_parallel_rays():
    camera = rm.Camera(position=(0, 0, 4), target=(0, 0, 0), projection="orthographic", height=2.9)
    found = drawn(scene_of(glowing(rm.sphere(1)), camera))
    assert np.abs(found - disc(SIZE[1] / 2.9)).max() < 0.05


@pytest.mark.parametrize("scale", [1e-2, 1e3])
def test_the_size_of_the_scene_does_not_matter(scale):
    camera = rm.Camera(position=(0, 0, 4 * scale), target=(0, 0, 0), fov=40)
    assert np.abs(drawn(scene_of(glowing(rm.sphere(scale)), camera)) - disc(RADIUS)).max() < 0.05


@pytest.mark.parametrize("tracer", TRACERS)
def test_every_tracer_finds_the_edges(tracer):
    found = drawn(scene_of(glowing(rm.sphere(1)), quality=EDGES.replace(tracer=tracer)))
    assert np.abs(found - disc(RADIUS)).max() < 0.05


def test_an_edge_far_from_the_middle_of_a_wide_view():
    camera = rm.Camera(position=(0, 0, 0), target=(0, 0, -1), fov=90)
    square = glowing(rm.box((1.7, 1.3, 1e-2))).translate((0.4, -0.2, -1))
    h = SIZE[1]

    def inside(x, y):
        x, y = x / (h / 2) * 0.995, y / (h / 2) * 0.995
        return (np.abs(x - 0.4) < 0.85) & (np.abs(y + 0.2) < 0.65)

    area = area_inside(inside)
    off = np.abs(drawn(scene_of(square, camera))[::-1] - area)
    rows, columns = (np.unique(np.nonzero(area)[k]) for k in (0, 1))
    corners = np.ix_(rows[[0, -1]], columns[[0, -1]])
    assert off[corners].max() < 0.1
    off[corners] = 0.0
    assert off.max() < 0.07  # a pixel is up to 3.6 degrees wide


@pytest.mark.parametrize("angle", [0.0, 0.3, 0.7, 1.4])
def test_a_thin_wire_keeps_its_mean(angle):
    width = 0.3 * 2 * 4 * np.tan(np.radians(20)) / SIZE[1]  # of 0.3 pixels
    wire = glowing(rm.cylinder(width / 2, 20).rotate(angle, "z").translate((0.013, 0, 0)))
    found = drawn(scene_of(wire))[8:-8, 12:-12]
    per_length = found.sum() / (24 / abs(np.sin(angle)) if abs(np.tan(angle)) > 1 else 16 / abs(np.cos(angle)))
    assert abs(per_length - 0.3) < 0.02


@pytest.mark.parametrize("turn", [0.0, 0.5, 1.0, 1.2])
def test_a_thin_sheet_hides_what_lies_behind(turn):
    pixel = 2 * 4 * np.tan(np.radians(20)) / SIZE[1]
    sheet = glowing(rm.box((9, 9, 0.1 * pixel)).rotate(turn, "y"))
    found = drawn(scene_of(sheet))
    assert found[8:-8, 20:-20].min() > 0.99


def test_a_flush_cut_is_no_edge():
    """The face of a cut that is flush with a face leaves a membrane of no thickness, which is no surface."""
    cut = rm.box((2, 2, 1)) - rm.box((1, 1, 1))
    found = drawn(scene_of(glowing(cut)))
    assert found[12:20, 20:28].max() == 0 and found[16, 13:17].min() == 1


def test_a_parameter_moves_the_edge():
    scene = scene_of(glowing(rm.sphere(1).translate((rm.Param("x", 0.0, min=-1, max=1), 0, 0))))
    with rm.Renderer(SIZE) as renderer:
        for x in (0.0, 0.03, 0.4):
            one = renderer.render(scene, params={"x": x}).color[..., 0]
            many = renderer.render(scene.replace(quality=rm.Quality(samples=1024)), params={"x": x}).color[..., 0]
            assert np.abs(one - many).max() < 0.05


def test_parts_of_a_picture_have_the_same_bits():
    scene = scene_of(glowing(rm.sphere(1)) | glowing(rm.box((9, 1, 1)).rotate(0.4, "z").translate((0, 0, -2)), 0.4))
    with rm.Renderer(SIZE) as renderer:
        whole = renderer.render(scene).color
        renderer.resize((24, 16))
        for x in (0, 24):
            for y in (0, 16):
                part = renderer.render(scene, part=PicturePart(SIZE, (x, y))).color
                assert np.array_equal(part, whole[y : y + 16, x : x + 24])


def test_many_edges_in_a_row():
    """Front to back: four balls behind each other, each a little beside the one before."""
    balls = [glowing(rm.sphere(0.5).translate((0.03 * k, 0, -1.5 * k)), 1 - 0.2 * k) for k in range(4)]
    solid = balls[0] | balls[1] | balls[2] | balls[3]
    found, many = drawn(scene_of(solid)), drawn(scene_of(solid, quality=rm.Quality(samples=1024)))
    assert np.abs(found - many).max() < 0.1


def test_the_horizon_of_a_plane():
    camera = rm.Camera(position=(0, 1, 0), target=(0, 0.9, -5), up=(0.2, 1, 0), fov=40)
    solid = glowing(rm.plane()) | glowing(rm.sphere(0.3).translate((0, 3, -9)), 0.5)
    found, many = drawn(scene_of(solid, camera)), drawn(scene_of(solid, camera, rm.Quality(samples=1024)))
    assert np.abs(found - many).max() < 0.1


@pytest.mark.parametrize(
    "other",
    [
        {"samples": 4},
        {"temporal": "accumulate"},
        {"temporal": "reproject"},
        {"steps_per_pass": 32},
        {"lights_per_pass": 1},
        {"rays": "interpolated"},
    ],
)
def test_settings_that_need_other_rays_are_refused(other):
    with pytest.raises(SceneError, match=f"edges = 'distance' with {next(iter(other))} = "):
        EDGES.replace(**other)


def test_scenes_that_need_many_rays_are_refused():
    solid = rm.sphere(1)
    for scene in (
        scene_of(solid, ALONG.replace(aperture=0.1)),
        scene_of(solid, ALONG.replace(shutter=0.1, position=(rm.time, 0, 4))),
        scene_of(solid.material(rm.Material(albedo=(1, 1, 1))), bounces=2),
        scene_of(rm.mandelbulb()),
    ):
        with pytest.raises(PlanError, match=r"Quality\(edges='distance'\)"):
            plan(scene)


def test_the_text_has_nothing_of_it_unless_asked():
    scene = scene_of(rm.sphere(1) | rm.plane(offset=-1), quality=rm.Quality())
    text = prepare(scene, ("color", "depth"), SIZE).texts["color"]
    assert not any(word in text for word in ("edge_", "EDGE", "smoothed", "beside("))


def test_the_plan_says_so():
    used = {feature.name: feature for feature in plan(scene_of(rm.sphere(1))).features}
    assert used["anti-aliasing"].used and "edges='distance'" in used["anti-aliasing"].reason


def test_most_of_the_cost_is_at_edges():
    """A pixel without an edge takes at most three evaluations more than with one sample."""
    solid = rm.sphere(1).translate((0.1, 0, 0))
    with rm.Renderer((120, 80)) as renderer:
        scenes = [scene_of(solid, quality=rm.Quality(edges=by, tracer="bracketing")) for by in ("samples", "distance")]
        counts = [renderer.render(scene, outputs=("evaluations",)).evaluations for scene in scenes]
    radius = pixels_of(1 / np.sqrt(16 - 1), height=80)
    y, x = np.mgrid[:80, :120] - np.array([39.5, 59.5])[:, None, None]
    inner = np.hypot(x - pixels_of(0.1 / 4, height=80), y) < radius - 8
    assert (counts[1] - counts[0])[inner].mean() < 3
    assert counts[1].mean() < 2 * counts[0].mean() + 1


@pytest.mark.parametrize("seed", range(6))
def test_random_solids(seed):
    """Of boxes, balls, rings and rods that meet: the error at edges is at most a quarter of that of one sample."""
    rng = np.random.default_rng(seed)
    solid = None
    for _ in range(4):
        size = rng.uniform(0.05, 0.8, 3)
        shapes = (rm.box(2 * size), rm.sphere(size[0]), rm.torus(0.5, 0.2 * size[0]), rm.cylinder(size[0] / 4, 2))
        part = shapes[rng.integers(4)].rotate(rng.uniform(0, 3), rng.normal(size=3)).translate(rng.uniform(-1, 1, 3))
        solid = part if solid is None else solid - part if rng.integers(4) == 0 else solid | part
    camera = rm.Camera(projection="orthographic") if seed % 2 else rm.Camera()
    known = drawn(scene_of(glowing(solid), camera, rm.Quality(samples=1024)))
    edge = (known > 0) & (known < 1)
    one, found = (drawn(scene_of(glowing(solid), camera, quality)) for quality in (rm.Quality(), EDGES))
    assert ((found - known)[edge] ** 2).mean() ** 0.5 < 0.25 * ((one - known)[edge] ** 2).mean() ** 0.5
