"""Cameras: what is refused, where they stand, which way they look."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.errors import SceneError
from raymarch.scene.parameter import Values, set_values
from tests.support.refusals import refused

NAN, INF = math.nan, math.inf
EPS = float(np.finfo(np.float64).eps)

BAD = [
    (lambda: rm.Camera(fov=0), "Camera: fov = 0 ", "between 0 and 180"),
    (lambda: rm.Camera(fov=180), "Camera: fov = 180 ", "between 0 and 180"),
    (lambda: rm.Camera(fov=-30.0), "Camera: fov = -30 ", "between 0 and 180"),
    (lambda: rm.Camera(fov=400), "Camera: fov = 400 ", "between 0 and 180"),
    (lambda: rm.Camera(fov=NAN), "Camera: fov = nan", "a finite number"),
    (lambda: rm.Camera(fov=INF), "Camera: fov = inf", "a finite number"),
    (lambda: rm.Camera(fov="wide"), "Camera: fov = 'wide'", "a finite number"),
    (lambda: rm.Camera(fov=(40, 50, 60)), "Camera: fov = (40, 50, 60)", "a finite number"),
    (lambda: rm.Camera(fov=True), "Camera: fov = True", "a finite number"),
    (lambda: rm.Camera(fov=None), "Camera: fov = None", "a finite number"),
    (lambda: rm.Camera(fov=40 + 1j), "Camera: fov = (40+1j)", "a finite number"),
    (lambda: rm.Camera(projection="parallel"), "Camera: projection = 'parallel'", "'perspective', 'orthographic'"),
    (lambda: rm.Camera(height=3), "Camera: height = 3 with projection='perspective'", "projection='orthographic'"),
    (lambda: rm.Camera(projection="orthographic", height=0), "Camera: height = 0", "> 0"),
    (lambda: rm.Camera(projection="orthographic", height=NAN), "Camera: height = nan", "a finite number"),
    (lambda: rm.Camera(near=-1), "Camera: near = -1", ">= 0"),
    (lambda: rm.Camera(near=2, far=2), "Camera: far = 2 with near = 2", "near < far"),
    (lambda: rm.Camera(far="away"), "Camera: far = 'away'", "a finite number"),
    (lambda: rm.Camera(aperture=-0.1), "Camera: aperture = -0.1", ">= 0"),
    (lambda: rm.Camera(aperture=0.1, focus=0), "Camera: focus = 0", "> 0"),
    (lambda: rm.Camera(shutter=-1), "Camera: shutter = -1", ">= 0"),
    (lambda: rm.Camera(focus=(1, 2, 3)), "Camera: focus = (1, 2, 3)", "a finite number"),
    (lambda: rm.Camera(position=(0, 5)), "Camera: position = (0, 5)", "3 finite numbers"),
    (lambda: rm.Camera(position=(0, 0, 0, 5)), "Camera: position = (0, 0, 0, 5)", "3 finite numbers"),
    (lambda: rm.Camera(position=5), "Camera: position = 5", "3 finite numbers"),
    (lambda: rm.Camera(position="above"), "Camera: position = 'above'", "3 finite numbers"),
    (lambda: rm.Camera(position=(0, "0", None)), "Camera: position = (0, '0', None)", "3 finite numbers"),
    (lambda: rm.Camera(position=(0, 0, NAN)), "Camera: position = (0, 0, nan)", "3 finite numbers"),
    (lambda: rm.Camera(position=(0, 0, 1e39)), "Camera: position = (0, 0, 1e+39)", "3 finite numbers"),
    (lambda: rm.Camera(target=(0, -INF, 0)), "Camera: target = (0, -inf, 0)", "3 finite numbers"),
    (lambda: rm.Camera(target={}), "Camera: target = {}", "3 finite numbers"),
    (lambda: rm.Camera(up=(0, NAN, 0)), "Camera: up = (0, nan, 0)", "3 finite numbers"),
    (lambda: rm.Camera((1, 2, 3), (1, 2, 3)), "position = target = [1.0, 2.0, 3.0]", "two different points"),
    (
        lambda: rm.Camera((0, 0, 5), (0, 0, 0), (0, 0, 1)),
        "up = [0.0, 0.0, 1.0] is parallel",
        "not parallel to the view",
    ),
    (
        lambda: rm.Camera((0, 0, 5), (0, 0, 0), (0, 0, -7)),
        "up = [0.0, 0.0, -7.0] is parallel",
        "not parallel to the view",
    ),
    (
        lambda: rm.Camera((0, 0, 5), (0, 0, 0), (0, 0, 0)),
        "up = [0.0, 0.0, 0.0] is parallel",
        "not parallel to the view",
    ),
    (lambda: rm.Camera((0, 0, 5), view_from=(1, 0, 0)), "view_from = (1, 0, 0) with a position", "or a position"),
    (lambda: rm.Camera(view_from=(0, 0, 0)), "view_from = (0, 0, 0)", "any length but 0"),
    (lambda: rm.Camera((0, 0, 5), (0, 0, 0), (0, 1e-12, 1)), "up = [0.0, 1e-12, 1.0]", "not parallel to the view"),
    (
        lambda: rm.Camera((9, 9, 9), (0, 0, 0), (1, 1, 1)),
        "up = [1.0, 1.0, 1.0] is parallel",
        "not parallel to the view",
    ),
]


@pytest.mark.parametrize(("make", "what", "legal"), BAD, ids=[what for _, what, _ in BAD])
def test_a_bad_camera_is_refused_where_it_is_made(make: Any, what: str, legal: str) -> None:
    refused(make, what, legal)


@pytest.mark.parametrize("fov", [1e-3, 1, 179, 179.999])
def test_any_angle_between_is_legal(fov: float) -> None:
    pose = rm.Scene(rm.sphere(), camera=rm.Camera(fov=fov)).pose(Values({}))
    assert pose.tan_half_fov == pytest.approx(math.tan(math.radians(fov) / 2), rel=4 * EPS)


def test_what_only_a_scene_shows_is_refused_at_the_cameras_line() -> None:
    ball = rm.sphere().translate((1, 2, 3))
    at_its_middle = rm.Camera(position=(1, 2, 3))
    with pytest.raises(SceneError, match=r"position = target = \[1.0, 2.0, 3.0\]") as caught:
        rm.Scene(ball, camera=at_its_middle).pose(Values({}))
    assert caught.value.where == at_its_middle.where
    above = rm.Camera(position=(1, 9, 3))
    with pytest.raises(SceneError, match=r"up = .* is parallel to the view") as caught:
        rm.Scene(ball, camera=above).pose(Values({}))
    assert caught.value.where == above.where


def test_a_camera_that_a_parameter_makes_degenerate_is_refused_when_it_does() -> None:
    fov, x = rm.Param("fov", 45, 0, 200), rm.Param("x", 5.0, -5, 5)
    camera = rm.Camera(position=(x, 0, 0), target=(0, 0, 0), fov=fov)
    scene = rm.Scene(rm.sphere(), camera=camera)

    def pose(**params: float) -> Any:
        return scene.pose(set_values(scene.parameters, params))

    assert pose().position.tolist() == [5, 0, 0]
    for params, words in (({"fov": 180.0}, "fov = 180"), ({"fov": 0.0}, "fov = 0"), ({"x": 0.0}, "position = target")):
        with pytest.raises(SceneError, match=words) as caught:
            pose(**params)
        assert caught.value.where == camera.where


# Where an unplaced camera stands.

SOLIDS = [
    rm.box((1, 1, 1)),
    rm.box((9, 1, 0.2)),
    rm.box((0.01, 30, 0.01)),
    rm.sphere(0.3).translate((100, -20, 7)),
    rm.box((2, 3, 4)).translate((-5, 0, 8)) | rm.plane(offset=-4),
    rm.box((2, 1, 2)) - rm.plane(),
    rm.union(rm.sphere(), rm.sphere().translate((3, 0, 0)), k=0.5),
]


@pytest.mark.parametrize("fov", [5, 45, 90, 150])
@pytest.mark.parametrize("size", [(640, 360), (100, 100), (90, 160), (16, 256)])
@pytest.mark.parametrize("solid", SOLIDS, ids=range(len(SOLIDS)))
def test_an_unplaced_camera_shows_the_solid_and_little_else(solid: Any, size: tuple[int, int], fov: float) -> None:
    aspect = size[0] / size[1]
    scene = rm.Scene(solid, camera=rm.Camera(fov=fov))
    pose = scene.pose(Values({}), aspect)
    subject = scene.subject
    assert subject is not None
    box = np.stack([subject.lower, subject.upper])
    inner = np.random.default_rng(1).uniform(*box, (20_000, 3))
    ends = np.array(list(itertools.product(*box.T)))
    points = np.concatenate([inner, ends])
    x, y, z = ((points[solid.distance(points) <= 1e-9] - pose.position) @ pose.frame).T
    assert np.all(z < 0), "a point lies behind the camera"
    across, up = x / -z / (pose.tan_half_fov * aspect), y / -z / pose.tan_half_fov
    largest = max(np.abs(across).max(), np.abs(up).max())
    assert largest <= 1, "a point lies outside the picture"
    assert fov > 45 or largest >= 0.7, "it stands too far away"


FILLED = {
    "ball": (rm.sphere(), 0.75),
    "turning": (rm.box((1, 1, 1)).rotate(rm.time, "x").rotate(0.7 * rm.time, "y").rotate(0.3 * rm.time, "z"), 0.6),
    "polyhedron of planes": (rm.intersection(*[rm.plane(s * e, 100) for e in np.eye(3) for s in (-1, 1)]), None),
    "large": (rm.torus(1e4, 2e3).translate((1e5, 0, 0)), 0.3),
    "sampled at the ends of a Param": (rm.sphere(rm.Param("filling", 1, 0.5, 2)), 0.35),
}


@pytest.mark.parametrize("name", FILLED)
def test_a_solid_fills_the_picture(name: str) -> None:
    """The height that random points of its inside take."""
    solid, least = FILLED[name]
    pose = rm.Scene(solid).pose(Values({}), 16 / 9)
    points = np.random.default_rng(2).uniform(-1.0, 1.0, (20_000, 3))
    if solid.facts.bounded:
        low, high = solid.bounds
        points = (low + high) / 2 + points * (high - low) / 2
    _, y, z = ((points[solid.distance(points) <= 0] - pose.position) @ pose.frame).T
    if least is not None:
        assert np.ptp(y / -z) / (2 * pose.tan_half_fov) >= least


@pytest.mark.parametrize("solid", [rm.gyroid(), rm.gyroid(30.0, 1.0), rm.sphere(0.3).repeat(1)])
def test_an_endless_solid_is_seen_from_outside_of_it(solid: Any) -> None:
    scene = rm.Scene(solid)
    pose = scene.pose(Values({}))
    found = rm.raycast(scene, pose.position[None], pose.view[None])
    assert solid.distance(pose.position) > 0.02 and np.all((found.distance > 0.02) & (found.distance < 50))


@pytest.mark.parametrize("aspect", [16 / 9, 1.0, 0.5])
@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
def test_a_direction_turns_a_camera_that_sees_everything(projection: str, aspect: float) -> None:
    """At any proportions of the picture; an end of a long solid touches the margin."""
    around = rm.vec3(rm.sin(rm.time), 0.5, rm.cos(rm.time))
    scene = rm.Scene(rm.box((6, 2, 0.5)) | rm.plane(offset=-1), rm.Camera(projection=projection, view_from=around))
    corners = np.array(list(itertools.product((-3, 3), (-1, 1), (-0.25, 0.25))))
    for time in (0.0, 1.0, 4.0):
        pose = scene.pose(set_values(scene.parameters, {}, time=time), aspect)
        assert np.allclose(np.cross(pose.frame[:, 2], (math.sin(time), 0.5, math.cos(time))), 0, atol=1e-12)
        x, y, z = ((corners - pose.position) @ pose.frame).T
        half = -z * pose.tan_half_fov if pose.half_height is None else pose.half_height
        assert 0.85 <= max((np.abs(x) / half / aspect).max(), (np.abs(y) / half).max()) <= 1.0


@pytest.mark.parametrize("target", [(0, 0, 0), (3, 0, 0), (0, -2, 5)])
def test_an_unplaced_camera_with_a_target_still_sees_everything(target: tuple[float, ...]) -> None:
    scene = rm.Scene(rm.box((1, 2, 1)), camera=rm.Camera(target=target))
    pose = scene.pose(Values({}))
    corners = np.array(list(itertools.product((-0.5, 0.5), (-1, 1), (-0.5, 0.5))))
    x, y, z = ((corners - pose.position) @ pose.frame).T
    assert np.all(z < 0) and np.all(np.abs(x) <= -z * pose.tan_half_fov) and np.all(np.abs(y) <= -z * pose.tan_half_fov)
    ahead = np.array(target) - pose.position
    assert np.allclose(ahead / np.linalg.norm(ahead), -pose.frame[:, 2], atol=4 * EPS)


@pytest.mark.parametrize(
    "solid", [rm.plane(), rm.sphere() & rm.sphere().translate((5, 0, 0)), rm.sphere(0.5).repeat(2)]
)
def test_a_scene_without_a_box_has_a_camera_too(solid: Any) -> None:
    pose = rm.Scene(solid).pose(Values({}))
    assert np.all(np.isfinite(pose.position)) and np.linalg.norm(pose.position) > 0


# Which way it looks.


def test_the_plain_frame_is_the_identity() -> None:
    pose = rm.Scene(rm.sphere(), camera=rm.Camera((0, 0, 5), (0, 0, 0))).pose(Values({}))
    assert np.array_equal(pose.frame, np.eye(3)) and pose.frame.dtype == np.float64
    assert np.array_equal(pose.position, [0, 0, 5])


PLACES = [((3, 2, 6), (0, 0, 0), (0, 1, 0)), ((-1, 4, -2), (7, 1, 3), (1, 5, 2)), ((0, 9, 1), (0, 0, 0), (0, 0, -1))]


@pytest.mark.parametrize(("position", "target", "up"), PLACES)
def test_the_frame_is_right_handed_and_looks_at_the_target(position: Any, target: Any, up: Any) -> None:
    pose = rm.Scene(rm.sphere(), camera=rm.Camera(position, target, up)).pose(Values({}))
    backward = np.subtract(position, target, dtype=np.float64)
    backward /= np.linalg.norm(backward)
    right = np.cross(np.asarray(up, np.float64), backward)
    right /= np.linalg.norm(right)
    expected = np.stack([right, np.cross(backward, right), backward], axis=1)
    # Each component is a sum of a few products of numbers up to 1 after two normalisations.
    assert np.abs(pose.frame - expected).max() <= 8 * EPS
    assert np.linalg.det(pose.frame) == pytest.approx(1, abs=8 * EPS)
    assert np.abs(pose.frame.T @ pose.frame - np.eye(3)).max() <= 8 * EPS


@pytest.mark.parametrize(("position", "target", "up"), PLACES)
def test_whole_numbers_are_numbers(position: Any, target: Any, up: Any) -> None:
    """pyrr keeps integer types, so that a rotation given in integers is rounded to 0."""
    inputs = [
        (position, target, up),
        (list(position), list(target), list(up)),
        tuple(np.array(v, np.int32) for v in (position, target, up)),
        tuple(np.array(v, np.float32) for v in (position, target, up)),
        tuple(tuple(float(x) for x in v) for v in (position, target, up)),
    ]
    poses = [rm.Scene(rm.sphere(), camera=rm.Camera(*given)).pose(Values({})) for given in inputs]
    for pose in poses[1:]:
        assert np.array_equal(pose.frame, poses[0].frame) and np.array_equal(pose.position, poses[0].position)


def test_the_frame_holds_far_away() -> None:
    """Moved with its target, a camera keeps its frame to the rounding of the difference of the two."""
    near = rm.Scene(rm.sphere(), camera=rm.Camera((3, 2, 6), (0, 0, 0))).pose(Values({})).frame
    offset = 2.0**23
    far = rm.Scene(rm.sphere(), camera=rm.Camera((3 + offset, 2, 6), (offset, 0, 0))).pose(Values({})).frame
    assert np.array_equal(near, far)  # 3 + 2^23 is exact in float64


def test_parameters_and_time_move_the_camera() -> None:
    distance, tilt = rm.Param("distance", 5.0, 1, 50), rm.Param("tilt", (0.0, 1.0, 0.0))
    camera = rm.Camera(position=(rm.time, 0, distance), target=(rm.time, 0, 0), up=tilt, fov=40 + 10 * rm.time)
    scene = rm.Scene(rm.sphere(), camera=camera)
    assert list(scene.parameters) == ["distance", "tilt"]
    still = scene.pose(set_values(scene.parameters, {}))
    moved = scene.pose(set_values(scene.parameters, {"distance": 8, "tilt": (1, 0, 0)}, time=2.0))
    assert still.position.tolist() == [0, 0, 5] and np.array_equal(still.frame, np.eye(3))
    assert moved.position.tolist() == [2, 0, 8] and moved.frame[:, 1].tolist() == [1, 0, 0]
    assert moved.tan_half_fov == pytest.approx(math.tan(math.radians(30)), rel=4 * EPS)


def test_a_pixel_is_the_pictures_height_over_its_rows() -> None:
    pose = rm.Scene(rm.sphere(), camera=rm.Camera(fov=90)).pose(Values({}))
    assert pose.pixel(100) == pytest.approx(2 * math.tan(math.pi / 4) / 100, rel=4 * EPS)


# How far it sees.


def test_rays_reach_the_farthest_corner_of_a_box() -> None:
    scene = rm.Scene(rm.box((2, 4, 6)).translate((10, 0, 0)), camera=rm.Camera((0, 1, 2), (10, 0, 0)))
    assert scene.far(scene.pose(Values({}))) == pytest.approx(math.dist((0, 1, 2), (11, -2, -3)), rel=4 * EPS)
    empty = rm.Scene(rm.sphere() & rm.sphere().translate((5, 0, 0)))
    assert empty.far(empty.pose(Values({}))) == 0


@pytest.mark.parametrize("height", [1e-3, 1.0, 1e5])
@pytest.mark.parametrize("solid", [rm.plane(), rm.plane() | rm.sphere(), rm.sphere().repeat(4)], ids=range(3))
def test_a_horizon_ends_below_a_quarter_of_a_pixel(solid: Any, height: float) -> None:
    scene = rm.Scene(solid, camera=rm.Camera((0, height, 0), (0, height, -1)))
    pose = scene.pose(Values({}))
    assert height / scene.far(pose) <= 0.25 * pose.pixel(1080)
