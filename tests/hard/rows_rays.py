"""Cases of rays: where marching is hard."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

import raymarch as rm
from raymarch.expr.vocabulary import length, where
from raymarch.plan import plan
from raymarch.scene.quality import CONTACT, TRACERS
from raymarch.sdf.definition import REGISTRY, cube
from raymarch.sdf.domain import Positive
from tests.hard.referee import Referee
from tests.hard.world import EPSILON, ULP, Figure, World, bytes_off, case, off, steepest, view_of
from tests.lab.fuzz import scene_of
from tests.support.analytic import angles, around, hit_plane, hit_sphere, points
from tests.support.cameras import camera_of

RED, BLUE = rm.Material((0.9, 0.1, 0.1)), rm.Material((0.1, 0.1, 0.9))
REAL = [name for name in TRACERS if name != "auto"]


@case(1, "thin shell")
def thin_shell(world: World) -> Iterator[Figure]:
    """A step that is too long by a fifth skips a shell of thickness 0.001, and most rays hit its far side."""
    node = rm.sphere(1.0).shell(0.002)
    outer = float(-node.bounds[0][0])
    view = view_of((0.5, 0.8, 3.5), (0, 0, 0))
    t = hit_sphere(view.origin, view.directions, (0, 0, 0), outer)
    normal = points(view.origin, view.directions, t)
    cosine = np.sum(normal * view.directions, axis=-1) / outer
    sure = np.isfinite(t) & (np.abs(cosine) > 0.05)
    holes, worst = 0, 0.0
    for tracer in REAL:
        frame = world.draw(rm.Scene(node, camera_of(view), quality=rm.Quality(tracer=tracer)))
        holes += int(np.sum(sure & ~np.isfinite(frame.depth)))
        worst = max(worst, off(frame.depth, view, t, cosine, sure & np.isfinite(frame.depth)))
    yield Figure("rays that miss, of all tracers", holes, 0, "a safe step passes nothing")
    yield Figure("largest error of a depth, in epsilons along the ray", worst, 1, "epsilon / cosine")


@case(2, "grazing plane")
def grazing(world: World) -> Iterator[Figure]:
    """A plain march towards a plane takes 49 steps at 10 degrees, 524 at 1 degree and 5,273 at 0.1 degrees."""
    node = rm.plane() | rm.sphere().translate((0, 30, 60))
    for degrees, most in ((10.0, 0.0), (1.0, 0.0)):
        view = view_of((0, 1, 0), (0, 1 - np.tan(np.radians(degrees)), -1), degrees / 2)
        frame = world.draw(rm.Scene(node, camera_of(view)), outputs=("depth", "iterations"))
        yield Figure(
            f"share of rays that run out of steps at {degrees:g}°",
            float(np.mean(frame.iterations >= 512)),
            most,
            "512 steps are enough",
        )
        t = hit_plane(view.origin, view.directions, 0.0)
        yield Figure(
            f"largest error of a depth at {degrees:g}°, in epsilons along the ray",
            off(frame.depth, view, t, view.directions[..., 1], np.isfinite(t)),
            1,
            "epsilon / cosine",
        )
    view = view_of((0, 1, 0), (0, 1 - np.tan(np.radians(0.1)), -1), 4.0)
    frame = world.draw(rm.Scene(node, camera_of(view)), outputs=("depth", "iterations"))
    down = view.directions[..., 1] < 0
    yield Figure(
        "holes at 0.1°", int(np.sum(~np.isfinite(frame.depth)[down])), 0, "the nearest sample is within a pixel"
    )
    view = view_of((0, 1, 0), (0, 1 - np.tan(np.radians(0.1)), -1), 0.08)
    frame = world.draw(rm.Scene(node, camera_of(view), quality=rm.Quality(max_steps=8192)), outputs=("depth",))
    t = hit_plane(view.origin, view.directions, 0.0)
    worst = off(frame.depth, view, t, view.directions[..., 1], np.isfinite(t))
    yield Figure("largest error at 0.1° with 8,192 steps, in epsilons along the ray", worst, 1, "epsilon / cosine")


@case(3, "tangent miss")
def tangent(world: World) -> Iterator[Figure]:
    """The number of steps grows with 1/sqrt(gap) along a ray that just misses; the silhouette must neither grow nor
    shrink."""
    position = np.array([0.3, 0.2, 6.0])
    ahead = -position / np.linalg.norm(position)
    edge = np.cross(ahead, (0, 1, 0))
    edge /= np.linalg.norm(edge)
    limb = 1 / np.sqrt(1 - 1 / float(position @ position))  # in the plane of the centre
    wrong = ran_out = 0
    for fov in (2.0, 0.1):
        view = view_of(tuple(position), tuple(edge * limb), fov)
        along = -np.sum(view.directions * view.origin, axis=-1)
        passing = np.linalg.norm(view.origin + along[..., None] * view.directions, axis=-1) - 1
        allowed = CONTACT * EPSILON * view.pixel * along + 4 * ULP * 6
        frame = world.draw(rm.Scene(rm.sphere(), camera_of(view)), outputs=("depth", "iterations"))
        hit = np.isfinite(frame.depth)
        wrong += int(np.sum((hit & (passing > allowed)) | (~hit & (passing < -allowed))))
        ran_out += int(np.sum(frame.iterations >= 512))
    yield Figure(
        "rays on the wrong side of the silhouette by more than a contact", wrong, 0, "a sixteenth of epsilon, and 4 ulp"
    )
    yield Figure("rays that run out of steps", ran_out, 0, "512 steps are enough")


@case(6, "coplanar materials")
def coplanar(world: World) -> Iterator[Figure]:
    """Two surfaces in one plane flicker if rounding decides between them. Ties are resolved in the same manner
    everywhere."""
    red, blue = rm.box((2, 1, 2)).material(RED), rm.box((1, 1, 3)).material(BLUE)
    view = view_of((0.4, 4, 1.5), (0, 0, 0))
    scenes = [
        rm.Scene(rm.union(*pair), camera_of(view), lights=[rm.Sun((0, 1, 0))]) for pair in ((red, blue), (blue, red))
    ]
    kinds = []
    for scene in scenes:
        frame = world.draw(scene, outputs=("depth", "material", "normal"))
        at = points(view.origin, view.directions, np.where(np.isfinite(frame.depth), frame.depth, 0).astype(np.float64))
        shared = (
            np.isfinite(frame.depth)
            & (np.abs(at[..., 0]) < 0.48)
            & (np.abs(at[..., 2]) < 0.98)
            & (frame.normal[..., 1] > 0.9)
        )
        kinds.append(len(np.unique(frame.material[shared])))
    yield Figure("further materials visible on the shared face", max(kinds) - 1, 0, "ties are resolved in one manner")
    first = world.draw(scenes[0], outputs=("color",))
    again = world.draw(scenes[0], outputs=("color",))
    yield Figure("8-bit steps between two frames", bytes_off(first, again), 0, "the same text and numbers")


@case(7, "a shape united with itself")
def self_union(world: World) -> Iterator[Figure]:
    """Two equal distances are a tie at every point."""
    node = rm.box(1) - rm.sphere(0.65)
    one = world.draw(rm.Scene(node), outputs=("color", "depth"))
    for name, other in (("|", node | node), ("&", node & node), ("union of 3", rm.union(node, node, node))):
        two = world.draw(rm.Scene(other), outputs=("color", "depth"))
        yield Figure(
            f"pixels that {name} changes",
            int(np.sum(one.color != two.color) + np.sum(one.depth != two.depth)),
            0,
            "equal subtrees are one",
        )


@case(23, "displacement")
def displacement(world: World) -> Iterator[Figure]:
    """Displacement increases the slope of the field, so that rays skip surfaces. Its slope is added to the Lipschitz
    bound."""
    node = rm.sphere().displace(0.05, 12.0)
    yield Figure("slope over its promise", steepest(node), 1 + 1e-9, "1-Lipschitz")
    scene = rm.Scene(node, rm.Camera((0.3, 0.4, 3.2), (0, 0, 0)))
    frame, known = world.draw(scene, outputs=("depth",)), rm.truth(scene, (64, 48), outputs=("depth",))
    inner = known.hit & ~around(~known.hit)
    yield Figure("holes", int(np.sum(inner & ~np.isfinite(frame.depth))), 0, "a safe step passes nothing")
    both = inner & np.isfinite(frame.depth)
    past = frame.depth[both] - known.depth[both]
    pixel = 2 * np.tan(np.radians(22.5)) / 48
    yield Figure(
        "pixels behind the first surface by a pixel's width",
        int(np.sum(past > pixel * 3.2)),
        0,
        "nothing is stepped over",
    )


@case(27, "camera inside a solid")
def camera_inside(world: World) -> Iterator[Figure]:
    """The field is negative at the camera. By definition, the inner wall is visible."""
    holes, worst = 0, 0.0
    for axis in range(3):
        for sign in (-1.0, 1.0):
            target = np.zeros(3)
            target[axis] = sign
            view = view_of(
                (0.1, -0.2, 0.15),
                tuple(np.add((0.1, -0.2, 0.15), target)),
                90.0,
                up=(0, 1, 0) if axis != 1 else (0, 0, 1),
            )
            frame = world.draw(rm.Scene(rm.box((2, 3, 4)), camera_of(view)), outputs=("depth", "normal"))
            d, half = view.directions, np.array([1.0, 1.5, 2.0])
            ways = (np.where(d > 0, half, -half) - view.origin) / d
            t = ways.min(axis=-1)
            cosine = np.abs(np.take_along_axis(d, ways.argmin(axis=-1)[..., None], -1)[..., 0])
            holes += int(np.sum(~np.isfinite(frame.depth)))
            worst = max(worst, off(frame.depth, view, t, cosine, np.isfinite(frame.depth)))
    yield Figure("holes in six views", holes, 0, "a closed wall all around")
    yield Figure("largest error of a depth, in epsilons along the ray", worst, 1, "epsilon / cosine")


@case(28, "fractal without bail-out")
def fractals(world: World) -> Iterator[Figure]:
    """The derivative of the eighth power overflows in the third iteration. Loops are bounded and stop when values grow
    too large."""
    from raymarch.expr.glsl import print_functions
    from raymarch.expr.types import VEC3
    from raymarch.sdf.evaluation import lower
    from tests.support.glsl_harness import run

    random = np.random.default_rng(7)
    near = random.uniform(-2, 2, (2000, 3))
    everywhere = np.concatenate([near, near * 1e3, near * 1e-6, np.zeros((1, 3)), np.eye(3), near * 1e8])
    bad = 0
    for node in (rm.mandelbulb(), rm.julia(), rm.mandelbox(), rm.apollonian(), rm.menger(), rm.sierpinski()):
        assert print_functions([lower(node)])
        bad += int(np.sum(~np.isfinite(run(world.context, node.glsl(), "field({0})", [(VEC3, everywhere)]))))
    yield Figure("values that are not finite, of 6 fractals, out to 2e8", bad, 0, "bail-out and floors")


@case(35, "tiny or huge units")
def units(world: World) -> Iterator[Figure]:
    """length() of a vector of size 1e-23 is 0, and of size 3e19 infinite. No constant in the shader is a length, so the
    unit of length does not matter."""

    def sized(s: float) -> rm.Scene:
        node = (rm.box(s).round(0.1 * s) | rm.torus(s, 0.2 * s).translate((0.2 * s, 0, 0))) - rm.sphere(0.6 * s)
        lights = [rm.Sun(shadow=True), rm.PointLight((s, 3 * s, 2 * s), intensity=4 * s * s)]
        return rm.Scene(node, rm.Camera((s, 1.5 * s, 4 * s), (0, 0, 0)), lights)

    one = world.draw(sized(1.0), outputs=("color", "evaluations", "material", "depth"))
    for s in (1e-6, 1e6):
        other = world.draw(sized(s), outputs=("color", "evaluations", "material", "depth"))
        shown = np.asarray(one.image(), int)
        flat = ~around(
            around(
                np.pad(np.abs(np.diff(shown, axis=1)).max(-1) > 24, [(0, 0), (0, 1)])
                | np.pad(np.abs(np.diff(shown, axis=0)).max(-1) > 24, [(0, 1), (0, 0)])
            )
        )
        yield Figure(
            f"8-bit steps off edges at a scale of {s:g}", bytes_off(one, other, flat), 1, "rounding of the sizes alone"
        )
    exact = world.draw(sized(2.0**20), outputs=("evaluations", "depth"))
    yield Figure(
        "pixels whose evaluations differ at a scale of 2^20",
        int(np.sum(exact.evaluations != one.evaluations)),
        0,
        "powers of two are exact",
    )


@case(54, "cone pass")
def cones(world: World) -> Iterator[Figure]:
    """A cone that returns the t at which it stopped may start rays behind surfaces, and jittered rays leave the
    cone."""
    node = (
        rm.sphere(0.6).repeat((1.4, None, 1.4), (5, None, 5))
        | rm.box((0.02, 1.5, 0.02)).translate((0.3, 0.4, 2.2))
        | rm.plane(offset=-0.6)
    )
    camera = rm.Camera((1.5, 1.6, 4.5), (0, 0, 0))
    known = rm.truth(rm.Scene(node, camera), (64, 48), outputs=("depth", "normal"))
    pixel = 2 * np.tan(np.radians(22.5)) / 48
    cosine = np.abs(np.sum(known.normal * known.direction, axis=-1))
    beyond = holes = 0
    for schedule in ("two", "four", "six", "cone", "cones"):
        frame = world.draw(rm.Scene(node, camera, quality=rm.Quality(schedule=schedule)), outputs=("depth",))
        sure = known.hit & (cosine > 0.05) & ~around(known.depth > 30)
        holes += int(np.sum(sure & ~np.isfinite(frame.depth)))
        allowed = EPSILON * pixel * np.where(known.hit, known.depth, 0) / np.maximum(cosine, 0.05) + 1e-5
        silhouettes = rm_silhouettes(known)
        beyond += int(np.sum(sure & ~silhouettes & (frame.depth > known.depth + allowed)))
    yield Figure("pixels beyond the truth, of 5 schedules", beyond, 0, "epsilon / cosine, silhouettes apart")
    yield Figure("holes", holes, 0, "a cone passes nothing")
    plain = world.draw(rm.Scene(node, camera, quality=rm.Quality(samples=8, schedule="single")), outputs=("color",))
    jittered = world.draw(rm.Scene(node, camera, quality=rm.Quality(samples=8, schedule="cone")), outputs=("color",))
    calm = ~around(rm_silhouettes(known)) & known.hit & (known.depth < 8)
    yield Figure(
        "8-bit steps that cones make to 8 jittered samples, silhouettes apart",
        bytes_off(plain, jittered, calm),
        1,
        "the same hits within epsilon",
    )


def rm_silhouettes(known: Any) -> Any:
    from raymarch.truth import silhouettes

    return silhouettes(known)


@case(55, "relaxed tracer on an estimate")
def estimates(world: World) -> Iterator[Figure]:
    """Overlapping spheres prove nothing if the field may exceed the distance. Such a field is marched with plain steps,
    or with steps that are at most a pixel longer."""
    wrong = 0
    for tracer in REAL:
        made = plan(rm.Scene(rm.mandelbulb(), quality=rm.Quality(tracer=tracer)))
        taken = "bracketing" if tracer == "bracketing" else "plain"
        wrong += made.marching.tracer != taken or (tracer != taken and tracer not in made.marching.tracer_reason)
        wrong += "ESTIMATE" not in made.variants
        wrong += not any("estimate" in warning for warning in made.warnings)
    yield Figure("tracers that relax on it, or do not say why not", wrong, 0, "the plan falls back, and says so")


@case(56, "first step of the enhanced tracer")
def enhanced(world: World) -> Iterator[Figure]:
    """As published, its first step is 0/0, and a receding ray takes an infinite step."""
    node = rm.sphere() | rm.plane(offset=-1.0) | rm.sphere(0.2).translate((0.3, 0.2, 2.5))
    camera = rm.Camera((0.8, 0.5, 3.5), (0, 0, 0))
    for tracer in ("enhanced", "auto_relaxed", "bracketing"):
        plain, other = (
            world.draw(rm.Scene(node, camera, quality=rm.Quality(tracer=name))) for name in ("plain", tracer)
        )
        inner = ~around(np.isfinite(plain.depth) != np.isfinite(other.depth))
        bad = int(np.sum(~np.isfinite(other.evaluations)) + np.sum(np.isnan(other.depth)))
        bad += int(np.sum(around(~np.isfinite(plain.depth)) != around(~np.isfinite(other.depth))))
        yield Figure(f"pixels of {tracer} without a number, or unlike plain", bad, 0, "guarded denominators")
        assert inner.any()


@case(57, "seam of a bound through a blend")
def seam(world: World) -> Iterator[Figure]:
    """If space is divided into regions that contain only nearby solids, a blend across regions has a seam. The bounding
    box of the scene is such a region: it must contain the whole blend."""
    node = rm.union(
        rm.box(1.0), rm.sphere(0.7).translate((0.9, 0.3, 0)), rm.torus(0.8, 0.2).translate((0, 0.6, 0)), k=0.6
    )
    camera = rm.Camera((1.5, 2.0, 4.0), (0.2, 0.2, 0))
    clipped = world.draw(rm.Scene(node, camera))
    endless = world.draw(rm.Scene(node | rm.plane(offset=-1e4) | rm.plane((0, -1, 0), -1e4), camera))
    near = endless.depth < 100
    yield Figure(
        "pixels that the box cuts off or adds",
        int(np.sum(near != np.isfinite(clipped.depth))),
        0,
        "the box holds the blend",
    )
    both = near & np.isfinite(clipped.depth)
    turned = float(np.degrees(angles(clipped.normal.astype(np.float64), endless.normal.astype(np.float64))[both].max()))
    yield Figure("turn of a normal in degrees", turned, 2.0, "hits differ by an epsilon at most")


@case(58, "infinite plane at the horizon")
def horizon(world: World) -> Iterator[Figure]:
    """Rays that run out of steps leave a band of holes below the horizon. They take the nearest sample."""
    node = rm.plane() | rm.sphere().translate((0, 30, 60))
    holes = above = 0
    for tracer in REAL:
        view = view_of((0, 1, 0), (0, 1, -1), 30.0)
        frame = world.draw(rm.Scene(node, camera_of(view), quality=rm.Quality(tracer=tracer)), outputs=("depth",))
        hit = np.isfinite(frame.depth)
        holes += int(np.sum(~hit[24:]))
        above += int(np.sum(hit[:23]))
    yield Figure("holes below the horizon, of all tracers", holes, 0, "within a pixel's width is a hit")
    yield Figure("hits more than a pixel above it", above, 0, "the sky is empty")


@case(46, "sizes of the picture")
def sizes(world: World) -> Iterator[Figure]:
    """Pictures of one pixel, of odd size, or very thin and long: half pixels or a wrong aspect ratio. Sizes beyond the
    limit are refused."""
    node = rm.sphere() | rm.plane(offset=-1)
    wrong = 0
    most = world.context.limits.picture[0]
    for size in ((1, 1), (1, 64), (64, 1), (63, 37), (2, 3), (4096, 1), (1, 4096), (min(16384, most), 1)):
        view = replace(view_of((0.2, 0.3, 4.0), (0, 0, 0)), size=size)
        frame = world.draw(rm.Scene(node, camera_of(view)), size, ("color", "depth"))
        ball, ground = (
            hit_sphere(view.origin, view.directions, (0, 0, 0), 1.0),
            hit_plane(view.origin, view.directions, -1.0),
        )
        t = np.minimum(ball, ground)
        cosine = np.where(
            ball < ground,
            -np.sum(points(view.origin, view.directions, ball) * view.directions, axis=-1),
            -view.directions[..., 1],
        )
        sure = np.isfinite(t) & (np.abs(cosine) > 0.05) & (t < 1e3)
        found = np.isfinite(frame.depth)
        wrong += frame.color.shape != (size[1], size[0], 3)
        wrong += int(np.sum(sure & ~found)) + (off(frame.depth, view, t, cosine, sure & found) > 1)
    yield Figure("wrong pixels and shapes, of 8 sizes", wrong, 0, "epsilon / cosine")
    from raymarch.errors import DeviceError, SceneError

    refused = 0
    for size in ((most + 1, 1), (0, 4), (-1, 4)):
        try:
            world.renderer.resize(size)
        except (DeviceError, SceneError) as error:
            refused += str(size[0]) in str(error)
    yield Figure("sizes accepted beyond the limit, of 3", 3 - refused, 0, "a clear refusal")


@case(61, "a wall beside the ray", before="1 of 480 rays went through a Menger sponge, 0.66 behind its face")
def beside_a_wall(world: World) -> Iterator[Figure]:
    """Along a wall that is nearer than an epsilon the slope is nearly 0, and a step along it passes through objects on
    the wall. The first such step is at most a pixel, and the next at most as long as the interval over which the slope
    was constant."""
    through = 0
    for seed in (2849, 11, 12, 13):
        referee = Referee(scene_of(rm.menger(2.0, 3), seed), (24, 20))
        frame = world.draw(referee.scene, (24, 20), ("depth",))
        through += int(referee.through(frame.depth.astype(np.float64)).sum())
    yield Figure("rays that go through the sponge, of 4 views", through, 0, "more than a contact deep in float64")
    through = 0
    for degrees, distance, thickness in ((0.1, 40, 30), (0.3, 15, 9), (0.5, 8, 6)):
        scene, face = _block_on_a_floor(degrees, distance, thickness)
        depth = world.draw(scene, (32, 1), ("depth",)).depth
        through += int((depth > face).sum())
    yield Figure(
        "rays that go through a block on a floor, of 96",
        through,
        0,
        "thicker than the distance at which the ray is within epsilon of it",
    )


def _block_on_a_floor(degrees: float, distance: float, thickness: float) -> tuple[rm.Scene, float]:
    """A floor seen so flat that a ray nears it by an epsilon many pixels before it meets it, with a block in the way
    so many pixels before; and a depth between the faces of the block."""
    slope, far = np.radians(degrees), 10.0
    pixel = 2.0 * np.tan(np.radians(0.15)) * far
    end, height = far * np.cos(slope), far * np.sin(slope)
    block = rm.box((thickness * pixel, 1, 8)).translate((end - (distance - 0.5 * thickness) * pixel, 0.5, 0))
    scene = rm.Scene(rm.plane() | block, camera=rm.Camera((0, height, 0), (end, 0, 0), fov=0.3))
    return scene, far - (distance - 0.5 * thickness) * pixel


@case(62, "a slope where nobody looks", before="no normal of the solid was finite")
def hidden_slope(world: World) -> Iterator[Figure]:
    """The branch of a choice that is not taken may have an infinite slope, and 0 times that is NaN. Gradients choose
    between the products."""

    @rm.shape(exactness="exact", bounds=lambda radius: cube(radius))
    def guarded_ball(p: Any, radius: Positive = 1.0) -> Any:
        return where(p.y > -2.0, length(p), length(p) / where(p.y > -2.0, 0.0, 1.0)) - radius

    REGISTRY.pop("guarded_ball")
    view = view_of((0.4, 0.5, 4.0), (0, 0, 0))
    frame = world.draw(rm.Scene(guarded_ball(), camera_of(view)))
    t = hit_sphere(view.origin, view.directions, (0, 0, 0), 1.0)
    found = np.isfinite(t) & np.isfinite(frame.depth)
    yield Figure(
        "normals that are not finite", int(np.sum(~np.isfinite(frame.normal[found]))), 0, "the other side counts"
    )
    normal = points(view.origin, view.directions, t)
    cosine = np.abs(np.sum(normal * view.directions, axis=-1))
    sure = found & (cosine > 0.05)
    allowed = EPSILON * view.pixel * t[sure] / cosine[sure] + 8 * ULP
    yield Figure(
        "error of a normal over what the hit allows",
        float(np.max(angles(frame.normal, normal)[sure] / allowed)),
        1,
        "epsilon / cosine",
    )


@case(87, "a fractal seen from afar", "estimates that grow faster than the distance: the Mandelbulb was not drawn")
def from_afar(world: World) -> Iterator[Figure]:
    """Estimates are evaluated in the box of their solid. An orthographic camera starts its rays at the box."""
    away = np.array([0.4, 0.3, 1.0]) * 200
    most = 0
    for node in (rm.mandelbulb(iterations=4), rm.julia(iterations=6), rm.mandelbox(iterations=5).scale(0.25)):
        height = 1.1 * float(np.max(node.bounds[1] - node.bounds[0]))
        narrow = float(np.degrees(2 * np.arctan(height / 2 / np.linalg.norm(away))))
        cameras = (rm.Camera(tuple(away), projection="orthographic", height=height), rm.Camera(tuple(away), fov=narrow))
        flat, found = (np.isfinite(world.draw(rm.Scene(node, c), (40, 30), ("depth",)).depth) for c in cameras)
        assert flat.sum() > 200
        most = max(most, int(np.sum(flat != found)))
    yield Figure("pixels unlike those of an orthographic camera, of 3 fractals", most, 8, "silhouettes")


@case(
    91, "self-shadowing of a fractal", "brighter than float64 by up to 71 %: rays ended half a pixel before the surface"
)
def fractal_shadows(world: World) -> Iterator[Figure]:
    """The value of an estimate may be a quarter of the distance: half a pixel ahead of a fractal its detail casts no
    shadows. Hits are refined where the estimate changes its sign. Others are drawn where they are small."""
    camera, sun = rm.Camera((1.4, 1.05, 2.2), (0, 0, 0), fov=40), rm.Sun((1.5, 2.0, 0.9), shadow=True)
    for node in (rm.julia(iterations=8), rm.mandelbulb(power=4, iterations=4)):
        scene = rm.Scene(node, camera, lights=[sun])
        known = rm.truth(scene, (64, 44))
        found = world.draw(scene, (64, 44), outputs=("color", "depth"))
        both = known.hit & np.isfinite(found.depth)
        assert both.sum() > 1000
        off = abs(float(found.color[both].mean() / known.color[both].mean()) - 1.0)
        yield Figure(f"relative error of the brightness, {node.name}", off, 0.03, "the noise of 1,000 points")
    box = rm.Scene(rm.mandelbox(iterations=5), rm.Camera((8, 6, 13), fov=40))
    hits = [
        np.isfinite(world.draw(box.replace(quality=quality), (40, 30), outputs=("depth",)).depth)
        for quality in (rm.Quality(), rm.Quality(tracer="plain", epsilon=0.5, refinement="none"))
    ]
    assert hits[1].sum() > 200
    yield Figure(
        "hits of a Mandelbox lost, which is nowhere negative", int(np.sum(hits[0] != hits[1])), 0, "half a pixel"
    )


@case(88, "walls thinner than a hit", "their far side in up to 8 % of the pixels, as dark specks")
def thin_walls(world: World) -> Iterator[Figure]:
    """A march may end on the far side of a wall that is thinner than the width of a hit: its normal is turned to the
    ray."""
    view = view_of((1.5, 1.2, 3), (0, 0, 0))
    most = 0
    for thickness in (1e-3, 1e-4, 1e-5):
        cup = rm.sphere(0.8).shell(thickness) - rm.plane((0, -1, 0), -0.2)
        frame = world.draw(rm.Scene(cup, camera_of(view)))
        facing = np.sum(frame.normal * view.directions, axis=-1)[np.isfinite(frame.depth)]
        most = max(most, int(np.sum(facing > 0.25)))
    yield Figure("pixels whose normal faces away from the camera", most, 0, "no visible side does")


@case(89, "bounds that are flat", "127 pixels beside three discs that were drawn, 134 beside their shadows")
def flat_bounds(world: World) -> Iterator[Figure]:
    """After an uneven scale the field rises slowly along the long axes: points far from the surface have the small
    values of a hit. The largest value of a hit is an epsilon over the largest ratio of a distance to its field."""
    view = view_of((1.5, 1.2, 3), (0, 0, 0))
    sun = np.array((1.0, 2.0, 1.5)) / np.linalg.norm((1.0, 2.0, 1.5))
    lost = wrong = dark = 0
    for thickness in (0.1, 0.01, 0.001, 1e-4, 1e-6):
        disc = rm.sphere().scale((1, thickness, 1))

        def meets(origins: Any, directions: Any, grown: float, thickness: float = thickness) -> NDArray[np.bool_]:
            scale = np.array((1.0, thickness, 1.0)) + grown
            across = directions / scale
            across /= np.linalg.norm(across, axis=-1, keepdims=True)
            return np.isfinite(hit_sphere(origins / scale, across, (0, 0, 0), 1.0))

        grown = 2.0 * EPSILON * view.pixel * 5.0
        found = np.isfinite(world.draw(rm.Scene(disc, camera_of(view)), outputs=("depth",)).depth)
        lost += int(np.sum(meets(view.origin, view.directions, -1e-5) & ~found))
        wrong += int(np.sum(found & ~meets(view.origin, view.directions, grown)))
        scene = rm.Scene(
            disc.visible(camera=False) | rm.plane(offset=-0.5), camera_of(view), [rm.Sun(sun, shadow=True)]
        )
        color = world.draw(scene, outputs=("color",)).color[..., 0]
        t = hit_plane(view.origin, view.directions, -0.5)
        shadow = meets(
            points(view.origin, view.directions, t), np.broadcast_to(sun, view.directions.shape), 2.0 * grown
        )
        near = np.isfinite(t) & (t < 20.0)
        dark += int(np.sum(near & ~shadow & (color < 0.5 * color[near].max())))
    yield Figure("pixels of the discs that are missing", lost, 0, "a safe step passes nothing")
    yield Figure("pixels more than an epsilon beside the discs", wrong, 0, "epsilon over the largest ratio")
    yield Figure("pixels beside their shadows that are dark", dark, 0, "epsilon over the largest ratio")
