"""Surface interactions of labels: the point, normal and footprint of the scene in the space of a label."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from raymarch.expr.derivative import directional_derivatives
from raymarch.expr.node import Expr, construct, var
from raymarch.expr.types import VEC3
from raymarch.expr.vocabulary import cross, dot, normalize, where
from raymarch.expr.walk import find, free_variables, substitute

POSITION = var("position of the label", VEC3)
"""In the expressions of a label: the point in the label's space, in which the label was given to its node."""


NORMAL, DPDX, DPDY, DPDN = (var(f"{name} of the label", VEC3) for name in ("normal", "dpdx", "dpdy", "dpdn"))
"""The surface interaction in that space: the unit normal, and the images under the Jacobian of the axes of the pixel's
footprint on the surface (DPDX, DPDY) and of the unit normal of the scene (DPDN)."""


SCENE_INTERACTION = tuple(var(name, VEC3) for name in ("normal", "dpdx", "dpdy"))
"""The surface interaction in scene space: the outward unit normal and the axes of the footprint. The axes are as long
as the footprint and perpendicular to the normal and to each other."""


LOCAL_INTERACTION = tuple(var(f"local_{name}", VEC3) for name in ("normal", "dpdx", "dpdy"))
"""Their images under the Jacobian of the transforms above a union whose materials are evaluated by a function of its
own. The normal is not of unit length."""


def depends_on_interaction(expressions: Iterable[Expr]) -> bool:
    """True if some expressions of a label depend on the normal or the footprint of the surface interaction."""
    return not {NORMAL, DPDX, DPDY, DPDN, *SCENE_INTERACTION}.isdisjoint(free_variables(expressions))


def cells_of(label: Any) -> list[Expr]:
    """The cells on whose index a label depends: those in its list `expressions`."""
    return find(getattr(label, "expressions", ()), "cell")


def material_expressions(mark: Expr, interaction: Sequence[Expr] = SCENE_INTERACTION) -> list[Expr]:
    """The `expressions` of a mark's label, at the point and in the cell of the marked part.

    interaction : normal and footprint in the space of `p`: `SCENE_INTERACTION` or `LOCAL_INTERACTION`.
    """
    _, at, *cells = mark.args
    here = at if at.type is VEC3 else construct(at, 0.0)
    known = {POSITION: here, **dict(zip(cells_of(mark.data), cells, strict=True))}
    if depends_on_interaction(mark.data.expressions):
        known |= _interaction_at(here, at.type is not VEC3, interaction)
    return substitute(mark.data.expressions, known)


def interaction_at(here: Expr, interaction: Sequence[Expr]) -> list[Expr]:
    """The images of normal and footprint under the Jacobian of `here`, a function of the point `p`."""
    return directional_derivatives(here, var("p", VEC3), interaction)


def _interaction_at(here: Expr, flat: bool, interaction: Sequence[Expr]) -> dict[Expr, Expr]:
    """Normal and footprint in the label's space, in which a point of the scene is `here`.

    Tangents are transformed by the Jacobian J of `here`, normals by the inverse transpose of J. The cross product of
    two transformed tangents has the direction of the transformed normal, but the opposite sign if J is a reflection.
    For flat shapes J is singular: side walls keep the image of their normal, and all other surfaces get the normal of
    the plane.
    """
    dpdn, dpdx, dpdy = interaction_at(here, interaction)
    if dpdn is SCENE_INTERACTION[0]:
        normal = dpdn
    else:
        product = cross(dpdx, dpdy)
        if flat:
            wall = dot(product, product) < 1e-6 * dot(dpdx, dpdx) * dot(dpdy, dpdy)
            normal = normalize(where(wall, dpdn, product))
            dpdn = where(wall, dpdn, normal)
        else:
            normal = normalize(where(dot(product, dpdn) < 0.0, -product, product))
    return {NORMAL: normal, DPDN: dpdn, DPDX: dpdx, DPDY: dpdy}
