"""Cases of scenes far away and long after the start, where float32 has no digits left."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

import raymarch as rm
from raymarch.expr.vocabulary import sin, vec3
from raymarch.plan import plan
from raymarch.scene import load
from tests.hard.world import ULP, Figure, World, bytes_off, case, view_of
from tests.support.analytic import angles, around, hit_sphere, points
from tests.support.cameras import camera_of

HELLO = Path(__file__).parents[2] / "examples" / "hello.py"


def displaced(scene: rm.Scene, by: tuple[float, float, float]) -> rm.Scene:
    """A scene moved with its camera and lights."""
    pose = scene.pose(rm.scene.parameter.Values({}))
    target = pose.position - pose.frame[:, 2]
    camera = rm.Camera(tuple(pose.position + by), tuple(target + by), fov=scene.camera.fov)
    lights = [_displaced(light, by) for light in scene.lights]
    return rm.Scene(scene.node.translate(by), camera, lights, scene.sky, scene.fog, scene.quality, scene.occlusion)


def _displaced(light: rm.scene.light.Light, by: tuple[float, float, float]) -> rm.scene.light.Light:
    if isinstance(light, rm.PointLight):
        return rm.PointLight(light.position + np.array(by), light.color, light.intensity, light.shadow)
    return light


@case(4, "far from the origin", before="hello at 1e6 was off by up to 144 of 255 steps, at 1e4 by 1")
def far_away(world: World) -> Iterator[Figure]:
    """Depths are wrong by 3e-3 at a distance of 1e5 from the origin, and by 0.45 at 1e7. A distant scene is rendered in
    coordinates relative to a point near its camera."""
    hello = load(HELLO)
    one = world.draw(hello, outputs=("color", "depth", "normal"))
    calm = ~_edges(one)
    for far in (1e4, 1e6, 1e7 / 3):
        two = world.draw(displaced(hello, (far, -far, 0.5 * far)), outputs=("color", "depth", "normal"))
        yield Figure(
            f"8-bit steps of hello at {far:.7g}, off edges", bytes_off(one, two, calm), 1, "float64, rounded once"
        )
        lost = int(np.sum(np.isfinite(one.depth)[calm] != np.isfinite(two.depth)[calm]))
        yield Figure(f"hits of hello at {far:.7g} lost or found, off edges", lost, 0, "the same scene")
    lamp = rm.PointLight((1, 2, 2), intensity=4, shadow=True)
    parts = (rm.box(1).rotate(0.4, (1, 2, 3)).scale(0.8) - rm.sphere(0.5)).material(rm.Material((0.8, 0.3, 0.1)))
    node = rm.union(parts, rm.torus(0.8, 0.2), k=0.2).shell(0.05) | rm.plane(offset=-0.7)
    mixed = rm.Scene(node, rm.Camera((2, 1.5, 3), (0, 0, 0)), [lamp])
    one, two = (world.draw(s, outputs=("color", "depth", "normal")) for s in (mixed, displaced(mixed, (1e6, 1e6, 1e6))))
    yield Figure(
        "8-bit steps of blends, planes and lights at 1e6", bytes_off(one, two, ~_edges(one)), 1, "float64, rounded once"
    )
    columns = rm.box((0.4, 2, 0.4)).repeat((1.5, None, 1.5))
    far = 1.5 * 700_000
    here = rm.Scene(columns, rm.Camera((0.75, 1.4, 0.75), (4, 0.6, 3)))
    there = rm.Scene(columns, rm.Camera((0.75 + far, 1.4, 0.75 - far), (4 + far, 0.6, 3 - far)))
    one, two = (world.draw(s, outputs=("color", "depth", "normal")) for s in (here, there))
    yield Figure(
        "8-bit steps of an endless grid at 1e6", bytes_off(one, two, ~_edges(one)), 1, "whole cells are left out"
    )
    image = rm.Scene(rm.sphere().translate((1e6, 0, 0)).mirror("x"), rm.Camera((1e6, 0, 4), (1e6, 0, 0)))
    warned = any("coordinates reach" in w for w in plan(image).warnings)
    yield Figure(
        "scenes that must stay far and are not warned of", not warned, 0, "2 ulp of the coordinates above epsilon"
    )
    told = any(f.name == "camera-relative" and f.used for f in plan(displaced(hello, (1e6, 0, 0))).features)
    quiet = not any(f.name == "camera-relative" and f.used for f in plan(hello).features)
    yield Figure("scenes with another origin without a report, or without need", 2 - told - quiet, 0, "explain says so")


def _edges(frame: rm.Frame) -> np.ndarray:
    """Pixels near a silhouette, a crease or the border of a shadow."""
    shown = np.asarray(frame.image(), int)
    edge = np.zeros(shown.shape[:2], bool)
    for axis in (0, 1):
        differs = np.abs(np.diff(shown, axis=axis)).max(axis=-1) > 24
        differs |= np.abs(np.diff(frame.normal, axis=axis)).max(axis=-1) > 0.5
        differs |= np.diff(np.isfinite(frame.depth), axis=axis) != 0
        edge |= np.pad(differs, [(0, 1), (0, 0)] if axis == 0 else [(0, 0), (0, 1)])
    return np.asarray(around(edge))


@case(5, "normals far away", before="5.6° at 1e3, 37° at 1e4 with a fixed step of 1e-4")
def far_normals(world: World) -> Iterator[Figure]:
    """Finite differences with a fixed step lose all digits far from the origin. The gradient is computed
    analytically."""
    for far in (1e3, 1e4, 1e6):
        centre = np.array([far, 0.5 * far, -far])
        view = view_of(tuple(centre + np.array((1, 0.7, 4))), tuple(centre), 35.0)
        scene = rm.Scene(rm.sphere().translate(tuple(centre)), camera_of(view), quality=rm.Quality.preset("exact"))
        frame = world.draw(scene, outputs=("depth", "normal"))
        t = hit_sphere(view.origin, view.directions, centre, 1.0)
        normal = points(view.origin, view.directions, t) - centre
        cosine = np.abs(np.sum(normal * view.directions, axis=-1))
        sure = np.isfinite(t) & np.isfinite(frame.depth) & (cosine > 0.1)
        turned = angles(frame.normal, normal)[sure]
        sideways = (0.002 * view.pixel * t + 16 * ULP * t)[sure] / cosine[sure]
        yield Figure(
            f"error of a normal at {far:g} over what the hit allows",
            float(np.max(turned / (sideways + 16 * ULP))),
            1,
            "epsilon / (cosine radius), rounding",
        )


@case(36, "a long time")
def long_time(world: World) -> Iterator[Figure]:
    """One ulp of float32 is 0.0078 s after a day, and 2 s after a year. Subexpressions that depend on time alone are
    computed in float64, and the phase of a wave is reduced modulo its period. Other products of time and position keep
    float32 precision."""
    turning = rm.Scene(rm.box((1, 0.6, 0.4)).rotate(rm.time * 2 * np.pi), rm.Camera((2, 1.5, 3), (0, 0, 0)))
    known = world.draw(turning, outputs=("color", "depth"), time=0.3)
    worst = 0
    for day in (1, 365):
        later = world.draw(turning, outputs=("color", "depth"), time=86400.0 * day + 0.3)
        inner = np.isfinite(known.depth) & np.isfinite(later.depth)
        worst = max(
            worst, int(np.sum(np.isfinite(known.depth) != np.isfinite(later.depth))), bytes_off(known, later, inner)
        )
    yield Figure("8-bit steps, or pixels of the silhouette, after a day and a year", worst, 1, "float64 leaves 4e-9 s")
    waves = rm.box(1.4).displace_by(lambda p: 0.03 * sin(6.0 * p.x + rm.time) * sin(6.0 * (p.y - rm.time)), 0.03, 0.26)
    rippled = rm.Scene(waves, rm.Camera((2, 1.5, 3), (0, 0, 0)))
    known, later = (world.draw(rippled, outputs=("color", "depth"), time=0.3 + 2 * np.pi * n) for n in (0, 5_000_000))
    inner = np.isfinite(known.depth) & np.isfinite(later.depth)
    yield Figure("8-bit steps of waves after a year", bytes_off(known, later, inner), 1, "float64 leaves 4e-9 s")
    pulse = 0.5 + 0.4 * sin(3.0 * rm.time)
    moving = rm.Material(
        lambda p: vec3(0.5 + 0.4 * sin(10.0 * p.x + rm.time), pulse, 0.5), emission=(0, 0, 0.2 * pulse)
    )
    lit = rm.Scene(
        rm.sphere().material(moving) | rm.plane(offset=-1).material(rm.Material((pulse, 0.5, 0.5))),
        rm.Camera((2, 1.5, 3), (0, 0, 0)),
        [rm.Sun((1, 2, 1), color=(1, pulse, 1)), rm.PointLight((2, 2, 2), intensity=3.0 * pulse)],
        sky=rm.Sky((pulse, 0.5, 0.5)),
        fog=rm.Fog((0.5, pulse, 0.5), 0.1 * pulse),
    )
    known, later = (world.draw(lit, outputs=("color",), time=0.3 + 2 * np.pi * n) for n in (0, 5_000_000))
    yield Figure(
        "8-bit steps of materials, lights, sky and fog after a year",
        bytes_off(known, later),
        1,
        "float64 leaves 4e-9 s",
    )
