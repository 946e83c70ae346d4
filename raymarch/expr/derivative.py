"""The derivative reading: symbolic gradients of expressions.

Reverse mode is used inside a definition. A call of a scalar field becomes a call of its companion function, which
returns gradient and value together (`vec4 sphere_gradient(...)`), so no field is evaluated twice. Loops use forward
mode, with the tangents as additional state, because reverse mode would need the history of the state.

Derivatives at kinks and singular points are finite. The derivative of abs(x) and of length(v) at 0 is 0. That of
max(a, b) where a = b is that of a, unless only b depends on the variable. Kinks of the same difference take the same
side (see `raymarch.expr.ties`): min(a, b) + abs(a - b) and max(a, b) have the same derivative.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TypeAlias
from weakref import WeakKeyDictionary

import numpy as np

import raymarch.expr.vocabulary as v
from raymarch.expr.adjoints import Masks, accumulate, taken
from raymarch.expr.choices import merge_calls
from raymarch.expr.function import Function, close_loop, sum_of
from raymarch.expr.node import Expr, const, construct, make, swizzle, var
from raymarch.expr.operations import operations_of
from raymarch.expr.partials import ONE, PARTIALS, STILL, ZERO, Partials, safe_inverse, zero
from raymarch.expr.raw import slope as raw_slope
from raymarch.expr.samples import sample_slope
from raymarch.expr.ties import one_sided
from raymarch.expr.types import BOOL, FLOAT, STATE, VEC2, VEC3
from raymarch.expr.walk import depends_on, rebuild, rewrite, substitute, topological


def _outer(a: Expr, b: Expr) -> Expr:
    return a @ v.transpose(b) if b.type.is_matrix else v.columns(*[a * b[i] for i in range(len(b))])


def _inner(a: Expr, b: Expr) -> Expr:
    """The sum of the products of all components of two vectors or matrices."""
    if not a.type.is_matrix:
        return v.dot(a, b)
    axes = [const(row) for row in np.eye(a.type.size)]
    return sum_of([v.dot(a @ axis, b @ axis) for axis in axes])


def _scatter(adjoint: Expr, e: Expr) -> Expr:
    """Adjoint of a swizzle: the adjoint on the selected components, 0 on the others."""
    sums = dict.fromkeys("xyzw"[: e.args[0].type.size], ZERO)
    for component, part in zip(e.data, [adjoint] if adjoint.type is FLOAT else adjoint, strict=True):
        sums[component] = sums[component] + part
    return construct(*sums.values())


def _gather(adjoint: Expr, e: Expr, index: int) -> Expr:
    """Adjoint of a vector constructor: the components of this argument."""
    start = sum(a.type.size for a in e.args[:index])
    parts = [adjoint[start + i] for i in range(e.args[index].type.size)]
    return parts[0] if len(parts) == 1 else construct(*parts)


def _unit(e: Expr, tangent: Expr) -> Expr:
    """Directional derivative of normalize; the Jacobian is symmetric."""
    return (tangent - e * v.dot(e, tangent)) * safe_inverse(v.length(e.args[0]))


def slope_of_call(e: Expr, i: int) -> Expr:
    """The gradient of a call by its argument i, from the companion function (see `companion`)."""
    both = companion(e.data, i)(*e.args)
    return swizzle(both, "xyz"[: both.type.size - 1])


def _slope_along(e: Expr, tangents: Sequence[Expr]) -> Expr:
    """Directional derivative of a call."""
    moving = [(i, tangent) for i, tangent in enumerate(tangents) if tangent is not zero(tangent.type)]
    return sum_of([v.dot(slope_of_call(e, i), tangent) for i, tangent in moving]) if moving else zero(e.type)


def _across(adjoint: Expr, e: Expr) -> Expr:
    """Adjoint of a probe: a probe in the reverse direction between the two nodes."""
    return make(
        "probe", adjoint.type, (adjoint,), e.data._replace(role="gradient", site=e.data.other, other=e.data.site)
    )


Back: TypeAlias = Callable[[Expr, Expr, int], "Expr | None"]
BACKWARD: Mapping[str, Back] = {
    "dot": lambda adj, e, i: adj * e.args[1 - i],
    "length": lambda adj, e, i: adj * v.normalize(e.args[0]),
    "normalize": lambda adj, e, i: _unit(e, adj),
    "cross": lambda adj, e, i: v.cross(e.args[1], adj) if i == 0 else v.cross(adj, e.args[0]),
    "swizzle": lambda adj, e, i: _scatter(adj, e),
    "construct": lambda adj, e, i: _gather(adj, e, i),
    "matmul": lambda adj, e, i: v.transpose(e.args[0]) @ adj if i == 1 else _outer(adj, e.args[1]),
    "where": lambda adj, e, i: (
        None
        if i == 0
        else v.where(e.args[0], adj, zero(adj.type))
        if i == 1
        else v.where(e.args[0], zero(adj.type), adj)
    ),
    "call": lambda adj, e, i: adj * slope_of_call(e, i),
    "columns": lambda adj, e, i: adj @ const([1.0 if k == i else 0.0 for k in range(adj.type.size)]),
    "transpose": lambda adj, e, i: v.transpose(adj),
    "raw": lambda adj, e, i: adj * raw_slope(e),
    "raw_slope": lambda adj, e, i: None,
    "sample": lambda adj, e, i: adj * sample_slope(e),
    **dict.fromkeys(("sample_slope", "sample_bend"), lambda adj, e, i: None),
    "probe": lambda adj, e, i: _across(adj, e) if i == 0 else None,
    "within": lambda adj, e, i: adj,
}
"""Operations that mix components: the adjoint of argument i from the adjoint of the result."""

Forward: TypeAlias = Callable[[Expr, Sequence[Expr]], Expr]
FORWARD: Mapping[str, Forward] = {
    "dot": lambda e, t: v.dot(t[0], e.args[1]) + v.dot(e.args[0], t[1]),
    "length": lambda e, t: v.dot(v.normalize(e.args[0]), t[0]),
    "normalize": lambda e, t: _unit(e, t[0]),
    "cross": lambda e, t: v.cross(t[0], e.args[1]) + v.cross(e.args[0], t[1]),
    "swizzle": lambda e, t: _take(t[0], e.data),
    "construct": lambda e, t: construct(*t),
    "matmul": lambda e, t: _product_rule(e, t),
    "where": lambda e, t: v.where(e.args[0], t[1], t[2]),
    "call": lambda e, t: _slope_along(e, t),
    "columns": lambda e, t: v.columns(*t),
    "transpose": lambda e, t: v.transpose(t[0]),
    "raw": lambda e, t: v.dot(raw_slope(e), t[0]),
    "raw_slope": lambda e, t: zero(e.type),
    "sample": lambda e, t: v.dot(sample_slope(e), t[0]),
    **dict.fromkeys(("sample_slope", "sample_bend"), lambda e, t: zero(e.type)),
    "probe": lambda e, t: t[0],
    "within": lambda e, t: t[0],
}
"""The same operations forwards: the tangent of the result from the tangents of the arguments."""


def _product_rule(e: Expr, tangents: Sequence[Expr]) -> Expr:
    """The tangent of a product of matrices, or of a matrix and a vector, without the factors that do not move."""
    (a, b), (da, db) = e.args, tangents
    terms = [term for term, t in ((da @ b, da), (a @ db, db)) if t is not zero(t.type)]
    return terms[0] + terms[1] if len(terms) > 1 else terms[0] if terms else zero(e.type)


def _take(value: Expr, components: str) -> Expr:
    parts = [value["xyzw".index(c)] for c in components]
    return parts[0] if len(parts) == 1 else construct(*parts)


def gradient(root: Expr, variable: Expr) -> Expr:
    """The gradient of a scalar expression with respect to a scalar or vector variable, as an expression."""
    return value_and_gradient(root, variable)[1]


def value_and_gradient(root: Expr, variable: Expr) -> tuple[Expr, Expr]:
    """The expression, rewritten to share subexpressions with its gradient, and the gradient."""
    (slope,) = merge_calls([raw_gradient(root, variable)], saving)
    value, slope = share_values([opened(root, variable), slope])
    return value, slope


def raw_gradient(root: Expr, variable: Expr) -> Expr:
    """The gradient of a scalar expression before calls are merged or shared."""
    return backpropagate(opened(root, variable), variable).get(variable, zero(variable.type))


def opened(root: Expr, variable: Expr) -> Expr:
    """The expression with the calls inlined that its gradient inlines, so that both share their parts."""
    return _open([root], {variable})[0]


def share_values(roots: Sequence[Expr]) -> list[Expr]:
    """The roots, with values taken from the calls and loops that also compute gradients, where there are any."""
    roots = share_calls(roots)
    while loops := _lifted_loops(roots):  # a loop with tangents also computes the values
        roots = substitute(roots, loops)
    return roots


def saving(definition: Function) -> int:
    """Operations that a gradient takes beyond those of the value; 0 for other functions."""
    plain: Function | None = definition.stated.gradient_of
    return operations_of(definition) - operations_of(plain) if plain is not None else 0


def share_calls(roots: Sequence[Expr]) -> list[Expr]:
    """The roots, with the value of a function taken from the call that also returns its gradient, if there is one."""
    known = {
        (plain, node.args): node.data
        for node in topological(roots)
        if node.op == "call" and (plain := node.data.stated.gradient_of) is not None
    }
    if not known:
        return list(roots)

    def rule(node: Expr, args: tuple[Expr, ...]) -> Expr:
        both = known.get((node.data, node.args)) if node.op == "call" else None
        if both is None:
            return rebuild(node, args)
        value = both(*args)
        return value[value.type.size - 1]

    new = rewrite(roots, rule)
    return [new[root] for root in roots]


def _lifted_loops(roots: Sequence[Expr]) -> dict[Expr, Expr]:
    """Results of loops whose version with tangents also occurs, with the results that replace them."""
    order = topological(roots)
    wholes = [node for node in order if node.op == "loop"]
    twins = {_lifted_from[twin]: twin for twin in wholes if twin in _lifted_from}
    found = {}
    for node in order if twins else ():
        if node.op == "item" and node.args[0] in twins:
            found[node] = make("item", node.type, (twins[node.args[0]],), node.data)
    return found


_lifted_from: WeakKeyDictionary[Expr, Expr] = WeakKeyDictionary()
"""The original loop of each loop with tangents."""


def partial_derivatives(root: Expr, marked: Sequence[Expr]) -> list[Expr]:
    """Derivatives of the root with respect to marked scalar subexpressions: the weights of material blending."""
    marks = [var(f"mark {i}", FLOAT) for i in range(len(marked))]
    cut = substitute([root], dict(zip(marked, marks, strict=True)))[0]
    opened = _open([cut], set(marks))[0]
    adjoints = backpropagate(opened, *marks)
    weights = [adjoints.get(mark, ZERO) for mark in marks]
    plain = [m.args[0] if m.op == "mark" else m for m in marked]
    return substitute(weights, dict(zip(marks, plain, strict=True)))


def backpropagate(root: Expr, *variables: Expr) -> dict[Expr, Expr]:
    """Adjoints of all expressions between the variables and an opened scalar root.

    Where the root is a choice, such as the smaller of two numbers, so are its adjoints: nested `where` over the
    conditions of the kinks, the outermost first. Products are taken inside of the choices.
    """
    adjoints: dict[Expr, Expr] = {root: ONE}
    order = topological([root])
    partials, moving = one_sided(order, depends_on([root], variables)), _moving([root], variables)
    masks = Masks()
    for node in reversed(order):
        adjoint = adjoints.get(node)
        if adjoint is None or node not in moving or node in variables:
            continue
        mask = masks.of(adjoint)
        inner = taken(adjoint, mask) if mask else adjoint
        if node.op == "item":
            for variable in variables:
                accumulate(adjoints, variable, _back_through_loop(node, variable, inner), adjoint, mask)
            continue
        for i, arg in enumerate(node.args):
            if arg in moving:
                accumulate(adjoints, arg, _backward(inner, node, i, partials), adjoint, mask)
    return adjoints


def _backward(adjoint: Expr, node: Expr, i: int, partials: Mapping[Expr, Partials]) -> Expr | None:
    if node.op in BACKWARD:
        return BACKWARD[node.op](adjoint, node, i)
    partial = (partials.get(node) or PARTIALS[node.op])[i]
    if partial is None:
        return None
    slope = partial(node)
    if node.args[i].type is node.type:
        return _scaled(adjoint, slope)
    if slope.type is FLOAT:  # a scalar broadcast over a vector sums over all components
        return slope * _inner(adjoint, const(np.ones(adjoint.type.shape)))
    return _inner(adjoint, slope)


def _scaled(adjoint: Expr, slope: Expr) -> Expr:
    """adjoint * slope, as a choice if the slope is 1 on one side and 0 on the other."""
    if slope.op == "where" and slope.args[1].op == slope.args[2].op == "const":
        condition, yes, no = slope.args
        return v.where(condition, _times(adjoint, yes), _times(adjoint, no))
    if slope.op == "sub" and slope.args[0] is ONE and slope.args[1].op == "where":
        condition, yes, no = slope.args[1].args
        if yes.op == no.op == "const":
            return v.where(condition, _times(adjoint, 1.0 - yes), _times(adjoint, 1.0 - no))
    return _times(adjoint, slope)


def _times(adjoint: Expr, factor: Expr) -> Expr:
    """The product; for a constant factor 0 it is 0 and not -0."""
    return zero(adjoint.type) if factor is ZERO else adjoint * factor


# Opening: calls without a companion are inlined, so the tables above need no other calls.


def _moving(roots: Sequence[Expr], variables: Iterable[Expr]) -> set[Expr]:
    """Every expression below the roots whose derivative by one of the variables may not be 0 everywhere."""
    moving = set(variables)
    for node in topological(roots):
        args = node.args[1:] if node.op == "where" else node.args
        if node.op not in STILL and node.type is not BOOL and not moving.isdisjoint(args):
            moving.add(node)
    return moving


def _open(roots: Sequence[Expr], variables: set[Expr]) -> list[Expr]:
    dependent = _moving(roots, variables)
    if not any(node.op == "call" for node in dependent):
        return list(roots)

    def rule(node: Expr, args: tuple[Expr, ...]) -> Expr:
        if node.op != "call" or node not in dependent:
            return rebuild(node, args)
        moving = tuple(arg in dependent for arg in node.args)
        definition: Function = node.data
        along = moving.index(True)
        if definition.type.fields or (
            definition.type is FLOAT and sum(moving) == 1 and node.args[along].type in (VEC2, VEC3)
        ):
            return rebuild(node, args)
        return substitute([_opened_body(definition, moving)], dict(zip(definition.params, args, strict=True)))[0]

    new = rewrite(roots, rule)
    return [new[root] for root in roots]


def _opened_body(definition: Function, moving: tuple[bool, ...]) -> Expr:
    variables = {p for p, moves in zip(definition.params, moving, strict=True) if moves}
    return definition.once(("opened", moving), lambda: _open([definition.body], variables)[0])


def companion(definition: Function, along: int = 0) -> Function:
    """The function that returns gradient and value together: (d/dx, d/dy, d/dz, value) for a vec3 parameter.

    Parameters
    ----------
    definition : a scalar function.
    along : index of the vec2 or vec3 parameter of the gradient.
    """

    def make() -> Function:
        value, slope = value_and_gradient(definition.body, definition.params[along])
        return gradient_function(definition, construct(slope, value))

    return definition.stated.gradients.get(along) or definition.once(("companion", along), make)


def gradient_function(definition: Function, both: Expr) -> Function:
    """The function that returns `both`, the gradient and the value of another function."""
    made = Function(f"{definition.name}_gradient", definition.params, both, definition.names, definition.where)
    made.stated.gradient_of = definition
    made.stated.programs.update(definition.stated.programs_of_gradient)
    return made


def state_gradient(definition: Function, both: Expr) -> Function:
    """State the companion of a function, which is then not derived. both : gradient and value."""
    definition.stated.gradients[0] = made = gradient_function(definition, both)
    return made


# Loops.


def _back_through_loop(item: Expr, variable: Expr, adjoint: Expr) -> Expr:
    """Contribution of a loop to the gradient: the adjoint times the tangent along each axis of the variable."""
    size = variable.type.size
    axes = [const([1.0 if i == k else 0.0 for k in range(size)]) if size > 1 else ONE for i in range(size)]
    parts = [
        v.dot(adjoint, moved) if moved.type.is_vector else adjoint * moved
        for (moved,) in tangents([item], [{variable: axis} for axis in axes])
    ]
    return construct(*parts) if size > 1 else parts[0]


def tangents(roots: Sequence[Expr], seeds: Sequence[Mapping[Expr, Expr]]) -> list[list[Expr]]:
    """Forward mode in several directions at once: for each direction, the tangent of each root."""
    moved: list[dict[Expr, Expr]] = [dict(seed) for seed in seeds]
    variables = [variable for seed in seeds for variable in seed]
    order = topological(roots)
    partials, moving = one_sided(order, depends_on(roots, variables)), _moving(roots, variables)
    for node in order:
        if node not in moving or node in moved[0]:
            continue
        if node.type is STATE:
            continue
        if node.op == "item":
            for direction, tangent in zip(moved, _loop_tangents(node, moved), strict=True):
                direction[node] = tangent
            continue
        for direction in moved:
            direction[node] = _forward(node, [direction.get(arg, zero(arg.type)) for arg in node.args], partials)
    return [[direction.get(root, zero(root.type)) for root in roots] for direction in moved]


def directional_derivatives(root: Expr, variable: Expr, directions: Sequence[Expr]) -> list[Expr]:
    """Directional derivatives of an expression with respect to a variable, one for each direction."""
    return [
        moved[0] for moved in tangents([opened(root, variable)], [{variable: direction} for direction in directions])
    ]


def _forward(node: Expr, incoming: Sequence[Expr], partials: Mapping[Expr, Partials]) -> Expr:
    if node.type is BOOL:
        return ZERO
    if node.op in FORWARD:
        return FORWARD[node.op](node, incoming)
    total = zero(node.type)
    if node.op in ("min", "max") and node.type is FLOAT and all(arg.type is FLOAT for arg in node.args):
        first = (partials.get(node) or PARTIALS[node.op])[0]
        side = None if first is None else first(node)
        if side is not None and side.op == "where" and {side.args[1], side.args[2]} == {ONE, ZERO}:
            taken = incoming if side.args[1] is ONE else incoming[::-1]
            return v.where(side.args[0], taken[0], taken[1])
    for partial, tangent in zip(partials.get(node) or PARTIALS[node.op], incoming, strict=True):
        if partial is not None and tangent is not zero(tangent.type):
            total = total + partial(node) * tangent
    return total if total.type is node.type else construct(*[total] * node.type.size)


def _loop_tangents(item: Expr, moved: Sequence[Mapping[Expr, Expr]]) -> list[Expr]:
    """The tangents of one result of a loop, from a loop with the tangents of all results as additional state."""
    loop_expr, body = item.args[0], item.args[0].data
    n, directions = len(body.state), range(len(moved))
    first = loop_expr.args[:n]
    formal = (*body.state, *body.captured)
    starts = [[moved[d].get(arg, zero(arg.type)) for arg in loop_expr.args] for d in directions]
    carried = [[var(f"{s.data} along {d}", s.type) for s in body.state] for d in directions]
    lifted = [
        [
            var(f"{c.data} along {d}", c.type) if s is not zero(s.type) else s
            for c, s in zip(body.captured, start[n:], strict=True)
        ]
        for d, start in zip(directions, starts, strict=True)
    ]
    inner = _open(body.inner, set(formal))
    step, until = inner[:n], inner[n] if body.until is not None else None
    still = {k for k in range(n) if all(starts[d][k] is zero(first[k].type) for d in directions)}
    while True:  # a state whose tangent starts as 0 and stays 0 needs none
        seeds = [
            {
                f: zero(f.type) if k in still else t
                for k, (f, t) in enumerate(zip(formal, carried[d] + lifted[d], strict=True))
            }
            for d in directions
        ]
        after = tangents(step, seeds)
        gaining = {k for k in still if any(after[d][k] is not zero(first[k].type) for d in directions)}
        if not gaining:
            break
        still -= gaining
    moving = [(d, k) for d in directions for k in range(n) if k not in still]
    around = dict(zip(body.captured, loop_expr.args[n:], strict=True))
    for d in directions:
        around.update({t: s for t, s in zip(lifted[d], starts[d][n:], strict=True) if t.op == "var"})
    results = close_loop(
        body.count,
        body.index,
        (*body.state, *(carried[d][k] for d, k in moving)),
        (*step, *(after[d][k] for d, k in moving)),
        until,
        (*first, *(starts[d][k] for d, k in moving)),
        around,
        body.kept,
    )
    if results[0].args[0] is not loop_expr:
        _lifted_from[results[0].args[0]] = loop_expr
    found = {pair: results[n + i] for i, pair in enumerate(moving)}
    return [found.get((d, item.data), zero(item.type)) for d in directions]
