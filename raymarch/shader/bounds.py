"""Generated code that clips rays and cones to the scene's box."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from raymarch.expr.pieces import filled, literal
from raymarch.plan import Plan
from raymarch.sdf.facts import Facts
from raymarch.shader.chunk import Chunk, Lines

Ends: TypeAlias = "list[tuple[str, float | None, float | None]]"

OPEN = 1e30
"""The end of a box that is unbounded there, where another box is not."""


def scene_box(plan: Plan) -> Chunk:
    """The part of a ray inside the scene's box, which is padded so that rounding cannot cut off the surface."""
    text = Lines("the scene's bounds", where=plan.scene.node.where)
    _clip(text, plan, "scene_box", box_ends(plan.scene.node.facts))
    return text.chunk("scene box")


def marched_range(plan: Plan) -> Chunk:
    """The part of a ray in which solids are marched: from the first to the last of their boxes that it goes through."""
    boxes = [box_ends(facts) for facts in plan.analytic.boxes]
    text = Lines("the bounds of what is marched", where=plan.scene.node.where)
    if len(boxes) == 1:
        _clip(text, plan, "marched_range", boxes[0])
        return text.chunk("marched range")
    text.add("vec2 marched_range(Ray ray, vec2 range) {")
    text.add(f"    vec2 found = vec2({literal(OPEN)}, {literal(-OPEN)});")
    for box in boxes:
        text.add(*filled(f"    found = enclosing(found, {_clipped(box)});", "    "))
    text.add("    return found;", "}")
    return text.chunk("marched range")


def _clip(text: Lines, plan: Plan, name: str, ends: Ends) -> None:
    """A function that clips rays and cones to a box: all at once, or plane by plane if the box is unbounded."""
    orthographic = plan.scene.camera.orthographic
    text.add(f"vec2 {name}(Ray ray, vec2 range) {{")
    if not any(end is None for _, *pair in ends for end in pair):
        text.add(*filled(f"    return {_clipped(ends)};", "    "))
    else:
        for axis, low, high in ends:
            for clip, sign, plane in (("above", "+", low), ("below", "-", high)):
                origin, direction = f"ray.origin.{axis}", f"ray.direction.{axis}"
                if plan.marching.cones:  # as in march/clip_to_box
                    direction += f" {sign} u_cone"
                    origin += f" {sign} u_cone_start" if "WIDE_CONE" in plan.variants else ""
                if "EDGES" in plan.variants:  # wider by what lies in the same pixel, until the ray has passed it
                    wider = f" {sign} 4.0 * EDGE_REACH * u_pixel"
                    origin, direction = origin + wider * orthographic, direction + wider * (not orthographic)
                if plane is not None:
                    text.add(f"    range = {clip}(range, {origin}, {direction}, {literal(plane)});")
        text.add("    return range;")
    text.add("}")


def _clipped(ends: Ends) -> str:
    low = ", ".join([literal(-OPEN if end is None else end) for _, end, _ in ends])
    high = ", ".join([literal(OPEN if end is None else end) for _, _, end in ends])
    return f"clip_to_box(ray, range, vec3({low}), vec3({high}))"


def scene_cone(plan: Plan) -> Chunk:
    """The range of a ray in which a cone around it overlaps the scene's box; for soft shadows.

    `width` is the tangent of the cone's half angle. A point at a distance width * t from the ray can be below a plane
    at `upper` where origin + (direction - width) t is below it.
    """
    text = Lines("the scene's bounds")
    text.add("vec2 scene_cone(Ray ray, vec2 range, float width) {")
    for axis, low, high in box_ends(plan.scene.node.facts):
        at = f"range, ray.origin.{axis}, ray.direction.{axis}"
        if high is not None:
            text.add(f"    range = below({at} - width, {literal(high)});")
        if low is not None:
            text.add(f"    range = above({at} + width, {literal(low)});")
    text.add("    return range;", "}")
    return text.chunk("scene cone")


def box_ends(facts: Facts) -> Ends:
    """Each axis with the lower and upper bound of the scene's box, None if unbounded.

    Bounds are padded so that rounding cannot cut off the surface.
    """
    found: Ends = []
    for i, axis in enumerate("xyz"):
        low, high = ends = float(facts.lower[i]), float(facts.upper[i])
        pad = 2.0**-20 * max([abs(e) for e in ends if np.isfinite(e)], default=0.0)  # 8 ulp of the box's coordinates
        pad = max(pad, 2.0**-80)
        found.append((axis, low - pad if np.isfinite(low) else None, high + pad if np.isfinite(high) else None))
    return found
