"""Materials: what a surface looks like. To the field a material is an opaque label."""

from __future__ import annotations

from typing import Any

from raymarch.errors import Location, user_location
from raymarch.expr.node import Expr
from raymarch.scene.parameter import as_number, as_vec3


class Material:
    """A surface shaded after Phong.

    Parameters
    ----------
    color : linear RGB, each in [0, 1].
    shininess : exponent of the highlight, > 0 (10 dull, 100 polished).
    specular : strength of the highlight, in [0, 1].
    ambient : share of each light's colour that arrives from everywhere, shadow or not, in [0, 1].

    Each may depend on parameters, time, and the index of a cell (`raymarch.repeat_varied`). Equal materials are one.
    """

    __slots__ = ("ambient", "color", "shininess", "specular", "where")

    FIELDS = ("color", "shininess", "specular", "ambient")

    def __init__(
        self, color: Any = (0.8, 0.8, 0.8), shininess: Any = 32.0, specular: Any = 0.25, ambient: Any = 0.1
    ) -> None:
        self.color = as_vec3("Material: color", color, 0.0, 1.0, cells=True)
        self.shininess = as_number("Material: shininess", shininess, 1e-3, 1e6, cells=True)
        self.specular = as_number("Material: specular", specular, 0.0, 1.0, cells=True)
        self.ambient = as_number("Material: ambient", ambient, 0.0, 1.0, cells=True)
        self.where: Location | None = user_location()

    @property
    def expressions(self) -> list[Expr]:
        """All that may depend on parameters or time, in the order of FIELDS."""
        return [self.color, self.shininess, self.specular, self.ambient]

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Material) and all(
            a is b for a, b in zip(self.expressions, other.expressions, strict=True)
        )

    def __hash__(self) -> int:
        return hash(tuple(self.expressions))

    def __repr__(self) -> str:
        color = self.color.data.tolist() if self.color.is_constant else "expression"
        return f"Material(color={color})"
