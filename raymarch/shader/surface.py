"""Generated calls that evaluate materials: with maps, with patterns, or without both."""

from __future__ import annotations

from raymarch.plan import Plan
from raymarch.plan.shading import mapped, patterned


def with_footprint(plan: Plan) -> bool:
    """True if material functions take the normal and the footprint."""
    return plan.material is not None and mapped(plan.scene)


def material_arguments(plan: Plan) -> str:
    """The arguments of material functions: the point, and with maps also the normal and the footprint."""
    point = "surface.inner" if patterned(plan.scene) else "surface.p"
    return point + (", surface.geometric_normal, surface.dpdx, surface.dpdy" if with_footprint(plan) else "")


def visible_side(plan: Plan, ray: str, indent: str = "    ") -> list[str]:
    """The line that turns the normal of a hit to the ray; none with relief, whose normals may face away."""
    line = f"{indent}surface.normal = visible_side(surface.normal, {ray}.direction);"
    return [line] if plan.relief is None else []


def geometric_normal_of(plan: Plan) -> str:
    """The geometric normal, on the side of the shading normal."""
    return "surface.normal" if plan.relief is None else "geometric_normal(surface)"
