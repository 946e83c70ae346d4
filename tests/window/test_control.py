"""Camera control: each movement does what the hand expects, for any view."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import raymarch as rm
from raymarch.scene.parameter import Values
from raymarch.window import control
from raymarch.window.control import View
from raymarch.window.pick import picked, verified

SIZE = (400, 300)


def view_at(position: Any, target: Any = (0, 0, 0), up: Any = (0, 1, 0), fov: float = 50.0) -> View:
    p, t = np.array(position, np.float64), np.array(target, np.float64)
    return View(p, t, np.array(up, np.float64), fov, float(np.linalg.norm(t - p)))


def pixel_of(view: View, point: Any) -> Any:
    """Where a point of space is in the picture, in pixels."""
    pose = view.pose()
    x, y, z = pose.frame.T @ (np.asarray(point, np.float64) - pose.position)
    height = SIZE[1]
    return np.array(
        [SIZE[0] / 2 + x / -z / pose.tan_half_fov * height / 2, height / 2 - y / -z / pose.tan_half_fov * height / 2]
    )


places = st.tuples(*[st.floats(-5, 5)] * 3).filter(lambda p: np.hypot(p[0], p[2]) > 0.5)
pixels = st.floats(-250, 250)


@given(places, pixels, pixels)
def test_an_orbit_keeps_the_target_its_distance_and_the_horizon(position: Any, dx: float, dy: float) -> None:
    before = view_at(position)
    after = control.orbit(before, dx, dy, SIZE[1])
    assert np.allclose(after.target, before.target)
    assert np.isclose(after.distance, before.distance)
    assert abs(after.right[1]) < 1e-9
    assert np.degrees(np.arccos(abs(after.forward[1]))) > 0.9


def test_an_orbit_follows_the_hand() -> None:
    before = view_at((0, 0, 5))
    near = np.array([0.0, 0.0, 1.0])  # the side of the scene that faces the camera
    right = pixel_of(control.orbit(before, 20, 0, SIZE[1]), near)
    down = pixel_of(control.orbit(before, 0, 20, SIZE[1]), near)
    middle = pixel_of(before, near)
    assert right[0] > middle[0] + 5 and abs(right[1] - middle[1]) < 1
    assert down[1] > middle[1] + 5 and abs(down[0] - middle[0]) < 1


@given(places, pixels, pixels)
def test_small_orbits_add_up(position: Any, dx: float, dy: float) -> None:
    once = control.orbit(view_at(position), dx, 0, SIZE[1])
    twice = control.orbit(control.orbit(view_at(position), dx / 2, 0, SIZE[1]), dx / 2, 0, SIZE[1])
    assert np.allclose(once.position, twice.position)


def test_an_orbit_stops_at_the_poles_and_comes_back() -> None:
    view = view_at((0, 1, 5))
    for _ in range(50):
        view = control.orbit(view, 3, 40, SIZE[1])
    assert 0.9 < np.degrees(np.arccos(view.forward @ (0, -1, 0))) < 1.1
    back = control.orbit(view, 0, -100, SIZE[1])
    assert back.position[1] < view.position[1]


@given(places, pixels, pixels)
def test_a_pan_keeps_the_point_under_the_cursor(position: Any, dx: float, dy: float) -> None:
    before = view_at(position)
    after = control.pan(before, dx, dy, SIZE[1])
    assert np.allclose(pixel_of(after, before.target) - pixel_of(before, before.target), (dx, dy), atol=1e-6)
    assert np.allclose(after.forward, before.forward)


@given(places, st.floats(-20, 20))
def test_a_dolly_moves_along_the_view_and_back(position: Any, steps: float) -> None:
    before = view_at(position)
    after = control.dolly(before, steps)
    assert np.isclose(after.distance, before.distance * 0.9**steps)
    assert np.allclose(after.forward, before.forward)
    assert np.allclose(control.dolly(after, -steps).position, before.position)


def test_a_dolly_never_reaches_its_target() -> None:
    view = control.dolly(view_at((0, 0, 5)), 1000)
    assert view.distance > 0 and np.all(np.isfinite(view.pose().frame))


def test_a_flight_moves_in_the_directions_of_the_picture() -> None:
    before = view_at((3, 2, 5))
    for speeds, place in (((1, 0, 0), None), ((0, 1, 0), (-1, 0)), ((0, 0, 1), (0, 1))):
        after = control.fly(before, *speeds, 0.1)
        assert np.isclose(np.linalg.norm(after.position - before.position), 0.1 * before.reach)
        assert np.allclose(after.target - after.position, before.target - before.position)
        if place is None:
            assert np.allclose(after.position - before.position, 0.1 * before.reach * before.forward)
        else:  # what was in the middle has moved the other way
            moved = pixel_of(after, before.target) - pixel_of(before, before.target)
            assert np.allclose(np.sign(np.round(moved, 6)), place)


@given(places, st.floats(-40, 40), st.floats(-40, 40))
def test_looking_about_leaves_the_camera_where_it_is(position: Any, dx: float, dy: float) -> None:
    before = view_at(position)
    after = control.turn(before, dx, dy, SIZE[1])
    assert np.array_equal(after.position, before.position)
    assert np.isclose(after.distance, before.distance)


def test_looking_about_follows_the_hand() -> None:
    before = view_at((0, 0, 5))
    moved = pixel_of(control.turn(before, 10, -6, SIZE[1]), before.target) - pixel_of(before, before.target)
    assert np.allclose(moved, (10, -6), rtol=0.15)


@given(places, st.tuples(*[st.floats(-3, 3)] * 3))
def test_focus_brings_a_point_to_the_middle_from_the_same_side(position: Any, point: Any) -> None:
    before = view_at(position)
    if np.linalg.norm(np.subtract(point, before.position)) < 0.1:
        return
    after = control.focus(before, np.array(point))
    assert np.allclose(pixel_of(after, point), (SIZE[0] / 2, SIZE[1] / 2))
    assert np.allclose(after.forward, before.forward)
    assert np.isclose(after.distance, np.linalg.norm(np.subtract(point, before.position)))


@given(places, st.floats(0, 400), st.floats(0, 300))
def test_rays_go_through_their_pixels(position: Any, x: float, y: float) -> None:
    view = view_at(position, (0.3, 0.1, -0.2))
    assert np.allclose(pixel_of(view, view.position + 2.5 * view.ray(x, y, SIZE)[1]), (x, y), atol=1e-7)


@given(places, st.floats(5, 120))
def test_a_copied_camera_is_the_same_camera(position: Any, fov: float) -> None:
    view = view_at(position, (0.123456789, 0, 1e-3), fov=fov)
    camera: rm.Camera = eval(control.as_python(view), {"rm": rm})
    given_back, mine = camera.pose(Values({}), None), view.pose()
    assert np.allclose(given_back.position, mine.position, atol=1e-5)
    assert np.allclose(given_back.frame, mine.frame, atol=1e-4)
    assert np.isclose(given_back.tan_half_fov, mine.tan_half_fov, rtol=1e-4)


def test_a_view_of_a_pose_is_that_pose() -> None:
    camera = rm.Camera((1, 2, 3), (0, 0.5, 0), up=(0.1, 1, 0), fov=33)
    pose = camera.pose(Values({}), None)
    view = control.view_of(pose, np.array([0, 0.5, 0]), np.array([0.1, 1, 0]))
    mine = view.pose()
    assert np.allclose(mine.frame, pose.frame) and np.isclose(mine.tan_half_fov, pose.tan_half_fov)
    assert np.allclose(view.target, (0, 0.5, 0))


@pytest.mark.parametrize("up", [(0, 0, 1), (1, 1, 0)])
def test_any_direction_may_be_up(up: Any) -> None:
    view = control.orbit(view_at((3, 4, 5), up=np.array(up) / np.linalg.norm(up)), 50, 20, SIZE[1])
    assert abs(view.right @ view.up) < 1e-9


def parallel_view(position: Any, height: float = 3.0) -> View:
    """An orthographic view with clip planes and a lens."""
    target = np.array([0.3, 0.1, -0.2])
    camera = rm.Camera(
        position, tuple(target), projection="orthographic", height=height, near=0.5, far=90, aperture=0.1, focus=3
    )
    return control.view_of(camera.pose(Values({}), None), target, np.array([0.0, 1.0, 0.0]))


def parallel_pixel_of(view: View, point: Any) -> Any:
    """Where an orthographic view shows a point, in pixels."""
    assert view.height is not None
    x, y, _ = view.pose().frame.T @ (np.asarray(point, np.float64) - view.position)
    return np.array([SIZE[0] / 2, SIZE[1] / 2]) + np.array([x, -y]) / view.height * SIZE[1]


@given(places, st.floats(0, 400), st.floats(0, 300))
def test_parallel_rays_go_through_their_pixels(position: Any, x: float, y: float) -> None:
    view = parallel_view(position)
    origin, direction = view.ray(x, y, SIZE)
    assert np.allclose(parallel_pixel_of(view, origin + 2.5 * direction), (x, y), atol=1e-7)


def test_an_orthographic_view_pans_with_the_hand_and_zooms_by_its_height() -> None:
    view = parallel_view((1.0, 2.0, 4.0))
    point = np.array([0.2, 0.3, 0.4])
    moved = control.pan(view, 30, -20, SIZE[1])
    assert np.allclose(parallel_pixel_of(moved, point) - parallel_pixel_of(view, point), (30, -20))
    nearer = control.dolly(view, 2)
    assert np.allclose(nearer.position, view.position) and np.isclose(nearer.height, 3.0 * 0.81)
    assert np.isclose(control.resized(view, 7.0).extent, 7.0)


def test_a_copied_orthographic_camera_is_the_same_camera() -> None:
    view = parallel_view((1.0, 2.0, 4.0))
    camera: rm.Camera = eval(control.as_python(view), {"rm": rm})
    given_back, mine = camera.pose(Values({}), None), view.pose()
    assert np.allclose(given_back.frame, mine.frame, atol=1e-4) and given_back.orthographic
    for name in ("half_height", "near", "far", "aperture", "focus"):
        assert np.isclose(getattr(given_back, name), getattr(mine, name))


@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
def test_a_click_between_clip_planes_finds_what_the_picture_shows(projection: str) -> None:
    """The reference of one pixel is that of the whole picture, also where the near plane cuts the ball open."""
    camera = rm.Camera((1, 2, 4), (0, 0, 0), projection=projection, near=4.2, far=9)
    scene, size, values = rm.Scene(rm.sphere(1.0), camera), (16, 12), Values({})
    view = control.view_of(scene.pose(values, 16 / 12), np.zeros(3), np.array([0.0, 1.0, 0.0]))
    known = rm.truth(scene, size)
    for column, row in ((8, 6), (5, 5), (0, 0)):
        origin, ray = view.ray(column + 0.5, row + 0.5, size)
        texels = {name: np.zeros((1, 1, 3)) for name in ("normal",)}
        texels |= {name: np.zeros((1, 1)) for name in ("depth", "material", "iterations", "evaluations")}
        found = verified(picked(1, (column, row), texels, origin, ray), scene, values, origin, ray, view.pose())
        assert found.true == pytest.approx(known.depth[row, column], rel=1e-9)
