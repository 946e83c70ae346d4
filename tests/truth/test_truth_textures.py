"""Textures and relief in the truth: filtering, how they move with what they are painted on, what they dim."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import raymarch as rm
from raymarch.expr.node import Expr
from raymarch.expr.vocabulary import cos, sin
from raymarch.truth import Truth, truth

TILE = 0.5
LOW, HIGH = 0.1, 0.9
CHECKS = np.kron(np.array([[LOW, HIGH], [HIGH, LOW]]), np.ones((32, 32)))
SHOWN = {"specular": 0.0, "ambient": 1.0}
"""Lit from behind, a surface of ambient 1 shows its own colour."""


def own_colour(node: rm.Node, camera: rm.Camera, size: tuple[int, int], **parts: object) -> Truth:
    back = rm.Sun(tuple(-(np.array(camera.position.data) - np.array(camera.target.data))))
    return truth(rm.Scene(node, camera=camera, lights=[back], **parts), size)


def floor_seen(size: tuple[int, int], **parts: object) -> Truth:
    """A checkered floor up to its horizon, lit from below."""
    floor = rm.plane().material(rm.Material(rm.planar(CHECKS, TILE, "y"), **SHOWN))
    camera = rm.Camera((0.13, 1, 0), (0.13, 0.95, -2), fov=40)
    return truth(rm.Scene(floor, camera=camera, lights=[rm.Sun((0, -1, 0))], **parts), size)


def footprints(seen: Truth, rows: int) -> tuple[np.ndarray, np.ndarray]:
    """Width across and along the ray of what each pixel covers."""
    width = 2 * np.tan(np.radians(20)) / rows * seen.depth
    with np.errstate(invalid="ignore"):
        return width, width / np.abs(seen.direction[..., 1])


def test_far_checks_are_their_mean_and_nearer_ones_as_near_to_it_as_an_interval_allows() -> None:
    """Over a length W a square wave of amplitude a and period P is off its mean by a P / (2 W) at most. The samples
    along it are up to two texels of the finer of their levels apart, and ripple by as much again."""
    seen = floor_seen((96, 72))
    mean, amplitude = (LOW + HIGH) / 2, (HIGH - LOW) / 2
    across, along = footprints(seen, 72)
    off = np.abs(seen.color[..., 0] - mean)
    far = seen.hit & (across >= TILE)
    assert far.sum() > 100 and off[far].max() < 2.0**-11
    wide = seen.hit & (along >= TILE)
    assert wide.sum() > 1.5 * far.sum()
    assert np.all(off[wide] < amplitude * TILE / along[wide] + 2.0**-11)


def test_without_its_footprint_the_floor_would_shimmer() -> None:
    """The same test fails for a ray that sees a point: the limits above are not met by chance."""
    seen = floor_seen((96, 72), quality=rm.Quality(samples=4096))
    across, along = footprints(seen, 72)
    off = np.abs(seen.color[..., 0] - (LOW + HIGH) / 2)
    wide = seen.hit & (along >= TILE) & (across < TILE)
    assert np.mean(off[wide] > (HIGH - LOW) / 2 * TILE / along[wide]) > 0.2


def test_a_filtered_floor_is_the_mean_of_many_rays() -> None:
    """Each of 12 x 12 rays sees its own part of the pixel. What is filtered at once is a little wider than the pixel,
    by the tent between texels, which moves an edge's share by up to 1/8 where it lies beside the pixel."""
    edge = 12
    once, fine = floor_seen((48, 36)), floor_seen((48 * edge, 36 * edge))
    many = fine.color.reshape(36, edge, 48, edge, 3).mean((1, 3))
    inside = once.hit & fine.hit.reshape(36, edge, 48, edge).all((1, 3))
    off = (once.color - many)[inside][:, 0]
    amplitude = (HIGH - LOW) / 2
    assert abs(off.mean()) < 2 * amplitude / edge / np.sqrt(inside.sum())
    assert np.abs(off).max() < 2 * amplitude * 0.25 and np.sqrt(np.mean(off**2)) < 2 * amplitude / 16


PLACED: dict[str, Callable[[rm.Node], rm.Node]] = {
    "turned": lambda n: n.rotate(0.7, (1, 2, 3)).translate((0.3, 0.1, 0)),
    "scaled": lambda n: n.scale(0.4),
    "stretched": lambda n: n.scale((1, 1.6, 0.7)).rotate(0.4, "x"),
    "mirrored": lambda n: n.translate((0.9, 0, 0)).mirror("x"),
    "twisted": lambda n: n.twist(0.6),
    "repeated": lambda n: n.scale(0.5).repeat((1.6, None, None), 3),
}
HEIGHT = 1e-5
SHARP = rm.Quality(samples=4096)
"""Each ray sees an eighth of a pixel."""


def bumps(p: Expr) -> Expr:
    return HEIGHT * sin(4.0 * p.x + 1.0) * cos(3.0 * p.y) * sin(5.0 * p.z)


@pytest.mark.parametrize("how", PLACED)
def test_relief_bends_normals_as_moved_surfaces_do(how: str) -> None:
    """Against a field that is really raised by so little that its surface stays where it is."""
    camera = rm.Camera((1, 2, 5), (0, 0, 0), fov=35)
    ball = rm.sphere(0.8)
    seen = truth(rm.Scene(PLACED[how](ball.material(rm.Material(height=bumps, height_scale=1.0))), camera), (40, 30))
    found = (seen._surfaces[0][1].shading_normals - seen._surfaces[0][1].normals) / HEIGHT
    raised = PLACED[how](ball.displace_by(lambda p: -bumps(p), HEIGHT, 8 * HEIGHT))
    slope = raised.gradient(seen._surfaces[0][1].points)
    wanted = (slope / np.linalg.norm(slope, axis=1, keepdims=True) - seen._surfaces[0][1].normals) / HEIGHT
    facing = -np.einsum("ij,ij->i", seen._surfaces[0][1].normals, seen.direction[seen.hit])
    some = facing > 0.1  # what is seen at grazing angles may be lifted to be seen at all
    assert np.abs(wanted[some]).max() > 1.0
    # of second order in the slopes, and the rounding of what is divided by the height
    np.testing.assert_allclose(found[some], wanted[some], atol=1e-3)


def test_a_picture_of_heights_bends_as_its_function_does() -> None:
    side = 256
    y, x = (np.mgrid[0:side, 0:side] + 0.5) / side - 0.5
    waves = np.sin(2 * np.pi * 2 * x) * np.cos(2 * np.pi * 3 * -y)  # row 0 is the top
    camera = rm.Camera((0.4, 0.3, 4), (0, 0, 0), fov=30)

    def normals(**relief: object) -> np.ndarray:
        made = truth(rm.Scene(rm.sphere().material(rm.Material(**relief)), camera, quality=SHARP), (40, 30))
        facing = -np.einsum("ij,ij->i", made.normal[made.hit], made.direction[made.hit])
        return made._surfaces[0][1].shading_normals[facing > 0.3]  # beyond, a pixel sees much of a wave

    for laid in (rm.planar(waves, 2), rm.planar(waves, 2, rotation=np.pi)):
        turn = -1 if laid.layout.turn.data else 1
        formula = normals(
            height=lambda p, s=turn: 0.05 * sin(s * 2 * np.pi * p.x) * cos(s * 3 * np.pi * p.y), height_scale=1.0
        )
        # Central differences of a wave of k texels a period: its slope times 1 - (2 pi / k)^2 / 6, and half floats.
        np.testing.assert_allclose(normals(height=laid, height_scale=0.05), formula, atol=2e-3)


def test_a_normal_map_is_the_slope_of_its_heights() -> None:
    """The same relief given as heights and as normals."""
    side, tall = 64, 0.03
    y, x = (np.mgrid[0:side, 0:side] + 0.5) / side
    heights = np.sin(2 * np.pi * x) * np.sin(2 * np.pi * y)
    right = tall * (np.roll(heights, -1, 1) - np.roll(heights, 1, 1)) * side / 2
    up = -tall * (np.roll(heights, -1, 0) - np.roll(heights, 1, 0)) * side / 2
    normal = np.stack([-right, -up, np.ones_like(right)], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    camera = rm.Camera((1, 2, 3), (0, 0, 0), fov=40)
    shapes = [
        truth(rm.Scene(rm.box(1).rotate(0.4, "y").material(m), camera), (40, 30))._surfaces[0][1].shading_normals
        for m in (
            rm.Material(height=rm.triplanar(heights), height_scale=tall),
            rm.Material(normal=rm.triplanar(0.5 + 0.5 * normal)),
            rm.Material(normal=rm.triplanar(0.5 + 0.5 * normal), normal_strength=0.0),
        )
    ]
    np.testing.assert_allclose(shapes[0], shapes[1], atol=2e-3)
    assert np.abs(shapes[0] - shapes[2]).max() > 0.1


def test_a_texture_moves_with_what_it_is_painted_on() -> None:
    picture = np.random.default_rng(3).uniform(0, 1, (16, 16, 3))
    painted = rm.box(1).material(rm.Material(rm.triplanar(picture), **SHOWN))
    turn = {"angle": 0.8, "axis": (1, 2, -1)}
    still = own_colour(painted, rm.Camera((1, 2, 4), (0, 0, 0), fov=30), (48, 36))
    c, s, a = np.cos(0.8), np.sin(0.8), np.array([1, 2, -1]) / np.sqrt(6)
    k = np.cross(np.eye(3), a).T
    matrix = np.eye(3) + s * k + (1 - c) * k @ k
    if np.abs(matrix @ a - a).max() > 1e-9 or painted.rotate(**turn).distance([matrix @ (0.5, 0.5, 0.5)])[0] > 1e-9:
        matrix = matrix.T
    moved = rm.Camera(tuple(2 * matrix @ (1, 2, 4)), (0, 0, 0), up=tuple(matrix @ (0, 1, 0)), fov=30)
    turned = own_colour(painted.rotate(**turn).scale(2), moved, (48, 36))
    assert np.array_equal(still.hit, turned.hit)
    np.testing.assert_allclose(turned.color[still.hit], still.color[still.hit], atol=1e-6)


def test_occlusion_dims_the_light_of_the_sky_alone() -> None:
    dim = rm.planar(np.full((4, 4), 0.25))
    for light, share in ((True, 0.25), (False, 1.0)):
        pictures = [
            truth(
                rm.Scene(
                    rm.sphere().material(rm.Material(albedo=(0.5, 0.5, 0.5), occlusion=open_)),
                    lights=[] if light else [rm.Sun((0, 0, 1))],
                    sky=rm.Sky((1, 1, 1), light=light),
                ),
                (24, 18),
            )
            for open_ in (None, dim)
        ]
        hit = pictures[0].hit
        np.testing.assert_allclose(pictures[1].color[hit], share * pictures[0].color[hit], rtol=1e-9)
