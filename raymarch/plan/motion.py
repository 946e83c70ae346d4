"""Where the points of a solid were in the frame before, while parameters and time move them.

Each shape has a space of its own, and what is painted or carved stays in place there. A point of the scene was where
the transforms of the frame before lead to the same point of that space. One step of Newton's method finds it, exactly
for translations, rotations, scales and shears. In a blend, each part moves the point by its share of the material.

The function runs with the uniforms of the frame BEFORE. Values of the frame that is drawn now reach it through twins of
the parameters.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from raymarch.errors import Location
from raymarch.expr.derivative import moved_along
from raymarch.expr.function import Function, sum_of
from raymarch.expr.node import Expr, const, construct, make
from raymarch.expr.types import VEC3
from raymarch.expr.vocabulary import cross, dot, length, where
from raymarch.expr.walk import find, free_variables, rebuild, rewrite
from raymarch.plan.hoisting import hoisted_from
from raymarch.scene.camera import Camera
from raymarch.scene.parameter import Spec
from raymarch.scene.scene import Scene
from raymarch.sdf.lower import PARTS, Lowering
from raymarch.sdf.weights import weights_of

STILL = const((0.0, 0.0, 0.0))

FLAT = 1e-3
"""The volume of a unit cube below which a transform counts as flat, so that it leads nowhere back."""

MOST = 64
"""Parts of a solid whose motion is followed; where there are more, the text of the shader would grow too long."""


def changes(scene: Scene) -> bool:
    """True if anything that is seen, the camera apart, reads time or a parameter."""
    return bool(find(scene.replace(camera=Camera()).expressions(), "time", "param"))


def motion_of(
    scene: Scene, lowering: Lowering, moments: Mapping[str, Expr], origins: dict[Expr, Location]
) -> tuple[Function, dict[str, Expr], dict[str, Expr]]:
    """`vec3 place_before(vec3 p)`: where the point p of this frame was in the one before, as far as transforms tell.

    Also the expressions of time alone, those of this function among them, and what each twin stands for, by its name.
    """
    marked, moments = hoisted_from(lowering.again().field(scene.node, label=PARTS), origins, moments)
    (p,) = marked.params
    twins = {leaf: _twin(leaf) for leaf in find([marked.body], "param", "time")}
    plain = {twin: leaf for leaf, twin in twins.items()}
    now = Function("now", (p,), _exchanged(marked.body, twins, {}))
    ways = []
    for mark in find([now.body], "mark"):
        here = mark.args[1]
        before = _exchanged(here, plain, {})
        follows = (
            here is not before and here.type is VEC3 and free_variables([here]) == [p] and not find([here], "cell")
        )
        ways.append(_led_back(here, before, p) if follows else STILL)
    way = STILL
    if all(each is ways[0] for each in ways):
        way = ways[0]
    elif len(ways) <= MOST:
        _, weights = weights_of(now)
        total = sum_of(weights)
        moved = [share * each for share, each in zip(weights, ways, strict=True) if each is not STILL]
        way = sum_of(moved) / where(total <= 0.0, 1.0, total)
    used = {twin.data.name: plain[twin] for twin in find([way], "param") if twin in plain}
    return Function("place_before", (p,), p + way), moments, used


def _twin(leaf: Expr) -> Expr:
    """The parameter that stands for another, or for time, as it is in this frame."""
    name, value = ("time", 0.0) if leaf.op == "time" else (leaf.data.name, leaf.data.value)
    return make("param", leaf.type, (), Spec(f"now {name}", value, None, None))


def _led_back(here: Expr, before: Expr, p: Expr) -> Expr:
    """The way to the point that the frame before leads to where this one leads p: a step of Newton's method."""
    x, y, z = moved_along(before, p, [const(axis) for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))])
    apart = here - before
    volume = dot(x, cross(y, z))
    way = construct(dot(cross(y, z), apart), dot(cross(z, x), apart), dot(cross(x, y), apart))
    flat = abs(volume) <= FLAT * length(x) * length(y) * length(z)
    return where(flat, STILL, way / where(flat, 1.0, volume))


def _exchanged(body: Expr, leaves: Mapping[Expr, Expr], made: dict[Function, Function]) -> Expr:
    """The expression with its leaves exchanged, in the functions and loops below it too."""

    def concerned(inner: Sequence[Expr]) -> bool:
        return any(leaf in leaves for leaf in find(inner, "param", "time"))

    def rule(node: Expr, args: tuple[Expr, ...]) -> Expr:
        if node in leaves:
            return leaves[node]
        if node.op == "call" and concerned([node.data.body]):
            old: Function = node.data
            if old not in made:
                made[old] = Function(old.name, old.params, _exchanged(old.body, leaves, made), old.names, old.where)
            return make("call", node.type, args, made[old])
        if node.op == "loop" and concerned(node.data.inner):
            inner = [_exchanged(e, leaves, made) for e in node.data.inner]
            n = len(node.data.step)
            until = inner[n] if node.data.until is not None else None
            return make("loop", node.type, args, replace(node.data, step=tuple(inner[:n]), until=until))
        return rebuild(node, args)

    return rewrite([body], rule)[body]
