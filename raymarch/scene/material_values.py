"""Values of a material: a number, a function of the point or a texture, checked and converted to an expression."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import cache
from os import PathLike, fspath
from pathlib import Path
from typing import Any, TypeAlias
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from raymarch.errors import SceneError
from raymarch.expr.arrays import evaluator
from raymarch.expr.colors import linear_color
from raymarch.expr.convert import called
from raymarch.expr.node import Expr, Operand, const, expr, var
from raymarch.expr.types import FLOAT, vector
from raymarch.expr.vocabulary import clamp, vec3
from raymarch.expr.walk import find, free_variables, substitute
from raymarch.scene.map_arithmetic import MapExpression
from raymarch.scene.parameter import as_color, as_number
from raymarch.scene.texture import Texture, share_projection
from raymarch.sdf.domain import ColorLike, Scalar, as_operand
from raymarch.sdf.interaction import DPDN, DPDX, DPDY, NORMAL, POSITION, depends_on_interaction

FloatOrTexture: TypeAlias = Scalar | Texture | Callable[[Expr], Operand]
"""A number, a texture, or a function of the point."""

ColorOrTexture: TypeAlias = ColorLike | Scalar | Texture | Callable[[Expr], Operand]
"""Linear RGB or one number for all three channels, a texture, or a function of the point."""


@cache
def _probes() -> NDArray[np.float64]:
    """Points at which patterns are checked. A pattern that is legal at none of them is refused, others are clamped."""
    return np.random.default_rng(5).uniform(-10.0, 10.0, (256, 3))


_pictures: WeakKeyDictionary[Expr, tuple[int, float, float]] = WeakKeyDictionary()
"""Expressions of textures whose values were checked, with (size, low, high). They need no second check."""


def material_value(name: str, value: Any, size: int, low: float, high: float) -> Expr:
    """A value of a material, checked. A function of the point becomes its expression, clamped to its range."""
    if isinstance(value, Expr) and _pictures.get(value) == (size, low, high):
        return value
    what = f"Material: {name}"
    if isinstance(value, Texture):
        return _picture(what, value, size, low, high)
    if _is_file(value) or (isinstance(value, np.ndarray) and value.ndim > 1):
        given = f"an array of shape {value.shape}" if isinstance(value, np.ndarray) else f"'{fspath(value)}'"
        legal = "planar(picture, size) or triplanar(picture, size)"
        if isinstance(value, np.ndarray) and value.ndim > 3 - (size == 1):
            legal = "of data in space, lambda p: rm.colormap(values(p), 'viridis') with values = rm.sampled(array)"
        raise SceneError(f"{what}: {given} has no projection", legal=legal)
    if isinstance(value, MapExpression):
        try:
            read = value.number if size == 1 else value.color
            made = _pattern(what, read, size, low, high)
            _check_texels(what, read(POSITION), low, high)
            return made
        except SceneError as fault:
            said = fault.what.removeprefix(f"{what}: ").replace("the function gives", f"{value!r} gives")
            raise SceneError(f"{what}: {said}", legal=fault.legal) from None
    check = as_number if size == 1 else as_color
    # An expression of POSITION comes from another material, by `replace`.
    if isinstance(value, Expr) and (POSITION in free_variables([value]) or depends_on_interaction([value])):
        return _pattern(what, lambda _: value, size, low, high)
    if not callable(value) or isinstance(value, Expr):
        return check(what, value, low, high, cells=True)
    return _pattern(what, value, size, low, high)


def _picture(what: str, value: Texture, size: int, low: float, high: float) -> Expr:
    """The values of a texture, which must all be legal."""
    try:
        made = value.number(POSITION) if size == 1 else value.color(POSITION)
    except SceneError as fault:
        raise SceneError(f"{what}: {fault.what}", legal=fault.legal) from None
    for read in find([made], "texture"):
        least, most = (float(end(read.data.levels[0])) for end in (np.min, np.max))
        if not low <= least <= most <= high:
            what = f"{what}: '{value.file}' has values from {least:.4g} to {most:.4g}"
            raise SceneError(what, legal=_ends(low, high))
    _pictures[made] = (size, low, high)
    return made


STEPS = 65
"""Values of each texture, from its least to its greatest, at which arithmetic of up to two textures is checked."""


def _check_texels(what: str, made: Expr, low: float, high: float) -> None:
    """SceneError for arithmetic of textures that leaves its range for values that they have. Between texels a texture
    takes all values; two textures are taken to be independent. Three projections take the values of one, because their
    weights add up to 1."""
    reads, apart = _independent(find([made], "texture"))
    made = substitute([made], {r: const(np.zeros(r.type.shape)) for r in apart})[0]
    if not 0 < len(reads) <= 4 or POSITION in free_variables(
        substitute([made], {r: const(np.zeros(r.type.shape)) for r in reads})[0:1]
    ):
        return
    ends = [(float(np.min(r.data.levels[0])), float(np.max(r.data.levels[0]))) for r in reads]
    grid = np.meshgrid(*[np.linspace(*each, STEPS if len(reads) <= 2 else 2) for each in ends])
    places = [var(f"texel {i}", r.type) for i, r in enumerate(reads)]
    body = substitute([made], dict(zip(reads, places, strict=True)))[0]
    at = [
        g.ravel() if r.type is FLOAT else np.repeat(g.reshape(-1, 1), r.type.shape[0], 1)
        for g, r in zip(grid, reads, strict=True)
    ]
    values = evaluator([body], places)(*at)[0]
    least, most = float(np.min(values)), float(np.max(values))
    slack = 1e-6 * max(abs(least), abs(most))
    if not low - slack <= least <= most <= high + slack:
        raise SceneError(f"{what}: the function gives values from {least:.4g} to {most:.4g}", legal=_ends(low, high))


def _independent(reads: Iterable[Expr]) -> tuple[list[Expr], list[Expr]]:
    """Readings of textures that take their values independently, and the others: two of three projections, whose
    weights are 0 where that of the first is 1. None are independent if a texture is projected at several places."""
    found: list[Expr] = []
    projected: dict[Any, list[Expr]] = {}
    for read in reads:
        if read.args[-1].is_constant:
            found.append(read)
        else:
            projected.setdefault(read.data, []).append(read)
    if any(len(each) != 3 for each in projected.values()):
        return [], []
    return [*found, *(each[0] for each in projected.values())], [r for each in projected.values() for r in each[1:]]


def _ends(low: float, high: float) -> str:
    return f"values from {low:g} to {high:g}" if high < np.inf else f"values >= {low:g}"


def _pattern(what: str, function: Callable[[Expr], Any], size: int, low: float, high: float) -> Expr:
    ends = f"from {low:g} to {high:g}" if high < np.inf else f">= {low:g}"
    legal = f"a function of a point that gives {'a number' if size == 1 else '3 numbers'} {ends}"
    given = called(what, function, POSITION, legal=legal)
    made = as_operand(f"{what}: the function gives", linear_color(what, given) if size == 3 else given, legal)
    if size == 3 and made.type is vector(1):
        made = vec3(made)
    if made.type is not vector(size):
        if size == 1 and find([made], "texture"):
            legal = "texture.number(p) in a function, or 0.5 * texture without one"
        raise SceneError(f"{what}: the function gives a {made.type}", legal=legal)
    if not find([made], "time", "param", "cell"):
        points = _probes()
        normals = points / np.linalg.norm(points, axis=1, keepdims=True)
        around = {NORMAL: normals, DPDN: normals, DPDX: 1e-3 * normals, DPDY: 1e-3 * normals}
        values = evaluator([made], [POSITION, *around])(points, *around.values())[0]
        values = np.broadcast_to(values, (len(points), *made.type.shape))
        legal_there = (values >= low) & (values <= high)  # false for NaN
        if not np.any(legal_there) or np.any(np.isnan(values)):
            raise SceneError(f"{what}: the function gives {values[~legal_there].flat[0]:.6g}", legal=legal)
    clamped = made.op == "clamp" and made.args[1:] == (expr(low), expr(high))
    return clamp(made, low, high) if high < np.inf and not clamped else made


def _is_file(value: Any) -> bool:
    """True for a path, or a string with a suffix. Other strings get another message."""
    return isinstance(value, PathLike) or (isinstance(value, str) and Path(value).suffix != "")


def check_map_sizes(maps: dict[str, Any]) -> None:
    """SceneError if maps that share a projection differ in resolution."""
    given = {name: value for name, value in maps.items() if isinstance(value, Texture)}
    for i, (name, one) in enumerate(given.items()):
        for first, other in list(given.items())[:i]:
            if share_projection(one, other) and one.size != other.size:
                sizes = [f"{width} x {height} pixels" for width, height in (one.size, other.size)]
                raise SceneError(
                    f"Material: the {name} map '{one.file}' has {sizes[0]}, the {first} map '{other.file}' {sizes[1]}",
                    legal="maps that share a projection (size, offset, rotation) must share a resolution",
                )
