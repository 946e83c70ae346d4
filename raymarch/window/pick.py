"""The point under the cursor: as the GPU rendered it, and by the float64 reference."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from queue import SimpleQueue
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from raymarch.errors import Location, RaymarchError
from raymarch.expr.arrays import bound, evaluator
from raymarch.expr.function import Function
from raymarch.scene.camera import Pose
from raymarch.scene.parameter import Values
from raymarch.scene.scene import Scene
from raymarch.sdf.lower import Lowering
from raymarch.sdf.node import Node, children_first
from raymarch.sdf.placing import with_label
from raymarch.sdf.rows import Rows
from raymarch.sdf.weights import weights_of
from raymarch.truth.narrow import along_ray
from raymarch.truth.rays import Rays
from raymarch.truth.tracer import trace
from raymarch.window.news import near
from raymarch.window.shot import Shot

Vector = NDArray[np.float64]
Swatch: TypeAlias = tuple[int, int, int] | None
"""A colour in sRGB, or None."""

SWATCH = "\u25a0"
"""The character that stands for a swatch at the beginning of a text."""


@dataclass(frozen=True, slots=True, eq=False)
class Pick:
    """One pixel.

    pixel : column and row from the upper left.
    distance : along the ray, from the GPU; inf for a miss.
    position, normal : of the hit.
    material : index into the scene's materials; -1 for none.
    iterations, evaluations : cost of the ray.
    true : the reference distance in float64, None until it is known; likewise `true_normal` and `true_evaluations`.
    part : the shape at the hit, with the user's line.
    surface, swatch : the name of the material, and its colour in sRGB if it is constant.
    """

    number: int
    pixel: tuple[int, int]
    distance: float
    position: Vector
    normal: Vector
    material: int
    iterations: int
    evaluations: int
    true: float | None = None
    true_normal: Vector | None = None
    true_evaluations: int | None = None
    part: str | None = None
    where: Location | None = None
    trouble: str = ""
    surface: str = ""
    swatch: Swatch = None

    def place(self, pose: Pose, size: tuple[int, int]) -> tuple[int, int] | None:
        """Column and row of the hit in a picture; None if it is not in it."""
        found = pose.place(self.position, size) if np.isfinite(self.distance) else None
        if found is None:
            return None
        column, row = (round(v) for v in found)
        return (column, row) if 0 <= column < size[0] and 0 <= row < size[1] else None

    def text(self) -> str:
        if not np.isfinite(self.distance):
            lines = ["nothing was hit here"]
        else:
            lines = [
                f"{self.part or '...'}\t{f'{near(self.where.file)}:{self.where.line}' if self.where else ''}",
                f"material\t{'' if self.swatch is None else f'{SWATCH} '}{self.surface or self.material}",
                f"position\t{_triple(self.position)}",
                f"normal\t{_triple(self.normal)}",
                f"distance\t{self.distance:.7g}",
            ]
        lines.append(f"cost\t{self.evaluations} evaluations, {self.iterations} steps")
        if self.true is not None:
            lines.append(self._truth())
        if self.trouble:
            lines.append(self.trouble)
        return "\n".join(lines)

    def _truth(self) -> str:
        assert self.true is not None
        cost = f"{self.true_evaluations} evaluations"
        if not np.isfinite(self.true):
            return f"truth\tnothing is hit here, {cost}"
        if not np.isfinite(self.distance):
            return f"truth\tdistance {self.true:.10g}, {cost}"
        assert self.true_normal is not None
        lean = float(np.degrees(np.arccos(np.clip(abs(self.true_normal @ self.normal), 0.0, 1.0))))
        return (
            f"truth\tdistance {self.true:.10g}, {abs(self.true - self.distance):.2g} apart\n"
            f" \tnormal {_triple(self.true_normal)}, {lean:.2g} degrees apart\n"
            f" \t{cost}"
        )


def picked(
    number: int,
    pixel: tuple[int, int],
    texels: Mapping[str, Any],
    origin: Vector,
    ray: Vector,
    named: Callable[[int], tuple[str, Swatch]] = lambda index: ("", None),
) -> Pick:
    """A pick from the texels of one pixel. named : name and colour of a material by its index."""
    distance = float(texels["depth"][0, 0])
    material = int(texels["material"][0, 0])
    surface, swatch = named(material)
    return Pick(
        number=number,
        pixel=pixel,
        distance=distance,
        position=origin + (distance if np.isfinite(distance) else 0.0) * ray,
        normal=np.asarray(texels["normal"][0, 0], np.float64),
        material=material,
        iterations=int(texels["iterations"][0, 0]),
        evaluations=int(texels["evaluations"][0, 0]),
        surface=surface,
        swatch=swatch,
    )


class Inquiry:
    """Computes the reference values of picks, each in a thread of its own."""

    def __init__(self, wake: Callable[[], None]) -> None:
        self._wake = wake
        self._found: SimpleQueue[Pick] = SimpleQueue()

    def ask(self, pick: Pick, shot: Shot, values: Values, origin: Vector, ray: Vector) -> None:
        arguments = (pick, shot.scene, values, origin, ray, shot.pose)
        threading.Thread(target=self._work, args=arguments, name="truth", daemon=True).start()

    def latest(self) -> list[Pick]:
        """The results since the last call."""
        return [self._found.get() for _ in range(self._found.qsize())]

    def _work(self, pick: Pick, *where: Any) -> None:
        try:
            self._found.put(verified(pick, *where))
        except RaymarchError as fault:
            self._found.put(replace(pick, trouble=str(fault)))
        except Exception as fault:
            self._found.put(replace(pick, trouble=f"{type(fault).__name__}: {fault}"))
        self._wake()


def verified(pick: Pick, scene: Scene, values: Values, origin: Vector, ray: Vector, pose: Pose) -> Pick:
    """The pick with the reference values of its ray and the shape at the hit. pose : of the clip planes."""
    near = along_ray(scene.node, pose, origin, ray, values)
    found = trace(scene, values, pose, Rays(origin[None], ray[None]), (1, 1), pose.pixel(1), near)
    depth = float(found.depth[0, 0])
    distance = depth if np.isfinite(depth) else pick.distance
    node = part_at(near, values, origin + distance * ray) if np.isfinite(distance) else None
    return replace(
        pick,
        true=depth,
        true_normal=found.normal[0, 0],
        true_evaluations=int(found.evaluations[0, 0]),
        part=None if node is None else node.name,
        where=None if node is None else node.where,
    )


def part_at(root: Node, values: Values, point: Vector) -> Node:
    """The shape of a tree with the largest partial derivative of the field at a point.

    The same derivatives are the weights of materials, so the result is the visible shape.
    """
    shapes = _labelled(root)
    marked = Lowering(objects=_Whole()).field(shapes, label=root)
    marks, weights = weights_of(marked)
    if not marks:
        return root
    weigh = evaluator(weights, marked.params)
    with bound(values.params, values.time):
        found: dict[Node, float] = {}
        for mark, weight in zip(marks, weigh(point[None, :]), strict=True):
            found[mark.data] = found.get(mark.data, 0.0) + float(np.ravel(weight)[0])
    return max(found, key=lambda node: found[node])


class _Whole:
    """Instances as one part, whatever materials they have; see `raymarch.sdf.lower.Objects`."""

    def distance(self, rows: Rows) -> Function:
        return rows.field

    def label(self, rows: Rows, inherited: Any) -> Any:
        return inherited


def _labelled(root: Node) -> Node:
    """The tree with each shape as its own label, without the previous labels."""
    made: dict[int, Node] = {}
    for node in children_first(root):
        if node.label is not None:
            made[id(node)] = made[id(node.children[0])]
        elif node.children:
            children = tuple(made[id(child)] for child in node.children)
            made[id(node)] = Node(node.definition, children, node.params, node.facts)
        else:
            made[id(node)] = with_label(node, node)
    return made[id(root)]


def _triple(vector: Vector) -> str:
    return f"({', '.join(f'{v + 0.0:.6g}' for v in vector)})"
