"""Generated code that clips rays and cones to the scene's box."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np

from raymarch.expr.glsl import literal
from raymarch.plan import Plan
from raymarch.sdf.facts import Facts
from raymarch.shader.chunk import Chunk, Lines

Ends: TypeAlias = "list[tuple[str, float | None, float | None]]"

OPEN = 1e30
"""The end of a box that is unbounded there, where another box is not."""


def scene_box(plan: Plan) -> Chunk:
    """The part of a ray inside the scene's box, which is padded so that rounding cannot cut off the surface.

    A cone is inside where any of its points is: its radius u_cone t moves each plane outwards, as if its axis pointed
    further inwards. For rays u_cone is 0.
    """
    text = Lines("the scene's bounds", where=plan.scene.node.where)
    _clip_to_box(text, plan, "scene_box(Ray ray, vec2 range)", _printed(box_ends(plan.scene.node.facts)))
    return text.chunk("scene box")


def _clip_to_box(text: Lines, plan: Plan, head: str, ends: Sequence[tuple[str, str]]) -> None:
    """The function that clips a ray or a cone to a box.

    ends : the lower and the upper end of the box on each axis, as GLSL; "" where it is unbounded.
    """
    text.add(f"vec2 {head} {{")
    for axis, (low, high) in zip("xyz", ends, strict=True):
        at = f"range, ray.origin.{axis}, ray.direction.{axis}"
        if plan.marching.cones and "WIDE_CONE" in plan.variants:  # it also starts as wide as u_cone_start
            at = "range, ray.origin.{axis} {sign} u_cone_start, ray.direction.{axis} {sign} u_cone"
            clips = [f"above({at.format(axis=axis, sign='+')}, {low})"] if low else []
            clips += [f"below({at.format(axis=axis, sign='-')}, {high})"] if high else []
        elif plan.marching.cones:
            clips = [f"above({at} + u_cone, {low})"] if low else []
            clips += [f"below({at} - u_cone, {high})"] if high else []
        else:
            clip = "above" if not high else "below" if not low else "slab"
            clips = [f"{clip}({at}, {', '.join(filter(None, (low, high)))})"] if low or high else []
        for call in clips:
            text.add(f"    range = {call};")
    text.add("    return range;")
    text.add("}")


def _printed(ends: Ends) -> list[tuple[str, str]]:
    return [("" if low is None else literal(low), "" if high is None else literal(high)) for _, low, high in ends]


def marched_range(plan: Plan) -> Chunk:
    """The part of a ray in which solids are marched: from the first to the last of their boxes that it goes through."""
    boxes = [box_ends(facts) for facts in plan.analytic.boxes]
    text = Lines("the bounds of what is marched", where=plan.scene.node.where)
    if len(boxes) == 1:
        _clip_to_box(text, plan, "marched_range(Ray ray, vec2 range)", _printed(boxes[0]))
        return text.chunk("marched range")
    if boxes:
        bounded = [[any(box[i][j] is not None for box in boxes) for j in (1, 2)] for i in range(3)]
        ends = [
            ("low." + axis if low else "", "high." + axis if high else "")
            for axis, (low, high) in zip("xyz", bounded, strict=True)
        ]
        _clip_to_box(text, plan, "clip_to_box(Ray ray, vec2 range, vec3 low, vec3 high)", ends)
        text.add("")
    text.add("vec2 marched_range(Ray ray, vec2 range) {")
    text.add("    vec2 found = vec2(1.0e30, -1.0e30);")
    if boxes:
        text.add("    vec2 part;")
    for box in boxes:
        low = ", ".join(literal(-OPEN if end is None else end) for _, end, _ in box)
        high = ", ".join(literal(OPEN if end is None else end) for _, _, end in box)
        text.add(f"    part = clip_to_box(ray, range, vec3({low}), vec3({high}));")
        text.add("    if (part.x <= part.y) found = vec2(min(found.x, part.x), max(found.y, part.y));")
    text.add("    return found;")
    text.add("}")
    return text.chunk("marched range")


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
    text.add("    return range;")
    text.add("}")
    return text.chunk("scene cone")


def box_ends(facts: Facts) -> Ends:
    """Each axis with the lower and upper bound of the scene's box, None if unbounded.

    Bounds are padded so that rounding cannot cut off the surface.
    """
    found: Ends = []
    for i, axis in enumerate("xyz"):
        ends = [float(facts.lower[i]), float(facts.upper[i])]
        largest = max([abs(e) for e in ends if np.isfinite(e)], default=0.0)
        pad = 2.0**-20 * max(largest, 2.0**-60)  # 8 ulp of the box's coordinates
        low, high = (e + d if np.isfinite(e) else None for e, d in zip(ends, (-pad, pad), strict=True))
        found.append((axis, low, high))
    return found
