"""Self-checks of the report: hits are compared with the reference, times with the wall clock."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raymarch.cost.sweep import Point, Sweep
from raymarch.gpu.clock import try_growth, try_timer
from raymarch.plan.marching import refined
from raymarch.scene.camera import Pose
from raymarch.scene.parameter import set_values
from raymarch.scene.quality import LAST_STEP
from raymarch.scene.scene import Scene
from raymarch.truth.field import Field
from raymarch.truth.large import field_of
from raymarch.truth.rays import Rays

ULPS = 8 * float(np.finfo(np.float32).eps)
"""Rounding error of the field at a hit in float32, over the largest coordinate or distance: a few units in the last
place of each of position, depth and field."""
SHARE = 1e-3
"""Fraction of the hits that may lie farther from the surface than a setting promises: those that graze an edge."""

BACK = 1000
"""Largest number of steps by which a ray is traced back from its hit."""


@dataclass(frozen=True, slots=True)
class Check:
    """Name of a check, whether it holds, and the finding with its numbers."""

    name: str
    holds: bool
    words: str


def check(
    made: Sweep, scene: Scene, renderer: Any, time: float = 0.0, params: Mapping[str, Any] | None = None
) -> list[Check]:
    """Run all checks of a sweep of a scene; `renderer`, `time` and `params` are those of the measurement. None for the
    renderer leaves out the check of its clock."""
    found = [*([] if renderer is None else [check_clock(renderer)]), check_times(made)]
    values = set_values(scene.parameters, params, time)
    field, pose = field_of(scene, values), scene.pose(values, made.known.size[0] / made.known.size[1])
    full_size = [p for p in made.points if p.tracer and p.setting.scale == 1.0]  # at other scales the rays are unknown
    hits = [check_hits(p, scene, made, field, pose) for p in full_size]
    failed = [c for c in hits if not c.holds]
    if failed or not hits:
        return found + failed
    words = f"hits lie where each setting promises, by the field in float64: {len(hits)} settings"
    return [*found, Check("hits", True, words)]


def check_clock(renderer: Any) -> Check:
    """Compare the renderer's clock with the wall clock on draws of known load; CPU time with the load itself."""
    if renderer.clock.kind == "CPU time":
        grown = try_growth(renderer.context, renderer.clock.time)
        return Check("clock", grown.agrees, f"CPU time: {grown.words}")
    found = try_timer(renderer.context, renderer.clock.time)
    return Check("clock", found.agrees, found.words.replace("the GPU timer", f"the {renderer.clock.kind}"))


def check_times(made: Sweep) -> Check:
    """Check that no frame claims more time than passed on the wall clock, of CPU time on each core."""
    worst = max((p for p in made.points if p.walls), key=_claim, default=None)
    if worst is None:
        return Check("frame times", True, "no frame was timed")
    claim = _claim(worst)
    words = f"a frame of {worst.name} claims {claim:.2f} of the time that passed on the wall clock"
    cores = made.environment["machine"]["cores"] if made.environment["clock"]["kind"] == "CPU time" else 1
    counted = f", on {cores} cores" if cores > 1 else ""
    return Check("frame times", claim <= cores, words + counted)


def _claim(point: Point) -> float:
    return max(claimed / wall for claimed, wall in zip(point.times, point.walls, strict=True))


def check_hits(point: Point, scene: Scene, made: Sweep, field: Field, pose: Pose) -> Check:
    """Check the distance of the hits of one setting from the surface, by the field in float64.

    A setting promises |field| <= `Quality.contact` pixel widths at the last sample of the ray, within rounding. One
    more step may follow without an evaluation: with refinement="proven" by at most half an epsilon, with "slope"
    forwards. The field must be as small at the hit, or somewhere on the ray within such a step. Rays that ran out of
    steps have no promise.
    """
    quality = point.setting.quality
    levels = refined(scene.replace(quality=quality))
    promised = quality.contact(levels)
    known = made.known
    ended = np.isfinite(point.depth) & point.done
    depth = point.depth[ended].astype(np.float64)
    if not depth.size:
        return Check(f"hits of {point.name}", True, "no ray came to its end")
    directions = known.direction[ended]
    origins = np.broadcast_to(known.origin, known.direction.shape)[ended]
    rays = _Rays(field, Rays(origins, directions), pose.near / (directions @ pose.view))
    size_of_origins = np.abs(known.origin).max()

    def allowed(t: NDArray[Any], rows: Any) -> NDArray[Any]:
        size = np.maximum(np.abs(rays.rays.at(rows, t)).max(axis=1), t) + size_of_origins
        return np.asarray(np.maximum(promised * known.footprint(t), ULPS * size) + ULPS * size)

    beyond = rays.values(depth, ...) > allowed(depth, ...)
    if quality.refinement == "slope":
        beyond[beyond] = ~rays.came_near(depth[beyond], np.flatnonzero(beyond), allowed)
    elif quality.refinement == "proven":
        reach = LAST_STEP * quality.near(levels) * known.footprint(depth[beyond])
        beyond[beyond] = ~rays.comes_near(depth[beyond], np.flatnonzero(beyond), allowed, reach)
    fraction = float(beyond.mean())
    before = "come no nearer to the surface before them than"
    lie = before if quality.refinement == "slope" else "lie farther from it than"
    words = f"{fraction:.2%} of the hits {lie} the {promised:g} pixel widths promised"
    return Check(f"hits of {point.name}", fraction <= SHARE, words)


@dataclass(frozen=True, slots=True)
class _Rays:
    """Rays of some pixels and the field along them, in float64; `rows` selects rays."""

    field: Field
    rays: Rays
    starts: NDArray[Any]

    def values(self, t: NDArray[Any], rows: Any) -> NDArray[Any]:
        return np.abs(self.field.distance(self.rays.at(rows, t)))

    def comes_near(self, t: NDArray[Any], rows: NDArray[Any], allowed: Any, reach: NDArray[Any]) -> NDArray[np.bool_]:
        """Whether the field is within the allowed value at some of 65 points up to `reach` before and behind t."""
        near = np.zeros(len(t), np.bool_)
        for fraction in np.linspace(-1.0, 1.0, 65):
            at = t + fraction * reach
            near |= self.values(at, rows) <= allowed(at, rows)
        return near

    def came_near(self, t: NDArray[Any], rows: NDArray[Any], allowed: Any) -> NDArray[np.bool_]:
        """Whether the field is within the allowed value anywhere before t on each ray.

        The ray is traced back to its start. The steps are safe for a 1-Lipschitz field.
        """
        at, near = t.copy(), np.zeros(len(t), np.bool_)
        left = np.arange(len(t))
        for _ in range(BACK):
            enough = allowed(at[left], rows[left])
            value = self.values(at[left], rows[left])
            near[left] = value <= enough
            at[left] -= np.maximum(value - enough, enough)
            left = left[~near[left] & (at[left] > self.starts[rows[left]])]
            if not left.size:
                break
        return near
