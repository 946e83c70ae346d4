"""Variants of a scene's light and materials as axes of a sweep; `Quality` has no fields for them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from raymarch.expr.vocabulary import max, pow, sqrt
from raymarch.scene.light import PENUMBRAS, Light
from raymarch.scene.light_kinds import hard
from raymarch.scene.material import Material
from raymarch.scene.scene import Scene
from raymarch.sdf.labels import relabelled


@dataclass(frozen=True, slots=True)
class Variant:
    """A part of a scene with the values that are compared.

    make : returns the scene with one of the values; None if the value would change nothing.
    ideal : returns the scene whose reference all values are compared with; None is the scene itself.
    ends : of the range of integers that are legal; None for the values alone.
    """

    name: str
    values: tuple[Any, ...]
    make: Callable[[Scene, Any], Scene | None]
    ends: tuple[int, int] | None = None
    ideal: Callable[[Scene], Scene] | None = None

    @property
    def legal(self) -> str:
        """Description of the legal values."""
        return ", ".join(self.values) if self.ends is None else "an integer from {} to {}".format(*self.ends)

    def is_legal(self, value: Any) -> bool:
        if self.ends is None:
            return value in self.values
        return type(value) is int and self.ends[0] <= value <= self.ends[1]


def with_penumbra(scene: Scene, form: str) -> Scene | None:
    """The scene with all soft shadows in one form, or "hard"."""
    if not any(light.soft for light in scene.lights):
        return None

    def formed(light: Light) -> Light:
        if not light.soft:
            return light
        return light.replace(penumbra=form) if form != "hard" else hard(light)

    return scene.replace(lights=[formed(light) for light in scene.lights])


def with_disc(scene: Scene) -> Scene:
    """The scene with soft shadows sampled over the light's whole disc, which all forms approximate."""
    return with_penumbra(scene, "sampled") or scene


def with_occlusion_samples(scene: Scene, samples: int) -> Scene | None:
    """The scene with another number of occlusion samples; the decay is adjusted, so the falloff with distance is
    equal."""
    own = scene.occlusion
    if own is None or own.steps == samples:
        return None
    made = own.replace(steps=samples, decay=max(pow(own.decay, own.steps / samples), 1e-3))
    return scene.replace(occlusion=made)


def with_model(scene: Scene, model: str) -> Scene | None:
    """The scene with all materials Phong, or all physical.

    Highlights have the same width in both: alpha of GGX and Blinn's exponent n have alpha^2 = 2 / (n + 2) (Walter et
    al. 2007), and Phong's exponent is a quarter of Blinn's.
    """
    wanted = model == "physical"
    if all(m.physical == wanted for m in scene.materials) or any(m.transmits or m.relief for m in scene.materials):
        return None
    turned = relabelled(scene.node, lambda material: _as_model(material, wanted))
    return scene.replace(node=turned.material(_as_model(scene.materials[0], wanted)))


def _as_model(material: Material, physical: bool) -> Material:
    if material.physical == physical:
        return material
    if physical:
        width = sqrt(2.0 / (4.0 * material.shininess + 2.0))
        return Material(albedo=material.color, roughness=sqrt(width), emission=material.emission)
    square = pow(material.roughness, 4.0)
    return Material(
        color=material.color, shininess=(2.0 / (square + 1e-4) - 2.0) / 4.0 + 1e-3, emission=material.emission
    )


VARIANTS: dict[str, Variant] = {
    v.name: v
    for v in (
        Variant("penumbra", ("hard", *PENUMBRAS), with_penumbra, ideal=with_disc),
        Variant("occlusion_samples", (2, 5, 10), with_occlusion_samples, (1, 32)),
        Variant("model", ("phong", "physical"), with_model),
    )
}
"""Variants by axis name."""


def varied(scene: Scene, variations: tuple[tuple[str, Any], ...]) -> Scene | None:
    """The scene with some variations, each a name and a value; None if one would change nothing."""
    for name, value in variations:
        made = VARIANTS[name].make(scene, value)
        if made is None:
            return None
        scene = made
    return scene


def ideal_of(scene: Scene, variations: tuple[tuple[str, Any], ...]) -> Scene:
    """The scene whose reference some variations are compared with."""
    for name, _ in variations:
        ideal = VARIANTS[name].ideal
        scene = ideal(scene) if ideal is not None else scene
    return scene
