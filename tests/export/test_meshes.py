"""Exported meshes: closed, near the surface, coloured and oriented, and sampled only where the surface may be."""

from __future__ import annotations

import json
import math
import re
import struct
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import raymarch as rm
from raymarch.errors import RaymarchError
from raymarch.export.dual import contour
from raymarch.export.surface import BLOCK, Surface, surface_of
from raymarch.expr.vocabulary import length, vec2, vec3
from raymarch.scene.parameter import set_values
from raymarch.sdf.definition import cube
from raymarch.sdf.domain import Positive
from tests.support.commands import files, run

RED, GREEN = rm.Material(color=(0.8, 0.1, 0.05)), rm.Material(color=(0.1, 0.7, 0.2))


def wide(major: Any, minor: Any) -> Any:
    """A box around a torus with room for cells beside the surface."""
    return cube(vec3(major + 2.0 * minor, 2.0 * minor, major + 2.0 * minor))


@rm.shape(exactness="exact", bounds=wide)
def exact_torus(p: Any, major: Positive = 1.0, minor: Positive = 0.25) -> Any:
    return length(vec2(length(p.xz) - major, p.y)) - minor


@rm.shape(exactness="estimate", bounds=wide)
def estimated_torus(p: Any, major: Positive = 1.0, minor: Positive = 0.25) -> Any:
    """A torus whose field has no known Lipschitz constant."""
    return length(vec2(length(p.xz) - major, p.y)) - minor


def surface(node: rm.Node, cells: int = 40, **options: Any) -> Surface:
    scene = rm.Scene(node)
    return surface_of(scene, set_values(scene.parameters), cells, **options)


def on_surface(node: rm.Node, count: int) -> NDArray[np.float64]:
    """Points on the surface of an exact field, by steps along its gradient from points around it."""
    low, high = node.bounds
    points = np.random.default_rng(5).uniform(low - 0.2, high + 0.2, (count, 3))
    for _ in range(8):
        points = points - node.distance(points)[:, None] * node.gradient(points)
    return points[np.abs(node.distance(points)) < 1e-9]


def test_measures_are_those_of_the_solid() -> None:
    ball = rm.triangulate(rm.Scene(rm.sphere(rm.Param("radius", 1.0, 0.5, 2.0)).translate((5, 0, 0))), cells=48)
    assert ball.volume == pytest.approx(4 / 3 * np.pi, rel=1e-3)
    assert ball.area == pytest.approx(4 * np.pi, rel=1e-3)
    np.testing.assert_allclose(ball.centroid, (5, 0, 0), atol=1e-6)
    np.testing.assert_allclose(ball.bounds, [(4, -1, -1), (6, 1, 1)], atol=0.01 * ball.cell + ball.deviation)
    at = np.concatenate([ball.vertices, ball.vertices[ball.faces].mean(axis=1)]) - (5, 0, 0)
    assert ball.deviation == pytest.approx(np.abs(np.linalg.norm(at, axis=1) - 1).max(), rel=1e-6)
    angle = rm.triangulate(rm.box(2) - rm.box(2).translate((1, 1, 0)), cells=20)
    assert angle.volume == pytest.approx(6, rel=1e-3) and angle.area == pytest.approx(22, rel=1e-3)
    np.testing.assert_allclose(angle.centroid, (-1 / 6, -1 / 6, 0), atol=1e-3)
    large = rm.triangulate(rm.sphere(rm.Param("radius", 1.0, 0.5, 2.0)), cells=24, params={"radius": 2.0})
    assert large.volume == pytest.approx(8 * ball.volume, rel=0.01)


def test_a_tolerance_is_kept_or_refused(tmp_path: Path) -> None:
    ball = rm.sphere(10)
    coarse, fine = (rm.triangulate(ball, tolerance=t) for t in (0.05, 0.005))
    for mesh, tolerance in ((coarse, 0.05), (fine, 0.005)):
        at = np.concatenate([mesh.vertices, mesh.vertices[mesh.faces].mean(axis=1)])
        assert np.abs(np.linalg.norm(at, axis=1) - 10).max() <= tolerance
    assert len(coarse.faces) < len(fine.faces) and coarse.cell > fine.cell
    assert repr(coarse) == f"<mesh: {len(coarse.faces):,} triangles, off the surface by up to {coarse.deviation:.2g}>"
    with pytest.raises(rm.SceneError, match=r"512 cells is off the surface .* the tolerance 1e-09 \(cells=1024"):
        rm.triangulate(rm.sphere(10) & rm.box((20, 1, 1)), tolerance=1e-9, cells=512)
    with pytest.raises(rm.SceneError, match=r"triangulate: tolerance = 0 \(a length > 0\)"):
        rm.triangulate(ball, tolerance=0)
    with pytest.raises(rm.SceneError, match=r"tolerance = 0.1 for a .html file"):
        rm.export(ball, tmp_path / "a.html", tolerance=0.1)


THIN = {
    "fin": (rm.box(1) | rm.box((3, 0.01, 3)).translate((1, 0.06, 0)), 1.08),
    "wire": (
        rm.box(1) | rm.cylinder(0.02, 3).rotate(1, "x").translate((0.04, 0, 0)),
        1 + math.pi * 0.02**2 * (3 - 1 / math.sin(1)),
    ),
    "slit": (rm.box(2) - rm.box((0.01, 3, 1)).translate((0.303, 0, 0)), 8 - 0.02),
}


@pytest.mark.parametrize("name", THIN)
def test_parts_that_the_grid_misses_are_told_or_found(name: str) -> None:
    """A fin of 0.01 was left out of meshes, measures and printed parts, and the deviation did not show it."""
    solid, volume = THIN[name]
    with pytest.warns(
        rm.SceneWarning, match=r"24 cells lacks parts or gaps thinner than a cell, .* \(cells=48, or a tol"
    ):
        coarse = rm.triangulate(solid, cells=24)
    assert len(coarse.missed) and abs(coarse.volume - volume) > 0.002
    assert np.abs(solid.distance(coarse.missed)).max() < 1e-3 * coarse.cell
    if name != "slit":
        fine = rm.triangulate(solid, tolerance=0.005, cells=48)
        assert fine.volume == pytest.approx(volume, abs=3e-4) and not len(fine.missed)


def test_a_plate_between_the_points_of_the_grid_takes_more_cells() -> None:
    for plate in (rm.triangulate(rm.box((10, 0.05, 10))), rm.triangulate(rm.box((10, 0.05, 10)), tolerance=0.01)):
        assert plate.volume == pytest.approx(5, rel=1e-3)
    with pytest.raises(
        rm.SceneError, match=r"grid of 64 cells lies inside the solid, which is thinner than a cell, 0.156"
    ):
        rm.triangulate(rm.box((10, 0.05, 10)), cells=64)


@pytest.mark.parametrize("solid", [rm.box(1) - rm.box((0.5, 1, 0.5)), rm.box(1) | rm.box(1).translate((1, 1, 0))])
def test_faces_that_touch_are_no_thin_parts(solid: rm.Node) -> None:
    """Films without a thickness, and edges that touch, are no part of a mesh."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert not len(rm.triangulate(solid, cells=40).missed)


def test_the_deviation_of_a_field_that_rises_slowly_in_places() -> None:
    """Near the ends of a thread the gradient is short, and the value over its length is far more than the distance."""

    def groove(p: Any) -> Any:
        return 0.9 * abs(2 * rm.fract(p.y / 1.5 - rm.atan2(p.z, p.x) / rm.tau) - 1) - 0.45

    screw = rm.cylinder(radius=7.55, height=14).displace_by(groove, lipschitz=1.21) & rm.slab(thickness=14)
    with pytest.warns(rm.SceneWarning, match="thinner than a cell"):  # crests that the ends cut to slivers
        mesh = rm.triangulate(screw, cells=64)
    at = np.concatenate([mesh.vertices, mesh.vertices[mesh.faces].mean(axis=1)])
    assert mesh.deviation >= np.abs(screw.distance(at)).max(), "the field is a lower bound of the distance"
    assert mesh.deviation < 1.5 * mesh.cell


def test_the_command_prints_the_measures(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "part.py").write_text("import raymarch as rm\nscene = rm.box(2)\n")
    assert run("export", str(tmp_path / "part.py"), "-o", str(tmp_path / "part.stl"), "--tolerance", "0.02") == 0
    said = capsys.readouterr().err
    assert re.search(r"triangles, off the surface by up to \S+; volume [78]\.?\d*, area 2[34]\.?\d*", said)


SMOOTH, SHARP = 0.1, 1e-3
"""Greatest distance between mesh and surface in cells: of smooth solids, and of those with flat faces."""

EXACT = {
    "sphere": (rm.sphere(1.1).translate((3, 0, 1)), SMOOTH),
    "torus": (rm.torus(1, 0.3).rotate(0.5, "x"), SMOOTH),
    "capsule": (rm.capsule((-1, 0, 0), (1, 0.5, 0.2), 0.4), SMOOTH),
    "far": (rm.torus(1, 0.3).rotate(0.5, "x").translate((1000, 0, 0)), SMOOTH),
    "box": (rm.box((1, 1.5, 2)).rotate(0.4, (1, 2, 3)), SHARP),
    "cube": (rm.box(1), SHARP),
}


@pytest.mark.parametrize("name", EXACT)
def test_a_mesh_is_closed_and_near_the_surface(name: str) -> None:
    """By the Hausdorff distance; and all normals are outward."""
    trimesh = pytest.importorskip("trimesh")
    node, cells = EXACT[name]
    made = surface(node)
    mesh = trimesh.Trimesh(made.vertices, made.faces, process=False)
    assert mesh.is_watertight and mesh.is_winding_consistent and mesh.volume > 0
    limit = cells * made.cell
    inner = np.concatenate([made.vertices, mesh.triangles_center, mesh.triangles[:, :2].mean(axis=1)])
    assert np.abs(node.distance(inner)).max() <= limit
    points = on_surface(node, 400)
    assert len(points) > 300
    assert np.abs(trimesh.proximity.closest_point(mesh, points)[1]).max() <= limit
    assert np.einsum("ij,ij->i", made.normals, mesh.vertex_normals).min() > 0.0
    np.testing.assert_allclose(np.linalg.norm(made.normals, axis=1), 1.0, atol=1e-9)


def test_more_cells_are_nearer() -> None:
    torus, _ = EXACT["torus"]
    errors = [np.abs(torus.distance(surface(torus, cells).vertices)).max() for cells in (20, 40)]
    assert errors[1] < 0.4 * errors[0]


def test_a_box_has_sharp_edges() -> None:
    """Points of the edges and the corners are on the mesh."""
    trimesh = pytest.importorskip("trimesh")
    size, turn = np.array([1, 1.5, 2]), rm.box((1, 1.5, 2)).rotate(0.4, (1, 2, 3))
    made = surface(turn)
    corners = np.array(np.meshgrid(*[(-0.5, 0.5)] * 3)).reshape(3, -1).T * size
    edges = [(a, b) for a in corners for b in corners if np.sum(a != b) == 1]
    points = np.array([a + t * (b - a) for a, b in edges for t in np.linspace(0, 1, 15)])
    axis = np.array([1, 2, 3]) / np.sqrt(14)
    turned = points * np.cos(0.4) + np.cross(axis, points) * np.sin(0.4)
    turned += np.outer(points @ axis, axis) * (1 - np.cos(0.4))
    assert np.abs(turn.distance(turned)).max() < 1e-12
    mesh = trimesh.Trimesh(made.vertices, made.faces, process=False)
    assert np.abs(trimesh.proximity.closest_point(mesh, turned)[1]).max() <= 1e-3 * made.cell


def test_random_signs_give_a_manifold() -> None:
    """Each side belongs to two triangles, and the triangles around each vertex are one fan."""

    def tangents(starts: Any, axes: Any, ends: Any) -> Any:
        at = ends[:, 0] / (ends[:, 0] - ends[:, 1])
        return starts + np.eye(3)[axes] * at[:, None], np.eye(3)[axes] * np.sign(ends[:, 1] - ends[:, 0])[:, None]

    for seed in range(8):
        values = np.pad(np.random.default_rng(seed).uniform(-1, 1, (7, 7, 7)), 1, constant_values=1.0)
        made = contour([(np.zeros(3, int), values)], tangents, lambda p: (np.zeros(len(p)), np.zeros((len(p), 3))))
        sides = np.concatenate([made.faces[:, [i, (i + 1) % 3]] for i in range(3)])
        assert len(np.unique(sides, axis=0)) == len(sides)
        assert set(np.unique(np.sort(sides, axis=1), axis=0, return_counts=True)[1]) == {2}
        following: dict[int, dict[int, int]] = {}
        for face in made.faces.tolist():
            for i in range(3):
                following.setdefault(face[i], {})[face[(i + 1) % 3]] = face[(i + 2) % 3]
        for fan in following.values():
            seen = [next(iter(fan))]
            while fan[seen[-1]] != seen[0]:
                seen.append(fan[seen[-1]])
            assert len(seen) == len(fan)


@pytest.mark.parametrize(
    "node",
    [
        rm.box(1) - rm.sphere(0.65),
        rm.union(*(rm.sphere(0.3).translate((0.4 * i, 0.1 * i * i, 0)) for i in range(4)), k=0.2),
        rm.gyroid(thickness=0.1) & rm.sphere(1.3),
        rm.box((1, 0.4, 1)).twist(2.0),
        rm.box(1) | rm.box(1).translate((1, 1, 0)),  # they share an edge
        rm.sphere(0.5) | rm.sphere(0.5).translate((1, 0, 0)),  # they touch
    ],
    ids=["csg", "blend", "gyroid", "twist", "edge", "touch"],
)
def test_joined_blocks_stay_closed(node: rm.Node) -> None:
    trimesh = pytest.importorskip("trimesh")
    made = surface(node, 3 * BLOCK + 5)
    mesh = trimesh.Trimesh(made.vertices, made.faces, process=False)
    assert mesh.is_watertight and mesh.is_winding_consistent and mesh.volume > 0
    points = np.concatenate([made.vertices, mesh.triangles_center, mesh.triangles[:, :2].mean(axis=1)])
    assert np.abs(node.distance(points)).max() <= 0.5 * np.sqrt(3) * made.cell
    if node.exactness == "exact":
        found = on_surface(node, 300)
        assert np.abs(trimesh.proximity.closest_point(mesh, found)[1]).max() <= 0.5 * np.sqrt(3) * made.cell


def test_blocks_without_the_surface_are_not_sampled() -> None:
    """All blocks together give the same mesh."""
    made = surface(exact_torus(1, 0.05).rotate(0.7, (1, 0, 1)), 8 * BLOCK)
    assert made.sampled < 0.3 * made.blocks
    steep = surface(estimated_torus(1, 0.05).rotate(0.7, (1, 0, 1)), 8 * BLOCK)
    assert steep.sampled == steep.blocks
    np.testing.assert_array_equal(made.faces, steep.faces)
    np.testing.assert_allclose(made.vertices, steep.vertices, atol=1e-6)


def test_colors_are_those_of_the_materials() -> None:
    made = surface(rm.sphere(0.5).material(RED) | rm.sphere(0.5).translate((2, 0, 0)).material(GREEN), 30)
    left = made.vertices[:, 0] < 1
    np.testing.assert_allclose(made.colors[left], np.broadcast_to((0.8, 0.1, 0.05), (left.sum(), 3)), atol=1e-12)
    np.testing.assert_allclose(made.colors[~left], np.broadcast_to((0.1, 0.7, 0.2), ((~left).sum(), 3)), atol=1e-12)


def test_a_box_clips_the_solid() -> None:
    trimesh = pytest.importorskip("trimesh")
    floor = rm.plane(offset=-0.2).material(GREEN)
    box = (np.array([-1.0, -1.0, -0.5]), np.array([1.0, 1.0, 0.5]))
    made = surface(floor | rm.sphere(0.5).material(RED), 30, box=box)
    mesh = trimesh.Trimesh(made.vertices, made.faces, process=False)
    assert mesh.is_watertight and mesh.volume == pytest.approx(2 * 0.8 * 1 + 0.39, abs=0.03)
    side = made.vertices[:, 0] > 1 - 1e-3
    flat = side & (np.abs(made.vertices[:, 1] + 0.6) < 0.3) & (np.abs(made.vertices[:, 2]) < 0.45)
    assert flat.sum() > 50 and np.allclose(made.normals[flat], (1, 0, 0))


def test_what_has_no_mesh_is_refused(tmp_path: Path) -> None:
    solid = rm.sphere() | rm.torus().rotate(0.3) | rm.plane(offset=-1).translate((0, 1, 0))
    for scene, message in (
        (rm.Scene(solid), r"test_meshes.py:\d+: plane is unbounded, and a mesh is finite"),
        (rm.Scene(rm.sphere() & rm.sphere().translate((5, 0, 0))), "the solid is empty"),
        (
            rm.Scene(
                rm.glsl_node("float ball(vec3 p) { return length(p) - 1.0; }", "ball", bounds=((-1,) * 3, (1,) * 3))
            ),
            "GLSL node",
        ),
    ):
        with pytest.raises(RaymarchError, match=message):
            rm.export(scene, tmp_path / "made.stl")
    for options, message in (
        ({"cells": 1}, "cells = 1"),
        ({"cells": 2.5}, "cells = 2.5"),
        ({"box": ((0, 0, 0), (1, 0, 1))}, "box = "),
        ({"box": 3}, "box = 3"),
        ({"box": ((5, 5, 5), (6, 6, 6))}, "no part in the box"),
        ({"shadertoy": True}, "shadertoy = True for a .stl file"),
    ):
        with pytest.raises(RaymarchError, match=message):
            rm.export(rm.Scene(rm.sphere()), tmp_path / "made.stl", **options)  # type: ignore[arg-type]
    assert not files(tmp_path)


@pytest.mark.parametrize("suffix", [".stl", ".obj", ".ply"])
def test_files_hold_the_mesh(suffix: str, tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh")
    solid = rm.sphere(0.5).material(RED) | rm.sphere(0.5).translate((2, 0, 0)).material(GREEN)
    seen: list[float] = []
    rm.export(rm.Scene(solid), tmp_path / f"made{suffix}", cells=60, progress=seen.append)
    assert files(tmp_path) == {f"made{suffix}"} and seen[-1] == 1.0 and seen == sorted(seen)
    mesh = trimesh.load(tmp_path / f"made{suffix}", force="mesh")
    assert mesh.is_watertight and mesh.volume == pytest.approx(2 * 0.5236, rel=0.02)
    if suffix != ".stl":
        left = mesh.vertices[:, 0] < 1
        assert np.all(mesh.visual.vertex_colors[left][:, :3] == (231, 89, 63))  # sRGB of RED


def test_a_glb_holds_the_mesh(tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh")
    file = tmp_path / "made.glb"
    rm.export(rm.box((1, 2, 3)).material(RED), file, cells=60)
    data = file.read_bytes()
    assert struct.unpack_from("<4sII", data) == (b"glTF", 2, len(data))
    length = struct.unpack_from("<I", data, 12)[0]
    document = json.loads(data[20 : 20 + length])
    view = document["bufferViews"][2]
    colors = np.frombuffer(data[28 + length :], "<u2", view["byteLength"] // 2, view["byteOffset"]).reshape(-1, 4)
    np.testing.assert_allclose(colors[:, :3] / 65535, np.broadcast_to((0.8, 0.1, 0.05), (len(colors), 3)), atol=1e-5)
    mesh = trimesh.load(file, force="mesh")
    assert mesh.is_watertight and mesh.volume == pytest.approx(6, rel=1e-4)
    np.testing.assert_allclose(mesh.bounds, [[-0.5, -1, -1.5], [0.5, 1, 1.5]], atol=1e-4)


def test_parameters_and_time_change_the_mesh() -> None:
    ball = rm.sphere(rm.Param("radius", 1.0, 0.5, 2.0)).translate((0.5 * rm.time, 0, 0))
    scene = rm.Scene(ball)
    box = (np.full(3, -3.0), np.full(3, 3.0))
    made = surface_of(scene, set_values(scene.parameters, {"radius": 1.5}, 2.0), 30, box)
    np.testing.assert_allclose(made.vertices.mean(axis=0), (1, 0, 0), atol=0.02)
    assert np.linalg.norm(made.vertices - (1, 0, 0), axis=1) == pytest.approx(1.5, abs=0.02)


def test_the_command_writes_a_mesh(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "scene.py").write_text("import raymarch as rm\nscene = rm.box(1) | rm.plane(offset=-0.4)\n")
    scene = str(tmp_path / "scene.py")
    assert run("export", scene, "-o", str(tmp_path / "made.stl")) == 2
    assert "scene.py:2: plane is unbounded" in capsys.readouterr().err and files(tmp_path) == {"scene.py"}
    assert run("export", scene, "-o", str(tmp_path / "made.stl"), "--cells", "16", "--box=-1,-1,-1:1,1,1") == 0
    assert files(tmp_path) == {"scene.py", "made.stl"}


def test_a_mesh_far_from_the_origin_is_that_near_it() -> None:
    """At 1e6 an ulp of float32 is a sixteenth: two cells here."""
    for away in (0.0, 1e6 + 0.3):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            made = rm.triangulate(rm.sphere(1).translate((away, 0, 0)), cells=60)
        assert made.area == pytest.approx(4 * math.pi, rel=1e-3) and made.deviation < 1e-3
