"""Cases of planes of symmetry, where two distances are equal."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

import raymarch as rm
from raymarch.expr.arrays import evaluator
from raymarch.expr.derivative import companion
from raymarch.sdf.blends import FAMILIES
from raymarch.sdf.evaluation import lower
from tests.hard.world import Figure, World, case, view_of
from tests.support.analytic import angles, points
from tests.support.cameras import camera_of
from tests.support.one_sided import limits, mirrored_fields, on_the_plane

PART = ((0.1, -0.5, 0.2), (0.7, 0.3, 0.5), 0.3)


def _mirrored(ends: tuple[tuple[float, float, float], tuple[float, float, float], float]) -> list[rm.Node]:
    """A rod and its image in x = 0, their distances equal to the last bit on the plane."""
    a, b, radius = ends
    image = [(-x, y, z) for x, y, z in (a, b)]
    return [
        rm.capsule(a, b, radius).material(rm.Material((0.9, 0.1, 0.1))),
        rm.capsule(*image, radius).material(rm.Material((0.1, 0.1, 0.9))),
    ]


@case(64, "planes of symmetry", before="normals of smooth blends off by 40° on a line of pixels, also in the reference")
def planes_of_symmetry(world: World) -> Iterator[Figure]:
    """Where two distances are equal, min has the derivative of one and abs that of neither, so the gradient of a blend
    was that of neither side. Kinks of the same difference now take the same side. The reference is finite differences
    of the distance."""
    worst, single, asked, unsure = 0.0, 0.0, 0, 0
    for seed, (_, build) in enumerate(mirrored_fields()):
        node, at = build(), on_the_plane(seed, 100).astype(np.float32).astype(np.float64)
        seen = limits(node.distance, at)
        worst = max(worst, float(np.max(seen.missed(node.gradient(at))[seen.sure], initial=0.0)))
        whole = companion(lower(node))
        twin = evaluator([whole.body], whole.params, np.float32)(at)[0][:, :3].astype(np.float64)
        single = max(single, float(np.max(seen.missed(twin)[seen.sure], initial=0.0)))
        asked, unsure = asked + len(at), unsure + int(np.sum(~seen.sure))
    yield Figure(f"error of the reference's gradient at {asked} points", worst, 1e-6, "the limits from both sides")
    yield Figure("error of the same gradients in float32", single, 1e-5, "rounding of a few operations")
    yield Figure("share of the points where differences do not settle", unsure / asked, 0.05, "other kinks are near")
    size = (33, 48)
    middle = size[0] // 2
    view = view_of((0.0, 0.6, 4.0), (0.0, 0.0, 0.0), 30.0, size)
    turned, seen_pixels, unequal = 0.0, 0, 0.0
    for family in FAMILIES:
        node = rm.union(*_mirrored(PART), k=0.6, blend=family)
        lit = rm.Scene(node, camera_of(view), lights=[rm.Sun((0, 0.3, 1))])
        frame = world.draw(lit, size, outputs=("depth", "normal", "color"))
        depth = frame.depth[:, middle].astype(np.float64)
        hit = np.isfinite(depth)
        at = points(view.origin, view.directions[:, middle], depth)[hit]
        at[:, 0] = 0.0
        limit = limits(node.distance, at)
        sure = limit.sure & limit.agree
        normal = frame.normal[:, middle][hit].astype(np.float64)
        turned = max(turned, float(np.max(angles(normal, limit.right)[sure], initial=0.0)))
        seen_pixels += int(np.sum(sure))
        color = frame.color[:, middle][hit][sure]
        unequal = max(unequal, float(np.max(np.abs(color[:, 0] - color[:, 2]), initial=0.0)))
    yield Figure(f"error of the normals of {seen_pixels} pixels in the plane, radians", turned, 2e-4, "float32")
    yield Figure("difference of the weights of two materials there", unequal, 1e-5, "both are half")
    yield Figure("pixels in the plane that are missing, of 100", max(100 - seen_pixels, 0), 0, "the blends fill it")
