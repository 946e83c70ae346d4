"""Print a plan, or return it as plain data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from raymarch.plan.device import as_plain
from raymarch.plan.plan import Plan
from raymarch.plan.presets import meanings

WIDTH = 30
"""Width of the column of names; the longest is that of a module."""


def as_dict(plan: Plan, modules: Mapping[str, str]) -> dict[str, Any]:
    """The plan as plain data for JSON. Infinite values are None.

    modules : the linked GLSL modules with their reasons.
    """
    facts = plan.given.node.facts
    return {
        "field": {
            "exactness": plan.given.node.exactness,
            "lipschitz": _finite(plan.given.node.lipschitz),
            "bounds": [[_finite(v) for v in corner] for corner in (facts.lower, facts.upper)],
            "nodes": plan.nodes,
            "shapes": plan.shapes,
            "operations": plan.operations,
        },
        "device": {**as_plain(plan.device), "reason": plan.device.reason},
        "passes": [{"name": p.name, "textures": p.textures, "reason": p.reason} for p in plan.passes],
        "modules": [{"name": name, "reason": reason} for name, reason in modules.items()],
        "features": [
            {"name": f.name, "used": f.used, "reason": f.reason, "where": str(f.where) if f.where else None}
            for f in plan.features
        ],
        "textures": [
            {"name": t.label, "size": list(t.size), "channels": t.channels, "bytes": t.nbytes} for t in plan.textures
        ],
        "parameters": [
            {"name": s.name, "value": s.value, "min": s.min, "max": s.max, "where": str(s.where) if s.where else None}
            for s in plan.parameters.values()
        ],
        "presets": [asdict(meaning) for meaning in meanings(plan.given)],
        "warnings": list(plan.warnings),
    }


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def show(plan: Plan, modules: Mapping[str, str], shader_bytes: int, console: Any) -> None:
    """Print the plan, one reason per line, to a rich console.

    modules : the linked GLSL modules with their reasons. shader_bytes : size of the shader text.
    """
    node = plan.given.node

    def heading(text: str) -> None:
        console.print(f"\n[bold]{text}[/bold]")

    def row(name: str, text: str) -> None:
        console.print(f"  {name:<{WIDTH}}  {text}", markup=False)

    console.print("[bold]Field[/bold]")  # the first line
    lower, upper = (", ".join(f"{v:.4g}" for v in corner) for corner in node.bounds)
    row("exactness", f"{node.exactness}: {_MEANING[node.exactness]}")
    row("lipschitz", f"{node.lipschitz:.4g}")
    row("bounds", f"({lower}) to ({upper})")
    row("nodes", f"{plan.nodes}, with {plan.shapes} distinct shapes")
    row("operations", f"{plan.operations} per evaluation")
    row("planned for", f"{plan.device.name}: {plan.device.reason}")
    row("prices", plan.device.measured or f"those of the class {plan.device.name}")
    heading("Passes")
    for chosen in plan.passes:
        row(chosen.name, f"{chosen.textures} texture{'s' * (chosen.textures > 1)}: {chosen.reason}")
    heading(f"Modules ({shader_bytes} bytes of shader)")
    for name, reason in modules.items():
        row(name, reason)
    for used, title in ((True, "Used"), (False, "Left out")):
        heading(title)
        for feature in plan.features:
            if feature.used == used:
                row(feature.name, feature.reason + (f" ({feature.where})" if feature.where else ""))
    if plan.textures:
        heading(f"Textures ({_bytes(sum(data.nbytes for data in plan.textures))})")
        for data in plan.textures:
            size = " x ".join(map(str, data.size))
            row(data.label, f"{size}, {data.channels} channel{'s' * (data.channels > 1)}, {_bytes(data.nbytes)}")
    if plan.parameters:
        heading("Parameters")
        for spec in plan.parameters.values():
            row(spec.name, f"{spec.value}, {spec.legal}")
    heading("Presets (--quality), measured on the examples; --error measures this scene")
    for meaning in meanings(plan.given):
        row(meaning.name, meaning.words)
    for warning in plan.warnings:
        console.print("\n[bold]Warning[/bold]", end=" ")
        console.print(warning, markup=False)


def _bytes(count: int) -> str:
    return f"{count / 2**20:.1f} MiB" if count >= 2**20 else f"{count / 2**10:.1f} KiB"


_MEANING = {
    "exact": "the Euclidean distance everywhere",
    "bound": "never larger than the distance, so no step passes through a surface",
    "estimate": "no guarantee",
}
