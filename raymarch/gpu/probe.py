"""The probe: a picture drawn once more with its field looked at node by node.

It finds the first value of each node that is not finite or out of its domain (`raymarch.expr.faults` says what that
is), and the steepest slope that each node shows between two samples, to be held against the slope that it promises.
Rays are the ones of the picture, those of shadows and reflections too, by one sample a pixel and without cones.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raymarch.expr.faults import KINDS, decoded
from raymarch.gpu.prepare import Prepared, assembled
from raymarch.gpu.program import Elements, Program
from raymarch.gpu.renderer import Renderer
from raymarch.gpu.reports import LEEWAY, SURFACE, Fault, Pixel, Report, Vector, table
from raymarch.gpu.targets import Target
from raymarch.gpu.tiles import draw_in_tiles
from raymarch.plan.probe import Probing, plan_faults, plan_slopes
from raymarch.scene.parameter import set_values
from raymarch.scene.scene import Scene, all_nodes, check_scene
from raymarch.sdf.node import Node

Progress = Callable[[float], None]

FOUR = 4
"""Nodes whose slopes one draw yields; see probe/watch.glsl."""

ALL = frozenset(range(4096))
"""Numbers of nodes that can be heard one by one; the last stands for all beyond."""

CLEARLY = np.float32(1.02)
"""A node is shown in place of one below it where it is steeper by this factor: both are sampled at their own points."""


@dataclass(frozen=True, slots=True)
class Faults:
    """What the probe for values found.

    reports : one for each node, those of the surface last. node : index into them of the first fault of each pixel, -1
    for none, (H, W). kind : index into `raymarch.expr.faults.KINDS`, (H, W). value : (H, W). color : (H, W, 3), linear.
    """

    reports: tuple[Report, ...]
    node: NDArray[np.int32]
    kind: NDArray[np.int32]
    value: NDArray[np.float32]
    color: NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class Slopes:
    """What the probe for slopes found.

    reports : one for each node. ratio : of each pixel the largest slope of a node over what the node promises (for an
    estimate, what it is taken for), (H, W). node : index of that node, (H, W). color : (H, W, 3), linear.
    """

    reports: tuple[Report, ...]
    ratio: NDArray[np.float32]
    node: NDArray[np.int32]
    color: NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class Probe:
    """Faults and slopes of all nodes; `str()` is a table."""

    reports: tuple[Report, ...]

    @property
    def sound(self) -> bool:
        """True if no value is at fault and no node is steeper than it promises."""
        return not any(report.faults or report.broken for report in self.reports)

    def __str__(self) -> str:
        return "\n".join(table(self.reports))


def probe(
    scene: Scene,
    size: tuple[int, int] = (160, 90),
    time: float = 0.0,
    params: Mapping[str, Any] | None = None,
    backend: str = "auto",
) -> Probe:
    """Look at every node of a scene while its picture is drawn.

    size : (width, height) in pixels, as for `render`. The errors are those of `Renderer.render`.
    Returns reports, one for each node: values that are not finite or out of their domain, and the steepest slope.
    """
    check_scene("probe", scene)
    with Renderer(size, backend) as renderer:
        return probe_with(renderer, scene, time, params)


def probe_with(renderer: Renderer, scene: Scene, time: float = 0.0, params: Mapping[str, Any] | None = None) -> Probe:
    """As `probe`, on a renderer that is there."""
    check_scene("probe", scene)
    values = find_faults(renderer, scene, time, params).reports
    slopes = find_slopes(renderer, scene, time, params).reports
    joined = [
        replace(a, slope=b.slope, steepest=b.steepest, inherits=b.inherits)
        for a, b in zip(values, slopes, strict=False)
    ]
    return Probe((*joined, *values[len(slopes) :]))


def find_faults(
    renderer: Renderer,
    scene: Scene,
    time: float = 0.0,
    params: Mapping[str, Any] | None = None,
    progress: Progress | None = None,
) -> Faults:
    """The first value of each pixel that went wrong, and the nodes that it went wrong in."""
    drawing = _Drawing(renderer, plan_faults(scene), time, params)
    count = len(drawing.probing.nodes)
    reports = [_report(node) for node in drawing.probing.nodes] + [Report(SURFACE, scene.where, np.inf)]
    whole = drawing.draw({"u_heard": Elements(heard(ALL))}, progress)
    found = [*_sites(whole)]
    more = found
    while more:  # what was found is not heard, so that the rest shows
        more = [
            site for site in _sites(drawing.draw({"u_heard": Elements(heard(ALL - set(found)))})) if site not in found
        ]
        found += more
    for site in found:
        alone = drawing.draw({"u_heard": Elements(heard([site]))})
        index = site - 1 if site else count
        reports[index] = replace(
            reports[index], faults=int(np.count_nonzero(alone[0][..., 0])), first=drawing.first(alone)
        )
    kind, site_of = np.vectorize(decoded, otypes=[np.int32, np.int32])(whole[0][..., 0])
    node = np.where(kind == 0, -1, np.where(site_of == 0, count, site_of - 1)).astype(np.int32)
    return Faults(tuple(reports), node, kind, whole[0][..., 1].copy(), whole[2][..., :3].copy())


def find_slopes(
    renderer: Renderer,
    scene: Scene,
    time: float = 0.0,
    params: Mapping[str, Any] | None = None,
    progress: Progress | None = None,
) -> Slopes:
    """How steep each node is along the rays."""
    drawing = _Drawing(renderer, plan_slopes(scene), time, params)
    nodes = drawing.probing.nodes
    height, width = renderer.size[1], renderer.size[0]
    ratio, steepest = np.zeros((height, width), np.float32), np.full((height, width), -1, np.int32)
    held = ratio  # the ratio of the node that is shown
    reports = [_report(node) for node in nodes]
    color = np.zeros((height, width, 3), np.float32)
    # A node comes before those below it: of equally steep ones the lowest is shown.
    for first in range((len(nodes) - 1) // FOUR * FOUR, -1, -FOUR):
        slopes, _, colors = drawing.draw({"u_first": first + 1}, _part(progress, first, len(nodes)))
        color = colors[..., :3].copy()
        for index in range(min(first + FOUR, len(nodes)) - 1, first - 1, -1):
            values = slopes[..., index - first]
            share = values / np.float32(nodes[index].facts.lipschitz)
            most = np.float32(1.0 + LEEWAY)
            steeper = (share > held * CLEARLY) | ((share > most) & (held <= most))
            steepest, held = np.where(steeper, np.int32(index), steepest), np.where(steeper, share, held)
            ratio = np.maximum(ratio, share)
            row, x = np.unravel_index(int(np.argmax(values)), values.shape)
            reports[index] = replace(reports[index], slope=float(values[row, x]) * nodes[index].facts.divisor)
            if values[row, x] > 0.0:
                reports[index] = drawing.placed(reports[index], index + 1, (int(x), int(row)))
    return Slopes(_inheriting(reports, nodes), ratio, steepest, color)


def _part(progress: Progress | None, first: int, count: int) -> Progress | None:
    if progress is None:
        return None
    return lambda share: progress((max(count - first - FOUR, 0) + share * min(FOUR, count - first)) / count)


def _report(node: Node) -> Report:
    divisor = node.facts.divisor
    return Report(node.name, node.where, node.lipschitz * divisor, node.facts.lipschitz * divisor)


def _inheriting(reports: Sequence[Report], nodes: Sequence[Node]) -> tuple[Report, ...]:
    """The reports, those of nodes above a broken one marked."""
    broken = {id(node) for node, report in zip(nodes, reports, strict=True) if report.broken}
    below = [broken.intersection(map(id, all_nodes(node))) - {id(node)} for node in nodes]
    return tuple(replace(report, inherits=bool(some)) for report, some in zip(reports, below, strict=True))


def heard(sites: Any) -> NDArray[np.uint32]:
    """The uniform of note.glsl: one bit for each node whose faults are heard."""
    bits = np.zeros(4096, np.uint32)
    bits[[min(site, 4095) for site in sites]] = 1
    return np.asarray((bits.reshape(128, 32) << np.arange(32, dtype=np.uint32)).sum(axis=1), np.uint32)


def _sites(arrays: Sequence[NDArray[np.float32]]) -> list[int]:
    """The numbers of the nodes that have the first fault of some pixel."""
    return sorted({decoded(number)[1] for number in np.unique(arrays[0][..., 0]) if number > 0})


class _Drawing:
    """A probe's program with all its uniforms, to be drawn several times."""

    def __init__(self, renderer: Renderer, probing: Probing, time: float, params: Mapping[str, Any] | None) -> None:
        self.probing = probing
        made = probing.plan
        self.ready: Prepared = assembled(made)
        (self.chosen,) = made.passes
        values = set_values(made.parameters, params, time, made.given.where)
        size = renderer.size
        self.uniforms = renderer.uniforms(self.ready, values, made.given.pose(values, size[0] / size[1]))
        self.target: Target = renderer.resources.target(self.chosen.name, size, self.chosen.textures)
        self.program: Program = renderer.resources.program(self.ready, self.chosen.name)[0]
        self.clock = renderer.clock

    def draw(self, own: Mapping[str, Any], progress: Progress | None = None) -> list[NDArray[np.float32]]:
        """All textures of one draw, row 0 at the top."""
        uniforms = {**self.uniforms, **own}

        def tile_of(tile: tuple[int, int, int, int]) -> float:
            return self.clock.time(lambda: self.program.draw(self.target, uniforms, tile))

        draw_in_tiles(self.target.size, tile_of, progress or (lambda share: None))
        return [self.target.read(k) for k in range(self.target.attachments)]

    def first(self, arrays: Sequence[NDArray[np.float32]]) -> Fault:
        """The topmost, leftmost fault of a draw."""
        fault, place = arrays[0], arrays[1]
        row, x = (int(k[0]) for k in np.nonzero(fault[..., 0]))
        kind, _ = decoded(float(fault[row, x, 0]))
        return Fault(KINDS[kind], float(fault[row, x, 1]), self._point(place[row, x]), (x, row))

    def placed(self, report: Report, number: int, pixel: Pixel) -> Report:
        """The report with the place in the scene of the steepest slope, which is in a pixel."""
        x, row = pixel
        tile = (x, self.target.size[1] - 1 - row, 1, 1)
        self.program.draw(self.target, {**self.uniforms, "u_first": number}, tile)
        return replace(report, steepest=(self._point(self.target.read_texel(x, row, 1)), pixel))

    def _point(self, texel: NDArray[np.float32]) -> Vector:
        x, y, z = (float(v) for v in texel[:3] + self.probing.plan.origin)
        return x, y, z
