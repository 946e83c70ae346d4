"""Generated code that keeps the kind of the present ray, for parts hidden by `visible` and for counts by kind."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from raymarch.plan import Plan
from raymarch.sdf.visibility import KINDS, RAY_KIND
from raymarch.shader.chunk import Chunk, Mapped

BY = "kinds of rays"
OCCLUSION = "1.25"
"""The kind of samples of ambient occlusion: that of a shadow ray for the field, and another one for counts."""
SHADOWS = {
    "hard": "hard_shadow",
    "two-sided": "two_sided_shadow",
    "cone": "cone_shadow",
    "triangulated": "triangulated_shadow",
    "sampled": "hard_shadow",
}
"""The GLSL function of each kind of shadow."""


def number(kind: str) -> str:
    """The number of a kind of ray, as GLSL text."""
    return OCCLUSION if kind == "occlusion" else f"{float(KINDS.index(kind))}"


def shadow_function(plan: Plan, shadow: str) -> str:
    """The name of the function that traces a shadow."""
    return SHADOWS[shadow] + "_rays" * plan.tells_kinds


def set_kind(plan: Plan, kind: str, indent: str) -> str:
    """The line that begins rays of a kind; "" where no kinds are kept."""
    return f"{indent}{RAY_KIND.data} = {number(kind)};" if plan.tells_kinds else ""


def as_occlusion(plan: Plan, indent: str) -> tuple[list[str], list[str]]:
    """The lines before and after text that samples ambient occlusion; none where no kinds are kept."""
    if not plan.tells_kinds:
        return [], []
    kept = f"{indent}float kind = {RAY_KIND.data};"
    return [kept, set_kind(plan, "occlusion", indent)], [f"{indent}{RAY_KIND.data} = kind;"]


def chunks() -> dict[str, Callable[[], Chunk]]:
    """The variable of the kind, and functions that trace shadows with it, by name."""
    numbered = ", ".join(f"{number(kind)} {kind}" for kind in (*KINDS, "occlusion"))
    variable = Mapped(f"float {RAY_KIND.data} = 0.0;  // {numbered}", BY)
    found: dict[str, Callable[[], Chunk]] = {str(RAY_KIND.data): partial(Chunk.of, "kinds of rays", [variable])}
    return found | {f"{name}_rays": partial(_shadow, name) for name in SHADOWS.values()}


def _shadow(name: str) -> Chunk:
    width, given = ("", "") if name == "hard_shadow" else (", float width", ", width")
    lines = (
        f"float {name}_rays(Surface surface, Light light{width}) {{",
        f"    float kind = {RAY_KIND.data};",
        f"    {RAY_KIND.data} = {number('shadow')};",
        f"    float visibility = {name}(surface, light{given});",
        f"    {RAY_KIND.data} = kind;",
        "    return visibility;",
        "}",
    )
    return Chunk.of(f"{name}_rays", [Mapped(line, BY) for line in lines])
