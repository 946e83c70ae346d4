"""The reading along a stretch of a ray: expressions that enclose f(o + s d) for all s from 0 to w.

A value is a `Series`: its power series at s = 0, and ranges of what is missing, each times a power of s:

    f(o + s d)  in  c[0] + c[1] s + ... + c[n] s^n  +  jump + slope s + curve s^2,    0 <= s <= w

Coefficients are expressions of o and d; ranges are pairs of expressions that read w too. Of a polynomial all
coefficients are exact, and nothing is missing (Taylor's formula). Of other smooth functions two coefficients are exact,
and `curve` is half the range of the second derivative over the stretch (Taylor models, Makino and Berz 2003). Kinks
have the slopes of both sides in `slope`. Where a value may jump, `jump` has the range of its changes.

The operations of expressions are in `raymarch.expr.stretch`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from raymarch.expr import vocabulary as v
from raymarch.expr.function import sum_of
from raymarch.expr.node import Expr, elementwise
from raymarch.expr.smooth import NOTHING, ONE, SMOOTH, ZERO, Range, add, hull, largest, scaled, squared, times

DEGREE = 12
"""Largest degree of a polynomial along the ray that is kept exactly."""


@dataclass(frozen=True, eq=False, slots=True)
class Series:
    """The value of a scalar expression along a stretch; see the module."""

    c: tuple[Expr, ...]
    jump: Range = NOTHING
    slope: Range = NOTHING
    curve: Range = NOTHING
    within: Range | None = None
    """A further range that holds the values, if one is known."""

    @property
    def exact(self) -> bool:
        return self.jump is NOTHING and self.slope is NOTHING and self.curve is NOTHING

    @property
    def rate(self) -> Expr:
        return self.c[1] if len(self.c) > 1 else ZERO

    @property
    def still(self) -> bool:
        """True if the value is the same all along the stretch."""
        return self.exact and len(self.c) == 1


def trimmed(c: Sequence[Expr]) -> tuple[Expr, ...]:
    n = len(c)
    while n > 1 and c[n - 1] is ZERO:
        n -= 1
    return tuple(c[:n])


class Reading:
    """One reading of an expression along a stretch of length w.

    exact : False reduces polynomials to two coefficients and a range, as other functions. smooth : False uses slopes
    alone. Both are for comparison. limited : True if a function with limits of its own was read, such as noise.
    """

    def __init__(self, w: Expr, exact: bool = True, smooth: bool = True) -> None:
        self.w, self.exact, self.smooth = w, exact, smooth
        self.limited = False

    # A value and its range

    def over(self, a: Range) -> Range:
        """The range of a value times s."""
        if a is NOTHING:
            return NOTHING
        if a[0] is a[1]:
            end = self.w * a[0]
            return v.min(end, 0.0), v.max(end, 0.0)
        return self.w * v.min(a[0], 0.0), self.w * v.max(a[1], 0.0)

    def tail(self, a: Series, power: int) -> Range:
        """The range of what follows the powers below `power`, divided by s^power; without jump and slope."""
        if len(a.c) <= power:
            return a.curve if power == 2 else self.over(a.curve) if power == 1 else NOTHING
        found: Range = (a.c[-1], a.c[-1])
        for k in range(len(a.c) - 2, power - 1, -1):
            low, high = self.over(found)
            found = a.c[k] + low, a.c[k] + high
        return add(found, a.curve) if power == 2 else add(found, self.over(a.curve)) if power == 1 else found

    def change(self, a: Series) -> Range:
        """The range of the slopes of lines from the start to each point of the stretch, without the jump."""
        if len(a.c) == 1:
            return add(a.slope, self.over(a.curve))
        return add(add((a.rate, a.rate), a.slope), self.over(self.tail(a, 2)))

    def range(self, a: Series) -> Range:
        low, high = add(self.over(self.change(a)), a.jump)
        low, high = a.c[0] + low, a.c[0] + high
        return (low, high) if a.within is None else (v.max(low, a.within[0]), v.min(high, a.within[1]))

    def reduced(self, a: Series) -> Series:
        """The same value by two coefficients and a range of curvature."""
        if len(a.c) <= 2:
            return a
        return Series(a.c[:2], a.jump, a.slope, self.tail(a, 2), a.within)

    def kept(self, a: Series) -> Series:
        """The value in the form of this reading."""
        if not self.smooth:
            return (
                Series(a.c[:1], a.jump, self.change(a), NOTHING, a.within)
                if a.curve is not NOTHING or len(a.c) > 2
                else a
            )
        return a if self.exact and a.exact and len(a.c) <= DEGREE + 1 else self.reduced(a)

    # Sums and products

    def add(self, a: Series, b: Series) -> Series:
        n = max(len(a.c), len(b.c))
        c = [at(a.c, k) + at(b.c, k) for k in range(n)]
        jump, slope, curve = (
            y if x is NOTHING else x if y is NOTHING else add(x, y)
            for x, y in ((a.jump, b.jump), (a.slope, b.slope), (a.curve, b.curve))
        )
        return Series(trimmed(c), jump, slope, curve)

    def neg(self, a: Series) -> Series:
        return self.scale(a, -ONE)

    def scale(self, a: Series, factor: Expr) -> Series:
        if factor is ZERO:
            return Series((ZERO,))
        c = tuple([each * factor for each in a.c])
        within = None if a.within is None else scaled(a.within, factor)
        jump, slope, curve = (scaled(part, factor) for part in (a.jump, a.slope, a.curve))
        return Series(c, jump, slope, curve, within)

    def mul(self, a: Series, b: Series) -> Series:
        if a.still:
            return self.scale(b, a.c[0])
        if b.still:
            return self.scale(a, b.c[0])
        if a.exact and b.exact:
            return self.kept(Series(_product(a.c, b.c)))
        # (P + A) b = P P' + P B + A b, where P and P' are the first two terms, A and B the rest
        a, b = self.reduced(a), self.reduced(b)
        head = Series(a.c)
        c = _product(a.c, b.c)
        if a is b:
            factor = add(self.range(head), self.range(a))
            jump, slope, curve = (times(part, factor) for part in (a.jump, a.slope, a.curve))
        else:
            first, second = self.range(head), self.range(b)
            jump, slope, curve = (
                _sum(times(first, y), times(x, second))
                for x, y in ((a.jump, b.jump), (a.slope, b.slope), (a.curve, b.curve))
            )
        return self.kept(self.reduced(Series(c, jump, slope, curve)))

    # Functions of one value

    def apply(self, a: Series, name: str) -> Series:
        """A smooth function of a value, of `SMOOTH`."""
        if a.still:
            return Series((elementwise(name, a.c[0]) if name != "reciprocal" else 1.0 / a.c[0],))
        rule = SMOOTH[name]
        a = self.reduced(a)
        whole = self.range(a)
        value, rate = rule.value(a.c[0])
        within = rule.within(a.c[0], whole)
        if a.jump is not NOTHING or not self.smooth:
            rates = rule.rates(a.c[0], whole)
            slope = times(rates, self.change(a))
            return Series((value,), times(rates, a.jump), slope, NOTHING, within)
        change = self.change(a)
        bend = rule.bends(a.c[0], whole)
        curve = _sum(scaled(a.curve, rate), times((0.5 * bend[0], 0.5 * bend[1]), squared(change)))
        return Series(trimmed((value, rate * a.rate)), NOTHING, scaled(a.slope, rate), curve, within)

    def lipschitz(self, value: Expr, *parts: Series) -> Series:
        """A value that changes by at most the largest change of some parts, such as their least."""
        changes = [self.change(part) for part in parts]
        jumps = [part.jump for part in parts if part.jump is not NOTHING]
        slope = hull(*[c[0] for c in changes])[0], hull(*[c[1] for c in changes])[1]
        jump = NOTHING
        if jumps:
            jump = hull(ZERO, *[j[0] for j in jumps])[0], hull(ZERO, *[j[1] for j in jumps])[1]
        return Series((value,), jump, slope)

    def chosen(self, condition: Expr, a: Series, b: Series) -> Series:
        """One of two values, by a condition that does not depend on s."""
        a, b = self.reduced(a), self.reduced(b)

        def both(x: Range, y: Range) -> Range:
            if x is NOTHING and y is NOTHING:
                return NOTHING
            return v.where(condition, x[0], y[0]), v.where(condition, x[1], y[1])

        c = [v.where(condition, at(a.c, k), at(b.c, k)) for k in range(max(len(a.c), len(b.c)))]
        return Series(trimmed(c), both(a.jump, b.jump), both(a.slope, b.slope), both(a.curve, b.curve))

    def least(self, a: Series, b: Series) -> Series:
        """The smaller of two values."""
        x, y = self.range(a), self.range(b)
        mixed = self.lipschitz(v.min(a.c[0], b.c[0]), a, b)
        return self.chosen(x[1] <= y[0], a, self.chosen(y[1] <= x[0], b, mixed))

    def absolute(self, a: Series) -> Series:
        low, high = self.range(a)
        most = largest(self.change(a))
        jump = NOTHING if a.jump is NOTHING else (-largest(a.jump), largest(a.jump))
        kink = Series((abs(a.c[0]),), jump, (-most, most))
        return self.chosen(low >= 0.0, a, self.chosen(high <= 0.0, self.neg(a), kink))

    def stepped(self, a: Series, rising: Callable[[Expr], Expr]) -> Series:
        """A function that does not fall and is constant between its jumps, such as floor."""
        if a.still:
            return Series((rising(a.c[0]),))
        low, high = self.range(a)
        value = rising(a.c[0])
        return Series((value,), (rising(low) - value, rising(high) - value))

    def either(self, condition: tuple[Expr, Expr, Expr], a: Series, b: Series) -> Series:
        """`where`: a condition at the start, whether it holds all along, and whether it does anywhere."""
        now, always, ever = condition
        if always is now:
            return self.chosen(now, a, b)
        x, y = self.range(a), self.range(b)
        value = v.where(now, a.c[0], b.c[0])
        jump = v.min(x[0], y[0]) - value, v.max(x[1], y[1]) - value
        return self.chosen(always, a, self.chosen(ever, Series((value,), jump), b))


def at(c: Sequence[Expr], k: int) -> Expr:
    return c[k] if k < len(c) else ZERO


def _sum(a: Range, b: Range) -> Range:
    return b if a is NOTHING else a if b is NOTHING else add(a, b)


def _product(a: Sequence[Expr], b: Sequence[Expr]) -> tuple[Expr, ...]:
    found = []
    for k in range(len(a) + len(b) - 1):
        pairs = [(i, k - i) for i in range(len(a)) if 0 <= k - i < len(b)]
        if a is b or (all(x is y for x, y in zip(a, b, strict=False)) and len(a) == len(b)):
            terms = [2.0 * (a[i] * a[j]) if i != j else a[i] * a[i] for i, j in pairs if i <= j]
        else:
            terms = [a[i] * b[j] for i, j in pairs]
        found.append(sum_of(terms))
    return trimmed(found)
