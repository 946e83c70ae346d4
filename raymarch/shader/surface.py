"""How the functions of looks are asked: with maps, with patterns, and without."""

from __future__ import annotations

from raymarch.plan import Plan
from raymarch.plan.shading import patterned


def place_of(plan: Plan) -> str:
    """What says where on a surface a look is asked: its point, and where there are maps also how it is seen."""
    point = "surface.inner" if patterned(plan.scene) else "surface.p"
    return point + (", surface.geometric_normal, surface.dpdx, surface.dpdy" if plan.relief is not None else "")


def surface_of(plan: Plan, ray: str, travelled: str) -> tuple[str, str]:
    """A call for the surface that a ray met after light has `travelled` so far, and the name of its function."""
    if not patterned(plan.scene):
        return f"surface_interaction({ray}, hit)", "surface_interaction"
    name = "surface_interaction_patterned" if plan.relief is None else "surface_interaction_mapped"
    return f"{name}({ray}, hit, {travelled})", name


def normal_of(plan: Plan) -> tuple[str, tuple[str, ...]]:
    """The normal of the solid itself, bent by no map, on the side of the other one, and what it needs."""
    return ("surface.normal", ()) if plan.relief is None else ("geometric_normal(surface)", ("geometric_normal",))
