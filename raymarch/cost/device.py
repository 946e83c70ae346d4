"""Check a driver: scenes of every shape, operators, effects and hard numbers, drawn and held against float64.

Limits come from float32: a driver may contract, reorder, flush denormals, and round divisions and functions as the
specification of GLSL allows. What it must not do is lose a surface, invent one, or move one by a share of a pixel.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

import raymarch.sdf as sdf
from raymarch.errors import RaymarchError, SceneWarning
from raymarch.expr.maths import sin
from raymarch.gpu.renderer import Renderer
from raymarch.scene import AmbientOcclusion, Camera, Fog, Material, PointLight, Quality, Scene, Sky, SphereLight, Sun
from raymarch.sdf import Node
from raymarch.sdf.builder import Builder
from raymarch.sdf.repetition import repeat
from raymarch.truth import silhouettes, truth
from raymarch.truth.edges import angle

if TYPE_CHECKING:
    from raymarch.scene.light import Light

SIZE = (64, 48)
"""Pixels of each picture."""

DEPTH = 0.05
"""Largest 99th percentile of |depth - truth|, in footprints of a pixel."""

NORMAL = 1.0
"""Largest 99th percentile of the angle between the normals, in degrees."""

COLOR = 0.01
"""Largest 99th percentile of the difference of the colours in linear light."""


@dataclass(frozen=True, slots=True)
class Case:
    """A scene to check: its group, its name, how to make it, and whether its colours are compared."""

    group: str
    name: str
    make: Callable[[], Scene]
    lit: bool = False


@dataclass(frozen=True, slots=True)
class Row:
    """What came of a case.

    hits : pixels that the reference hits. missed, false : hits that only the reference has, and that only the device
    has, away from silhouettes. depth, normal, color : 99th percentiles, in pixels, degrees and linear light; nan where
    nothing is compared. fault : what the driver or the package said; "" for nothing. seconds : of drawing, with
    compiling.
    """

    group: str
    name: str
    hits: int = 0
    missed: int = 0
    false: int = 0
    depth: float = float("nan")
    normal: float = float("nan")
    color: float = float("nan")
    fault: str = ""
    seconds: float = 0.0

    @property
    def holds(self) -> bool:
        """True if the device drew it within the limits."""
        within = (self.depth, DEPTH), (self.normal, NORMAL), (self.color, COLOR)
        lost = self.missed + self.false
        return not self.fault and lost == 0 and not any(value > limit for value, limit in within)


def _seen(node: Node, *lights: Light, **given: Any) -> Scene:
    """A scene of a node from a camera that sees its bounds. Of an unbounded one, the part inside of a box."""
    if not np.all(np.isfinite(node.bounds)):
        node = node & sdf.box(2.0)
    low, high = np.asarray(node.bounds)
    middle, reach = (low + high) / 2, float(np.linalg.norm(high - low)) / 2
    place = middle + reach * np.array([1.3, 1.1, 2.2])
    camera = Camera(tuple(map(float, place)), tuple(map(float, middle)), fov=45.0)
    return Scene(node, camera, list(lights) or [Sun((0.5, 1.0, 0.7))], **given)


_FLAT = ((-0.8, -0.4), (0.7, -0.5), (0.1, 0.6))
_DEEP = ((-0.8, -0.4, 0.1), (0.7, -0.5, -0.2), (0.8, 0.6, 0.2), (-0.6, 0.5, 0.0))
_GIVEN: dict[str, tuple[object, ...]] = {
    "line": _DEEP[:2],
    "triangle": _DEEP[:3],
    "quad": ((-0.8, -0.5, 0), (0.8, -0.5, 0), (0.7, 0.6, 0), (-0.6, 0.5, 0)),
    "bezier_tube": _DEEP[:3],
    "polyline_tube": (_DEEP,),
    "flat_triangle": _FLAT,
    "bezier": _FLAT,
    "stroke": _FLAT[:2],
    "polygon": (_FLAT,),
    "polyline": (_FLAT,),
}
"""Arguments of shapes that have no default for them."""


def _seen_of(make: Callable[[], Node]) -> Scene:
    return _seen(make())


def _shapes() -> Iterator[Case]:
    for name, made in vars(sdf).items():
        try:
            node = made(*_GIVEN.get(name, ())) if isinstance(made, Builder) else None
        except (RaymarchError, TypeError, ValueError):
            continue  # an operator, which needs operands
        if node is not None and node.dimension == 2:
            node = node.extrude(0.3)
        if node is not None:
            yield Case("shapes", name, partial(_seen, node))


def _operators() -> Iterator[Case]:
    a, b = sdf.box((1.2, 0.8, 0.9)), sdf.sphere(0.6).translate((0.4, 0.3, 0.2))
    tilted = a.rotate(0.4, "x")
    made: dict[str, Callable[[], Node]] = {
        "union": lambda: a | b,
        "intersection": lambda: a & b,
        "difference": lambda: a - b,
        "xor": lambda: a ^ b,
        "smooth union": lambda: sdf.union(a, b, k=0.2),
        "smooth difference": lambda: sdf.difference(a, b, k=0.2),
        "round fillet": lambda: sdf.union(a, b, k=0.1, blend="round"),
        "chamfer": lambda: sdf.union(a, b, k=0.1, blend="chamfer"),
        "rotate": lambda: tilted,
        "uneven scale": lambda: sdf.sphere(0.6).scale((1.5, 0.7, 1.0)),
        "mirror": lambda: b.mirror("x"),
        "repeat": lambda: repeat(sdf.sphere(0.25), 0.7, (3, 2, 3)),
        "repeat varied": lambda: sdf.repeat_varied(lambda i: sdf.sphere(0.2), 0.7, (3, 1, 3)),
        "polar": lambda: sdf.box((0.2, 0.2, 0.4)).translate((0, 0, 0.8)).polar(7),
        "twist": lambda: a.twist(1.0),
        "bend": lambda: a.bend(0.6),
        "taper": lambda: a.taper(0.4),
        "displace": lambda: sdf.sphere(0.8).displace(0.05, 8.0),
        "round": lambda: a.round(0.1),
        "shell": lambda: (a - b).shell(0.05),
        "elongate": lambda: sdf.torus(0.4, 0.15).elongate((0.3, 0.0, 0.2)),
        "implicit": lambda: sdf.implicit(
            lambda p: p.x**4 + p.y**4 + p.z**4 - p.x**2 - p.y**2 - p.z**2 + 0.4, ((-1.5,) * 3, (1.5,) * 3)
        ),
        "implicit waves": lambda: sdf.implicit(
            lambda p: sin(4 * p.x) + sin(4 * p.y) + sin(4 * p.z), ((-1.0,) * 3, (1.0,) * 3)
        ),
        "many objects": lambda: sdf.union(
            *(
                sdf.sphere(0.12).translate((0.4 * x, 0.4 * y, 0.4 * z))
                for x in range(5)
                for y in range(5)
                for z in range(3)
            )
        ),
    }
    for name, make in made.items():
        yield Case("operators", name, partial(_seen_of, make))


def _effects() -> Iterator[Case]:
    ball, floor = sdf.sphere(0.5).translate((0, 0.5, 0)), sdf.plane(offset=0.0)
    camera = Camera((1.2, 1.6, 3.0), (0, 0.4, 0), fov=40.0)
    sun = Sun((0.5, 1.0, 0.7), shadow=True)
    painted = ball.material(Material("tomato", roughness=0.4)) | floor.material(Material("white"))

    def scene(node: Node = painted, lights: Sequence[Light] = (sun,), **given: Any) -> Callable[[], Scene]:
        return lambda: Scene(node, camera, list(lights), **given)

    yield Case("effects", "hard shadow", scene(), True)
    yield Case("effects", "point light", scene(lights=[PointLight((1, 2, 1), shadow=True)]), True)
    yield Case("effects", "sphere light", scene(lights=[SphereLight((1, 2, 1), 0.2)]), True)
    yield Case("effects", "sky", scene(sky=Sky(light=True)), True)
    yield Case("effects", "fog", scene(fog=Fog(density=0.1)), True)
    yield Case("effects", "occlusion", scene(occlusion=AmbientOcclusion(reach=0.5)), True)
    mirror = ball.material(Material("white", metalness=1.0, roughness=0.0)) | floor
    yield Case("effects", "mirror", scene(mirror, bounces=1, quality=Quality(integrator="whitted")), True)


def _numbers() -> Iterator[Case]:
    node = (sdf.box((1.0, 0.8, 0.6)) - sdf.sphere(0.5).translate((0.3, 0.3, 0.2))) | sdf.torus(0.5, 0.1).translate(
        (0, 0.6, 0)
    )
    for factor in (1e-4, 1e-2, 1e2, 1e4):
        yield Case("numbers", f"scaled by {factor:g}", partial(_scaled, node, factor))
    for away in (1e2, 1e4):
        yield Case("numbers", f"{away:g} from the origin", partial(_moved, node, away))
    yield Case(
        "numbers", "grazing floor", lambda: Scene(sdf.plane(offset=0.0) | node, Camera((0, 0.02, 3), (0, 0.1, 0)))
    )
    yield Case("numbers", "flat cylinder", lambda: _seen(sdf.cylinder(1.0, 1e-3)))
    yield Case("numbers", "all marched", lambda: _marched(node))


def _scaled(node: Node, factor: float) -> Scene:
    camera = Camera((1.5 * factor, 1.3 * factor, 2.6 * factor), (0, 0, 0))
    return Scene(node.scale(factor), camera)


def _moved(node: Node, away: float) -> Scene:
    return Scene(node.translate((away, 0, 0)), Camera((away + 1.5, 1.3, 2.6), (away, 0, 0)))


def _marched(node: Node) -> Scene:
    scene = _seen(node)
    return scene.replace(quality=scene.quality.replace(analytic=False))


def cases() -> list[Case]:
    """All cases: shapes with default sizes, operators, effects, hard numbers."""
    return [*_shapes(), *_operators(), *_effects(), *_numbers()]


def check(renderer: Renderer, case: Case) -> Row:
    """Draw a case and compare it with the reference. Faults of the driver and of the package are the row's `fault`."""
    begin = time.perf_counter()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SceneWarning)
            scene = case.make()
            frame = renderer.render(scene, outputs=("depth", "normal", *(("color",) if case.lit else ())))
            depth, normal = frame.depth.astype(np.float64), frame.normal.astype(np.float64)
            color = frame.color.astype(np.float64) if case.lit else None
    except Exception as error:  # a driver may fail in any way, and the other cases go on
        return Row(case.group, case.name, fault=" ".join(str(error).split())[:300] or type(error).__name__)
    return compared(case, scene, depth, normal, color, time.perf_counter() - begin)


def compared(
    case: Case,
    scene: Scene,
    depth: NDArray[np.float64],
    normal: NDArray[np.float64],
    color: NDArray[np.float64] | None,
    seconds: float,
) -> Row:
    """A picture of a case beside float64. depth : (H, W), inf where nothing was hit. normal, color : (H, W, 3)."""
    height, width = depth.shape
    known = truth(scene, (width, height), outputs=("depth", "normal", *(("color",) if color is not None else ())))
    apart = ~silhouettes(known)
    hit, found = np.isfinite(known.depth), np.isfinite(depth)
    both = apart & hit & found
    is_estimate = scene.node.exactness == "estimate"
    footprint = 2.0 * np.tan(np.radians(float(scene.camera.fov)) / 2) / height * known.depth[both]
    return Row(
        case.group,
        case.name,
        int(hit.sum()),
        0 if is_estimate else int((apart & hit & ~found).sum()),
        0 if is_estimate else int((apart & ~hit & found).sum()),
        float("nan") if is_estimate else _worst(np.abs(depth[both] - known.depth[both]) / footprint),
        float("nan") if is_estimate else _worst(angle(normal[both], known.normal[both])),
        float("nan") if color is None else _worst(np.abs(color - known.color)[apart].max(axis=-1)),
        seconds=seconds,
    )


def _worst(values: NDArray[np.float64]) -> float:
    return float(np.quantile(values, 0.99)) if values.size else float("nan")
