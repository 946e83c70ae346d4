"""Motion vectors: the position of a surface point in the previous frame, when parameters and time move the solid.

Each shape has its own object space, in which patterns and carvings stay fixed. A point was where the transforms of the
previous frame map to the same point of object space. One step of Newton's method finds it, and is exact for
translations, rotations, scales and shears. In a blend, the motion is the mean of the parts' motions by material weight.

The function runs with the uniforms of the PREVIOUS frame. Twins of the parameters pass the values of the current frame.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from raymarch.expr.derivative import directional_derivatives
from raymarch.expr.function import Function, changed_inside, sum_of
from raymarch.expr.node import Expr, const, construct, make
from raymarch.expr.types import VEC3
from raymarch.expr.vocabulary import cross, dot, length, where
from raymarch.expr.walk import find, free_variables, rebuild, rewrite
from raymarch.scene.parameter import Spec
from raymarch.scene.scene import Scene
from raymarch.sdf.lower import PARTS, Lowering
from raymarch.sdf.node import Node
from raymarch.sdf.weights import weights_of

STILL = const((0.0, 0.0, 0.0))

FLAT = 1e-3
"""Relative volume of a mapped unit cube below which a transform counts as singular, so that no motion is computed."""

MOST = 64
"""Largest number of parts with motion vectors; with more, the shader text would grow too long."""


def changes(scene: Scene) -> bool:
    """True if anything but the camera reads time or a parameter."""
    return bool(find(scene.expressions(camera=False), "time", "param"))


def motion_of(
    solid: Node, lowering: Lowering, hoist: Callable[[Function], Function] = lambda function: function
) -> tuple[Function, dict[str, Expr]]:
    """`vec3 previous_position(vec3 p)`: where the point p of this frame was in the previous frame, by transforms alone.

    hoist : replaces expressions of time alone, see `raymarch.plan.hoisting`.

    Also returns the leaf that each twin stands for, by the twin's name.
    """
    marked = hoist(lowering.again().field(solid, label=PARTS))
    (p,) = marked.params
    twins = {leaf: _twin(leaf) for leaf in find([marked.body], "param", "time")}
    plain = {twin: leaf for leaf, twin in twins.items()}
    now = Function("now", (p,), _exchanged(marked.body, twins))
    motions = []
    for mark in find([now.body], "mark"):
        here = mark.args[1]
        before = _exchanged(here, plain)
        tracked = (
            here is not before and here.type is VEC3 and free_variables([here]) == [p] and not find([here], "cell")
        )
        motions.append(_motion_back(here, before, p) if tracked else STILL)
    motion = STILL
    if all(each is motions[0] for each in motions):
        motion = motions[0]
    elif len(motions) <= MOST:
        _, weights = weights_of(now)
        total = sum_of(weights)
        moved = [weight * each for weight, each in zip(weights, motions, strict=True) if each is not STILL]
        motion = sum_of(moved) / where(total <= 0.0, 1.0, total)
    used = {twin.data.name: plain[twin] for twin in find([motion], "param") if twin in plain}
    return Function("previous_position", (p,), p + motion), used


def _twin(leaf: Expr) -> Expr:
    """The parameter that holds the value of another parameter, or of time, in the current frame."""
    name, value = ("time", 0.0) if leaf.op == "time" else (leaf.data.name, leaf.data.value)
    return make("param", leaf.type, (), Spec(f"now {name}", value, None, None))


def _motion_back(here: Expr, before: Expr, p: Expr) -> Expr:
    """The motion from p to the point that the previous frame maps where this frame maps p: one Newton step."""
    x, y, z = directional_derivatives(
        before, p, [const(axis) for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))]
    )
    apart = here - before
    volume = dot(x, cross(y, z))
    motion = construct(dot(cross(y, z), apart), dot(cross(z, x), apart), dot(cross(x, y), apart))
    flat = abs(volume) <= FLAT * length(x) * length(y) * length(z)
    return where(flat, STILL, motion / where(flat, 1.0, volume))


def _exchanged(body: Expr, leaves: Mapping[Expr, Expr]) -> Expr:
    """The expression with its leaves replaced, also inside the functions and loops that it uses."""
    made: dict[Function, Function] = {}

    def rule(node: Expr, args: tuple[Expr, ...]) -> Expr:
        if node in leaves:
            return leaves[node]
        if node.op == "call":
            return make("call", node.type, args, changed_inside(node.data, rule, made))
        if node.op == "loop":
            return make("loop", node.type, args, node.data.changed(rule))
        return rebuild(node, args)

    return rewrite([body], rule)[body]
