"""Edits of lights, materials and quality in the window: applied to a scene, and exported as Python.

An edited number becomes a parameter of the scene, so moving its slider does not recompile. Adding or removing a light,
or changing an option such as its shadow, compiles a new shader.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from raymarch.expr.node import Expr
from raymarch.scene import light as lights
from raymarch.scene.light import Light, Range
from raymarch.scene.material import Material
from raymarch.scene.parameter import Param, Spec, Value
from raymarch.scene.scene import Scene
from raymarch.scene.value import parameters_of
from raymarch.sdf.labels import relabelled
from raymarch.sdf.node import Node

KINDS: dict[str, tuple[type[Light], Mapping[str, Range]]] = {
    kind.__name__: (kind, kind.EDITED) for kind in lights.KINDS
}
"""The kinds of lights, with their editable values and ranges."""

KEPT = ("range", "shadow_radius", "attenuation")
"""Values of lights that cannot be edited."""

SOFT = 0.1
"""Initial softness of a shadow."""

PHONG: dict[str, Range] = {
    "color": (0.0, 1.0),
    "shininess": (1.0, 500.0),
    "specular": (0.0, 1.0),
    "ambient": (0.0, 1.0),
    "emission": (0.0, None),
}
PHYSICAL: dict[str, Range] = {
    "albedo": (0.0, 1.0),
    "metalness": (0.0, 1.0),
    "roughness": (0.0, 1.0),
    "f0": (0.0, 1.0),
    "emission": (0.0, None),
}
COATED: dict[str, Range] = {**PHYSICAL, "clearcoat": (0.0, 1.0), "clearcoat_roughness": (0.0, 1.0)}


@dataclass(frozen=True, slots=True)
class LightEdit:
    """An editable light: its kind, its numbers by name, its options.

    `number` identifies its parameters and does not change when other lights are added or removed. Values that are not
    plain numbers are kept unchanged and cannot be edited.
    """

    number: int
    kind: str
    values: dict[str, Any]
    shadow: bool
    penumbra: str
    kept: dict[str, Any] = field(default_factory=dict)
    own: Light | None = None
    """The light itself if it is of a kind of the user's own, which is not editable."""

    def name(self, value: str) -> str:
        """The name of the parameter for a value."""
        return f"light {self.number} {value}"

    def softened(self) -> LightEdit:
        """The light with a soft shadow, whose width is then editable."""
        return replace(self, values={**self.values, "softness": SOFT}, shadow=True)

    def light(self) -> Light:
        """The light with parameters for its numbers."""
        if self.own is not None:
            return self.own
        made, ranges = KINDS[self.kind]
        values: dict[str, Any] = {}
        for name, value in self.values.items():
            values[name] = value if isinstance(value, Expr) else Param(self.name(name), value, *ranges[name])
        kind: Any = made
        options = {"shadow": self.shadow, "penumbra": self.penumbra}
        return kind(**values, **{n: v for n, v in options.items() if n in parameters_of(made)}, **self.kept)

    def python(self, params: dict[str, Value]) -> str:
        """The light as Python; `params` are the values of changed parameters."""
        if self.own is not None:
            return f"{self.kind}(...)"
        parts = [f"{name}={_written(params.get(self.name(name), value))}" for name, value in self.values.items()]
        if self.shadow:
            parts.append("shadow=True")
        if self.penumbra != "two-sided" and "penumbra" in parameters_of(KINDS[self.kind][0]):
            parts.append(f"penumbra={self.penumbra!r}")
        parts += [f"{name}={_written(value)}" for name, value in self.kept.items()]
        return f"rm.{self.kind}({', '.join(parts)})"


@dataclass(frozen=True, slots=True)
class Edits:
    """The changes that the window makes to the scene of a file. None and empty dicts are no change.

    Attributes
    ----------
    lights : all lights, to replace those of the scene.
    materials : the values of edited materials, by their index in `scene.materials`.
    quality : fields of `Quality` that replace those of the scene.
    """

    lights: tuple[LightEdit, ...] | None = None
    materials: dict[int, dict[str, Any]] = field(default_factory=dict)
    quality: dict[str, Any] = field(default_factory=dict)

    @property
    def empty(self) -> bool:
        return self.lights is None and not self.materials and not self.quality

    def apply(self, scene: Scene) -> Scene:
        """The edited scene. Materials that the scene no longer has are ignored."""
        if self.empty:
            return scene
        lights = scene.lights if self.lights is None else tuple(light.light() for light in self.lights)
        node = _painted(scene, self.materials) if self.materials else scene.node
        quality = scene.quality.replace(**self.quality)
        return scene.replace(node=node, lights=lights, quality=quality)

    def python(self, scene: Scene, params: dict[str, Value]) -> str:
        """The edits as lines for the scene file."""
        lines = []
        if self.lights is not None:
            lines += ["lights = [", *(f"    {light.python(params)}," for light in self.lights), "]"]
        for index, values in self.materials.items():
            parts = [f"{n}={_written(params.get(material_name(index, n), v))}" for n, v in values.items()]
            old = scene.materials[index] if index < len(scene.materials) else None
            parts += _kept_glass(old) if old is not None else []
            where = f"  # {old.where}" if old is not None and old.where else ""
            lines.append(f"material_{index} = rm.Material({', '.join(parts)}){where}")
        if self.quality:
            parts = [f"{name}={value!r}" for name, value in self.quality.items()]
            lines.append(f"quality = rm.Quality({', '.join(parts)})")
        return "\n".join(lines)


def _kept_glass(material: Material) -> list[str]:
    """The values of a transmissive material that are not editable; `...` for non-constant ones."""
    if not material.transmits:
        return []
    kept = {"transmission": material.transmission, "ior": material.ior, "absorption": material.absorption}
    return [f"{name}={_written(value)}" for name, value in kept.items()]


def params_as_python(specs: Mapping[str, Spec], params: Mapping[str, Value]) -> str:
    """The changed parameters as lines for the scene file, with their values as defaults."""
    lines = []
    for name, value in params.items():
        spec = specs[name]
        ends = [
            f"{end}={_written(bound)}" for end, bound in (("min", spec.min), ("max", spec.max)) if bound is not None
        ]
        lines.append(f"rm.Param({', '.join([json.dumps(name), _written(value), *ends])})")
    return "\n".join(lines)


def editable_lights(scene: Scene) -> tuple[LightEdit, ...]:
    """The lights of a scene in editable form."""
    return tuple(_editable(i, light) for i, light in enumerate(scene.lights, 1))


def new_light(kind: str, number: int, scene: Scene) -> LightEdit:
    """A new light of a kind, above the subject of a scene."""
    subject = scene.subject
    reach = 1.0 if subject is None or not subject.bounded or subject.empty else float(np.linalg.norm(subject.size))
    place = (0.6 * reach, 1.2 * reach, 0.8 * reach)
    bright = 1.0 if kind == "Sun" else round(reach**2, 3)
    first: dict[str, Any] = {
        "direction": (0.4, 0.8, 0.45) if kind == "Sun" else (-0.4, -0.8, -0.45),
        "position": tuple(round(v, 3) for v in place),
        "width": round(0.5 * reach, 3),
        "height": round(0.5 * reach, 3),
        "angle": 0.5,
        "blend": 0.2,
        "radius": round(0.1 * reach, 3),
        "color": (1.0, 1.0, 1.0),
        "intensity": bright,
    }
    return LightEdit(number, kind, {n: first[n] for n in KINDS[kind][1] if n in first}, False, "two-sided")


def editable_material(material: Material) -> dict[str, Any]:
    """The values of a material that are numbers or parameters, by name."""
    return {name: _plain(material_value(material, name)) for name in _ranges(material)}


def _ranges(material: Material) -> dict[str, Range]:
    """The editable values of a material. One without a clear coat gets none, because it would cost time."""
    if not material.physical:
        return PHONG
    return COATED if material.coated else PHYSICAL


def material_value(material: Material, name: str) -> Any:
    """A value of a material."""
    return getattr(material, "color" if name == "albedo" else name)


def material_name(index: int, value: str) -> str:
    """The name of the parameter for a value of an edited material."""
    return f"material {index} {value}"


def _editable(number: int, light: Light) -> LightEdit:
    kind = type(light).__name__
    if type(light) not in lights.KINDS:
        return LightEdit(number, kind, {}, light.shadow, light.penumbra, own=light)
    values = {name: _plain(getattr(light, name)) for name in KINDS[kind][1]}
    if values.get("softness") == 0.0:
        del values["softness"]  # a parameter could be > 0, which would require a soft shadow
    kept = {name: getattr(light, name) for name in KEPT if getattr(light, name, None) is not None}
    return LightEdit(number, kind, values, light.shadow, light.penumbra, kept)


def _plain(value: Any) -> Any:
    """A constant expression as a number or tuple; anything else as it is."""
    if not isinstance(value, Expr) or not value.is_constant:
        return value
    data = np.asarray(value.data, np.float64)
    return float(data) if data.shape == () else tuple(float(v) for v in data)


def _painted(scene: Scene, materials: dict[int, dict[str, Any]]) -> Node:
    """The tree with edited materials. Parts without a material show material 0, which wraps the entire tree."""
    exchanged: dict[Material, Material] = {}
    for index, values in materials.items():
        if index < len(scene.materials):
            old = scene.materials[index]
            ranges = _ranges(old)
            new = {
                name: Param(material_name(index, name), value, *ranges[name])
                for name, value in values.items()
                if name in ranges and _number(value)  # a pattern or an image is not editable
            }
            exchanged[old] = old.replace(**new)
    root = relabelled(scene.node, lambda material: exchanged.get(material, material))
    default = scene.materials[0]
    return root.material(exchanged[default]) if default in exchanged else root


def _number(value: Any) -> bool:
    return isinstance(value, int | float | tuple)


def _written(value: Any) -> str:
    plain = _plain(value)
    if isinstance(plain, tuple):
        return f"({', '.join(f'{v:.6g}' for v in plain)})"
    return f"{plain:.6g}" if isinstance(plain, int | float) else "..."
