"""Simplification of new expressions: constant folding and identities.

Folding uses the float64 reading, so literals and uniforms of the same value follow the same rules. x * 0 becomes 0
although inf * 0 is NaN: fields are finite by their facts, and derivatives contain many zeros.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raymarch.expr.arrays import FLOAT64
from raymarch.expr.node import (
    Expr,
    called_by_expressions,
    const,
    construct,
    elementwise,
    make,
    product,
    simplifier,
    simplify,
    swizzle,
)
from raymarch.expr.types import BOOL, FLOAT, Type

_RULES = FLOAT64.rules


@called_by_expressions
def fold_constants(op: str, type: Type, args: tuple[Expr, ...], data: Any) -> Expr | None:
    """The constant that an operation of constants gives; None for a struct, or what only the shader computes."""
    if not args or op == "record" or op not in _RULES:
        return None
    return _folded(op, type, args, data) if data is None or op == "swizzle" else _fold(op, type, args, data)


def _fold(op: str, type: Type, args: tuple[Expr, ...], data: Any) -> Expr:
    node = make(op, type, args, data)
    with np.errstate(all="ignore"):
        value = _RULES[op](node, *[arg.data for arg in args])
    if type is BOOL:
        return const(bool(value))
    if np.shape(value) != type.shape:
        value = np.broadcast_to(value, type.shape)
    return const(value, type)


_folded = lru_cache(2048)(_fold)
"""Derivatives fold the same constants again and again."""


def _number(node: Expr) -> float | None:
    """The number that each component of a constant has; None for other expressions."""
    if node.op != "const" or node.type is BOOL or node.type.is_matrix:
        return None
    numbers = node.data.ravel()
    return float(numbers[0]) if (numbers == numbers[0]).all() else None


def _widen(node: Expr, type: Type) -> Expr:
    if node.type is type:
        return node
    if node.op == "const":
        return const(np.broadcast_to(node.data, type.shape), type)
    return make("construct", type, (node,) * type.size)


@simplifier(*("add", "sub", "mul", "div", "neg", "dot", "round", "min", "max", "abs", "not"))
def identities(op: str, type: Type, args: tuple[Expr, ...], data: Any) -> Expr | None:
    match op, args:
        case "add", (a, b):
            if _number(a) == 0:
                return _widen(b, type)
            if _number(b) == 0:
                return _widen(a, type)
            if b.op == "neg":
                return elementwise("sub", a, b.args[0])
            return _add_components(a, b)
        case "sub", (a, b):
            if _number(b) == 0:
                return _widen(a, type)
            if _number(a) == 0:
                return elementwise("neg", _widen(b, type))
            if b.op == "neg":
                return elementwise("add", a, b.args[0])
            if a is b:
                return _widen(const(0.0), type)
        case "mul", (a, b):
            for one, other in ((a, b), (b, a)):
                number = _number(one)
                if number == 0:
                    return _widen(const(0.0), type)
                if number == 1:
                    return _widen(other, type)
                if number == -1:
                    return elementwise("neg", _widen(other, type))
        case "dot", (a, b) if 0 in (_number(a), _number(b)):
            return const(0.0)
        case "dot", (a, b):
            for one, other in ((a, b), (b, a)):
                if (axis := _axis_of(one)) is not None:
                    k, sign = axis
                    return other[k] if sign > 0 else elementwise("neg", other[k])
        case "round", (a,) if a.op == "sub" and _number(a.args[1]) == 0.5:
            return elementwise("floor", a.args[0])
        case "div", (a, b):
            if _number(b) == 1:
                return _widen(a, type)
            if _number(a) == 0:
                return _widen(const(0.0), type)
        case "neg", (a,) if a.op == "neg":
            return a.args[0]
        case (("min" | "max"), (a, b)) if a is b:
            return a
        case "abs", (a,) if a.op in ("abs", "neg"):
            return a if a.op == "abs" else elementwise("abs", a.args[0])
        case "not", (a,) if a.op == "not":
            return a.args[0]
    return None


def _axis_of(node: Expr) -> tuple[int, float] | None:
    """Index and sign of the axis that a constant unit vector lies along; None for other expressions."""
    if node.op != "const" or not node.type.is_vector or np.count_nonzero(node.data) != 1:
        return None
    k = int(np.flatnonzero(node.data)[0])
    return (k, float(node.data[k])) if abs(node.data[k]) == 1.0 else None


@simplifier("add", "sub")
def folds(op: str, type: Type, args: tuple[Expr, ...], data: Any) -> Expr | None:
    """A vector plus a multiple of an axis changes one component; x - 2 min(x, 0) is |x|."""
    a, b = args
    if type.is_vector and a.type is type and b.op == "mul":
        for along, factor in (b.args, b.args[::-1]):
            if factor.type is FLOAT and (axis := _axis_of(along)) is not None:
                k, sign = axis
                changed = elementwise("add" if (sign > 0) == (op == "add") else "sub", a[k], factor)
                return construct(*[changed if i == k else a[i] for i in range(type.size)])
    if type is FLOAT and b.op == "mul" and b.args[1].op == "min" and _number(b.args[0]) == 2:
        x, least = b.args[1].args
        if _number(least) != 0:
            return None
        if op == "sub" and x is a:
            return elementwise("abs", a)
        if op == "add" and x is elementwise("neg", a):
            return elementwise("neg", elementwise("abs", a))
    return None


def _add_components(a: Expr, b: Expr) -> Expr | None:
    """Sum of vectors with disjoint components, such as (x, 0, 0) + (0, y, z) in gradients."""
    if a.op == b.op == "construct" and all(p.type is FLOAT for p in a.args + b.args):
        sums = tuple(elementwise("add", p, q) for p, q in zip(a.args, b.args, strict=True))
        return make("construct", a.type, sums)
    return None


@simplifier("where", "and", "or")
def choices(op: str, type: Type, args: tuple[Expr, ...], data: Any) -> Expr | None:
    if op == "where":
        condition, a, b = args
        if condition.op == "const":
            return a if bool(condition.data) else b
        if a is b:
            return a
        if condition.op == "not":
            return make("where", type, (condition.args[0], b, a))
        return None
    for one, other in (args, args[::-1]):
        if one.op == "const":
            return other if bool(one.data) == (op == "and") else one
    return None


@simplifier("field")
def fields(op: str, type: Type, args: tuple[Expr, ...], data: Any) -> Expr | None:
    (value,) = args
    if value.op == "record":
        return value.args[[name for name, _ in value.type.fields].index(data)]
    if value.op == "where":
        condition, a, b = value.args
        sides = (simplify("field", type, (side,), data) for side in (a, b))
        return simplify("where", type, (condition, *sides))
    return None


def _scalars(v: Expr) -> list[Expr]:
    """The components of a constructed vector, one expression each."""
    return [part for p in v.args for part in ([p] if p.type is FLOAT else [p[i] for i in range(p.type.size)])]


def _placed(m: Expr, v: Expr) -> Expr | None:
    """A constant matrix times a vector.

    Elements below 2^-50 of their row, the rounding error of a full turn, count as 0, such as the cosine of a quarter
    turn. A matrix that only permutes and negates axes becomes a selection of components.
    """
    data, selected, turned = _cleaned(m)
    if selected is not None:
        return construct(*(v[i] * sign for i, sign in selected))
    if turned is not None:
        i, j, k = turned
        pair = product(const(data[np.ix_([i, j], [i, j])]), swizzle(v, "xyz"[i] + "xyz"[j]))
        parts = {i: pair[0], j: pair[1], k: v[k]}
        return construct(*[parts[n] for n in range(3)])
    return None if np.array_equal(data, m.data) else make("matmul", v.type, (const(data, m.type), v))


@lru_cache(256)
def _cleaned(m: Expr) -> tuple[NDArray[np.float64], list[tuple[int, float]] | None, tuple[int, int, int] | None]:
    """A constant matrix without rounding errors; the components that it selects and their signs, if it only does that;
    and the axes i, j that it turns and the one, k, that it keeps, if it turns about an axis."""
    size = np.abs(m.data)
    data = np.where(size < 2.0**-50 * size.max(axis=1, keepdims=True), 0.0, m.data)
    if np.all(np.sort(np.abs(data), axis=1) == np.eye(m.type.size)[-1]):
        return data, [(int(np.argmax(np.abs(row))), float(row.sum())) for row in data], None
    if m.type.size == 3:
        for k in range(3):
            i, j = (i for i in range(3) if i != k)
            if data[k, k] == 1.0 and not any(data[[k, k, i, j], [i, j, k, k]]):
                return data, None, (i, j, k)
    return data, None, None


@simplifier("swizzle", "construct", "matmul", "transpose")
def components(op: str, type: Type, args: tuple[Expr, ...], data: Any) -> Expr | None:
    if op == "swizzle":
        (v,) = args
        if data == "xyzw"[: v.type.size]:
            return v
        if v.op == "swizzle":
            return swizzle(v.args[0], "".join(v.data["xyzw".index(c)] for c in data))
        if v.op == "construct":
            picked = tuple(map(_scalars(v).__getitem__, map("xyzw".index, data)))
            return picked[0] if len(picked) == 1 else construct(*picked)
    if op == "construct":
        if len(args) == 1:
            return args[0]
        if any(arg.op == "construct" and len({*arg.args}) > 1 for arg in args):
            parts = [p for arg in args for p in (arg.args if arg.op == "construct" else (arg,))]
            return construct(*parts)
        source = args[0].args[0] if args[0].op == "swizzle" else None
        if source is not None and all(p.op == "swizzle" and p.args[0] is source for p in args):
            return swizzle(source, "".join(p.data for p in args))
    if op == "matmul":
        m, v = args
        if m.op == "const" and v.type.is_vector:
            return _placed(m, v)
    if op == "transpose" and args[0].op == "transpose":
        return args[0].args[0]
    return None
