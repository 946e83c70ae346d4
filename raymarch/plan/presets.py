"""The accuracy of the presets of Quality for a scene, computed without drawing it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from raymarch.scene.parameter import set_values
from raymarch.scene.quality import PRESETS, PROMISED
from raymarch.scene.scene import Scene
from raymarch.sdf.levels import has_levels

HEIGHT = 360
"""Height in pixels of the picture that `Meaning.length` refers to: the default of `raymarch render`."""


@dataclass(frozen=True, slots=True)
class Meaning:
    """The accuracy of one preset for a scene.

    name : of the preset.
    pixels : error that 99 % of the hits do not exceed, in pixel footprints; None if the field is an estimate, for which
        nothing is guaranteed.
    length : the same error in the scene's unit, at the centre of its bounded part, in a picture of 360 rows; None if
        no part is bounded.
    epsilon : distance to a surface, in pixel widths, at which a ray starts to refine its hit.
    own : True if it is the quality of the scene.
    """

    name: str
    pixels: float | None
    length: float | None
    epsilon: float
    own: bool

    @property
    def words(self) -> str:
        """The preset in one line of text."""
        own = "; the scene uses this" if self.own else ""
        if self.pixels is None:
            return f"the field is an estimate, no accuracy is guaranteed; rays end within {self.epsilon:g} px{own}"
        length = "" if self.length is None else f", {self.length:.2g} at the scene's centre in {HEIGHT} rows"
        return f"99 % of the hits within {self.pixels:g} px{length}; refines hits within {self.epsilon:g} px{own}"


def meanings(scene: Scene) -> list[Meaning]:
    """All presets for a scene, coarsest first, with default parameters and at time 0."""
    certified = scene.node.exactness != "estimate"
    footprint = _footprint(scene)
    found = []
    for name in PRESETS:
        quality = scene.quality.to_preset(name)
        pixels = PROMISED[name] if certified else None
        length = None if pixels is None or footprint is None else pixels * footprint
        found.append(Meaning(name, pixels, length, quality.near(has_levels(scene.node)), quality == scene.quality))
    return found


def _footprint(scene: Scene) -> float | None:
    """Width of a pixel at the centre of the scene's bounded part, None if no part is bounded."""
    subject = scene.subject
    if subject is None:
        return None
    pose = scene.pose(set_values(scene.parameters, {}, 0.0), 16 / 9)
    distance = float(np.linalg.norm(pose.position - (subject.lower + subject.upper) / 2))
    return float(pose.footprint(distance, HEIGHT))
