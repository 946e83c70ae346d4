"""The probe: renders a picture with instrumentation of every node of its field.

It finds the first value of each node that is not finite or outside its domain (see `raymarch.expr.faults`), and the
largest slope of each node between two samples, to compare with its stated Lipschitz bound. The rays are those of the
picture, including shadow and secondary rays, with one sample per pixel and without cones.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raymarch.expr.arrays import bound
from raymarch.expr.calls import checked
from raymarch.expr.faults import KINDS, decoded
from raymarch.gpu.prepare import Prepared, assembled
from raymarch.gpu.program import Elements, Program
from raymarch.gpu.renderer import Renderer
from raymarch.gpu.reports import LEEWAY, SURFACE, Fault, Pixel, Report, Vector, table
from raymarch.gpu.targets import Target
from raymarch.gpu.tiles import draw_in_tiles
from raymarch.plan.probe import Probing, plan_faults, plan_slopes
from raymarch.scene.parameter import ParamValue, set_values
from raymarch.scene.scene import Scene, all_nodes, as_scene, check_scene
from raymarch.sdf.node import Node
from raymarch.sdf.sampled_facts import contradictions, stated_by_user

Progress = Callable[[float], None]

FOUR = 4
"""Number of nodes whose slopes one draw measures; see probe/watch.glsl."""

ALL = frozenset(range(4096))
"""Indices of nodes that can be selected one by one; the last stands for all beyond."""

SAMPLED = 256
"""Number of nodes whose fields are sampled: each takes about 10 ms."""

CLEARLY = np.float32(1.02)
"""A node is shown instead of its descendant if its ratio is larger by this factor: both are sampled at their own
points."""


@dataclass(frozen=True, slots=True)
class Faults:
    """The result of the probe for faulty values.

    reports : one for each node, then one for the surface.
    node : index into `reports` of the first fault of each pixel, -1 for none, (H, W).
    kind : index into `raymarch.expr.faults.KINDS`, (H, W).
    value : the faulty value, (H, W).
    color : the picture, linear RGB, (H, W, 3).
    """

    reports: tuple[Report, ...]
    node: NDArray[np.int32]
    kind: NDArray[np.int32]
    value: NDArray[np.float32]
    color: NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class Slopes:
    """The result of the probe for slopes.

    reports : one for each node.
    ratio : the largest slope of a node over its Lipschitz bound (for an estimate, over the assumed bound) at each
        pixel, (H, W).
    node : index of that node, (H, W).
    color : the picture, linear RGB, (H, W, 3).
    """

    reports: tuple[Report, ...]
    ratio: NDArray[np.float32]
    node: NDArray[np.int32]
    color: NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class Probe:
    """Faults, slopes and contradicted facts of all nodes. `str()` returns a table."""

    reports: tuple[Report, ...]

    @property
    def sound(self) -> bool:
        """True if no value is faulty, no slope exceeds its Lipschitz bound, and samples contradict no other fact."""
        return not any(report.faults or report.broken or report.refuted for report in self.reports)

    def __str__(self) -> str:
        return "\n".join(table(self.reports))


@checked
def probe(
    scene: Scene | Node,
    size: tuple[int, int] = (160, 90),
    time: float = 0.0,
    params: Mapping[str, ParamValue] | None = None,
    backend: str = "auto",
) -> Probe:
    """Check every node of a scene along the rays of its picture.

    Finds values that are not finite or outside their domain, and the largest slope of each node. Also samples the
    fields in float64, in and around their boxes: finds solid points outside the bounds, fields that rise more slowly
    than their spread states, fields of exact nodes that are not the distance, and fields without the stated symmetry.
    Of a scene with more than 256 nodes, those with facts of your own are sampled first.

    Parameters
    ----------
    scene : a Scene, or a solid.
    size : (width, height) in pixels.
    time : value of `rm.time` in seconds.
    params : values of parameters by name.
    backend : see `Renderer`.

    Returns
    -------
    Probe

    Raises
    ------
    RaymarchError : as of `Renderer.render`.
    """
    scene = as_scene("probe", scene)
    with Renderer(size, backend) as renderer:
        return probe_with(renderer, scene, time, params)


def probe_with(
    renderer: Renderer, scene: Scene, time: float = 0.0, params: Mapping[str, ParamValue] | None = None
) -> Probe:
    """As `probe`, on an existing renderer."""
    check_scene("probe", scene)
    values = find_faults(renderer, scene, time, params).reports
    slopes = find_slopes(renderer, scene, time, params).reports
    joined = [
        replace(a, slope=b.slope, steepest=b.steepest, inherits=b.inherits)
        for a, b in zip(values, slopes, strict=False)
    ]
    for index, refuted in _refuted(scene, time, params):
        joined[index] = replace(joined[index], refuted=refuted)
    return Probe((*joined, *values[len(slopes) :]))


def _refuted(scene: Scene, time: float, params: Mapping[str, Any] | None) -> Iterator[tuple[int, tuple[str, ...]]]:
    """The facts that samples of a node contradict, with the node's index."""
    nodes = plan_slopes(scene).nodes
    chosen = sorted(range(len(nodes)), key=lambda i: not stated_by_user(nodes[i]))[:SAMPLED]
    values = set_values(scene.parameters, params, time, scene.where)
    with bound(values.params, values.time):
        for i in chosen:
            if refuted := tuple(contradictions(nodes[i])):
                yield i, refuted


def find_faults(
    renderer: Renderer,
    scene: Scene,
    time: float = 0.0,
    params: Mapping[str, ParamValue] | None = None,
    progress: Progress | None = None,
) -> Faults:
    """Find the first faulty value of each pixel, and its node."""
    drawing = _Drawing(renderer, plan_faults(scene), time, params)
    count = len(drawing.probing.nodes)
    reports = [_report(node) for node in drawing.probing.nodes] + [Report(SURFACE, scene.where, np.inf)]
    first_faults = drawing.draw({"u_site_mask": Elements(site_bits(ALL))}, progress)
    found = [*_sites(first_faults)]
    more = found
    while more:  # mask the known sites, so that the others show
        more = [
            site
            for site in _sites(drawing.draw({"u_site_mask": Elements(site_bits(ALL - set(found)))}))
            if site not in found
        ]
        found += more
    for site in found:
        alone = drawing.draw({"u_site_mask": Elements(site_bits([site]))})
        index = site - 1 if site else count
        reports[index] = replace(
            reports[index], faults=int(np.count_nonzero(alone[0][..., 0])), first=drawing.first(alone)
        )
    kind, site_of = np.vectorize(decoded, otypes=[np.int32, np.int32])(first_faults[0][..., 0])
    node = np.where(kind == 0, -1, np.where(site_of == 0, count, site_of - 1)).astype(np.int32)
    return Faults(tuple(reports), node, kind, first_faults[0][..., 1].copy(), first_faults[2][..., :3].copy())


def find_slopes(
    renderer: Renderer,
    scene: Scene,
    time: float = 0.0,
    params: Mapping[str, ParamValue] | None = None,
    progress: Progress | None = None,
) -> Slopes:
    """Measure the slopes of each node along the rays."""
    drawing = _Drawing(renderer, plan_slopes(scene), time, params)
    nodes = drawing.probing.nodes
    height, width = renderer.size[1], renderer.size[0]
    ratio, steepest = np.zeros((height, width), np.float32), np.full((height, width), -1, np.int32)
    shown = ratio  # the ratio of the node that is shown
    reports = [_report(node) for node in nodes]
    color = np.zeros((height, width, 3), np.float32)
    # A node precedes its descendants: of equal ratios the lowest node is shown.
    for first in range((len(nodes) - 1) // FOUR * FOUR, -1, -FOUR):
        slopes, _, colors = drawing.draw({"u_first": first + 1}, _part(progress, first, len(nodes)))
        color = colors[..., :3].copy()
        for index in range(min(first + FOUR, len(nodes)) - 1, first - 1, -1):
            values = slopes[..., index - first]
            share = values / np.float32(nodes[index].facts.lipschitz)
            most = np.float32(1.0 + LEEWAY)
            steeper = (share > shown * CLEARLY) | ((share > most) & (shown <= most))
            steepest, shown = np.where(steeper, np.int32(index), steepest), np.where(steeper, share, shown)
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
    """The reports, with `inherits` set for ancestors of a broken node."""
    broken = {id(node) for node, report in zip(nodes, reports, strict=True) if report.broken}
    below = [broken.intersection(map(id, all_nodes(node))) - {id(node)} for node in nodes]
    return tuple(replace(report, inherits=bool(some)) for report, some in zip(reports, below, strict=True))


def site_bits(sites: Any) -> NDArray[np.uint32]:
    """The uniform of probe/note.glsl: one bit for each node whose faults are recorded."""
    bits = np.zeros(4096, np.uint32)
    bits[[min(site, 4095) for site in sites]] = 1
    return np.asarray((bits.reshape(128, 32) << np.arange(32, dtype=np.uint32)).sum(axis=1), np.uint32)


def _sites(arrays: Sequence[NDArray[np.float32]]) -> list[int]:
    """The sites (index of the node + 1; 0 is the surface) of the first faults of all pixels."""
    return sorted({decoded(number)[1] for number in np.unique(arrays[0][..., 0]) if number > 0})


class _Drawing:
    """The program of a probe and its uniforms, for several draws."""

    def __init__(
        self, renderer: Renderer, probing: Probing, time: float, params: Mapping[str, ParamValue] | None
    ) -> None:
        self.probing = probing
        made = probing.plan
        self.ready: Prepared = assembled(made)
        (self.chosen,) = made.passes
        values = set_values(made.parameters, params, time, made.given.where)
        size = renderer.size
        pose = made.given.pose(values, size[0] / size[1])
        # the rays evaluate the field at the camera too, where it may be at fault
        self.uniforms = {**renderer.inputs(self.ready, values, pose).uniforms, "u_start": (0.0, 0.0, 0.0, 0.0)}
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
        """The topmost, then leftmost fault of a draw."""
        fault, place = arrays[0], arrays[1]
        row, x = (int(k[0]) for k in np.nonzero(fault[..., 0]))
        kind, _ = decoded(float(fault[row, x, 0]))
        return Fault(KINDS[kind], float(fault[row, x, 1]), self._point(place[row, x]), (x, row))

    def placed(self, report: Report, number: int, pixel: Pixel) -> Report:
        """The report with the position of its largest slope, which lies in `pixel`."""
        x, row = pixel
        tile = (x, self.target.size[1] - 1 - row, 1, 1)
        self.program.draw(self.target, {**self.uniforms, "u_first": number}, tile)
        return replace(report, steepest=(self._point(self.target.read_texel(x, row, 1)), pixel))

    def _point(self, texel: NDArray[np.float32]) -> Vector:
        x, y, z = (float(v) for v in texel[:3] + self.probing.plan.origin)
        return x, y, z
