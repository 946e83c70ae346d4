"""Generated code that clips rays and cones to the scene's box."""

from __future__ import annotations

import numpy as np

from raymarch.expr.glsl import literal
from raymarch.plan import Plan
from raymarch.sdf.facts import Facts
from raymarch.shader.chunk import Chunk, Lines


def scene_box(plan: Plan) -> Chunk:
    """The part of a ray inside the scene's box, which is padded so that rounding cannot cut off the surface.

    A cone is inside where any of its points is: its radius u_cone t moves each plane outwards, as if its axis pointed
    further inwards. For rays u_cone is 0.
    """
    text = Lines("the scene's bounds", where=plan.scene.node.where)
    _clip_to_box(text, plan, "scene_box", plan.scene.node.facts)
    return text.chunk("scene box")


def _clip_to_box(text: Lines, plan: Plan, name: str, facts: Facts) -> None:
    """The function that clips a ray or a cone to a box."""
    text.add(f"vec2 {name}(Ray ray, vec2 range) {{")
    for axis, low, high in box_ends(facts):
        at = f"range, ray.origin.{axis}, ray.direction.{axis}"
        if plan.marching.cones and "WIDE_CONE" in plan.variants:  # it also starts as wide as u_cone_start
            at = "range, ray.origin.{axis} {sign} u_cone_start, ray.direction.{axis} {sign} u_cone"
            clips = [f"above({at.format(axis=axis, sign='+')}, {literal(low)})"] if low is not None else []
            clips += [f"below({at.format(axis=axis, sign='-')}, {literal(high)})"] if high is not None else []
        elif plan.marching.cones:
            clips = [f"above({at} + u_cone, {literal(low)})"] if low is not None else []
            clips += [f"below({at} - u_cone, {literal(high)})"] if high is not None else []
        else:
            planes = ", ".join(literal(end) for end in (low, high) if end is not None)
            clip = "above" if high is None else "below" if low is None else "slab"
            clips = [f"{clip}({at}, {planes})"] if planes else []
        for call in clips:
            text.add(f"    range = {call};")
    text.add("    return range;")
    text.add("}")


def marched_range(plan: Plan) -> Chunk:
    """The part of a ray in which solids are marched: from the first to the last of their boxes that it goes through."""
    boxes = plan.analytic.boxes
    text = Lines("the bounds of what is marched", where=plan.scene.node.where)
    if len(boxes) == 1:
        _clip_to_box(text, plan, "marched_range", boxes[0])
        return text.chunk("marched range")
    for i, box in enumerate(boxes):
        _clip_to_box(text, plan, f"marched_box_{i}", box)
    text.add("vec2 marched_range(Ray ray, vec2 range) {")
    text.add("    vec2 found = vec2(1.0e30, -1.0e30);")
    if boxes:
        text.add("    vec2 part;")
    for i in range(len(boxes)):
        text.add(f"    part = marched_box_{i}(ray, range);")
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


def box_ends(facts: Facts) -> list[tuple[str, float | None, float | None]]:
    """Each axis with the lower and upper bound of the scene's box, None if unbounded.

    Bounds are padded so that rounding cannot cut off the surface.
    """
    found: list[tuple[str, float | None, float | None]] = []
    for i, axis in enumerate("xyz"):
        ends = [float(facts.lower[i]), float(facts.upper[i])]
        largest = max([abs(e) for e in ends if np.isfinite(e)], default=0.0)
        pad = 2.0**-20 * max(largest, 2.0**-60)  # 8 ulp of the box's coordinates
        low, high = (e + d if np.isfinite(e) else None for e, d in zip(ends, (-pad, pad), strict=True))
        found.append((axis, low, high))
    return found
