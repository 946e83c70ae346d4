"""Cases of sizes that float32 cannot hold, and of values that a frame takes out of their range."""

from __future__ import annotations

import tempfile
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

import raymarch as rm
from raymarch.errors import RaymarchError
from raymarch.expr.node import Expr
from raymarch.plan import plan
from raymarch.scene.legal import violations
from raymarch.scene.parameter import Values
from tests.hard.world import Figure, World, case, refusals

UNIT = 2.0**40
"""A power of two, so that a scene in this unit is the same numbers with another exponent."""


def _scenes(s: float) -> list[rm.Scene]:
    """The same scenes in units of s: hard and soft shadows, blends, bounces, lights, a Param, a grid, patterns."""
    axis = np.linspace(-1.0, 1.0, 24)
    x, y, z = np.meshgrid(axis, axis, axis, indexing="ij")
    camera = rm.Camera((1.0 * s, 0.8 * s, 2.0 * s), (0, 0, 0))
    floor = rm.plane(offset=-0.5 * s)
    blend = rm.union(rm.box((s, s, s)), rm.torus(0.8 * s, 0.2 * s), k=0.2 * s)
    lamp = rm.PointLight((s, 2.0 * s, s), intensity=4.0 * s * s, shadow=True)
    soft = [rm.Sun(shadow=True, softness=0.1)]
    area = {"intensity": 4.0 * s * s, "range": 9.0 * s, "shadow": True}
    wide = [rm.SphereLight((s, 2.0 * s, s), 0.2 * s, **area), rm.RectLight((-s, 2.0 * s, s), s, s, **area)]
    tiles = rm.Material(rm.checker((0.9, 0.5, 0.3), (0.2, 0.2, 0.6), 0.3 * s, axis="y"))
    picture = np.linspace(0.2, 0.8, 48).reshape(4, 4, 3)
    waves = rm.Material(rm.planar(picture, s, "x"), height=lambda p: rm.sin(6.0 * p.x / s), height_scale=0.05 * s)
    bumps = rm.Material(rm.noise("red", "blue", 0.2), height=lambda p: rm.sin(6.0 * p.x), height_scale=0.05)
    ambient = {"sky": rm.Sky((0.4, 0.5, 0.7), light=True), "occlusion": rm.AmbientOcclusion(3, 0.3 * s)}
    return [
        rm.Scene(rm.sphere(s)),
        rm.Scene(blend, lights=[rm.Sun(shadow=True)]),
        rm.Scene(rm.sphere(0.5 * s) | floor, camera, soft, bounces=2, quality=rm.Quality(samples=2)),
        rm.Scene(rm.cylinder(0.5 * s, s) | floor, camera, [lamp]),
        rm.Scene(rm.sphere(rm.Param("radius", s, 0.5 * s, 2.0 * s))),
        rm.Scene(rm.grid((np.sqrt(x * x + y * y + z * z) - 0.8) * s, size=2.0 * s)),
        rm.Scene((rm.box((s, s, s)) - rm.sphere(0.6 * s)).shell(0.02 * s).rotate(0.5, (1, 2, 3))),
        rm.Scene(rm.sphere(0.5 * s).material(waves) | floor.material(tiles), camera, wide, **ambient),
        rm.Scene(rm.box((1, 1, 1)).material(bumps).scale(s), camera, [rm.Sun()]),
    ]


def _cube(folder: Path, edge: float) -> rm.Node:
    """A mesh of a cube, read from a file."""
    import trimesh

    corners = [[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]
    solid = trimesh.Trimesh(corners, process=False).convex_hull
    file = folder / f"cube {edge:g}.obj"
    rows = [f"v {' '.join(repr(float(edge * c)) for c in corner)}" for corner in solid.vertices]
    rows += [f"f {' '.join(str(int(i) + 1) for i in face)}" for face in solid.faces]
    file.write_text("\n".join(rows))
    return rm.mesh(file, resolution=12, cache=folder)


def _differ(world: World, one: rm.Scene, two: rm.Scene, unit: float) -> int:
    """Pixels in which a scene in another unit differs in its colour by more than a step of 8 bits, or in its depth."""
    first, second = (world.draw(scene, outputs=("color", "depth")) for scene in (one, two))
    apart = np.abs(np.asarray(first.image(), int) - np.asarray(second.image(), int)).max(axis=-1) > 1
    hit = np.isfinite(first.depth)
    depth = np.where(hit, first.depth, 0.0).astype(np.float64) * unit
    off = np.abs(np.where(hit, second.depth, 0.0) - depth) > 1e-5 * depth
    return int(np.sum(apart | (hit != np.isfinite(second.depth)) | off))


@case(70, "extreme sizes", before="empty skies at 1e20, 1e30 and 1e-30, stray dots for a mesh of 1e-6; exit code 0")
def extreme_sizes(world: World) -> Iterator[Figure]:
    """In float32 the square of 1e20 is infinite and that of 1e-30 is 0. Scenes from 1e-12 to 1e12 units render as in
    any other unit. Scenes beyond the range of float32 are refused, and so are scenes whose field or normals lose all
    digits in front of the camera, such as a ball of radius 1e9 at a distance of 1."""
    home = _scenes(1.0)
    for unit in (UNIT, 1.0 / UNIT):
        differ = sum(_differ(world, *pair, unit) for pair in zip(home, _scenes(unit), strict=True))
        yield Figure(f"pixels of {len(home)} scenes that differ in units of {unit:.2g}", differ, 0, "exponents only")
    with tempfile.TemporaryDirectory() as folder:
        at = Path(folder)
        one = rm.Scene(_cube(at, 1.0))
        for edge in (2.0**-20, 2.0**-40, 2.0**40):
            other = rm.Scene(_cube(at, edge))
            yield Figure(f"pixels of a mesh of {edge:.2g} that differ", _differ(world, one, other, edge), 0, "the same")
            apart = max(
                np.abs(np.subtract(getattr(other.node.facts, end) / edge, getattr(one.node.facts, end))).max()
                for end in ("lower", "upper")
            )
            yield Figure(
                f"edges by which the box of a mesh of {edge:.2g} is displaced", apart, 0, "powers of 2 are exact"
            )

    def refused(node: rm.Node, camera: rm.Camera | None = None) -> Callable[[], Any]:
        return lambda: plan(rm.Scene(node, camera))

    far, near = ("1e-15 to 1e+15", "float32"), ("float32", "nearest surface")
    yield refusals(
        *((refused(rm.sphere(size)), far) for size in (1e20, 1e30, 1e-30)),
        (refused(rm.sphere(rm.Param("radius", 1e20, 1e19, 1e21))), far),
        (refused(rm.box((1e20, 1e20, 1e20)).repeat((3e20, None, None))), far),
        (refused(rm.plane(offset=1e20), rm.Camera((0, 0, 0), (0, 0, -1))), far),
        (refused(rm.sphere(1e9).translate((0, -1e9, 0)), rm.Camera((0, 1, 0), (3, 0, 0))), near),
        what="scenes that are not refused with their reason",
    )
    small = [rm.Scene(rm.sphere() | rm.sphere(1e-30).translate((2, 0, 0))), rm.Scene(rm.plane())]
    wrong = sum(_is_refused(scene) for scene in [*small, rm.Scene(rm.sphere(rm.Param("radius", 1, 1e-30, 1e3)))])
    yield Figure("scenes with something tiny or endless in them that are refused", wrong, 0, "the rest can be drawn")


def _is_refused(scene: rm.Scene) -> bool:
    try:
        plan(scene)
    except RaymarchError:
        return True
    return False


_HERE = "rows_extremes.py:"
D = rm.Param("d", (0.0, 1.0, 0.0), -1, 1)
A = rm.Param("a", 0.5, 0, 2)


def _over(a: Any, t: Any) -> Any:
    """A quotient that may be infinite, also of plain numbers."""
    return a / t if isinstance(t, Expr) else np.divide(float(a), t).item()


def _values(t: Any, d: Any, a: Any) -> list[Callable[[], Any]]:
    """Scenes of one value each that depends on time or a Param, or on what they are at one moment."""
    ball = rm.sphere()
    return [
        lambda: rm.Scene(rm.sphere(1 + 0.1 * t)),
        lambda: rm.Scene(rm.box((1, 1 + t, 1))),
        lambda: rm.Scene(rm.torus(1, 0.5 + 0.1 * t)),
        lambda: rm.Scene(rm.sphere().translate((_over(1, t), 0, 0))),
        lambda: rm.Scene(ball, lights=[rm.PointLight((0, _over(a, t), 0))]),
        lambda: rm.Scene(rm.plane(d)),
        lambda: rm.Scene(ball.rotate(1, d)),
        lambda: rm.Scene(rm.union(ball, rm.box(1), k=0.2 - 0.1 * t)),
        lambda: rm.Scene(ball, lights=[rm.Sun(d)]),
        lambda: rm.Scene(ball, lights=[rm.Sun(intensity=t)]),
        lambda: rm.Scene(ball, lights=[rm.PointLight((0, 2, 0), range=2 - t)]),
        lambda: rm.Scene(ball, lights=[rm.SpotLight((0, 2, 0), d, half_angle=0.5 + 0.1 * t)]),
        lambda: rm.Scene(ball, lights=[rm.PointLight((0, 2, 0), attenuation=(0 * t + a, a, a))]),
        lambda: rm.Scene(ball, lights=[rm.SphereLight((0, 3, 0), 1 + 0.5 * t)]),
        lambda: rm.Scene(ball.material(rm.Material((a, 0.5, 0.5)))),
        lambda: rm.Scene(ball.material(rm.Material(albedo=(1, 1, 1), roughness=0.5 + 0.1 * t))),
        lambda: rm.Scene(ball.material(rm.Material(rm.checker((1, 0, 0), (0, 1, 0), size=t)))),
        lambda: rm.Scene(ball.material(rm.Material(height=lambda p: p.x, height_scale=500 * t))),
        lambda: rm.Scene(ball, fog=rm.Fog(density=0.1 * t)),
        lambda: rm.Scene(ball, sky=rm.Sky((a, 1 + t, 1))),
        lambda: rm.Scene(ball, sky=rm.SunSky(d, turbidity=4 + t)),
        lambda: rm.Scene(ball, sky=rm.GradientSky(zenith=(a, a, t))),
        lambda: rm.Scene(ball, occlusion=rm.AmbientOcclusion(strength=1 + t, reach=a)),
    ]


@case(71, "values out of range at run time", before="an empty sky, or ambient light only, exit code 0")
def run_time_values(world: World) -> Iterator[Figure]:
    """Time may make a radius negative, and a parameter may make the direction of a sun 0. Numbers are refused where
    they are written. Values that depend on time or a parameter are checked by the same rules in each frame, and the
    frame names the value that is out of range. With `strict`, no picture is made."""
    others = (((0, 1, 0), 0.5), ((0, 0, 0), 0.0), ((1, 0, 1), 1.5))
    moments = [(t, d, a) for t in (-50.0, -1.0, 0.0, 0.5, 3.0) for d, a in others]
    silent = loud = unnamed = 0
    moving = [plan(make()).conditions for make in _values(rm.time, D, A)]
    for t, d, a in moments:
        for scene, fixed in zip(moving, _values(t, d, a), strict=True):
            said = violations(scene, Values({"d": d, "a": a}, t))
            with np.errstate(all="ignore"):
                reason = _refusal(fixed)
            silent += bool(reason) and not said
            loud += bool(said) and not reason
            named = any(f" {reason} = " in line and _HERE in line and line.endswith(")") for line in said)
            unnamed += bool(reason and said) and not named
    count = len(moving) * len(moments)
    yield Figure(
        f"frames of {count} without a warning about a value that is refused as a number", silent, 0, "the same rules"
    )
    yield Figure(f"frames of {count} with a warning about a value that is legal as a number", loud, 0, "the same rules")
    yield Figure("warnings that do not name the value, its range and the line", unnamed, 0, "needed to find the value")
    scene = rm.Scene(rm.sphere(1 + 0.1 * rm.time))
    with rm.Renderer((16, 12), context=world.context, strict=True) as strict:
        kept = 0
        for time, illegal in ((-50.0, True), (0.0, False)):
            try:
                strict.render(scene, time=time)
            except rm.RenderError:
                kept += not illegal
            else:
                kept += illegal
    yield Figure("pictures of a strict renderer that should not be, or lack", kept, 0, "strict")
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        world.draw(scene, outputs=("color",), time=-50.0)
        world.draw(scene, outputs=("color",), time=0.0)
    here = [w for w in heard if w.category is rm.RenderWarning and "radius" in str(w.message)]
    yield Figure("warnings too few or too many", abs(len(here) - 1), 0, "one frame of two is illegal")


def _refusal(make: Callable[[], Any]) -> str:
    """The name of the parameter whose number is refused; empty if none is."""
    try:
        make()
    except RaymarchError as error:
        return error.what.partition(" = ")[0].rpartition(" ")[2]
    return ""
