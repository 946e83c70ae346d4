"""A plane through the field, against distances that are known."""

from __future__ import annotations

import numpy as np
import pytest

import raymarch as rm
from raymarch.errors import SceneError
from raymarch.gpu.context import Context
from raymarch.gpu.slices import SCALE, Slice, slice_picture, spacing
from raymarch.gpu.views import picture, scale_of
from raymarch.scene.parameter import set_values
from raymarch.truth.rays import camera_rays

CAMERA = rm.Camera(position=(0.3, 0.2, 5), target=(0.1, 0, 0), fov=50)


def rendered(context: Context, scene: rm.Scene, cut: Slice | None = None, size: tuple[int, int] = (64, 36)) -> rm.Frame:
    with rm.Renderer(size, context=context) as renderer:
        return renderer.render(scene, outputs=("slice" if cut is None else cut,))


def points_of(frame: rm.Frame, plane: Slice) -> np.ndarray:
    """Where the rays meet the plane, (H, W, 3)."""
    assert frame.pose is not None
    rays = camera_rays(frame.pose, *frame.size).directions.reshape(frame.size[1], frame.size[0], 3)
    t = (plane.offset - frame.pose.position @ plane.normal) / (rays @ np.array(plane.normal))
    return np.where(t[..., None] >= 0, frame.pose.position + t[..., None] * rays, np.nan)


@pytest.mark.parametrize("plane", [Slice((0, 0, 1), 0.25), Slice((0, 1, 0), -0.5), Slice((1, 2, 3), 1.0)])
def test_values_are_those_of_the_field(egl: Context, plane: Slice) -> None:
    node = rm.box((1, 1.5, 1)) - rm.sphere(0.8) | rm.torus(1.5, 0.2).rotate(1.0, "x")
    frame = rendered(egl, rm.Scene(node, CAMERA), plane)
    at = points_of(frame, plane)
    met = np.isfinite(at[..., 0])
    assert np.array_equal(np.isfinite(frame.slice[..., 0]), met) and met.mean() > 0.3
    size = np.abs(at[met]).max(axis=-1)
    assert np.all(np.abs(frame.slice[met][:, 0] - node.distance(at[met])) <= 1e-5 * (1 + size))
    slope = np.linalg.norm(node.gradient(at[met]), axis=-1)
    assert np.median(np.abs(frame.slice[met][:, 1] - slope)) < 1e-6
    assert np.mean(np.abs(frame.slice[met][:, 1] - slope) > 1e-3) < 0.01  # at a ridge rounding chooses the side


def test_a_field_that_is_no_distance_shows_in_its_slope(egl: Context) -> None:
    node = rm.sphere().scale((1, 0.5, 1))
    frame = rendered(egl, rm.Scene(node, CAMERA), Slice((0, 0, 1)))
    at = points_of(frame, Slice((0, 0, 1)))
    far = np.linalg.norm(at, axis=-1) > 1.2
    assert np.abs(frame.slice[far][:, 1] - np.linalg.norm(node.gradient(at[far]), axis=-1)).max() < 1e-4
    assert frame.slice[far][:, 1].min() < 0.6 and frame.slice[far][:, 1].max() <= 1 + 1e-5


def test_other_normals_and_schedules_do_not_matter(egl: Context) -> None:
    quality = rm.Quality(normals="central", schedule="cone", samples=4)
    scenes = [rm.Scene(rm.sphere(), CAMERA, quality=q) for q in (None, quality)]
    plain, other = (rendered(egl, scene).slice for scene in scenes)
    assert np.array_equal(plain, other, equal_nan=True)


def test_a_plane_behind_the_camera_is_not_met(egl: Context) -> None:
    frame = rendered(egl, rm.Scene(rm.sphere(), CAMERA), Slice((0, 0, 1), 6.0))
    assert np.isnan(frame.slice).all()
    assert not np.asarray(picture(frame, "slice", rm.Scene(rm.sphere()))).any()


def test_without_a_plane_it_faces_the_camera_through_the_middle(egl: Context) -> None:
    scene = rm.Scene(rm.sphere().translate((0, 0, 0.75)), CAMERA)
    pose = scene.pose(set_values({}, {}, 0.0))
    assert Slice.facing(scene, pose) == Slice((0, 0, 1), 0.75)
    assert np.array_equal(rendered(egl, scene).slice, rendered(egl, scene, Slice((0, 0, 1), 0.75)).slice)
    from_above = rm.Scene(rm.plane(), rm.Camera(position=(0.1, 9, 0.2), target=(0, 0, 0)))
    assert Slice.facing(from_above, from_above.pose(set_values({}, {}, 0.0))) == Slice((0, 1, 0), 0.0)


def test_planes() -> None:
    plane = Slice((0, -2, 0), 1.0)
    assert (plane.normal, plane.offset) == ((0.0, -1.0, 0.0), 0.5)
    assert Slice((3, 0, 4), 10.0) == Slice((0.6, 0.0, 0.8), 2.0)
    for normal, offset in (((0, 0, 0), 1.0), ((1, np.nan, 0), 1.0), ((1, 0, 0), np.inf), ((1, 0), 0.0)):
        with pytest.raises(SceneError, match=r"Slice: normal .* \(three numbers"):
            Slice(normal, offset)  # type: ignore[arg-type]


def ramp(per_pixel: float, start: float, width: int = 400) -> np.ndarray:
    return np.tile(start + per_pixel * np.arange(width), (8, 1))


def test_contour_lines_stand_at_multiples_of_the_spacing() -> None:
    distance = ramp(0.03, 0.61)
    step = spacing(distance)
    assert step == pytest.approx(0.5)  # the smallest nice number of at least 8 pixels
    row = slice_picture(distance, np.ones_like(distance))[4].sum(axis=-1)
    dark = np.flatnonzero(row < row.max() - 0.3)
    lines = (np.arange(1, 25) * step + 0.5 - 0.61) / 0.03
    assert np.abs(dark[:, None] - lines).min(axis=0).max() <= 1.0
    assert np.abs(dark[:, None] - lines).min(axis=1).max() <= 1.0


def test_the_surface_is_black_and_the_inside_darker() -> None:
    distance = ramp(0.01, -2.003)
    shown = slice_picture(distance, np.ones_like(distance))
    zero = 2.003 / 0.01
    assert shown[:, [int(zero), int(zero) + 1]].max() < 0.25
    assert shown[4, 108].sum() < 0.8 * shown[4, 292].sum()


def test_colour_is_the_slope_alone() -> None:
    distance = ramp(0.01, 1.023, 4)
    for slope in (0.0, 0.5, 1.0, 1.25, 3.0):
        shown = slice_picture(distance, np.full_like(distance, slope))
        assert np.allclose(shown, SCALE.colored(slope - 1.0))


def test_a_constant_distance_has_no_lines() -> None:
    distance = 1.0 + 1e-7 * np.random.default_rng(1).standard_normal((30, 40))
    distance[:, :8] = 1.0 + 0.05 * np.arange(8, 0, -1)
    shown = slice_picture(distance, np.ones_like(distance))
    assert np.allclose(shown[:, 10:], SCALE.colored(0.0))


def test_lines_vanish_before_they_touch() -> None:
    distance = np.concatenate([ramp(0.02, 1.0, 500), ramp(1.7, 11.0, 40)], axis=1)
    shown = slice_picture(distance, np.ones_like(distance))
    assert np.allclose(shown[:, 505:], SCALE.colored(0.0))
    assert shown[:, :500].min() < 0.6


def test_one_pixel_and_a_flat_field() -> None:
    assert spacing(np.array([[0.5]])) == 1.0
    assert spacing(np.full((3, 3), np.nan)) == 1.0
    assert slice_picture(np.array([[0.3]]), np.array([[1.0]])).shape == (1, 1, 3)


def test_the_bar_says_how_far_lines_are_apart(egl: Context) -> None:
    scale = scale_of(rendered(egl, rm.Scene(rm.sphere(), CAMERA)), "slice")
    assert scale is not None
    # a pixel is 0.13 wide there, so that 8 are a little more than 1
    assert scale.quantity == "|gradient| - 1; a line every 2"


def test_a_scene_far_away_is_sliced_as_at_home(egl: Context) -> None:
    away = np.array([4096.0, 0, -8192])
    plane = Slice((1, 1, 2), 0.5)
    node = rm.box((1, 1.5, 1)) | rm.torus(1.5, 0.2)
    moved = rm.Camera(
        position=(away + np.array([0.3, 0.2, 5])).tolist(), target=(away + np.array([0.1, 0, 0])).tolist(), fov=50
    )
    home = rendered(egl, rm.Scene(node, CAMERA), plane)
    far = rendered(
        egl, rm.Scene(node.translate(away.tolist()), moved), Slice(plane.normal, plane.offset + away @ plane.normal)
    )
    assert np.nanmax(np.abs(home.slice - far.slice)[..., 0]) < 1e-4
    facing = rendered(egl, rm.Scene(node.translate(away.tolist()), moved))
    assert np.nanmax(np.abs(facing.slice - rendered(egl, rm.Scene(node, CAMERA)).slice)[..., 0]) < 1e-4
