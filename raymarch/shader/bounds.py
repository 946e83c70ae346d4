"""Generated code that clips rays and cones to the scene's box."""

from __future__ import annotations

import numpy as np

from raymarch.expr.glsl import literal
from raymarch.plan import Plan
from raymarch.sdf.facts import Facts
from raymarch.shader.chunk import Chunk, Lines, Mapped


def scene_box(plan: Plan) -> Chunk:
    """The part of a ray inside the scene's box, which is padded so that rounding cannot cut off the surface.

    A cone is inside where any of its points is: its radius u_cone t moves each plane outwards, as if its axis pointed
    further inwards. For rays u_cone is 0.
    """
    steps, needs = [], {"Ray"}
    cones = plan.marching.cones
    for axis, low, high in box_ends(plan.scene.node.facts):
        at = f"ray.origin.{axis}, ray.direction.{axis}"
        if cones:
            clips = [(f"above(range, {at} + u_cone, {literal(low)})", "above")] if low is not None else []
            clips += [(f"below(range, {at} - u_cone, {literal(high)})", "below")] if high is not None else []
        else:
            planes = ", ".join(literal(end) for end in (low, high) if end is not None)
            clip = "above" if high is None else "below" if low is None else "slab"
            clips = [(f"{clip}(range, {at}, {planes})", clip)] if planes else []
        steps += [f"    range = {text};" for text, _ in clips]
        needs |= {name for _, name in clips}
    needs |= {"u_cone"} if cones else set()
    text = ["vec2 scene_box(Ray ray, vec2 range) {", *steps, "    return range;", "}"]
    lines = tuple(Mapped(line, "the scene's bounds", plan.scene.node.where) for line in text)
    return Chunk("scene box", frozenset(needs), frozenset({"scene_box"}), lines)


def scene_cone(plan: Plan) -> Chunk:
    """The range of a ray in which a cone around it overlaps the scene's box; for soft shadows.

    `width` is the tangent of the cone's half angle. A point at a distance width * t from the ray can be below a plane
    at `upper` where origin + (direction - width) t is below it.
    """
    text = Lines("the scene's bounds")
    text.add("vec2 scene_cone(Ray ray, vec2 range, float width) {", "Ray")
    for axis, low, high in box_ends(plan.scene.node.facts):
        at = f"range, ray.origin.{axis}, ray.direction.{axis}"
        if high is not None:
            text.add(f"    range = below({at} - width, {literal(high)});", "below")
        if low is not None:
            text.add(f"    range = above({at} + width, {literal(low)});", "above")
    text.add("    return range;")
    text.add("}")
    return Chunk("scene cone", frozenset(text.needs), frozenset({"scene_cone"}), tuple(text.lines))


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
