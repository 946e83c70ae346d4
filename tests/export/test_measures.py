"""3MF files and measures of parts."""

from __future__ import annotations

import zipfile
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

import raymarch as rm

PLATE = rm.box((40, 20, 10)) - rm.cylinder(radius=4, height=30).orient((0, 0, 1))
CORE = "{http://schemas.microsoft.com/3dmanufacturing/core/2015/02}"
COLORS = "{http://schemas.microsoft.com/3dmanufacturing/material/2015/02}"


def test_a_3mf_holds_the_mesh_and_its_colours(tmp_path: Path) -> None:
    part = rm.box((2, 3, 4)).material(rm.Material("red")) | rm.box(1).material(rm.Material("blue")).translate((4, 0, 0))
    made = rm.export(part, tmp_path / "part.3mf", cells=24)
    assert made is not None
    with zipfile.ZipFile(tmp_path / "part.3mf") as package:
        assert package.namelist() == ["[Content_Types].xml", "_rels/.rels", "3D/3dmodel.model"]
        model = ElementTree.fromstring(package.read("3D/3dmodel.model"))
        target = ElementTree.fromstring(package.read("_rels/.rels"))[0].get("Target")
    assert model.get("unit") == "millimeter" and target == "/3D/3dmodel.model"
    vertices = np.array([[float(v.get(axis, "")) for axis in "xyz"] for v in model.iter(f"{CORE}vertex")])
    faces = np.array([[int(t.get(f"v{i}", "")) for i in (1, 2, 3)] for t in model.iter(f"{CORE}triangle")])
    np.testing.assert_allclose(vertices, made.vertices, atol=1e-7)
    a, b, c = vertices[faces].transpose(1, 0, 2)
    assert np.einsum("ij,ij->", a, np.cross(b, c)) / 6 == pytest.approx(2 * 3 * 4 + 1, rel=1e-3), "outwards and closed"
    listed = [color.get("color") for color in model.iter(f"{COLORS}color")]
    first = model.find(f".//{CORE}triangle")
    assert first is not None and sorted(map(str, listed)) == ["#0000FF", "#FF0000"]
    assert listed[int(first.get("p1", ""))] == "#FF0000", "the triangle at the least x"


def test_step_is_answered_with_why(tmp_path: Path) -> None:
    with pytest.raises(rm.SceneError, match=r"no edges and faces for a CAD file.*\.3mf"):
        rm.export(PLATE, tmp_path / "part.step")


def test_measures_of_a_plate_with_a_hole() -> None:
    found = rm.measure(PLATE, cells=48)
    assert found.volume == pytest.approx(40 * 20 * 10 - np.pi * 16 * 10, rel=1e-3)
    assert found.area == pytest.approx(2 * (800 + 400 + 200 - np.pi * 16) + 2 * np.pi * 4 * 10, rel=2e-3)
    np.testing.assert_allclose(found.extent, (40, 20, 10), atol=1e-5)
    np.testing.assert_allclose(found.centroid, 0, atol=1e-3)
    np.testing.assert_allclose(found.thickness([(20, 0, 0), (0, 10, 0), (20.3, 9, 1)]), (16, 6, 40), rtol=1e-6)
    assert found.thickness((3, 2, 5)).shape == (1,)


@pytest.mark.parametrize("size", [0.003, 1.0, 1000.0])
@pytest.mark.parametrize("cells", [30, 64])
def test_extents_of_a_box_are_exact_at_any_size_and_place(size: float, cells: int) -> None:
    for middle in np.zeros(3), size * np.array([0.3, 7.0, -40.0]):
        found = rm.measure(rm.box((size, size / 2, size / 3)).translate(middle), cells=cells)
        np.testing.assert_allclose(found.extent, (size, size / 2, size / 3), rtol=1e-12)
        np.testing.assert_allclose(np.mean(found.bounds, axis=0), middle, atol=1e-13 * size, rtol=1e-13)


@pytest.mark.parametrize("size", [1.0, 1000.0])
def test_thickness_of_a_shell_at_any_size(size: float) -> None:
    shell = rm.measure(rm.sphere(2 * size).shell(0.2 * size), cells=12)
    np.testing.assert_allclose(shell.thickness(size * np.array([(0, 2.1, 0), (1.2, 1.2, 1.3)])), 0.2 * size, rtol=1e-4)


FLUSH = {
    "boxes": (rm.box(1) | rm.box(1).translate((1, 0, 0)), 10.0),
    "boxes along x = y": (
        rm.box(2**0.5).rotate(rm.pi / 4, "z") | rm.box(2**0.5).rotate(rm.pi / 4, "z").translate((1, 1, 0)),
        20.0,
    ),
    "mirrored": (rm.box(1).translate((0.5, 0.2, 0)).mirror("x"), 10.0),
    "cylinders": (rm.cylinder(0.5, 1) | rm.cylinder(0.5, 1).translate((0, 1, 0)), 2.5 * np.pi),
    "halves of a ball": (
        (rm.sphere(1) & rm.box(4).translate((2, 0, 0))) | (rm.sphere(1) & rm.box(4).translate((-2, 0, 0))),
        4 * np.pi,
    ),
    "eight boxes": (rm.box(1).repeat(1, 2), 24.0),
}


@pytest.mark.parametrize("name", FLUSH)
@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
def test_solids_that_touch_at_a_face_have_no_wall_there(name: str, size: float) -> None:
    """Also where points of the grid lie in the face, at which the field is 0."""
    solid, area = FLUSH[name]
    found = rm.measure(solid.scale(size), cells=32)
    assert found.area == pytest.approx(area * size**2, rel=2e-3)


def test_distance_of_two_parts() -> None:
    plate, ball = rm.measure(PLATE, cells=32), rm.measure(rm.sphere(3).translate((30, 1, 2)), cells=32)
    gap = plate.distance(ball)
    assert gap.distance == pytest.approx(7, abs=plate.deviation + ball.deviation)
    assert gap.start[0] == pytest.approx(20, abs=1e-4) and gap.end[0] == pytest.approx(27, abs=0.02)
    assert ball.distance(plate).distance == gap.distance
    inside = rm.measure(rm.sphere(1).translate((12, 0, 0)), cells=12)
    assert plate.distance(inside).distance == 0 == inside.distance(plate).distance
    with pytest.raises(rm.SceneError, match=r"what rm\.measure"):
        plate.distance(rm.sphere())  # type: ignore[arg-type]


def test_points_that_lead_nowhere_are_refused() -> None:
    with pytest.raises(rm.SceneError, match="lead to no surface"):
        rm.measure(rm.sphere(), cells=8).thickness((0, 0, 0))


@pytest.mark.parametrize("points", [[(9, 9)], (1, 2, 3, 4), [[[1, 2, 3]]], 3])
def test_points_of_another_shape_are_refused(points: object) -> None:
    with pytest.raises(
        rm.SceneError, match=r"test_measures.py:\d+: thickness: points of shape .* \(\(N, 3\) or \(3,\)"
    ):
        rm.measure(rm.sphere(), cells=8).thickness(points)  # type: ignore[arg-type]
