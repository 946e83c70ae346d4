"""Probe plans: plans whose shader inspects each node of the field while it draws.

Other plans contain no probe code. The picture is marched and shaded as usual, with one sample per pixel and no cones.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from raymarch.expr.faults import first_fault, plain
from raymarch.expr.function import Function
from raymarch.expr.node import Expr, const
from raymarch.expr.vocabulary import parts_of
from raymarch.plan.passes import Pass
from raymarch.plan.plan import Plan, plan
from raymarch.scene.quality import SINGLE_PASS
from raymarch.scene.scene import Scene
from raymarch.sdf.lower import Lowering
from raymarch.sdf.node import Node

WRITTEN = ("u_found", "u_place", "u_color")
FAULTS = Pass("nonfinite", "view/nonfinite", WRITTEN, "invalid values were requested", shades=True)
SLOPES = Pass("lipschitz", "view/lipschitz", WRITTEN, "Lipschitz constants of all nodes were requested", shades=True)


@dataclass(frozen=True, slots=True)
class Probing:
    """A plan and the nodes that it inspects, numbered from 1 in this order."""

    plan: Plan
    nodes: tuple[Node, ...]


def single_sample(scene: Scene) -> Scene:
    """The scene with one sample per pixel, marched in one pass without cones, by values of the field alone."""
    asked = scene.quality.tracer
    tracer = "bracketing" if asked in ("auto", "advance") else asked  # of certified fields; of estimates as "auto"
    single = scene.quality.replace(**SINGLE_PASS, samples=1, edges="samples")
    return scene.replace(quality=single.replace(analytic=False, tracer=tracer))


def plan_faults(scene: Scene) -> Probing:
    """A plan that finds the first value of each pixel that is not finite or outside its domain."""
    made, nodes = _planned(scene)
    inspected = [part for f in _surface(made) for part in parts_of(f.body)]
    field, surface = first_fault([made.field.body]), first_fault(inspected)
    further = [_function("field_faults", made.field, field), _function("surface_faults", made.field, surface)]
    probes = {"probe/note_calls": FAULTS.reason}
    return Probing(_stripped(made, plain(made.field), FAULTS, probes, further), nodes)


def plan_slopes(scene: Scene) -> Probing:
    """A plan that measures the largest slope of each node along the rays."""
    made, nodes = _planned(scene)
    return Probing(_stripped(made, made.field, SLOPES, {"probe/watch_calls": SLOPES.reason}), nodes)


def _planned(scene: Scene) -> tuple[Plan, tuple[Node, ...]]:
    nodes: list[Node] = []
    made = plan(single_sample(scene), lowering=Lowering(sites=nodes))
    return made, tuple(nodes)


def _surface(made: Plan) -> list[Function]:
    """The functions evaluated at the hit. Faults of textured materials (more arguments) show in the colour."""
    functions = (made.gradient, made.material, made.emission, made.glass)
    return [f for f in functions if f is not None and f.params == made.field.params]


def _function(name: str, like: Function, fault: Expr | None) -> Function:
    return Function(name, like.params, const([0.0, 0.0]) if fault is None else fault, where=like.where)


def _stripped(
    made: Plan, field: Function, chosen: Pass, probes: Mapping[str, str], further: Sequence[Function] = ()
) -> Plan:
    """The plan of one pass where a module defines `field`, with probes in `field_value` and no other function."""
    named = Function("field_value", field.params, field.body, field.names, field.where)
    optional = ("gradient", "emission", "material", "relief", "glass", "undivided")
    bare: dict[str, Any] = {name: plain(f) for name in optional if (f := getattr(made, name)) is not None}
    others = [*map(plain, made.further), *further]
    return replace(made, field=named, passes=[chosen], probes=probes, further=others, **bare)
