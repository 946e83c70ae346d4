"""What the presets of Quality mean for a scene: known before anything is drawn."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from raymarch.scene.parameter import set_values
from raymarch.scene.quality import PRESETS, PROMISED
from raymarch.scene.scene import Scene

HEIGHT = 360
"""Rows of the picture that lengths are given for: those of `raymarch render`."""


@dataclass(frozen=True, slots=True)
class Meaning:
    """A preset in terms of a scene.

    name : of the preset. pixels : how far 99 % of the hits may lie from the true ones, in pixel footprints; None if
    the field is an estimate, of which nothing can be promised. length : the same in the scene's unit, at the middle of
    what has an end, in a picture of 360 rows; None if nothing has one. epsilon : how near a ray comes, in pixels,
    before it looks for its hit. own : whether it is the scene's own quality.
    """

    name: str
    pixels: float | None
    length: float | None
    epsilon: float
    own: bool

    @property
    def words(self) -> str:
        """One line."""
        own = "; this is the scene's own" if self.own else ""
        if self.pixels is None:
            return f"the field is an estimate, nothing is promised; rays end within {self.epsilon:g} px{own}"
        length = "" if self.length is None else f", {self.length:.2g} at the scene's middle in {HEIGHT} rows"
        return f"99 % of the hits within {self.pixels:g} px{length}; looks for a hit within {self.epsilon:g} px{own}"


def meanings(scene: Scene) -> list[Meaning]:
    """All presets, coarsest first, with the parameters' defaults and at time 0."""
    certified = scene.node.exactness != "estimate"
    footprint = _footprint(scene)
    found = []
    for name in PRESETS:
        quality = scene.quality.to_preset(name)
        pixels = PROMISED[name] if certified else None
        length = None if pixels is None or footprint is None else pixels * footprint
        found.append(Meaning(name, pixels, length, quality.near(certified), quality == scene.quality))
    return found


def _footprint(scene: Scene) -> float | None:
    """Size of a pixel at the middle of what has an end."""
    subject = scene.subject
    if subject is None:
        return None
    pose = scene.pose(set_values(scene.parameters, {}, 0.0), 16 / 9)
    distance = float(np.linalg.norm(pose.position - (subject.lower + subject.upper) / 2))
    return pose.pixel(HEIGHT) * distance
