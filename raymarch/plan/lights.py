"""Lights in the shader: few are written as code, many are rows of a texture that one loop reads."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from raymarch.errors import SceneError
from raymarch.scene.light import Light, PointLight, SpotLight, Sun
from raymarch.scene.parameter import Values
from raymarch.scene.scene import Scene

AS_TEXT = 8
"""Up to this many lights are written as code. More become rows of a texture, read in one loop."""

SUN, POINT, ATTENUATED = 0.0, 1.0, 2.0


def as_data(scene: Scene) -> bool:
    """True if the lights are rows of a texture."""
    return len(scene.lights) > AS_TEXT


def traits(scene: Scene) -> frozenset[str]:
    """The traits of all lights together. The shader holds no code for other traits.

    Kinds of light: "sun", "point", "attenuated". Falloff at the range: "window" for inverse-square lights, "fade" for
    lights with an attenuation. Also "spot", "hard" for hard shadows, and the names of soft shadows.
    """
    return frozenset[str]().union(*(traits_of(light) for light in scene.lights))


def traits_of(light: Light) -> set[str]:
    """The traits of one light; see `traits`."""
    found = set()
    if isinstance(light, PointLight):
        own = light.attenuation is not None
        found.add("attenuated" if own else "point")
        if light.range is not None:
            found.add("fade" if own else "window")
    elif isinstance(light, Sun):
        found.add("sun")
    else:
        raise no_code(light, "raymarch/plan/lights.py")
    if isinstance(light, SpotLight):
        found.add("spot")
    if light.shadow:
        found.add(light.penumbra if light.soft else "hard")
    return found


def no_code(light: Light, file: str) -> SceneError:
    """The error for a kind of light that a file has no code for."""
    name = type(light).__name__
    return SceneError(
        f"{name} has no code in {file}", legal="see docs/extending.md, a kind of light", where=light.where
    )


def columns(has: frozenset[str]) -> list[str]:
    """The names of the texels in a light's row: only those that the lights of the scene need."""
    found = ["place", "source"]
    if "attenuated" in has:
        found.append("terms")
    if "spot" in has:
        found += ["axis", "cone"]
    if shadows(has):
        found.append("caster")
    return found


def shadows(has: frozenset[str]) -> list[str]:
    """The kinds of shadow that the lights cast. Their numbers in the texture are their positions here, from 1."""
    return [kind for kind in ("hard", "two-sided", "cone", "triangulated", "sampled") if kind in has]


def rows(scene: Scene, values: Values) -> NDArray[np.float32]:
    """The lights of one frame as float32, shape (lights, texels, 4).

    place : position or direction; kind of light. source : radiance; range, or 0 for none. terms : constant, linear and
    quadratic attenuation. axis : direction of a spot; 1 for a spot, else 0. cone : outer and inner cosine of a spot.
    caster : number of the kind of shadow, or 0; softness; shadow radius, or 0 for none.
    """
    has = traits(scene)
    names, kinds = columns(has), shadows(has)
    made = np.zeros((len(scene.lights), len(names), 4))
    for row, light in zip(made, scene.lights, strict=True):
        for texel, name in zip(row, names, strict=True):
            given = _texel(name, light, kinds, values)
            texel[: len(given)] = given
    return made.astype(np.float32)


def _texel(name: str, light: Light, kinds: list[str], values: Values) -> list[float]:
    def of(value: Any) -> list[float]:
        return [] if value is None else np.atleast_1d(values.of(value)).tolist()

    local = light if isinstance(light, PointLight) else None
    spot = light if isinstance(light, SpotLight) else None
    match name:
        case "place" if isinstance(light, Sun):
            return [*of(light.direction), SUN]
        case "place" if local is not None:
            return [*of(local.position), POINT if local.attenuation is None else ATTENUATED]
        case "source":
            return [*of(light.radiance), *of(local.range if local is not None else None)]
        case "terms" if local is not None:
            return of(local.attenuation)
        case "axis" if spot is not None:
            return [*of(spot.direction), 1.0]
        case "cone" if spot is not None:
            return [c for cosine in spot.cosines for c in of(cosine)]
        case "caster" if light.shadow:
            kind = kinds.index(light.penumbra if light.soft else "hard") + 1
            return [kind, *of(light.softness), *(of(local.shadow_radius) if local is not None else [])]
    return []
