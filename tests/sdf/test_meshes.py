"""Meshes from outside: inside out, wound at random, open, with vertices that are not numbers."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest
import trimesh

import raymarch as rm
from raymarch.errors import SceneError, SceneWarning
from raymarch.sdf.meshes import mesh

POINTS = np.random.default_rng(7).uniform(-1.5, 1.5, (4000, 3))
SIZE = np.array([1.0, 2.0, 1.0])


def box_distance(points: np.ndarray, size: np.ndarray = SIZE) -> np.ndarray:
    q = np.abs(points) - size / 2
    return np.linalg.norm(np.maximum(q, 0), axis=1) + np.minimum(q.max(axis=1), 0)


def saved(solid: trimesh.Trimesh, folder: Path, name: str = "solid.ply") -> Path:
    solid.export(folder / name)
    return folder / name


def unlike(node: rm.Node, known: np.ndarray) -> float:
    """Share of the points farther than two cells from the surface that are on the wrong side."""
    clear = np.abs(known) > 0.15
    return float(np.mean(np.sign(node.distance(POINTS))[clear] != np.sign(known)[clear]))


def box(size: np.ndarray = SIZE, turned: object = slice(0, 0)) -> trimesh.Trimesh:
    made = trimesh.creation.box(size)
    faces = made.faces.copy()
    faces[turned] = faces[turned][:, ::-1]
    return trimesh.Trimesh(made.vertices, faces, process=False)


@pytest.mark.parametrize(
    ("turned", "words"),
    [(slice(None), "it is inside out"), ([0, 5, 7], "3 of 12 triangles"), (slice(0, 8), "8 of 12 triangles")],
)
def test_a_mesh_is_turned_the_right_way_out(turned: object, words: str, tmp_path: Path) -> None:
    for name in ("solid.stl", "solid.ply"):
        file = saved(box(turned=turned), tmp_path, name)
        with pytest.warns(SceneWarning, match=words) as caught:
            node = mesh(file, resolution=24, cache=tmp_path)
        assert caught[0].filename == __file__
        assert unlike(node, box_distance(POINTS)) == 0.0
    with pytest.warns(SceneWarning, match=words):  # also when it is read from the cache
        mesh(file, resolution=24, cache=tmp_path)


def test_two_parts_one_of_which_is_inside_out(tmp_path: Path) -> None:
    half = np.array([0.6, 0.6, 0.6])
    one, other = box(half), box(half, slice(None))
    one.apply_translation((-0.6, 0, 0))
    other.apply_translation((0.6, 0, 0))
    file = saved(trimesh.util.concatenate([one, other]), tmp_path)
    with pytest.warns(SceneWarning, match="1 of its 2 parts are inside out"):
        node = mesh(file, resolution=40, cache=tmp_path)
    known = np.minimum(*(box_distance(POINTS - (x, 0, 0), half) for x in (-0.6, 0.6)))
    assert unlike(node, known) == 0.0


@pytest.mark.parametrize("whole", [False, True])
def test_a_cavity_stays_one(whole: bool, tmp_path: Path) -> None:
    """Its normals point into it, out of the solid; also where all of it is inside out."""
    inner = np.array([0.5, 1.2, 0.5])
    both = trimesh.util.concatenate([box(), box(inner, slice(None))])
    if whole:
        both = trimesh.Trimesh(both.vertices, both.faces[:, ::-1], process=False)
    file = saved(both, tmp_path)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        node = mesh(file, resolution=48, cache=tmp_path)
    assert len(caught) == whole
    known = np.maximum(box_distance(POINTS), -box_distance(POINTS, inner))
    assert unlike(node, known) == 0.0


def test_a_small_mesh_and_a_far_one_are_as_true(tmp_path: Path) -> None:
    tiny = box()
    tiny.apply_scale(1e-6)
    node = mesh(saved(tiny, tmp_path), extent=2.0, resolution=24, cache=tmp_path)
    assert unlike(node, box_distance(POINTS)) == 0.0


def broken(name: str) -> trimesh.Trimesh:
    solid = box()
    if name == "open":
        return trimesh.Trimesh(solid.vertices, solid.faces[1:], process=False)
    if name == "fin":
        return trimesh.Trimesh([*solid.vertices, [3, 0, 0]], [*solid.faces, [*solid.faces[0][:2], 8]], process=False)
    if name == "flat":
        return trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2], [1, 0, 2]], process=False)
    if name == "nan":
        solid.vertices[3] = np.nan
        return solid
    if name == "crossed":
        other = solid.copy()
        other.apply_translation((0.4, 0.3, 0.2))
        return trimesh.util.concatenate([solid, other])
    return klein()


def klein() -> trimesh.Trimesh:
    """A torus that is closed with a flip: one side only."""
    n = 8
    u, v = np.meshgrid(np.arange(n), np.arange(n), indexing="ij")
    a, b = 2 * np.pi * u / n, 2 * np.pi * (v + 0.5) / n
    r = 2 + np.cos(a / 2) * np.sin(b) - np.sin(a / 2) * np.sin(2 * b)
    places = np.stack([r * np.cos(a), r * np.sin(a), np.sin(a / 2) * np.sin(b) + np.cos(a / 2) * np.sin(2 * b)], -1)

    def at(i: int, j: int) -> int:
        return (i % n) * n + ((-1 - j if i >= n else j) % n)

    faces = []
    for i in range(n):
        for j in range(n):
            quad = at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)
            faces += [(quad[0], quad[1], quad[2]), (quad[0], quad[2], quad[3])]
    return trimesh.Trimesh(places.reshape(-1, 3), faces, process=False)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("open", "not closed: 3 edges"),
        ("fin", "edges"),
        ("flat", "triangle"),
        ("nan", "1 of 8 vertices"),
        ("klein", "one side"),
        ("crossed", "not clear"),
    ],
)
def test_what_has_no_inside_is_refused_with_the_reason(name: str, words: str, tmp_path: Path) -> None:
    file = saved(broken(name), tmp_path)
    with pytest.raises(SceneError, match=words) as caught:
        mesh(file, resolution=24, cache=tmp_path)
    assert "solid.ply" in str(caught.value) and __file__ in str(caught.value)


@pytest.mark.parametrize("name", ["solid.stl", "solid.ply", "solid.obj"])
def test_an_empty_file_is_refused(name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_bytes(b"")
    with pytest.raises(SceneError, match=name):
        mesh(tmp_path / name, cache=tmp_path)


def test_a_tiny_part_of_a_mesh_is_not_taken_for_a_flat_one(tmp_path: Path) -> None:
    """Its volume is 6e-14 of that of the mesh."""
    grain = box(np.full(3, 5e-5))
    grain.apply_translation((0.0, 1.5, 0.0))
    node = mesh(saved(trimesh.util.concatenate([box(), grain]), tmp_path), resolution=24, cache=tmp_path)
    assert unlike(node, box_distance(POINTS)) == 0.0


def test_a_good_mesh_says_nothing(tmp_path: Path) -> None:
    for solid in (box(), trimesh.creation.icosphere(2), trimesh.creation.torus(0.8, 0.2)):
        mesh(saved(solid, tmp_path), resolution=24, cache=tmp_path)


def test_text_of_another_encoding_and_a_wrong_count_are_read_or_named(tmp_path: Path) -> None:
    text = box().export(file_type="obj")
    (tmp_path / "latin.obj").write_bytes("# Körper für Gußformen\no Fläche\n".encode("latin-1") + text.encode())
    assert unlike(mesh(tmp_path / "latin.obj", resolution=24, cache=tmp_path), box_distance(POINTS)) == 0.0
    binary = bytearray(box().export(file_type="stl"))
    binary[80] += 3
    (tmp_path / "count.stl").write_bytes(binary)
    with pytest.raises(SceneError, match=r"count\.stl' holds no triangles"):
        mesh(tmp_path / "count.stl", cache=tmp_path)


@pytest.mark.parametrize("name", ["../outside.bin", "/dev/zero", "link.bin"])
def test_a_mesh_names_no_file_outside_of_its_folder(name: str, tmp_path: Path) -> None:
    made = box().export(file_type="gltf")
    buffer = next(each for each in made if each.endswith(".bin"))
    (tmp_path / "inside").mkdir()
    (tmp_path / "outside.bin").write_bytes(made[buffer])
    (tmp_path / "inside" / "link.bin").symlink_to("../outside.bin")
    scene = tmp_path / "inside" / "scene.gltf"
    scene.write_text(made["model.gltf"].decode().replace(buffer, name))
    with pytest.raises(SceneError, match="in its folder"):
        mesh(scene, resolution=8, cache=tmp_path)


def test_arrays_are_the_mesh_of_their_file(tmp_path: Path) -> None:
    ball = trimesh.creation.icosphere(2)
    ball.export(tmp_path / "ball.ply")
    points = np.random.default_rng(0).uniform(-1.5, 1.5, (200, 3))
    read = mesh(tmp_path / "ball.ply", resolution=16).distance(points)
    for given in ((ball.vertices, ball.faces), [ball.vertices.tolist(), ball.faces.tolist()], ball):
        np.testing.assert_allclose(mesh(given, resolution=16).distance(points), read, atol=1e-6)
    with pytest.warns(SceneWarning, match="the mesh of arrays: it is inside out"):
        mesh((ball.vertices, ball.faces[:, ::-1]), resolution=16)


@pytest.mark.parametrize(
    ("vertices", "faces", "words"),
    [
        (np.zeros((4, 2)), [[0, 1, 2]], r"vertices of shape \(4, 2\) \(\(N, 3\)"),
        (np.zeros((4, 3)), [[0, 1, 4]], "has the vertex 4 .whole numbers from 0 to 3"),
        (np.zeros((4, 3)), [[0, 1, 1.5]], "has the vertex 1.5"),
        (np.zeros((4, 3)), [[0, 1, -1]], "has the vertex -1"),
        (np.full((4, 3), np.nan), [[0, 1, 2]], "vertices"),
        (np.eye(3), [[0, 1, 2]], "the mesh of arrays is not closed"),
        ("abc", [[0, 1, 2]], "mesh: vertices = 'abc'"),
    ],
)
def test_arrays_that_are_no_mesh_are_refused(vertices: object, faces: object, words: str) -> None:
    with pytest.raises(SceneError, match=words):
        mesh((vertices, faces))
