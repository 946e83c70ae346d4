"""The camera against an independent renderer: right-handed, y up, row 0 at the top, not mirrored."""

from __future__ import annotations

from typing import Any

import numpy as np

from raymarch.scene import Camera, Scene
from raymarch.scene.parameter import Values
from raymarch.sdf import box, sphere
from raymarch.truth import silhouettes, truth
from raymarch.truth.rays import camera_rays, lens_rays

POSITION, TARGET, UP, FOV = (2.0, 1.5, 4.5), (0.3, 0.4, -0.2), (0.25, 1.0, 0.1), 38.0
SIZE = (96, 54)
CENTRE, RADIUS = (-0.8, 0.2, 0.3), 0.7
PLACE, EXTENT, ANGLE = (0.9, 0.9, -0.5), (0.8, 1.6, 0.5), 0.6


def test_rays_by_hand() -> None:
    """A camera at the origin of a plain frame: right is +x, up is +y, ahead is -z."""
    made = truth(Scene(sphere(), camera=Camera((0, 0, 5), (0, 0, 0), fov=90.0)), (4, 2), outputs=("depth",))
    assert made.direction[0, 0, 0] < 0 < made.direction[0, 3, 0]
    assert made.direction[1, 0, 1] < 0 < made.direction[0, 0, 1]
    ahead = made.direction / -made.direction[..., 2:]
    np.testing.assert_allclose(ahead[0, :, 0], [-1.5, -0.5, 0.5, 1.5], atol=1e-14)
    np.testing.assert_allclose(ahead[:, 0, 1], [0.5, -0.5], atol=1e-14)


def their_scene(mi: Any) -> Any:
    place = mi.ScalarTransform4f
    turned = place().translate(PLACE).rotate((0, 1, 0), np.degrees(ANGLE)).scale([e / 2 for e in EXTENT])
    return mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "aov", "aovs": "dd:depth"},
            "sensor": {
                "type": "perspective",
                "fov": FOV,
                "fov_axis": "y",
                "near_clip": 1e-3,
                "far_clip": 100.0,
                "to_world": place().look_at(origin=POSITION, target=TARGET, up=UP),
                "film": {"type": "hdrfilm", "width": SIZE[0], "height": SIZE[1], "rfilter": {"type": "box"}},
                "sampler": {"type": "independent", "sample_count": 16},
            },
            "ball": {"type": "sphere", "center": CENTRE, "radius": RADIUS},
            "block": {"type": "cube", "to_world": turned},
        }
    )


def our_picture() -> Any:
    node = sphere(RADIUS).translate(CENTRE) | box(EXTENT).rotate(ANGLE, "y").translate(PLACE)
    return truth(Scene(node, camera=Camera(POSITION, TARGET, UP, FOV)), SIZE, outputs=("depth", "normal"))


def test_every_ray_hits_what_mitsuba_hits(mitsuba: Any) -> None:
    scene, made = their_scene(mitsuba), our_picture()
    depth, normal = np.full(made.depth.shape, np.inf), np.zeros(made.normal.shape)
    for row, column in np.ndindex(depth.shape):
        at = ((column + 0.5) / SIZE[0], (row + 0.5) / SIZE[1])
        ray, _ = scene.sensors()[0].sample_ray(0.0, 0.5, at, (0.5, 0.5))
        met = scene.ray_intersect(ray)
        if met.is_valid():
            depth[row, column] = np.linalg.norm(np.array(met.p) - POSITION)
            normal[row, column] = np.array(met.n)
    sure = ~silhouettes(made)
    assert np.array_equal(made.hit[sure], np.isfinite(depth)[sure])
    assert np.mean(made.hit != np.isfinite(depth)) < 0.002
    both = made.hit & np.isfinite(depth) & sure
    assert both.sum() > 300
    np.testing.assert_allclose(made.depth[both], depth[both], rtol=2e-6)  # theirs is float32
    np.testing.assert_allclose(made.normal[both], normal[both], atol=2e-5)


def test_the_picture_is_neither_mirrored_nor_upside_down(mitsuba: Any) -> None:
    """Their picture as it comes out of the film, which no choice of ours about sample positions enters."""
    theirs = np.array(mitsuba.render(their_scene(mitsuba), spp=16, seed=1))[..., -1]
    made = our_picture()
    sure = ~silhouettes(made)
    assert np.array_equal((theirs > 0)[sure], made.hit[sure])
    for other in (theirs[::-1], theirs[:, ::-1], theirs[::-1, ::-1]):
        assert np.mean((other > 0) != made.hit) > 0.1


PIXELS = ((0, 0), (95, 3), (40, 53), (61, 20))


def their_rays(mi: Any, at: Any, lens: Any = (0.5, 0.5), **sensor: Any) -> tuple[Any, Any]:
    """Origin and direction of their ray through the centre of a pixel."""
    place = sensor.pop("to_world", mi.ScalarTransform4f().look_at(origin=POSITION, target=TARGET, up=UP))
    film = {"type": "hdrfilm", "width": SIZE[0], "height": SIZE[1]}
    made = mi.load_dict({**sensor, "to_world": place, "film": film})
    ray, _ = made.sample_ray(0.0, 0.5, ((at[0] + 0.5) / SIZE[0], (at[1] + 0.5) / SIZE[1]), lens)
    return np.array(ray.o), np.array(ray.d)


def test_parallel_rays_are_those_of_mitsuba(mitsuba: Any) -> None:
    """Their picture is 2 wide before it is scaled; their rays start at the near plane."""
    height, near = 3.0, 0.01
    camera = Camera(POSITION, TARGET, UP, projection="orthographic", height=height)
    made = truth(Scene(sphere(), camera=camera), SIZE, outputs=())
    half = height * SIZE[0] / SIZE[1] / 2
    place = mitsuba.ScalarTransform4f().look_at(origin=POSITION, target=TARGET, up=UP)
    for x, y in PIXELS:
        origin, direction = their_rays(
            mitsuba, (x, y), type="orthographic", near_clip=near, to_world=place.scale((half, half, 1))
        )
        np.testing.assert_allclose(made.direction[y, x], direction, atol=1e-6)
        np.testing.assert_allclose(made.origin[y, x] + near * direction, origin, atol=2e-6)


def test_rays_through_the_lens_are_those_of_mitsuba(mitsuba: Any) -> None:
    """From the same point of the lens; their x axis points to the left. Their rays start at the near plane."""
    aperture, focus, near = 0.3, 3.5, 1e-3
    pose = Camera(POSITION, TARGET, UP, FOV, aperture=aperture, focus=focus).pose(Values({}), None)
    sensor = {"type": "thinlens", "fov": FOV, "fov_axis": "y", "near_clip": near, "aperture_radius": aperture}
    for x, y in PIXELS:
        origin, direction = their_rays(mitsuba, (x, y), (0.8, 0.3), focus_distance=focus, **sensor)
        start = origin - direction * (near / (direction @ pose.view))
        point = (start - pose.position) @ pose.frame / aperture
        assert np.hypot(*point[:2]) < 1.0 and abs(point[2]) < 1e-5
        ours = lens_rays(pose, camera_rays(pose, *SIZE), point[:2])
        np.testing.assert_allclose(ours.directions.reshape(SIZE[1], SIZE[0], 3)[y, x], direction, atol=2e-6)
