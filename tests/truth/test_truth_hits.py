"""Hits, depths and normals against closed forms."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from raymarch.errors import SceneError
from raymarch.expr.node import Expr
from raymarch.expr.vocabulary import floor, length
from raymarch.scene import Camera, Material, Param, Scene, Sun, time
from raymarch.sdf import Node, box, plane, shape, sphere, torus, union
from raymarch.sdf.definition import EVERYWHERE, cube
from raymarch.truth import Truth, truth
from raymarch.truth.march import GAP, PATIENCE

GEOMETRY = ("depth", "normal")


def looking(node: Node, position: Any, target: Any, up: Any = (0, 1, 0), fov: float = 40.0) -> Scene:
    return Scene(node, camera=Camera(position, target, up, fov))


def one_ray(node: Node, position: Any, direction: Any) -> Truth:
    """The ray through the only pixel: exactly along the view."""
    position, direction = np.asarray(position, np.float64), np.asarray(direction, np.float64)
    up = (0.3, 1.0, -0.2) if abs(direction[1]) < 0.9 * np.linalg.norm(direction) else (1.0, 0.0, 0.0)
    return truth(looking(node, position, position + direction, up, 10.0), (1, 1), outputs=GEOMETRY)


def ball(origin: Any, direction: Any, centre: Any, radius: float) -> tuple[Any, Any]:
    """Where unit rays enter and leave a ball, nan where they miss."""
    between = np.asarray(origin) - centre
    b = direction @ between
    with np.errstate(invalid="ignore"):
        root = np.sqrt(b * b - between @ between + radius * radius)
    return -b - root, -b + root


def test_sphere() -> None:
    made = truth(looking(sphere(1.3).translate((0.2, -0.1, 0.3)), (2, 1, 4), (0, 0.3, 0)), (61, 37), outputs=GEOMETRY)
    enter, _ = ball(made.position, made.direction, (0.2, -0.1, 0.3), 1.3)
    assert np.array_equal(made.hit, np.isfinite(enter))
    assert 0.1 < made.hit.mean() < 0.9
    np.testing.assert_allclose(made.depth[made.hit], enter[made.hit], rtol=1e-12)
    points = made.position + made.depth[made.hit][:, None] * made.direction[made.hit]
    np.testing.assert_allclose(made.normal[made.hit], (points - (0.2, -0.1, 0.3)) / 1.3, atol=1e-12)
    assert np.all(made.residual <= 1e-14)
    assert np.all(made.depth[~made.hit] == np.inf) and not made.normal[~made.hit].any()


def test_box_seen_off_axis() -> None:
    size = np.array([1.0, 2.0, 0.5])
    scene = looking(box(size.tolist()), (1.7, 2.9, 2.2), (0.3, 0.1, -0.2), up=(0.4, 1, 0.1))
    made = truth(scene, (53, 41), outputs=GEOMETRY)
    near, far = (-0.5 * size - made.position) / made.direction, (0.5 * size - made.position) / made.direction
    enter, leave = np.minimum(near, far), np.maximum(near, far).min(axis=-1)
    hit = enter.max(axis=-1) < leave
    assert np.array_equal(made.hit, hit)
    assert 0.05 < hit.mean() < 0.9
    np.testing.assert_allclose(made.depth[hit], enter.max(axis=-1)[hit], rtol=1e-13)
    axis = np.argmax(enter, axis=-1)[..., None]
    normal = np.where(np.arange(3) == axis, -np.sign(made.direction), 0.0)
    np.testing.assert_allclose(made.normal[hit], normal[hit], atol=1e-14)


def torus_roots(origin: Any, direction: Any, major: float, minor: float) -> Any:
    """Real roots in t of (|p|^2 + R^2 - r^2)^2 = 4 R^2 (x^2 + z^2), a polynomial of degree four."""
    square = np.array([1.0, 2 * origin @ direction, origin @ origin + major**2 - minor**2])
    flat_o, flat_d = origin[[0, 2]], direction[[0, 2]]
    ring = 4 * major**2 * np.array([flat_d @ flat_d, 2 * flat_o @ flat_d, flat_o @ flat_o])
    roots = np.roots(np.polysub(np.polymul(square, square), ring))
    return np.sort(roots[np.abs(roots.imag) < 1e-7].real)


def test_torus() -> None:
    made = truth(looking(torus(1.0, 0.3), (0.8, 1.1, 3.1), (0.1, 0, 0)), (31, 21), outputs=GEOMETRY)
    wanted = np.full(made.depth.shape, np.inf)
    for index in np.ndindex(made.depth.shape):
        roots = torus_roots(made.position, made.direction[index], 1.0, 0.3)
        wanted[index] = roots[0] if roots.size else np.inf
    assert np.array_equal(made.hit, np.isfinite(wanted))
    assert 0.1 < made.hit.mean() < 0.9
    wrong = np.abs(made.depth[made.hit] - wanted[made.hit])
    assert np.median(wrong) < 1e-14 * 16
    assert np.max(wrong) < 1e-9  # a root of a quartic that is nearly double is known to half the digits only


DEGREES = (60.0, 10.0, 1.0, 0.3, 0.1)
TILT = np.array([0.6, 1.0, -0.3]) / np.linalg.norm([0.6, 1.0, -0.3])


@pytest.mark.parametrize("degrees", DEGREES)
@pytest.mark.parametrize("kind", ["plane", "marched"])
def test_plane_at_grazing_angles(kind: str, degrees: float) -> None:
    """In closed form, and as a part of a blend, where it must be marched."""
    node = plane(normal=TILT.tolist(), offset=0.2)
    if kind == "marched":
        node = union(node, sphere(0.1).translate((0, 40, 0)), k=0.01)
    along = np.cross(TILT, (0.1, 0.2, 1.0))
    angle = np.radians(degrees)
    direction = np.cos(angle) * along / np.linalg.norm(along) - np.sin(angle) * TILT
    made = one_ray(node, 1.2 * TILT, direction)
    sine = -(made.direction[0, 0] @ TILT)
    assert abs(made.depth[0, 0] * sine - 1.0) < 1e-11
    np.testing.assert_allclose(made.normal[0, 0], TILT, atol=1e-12)
    assert made.gap[0, 0] <= 1.001 * GAP * made.depth[0, 0]
    least = np.log(1 / GAP) / np.log((1 + sine) / (1 - sine))
    assert made.evaluations[0, 0] <= (1.05 * least + 20 if kind == "marched" else 0)


@pytest.mark.parametrize("gap", [1e-2, 1e-5, 1e-7])
def test_tangent_rays(gap: float) -> None:
    """A ray that passes a ball at a distance of `gap` misses; one as far inside hits, on a chord of known length."""
    direction = np.array([1.0, -0.3, -2.0]) / np.linalg.norm([1.0, -0.3, -2.0])
    across = np.cross(direction, (0.2, 1.0, 0.3))
    across /= np.linalg.norm(across)
    missed = one_ray(sphere(1.0), (1 + gap) * across - 5 * direction, direction)
    assert not missed.hit[0, 0] and missed.gap[0, 0] < 1e-2
    met = one_ray(sphere(1.0), (1 - gap) * across - 5 * direction, direction)
    half_chord = np.sqrt(2 * gap - gap * gap)
    assert abs(met.depth[0, 0] - (5 - half_chord)) < 1e-15 * 20 / half_chord


def test_what_is_thin_is_not_stepped_over() -> None:
    scene = looking(sphere(1.0).shell(1e-6) | box((8, 1e-5, 8)).translate((0, -1.2, 0)), (0.5, 0.7, 5), (0, 0, 0))
    made = truth(scene, (48, 32), outputs=GEOMETRY)
    enter, _ = ball(made.position, made.direction, (0, 0, 0), 1 + 0.5e-6)
    through = np.isfinite(enter)
    np.testing.assert_allclose(made.depth[through], enter[through], rtol=1e-12)
    floor = (-1.2 + 0.5e-5 - made.position[1]) / made.direction[..., 1]
    on_floor = ~through & (np.abs(made.position + floor[..., None] * made.direction)[..., [0, 2]] < 4.0).all(axis=-1)
    on_floor &= floor > 0
    assert on_floor.any()
    np.testing.assert_allclose(made.depth[on_floor], floor[on_floor], rtol=1e-12)


def test_camera_inside_a_sphere_sees_its_wall() -> None:
    made = truth(looking(sphere(2.0), (0.5, -0.3, 0.9), (0, 1, -2), fov=100.0), (32, 24), outputs=GEOMETRY)
    _, leave = ball(made.position, made.direction, (0, 0, 0), 2.0)
    assert made.hit.all()
    np.testing.assert_allclose(made.depth, leave, rtol=1e-13)
    points = made.position + made.depth[..., None] * made.direction
    np.testing.assert_allclose(made.normal, points / 2.0, atol=1e-13)  # outward, away from the viewer


def test_camera_below_a_floor_sees_it_from_beneath() -> None:
    made = truth(looking(plane() | sphere(0.5), (0, -2, 3), (0, 0, 0)), (16, 12), outputs=GEOMETRY)
    up = made.direction[..., 1] > 0
    wanted = 2.0 / made.direction[up][:, 1]
    flat = np.abs(made.position + wanted[:, None] * made.direction[up])[:, [0, 2]]
    away = np.linalg.norm(flat, axis=1) > 0.5  # the half ball above the floor belongs to the same solid
    np.testing.assert_allclose(made.depth[up][away], wanted[away], rtol=1e-12)


def test_repetition_equals_the_union_of_its_copies() -> None:
    child = (box((0.6, 0.4, 0.3)) | sphere(0.25).translate((0.2, 0.2, 0.0))).material(Material((0.2, 0.4, 0.6)))
    spacing, count = (1.1, 0.9, 1.3), (3, 2, 2)
    copies = [
        child.translate([s * (i - (n - 1) / 2) for i, s, n in zip(cell, spacing, count, strict=True)])
        for cell in np.ndindex(count)
    ]
    view = ((2.6, 2.1, 3.4), (0.1, 0, 0))
    one = truth(looking(child.repeat(spacing, count), *view), (64, 40))
    many = truth(looking(union(*copies), *view), (64, 40))
    assert np.array_equal(one.hit, many.hit) and 0.1 < one.hit.mean() < 0.9
    np.testing.assert_allclose(one.depth[one.hit], many.depth[one.hit], rtol=1e-12)
    np.testing.assert_allclose(one.normal, many.normal, atol=1e-9)
    np.testing.assert_allclose(one.color, many.color, atol=1e-9)
    assert np.array_equal(one.material, many.material)


def test_far_from_the_origin_nothing_changes() -> None:
    node = sphere(0.7) | box((1, 0.3, 2))
    place = np.array([3e6, -2e6, 5e6])
    here = truth(looking(node, (1.5, 2, 2.5), (0, 0, 0)), (40, 30), outputs=GEOMETRY)
    there = truth(looking(node.translate(place), place + np.array([1.5, 2, 2.5]), place), (40, 30), outputs=GEOMETRY)
    assert np.mean(here.hit != there.hit) < 0.002
    both = here.hit & there.hit
    assert np.median(np.abs(here.depth[both] - there.depth[both])) < 1e-8


@pytest.mark.parametrize("unit", [1e-6, 1e6])
def test_units_do_not_matter(unit: float) -> None:
    small = truth(looking(sphere(0.7) | box((1, 0.3, 2)), (1.5, 2, 2.5), (0, 0, 0)), (40, 30), outputs=GEOMETRY)
    node = sphere(0.7 * unit) | box((unit, 0.3 * unit, 2 * unit))
    large = truth(looking(node, np.multiply(unit, (1.5, 2, 2.5)), (0, 0, 0)), (40, 30), outputs=GEOMETRY)
    assert np.array_equal(small.hit, large.hit)
    np.testing.assert_allclose(large.depth[small.hit], unit * small.depth[small.hit], rtol=1e-12)


def test_a_picture_of_ordinary_size_takes_few_evaluations() -> None:
    """A floor to the horizon among other solids: its grazing rays would take thousands of plain steps each."""
    node = plane() | box(1).translate((-1.5, 0.5, 0)) | sphere(0.6).translate((0, 0.6, 0)) | torus(0.6, 0.2)
    made = truth(looking(node, (2, 1.5, 5), (0, 0.4, 0)), (320, 180), outputs=("depth",))
    assert made.evaluations.mean() < 8 and made.evaluations.max() < PATIENCE / 10
    floor = made.direction[..., 1] < 0
    assert made.hit[floor & (-1.5 / np.where(floor, made.direction[..., 1], -1) < 1e4)].all()


@shape(exactness="estimate", bounds=lambda radius: cube(radius))
def guessed_ball(p: Expr, radius: float = 1.0) -> Expr:
    """A ball whose distance is half as large again as it should be."""
    return 1.5 * (length(p) - radius)


def test_an_estimate_is_traced_and_says_that_nothing_is_proved() -> None:
    made = truth(looking(guessed_ball(1.0), (0, 0, 4), (0, 0, 0)), (21, 21), outputs=GEOMETRY)
    enter, _ = ball(made.position, made.direction, (0, 0, 0), 1.0)
    assert np.array_equal(made.hit, np.isfinite(enter))
    np.testing.assert_allclose(made.depth[made.hit], enter[made.hit], rtol=1e-12)
    assert np.all(made.gap == np.inf)


@shape(exactness="estimate", bounds=lambda: EVERYWHERE)
def terraces(p: Expr) -> Expr:
    """Steps of height 0.25 and width 1: not a plane, although its gradient is the same everywhere."""
    return 0.9 * (p.y - 0.25 * floor(p.x))


def test_steps_are_not_taken_for_a_plane() -> None:
    made = one_ray(terraces() | sphere(0.1).translate((0, 9, 0)), (0.3, 4, 0), (2.2, -3.5, 0))
    assert abs(made.depth[0, 0] - np.hypot(2.2, 3.5)) < 1e-12


@shape(exactness="estimate", bounds=lambda: cube(1.0))
def undefined(p: Expr) -> Expr:
    """inf - inf."""
    nothing = floor(1e-9 * abs(p.x))
    return length(p) / nothing - 2.0 * length(p) / nothing


def test_a_field_that_is_nan_is_an_error() -> None:
    with pytest.raises(SceneError, match="NaN"):
        truth(looking(undefined(), (0, 0, 4), (0, 0, 0)), (4, 4))


@pytest.mark.parametrize("size", [(0, 4), (4,), (4.5, 3), "4x4", (True, 2), None])
def test_a_wrong_size_is_an_error(size: Any) -> None:
    with pytest.raises(SceneError, match="size"):
        truth(Scene(sphere()), size)


def test_a_wrong_output_or_parameter_is_an_error() -> None:
    with pytest.raises(SceneError, match="'colour'"):
        truth(Scene(sphere()), (2, 2), outputs=("colour",))
    with pytest.raises(SceneError, match="'radius'"):
        truth(Scene(sphere()), (2, 2), params={"radius": 1.0})


def test_parameters_and_time() -> None:
    node = sphere(Param("radius", 1.0, 0.5, 2.0)) | plane(offset=Param("level", -9.0, -10.0, 0.0))
    scene = Scene(node, camera=Camera((0, 0, 5 + time), (0, 0, 0)), lights=[Sun(intensity=time)])
    depth = [truth(scene, (1, 1), t, params).depth[0, 0] for t, params in ((0.0, None), (2.0, {"radius": 1.5}))]
    np.testing.assert_allclose(depth, [4.0, 5.5], rtol=1e-14)


def test_nothing_to_see() -> None:
    nowhere = sphere(1.0) & sphere(1.0).translate((5, 0, 0))
    made = truth(Scene(nowhere, camera=Camera((0, 0, 5), (0, 0, 0)), sky=(0.1, 0.2, 0.3)), (3, 2))
    assert not made.hit.any() and np.all(made.material == -1) and np.all(made.color == (0.1, 0.2, 0.3))


def test_shapes_and_types() -> None:
    made = truth(Scene(sphere()), (7, 4))
    assert made.depth.shape == made.hit.shape == made.material.shape == made.evaluations.shape == (4, 7)
    assert made.normal.shape == made.color.shape == made.direction.shape == (4, 7, 3)
    assert made.depth.dtype == made.color.dtype == made.normal.dtype == np.float64
    assert made.hit.dtype == bool and np.issubdtype(made.material.dtype, np.integer)
    np.testing.assert_allclose(np.linalg.norm(made.direction, axis=-1), 1.0, rtol=1e-15)
