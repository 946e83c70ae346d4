"""Fields from data: grids, meshes and height maps keep their promises and look the same on the device."""

from __future__ import annotations

import struct
import zlib

import numpy as np
import pytest
import trimesh
from PIL import Image

import raymarch as rm
from raymarch.errors import SceneError, SceneWarning
from raymarch.expr.samples import Samples
from raymarch.gpu.renderer import Renderer
from raymarch.sdf.evaluation import evaluate_undivided
from raymarch.sdf.heights import displace_by_image, displace_by_samples, heightmap, terrain
from raymarch.sdf.meshes import mesh
from raymarch.sdf.nearest import Surface
from raymarch.sdf.sampled import grid
from raymarch.truth import truth
from tests.support.compared import compare


def points_in(reach: float, n: int) -> np.ndarray:
    return np.random.default_rng(7).uniform(-reach, reach, (n, 3))


def ball(n: int = 24, radius: float = 0.7) -> np.ndarray:
    axis = np.linspace(-1, 1, n)
    x, y, z = np.meshgrid(axis, axis, axis, indexing="ij")
    return np.sqrt(x**2 + y**2 + z**2) - radius


def steepest(node, n=200_000, reach=3.0):
    rng = np.random.default_rng(8)
    p = points_in(reach, n)
    q = p + rng.normal(size=p.shape) * 10 ** rng.uniform(-4, 0, (n, 1))
    return np.max(np.abs(node.distance(p) - node.distance(q)) / np.linalg.norm(p - q, axis=1))


NODES = {
    "grid": lambda: grid(ball(), size=2, center=(0.3, -0.2, 0.1)),
    "oblong grid": lambda: grid(np.maximum(np.abs(ball(13, 0.0)) - 0.6, ball(13, 0.5)), size=(2, 3, 4)),
    "isosurface": lambda: rm.isosurface(-300 * ball(13), rm.Param("level", 0, -60, 60)),
    "cut isosurface": lambda: rm.isosurface(9 * ball(13), 2.0, size=(2, 3, 4)),
    "terrain": lambda: terrain(),
    "displaced sphere": lambda: displace_by_samples(rm.sphere(), height=0.3),
    "random heights": lambda: heightmap(np.random.default_rng(1).uniform(0, 1, (7, 11)), size=(3, 2), height=0.3),
}


def test_an_isosurface_above_all_values_is_reported():
    with pytest.warns(rm.SceneWarning, match="level = 5 exceeds all values, 1 at most: an empty solid"):
        rm.isosurface(np.linspace(0, 1, 8).reshape(2, 2, 2), 5)
    with pytest.warns(rm.SceneWarning, match="can exceed all values, 1 at most"):
        rm.isosurface(np.linspace(0, 1, 8).reshape(2, 2, 2), rm.Param("level", 0.5, 0, 7))


def test_an_isosurface_lies_at_its_level_in_any_unit():
    """A density that falls by 1000 per unit of length has the level -700 at the radius 0.7; so has any value of a
    `Param`. Values above the level on the faces of the box are cut off there."""
    points = np.array([(0.0, 0.7, 0.0), (0.5, 0.0, 0.0), (0.0, 0.0, 0.9)])
    fixed = rm.isosurface(-1000 * ball(81, 0.0), -700)
    assert fixed.distance(points) == pytest.approx((0, -0.2, 0.2), abs=0.01)
    far = rm.isosurface(np.exp(-12 * ball(81, 0.0)), np.exp(-12 * 0.7))  # a decay by 4,000 up to the level
    shares = far.distance(points[1:]) / (-0.2, 0.2)  # 1 / 4,000 without the map of values
    assert far.distance(points[0]) == pytest.approx(0, abs=1e-3) and np.all((shares > 0.4) & (shares <= 1))
    moved = rm.isosurface(-1000 * ball(81, 0.0), rm.Param("level", -500, -900, -300))
    assert moved.distance(points[1:2]) == pytest.approx(0, abs=1e-3)
    assert np.all(moved.bounds[1] < 1)
    with pytest.warns(rm.SceneWarning, match="below all values"):
        everywhere = rm.isosurface(-1000 * ball(81, 0.0), -5000, size=2)
    assert everywhere.distance([(0, 1.5, 0), (0, 0.99, 0)]) == pytest.approx((0.5, -0.01), abs=1e-6)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: rm.isosurface(ball(), rm.Param("level", 0)), "name, value, min, max"),
        (lambda: rm.isosurface(ball(), (0, 1)), "level = "),
        (lambda: rm.isosurface(ball(), 0, size=(1, 2)), "3 numbers > 0"),
        (lambda: rm.isosurface(ball()[0], 0), "nx, ny, nz"),
    ],
)
def test_an_isosurface_says_what_it_needs(make, says):
    with pytest.raises(SceneError, match=says):
        make()


@pytest.mark.parametrize("name", NODES)
def test_slope_bounds_gradient_and_twin(name):
    node = NODES[name]()
    assert steepest(node) <= 1 + 1e-9
    points = points_in(3, 20_000)
    lower, upper = node.bounds
    inside = points[node.distance(points) < 0]
    assert np.all(inside >= lower - 1e-12)
    assert np.all(inside <= upper + 1e-12)
    h = 1e-6
    axes = np.eye(3)
    differences = np.stack(
        [(node.distance(points + h * a) - node.distance(points - h * a)) / (2 * h) for a in axes], axis=-1
    )
    error = np.abs(differences - node.gradient(points)).max(axis=1)
    assert np.mean(error < 1e-6) > 0.99  # the rest straddle a cell's border or an edge


@pytest.mark.parametrize("name", NODES)
def test_picture_against_truth(name):
    scene = rm.Scene(NODES[name](), camera=rm.Camera((2.5, 2, 4), (0, 0, 0)))
    size = (240, 160)
    expected = truth(scene, size=size)
    with Renderer(size) as renderer:
        frame = renderer.render(scene, outputs=("depth",))
        found = compare(frame.depth, frame.normal, expected)
    assert found.compared > 300  # creases between cells are left out
    assert found.missed_hits == 0
    assert found.false_hits == 0
    assert found.depth_p99 <= 1e-3


def test_outside_its_box_a_grid_never_exceeds_the_distance():
    node = grid(ball(40), size=2)
    points = points_in(6, 50_000)
    true = np.linalg.norm(points, axis=1) - 0.7
    cell = 2 / 39
    assert (
        np.max(np.abs(node.distance(points)) - np.abs(true)) <= cell
    )  # the sampled ball lies within a cell of the true one
    far = np.linalg.norm(points, axis=1) > 4
    # sqrt(e^2 + s^2) >= (e + s) / sqrt(2), and e + s is no less than the distance, up to a cell
    assert np.min(node.distance(points)[far] / (true[far] - cell)) > 1 / (np.sqrt(2) * node.facts.divisor)


def test_the_spread_of_a_grid_bounds_its_box_and_no_less_would():
    axis = np.linspace(-1.0, 1.0, 12)
    x, y, z = np.meshgrid(axis, axis, axis, indexing="ij")
    node = rm.grid(3.0 * (np.sqrt(x * x + 4.0 * y * y + z * z) - 0.7), size=(2.0, 3.0, 4.0))
    points = np.random.default_rng(4).uniform(-4.0, 4.0, (100_000, 3))
    points[::2, :2] *= 0.1  # the field is flattest along z
    value, (low, high) = node.distance(points), node.bounds
    away = np.max(np.maximum(np.maximum(low - points, points - high), 0.0), axis=1)
    largest = np.max(away[value > 0.0] / value[value > 0.0])
    assert 0.98 * node.facts.spread < largest <= node.facts.spread


def random_values():
    """Random numbers, above 0 on the faces of their box: the surface of a grid of them is in no cell far away."""
    values = np.ones((8, 7, 6))
    values[1:-1, 1:-1, 1:-1] = np.random.default_rng(5).normal(size=(6, 5, 4))
    return values


@pytest.mark.parametrize("make", [rm.grid, lambda values: rm.isosurface(-values, 0.0)], ids=["grid", "isosurface"])
def test_the_unit_of_a_grids_values_does_not_matter(make):
    """Before, flat values were hits in all of the box, and of steep ones float32 lost the squares."""
    points, values = points_in(2.0, 1000), random_values()
    known = make(values)
    inside = known.gradient(points[np.max(np.abs(points), axis=1) < 1.0])
    assert 0.3 < np.max(np.linalg.norm(inside, axis=1)) <= 1.0
    for unit in (1e-30, 1e-6, 1e6, 1e30):
        np.testing.assert_allclose(make(unit * values).distance(points), known.distance(points), rtol=1e-5, atol=1e-6)


def test_huge_values_away_from_the_surface_neither_move_nor_flatten_it():
    values = ball(24)
    band = np.where(np.abs(values) < 0.2, values, 1e10 * np.sign(values))
    whole, sparse = grid(values), grid(band)
    points = points_in(1.0, 20_000)
    known, found = whole.distance(points), sparse.distance(points)
    assert np.array_equal(found > 0.0, known > 0.0)
    assert np.min(np.abs(found) / np.maximum(np.abs(known), 1e-6)) > 0.3
    assert sparse.facts.divisor == 1.0


def test_the_order_of_a_grids_axes():
    values = np.full((5, 6, 7), 1.0)
    values[3, 2, 1] = -0.5
    node = grid(values, size=(4, 5, 6))
    at = np.array([-2 + 3, -2.5 + 2, -3 + 1.0])
    assert node.distance(at) < 0
    assert np.all(node.distance(at + 1.9 * np.vstack([np.eye(3), -np.eye(3)])) > 0)


def test_a_damaged_cache_is_named_and_made_anew(tmp_path):
    file = tmp_path / "box.stl"
    trimesh.creation.box((1, 2, 1)).export(file)
    node = mesh(file, resolution=12, cache=tmp_path / "kept")
    (kept,) = (tmp_path / "kept").iterdir()
    whole = kept.read_bytes()
    for content in (b"", b"hello", whole[: len(whole) // 2]):
        kept.write_bytes(content)
        with pytest.warns(SceneWarning, match=f"'{kept}' cannot be read: it is made anew"):
            again = mesh(file, resolution=12, cache=tmp_path / "kept")
        assert kept.read_bytes() == whole
    points = points_in(1.5, 100)
    np.testing.assert_array_equal(node.distance(points), again.distance(points))
    with pytest.warns(SceneWarning, match=r"the cache cannot write '/dev/null/kept': .*: nothing is kept"):
        mesh(file, resolution=12, cache="/dev/null/kept")


@pytest.mark.parametrize("size", [1.0, 30.0])
def test_distances_of_a_mesh_are_exact_near_its_surface(size):
    """Also where triangles are far larger than the cell. Far away, the nearest triangle may be another of a cell."""
    points = points_in(1.5, 3000)
    solid = trimesh.creation.box((1.0, 2.0, 0.5))
    found = Surface(solid, 0.05 * size).distances(points)
    q = np.abs(points) - (0.5, 1.0, 0.25)
    known = np.linalg.norm(np.maximum(q, 0), axis=1) + np.minimum(q.max(axis=1), 0)
    assert np.max(np.abs(found - known)) < 1e-12
    ball = trimesh.creation.icosphere(3)
    off = Surface(ball, 0.1).distances(points) - trimesh.proximity.signed_distance(ball, points) * -1.0
    assert np.max(np.abs(off)) < 2e-3
    assert np.max(np.abs(off[np.abs(np.linalg.norm(points, axis=1) - 1) < 0.15])) < 1e-9


def test_many_points_are_rows_of_a_table():
    """The same shapes as text, with points on straight pieces between their corners."""
    angle = 2 * np.pi * np.arange(30) / 30
    corners = np.stack([np.cos(angle), np.sin(angle), 0.3 * np.cos(3 * angle)], axis=1) * (
        1 + 0.3 * np.sin(7 * angle[:, None])
    )
    steps = (np.arange(8) / 8)[None, :, None]
    many = (corners[:, None] * (1 - steps) + np.roll(corners, -1, axis=0)[:, None] * steps).reshape(-1, 3)
    points = points_in(1.5, 500)
    for make, width in ((rm.polygon, 2), (rm.polyline, 2), (lambda c: rm.polyline_tube(c, 0.1), 3)):
        few, rows = (
            make(np.vstack([corners, corners[:1]])[: 30 if make is rm.polygon else 31, :width]),
            make((many if make is rm.polygon else np.vstack([many, corners[:1]]))[:, :width]),
        )
        assert "u_table" in rows.glsl()
        assert "u_table" not in few.glsl()
        at = points[:, :width]
        assert np.max(np.abs(few.distance(at) - rows.distance(at))) < 1e-6
        same = np.linalg.norm(few.gradient(at) - rows.gradient(at), axis=1) < 1e-4
        assert np.mean(same) > 0.99


def test_a_mesh_is_sampled_once_and_kept(tmp_path):
    file = tmp_path / "box.stl"
    trimesh.creation.box((1, 2, 1)).export(file)
    shares = []
    node = mesh(file, resolution=24, cache=tmp_path / "kept", progress=shares.append)
    assert shares[-1] == 1.0
    again = []
    same = mesh(file, resolution=24, cache=tmp_path / "kept", progress=again.append)
    assert again == []
    points = points_in(1.5, 2000)
    np.testing.assert_array_equal(node.distance(points), same.distance(points))
    box = rm.box((1, 2, 1)).distance(points)
    cell = 2 / 19
    assert np.max(np.abs(node.distance(points)) - np.abs(box)) < cell
    near = np.abs(box) < 0.2
    assert np.max(np.abs(evaluate_undivided(node, points) - box)[near]) < cell


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda p: mesh(p / "nosuch.stl"), "nosuch.stl"),
        (lambda p: mesh(p / "broken.stl", cache=p), "broken.stl"),
        (lambda p: mesh(p / "open.stl", cache=p), "not closed"),
        (lambda p: mesh(p / "open.stl", resolution=3), "8 to 256"),
        (lambda p: heightmap(p / "nosuch.png"), "nosuch.png"),
        (lambda p: heightmap(p / "broken.png"), "broken.png"),
        (lambda p: heightmap(np.zeros(4)), "(4,)"),
        (lambda p: displace_by_image(rm.sphere(), np.array([[0, np.nan], [0, 0]])), "finite"),
        (lambda p: heightmap(p / "one.png"), "1 x 1 pixels"),
        (lambda p: heightmap(p / "long.png"), "2049 x 4 pixels"),
        (lambda p: heightmap(p / "bomb.png"), "bomb.png"),
        (lambda p: heightmap(p / "nan.tiff"), "1 of 16 heights are not finite"),
        (lambda p: heightmap(p / "cut.png"), "cut.png"),
        (lambda p: heightmap(np.zeros((1, 1))), "(1, 1)"),
        (lambda p: heightmap(np.zeros((4, 2049))), "2049"),
        (lambda p: heightmap(np.full((4, 4), np.inf)), "16 of 16"),
        (lambda p: rm.image(p / "bomb.png"), "bomb.png"),
        (lambda p: rm.image(p / "one.png"), "one.png' is too fine"),
        (lambda p: rm.image(p / "cut.png"), "cut.png"),
        (lambda p: rm.image(np.full((4, 4), np.nan)), "nan"),
        (lambda p: grid(np.where(ball(8) > 1.0, np.nan, ball(8))), "values are not finite"),
        (lambda p: grid(np.zeros((4, 4))), "(4, 4)"),
        (lambda p: grid(-np.ones((4, 4, 4))), "larger box"),
        (lambda p: grid(ball(8), size=-1), "> 0"),
    ],
)
def test_bad_data_is_refused(make, words, tmp_path):
    (tmp_path / "broken.stl").write_bytes(b"solid nothing")
    (tmp_path / "broken.png").write_bytes(b"not a picture")
    Image.new("L", (1, 1), 255).save(tmp_path / "one.png")
    Image.new("L", (2049, 4), 255).save(tmp_path / "long.png")
    heights = np.zeros((4, 4), np.float32)
    heights[1, 2] = np.nan
    Image.fromarray(heights).save(tmp_path / "nan.tiff")
    Image.effect_noise((64, 64), 50).save(tmp_path / "cut.png")
    whole = (tmp_path / "cut.png").read_bytes()
    (tmp_path / "cut.png").write_bytes(whole[: len(whole) // 2])
    head = struct.pack(">II", 60000, 60000) + bytes((8, 0, 0, 0, 0))
    chunk = b"IHDR" + head
    start = b"\x89PNG\r\n\x1a\n" + struct.pack(">I", 13) + chunk + struct.pack(">I", zlib.crc32(chunk))
    (tmp_path / "bomb.png").write_bytes(start + whole[33:])
    sheet = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    sheet.export(tmp_path / "open.stl")
    with pytest.raises(SceneError) as fault:
        make(tmp_path)
    assert words in str(fault.value)
    assert __file__ in str(fault.value)


def test_an_image_lies_the_right_way_round(tmp_path):
    """Row 0 of the file is the far side, column 0 the left."""
    pixels = np.zeros((8, 8), np.uint8)
    pixels[0, -1] = 255
    Image.fromarray(pixels).save(tmp_path / "corner.png")
    node = heightmap(tmp_path / "corner.png", size=(2, 2), height=1.0)
    corners = {(x, z): float(node.distance((x, 0.5, z))) for x in (-0.99, 0.99) for z in (-0.99, 0.99)}
    assert min(corners, key=corners.__getitem__) == (0.99, -0.99)


def test_equal_data_are_one_texture():
    a, b = Samples(ball(8)), Samples(ball(8).copy())
    assert a == b
    assert a.name == b.name
