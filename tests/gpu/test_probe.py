"""The probe names what is wrong, with its line, and finds nothing where nothing is."""

from __future__ import annotations

import inspect
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.expr.faults import KINDS
from raymarch.expr.vocabulary import length, log, max, vec3, where
from raymarch.gpu.context import Context
from raymarch.gpu.probe import find_faults, find_slopes, probe_with
from raymarch.gpu.probe_pictures import COLORS, fault_numbers, fault_picture, slope_numbers, slope_picture
from raymarch.gpu.reports import sentences, table
from raymarch.plan import plan
from raymarch.plan.probe import plan_faults, plan_slopes
from raymarch.sdf.definition import REGISTRY, cube
from raymarch.shader import assemble

SIZE = (48, 32)
CAMERA = rm.Camera((0, 1, 6), (0, 0, 0))


@rm.shape(exactness="bound", bounds=lambda radius: cube(radius))
def cracked(p: Any, radius: float = 1.0) -> Any:
    return max(length(p) - radius, log(p.x) - 200.0)


@rm.shape(exactness="bound", bounds=lambda radius: cube(radius))
def divided(p: Any, radius: float = 1.0) -> Any:
    return where(p.y > 0.0, length(p), length(p) / where(p.x < 9.0, 0.0, 1.0)) - radius


@rm.shape(exactness="bound", bounds=lambda radius: cube(radius), lipschitz=1.0)
def steeper(p: Any, radius: float = 1.0) -> Any:
    return 1.5 * (length(p) - radius)


@rm.shape(exactness="bound", bounds=lambda radius: cube(radius))
def early(p: Any, radius: float = 1.0) -> Any:
    return max(length(p) - radius, log(where(p.z > 4.0, 0.0, 1.0)) - 200.0)


@rm.shape(exactness="bound", bounds=lambda radius: cube(radius))
def late(p: Any, radius: float = 1.0) -> Any:
    return max(length(p) - radius, log(where(p.z < 3.0, 0.0, 1.0)) - 200.0)


@rm.shape(exactness="bound", bounds=lambda radius: cube(radius))
def slightly(p: Any, radius: float = 1.0) -> Any:
    return 1.01 * (length(p) - radius)


for _own in ("cracked", "divided", "steeper", "slightly", "early", "late"):
    REGISTRY.pop(_own)


def here() -> int:
    """The line of the caller."""
    frame = inspect.currentframe()
    assert frame is not None and frame.f_back is not None
    return frame.f_back.f_lineno


def off_ray(camera: rm.Camera, pixel: tuple[int, int], position: Any) -> float:
    """Sine of the angle between the ray of a pixel and a position, as seen from the camera."""
    pose = camera.pose(rm.scene.parameter.Values({}), None, SIZE[0] / SIZE[1])
    screen = (2 * np.array([pixel[0] + 0.5, SIZE[1] - pixel[1] - 0.5]) - SIZE) / SIZE[1] * pose.tan_half_fov
    direction = pose.frame @ np.array([*screen, -1.0])
    away = np.asarray(position) - pose.position
    return float(np.linalg.norm(np.cross(away, direction)) / np.linalg.norm(away) / np.linalg.norm(direction))


@pytest.fixture
def renderer(egl: Context) -> Any:
    with rm.Renderer(SIZE, context=egl) as made:
        yield made


def test_a_hidden_logarithm_is_named_with_its_line_its_value_and_its_place(renderer: rm.Renderer) -> None:
    planted, line = cracked().translate((-1.2, 0, 0)), here()
    found = find_faults(
        renderer, rm.Scene(planted | rm.sphere().translate((1.2, 0, 0)) | rm.plane(offset=-1.1), CAMERA)
    )
    (wrong,) = [report for report in found.reports if report.faults]
    assert (wrong.name, wrong.where and (wrong.where.file, wrong.where.line)) == ("cracked", (__file__, line))
    assert wrong.first is not None and wrong.first.what == "the logarithm of 0 or less"
    x, row = wrong.first.pixel
    assert found.node[row, x] == found.reports.index(wrong) and np.all(found.node[:row] == -1)
    assert wrong.faults == np.count_nonzero(found.node >= 0) and 0.05 < wrong.faults / found.node.size < 0.95
    # asked at x + 1.2 <= 0, and on the ray of that pixel
    value, position = wrong.first.value, np.array(wrong.first.position)
    assert value <= 0.0 and abs(position[0] + 1.2 - value) < 1e-5
    assert off_ray(CAMERA, (x, row), position) < 1e-4
    (sentence,) = sentences(found.reports)
    assert (
        sentence.startswith(f"cracked, {__file__}:{line}: the logarithm of 0 or less, ") and f"{(x, row)}" in sentence
    )


def test_a_division_by_zero_is_found_only_where_it_is_taken(renderer: rm.Renderer) -> None:
    found = find_faults(renderer, rm.Scene(divided() | rm.plane(offset=-1.5), rm.Camera((0, 0.1, 6), (0, 0.1, 0))))
    (wrong,) = [report for report in found.reports if report.faults]
    assert wrong.name == "divided" and wrong.first is not None and wrong.first.what == "a division by 0"
    rows = np.any(found.node >= 0, axis=1)
    assert not rows[: SIZE[1] // 2 - 1].any() and rows[SIZE[1] // 2 + 1 :].all()


def test_every_node_at_fault_is_counted_by_itself(renderer: rm.Renderer) -> None:
    """Also one whose pixels have all seen another fault before."""
    both = early() | late() | rm.plane(offset=-1.5)
    found = find_faults(renderer, rm.Scene(both, CAMERA))
    counts = {report.name: report.faults for report in found.reports if report.faults}
    first = {found.reports[k].name for k in np.unique(found.node[found.node >= 0])}
    assert first == {"early"} and counts["early"] == np.count_nonzero(found.node >= 0)
    assert set(counts) == {"early", "late"} and 0 < counts["late"] < counts["early"]


def test_glsl_materials_and_colours_are_looked_at(renderer: rm.Renderer) -> None:
    code = "float holed(vec3 p) {\n    return p.x < -0.3 ? sqrt(-1.0 - p.x * p.x) : length(p) - 1.0;\n}"
    node, line = rm.glsl_node(code, "holed", bounds=((-1, -1, -1), (1, 1, 1))), here()
    found = find_faults(renderer, rm.Scene(node | rm.plane(offset=-1), CAMERA))
    (wrong,) = [report for report in found.reports if report.faults]
    assert (wrong.name, wrong.where and wrong.where.line) == ("glsl_node", line)
    assert wrong.first is not None and wrong.first.what == KINDS[1] and not np.isfinite(wrong.first.value)
    spotted = rm.Material(lambda p: log(p.y) * vec3(1, 1, 1))
    found = find_faults(renderer, rm.Scene(rm.sphere().material(spotted), CAMERA))
    (wrong,) = [report for report in found.reports if report.faults]
    assert wrong.name == "surface" and wrong.first is not None and wrong.first.what == "the logarithm of 0 or less"


def test_a_slope_beyond_its_promise_is_named(renderer: rm.Renderer) -> None:
    planted, line = steeper().translate((-1.2, 0, 0)).rotate(0.2, "z"), here()
    found = find_slopes(renderer, rm.Scene(planted | rm.box(1).translate((1.2, 0, 0)) | rm.plane(offset=-1.1), CAMERA))
    by_name = {report.name: report for report in found.reports}
    wrong = by_name["steeper"]
    assert (wrong.where and wrong.where.line, wrong.promise, wrong.broken, wrong.inherits) == (line, 1.0, True, False)
    assert wrong.slope == pytest.approx(1.5, abs=2e-3) and wrong.steepest is not None
    assert all(by_name[name].inherits and by_name[name].broken for name in ("union", "rotate"))
    assert not by_name["box"].broken and not by_name["plane"].broken and by_name["box"].slope > 0.9
    (sentence,) = list(sentences(found.reports))
    assert sentence.startswith(f"steeper, {__file__}:{line}: slope 1.5 exceeds the Lipschitz bound 1 at (")
    shown = found.node[found.ratio > 1.001]
    assert shown.size > 20 and all(found.reports[k].broken for k in shown)
    assert np.mean([found.reports[k].name == "steeper" for k in shown]) > 0.9


def test_a_slope_is_that_of_the_definition_before_it_is_divided(renderer: rm.Renderer) -> None:
    code = "float thrice(vec3 p) { return 3.0 * (length(p) - 1.0); }"
    node = rm.glsl_node(code, "thrice", "bound", lipschitz=2.0, bounds=((-1, -1, -1), (1, 1, 1)))
    found = find_slopes(renderer, rm.Scene(node | rm.plane(offset=-1.1), CAMERA)).reports
    (wrong,) = [report for report in found if report.name == "glsl_node"]
    assert wrong.broken and wrong.promise == 2.0 and wrong.slope == pytest.approx(3.0, abs=4e-3)


@pytest.mark.parametrize("far", [0.0, 1e6])
def test_places_are_in_the_scene_and_on_the_ray_of_their_pixel(renderer: rm.Renderer, far: float) -> None:
    camera = rm.Camera((far, 1, 6), (far, 0, 0))
    scene = rm.Scene((steeper() | cracked()).translate((far, 0.7, 0)), camera)
    for report in find_slopes(renderer, scene).reports:
        assert report.steepest is not None and off_ray(camera, report.steepest[1], report.steepest[0]) < 1e-3
    firsts = [report.first for report in find_faults(renderer, scene).reports if report.first is not None]
    assert firsts and all(off_ray(camera, first.pixel, first.position) < 1e-3 for first in firsts)


def test_only_nodes_that_are_too_steep_have_a_colour(renderer: rm.Renderer) -> None:
    """Also where another node of the pixel is nearly as steep."""
    above = [rm.Sun((0.01, 1, 0), shadow=True)]
    scene = rm.Scene(slightly().translate((1.2, 0, 0)) | rm.plane(offset=-1.1), CAMERA, above)
    found = find_slopes(renderer, scene)
    assert {found.reports[k].name for k in found.node[found.ratio > 1.001]} <= {"slightly", "translate", "union"}
    assert next(report for report in found.reports if report.name == "plane").slope == pytest.approx(1.0, abs=1e-3)


def test_what_is_sound_is_found_sound(renderer: rm.Renderer) -> None:
    """Cells that differ, copies, the plane, data, a fractal, textures of lights, glass and samples of a pixel."""
    data = rm.heightmap(np.hypot(*np.mgrid[-4:5, -4:5]) / 8, (2, 2))
    cells = rm.repeat_varied(lambda i: rm.sphere(0.1 + 0.2 * rm.hash(i)), 1.0, (3, 1, 3))
    parts = [cells, data, rm.star().extrude(0.3), rm.box(1).twist(0.5), rm.text("a").extrude(0.2)]
    solid = rm.union(*[part.translate((1.6 * k - 3, 0, 0)) for k, part in enumerate(parts)]).repeat((None, None, 4), 2)
    lamps = [rm.PointLight((k, 3, 0), shadow=True) for k in range(10)]
    scenes = [
        rm.Scene(solid | rm.plane(offset=-1).material(rm.Material(rm.checker((1, 1, 1), (0, 0, 0)))), CAMERA, lamps),
        rm.Scene(rm.sphere().material(rm.Material(transmission=1)) | rm.plane(offset=-1), CAMERA, sky=rm.GradientSky()),
        rm.Scene(rm.box(1).translate((1e6, 0, 0)), quality=rm.Quality(samples=4, temporal="accumulate")),
    ]
    for scene in scenes:
        found = probe_with(renderer, scene)
        assert found.sound, str(found)
        assert all(report.slope is not None for report in found.reports if report.name != "surface")
        assert str(found).startswith("node ") and len(str(found).splitlines()) == len(found.reports) + 1


@pytest.mark.parametrize("tracer", ["auto", "advance"])
def test_slopes_are_measured_where_the_picture_asks_how_far_rays_are_free(renderer: rm.Renderer, tracer: str) -> None:
    scene = rm.Scene(rm.union(rm.sphere(), rm.box(1.5), k=0.01), CAMERA, quality=rm.Quality(tracer=tracer))
    assert plan(scene).marching.tracer == "advance", "which evaluates no node's field"
    for report in find_slopes(renderer, scene).reports:
        assert 0.5 < report.slope <= 1.0, report.name


def test_the_probe_leaves_the_renderer_as_it_was(renderer: rm.Renderer) -> None:
    scene = rm.Scene(rm.sphere() | rm.box(1).translate((1, 0, 0)), CAMERA)
    before = renderer.render(scene).color
    probe_with(renderer, scene)
    assert np.array_equal(renderer.render(scene).color, before)
    usual = assemble(rm.plan.plan(scene)).text()
    assert not re.search(r"faults|seen\(|is_finite|note\(", usual)
    assert "field_faults" in assemble(plan_faults(scene).plan).text()
    assert "record_value(" in assemble(plan_slopes(scene).plan).text()


def test_pictures_and_numbers(renderer: rm.Renderer, tmp_path: Path) -> None:
    scene = rm.Scene(cracked().translate((-1.2, 0, 0)) | steeper().translate((1.2, 0, 0)), CAMERA)
    faults, slopes = find_faults(renderer, scene), find_slopes(renderer, scene)
    shown = np.asarray(fault_picture(faults))
    assert shown.shape[0] > SIZE[1] and shown.shape[1] == SIZE[0]
    body = shown[: SIZE[1]].astype(int)
    grey = np.ptp(body, axis=-1) == 0
    assert np.array_equal(grey, faults.node < 0)
    numbers = fault_numbers(faults)
    assert np.array_equal(numbers[..., 0] > 0, faults.node >= 0) and np.all(numbers[faults.node >= 0][:, 1] == 7)
    body = np.asarray(slope_picture(slopes))[: SIZE[1]].astype(int)
    red = (body[..., 0] > 100) & (body[..., 1] < 60) & (body[..., 2] < 60)
    assert np.array_equal(red, slopes.ratio > 1.001) and COLORS[0][0] > 200
    numbers = slope_numbers(slopes)
    assert np.allclose(numbers[..., 0], slopes.ratio) and numbers[..., 2].max() == pytest.approx(1.5, abs=1e-2)
    assert table(slopes.reports)[0].split() == ["node", "line", "faults", "slope", "at", "most"]
