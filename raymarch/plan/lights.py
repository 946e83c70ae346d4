"""How lights reach the shader: a few as text, many as data that one loop goes through."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from raymarch.scene.light import Light, PointLight, SpotLight, Sun
from raymarch.scene.parameter import Values
from raymarch.scene.scene import Scene

AS_TEXT = 8
"""Up to so many lights are written out, each with what it needs; more become the rows of a texture and one loop."""

SUN, POINT, ATTENUATED = 0.0, 1.0, 2.0


def as_data(scene: Scene) -> bool:
    """True if the lights are data."""
    return len(scene.lights) > AS_TEXT


def traits(scene: Scene) -> frozenset[str]:
    """What at least one of the lights has; what none has is not in the shader.

    "sun", "point", "attenuated" (kinds of source), "window", "fade" (an end to them), "spot", "hard" and the names of
    soft shadows.
    """
    return frozenset[str]().union(*(traits_of(light) for light in scene.lights))


def traits_of(light: Light) -> set[str]:
    """What one light has; see `traits`."""
    found = set()
    if isinstance(light, PointLight):
        own = light.attenuation is not None
        found.add("attenuated" if own else "point")
        if light.range is not None:
            found.add("fade" if own else "window")
    else:
        found.add("sun")
    if isinstance(light, SpotLight):
        found.add("spot")
    if light.shadow:
        found.add(light.penumbra if light.soft else "hard")
    return found


def columns(has: frozenset[str]) -> list[str]:
    """The names of the texels of a light's row: what the lights of this scene need, no more."""
    found = ["place", "source"]
    if "attenuated" in has:
        found.append("terms")
    if "spot" in has:
        found += ["axis", "cone"]
    if shadows(has):
        found.append("caster")
    return found


def shadows(has: frozenset[str]) -> list[str]:
    """The kinds of shadow among the lights, in the order of their numbers in the data, from 1."""
    return [kind for kind in ("hard", "two-sided", "cone", "triangulated", "sampled") if kind in has]


def rows(scene: Scene, values: Values) -> NDArray[np.float32]:
    """The lights of one frame, shape (lights, texels, 4).

    place: position or direction, kind of source. source: radiance, radius or 0. terms: attenuation. axis: of a spot;
    its fourth value is 1 for a spot. cone: outer and inner cosine. caster: number of the kind of shadow or 0, softness,
    shadow radius or 0.
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
