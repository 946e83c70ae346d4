"""Participating media against closed forms and a fine sum that is written anew, and against the float64 reference."""

from __future__ import annotations

import itertools
import math
import pickle
from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.errors import RaymarchError
from raymarch.scene.parameter import Values

LOW, HIGH = np.array((-1.0, -0.5, -1.0)), np.array((1.0, 0.5, 1.0))
BOUNDS = (tuple(LOW), tuple(HIGH))
EYE = np.array((0.0, 0.2, 5.0))


def scene(medium: rm.Medium, **parts: Any) -> rm.Scene:
    """A medium before a black sky; one wall behind it does not show."""
    parts = {"lights": [rm.Sun((0, 1, 0), intensity=2.0)], "sky": (0, 0, 0)} | parts
    wall = rm.plane((0, 1, 0), offset=-50).material(rm.Material((0, 0, 0), specular=0))
    return rm.Scene(parts.pop("node", wall), rm.Camera(tuple(EYE), (0, 0.2, 0)), fog=medium, **parts)


def middle(given: rm.Scene) -> Any:
    """The colour of the ray through the middle of the picture, which is level."""
    with rm.Renderer((3, 3)) as renderer:
        found = renderer.render(given).color[1, 1].astype(float)
    np.testing.assert_allclose(found, rm.truth(given, size=(3, 3)).color[1, 1], rtol=2e-5, atol=1e-6)
    return found


@pytest.mark.parametrize("g", [-0.5, 0.0, 0.7])
@pytest.mark.parametrize("density", [0.05, 1.0, 20.0])
def test_an_even_medium_is_its_closed_form(g: float, density: float) -> None:
    """A level ray, lit from above: all its points have the same light, so any number of steps is exact."""
    albedo = np.array((0.9, 0.5, 0.1))
    found = middle(scene(rm.Medium(density, BOUNDS, albedo, g, steps=7, light_steps=3)))
    to_light = math.exp(-density * (HIGH[1] - EYE[1]))
    phase = (1 - g * g) / (4 * math.pi * (1 + g * g) ** 1.5)  # at a right angle
    scattered = albedo * phase * math.pi * 2.0 * to_light * (1 - math.exp(-density * 2.0))
    np.testing.assert_allclose(found, scattered, rtol=2e-3, atol=1e-6)  # a ray of less than 1e-3 ends


def test_a_surface_behind_it_is_dimmed_and_one_within_ends_the_ray() -> None:
    glow = rm.Material((0, 0, 0), specular=0, emission=(1, 2, 3))
    for z, length in ((-3.0, 2.0), (0.25, 0.75), (2.0, 0.0)):
        node = rm.plane((0, 0, 1), offset=z).material(glow)
        found = middle(scene(rm.Medium(0.8, BOUNDS, albedo=(0, 0, 0)), node=node, lights=[]))
        np.testing.assert_allclose(found, np.array((1, 2, 3)) * math.exp(-0.8 * length), rtol=1e-5)


def clumps(p: Any) -> Any:
    """A density with values below 0, of expressions or arrays."""
    sin = np.sin if isinstance(p, np.ndarray) else rm.sin
    x, y, z = (p[..., 0], p[..., 1], p[..., 2]) if isinstance(p, np.ndarray) else (p.x, p.y, p.z)
    return 1.5 + 2.5 * sin(4.0 * x) * sin(5.0 * z + 1.0) + sin(3.0 * y)


def brute_force(direction: Any, light: Any, g: float, ambient: float) -> float:
    """The light along a ray from the eye, by 2,000 steps and 400 for each of them; no code of the package."""

    def box(o: Any, d: Any) -> tuple[Any, Any]:
        with np.errstate(divide="ignore"):
            a, b = (LOW - o) / d, (HIGH - o) / d
        return np.maximum(np.minimum(a, b).max(-1), 0.0), np.maximum(a, b).min(-1)

    begin, end = box(EYE, direction)
    if end <= begin:
        return 0.0
    n = 2000
    width = (end - begin) / n
    points = EYE + (begin + (np.arange(n) + 0.5) * width)[:, None] * direction
    extinction = np.maximum(clumps(points), 0.0)
    way = light - points
    distance = np.linalg.norm(way, axis=1)
    way /= distance[:, None]
    out = np.minimum(box(points, way)[1], distance)
    at = points[:, None] + ((np.arange(400) + 0.5) / 400 * out[:, None])[..., None] * way[:, None]
    depth = np.maximum(clumps(at), 0.0).mean(axis=1) * out
    cosine = way @ direction
    phase = (1 - g * g) / (4 * np.pi * (1 + g * g - 2 * g * cosine) ** 1.5)
    arriving = np.pi * 4.0 / distance**2 * np.exp(-depth) * phase + ambient
    before = np.exp(-np.cumsum(extinction * width) + extinction * width)
    return float(np.sum(before * (1 - np.exp(-extinction * width)) * arriving))


@pytest.mark.parametrize(("steps", "within"), [(16, 0.03), (200, 2e-3)])
def test_a_medium_of_clumps_is_the_fine_sum(steps: int, within: float) -> None:
    """More steps come nearer."""
    lamp, g, ambient, size = np.array((1.5, 2.0, 1.0)), 0.4, 0.05, (9, 5)
    medium = rm.Medium(clumps, BOUNDS, anisotropy=g, steps=steps, light_steps=steps // 4, ambient=(ambient,) * 3)
    given = scene(medium, lights=[rm.PointLight(tuple(lamp), intensity=4.0)])
    with rm.Renderer(size) as renderer:
        found = renderer.render(given).color[..., 0].astype(float)
    tangent, truth = math.tan(math.radians(0.5 * given.camera.arguments()["fov"].data)), np.zeros((size[1], size[0]))
    for j in range(size[1]):
        for i in range(size[0]):
            screen = np.array((2 * i + 1 - size[0], size[1] - 1 - 2 * j)) / size[1] * tangent
            direction = np.array((*screen, -1.0))
            truth[j, i] = brute_force(direction / np.linalg.norm(direction), lamp, g, ambient)
    assert truth.max() > 0.1
    np.testing.assert_allclose(found, truth, atol=within * truth.max())


def test_it_dims_lights_on_surfaces_where_it_is_asked_to() -> None:
    """The light of a slanted sun on a floor, through a slab, and of a lamp within it."""
    slab = ((-20.0, 0.0, -20.0), (20.0, 0.5, 20.0))
    floor = rm.plane(offset=-1).material(rm.Material((1, 1, 1), specular=0, ambient=0))
    eye = rm.Camera((0, -0.5, 2), (0, -1, 0))
    cosine = 0.8
    lights = {"sun": rm.Sun((0.6, cosine, 0)), "lamp": rm.PointLight((0, 0.2, 0), range=50)}
    for name, way in (("sun", 0.5 / cosine), ("lamp", 0.2)):
        bright, dim = (
            rm.truth(
                rm.Scene(floor, eye, [lights[name]], (0, 0, 0), rm.Medium(0.7, slab, albedo=(0, 0, 0), shadow=dims)),
                size=(3, 3),
            ).color[1, 1, 0]
            for dims in (False, True)
        )
        np.testing.assert_allclose(dim / bright, math.exp(-0.7 * way), rtol=1e-6)
    with rm.Renderer((3, 3)) as renderer:
        shown = rm.Scene(floor, eye, [lights["lamp"]], (0, 0, 0), rm.Medium(0.7, slab, albedo=(0, 0, 0), shadow=True))
        np.testing.assert_allclose(renderer.render(shown).color[1, 1, 0], dim, rtol=1e-5)


def test_lights_that_come_and_go_light_it() -> None:
    """One renderer, as in the window: the values of lights are part of the function of the medium."""
    size = (9, 5)
    with rm.Renderer(size) as renderer:
        for count in (2, 3, 1, 10):
            lamps = [rm.PointLight((0.5 * k - 2, 1.5, 0)) for k in range(count)]
            given = scene(rm.Medium(clumps, BOUNDS, steps=6, light_steps=2), lights=lamps)
            np.testing.assert_allclose(
                renderer.render(given).color, rm.truth(given, size=size).color, rtol=1e-4, atol=1e-6
            )


def test_light_of_the_sky_and_values_that_move() -> None:
    """The mean of the sky along the axes, unless it lights nothing; parameters and time in all numbers."""
    sky = rm.Sky(lambda d: (1.0 + 0.5 * d.y + 0.25 * d.x * d.x) * rm.vec3(1, 1, 1), light=True)
    thick = rm.Medium(50.0, BOUNDS)
    np.testing.assert_allclose(middle(scene(thick, lights=[], sky=sky)), 1.0 + 0.25 / 3, rtol=2e-3)
    assert np.all(middle(scene(thick, lights=[])) == 0.0)
    given = rm.Param("density", 1.0, 0.0, 9.0)
    albedo = (0.5 + 0.5 * rm.sin(rm.time), 1, 1)
    moving = rm.Medium(lambda p: given + 0.0 * p.x, BOUNDS, albedo, ambient=(1, 1, 1))
    with rm.Renderer((3, 3)) as renderer:
        found = renderer.render(scene(moving, lights=[]), time=math.pi / 2, params={"density": 0.5}).color[1, 1]
    np.testing.assert_allclose(found, 1 - math.exp(-0.5 * 2.0), rtol=1e-5)


def test_it_stays_where_it_is_far_from_the_origin() -> None:
    def at(x: float) -> Any:
        moved = ((LOW[0] + x, LOW[1], LOW[2]), (HIGH[0] + x, HIGH[1], HIGH[2]))
        medium = rm.Medium(lambda p: 2.0 - 2.0 * (p.x - x), moved, ambient=(1, 1, 1))
        floor = rm.plane(offset=-50)
        given = rm.Scene(floor, rm.Camera((x, 0.2, 5.0), (x, 0.2, 0)), [], (0, 0, 0), medium)
        with rm.Renderer((9, 5)) as renderer:
            return renderer.render(given).color

    np.testing.assert_allclose(at(65536.0), at(0.0), atol=1e-4)


def test_what_cannot_be_is_refused() -> None:
    refused = {
        "Medium: density = -1": lambda: rm.Medium(-1, BOUNDS),
        "Medium: bounds": lambda: rm.Medium(1, ((1, 1, 1), (0, 2, 2))),
        "inf": lambda: rm.Medium(1, ((-math.inf,) * 3, (1, 1, 1))),
        "anisotropy = 1": lambda: rm.Medium(1, BOUNDS, anisotropy=1),
        "steps = 0": lambda: rm.Medium(1, BOUNDS, steps=0),
        "gives a vec3": lambda: rm.Medium(lambda p: p, BOUNDS),
        "rm.sin in place of math.sin": lambda: rm.Medium(lambda p: math.sin(p.x), BOUNDS),
        "Medium: the value of the density = None": lambda: rm.Medium(lambda p: None, BOUNDS),
        "albedo": lambda: rm.Medium(1, BOUNDS, albedo=(1.5, 1, 1)),
        "rm.sampled(array, size)": lambda: rm.Medium(np.ones((4, 4, 4)), BOUNDS),
        "-node.distance(p)": lambda: rm.Medium(rm.sphere(), BOUNDS),
        "its distance is node.distance(p)": lambda: rm.Medium(lambda p: rm.sphere()(p), BOUNDS),
        "one Medium(...)": lambda: rm.Scene(rm.sphere(), fog=[rm.Medium(1, BOUNDS), rm.Fog()]),
        "65792 points a pixel": lambda: scene(rm.Medium(1, BOUNDS, steps=256, light_steps=256)),
    }
    for words, make in refused.items():
        with pytest.raises(RaymarchError) as error:
            make()
        assert words in str(error.value) and "\n" not in str(error.value), (words, str(error.value))


def test_it_is_a_value() -> None:
    medium = rm.Medium(clumps, BOUNDS, anisotropy=0.2, shadow=True)
    assert pickle.loads(pickle.dumps(medium)) == medium == medium.replace() != medium.replace(steps=9)
    assert "Medium" in repr(medium)


def test_smoke_in_the_form_of_a_solid() -> None:
    """The distance of a node as an expression of a function: a ball of even smoke, by its chords."""
    ball, flat = rm.sphere(0.4).translate((0.1, 0.2, 0)), rm.circle(0.4)
    inside = {
        "solid": rm.Medium(lambda p: rm.where(ball.distance(p) < 0, 2.0, 0.0), BOUNDS, ambient=(1, 1, 1), steps=400),
        "flat": rm.Medium(lambda p: rm.where(flat.distance(p.xz) < 0, 2.0, 0.0), BOUNDS, ambient=(1, 1, 1), steps=400),
    }
    for name, half in (("solid", math.sqrt(0.4**2 - 0.1**2)), ("flat", 0.4)):
        found = middle(scene(inside[name], lights=[]))
        np.testing.assert_allclose(found, 1 - math.exp(-2.0 * 2 * half), rtol=5e-3)
        assert pickle.loads(pickle.dumps(inside[name])) == inside[name]


def test_a_camera_without_a_position_shows_the_medium() -> None:
    """Its corners and the solid's are in the picture, and fill it; a haze around a small solid is not framed."""
    cloud, haze = rm.Medium(1.0, BOUNDS), rm.Medium(0.01, ((-99.0, -99.0, -99.0), (99.0, 99.0, 99.0)))
    for node in (rm.sphere(0.3), rm.plane(offset=-2)):
        pose = rm.Scene(node, fog=cloud).pose(Values({}), 1.5)
        corners = np.array(list(itertools.product(*np.stack([LOW, HIGH]).T)))
        x, y, z = ((corners - pose.position) @ pose.frame).T
        reach = np.maximum(np.abs(x / z) / 1.5, np.abs(y / z)).max() / pose.tan_half_fov
        assert np.all(z < 0) and 0.6 < reach <= 1.0, (node, reach)
    alone = rm.Scene(rm.sphere(0.3)).pose(Values({}), 1.5)
    np.testing.assert_allclose(rm.Scene(rm.sphere(0.3), fog=haze).pose(Values({}), 1.5).position, alone.position)


@pytest.mark.parametrize(
    ("near", "far", "length"), [(4.5, None, 1.5), (4.5, 5.5, 1.0), (0.0, 5.0, 1.0), (7.0, 9.0, 0.0)]
)
@pytest.mark.parametrize("wall", [-50.0, -0.5])
def test_clip_planes_cut_it(near: float, far: float | None, length: float, wall: float) -> None:
    """Before a lit sky, or before a glowing wall in its middle, which the planes may hide."""
    glow = (
        rm.box((9, 9, 1)).translate((0, 0, wall - 0.5)).material(rm.Material((0, 0, 0), specular=0, emission=(1, 1, 1)))
    )
    given = scene(rm.Medium(0.7, BOUNDS, (0, 0, 0)), node=glow, sky=(1, 1, 1))
    shown = wall > -1.0 and near < 5.5 and (far is None or far > 5.5)
    length = 5.5 - near if shown else length
    found = middle(given.replace(camera=rm.Camera(tuple(EYE), (0, 0.2, 0), near=near, far=far)))
    np.testing.assert_allclose(found, math.exp(-0.7 * length), rtol=1e-4)
