"""Rows 3, 4, 8, 24 and 25: what rays meet, against closed forms."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

import raymarch as rm
from tests.lab.trials.rays import Solid, View, borders, box, ellipsoid, first_hit, frustum, wrong_pixels
from tests.lab.trials.row import WHITE, Array, Figure, drawn, looking_down, pixels

SIZE = (96, 72)
RATIOS = tuple(10.0**e for e in range(-6, 7))


def _by_ratio(ratio: float) -> dict[str, tuple[rm.Node, Solid]]:
    wide, high = (1.0, ratio) if ratio <= 1 else (1.0 / ratio, 1.0)
    return {
        "cone": (rm.cone(wide, high), frustum(wide, high, 0)),
        "cone upside down": (rm.cone(0, high, wide), frustum(0, high, wide)),
        "frustum": (rm.cone(wide, high, 0.4 * wide), frustum(wide, high, 0.4 * wide)),
        "cylinder": (rm.cylinder(wide, high), frustum(wide, high, wide)),
        "ellipsoid": (rm.ellipsoid((2 * wide, high, 1.6 * wide)), ellipsoid((2 * wide, high, 1.6 * wide))),
        "box": (rm.box((2 * wide, high, wide)), box((2 * wide, high, wide))),
    }


def flat_and_long() -> Iterator[Figure]:
    """Closed forms at ratios 1e-6 to 1e6 above a floor, with shadows, from aside, above and nearly level."""
    view = View((1.5, 1.2, 3.0), (0, 0, 0))
    for then, ratio in (("12,815 of 43,200", 1e-4), ("533", 5e-4), ("120", 1e-3), ("2", 1e-2)):
        now = wrong_pixels(rm.cone(1, ratio), [frustum(1, ratio, 0)], view, -0.3, (240, 180))
        yield Figure(f"cone(1, {ratio:g}) above a floor: wrong pixels", then, now, 0)
    views = view, View((0.2, 3, 0.5), (0, 0, 0)), View((0, 0.02, 2.5), (0, 0, 0))
    worst, total = ("none", 0), 0
    for index, ratio in enumerate(RATIOS):
        for name, (node, solid) in [*_by_ratio(ratio).items()][index % 2 :: 2]:
            now = wrong_pixels(node, [solid], views[index % 3], -0.6, SIZE)
            total += now
            worst = max(worst, (f"{name} at {ratio:g}", now), key=lambda each: each[1])
    yield Figure(f"6 closed forms at 13 ratios: wrong pixels, worst {worst[0]}", "-", total, 0)


HOLE = (240, 120)


def _through(node: rm.Node, inside: Callable[[Array, Array], Array], **given: Any) -> int:
    """Pixels of a plate seen from above that do not show the floor within a hole, or show it beside the hole."""
    frame = drawn(rm.Scene(node | rm.plane(offset=-20), looking_down(44, (0, 60, 0)), **given), HOLE)
    x, z = pixels(44, HOLE)
    plate = (np.abs(x) < 20) & (np.abs(z) < 20)
    wanted = np.where(plate & ~inside(x, z), 55.0, 80.0)  # a shell is .25 higher
    rim = borders(wanted)
    return int(((np.abs(frame.depth - wanted) > 0.3) & ~rim).sum())


def flush_cuts() -> Iterator[Figure]:
    """Tools as long as the plate is thick, from above; then light through the hole."""
    plate = rm.box((40, 10, 40))

    def round_hole(x: Array, z: Array) -> Array:
        return x * x + z * z < 64

    def square(x: Array, z: Array) -> Array:
        return (np.abs(x) < 8) & (np.abs(z) < 8)

    def four(x: Array, z: Array) -> Array:
        return (np.abs(x) - 9) ** 2 + (np.abs(z) - 9) ** 2 < 16

    param = rm.Param("h", 10.0, 1.0, 20.0)
    holes = {
        "cylinder(8, 10)": (plate - rm.cylinder(8, 10), round_hole),
        "cylinder(8, 10.001)": (plate - rm.cylinder(8, 10.001), round_hole),
        "box": (plate - rm.box((16, 10, 16)), square),
        "scaled drill": (plate - rm.cylinder(1, 1).scale((8, 10, 8)), round_hole),
        "turned drill": (plate - rm.cylinder(8, 10).rotate(math.pi / 2, "x").rotate(-math.pi / 2, "x"), round_hole),
        "four": (plate - rm.cylinder(4, 10).repeat((18, None, 18), (2, 1, 2)), four),
        "Param": (plate - rm.cylinder(8, param), round_hole),
        "by time": (plate - rm.cylinder(8, 10 + 0 * rm.time), round_hole),
        "and complement": (plate & rm.cylinder(8, 10).complement(), round_hole),
        "shell": (plate.shell(0.5) - rm.cylinder(8, 10.5), round_hole),
    }
    wrong = {name: _through(node, inside) for name, (node, inside) in holes.items()}
    worst = max(wrong, key=lambda name: wrong[name])
    yield Figure(f"10 flush tools: wrong pixels, worst {worst}", "all of the hole", sum(wrong.values()), 0)
    white = (plate - rm.cylinder(8, 10) | rm.plane(offset=-20)).material(WHITE)
    x, z = pixels(44, HOLE)
    lit = (x * x + z * z < 36) & (np.abs(x) < 20)
    for what, softness, penumbra in (
        ("hard shadow", 0.0, "two-sided"),
        ("two-sided", 0.02, "two-sided"),
        ("cone", 0.02, "cone"),
        ("triangulated", 0.02, "triangulated"),
        ("sampled", 0.02, "sampled"),
    ):
        sun = rm.Sun((0, 1, 0), shadow=True, softness=softness, penumbra=penumbra)
        frame = drawn(rm.Scene(white, looking_down(44, (0, 60, 0)), lights=[sun], sky=(0, 0, 0)), HOLE)
        yield Figure(
            f"light lost on the floor below the hole, {what}", "1", float(1 - frame.color[lit, 0].mean()), 0.02
        )
    yield from _occlusion_of_holes(lit)


def _occlusion_of_holes(lit: Array) -> Iterator[Figure]:
    """Occlusion of the floor of a hole against that below a hole that is flush with nothing."""
    given: dict[str, Any] = {
        "lights": [],
        "sky": rm.Sky((1, 1, 1), light=True),
        "occlusion": rm.AmbientOcclusion(reach=8.0),
    }
    mean = []
    for height in (10, 14):
        node = rm.box((40, 10, 40)) - rm.cylinder(8, height) | rm.plane(offset=-8)
        scene = rm.Scene(node.material(rm.Material((1, 1, 1), specular=0.0)), looking_down(44, (0, 60, 0)), **given)
        mean.append(drawn(scene, HOLE).color[lit, 0].mean())
    yield Figure("occlusion in a flush hole against a clear one", "-", float(abs(mean[0] - mean[1])), 0.02)


def flat_torus() -> Iterator[Figure]:
    """A torus scaled flat: hits beyond its rim, in pixels; and a plane seen from far above, rolled."""
    worst = 0.0
    for factor, lift in itertools.product((1e-2, 1e-3, 1e-4, 1e-5), (4.0, 1.5)):
        view = View((0.3, lift, 3.0), (0, 0, 0), 45)
        depth = drawn(rm.Scene(rm.torus(1, 0.25).scale((1, factor, 1)), view.camera, lights=[]), (160, 90)).depth
        o, d = view.rays((160, 90))
        hit = np.isfinite(depth.reshape(-1))
        t = depth.reshape(-1)[hit].astype(float)
        at = np.asarray(o[hit] + t[:, None] * d[hit], float)
        beyond = np.abs(np.hypot(at[:, 0], at[:, 2]) - 1) - 0.25
        worst = max(worst, float((beyond / (t * 2 * math.tan(math.radians(22.5)) / 90)).max()))
    yield Figure("torus scaled (1, 1e-2 ... 1e-5, 1): pixels beyond its rim", ".77", worst, 0.2)
    holes = 0
    for roll in (0.0, 0.3, 1.0):
        view = View((0, 1e4, 0), (1e4, 9.9e3, 0), 45, (0, math.cos(roll), math.sin(roll)))
        depth = drawn(rm.Scene(rm.plane(), view.camera, lights=[]), (160, 90)).depth
        _, d = view.rays((160, 90))
        below = -np.asarray(d[:, 1], float) > 0.01 * math.tan(math.radians(22.5)) / 45
        holes += int((below & ~np.isfinite(depth.reshape(-1))).sum())
    yield Figure("plane from 1e4 above, rolled: holes below the horizon", "1", holes, 0)


def _sponge(size: float, iterations: int) -> list[Solid]:
    cells = [np.zeros(3)]
    for level in range(1, iterations + 1):
        steps = [np.array(s) for s in itertools.product((-1, 0, 1), repeat=3) if sum(map(abs, s)) > 1]
        cells = [c + size / 3**level * s for c in cells for s in steps]
    return [box((size / 3**iterations,) * 3, c) for c in cells]


def _late(node: rm.Node, solids: list[Solid], view: View, size: tuple[int, int], marched: bool) -> tuple[int, float]:
    """Rays that hit a tenth of a pixel too far where a pixel of solid is passed, and by how much the farthest."""
    quality = rm.Quality(analytic=False) if marched else rm.Quality()
    depth = drawn(rm.Scene(node, view.camera, lights=[], quality=quality), size).depth.reshape(-1)
    o, d = view.rays(size)
    right = first_hit(solids, o, d)
    with np.errstate(invalid="ignore"):
        pixel = right * 2 * math.tan(math.radians(view.fov / 2)) / size[1]
        thick = np.zeros(len(o))
        for solid in solids:
            enter, leave = solid(o, d)
            thick = np.maximum(thick, np.where(enter == right, leave - enter, 0))
        late = np.where(np.isfinite(right) & (thick > pixel), (depth - right) / pixel, 0.0)
    return int((late > 0.1).sum()), float(np.nan_to_num(late, posinf=99.0).max())


def thin_parts() -> Iterator[Figure]:
    """The sponge of the row and others, and fins, from random places: what is a pixel thick is hit."""
    random = np.random.default_rng(24)
    count, worst = 0, 0.0
    for seed in range(5):
        size = 1.0218 if seed == 0 else float(random.uniform(0.9, 1.3))
        way = random.normal(size=3)
        view = View(tuple(2.2 * way / np.linalg.norm(way)), tuple(random.uniform(-0.1, 0.1, 3)), 40)
        late, far = _late(rm.menger(size, iterations=2), _sponge(size, 2), view, (120, 68), True)
        count, worst = count + late, max(worst, far)
    yield Figure("rays late by .1 pixel in a sponge of 2 iterations", "2.3 pixels", count, 0)
    count = 0
    for _ in range(6):
        fins: list[tuple[Array, Array]] = []
        for _ in range(8):
            extent = random.uniform(0.2, 1.0, 3)
            extent[random.integers(3)] = 10 ** random.uniform(-2.5, -1.3)
            fins.append((extent, random.uniform(-0.7, 0.7, 3)))
        node = rm.union(*(rm.box(tuple(e)).translate(tuple(c)) for e, c in fins))
        way = random.normal(size=3)
        view = View(tuple(2.5 * way / np.linalg.norm(way)), (0, 0, 0), 40)
        late, far = _late(node, [box(tuple(e), c) for e, c in fins], view, (160, 90), True)
        count, worst = count + late, max(worst, far)
    yield Figure(f"rays late by .1 pixel among thin fins; the farthest {worst:.2f}", "7 of 362,496", count, 0)


def skimming() -> Iterator[Figure]:
    """A camera 1e-4 R above a ball, a cylinder or a box, that looks along it at a ball behind: holes and false hits."""
    wrong = views = 0
    grounds = (
        (rm.sphere(1), ellipsoid((2, 2, 2))),
        (rm.ellipsoid((6, 2, 3)), ellipsoid((6, 2, 3))),
        (rm.cylinder(3, 2), frustum(3, 2, 3)),
    )
    for (ground, solid), rise, marched in itertools.product(grounds, (-0.02, 0.0, 0.01, 0.03), (True, False)):
        view = View((0, 1 + 1e-4, 0), (1, 1 + 1e-4 + rise, 0), 30)
        node = ground | rm.sphere(0.35).translate((3.6, 1.15, 0.1))
        quality = rm.Quality(analytic=False) if marched else rm.Quality()
        depth = drawn(rm.Scene(node, view.camera, lights=[], quality=quality), SIZE).depth
        o, d = view.rays(SIZE)
        right = first_hit([solid, ellipsoid((0.7, 0.7, 0.7), (3.6, 1.15, 0.1))], o, d).reshape(SIZE[::-1])
        edge = borders(right, 0.2)
        with np.errstate(invalid="ignore"):
            off = ~(np.abs(depth - right) <= 0.05 * right) & np.isfinite(right)
        off |= np.isfinite(depth) & ~np.isfinite(right)
        wrong, views = wrong + int((off & ~edge).sum()), views + 1
    yield Figure(f"a camera 1e-4 R above a surface, {views} views: wrong pixels", "4 of 81 views", wrong, 0)
