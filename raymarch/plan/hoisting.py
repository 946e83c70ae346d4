"""Hoisting: subexpressions that read time but not the point are computed on the CPU in float64, once per frame.

After a day, an ulp of `time` in float32 is .0078 s, so an angle that grows with time would turn in jerks. Sines, angles
and offsets of time are passed as uniforms instead, which also saves work in each evaluation of the field; so are costly
expressions of parameters. A wave such as sin(x + time) depends on time and on the point. It is periodic, so its time
term is reduced modulo the period.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from raymarch.errors import Location
from raymarch.expr.function import Function, unique_function
from raymarch.expr.node import Expr, make
from raymarch.expr.operations import operations
from raymarch.expr.types import FLOAT, Type
from raymarch.expr.walk import find, rebuild, topological
from raymarch.prices import STANDARD, Prices
from raymarch.scene.parameter import Spec, Value, Values
from raymarch.sdf.lower import rewritten

NEVER_HOISTED = frozenset(
    "var apply cell loop item mark sample sample_slope sample_bend fetch texture raw raw_slope".split()
)
"""Operations that depend on the point, or that only the shader can evaluate."""


class Hoisting:
    """Replaces time-only subexpressions, and costly ones of parameters alone, by new parameters, which the functions of
    a plan share.

    origins : the user's line of each expression; lines of new expressions are added. prices : of the device.
    expressions : what each parameter stands for, by its name.
    """

    def __init__(self, origins: dict[Expr, Location], prices: Prices = STANDARD) -> None:
        self.origins, self._least = origins, prices.uniform
        self.expressions: dict[str, Expr] = {}
        self._leaves: dict[Expr, Expr] = {}
        self._done: dict[Function, Function] = {}

    def __call__(self, function: Function) -> Function:
        """The function with its time-only subexpressions replaced, and costly ones of parameters."""
        if function not in self._done:
            read = {leaf.op for leaf in find([function.body], "time", "param")}
            if not read or ("time" not in read and not _costly(function.body, self._least)):
                self._done[function] = function
        if function not in self._done:
            made: dict[Function, Function] = {}
            for old in topological([function], _called):
                body = _calling(old.body, made, self.origins)
                body = _replaced(body, _phases(body), self.origins)
                for node in (*_largest(body), *_costly(body, self._least)):
                    if node not in self._leaves:
                        name = f"hoisted {len(self.expressions)}"
                        spec = Spec(name, _plain(Values({}).of(node)), None, None, self.origins.get(node))
                        self.expressions[name] = node
                        self._leaves[node] = make("param", node.type, (), spec)
                body = _replaced(body, self._leaves, self.origins)
                same = body is old.body
                made[old] = old if same else unique_function(old.name, old.params, body, old.names, old.where)
            self._done[function] = made[function]
        return self._done[function]


def _called(definition: Function) -> tuple[Function, ...]:
    """The functions that may combine time with the point."""
    still, _ = _of_time(definition.body)
    calls = [node for node in topological([definition.body]) if node.op == "call" and node not in still]
    return tuple(node.data for node in calls if find([node.data.body], "time"))


def _calling(body: Expr, made: Mapping[Function, Function], origins: dict[Expr, Location]) -> Expr:
    """The body with calls redirected to the rewritten functions."""
    still, _ = _of_time(body)

    def rule(node: Expr, args: tuple[Expr, ...]) -> Expr:
        if node.op == "call" and node not in still and node.data in made:
            return make("call", node.type, args, made[node.data])
        return rebuild(node, args)

    return rewritten(body, rule, origins)[body]


def _replaced(body: Expr, leaves: Mapping[Expr, Expr], origins: dict[Expr, Location]) -> Expr:
    """The body with each key of `leaves` replaced by its value."""

    def rule(node: Expr, args: tuple[Expr, ...]) -> Expr:
        return leaves[node] if node in leaves else rebuild(node, args)

    return rewritten(body, rule, origins)[body]


def with_hoisted(hoisted: Mapping[str, Expr], values: Values) -> Values:
    """The values of a frame, including those of the hoisted parameters."""
    if not hoisted:
        return values
    known = {name: _plain(values.of(node)) for name, node in hoisted.items()}
    return Values({**values.params, **known}, values.time)


def _largest(body: Expr) -> list[Expr]:
    """The maximal time-only expressions. `time` itself is not among them: hoisting it would gain no precision."""
    still, moving = _of_time(body)
    found = {arg: None for node in topological([body]) if node not in still for arg in node.args if arg in moving}
    if body in moving:
        found[body] = None
    return [node for node in found if node.op != "time"]


def _costly(body: Expr, least: float) -> list[Expr]:
    """The maximal expressions of parameters alone that take so many operations or more."""
    still, moving = _of_time(body)
    found = {arg: None for node in topological([body]) if node not in still for arg in node.args if arg in still}
    return [node for node in found if node not in moving and operations([node]) >= least and find([node], "param")]


def _of_time(body: Expr) -> tuple[set[Expr], set[Expr]]:
    """The expressions that do not depend on the point and can be parameters, and those of them that depend on time.

    Matrices and booleans cannot be parameters.
    """
    still: set[Expr] = set()
    moving: set[Expr] = set()
    for node in topological([body]):
        if node.op in NEVER_HOISTED or not _has_leaf(node.type) or not all(arg in still for arg in node.args):
            continue
        still.add(node)
        if node.op == "time" or any(arg in moving for arg in node.args) or (node.op == "call" and find([node], "time")):
            moving.add(node)
    return still, moving


def _phases(body: Expr) -> dict[Expr, Expr]:
    """The sines and cosines of sums with a time term, each with its copy whose term is reduced modulo the period."""
    still, moving = _of_time(body)
    waves = {}
    for node in topological([body]):
        if node.op in ("sin", "cos") and node not in still:
            (phase,) = node.args
            turned = _turned(phase, 2.0 * math.pi, moving)
            if turned is not phase:
                waves[node] = rebuild(node, (turned,))
    return waves


def _turned(phase: Expr, period: float, moving: set[Expr]) -> Expr:
    """The sum with its time terms reduced modulo the period; a factor of the sum divides the period."""
    done: dict[tuple[Expr, float], Expr] = {}
    pending = [(phase, period)]
    while pending:
        term, turn = key = pending[-1]
        if key in done:
            pending.pop()
            continue
        factor = _factor(term)
        if term in moving:
            done[key] = term % turn
        elif factor is None and term.op not in ("add", "sub", "neg", "swizzle"):
            done[key] = term
        else:
            inner = turn if factor is None else turn / abs(float(factor.data))
            waiting = [(arg, inner) for arg in term.args if arg is not factor and (arg, inner) not in done]
            pending += waiting
            if not waiting:
                done[key] = rebuild(term, tuple(a if a is factor else done[a, inner] for a in term.args))
    return done[phase, period]


def _factor(term: Expr) -> Expr | None:
    if term.op != "mul":
        return None
    return next((arg for arg in term.args if arg.is_constant and arg.type is FLOAT and arg.data != 0), None)


def _has_leaf(type: Type) -> bool:
    return not type.is_matrix and type.name in ("float", "vec2", "vec3", "vec4")


def _plain(value: np.ndarray) -> Value:
    return float(value) if value.shape == () else tuple(float(v) for v in value)
