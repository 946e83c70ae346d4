"""Lens and shutter: the circle of confusion and a moving box against closed forms, and cones that hold the lens."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.errors import PlanError
from raymarch.gpu.renderer import Renderer
from raymarch.plan import plan
from raymarch.scene.parameter import Values
from raymarch.truth.rays import camera_rays, lens_rays
from raymarch.truth.tracer import trace

SIZE = (64, 48)
RADIUS = 0.08
POINTS: dict[str, Any] = {"perspective": {}, "orthographic": {"projection": "orthographic", "height": 4.0}}


@pytest.fixture
def small(renderer: Renderer) -> Renderer:
    renderer.resize(SIZE)
    return renderer


def spot(distance: float, factor: float = 1.0, samples: int = 256, **camera: Any) -> rm.Scene:
    """A small ball that emits, in the dark. All lengths are times a factor."""
    lengths = {name: factor * camera.pop(name) for name in ("height", "focus", "aperture") if name in camera}
    return rm.Scene(
        rm.sphere(RADIUS * factor).material(rm.Material(emission=(100.0,) * 3)),
        rm.Camera((0, 0, distance * factor), (0, 0, 0), **lengths, **camera),
        lights=[],
        sky=(0, 0, 0),
        quality=rm.Quality(samples=samples),
    )


def moments(color: Any) -> tuple[float, float]:
    """The sum of a picture, and the mean square of the distance from its centre, in pixels."""
    x, y = np.meshgrid(np.arange(SIZE[0]) + 0.5 - SIZE[0] / 2, np.arange(SIZE[1]) + 0.5 - SIZE[1] / 2)
    total = color.sum()
    return float(total), float((color * (x * x + y * y)).sum() / total)


@pytest.mark.parametrize("factor", [1.0, 1e3])
@pytest.mark.parametrize("projection", POINTS)
@pytest.mark.parametrize(("distance", "focus"), [(5.0, 2.5), (5.0, 10.0)])
def test_a_point_becomes_the_circle_of_confusion(
    small: Renderer, factor: float, projection: str, distance: float, focus: float
) -> None:
    """Its mean square radius is that of the circle, plus those of the ball and of the pixel."""
    aperture, camera = 0.4, POINTS[projection]
    if projection == "perspective":
        per_pixel = 2 * np.tan(np.radians(22.5)) / SIZE[1]
        circle, ball = aperture * abs(1 / focus - 1 / distance) / per_pixel, RADIUS / distance / per_pixel
    else:
        per_pixel = camera["height"] / SIZE[1]
        circle, ball = aperture * abs(distance - focus) / focus / per_pixel, RADIUS / per_pixel
    given = spot(distance, factor, aperture=aperture, focus=focus, **camera)
    total, spread = moments(small.render(given).color[..., 0])
    hits = 256 * np.pi * ball**2  # at random they vary by their square root
    assert total * 2.56 == pytest.approx(hits, abs=3 * np.sqrt(hits))
    assert np.sqrt(2 * (spread - ball**2 / 2 - 1 / 6)) == pytest.approx(circle, rel=0.05)
    if factor == 1.0:
        _, spread = moments(
            rm.truth(spot(distance, 1.0, 64, aperture=aperture, focus=focus, **camera), SIZE, outputs=("color",)).color[
                ..., 0
            ]
        )
        assert np.sqrt(2 * (spread - ball**2 / 2)) == pytest.approx(circle, rel=0.05)


@pytest.mark.parametrize("projection", POINTS)
def test_the_plane_in_focus_is_sharp(small: Renderer, projection: str) -> None:
    """A wall of emissive checks at the target, seen at an angle of 0: as through a pinhole."""
    checks = rm.Material(emission=rm.checker((1, 1, 1), (0, 0, 0), 0.5))
    sharp = rm.Scene(rm.plane((0, 0, 1)).material(checks), lights=[], quality=rm.Quality(samples=16))
    sharp = sharp.replace(camera=rm.Camera((0.1, 0.2, 4), (0.1, 0.2, 0), **POINTS[projection]))
    blurred = sharp.replace(camera=sharp.camera.replace(aperture=0.3))
    np.testing.assert_allclose(
        rm.truth(blurred, SIZE, outputs=("color",)).color, rm.truth(sharp, SIZE, outputs=("color",)).color, atol=1e-6
    )
    off = np.abs(small.render(blurred).color - small.render(sharp).color)
    assert np.mean(off > 1e-3) < 0.01
    other = sharp.replace(camera=blurred.camera.replace(focus=2.0))
    assert np.mean(np.abs(small.render(other).color - small.render(sharp).color)) > 0.1


def lit(**quality: Any) -> rm.Scene:
    """Balls before and behind the plane in focus, over a floor."""
    balls = rm.union(*[rm.sphere(0.5).translate((1.2 * i - 2, 0.5, -1.5 * i)) for i in range(4)])
    camera = rm.Camera((0, 1.2, 4), (0, 0.5, -1.5), aperture=0.15, focus=5.6)
    return rm.Scene(balls | rm.plane(), camera, quality=rm.Quality(**quality))


def test_cones_hold_the_lens(small: Renderer) -> None:
    """No cone passes a surface that a ray from any point of the lens hits, and the picture is the same."""
    made = lit(schedule="cones", samples=4, analytic=False)
    picture = small.render(made).color
    values = Values({})
    pose = made.pose(values, SIZE[0] / SIZE[1])
    known = np.full(SIZE[::-1], np.inf)
    for point in ((0, 0), (1, 0), (-1, 0), (0, 1), (0, -1), (0.7, 0.7)):
        rays = lens_rays(pose, camera_rays(pose, *SIZE), np.array(point))
        known = np.minimum(known, trace(made, values, pose, rays, SIZE[::-1], pose.pixel(SIZE[1])).depth)
    for i, level in enumerate(plan(made, size=SIZE).marching.schedule.levels):
        ended = small.resources.target(f"cone {i}", level.size(SIZE)).read()[..., 0]
        rows = np.minimum((np.arange(SIZE[1]) + 0.5) / SIZE[1] * ended.shape[0], ended.shape[0] - 1).astype(int)
        columns = np.minimum((np.arange(SIZE[0]) + 0.5) / SIZE[0] * ended.shape[1], ended.shape[1] - 1).astype(int)
        free = ended[rows][:, columns]
        assert np.all(np.where(free < 0, np.inf, free) <= known * (1 + 1e-5)), i
        assert np.median(free) > 0.3 * np.median(known)
    alone = small.render(lit(schedule="single", samples=4, step_scale=0.999)).color  # no cones at all
    assert np.mean(np.abs(picture - alone) > 2e-3) < 0.01


def test_the_aperture_moves_without_a_recompile_and_depth_is_sharp(small: Renderer) -> None:
    aperture = rm.Param("aperture", 0.1, 0.0, 1.0)
    made = lit(samples=4)
    moving, closed = (made.replace(camera=made.camera.replace(aperture=a)) for a in (aperture, 0.0))
    wide = small.render(moving, outputs=("color", "depth"))
    compiled = small.compiled
    narrow = small.render(moving, params={"aperture": 0.0}, outputs=("color", "depth"))
    assert small.compiled == compiled
    pinhole = small.render(closed, outputs=("color", "depth"))
    hit = np.isfinite(wide.depth) & np.isfinite(narrow.depth)
    assert np.quantile(np.abs(wide.depth[hit] / narrow.depth[hit] - 1), 0.97) < 1e-3
    assert np.mean(np.abs(narrow.color - pinhole.color) > 1e-3) < 0.01
    assert np.mean(np.abs(wide.color - pinhole.color) > 1e-3) > 0.05
    hit = np.isfinite(wide.depth) & np.isfinite(pinhole.depth)
    assert np.quantile(np.abs(wide.depth[hit] / pinhole.depth[hit] - 1), 0.97) < 1e-3


def test_what_a_lens_changes_in_the_plan() -> None:
    assert [p.module for p in plan(lit(temporal="reproject")).passes if p.name == "color"] == ["view/accumulate"]
    closed = lit().camera.replace(aperture=0.0)
    assert plan(lit(analytic=False, tracer="bracketing").replace(camera=closed)).variants == {"BOUNDED", "JOINT"}
    with pytest.raises(PlanError, match=r"Camera\(aperture=...\) needs many") as caught:
        plan(lit(steps_per_pass=8))
    assert caught.value.where is not None


def test_one_ray_a_pixel_is_noisy(small: Renderer) -> None:
    assert any("Camera(aperture=...) is noisy" in doubt for doubt in small.render(lit()).doubts())
    assert not any("aperture" in doubt for doubt in small.render(lit(samples=2)).doubts())


def moving(seconds: Any, time: Any = rm.time, samples: int = 64, **quality: Any) -> rm.Scene:
    """A white box, .5 wide, that moves to the right by 2 units a second, in the dark, at 16 pixels per unit."""
    return rm.Scene(
        rm.box(0.5).translate((2.0 * time, 0, 0)).material(rm.Material(emission=(1, 1, 1))),
        rm.Camera((0, 0, 5), (0, 0, 0), projection="orthographic", height=3, shutter=seconds),
        lights=[],
        sky=(0, 0, 0),
        quality=rm.Quality(samples=samples, **quality),
    )


def test_a_moving_box_becomes_a_trapezium(small: Renderer) -> None:
    """While the shutter is open it moves by 1 unit: a column is covered for half of the time at most."""
    x = (np.arange(SIZE[0]) + 0.5 - SIZE[0] / 2) / 16
    covered = np.clip(0.75 - np.abs(x - 0.2), 0.0, 0.5)
    given = moving(rm.Param("seconds", 0.5, 0.0, 1.0))
    middle = small.render(given, time=0.1).color[SIZE[1] // 2, :, 0]
    # the edges cross a pixel in a sixteenth of the time, where the place of a sample in the pixel decides
    np.testing.assert_allclose(middle, covered, atol=4.5 / 64)
    assert middle.sum() == pytest.approx(covered.sum(), rel=0.02)
    known = rm.truth(moving(0.5, samples=25), SIZE, time=0.1, outputs=("color",)).color[SIZE[1] // 2, :, 0]
    np.testing.assert_allclose(known, covered, atol=1.01 / 25)
    compiled = small.compiled
    shut = small.render(given, time=0.1, params={"seconds": 0.0}).color[SIZE[1] // 2, :, 0]
    np.testing.assert_allclose(shut, np.clip(16 * (0.25 - np.abs(x - 0.2)) + 0.5, 0, 1), atol=0.1)
    assert small.compiled == compiled


def test_a_moving_camera_blurs_and_a_given_pose_stays(small: Renderer) -> None:
    still = moving(0.5, time=rm.Param("unused", 0.1, 0.0, 1.0))
    camera = still.camera.replace(position=(-2 * rm.time, 0, 5), target=(-2 * rm.time, 0, 0))
    made = still.replace(camera=camera)
    assert made.motion_blur and not still.motion_blur
    blurred = small.render(made).color[SIZE[1] // 2, :, 0]
    assert blurred.max() < 0.65
    fixed = small.render(made, pose=made.pose(Values({}, 0.3))).color[SIZE[1] // 2, :, 0]
    assert fixed.max() == 1.0


def test_what_a_shutter_changes_in_the_plan() -> None:
    made = moving(0.5, temporal="reproject")
    assert [p.module for p in plan(made).passes] == ["view/accumulate"]
    still = moving(0.5, time=rm.Param("unused", 0.0, 0.0, 1.0))
    assert [p.name for p in plan(still).passes] == ["cone", "color"]
    with pytest.raises(PlanError, match=r"Camera\(shutter=...\): an exported shader draws one moment"):
        plan(made, standalone=True)
    with pytest.raises(PlanError, match=r"Camera\(shutter=...\) needs many"):
        plan(moving(0.5, samples=1, steps_per_pass=8))
