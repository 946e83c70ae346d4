"""Orthographic cameras and clip planes, against closed forms, the reference and far perspective cameras."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.gpu.renderer import Renderer
from raymarch.plan import plan
from raymarch.truth import silhouettes

SIZE = (64, 48)
FLOOR = rm.Material(albedo=rm.checker((0.9, 0.8, 0.7), (0.1, 0.2, 0.3), 0.3))
BALL_AND_BOX = rm.sphere(1.0).translate((0, 1, 0)) | rm.box((1, 1, 1)).translate((2, 0.5, -1))
SOLID = BALL_AND_BOX | rm.plane()
PLACE: dict[str, Any] = {"position": (3, 3, 5), "target": (0, 0.5, 0)}
ORTHOGRAPHIC: dict[str, Any] = {**PLACE, "projection": "orthographic", "height": 5}
CUT: dict[str, Any] = {"near": 5.5, "far": 7.5}


def scene(camera: rm.Camera, node: rm.Node = SOLID, **quality: Any) -> rm.Scene:
    return rm.Scene(node, camera, quality=rm.Quality(**quality))


def front(node: rm.Node, distance: float = 5.0, **camera: Any) -> rm.Scene:
    """Seen along -z, at 48 pixels per 3 units."""
    return scene(rm.Camera((0, 0, distance), (0, 0, 0), projection="orthographic", height=3, **camera), node)


@pytest.fixture
def small(renderer: Renderer) -> Renderer:
    renderer.resize(SIZE)
    return renderer


@pytest.mark.parametrize("distance", [2.0, 50.0])
def test_the_picture_of_a_sphere_is_a_disc_of_its_radius(small: Renderer, distance: float) -> None:
    pixel = 3.0 / SIZE[1]
    x, y = np.meshgrid(np.arange(SIZE[0]) - 31.5, np.arange(SIZE[1]) - 23.5)
    off = np.hypot(x, y) * pixel
    inside = off < 1.0
    depth = small.render(front(rm.sphere(1.0), distance), outputs=("depth",)).depth
    assert np.array_equal(np.isfinite(depth), inside)
    assert np.sum(inside) * pixel**2 == pytest.approx(np.pi, rel=0.01)
    steep = off < 0.97
    np.testing.assert_allclose(depth[steep], distance - np.sqrt(1.0 - off[steep] ** 2), atol=0.01 * pixel)


def test_parallel_edges_stay_parallel(small: Renderer) -> None:
    """A box of 2 x 1 x 40: its sides are seen edge-on, and cover what the front covers."""
    hit = np.isfinite(small.render(front(rm.box((2, 1, 40)), 30.0), outputs=("depth",)).depth)
    assert hit.sum() == 32 * 16
    assert np.array_equal(np.flatnonzero(hit.any(axis=0))[[0, -1]], [16, 47])
    assert np.array_equal(np.flatnonzero(hit.any(axis=1))[[0, -1]], [16, 31])


def test_rays_that_start_on_a_floor_see_its_upper_side(small: Renderer) -> None:
    """The box of a plane ends in the plane, so rays from above begin their march on the surface."""
    random = np.random.default_rng(1)
    for _ in range(6):
        scale = 10.0 ** random.uniform(-3, 3)
        position, target = scale * random.uniform((-1, 1, -1), (1, 3, 1)), scale * random.uniform(-0.5, 0.5, 3)
        camera = rm.Camera(tuple(position), tuple(target), projection="orthographic", height=1.2 * scale)
        color = small.render(scene(camera, rm.plane()), outputs=("color",)).array("color")
        assert np.ptp(color, axis=(0, 1)).max() < 1e-6


@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
def test_a_clip_plane_on_a_face_shows_the_face(small: Renderer, projection: str) -> None:
    height = 3 if projection == "orthographic" else None
    camera = rm.Camera((0, 0, 5.3), (0, 0, 0), projection=projection, near=4.4, height=height)
    frame = small.render(scene(camera, rm.box((2, 2, 1.8))), outputs=("depth", "color"))
    hit = np.isfinite(frame.depth)
    assert hit.sum() > 600
    assert np.ptp(frame.array("color")[hit], axis=0).max() < 0.02
    assert frame.array("color")[hit].min() > 0.3


@pytest.mark.parametrize("factor", [1e-3, 1e3])
def test_scale_changes_nothing(small: Renderer, factor: float) -> None:
    camera = rm.Camera(
        tuple(factor * v for v in (3, 3, 5)),
        (0, 0.5 * factor, 0),
        projection="orthographic",
        height=5 * factor,
        near=5.5 * factor,
    )
    one = small.render(scene(rm.Camera(**ORTHOGRAPHIC, near=5.5), BALL_AND_BOX), outputs=("depth",)).depth
    other = small.render(scene(camera, BALL_AND_BOX.scale(factor)), outputs=("depth",)).depth
    both = np.isfinite(one) & np.isfinite(other)
    assert np.mean(np.isfinite(one) != np.isfinite(other)) < 2e-3
    np.testing.assert_allclose(other[both] / factor, one[both], atol=5e-3)


def test_a_perspective_camera_converges_to_it(small: Renderer) -> None:
    """From far away, with the angle that shows 5 units."""
    exact = small.render(scene(rm.Camera(**ORTHOGRAPHIC)), outputs=("depth",)).depth
    sure = ~silhouettes(rm.truth(scene(rm.Camera(**ORTHOGRAPHIC)), SIZE), 2)
    toward = np.array([3, 2.5, 5]) / np.linalg.norm([3, 2.5, 5])
    differences = []
    for distance in (1e2, 1e3, 1e4):
        far = rm.Camera(
            tuple(np.array([0, 0.5, 0]) + distance * toward),
            (0, 0.5, 0),
            fov=2 * np.degrees(np.arctan(2.5 / distance)),
        )
        seen = rm.truth(scene(far), SIZE, outputs=())
        differences.append(np.mean(np.abs(seen.depth - distance - (exact - np.sqrt(40.25)))[sure]))
    assert differences[1] < 0.2 * differences[0] and differences[2] < 0.2 * differences[1]
    assert differences[2] < 2.5 / 1e4 * 10.0  # the angle at the upper edge, times the depth of what is seen


CASES = {
    "orthographic": (ORTHOGRAPHIC, {}),
    "clipped": ({**PLACE, **CUT}, {}),
    "both": ({**ORTHOGRAPHIC, **CUT}, {}),
    "far alone": ({**PLACE, "far": 7.0}, {}),
    "passes": ({**ORTHOGRAPHIC, **CUT}, {"steps_per_pass": 8}),
    "interpolated": (ORTHOGRAPHIC, {"rays": "interpolated"}),
    "cones": ({**ORTHOGRAPHIC, **CUT}, {"schedule": "cones"}),
    "clipped cones": ({**PLACE, **CUT}, {"schedule": "cones", "steps_per_pass": 8}),
    "plain": ({**ORTHOGRAPHIC, **CUT}, {"tracer": "plain"}),
}


@pytest.mark.parametrize("name", CASES)
def test_the_picture_is_that_of_the_reference(small: Renderer, name: str) -> None:
    camera, quality = CASES[name]
    made = scene(rm.Camera(**camera), **quality)
    frame, known = small.render(made, outputs=("depth", "normal")), rm.truth(made, SIZE, outputs=())
    sure = ~silhouettes(known)
    assert np.array_equal(np.isfinite(frame.depth)[sure], known.hit[sure])
    both = sure & known.hit
    assert both.sum() > 200
    assert np.abs(frame.depth[both] - known.depth[both]).max() < 0.05 * 5 / SIZE[1]
    assert np.abs(frame.normal[both] - known.normal[both]).max() < 1e-3


def test_shadows_and_footprints_are_those_of_the_reference(small: Renderer) -> None:
    """A floor of checks near the size of a pixel, which is one at all distances."""
    lit = {"lights": [rm.Sun((1, 2, 1.5), shadow=True)]}
    made = scene(rm.Camera(**ORTHOGRAPHIC), BALL_AND_BOX | rm.plane().material(FLOOR)).replace(**lit)
    known = rm.truth(made, SIZE)
    off = np.abs(small.render(made).color - known.color).max(axis=-1)
    assert np.mean(off[~silhouettes(known)] > 2e-3) < 0.01


@pytest.mark.parametrize(("camera", "samples"), [({**PLACE, **CUT}, 4), ({**ORTHOGRAPHIC, **CUT}, 1)])
def test_no_cone_goes_on_beyond_what_it_holds(small: Renderer, camera: dict[str, Any], samples: int) -> None:
    made = scene(rm.Camera(**camera), schedule="cones", samples=samples, analytic=False)
    known = rm.truth(made, SIZE, outputs=()).depth
    for call in small.draw_calls(made):
        call.draw()
    for i, level in enumerate(plan(made, size=SIZE).marching.schedule.levels):
        ended = small.resources.target(f"cone {i}", level.size(SIZE)).read()[..., 0]
        rows = np.minimum((np.arange(SIZE[1]) + 0.5) / SIZE[1] * ended.shape[0], ended.shape[0] - 1).astype(int)
        columns = np.minimum((np.arange(SIZE[0]) + 0.5) / SIZE[0] * ended.shape[1], ended.shape[1] - 1).astype(int)
        free = ended[rows][:, columns]
        free = np.where(free < 0, np.inf, free)
        assert np.all(free <= known * (1 + 1e-5)), (camera, i)


def test_cones_save_evaluations(small: Renderer) -> None:
    alone, cones = (
        small.render(scene(rm.Camera(**ORTHOGRAPHIC), schedule=name), outputs=("evaluations",)).evaluations.mean()
        for name in ("single", "cones")
    )
    assert cones < 0.8 * alone


def test_a_plane_cuts_a_ball_open(small: Renderer) -> None:
    """A ball of radius 1 cut at its centre: its inner side, 1 unit farther behind the plane, and no fewer pixels."""
    depth = small.render(front(rm.sphere(1.0), near=5.0), outputs=("depth",)).depth
    whole = small.render(front(rm.sphere(1.0)), outputs=("depth",)).depth
    assert np.array_equal(np.isfinite(depth), np.isfinite(whole))
    middle = depth[23:25, 31:33]
    np.testing.assert_allclose(middle, 6.0, atol=2e-3)
    beyond = small.render(front(rm.sphere(1.0), far=4.5), outputs=("depth",)).depth
    cap = np.isfinite(beyond)
    assert cap.sum() * (3.0 / SIZE[1]) ** 2 == pytest.approx(np.pi * 0.75, rel=0.02)  # of radius sqrt(1 - .5^2)


def test_clip_planes_are_planes(small: Renderer) -> None:
    """A wall at z = 0, seen from z = 5 at 90 degrees: near = 4.99 shows all of it, near = 5.01 nothing."""
    wall = rm.plane((0, 0, 1))
    for near, hits in ((4.99, SIZE[0] * SIZE[1]), (5.01, 0)):
        camera = rm.Camera((0, 0, 5), (0, 0, 0), fov=90, near=near)
        depth = small.render(scene(camera, wall), outputs=("depth",)).depth
        assert np.isfinite(depth).sum() == hits
        assert rm.truth(scene(camera, wall), SIZE).hit.sum() == hits
    for far, hits in ((4.99, 0), (5.01, SIZE[0] * SIZE[1])):
        camera = rm.Camera((0, 0, 5), (0, 0, 0), fov=90, far=far)
        assert np.isfinite(small.render(scene(camera, wall), outputs=("depth",)).depth).sum() == hits


def test_parameters_move_without_a_recompile(small: Renderer) -> None:
    height, near = rm.Param("height", 3.0, 1.0, 10.0), rm.Param("near", 0.5, 0.1, 10.0)
    made = front(rm.sphere(1.0)).replace(
        camera=rm.Camera((0, 0, 5), (0, 0, 0), projection="orthographic", height=height, near=near)
    )

    def area(**params: float) -> int:
        return int(np.isfinite(small.render(made, params=params, outputs=("depth",)).depth).sum())

    first, compiled = area(height=3.0), small.compiled
    assert first / area(height=6.0) == pytest.approx(4.0, rel=0.05)
    assert area(near=6.5) == 0
    assert small.compiled == compiled


def test_tiles_change_nothing(small: Renderer) -> None:
    made = scene(rm.Camera(**ORTHOGRAPHIC, **CUT))
    assert np.array_equal(small.render(made).color, small.render(made, progress=lambda done: None).color)


def test_a_history_follows_the_camera(small: Renderer) -> None:
    """While an orthographic camera moves to the right, the history cuts the error of one sample a pixel."""
    pattern = rm.Material(albedo=rm.checker((1, 1, 1), (0, 0, 0), 0.3))
    push = rm.Param("push", 0.0, -5.0, 5.0)
    node = (rm.box((4, 4, 1)) | rm.sphere(0.5).translate((push, 0, 0.8))).material(pattern)

    def at(shift: float, **quality: Any) -> rm.Scene:
        camera = rm.Camera((shift, 1, 5), (shift, 0, 0), projection="orthographic", height=3)
        return scene(camera, node, **quality)

    small.forget()
    for i in range(8):
        frame = small.render(at(0.01 * i, temporal="reproject"), params={"push": 0.01 * i})
    mean = small.render(at(0.07, samples=64), params={"push": 0.07}).color
    alone = small.render(at(0.07), params={"push": 0.07}).color
    assert np.sqrt(np.mean((frame.color - mean) ** 2)) < 0.6 * np.sqrt(np.mean((alone - mean) ** 2))


def test_a_pose_of_another_projection_is_refused(small: Renderer) -> None:
    made, other = scene(rm.Camera(**ORTHOGRAPHIC)), scene(rm.Camera(**PLACE))
    with pytest.raises(rm.SceneError, match="pose: of a perspective camera"):
        small.render(made, pose=other.camera.pose(rm.scene.parameter.Values({}), None))


def test_other_scenes_keep_their_text() -> None:
    found = plan(scene(rm.Camera(**PLACE, projection="perspective", near=0.0), analytic=False, tracer="bracketing"))
    assert found.variants == {"BOUNDED", "JOINT"}
