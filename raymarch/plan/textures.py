"""The textures that a plan's shader reads."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeAlias

from raymarch.expr.samples import Samples
from raymarch.expr.texels import Texels
from raymarch.expr.walk import find

if TYPE_CHECKING:
    from raymarch.plan.plan import Plan

Data: TypeAlias = Samples | Texels


def textures_of(plan: Plan) -> list[Data]:
    """The pictures and sampled data that the field and the materials read, each once."""
    functions = (plan.field, plan.material, plan.relief, plan.emission, plan.glass)
    roots = [root for function in functions if function is not None for root in function.inner]
    if any(p.shades for p in plan.passes):
        roots.append(plan.scene.sky.radiance)
    return list(dict.fromkeys(node.data for node in find(roots, "texture", "sample", "sample_slope")))
