"""Rows 13, 14, 15, 17, 18 and 22: lights with an area, the sun's cone, occlusion and furnaces, against quadrature."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

import raymarch as rm
from tests.lab.trials.rays import box
from tests.lab.trials.row import WHITE, Array, Figure, drawn, looking_down, pixels, quiet

BLACK = (0.0, 0.0, 0.0)
SIZE = (24, 24)


def ball_light(points: Array, centre: Any, radius: float, intensity: float) -> Array:
    """The light of a white floor at points (N, 3) beside a ball of light: that of its cone above the horizon."""
    found = []
    for way in np.asarray(centre) - points:
        far = np.linalg.norm(way)
        tangent = radius / math.sqrt(far**2 - radius**2)
        above = np.maximum(_cone(way / far, tangent, 1500)[:, 1], 0).mean()
        found.append(2 * (1 - 1 / math.hypot(1, tangent)) * above)
    return np.array(found) * intensity / radius**2


def rect_light(points: Array, centre: Any, width: float, height: float, intensity: float) -> Array:
    """That of a rectangle that shines down, by 64 x 64 of its points."""
    k = (np.arange(64) + 0.5) / 64 - 0.5
    x, z = (each.ravel() for each in np.meshgrid(k * width, k * height))
    way = np.asarray(centre) + np.stack([x, 0 * x, z], axis=1) - points[:, None]
    return np.asarray(intensity * (way[..., 1] ** 2 / (way**2).sum(-1) ** 2).mean(axis=1))


def _floor(
    lights: list[rm.Light], at: tuple[float, float] = (0, 0), wide: float = 1.0, up: float = 0.9, **more: Any
) -> Array:
    """The light of a white floor at y = 0, seen from above from below the lights: (24, 24)."""
    given = {"quality": rm.Quality(samples=64)} | more
    node = given.pop("node", rm.plane()).material(WHITE)
    scene = rm.Scene(node, looking_down(wide, (at[0], up, at[1])), lights=lights, sky=BLACK, **given)
    return np.asarray(drawn(scene, SIZE).color[..., 0], float)


def _points(at: tuple[float, float], wide: float) -> Array:
    x, z = pixels(wide, SIZE, at)
    return np.stack([x, 0 * x, z], axis=-1).reshape(-1, 3)


def shown_lights() -> Iterator[Figure]:
    """Lights that are shown: the floor's light, once, with bounces, and with each penumbra."""
    ball = rm.SphereLight((0, 1.5, 0), 0.3, intensity=2, shadow=True, visible=True)
    rect = rm.RectLight((0, 1.5, 0), 0.6, 0.6, intensity=1, shadow=True, visible=True)
    at, wide = (0.9, 0.2), 0.4
    points = _points(at, wide)
    wanted = {
        "ball": (2 * 1.5 / (points[:, 0] ** 2 + points[:, 2] ** 2 + 1.5**2) ** 1.5).mean(),
        "rectangle": rect_light(points, (0, 1.5, 0), 0.6, 0.6, 1.0).mean(),
    }
    worst, which = 0.0, ""
    for name, light in (("ball", ball), ("rectangle", rect)):
        for bounces in (0, 1, 3):
            for penumbra in ("two-sided", "sampled") if name == "ball" else ("sampled",):
                with quiet():
                    seen = light.replace(penumbra=penumbra) if name == "ball" else light
                found = _floor([seen], at, wide, bounces=bounces).mean() / wanted[name] - 1
                if abs(found) > worst:
                    worst, which = abs(found), f"{name}, {penumbra}, {bounces} bounces"
    yield Figure(f"floor below a light that is shown: relative error, worst {which}", ".015 for .533; x 2", worst, 0.01)
    mirror = rm.Material(albedo=(1, 1, 1), metalness=1.0, roughness=0.0)
    node = rm.box((2, 2, 0.1)).translate((0, 1, -1)).material(mirror)
    camera = rm.Camera((0, 1.5, 3), (0, 1.5, -0.95), fov=1)
    light = ball.replace(position=(0, 1.5, 4))
    scene = rm.Scene(node, camera, [light], sky=BLACK, bounces=1, quality=rm.Quality(samples=16))
    value = float(drawn(scene, (8, 8)).color[..., 0].mean())
    yield Figure("a light in a mirror over its radiance", "-", abs(value / (2 / 0.09) - 1), 0.01)


def _cone(towards: Array, tangent: float, count: int) -> Array:
    """Directions spread evenly over the solid angle of a cone."""
    k = np.arange(count) + 0.5
    cosine = 1 - k / count * (1 - 1 / math.hypot(1, tangent))
    sine, a = np.sqrt(1 - cosine**2), 2.399963 * k
    side = np.cross(towards, (0.3, 0.1, 0.9))
    side /= np.linalg.norm(side)
    return sine[:, None] * (np.cos(a)[:, None] * side + np.sin(a)[:, None] * np.cross(towards, side)) + cosine[
        :, None
    ] * np.asarray(towards)


def suns() -> Iterator[Figure]:
    """The sun's softness is the tangent of its angular radius in all methods: behind the edge of a thick wall."""
    wall = rm.box((20, 4, 40)).translate((-10, 3, 0)).visible(camera=False)
    judge = box((20, 4, 40), (-10, 3, 0))
    errors: dict[str, float] = {"sampled": 0.0, "two-sided": 0.0}
    for softness in (0.05, 0.3, 1.0):
        rays = _cone(np.array((0.0, 1.0, 0.0)), softness, 4000)
        wide = 4 * softness
        line = _points((0, 0), wide)[: SIZE[0]] * (1, 1, 0)
        free = [judge(np.broadcast_to(p, rays.shape), rays)[1] < 0 for p in line]
        right = np.array([np.average(each, weights=rays[:, 1]) for each in free])
        for method in errors:
            sun = rm.Sun((0, 1, 0), shadow=True, softness=softness, penumbra=method)
            given: dict[str, Any] = {
                "quality": rm.Quality(samples=64, light_samples=16) if method == "sampled" else rm.Quality()
            }
            found = _floor([sun], (0, 0), wide, node=rm.plane() | wall, **given).mean(axis=0)
            whole = _floor([sun.replace(shadow=False)], (0, 0), wide, quality=rm.Quality()).mean()
            errors[method] = max(errors[method], float(np.abs(found / whole - right).max()))
    yield Figure("edge of a wall under a sun of softness .05, .3, 1: sampled", ".798 for .956", errors["sampled"], 0.02)
    yield Figure("the same, two-sided", "-", errors["two-sided"], 0.07)


def written_otherwise() -> Iterator[Figure]:
    """Convex solids whose fields are no distances: nothing occludes their top, and nothing hides the light from it."""
    tops = {
        "box": (rm.box(), 1.0, 0.6),
        "box sheared and back": (rm.box().shear(0.7).shear(-0.7), 1.0, 0.6),
        "box.twist(2)": (rm.box(1).twist(2), 0.5, 0.4),
        "box.displace(1e-3, 500)": (rm.box().displace(1e-3, 500), 1.0, 0.6),
        "sphere.scale((3, .5, .5))": (rm.sphere().scale((3, 0.5, 0.5)), 0.5, 0.3),
        "box.scale((4, .2, 1))": (rm.box().scale((4, 0.2, 1)), 0.2, 0.6),
        "box.taper(.3)": (rm.box().taper(0.3), 1.0, 0.6),
        "box.bend(.4)": (rm.box((0.2, 1, 1)).bend(0.4), 0.5, 0.05),
        "turned and scaled": (rm.box().rotate(math.pi / 2, "x").scale((1, 1, 4)), 1.0, 0.6),
        "in a union": (rm.sphere().scale((3, 0.5, 0.5)) | rm.box(1).translate((9, 0, 0)), 0.5, 0.3),
        "mirrored": (rm.sphere().scale((3, 0.5, 0.5)).translate((2, 0, 0)).mirror("x").translate((-2, 0, 0)), 0.5, 0.3),
    }
    lost, which, undoubted, dark = 0.0, "", 0.0, ""
    for name, (node, _, wide) in tops.items():
        scene = rm.Scene(
            node.material(rm.Material((1, 1, 1), specular=0.0)),
            looking_down(wide),
            lights=[],
            sky=rm.Sky((1, 1, 1), light=True),
        )
        free = drawn(scene, (12, 12)).color[..., 0]
        frame = drawn(scene.replace(occlusion=rm.AmbientOcclusion(reach=0.5)), (12, 12))
        now = float(1 - (frame.color[..., 0] / free).mean())
        if now > lost:
            lost, which = now, name
        if not frame.doubts() and now > undoubted:
            undoubted, dark = now, name
    yield Figure(f"occlusion of the free tops of 11 solids, worst {which}", "0 for .618", lost, 0.2)
    yield Figure(f"the same, without a doubt, worst {dark}", "-", undoubted, 0.06)


def cutting_lights() -> Iterator[Figure]:
    """Balls of light that cut the floor: its mean light beside the ball."""
    worst, which = 0.0, ""
    for lift, radius in ((0.0, 0.5), (0.3, 0.5), (0.1, 2.0), (-0.3, 0.5), (0.5, 0.5)):
        reach = math.sqrt(max(radius**2 - lift**2, 0)) + 0.05
        at, wide = (reach + 0.5, 0.0), 0.9
        points = _points(at, wide)
        points = points[np.hypot(points[:, 0], points[:, 2]) > reach]
        wanted = ball_light(points, (0, lift, 0), radius, 1.0)
        for shadow, penumbra in ((False, "two-sided"), (True, "two-sided"), (True, "sampled")):
            light = rm.SphereLight((0, lift, 0), radius, shadow=shadow, penumbra=penumbra)
            found = _floor([light], at, wide).ravel()
            x, z = pixels(wide, SIZE, at)
            found = found[np.hypot(x, z).ravel() > reach]
            off = float(abs(found.mean() / wanted.mean() - 1))
            if off > worst:
                worst, which = off, f"y = {lift}, R = {radius}, {penumbra if shadow else 'no shadow'}"
    yield Figure(f"floor beside lights that cut it: relative error, worst {which}", "+182 %, -100 %", worst, 0.03)


def touching_lights() -> Iterator[Figure]:
    """Lights flush with a face: a rectangle and a point below a box, 1e-4 below it, and far from the origin."""
    worst, which = 0.0, ""
    points = _points((0.2, 0), 1.0)
    for below in (0.0, 1e-4, 1e-2):
        for name in ("rectangle", "point"):
            y = 1.0 - below
            if name == "rectangle":
                light: rm.Light = rm.RectLight((0, y, 0), 0.6, 0.4, intensity=0.3, shadow=True)
                wanted = rect_light(points, (0, y, 0), 0.6, 0.4, 0.3).mean()
            else:
                light = rm.PointLight((0, y, 0), intensity=0.3, shadow=True)
                wanted = (0.3 * y / ((points - (0, y, 0)) ** 2).sum(axis=1) ** 1.5).mean()
            for far in (0.0, 1000.0):
                lid = rm.box((3, 0.2, 3)).translate((0, 1.1, 0)) | rm.plane()
                moved = light.replace(position=(far, y, 0))
                found = _floor([moved], (0.2 + far, 0), node=lid.translate((far, 0, 0))).mean()
                off = abs(found / wanted - 1)
                if off > worst:
                    worst, which = float(off), f"{name}, {below:g} below, at {far:g}"
    yield Figure(
        f"lights flush with a face: relative error, worst {which}", ".060 for .161, .057 for .183", worst, 0.02
    )


def furnaces() -> Iterator[Figure]:
    """White furnaces of materials, integrators and roughness at 60 to 89 degrees: no light is gained."""
    gained, which = 0.0, ""
    rough, angle = rm.Param("rough", 0.14, 0.0, 1.0), rm.Param("angle", 1.0, 0.0, 1.6)
    materials = {
        "dielectric": rm.Material(albedo=(1, 1, 1), roughness=rough),
        "metal": rm.Material(albedo=(1, 1, 1), metalness=1.0, roughness=rough),
        "coat": rm.Material(albedo=(1, 1, 1), roughness=0.8, clearcoat=1.0, clearcoat_roughness=rough),
        "coat on metal": rm.Material(albedo=(1, 1, 1), metalness=1.0, roughness=rough, clearcoat=1.0),
        "bright f0": rm.Material(albedo=(1, 1, 1), f0=0.5, roughness=rough),
    }
    camera = rm.Camera((5 * rm.sin(angle), 5 * rm.cos(angle), 0), (0, 0, 0), fov=0.1)
    with quiet(), rm.Renderer((6, 6)) as renderer:
        for name, material in materials.items():
            for integrator in ("whitted", "path"):
                samples = 1 if integrator == "whitted" else 64
                quality = rm.Quality(integrator=integrator, samples=samples)
                scene = rm.Scene(
                    rm.plane().material(material),
                    camera,
                    [],
                    sky=rm.Sky((1, 1, 1), light=True),
                    bounces=2,
                    quality=quality,
                )
                for degrees in (60, 80, 88, 89):
                    for value in (0.02, 0.1, 0.12, 0.14, 0.18, 0.3, 0.7):
                        params = {"rough": value, "angle": math.radians(degrees)}
                        color = renderer.render(scene, params=params).color[..., 0]
                        noise = 0.0 if integrator == "whitted" else 3 * float(color.std()) / 6
                        found = float(color.mean()) - noise - 1
                        if found > gained:
                            gained, which = found, f"{name}, {integrator}, roughness {value}, {degrees} degrees"
    yield Figure(f"light gained in furnaces, most {which}", ".051", gained, 0.003)
