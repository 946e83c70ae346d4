"""The curvature reading: which expressions are convex functions of a point, by the rules of disciplined convex
programming (Grant, Boyd and Ye 2006).

Affine, convex and concave functions are composed: a nondecreasing convex function of a convex one is convex. The rules
are sufficient, not necessary: max(q.x, q.y) - length(q) has no curvature here, whatever it is.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from typing import TypeAlias

import numpy as np

import raymarch.expr.vocabulary as v
from raymarch.expr.function import Function
from raymarch.expr.node import Expr, construct
from raymarch.expr.types import BOOL, FLOAT
from raymarch.expr.walk import topological


@dataclass(frozen=True, slots=True)
class Kind:
    """What is known of one component: `low` and `high` bound it everywhere."""

    convex: bool = False
    concave: bool = False
    low: float = -np.inf
    high: float = np.inf
    still: bool = False
    """True if it does not depend on the point."""

    @property
    def affine(self) -> bool:
        return self.convex and self.concave

    @property
    def rises(self) -> bool:
        """True if its absolute value is convex where it is: convex and nowhere negative, or the mirror image."""
        return (self.convex and self.low >= 0.0) or (self.concave and self.high <= 0.0)


UNKNOWN = Kind()
Kinds: TypeAlias = tuple[Kind, ...]
"""One for each component of a vector; one for a number or a matrix."""


def still(low: float = -np.inf, high: float = np.inf) -> Kind:
    """What does not depend on the point, within a range."""
    return Kind(True, True, low, high, still=True)


AFFINE = Kind(True, True)


def _sum(a: Kind, b: Kind) -> Kind:
    return Kind(a.convex and b.convex, a.concave and b.concave, a.low + b.low, a.high + b.high, a.still and b.still)


def _negative(a: Kind) -> Kind:
    return Kind(a.concave, a.convex, -a.high, -a.low, a.still)


def _product(a: Kind, b: Kind) -> Kind:
    with np.errstate(invalid="ignore"):
        ends = np.nan_to_num([a.low * b.low, a.low * b.high, a.high * b.low, a.high * b.high], nan=0.0, posinf=np.inf)
    low, high = float(ends.min()), float(ends.max())
    factor, other = (a, b) if a.still else (b, a)
    if not factor.still:
        return Kind(low=low, high=high)
    if factor.high <= 0.0 < -factor.low:
        other = _negative(other)
    elif factor.low < 0.0 and not other.affine:
        return Kind(low=low, high=high)
    return Kind(other.convex, other.concave, low, high, a.still and b.still)


def _square(a: Kind) -> Kind:
    return Kind(a.affine or a.rises, a.still, 0.0, still=a.still)


def _quotient(a: Kind, b: Kind) -> Kind:
    inverse = still(0.0, np.inf) if b.low >= 0.0 else still(-np.inf, 0.0) if b.high <= 0.0 else still()
    return _product(a, inverse) if b.still else UNKNOWN


def _absolute(a: Kind) -> Kind:
    high = max(abs(a.low), abs(a.high))
    return Kind(a.affine or a.rises, a.still, max(a.low, -a.high, 0.0), high, a.still)


def _larger(a: Kind, b: Kind) -> Kind:
    both = a.still and b.still
    return Kind(a.convex and b.convex, both, max(a.low, b.low), max(a.high, b.high), both)


def _smaller(a: Kind, b: Kind) -> Kind:
    return _negative(_larger(_negative(a), _negative(b)))


def _norm(parts: Sequence[Kind]) -> Kind:
    fixed = all(part.still for part in parts)
    return Kind(all(part.affine or part.rises for part in parts), fixed, 0.0, still=fixed)


def _root(a: Kind) -> Kind:
    return Kind(a.still, a.concave, 0.0, still=a.still)


def _power(a: Kind) -> Kind:
    return Kind(a.convex, a.still, 0.0, still=a.still)


_EACH: Mapping[str, Callable[..., Kind]] = {
    "add": _sum,
    "sub": lambda a, b: _sum(a, _negative(b)),
    "neg": _negative,
    "mul": _product,
    "div": _quotient,
    "abs": _absolute,
    "max": _larger,
    "min": _smaller,
    "sqrt": _root,
    "exp": _power,
    "exp2": _power,
}
"""Operations of each component."""

Folds: TypeAlias = Callable[[Function], bool]
"""Whether a function of distances, and of numbers beside, is concave and nondecreasing in all distances."""


def kinds_of(root: Expr, known: Mapping[Expr, Kinds], folds: Folds = lambda _: False) -> Kinds:
    """The kinds of the components of an expression, from those of the variables and of other parts in `known`."""
    found: dict[Expr, Kinds] = {}
    for e in topological([root]):
        found[e] = known[e] if e in known else _kinds(e, [found[arg] for arg in e.args], folds)
    return found[root]


def _kinds(e: Expr, args: list[Kinds], folds: Folds) -> Kinds:
    size = e.type.size if e.type.is_vector else 1
    if e.op == "const":
        if e.type is BOOL or e.type.is_matrix:
            return (still(),)
        return tuple(still(float(x), float(x)) for x in np.ravel(e.data))
    if e.op in ("mul", "add", "sub") and any(arg.type.is_matrix for arg in e.args):
        return (still(),) * size if all(kind.still for arg in args for kind in arg) else (UNKNOWN,) * size
    if e.op == "mul" and e.args[0] is e.args[1]:
        return tuple(map(_square, args[0]))
    if e.op in _EACH:
        wide = [arg * size if len(arg) < size else arg for arg in args]
        return tuple(_EACH[e.op](*each) for each in zip(*wide, strict=True))
    if e.op in ("within", "stop_gradient"):
        return args[0]
    if e.op == "swizzle":
        return tuple(args[0]["xyzw".index(c)] for c in e.data)
    if e.op == "construct":
        return tuple(kind for arg in args for kind in arg)
    if e.op == "length":
        return (_norm(args[0]),)
    if e.op == "dot":
        same = e.args[0] is e.args[1]
        terms = map(_square, args[0]) if same else map(_product, *args)
        return (reduce(_sum, terms),)
    if e.op == "matmul" and args[0][0].still and e.type.is_vector:
        fixed = all(kind.still for kind in args[1])
        return ((still() if fixed else AFFINE if all(kind.affine for kind in args[1]) else UNKNOWN),) * size
    if e.op == "call" and e.type is FLOAT:
        if folds(e.data) and all(kind.concave for arg in args for kind in arg):
            return (Kind(concave=True),)
        return kinds_of(e.data.body, dict(zip(e.data.params, args, strict=True)), folds)
    if e.args and e.op not in ("apply", "mark", "probe") and all(kind.still for arg in args for kind in arg):
        return (still(),) * size
    return ((still() if e.op in ("param", "time") else UNKNOWN),) * size


def convex_minorant(root: Expr, known: Mapping[Expr, Kinds], folds: Folds = lambda _: False) -> Expr | None:
    """A convex function that is nowhere larger than a number; None if the rules find none but constants.

    |x| >= max(x, 0), so a length does not grow where a component that is convex but may be negative is replaced by its
    positive part, and a component of no known curvature by 0. A torus is thus held by the disc with a round rim.
    """
    return _minorant(root, known, folds)


def _minorant(e: Expr, known: Mapping[Expr, Kinds], folds: Folds) -> Expr | None:
    def kind(part: Expr) -> Kind:
        return kinds_of(part, known, folds)[0]

    if kind(e).convex:
        return e
    if e.op == "call" and e.type is FLOAT:
        return _minorant(e.data.inline(*e.args), known, folds)
    if e.op in ("add", "max"):
        parts = [_minorant(arg, known, folds) for arg in e.args]
        if None in parts:
            return next((part for part in parts if part is not None), None) if e.op == "max" else None
        return v.max(*parts) if e.op == "max" else parts[0] + parts[1]  # type: ignore[arg-type, operator]
    if e.op == "sub" and kind(e.args[1]).concave:
        inner = _minorant(e.args[0], known, folds)
        return None if inner is None else inner - e.args[1]
    if e.op == "abs" and e.type is FLOAT:
        inner = _minorant(e.args[0], known, folds)
        return None if inner is None else v.max(inner, 0.0)
    if e.op == "length":
        parts = [_positive_part(part, known, folds) for part in e.args[0]]
        kept = [part for part in parts if part is not None]
        return None if not kept else v.length(construct(*kept)) if len(kept) > 1 else v.abs(kept[0])
    return None


def _positive_part(part: Expr, known: Mapping[Expr, Kinds], folds: Folds) -> Expr | None:
    """A number whose absolute value is convex and not above that of a component; None for 0."""
    kind = kinds_of(part, known, folds)[0]
    if kind.affine or kind.rises:
        return part
    inner = _minorant(part, known, folds)
    return None if inner is None else v.max(inner, 0.0)
