"""The values of materials: each with its default, range and group. BSDFs and shading name those that they read."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from raymarch.expr.types import Type, vector


@dataclass(frozen=True, slots=True)
class Field:
    """A value of materials.

    name : as BSDFs read it. groups : what reads it: "phong", "physical", "glass", "coat", "subsurface" or "relief".
    default : of the argument; a number, or three for a vec3. low, high : range of each component.
    argument : the argument of `Material` that gives it; empty if the others do.
    """

    name: str
    groups: tuple[str, ...]
    default: Any
    low: float = 0.0
    high: float = 1.0
    argument: str | None = None

    @property
    def size(self) -> int:
        """Number of components."""
        return len(self.default) if isinstance(self.default, tuple) else 1

    @property
    def type(self) -> Type:
        """Type of the value: float or vec3."""
        return vector(self.size)

    @property
    def given(self) -> str:
        """The argument that gives the value; empty if the others do."""
        return self.name if self.argument is None else self.argument


GREY = (0.5, 0.5, 0.5)
"""The colour of a solid to which none is given: under a sun and a lit sky it is not yet white."""

ALL = (
    Field("color", ("phong", "physical"), GREY),
    Field("shininess", ("phong",), 32.0, 1e-3, 1e6),
    Field("specular", ("phong",), 0.25),
    Field("ambient", ("phong",), 0.1),
    Field("metalness", ("physical",), 0.0),
    Field("roughness", ("physical",), 0.5),
    Field("f0", ("physical",), (0.04, 0.04, 0.04)),
    Field("physical", (), 0.0, argument=""),
    Field("emission", (), (0.0, 0.0, 0.0), 0.0, np.inf),
    Field("transmission", ("glass",), 0.0),
    Field("ior", ("glass",), 1.5, 1.0, 4.0),
    Field("absorption", ("glass",), (0.0, 0.0, 0.0), 0.0, 1e6),
    Field("clearcoat", ("coat",), 0.0),
    Field("clearcoat_roughness", ("coat",), 0.0),
    Field("subsurface", ("subsurface",), 0.0),
    Field("subsurface_radius", ("subsurface",), (0.1, 0.1, 0.1), 0.0, 1e6),
    Field("subsurface_color", ("subsurface",), GREY),
    Field("exits", ("subsurface",), 0.0, argument=""),
    Field("bump_gradient", ("relief",), (0.0, 0.0, 0.0), -np.inf, np.inf, ""),
    Field("ambient_visibility", ("relief",), 1.0, argument="occlusion"),
    Field("own", (), 0.0, argument=""),
)
"""All values. "physical" and "own" are 1 for a material that is physical, or has a BSDF of the user's own. The gradient
"bump_gradient" perturbs the normal, and "ambient_visibility" is that of ambient light, 0 to 1. Paths set
"exits" to 1 where light leaves a medium that scattered it, and to -1 where it replaces diffuse reflection."""

FIELDS = tuple(field.name for field in ALL)
"""Their names."""


def group(name: str) -> tuple[str, ...]:
    """The names of the values of a group."""
    return tuple(field.name for field in ALL if name in field.groups)


PHONG, PHYSICAL, GLASS, COAT, SUBSURFACE, RELIEF = map(
    group, ("phong", "physical", "glass", "coat", "subsurface", "relief")
)

ARGUMENTS: Mapping[str, Field] = {field.given: field for field in ALL if field.given}
"""The values by the argument of `Material` that gives them."""

SMOOTH = 0.1
"""Roughness up to which Whitted ray tracing treats a surface as a mirror: its lobe is then about two pixels wide. Above
it the weight of the reflection falls linearly to 0 at twice this roughness, so that roughness maps show no edges."""

GLOSSY = 0.4
"""Roughness below which highlights of lights with an area are sampled by the lobes too. For rougher surfaces, points of
the light alone give less noise for the time: directions of the lobes lower the variance by less than half, even under a
light as wide as half its distance, and take up to twice the shadow rays."""
