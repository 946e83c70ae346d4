"""Measures what every node promises, on its samples, and keeps the figures in docs/figures/nodes.json.

python -m tests.lab.measure                 # all nodes: some minutes
python -m tests.lab.measure --missing       # those without a row
python -m tests.lab.measure torus gyroid    # some

The tests ask whether a promise holds; here is how well. docs/proofs.py makes a page of it.
"""

from __future__ import annotations

import json
import sys
from dataclasses import asdict, dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from raymarch.expr.glsl import print_functions
from raymarch.expr.types import VECTORS
from raymarch.gpu.context import Context, open_context
from raymarch.sdf.evaluation import lower
from raymarch.sdf.facts import ORDER
from tests.sdf.test_every_node import TWIN_ULPS, ULP, few_wrong
from tests.support.glsl_harness import run
from tests.support.node_samples import NodeSample, Seen, definitions, look_at, samples
from tests.support.records import NODES, measured, unmeasured
from tests.support.surface_search import lowest_on_plane, nearest_distance, smooth_differences, thorough_distance

PAIRS = 1_000_000
"""Pairs of points for the slopes of a definition, over all of its samples."""
CHUNK = 50_000
FINE = 1e-5
"""Distances that seem to be missed by more than this, in units of the size, are searched for more thoroughly."""
ALLOWED = 5e-4
"""By how much an exact field may still seem to be too small, in units of the size."""


@dataclass
class Figures:
    """What was found for one definition: the worst of its samples. None where a promise is not made.

    Attributes
    ----------
    samples : how many nodes were looked at.
    exactness : the weakest, and `best` the strongest among them.
    divisor : largest number that a sample's own value is divided by.
    twin : float32 on the driver against float64, in ulp of max(|p|, size); of an estimate the 98th percentile.
    twin_limit : the bound stated for it.
    gradient : symbolic against central differences, the largest difference where the field is smooth.
    slope : the largest found, in units of the promised one; 1 and a little rounding at most.
    looseness : promised / found, the largest of the samples.
    usual : promised / the slope in the middle of those at points of the surface, the largest of the samples: by how
        much marching straight at it takes shorter steps than it could.
    inside : interior points that were looked at for the bounds.
    margin : how far a side of the box is from an exact solid, in % of its size.
    short_outside, short_inside : how much less than the distance an exact node says, in % of its size.
    over : how much more than the distance a node says, in % of its size.
    violations : points, pairs and samples at which a promise was broken.
    means : for each sample, what its field is known by; see `Seen.means`.
    """

    samples: int
    best: str
    exactness: str
    divisor: float
    twin: float
    twin_limit: float
    gradient: float
    slope: float | None
    looseness: float | None
    usual: float | None
    inside: int
    margin: float | None
    short_outside: float | None
    short_inside: float | None
    over: float | None
    violations: int
    means: dict[str, list[float]]


@dataclass
class Slope:
    found: float
    usual: float | None
    broken: int


def twin(s: Seen, egl: Context) -> tuple[float, int]:
    """ulp between the driver's values and float64, and how many points are beyond what is stated."""
    text = print_functions([lower(s.node)])
    point = VECTORS[s.node.dimension]
    values = run(egl, s.node.glsl(), "field({0})", [(point, s.points)], samples=text.samples)
    ulps = np.abs(values - s.values) / (ULP * np.maximum(np.abs(s.points).max(axis=1), s.field.size))
    ulps = np.nan_to_num(ulps, nan=np.inf)
    limit, _ = TWIN_ULPS.get(s.sample.definition.name, (16.0, ""))
    wrong = ulps > limit
    broken = int(wrong.sum()) if wrong.mean() > few_wrong(s.node) else 0
    return float(np.percentile(ulps, 98) if s.node.exactness == "estimate" else ulps.max()), broken


def gradient(s: Seen) -> tuple[float, int]:
    points = s.points[:20_000]
    central, smooth = smooth_differences(s.field, points, 1e-6 * s.field.size, 1e-4)
    error = np.abs(s.field.gradient(points) - central).max(axis=1)[smooth]
    rough = few_wrong(s.node)
    broken = int((~(error <= 2e-5)).sum())
    worst = float(np.percentile(error, 100 * (1 - rough))) if len(error) else 0.0
    return worst, broken if broken > rough * len(error) else 0


def slope(s: Seen, pairs: int) -> Slope:
    """The steepest of pairs far apart, pairs close together, and gradients."""
    random = np.random.default_rng(31)
    limit, size, eps = s.node.lipschitz, s.field.size, np.finfo(np.float64).eps
    found, broken = 0.0, 0
    for _ in range(-(-pairs // (2 * CHUNK))):
        a, b = s.field.draw(random, CHUNK), s.field.draw(random, CHUNK)
        steps = random.normal(size=a.shape)
        steps *= (size * 10 ** random.uniform(-5, -0.5, CHUNK) / np.linalg.norm(steps, axis=1))[:, None]
        here = s.field.value(a)
        rounding = 64 * eps * (np.abs(a).max() + size)
        for other in (b, a + steps):
            distance = np.linalg.norm(other - a, axis=1)
            rise = np.abs(s.field.value(other) - here)
            broken += int((~(rise <= limit * distance * (1 + 1e-9) + rounding)).sum())
            found = max(found, float(np.max((rise - rounding) / np.maximum(distance, 1e-300))))
    slopes = np.linalg.norm(s.field.gradient(s.points[:20_000]), axis=1)
    there = np.linalg.norm(s.field.gradient(s.surface), axis=1)
    usual = limit / max(float(np.median(there)), 1e-9) if len(there) else None
    return Slope(max(found, float(slopes.max())), usual, broken + int((slopes > limit * (1 + 1e-9)).sum()))


def box_margin(s: Seen) -> float | None:
    """Of an exact shape, in % of its size, the largest gap between it and a side of its box."""
    if s.sample.definition.arity != "none" or s.node.exactness != "exact":
        return None
    gaps = [
        lowest_on_plane(s.field, axis, edge[axis])
        for edge in s.node.bounds
        for axis in range(s.node.dimension)
        if np.isfinite(edge[axis])
    ]
    return 100.0 * max(gaps) / s.field.size if gaps else None


def stray(s: Seen) -> tuple[int, int]:
    """Interior points, and how many of them the box leaves out; the surroundings of the box are searched too."""
    low, high = s.node.bounds
    slack = 1e-9 * s.field.size
    random = np.random.default_rng(13)
    far = random.uniform(s.field.low - 2 * s.field.size, s.field.high + 2 * s.field.size, s.points.shape)
    inside = np.concatenate([s.points[s.values < 0], far[s.field.value(far) < 0]])
    return len(inside), int(np.any((inside < low - slack) | (inside > high + slack), axis=1).sum())


def too_long(s: Seen) -> tuple[float | None, int]:
    """By how much, in % of the size, the field exceeds the way to a known point of the surface, and how often."""
    if s.node.exactness == "estimate" or not len(s.surface):
        return None, 0
    distances, _ = cKDTree(s.surface).query(s.points[:50_000])
    excess = np.abs(s.values[:50_000]) - distances
    return max(0.0, 100.0 * float(excess.max()) / s.field.size), int((excess > 1e-9 * s.field.size).sum())


def too_short(s: Seen) -> tuple[float | None, float | None, int]:
    """By how much, in % of the size, an exact field falls short of the distance, outside and inside."""
    if s.node.exactness != "exact" or (s.sample.definition.arity != "none" and not s.node.facts.bounded):
        return None, None, 0
    random = np.random.default_rng(15)
    margin = np.minimum(s.points - s.field.low, s.field.high - s.points).min(axis=1)
    known = np.abs(s.values) < 0.5 * margin
    short: list[float] = []
    broken = 0
    for side in (s.values > 0, s.values < 0):
        queries = s.points[known & side][:120]
        if not len(queries):
            short.append(0.0)
            continue
        distances = nearest_distance(s.field, random, s.surface, queries)
        values = np.abs(s.field.value(queries))
        for k in np.argsort(values - distances)[:8]:
            if distances[k] - values[k] > FINE * s.field.size:
                distances[k] = min(distances[k], thorough_distance(s.field, random, queries[k], distances[k]))
        missing = (distances - values) / s.field.size
        short.append(max(0.0, 100.0 * float(missing.max())))
        broken += int((missing > ALLOWED).sum())
    return short[0], short[1], broken


def unmirrored(s: Seen) -> int:
    """Points whose mirror image, along an axis of symmetry, has another value."""
    points, broken = s.points[:20_000], 0
    for axis in s.node.facts.symmetry:
        mirrored: NDArray[np.float64] = points * np.where(np.arange(s.node.dimension) == "xyz".index(axis), -1.0, 1.0)
        broken += int((np.abs(s.field.value(mirrored) - s.values[:20_000]) > 1e-12 * s.field.size).sum())
    return broken


def far_from_box(s: Seen) -> int:
    """Points whose value is too small for how far from the box they lie."""
    low, high = s.node.bounds
    outside = np.maximum(np.maximum(low - s.points, s.points - high), 0.0).max(axis=1)
    with np.errstate(invalid="ignore"):
        reached = s.node.facts.spread * np.maximum(s.values, 1e-12) + 1e-9 * s.field.size
    return int((outside > reached).sum())


def measure(name: str, chosen: list[NodeSample], egl: Context) -> Figures:
    """The figures of one definition: the worst of its samples."""
    rows: list[Figures] = []
    for sample in chosen:
        s = look_at(sample)
        off, wrong_twin = twin(s, egl)
        turn, wrong_gradient = gradient(s)
        promised = s.node.exactness != "estimate"
        steepest = slope(s, -(-PAIRS // len(chosen))) if promised else Slope(0.0, None, 0)
        inside, left_out = stray(s)
        over, wrong_over = too_long(s)
        outside, within, wrong_short = too_short(s)
        margin = box_margin(s)
        broken = wrong_twin + wrong_gradient + steepest.broken + left_out + wrong_over + wrong_short
        broken += unmirrored(s) + far_from_box(s) + int(margin is not None and margin > 1.0)
        rows.append(
            Figures(
                1, s.node.exactness, s.node.exactness, s.node.facts.divisor, off,
                TWIN_ULPS.get(name, (16.0, ""))[0], turn,
                steepest.found / s.node.lipschitz if promised else None,
                s.node.lipschitz / max(steepest.found, 1e-9) if promised else None,
                steepest.usual, inside, margin, outside, within, over, broken,
                {sample.name: s.means},
            )
        )  # fmt: skip
    return worst_of(rows)


def worst_of(rows: list[Figures]) -> Figures:
    made: dict[str, Any] = {}
    for f in fields(Figures):
        values = [v for row in rows if (v := getattr(row, f.name)) is not None]
        if f.name in ("samples", "inside", "violations"):
            made[f.name] = sum(values)
        elif f.name == "means":
            made[f.name] = {name: means for each in values for name, means in each.items()}
        elif f.name == "best":
            made[f.name] = min(values, key=ORDER.index)
        elif f.name == "exactness":
            made[f.name] = max(values, key=ORDER.index)
        else:
            made[f.name] = float(f"{max(values):.4g}") if values else None
    return Figures(**made)


def write(rows: dict[str, dict[str, Any]]) -> None:
    """A line for each node, so that two that are added at the same time do not meet."""
    known = {d.name for d in definitions()}
    lines = [f'"{name}": {json.dumps(row)}' for name, row in sorted(rows.items()) if name in known]
    NODES.parent.mkdir(exist_ok=True)
    NODES.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")


def main(arguments: list[str]) -> int:
    rows = measured()
    names = [d.name for d in definitions()]
    unknown = [a for a in arguments if a != "--missing" and a not in names]
    if unknown:
        print(f"no nodes: {', '.join(unknown)}")
        return 2
    if "--missing" in arguments:
        names = unmeasured()
    elif arguments:
        names = arguments
    broken = 0
    with open_context("egl") as egl:
        for i, name in enumerate(names):
            figures = measure(name, [x for x in samples() if x.definition.name == name], egl)
            rows[name] = asdict(figures)
            broken += figures.violations
            print(f"{i + 1}/{len(names)} {name}: {json.dumps(rows[name])}", flush=True)
            write(rows)
    print(f"{len(names)} nodes, {broken} violations. python docs/build.py --text writes the pages")
    return 1 if broken else 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
