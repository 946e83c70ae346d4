"""Edits of lights, materials and quality in the window: applied to a scene, and exported as Python.

An edited number becomes a parameter of the scene, so moving its slider does not recompile. Adding or removing a light,
setting a value that had none, or changing an option such as a shadow, compiles a new shader.
"""

from __future__ import annotations

import inspect
import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, TypeAlias

import numpy as np

from raymarch.expr.node import Expr
from raymarch.scene import light_kinds
from raymarch.scene.light import PENUMBRAS, Light
from raymarch.scene.material import Material
from raymarch.scene.parameter import Param, Spec, Value
from raymarch.scene.scene import Scene
from raymarch.scene.value import parameters_of
from raymarch.sdf.labels import relabelled
from raymarch.sdf.node import Node

Range: TypeAlias = tuple[float | None, float | None]

KINDS: dict[str, type[Light]] = {kind.__name__: kind for kind in light_kinds.KINDS}
"""The kinds of lights."""

UNSET: Mapping[str, Any] = {
    "softness": 0.1,
    "radius": 0.1,
    "range": 10.0,
    "shadow_radius": 10.0,
    "attenuation": (1.0, 0.0, 1.0),
    "up": (0.0, 1.0, 0.1),
    "direction": (0.0, -1.0, 0.0),
    "target": (0.0, 0.0, 0.0),
}
"""Values that a light may lack, and what they start with when they are set."""

AIMS = frozenset(("direction", "target"))
"""Values of which a light has one."""

LIGHT_RANGES: Mapping[str, Range] = {
    **dict.fromkeys(("color", "intensity", "attenuation"), (0.0, None)),
    **dict.fromkeys(("direction", "sun_direction", "up"), (-1.0, 1.0)),
    **dict.fromkeys(("range", "shadow_radius"), (0.01, None)),
    **dict.fromkeys(("width", "height", "radius"), (0.01, 10.0)),
    "softness": (0.0, 1.0),
    "half_angle": (0.01, 3.1),
    "blend": (0.0, 1.0),
}
"""Ranges of the values of lights; the others have none."""

OPTIONS: Mapping[str, tuple[Any, ...]] = {
    "shadow": (False, True),
    "penumbra": PENUMBRAS,
    "visible": (False, True),
}
"""Values of lights that are chosen, not moved."""

RANGES: dict[str, Range] = {
    **dict.fromkeys(("color", "specular", "ambient", "albedo", "metalness", "roughness", "f0"), (0.0, 1.0)),
    **dict.fromkeys(("transmission", "clearcoat", "clearcoat_roughness", "occlusion"), (0.0, 1.0)),
    **dict.fromkeys(("emission", "absorption"), (0.0, None)),
    "shininess": (1.0, 500.0),
    "ior": (1.0, 4.0),
    "normal_strength": (0.0, 4.0),
    "height_scale": (-0.2, 0.2),
}
"""Ranges of the values of materials."""

PHONG = ("color", "shininess", "specular", "ambient", "emission")
PHYSICAL = ("albedo", "metalness", "roughness", "f0", "emission")
"""Values that every material has."""

GLASS = {"transmission": 0.5, "ior": 1.5, "absorption": (0.1, 0.1, 0.1), "clearcoat": 0.5, "clearcoat_roughness": 0.1}
MAPS = {"normal_strength": 1.0, "height_scale": 0.02}
OCCLUSION = {"occlusion": 1.0}
"""Values that a material may lack, which then cost nothing, and what they start with when they are set."""


@dataclass(frozen=True, slots=True)
class LightEdit:
    """An editable light: its kind and its constructor arguments. None, and a softness or radius of 0, are unset.

    `number` identifies its parameters and does not change when other lights are added or removed. Expressions of the
    scene file are kept and cannot be edited.
    """

    number: int
    kind: str
    values: dict[str, Any]
    own: Light | None = None
    """The light itself if it is of a kind of the user's own, which is not editable."""

    def name(self, value: str) -> str:
        """The name of the parameter for a value."""
        return f"light {self.number} {value}"

    @property
    def unset(self) -> list[str]:
        """The values that it lacks."""
        return [name for name, value in self.values.items() if name in UNSET and _is_unset(value)]

    @property
    def moved(self) -> list[str]:
        """The values with sliders, or kept as expressions."""
        return [n for n, v in self.values.items() if n not in OPTIONS and not (n in UNSET and _is_unset(v))]

    def with_value(self, name: str, value: Any) -> LightEdit:
        """The light with another value. A softness, and the radius of a light that shines as a point, need a shadow. A
        light has a direction or a target."""
        soft = name == "softness" or (name == "radius" and self.kind != "SphereLight")
        others: dict[str, Any] = {"shadow": True} if soft else {}
        others |= {other: None for other in AIMS - {name} if name in AIMS and other in self.values}
        return replace(self, values={**self.values, name: value, **others})

    def light(self) -> Light:
        """The light with parameters for its numbers."""
        if self.own is not None:
            return self.own
        kind: Any = KINDS[self.kind]
        made = dict(self.values)
        for name in self.moved:
            if is_number(made[name]):
                ends = LIGHT_RANGES.get(name, (None, None))
                made[name] = _param(self.name(name), made[name], ends)
        return kind(**made)

    def python(self, params: Mapping[str, Value]) -> str:
        """The light as Python; `params` are the values of changed parameters. Expressions are read from `scene`."""
        kept = f"scene.lights[{self.number - 1}]"
        if self.own is not None:
            return kept
        usual = {n: p.default for n, p in inspect.signature(KINDS[self.kind]).parameters.items()}
        now = {n: params.get(self.name(n), v) for n, v in self.values.items()}
        parts = [f"{n}={_written(v, f'{kept}.{n}')}" for n, v in now.items() if isinstance(v, Expr) or v != usual[n]]
        return f"rm.{self.kind}({', '.join(parts)})"


@dataclass(frozen=True, slots=True)
class Edits:
    """The changes that the window makes to the scene of a file. None and empty dicts are no change.

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
        return scene.replace(node=node, lights=lights, quality=scene.quality.replace(**self.quality))

    def python(self, scene: Scene, params: Mapping[str, Value]) -> str:
        """The edits as lines for the end of the scene file, which can be run there."""
        lines, given = [], []
        if self.lights is not None:
            lines += ["lights = [", *(f"    {light.python(params)}," for light in self.lights), "]"]
            given.append("lights=lights")
        for index, values in self.materials.items():
            if index < len(scene.materials):
                now = {n: params.get(material_name(index, n), v) for n, v in values.items()}
                lines.append(f"material_{index} = {_material_python(scene.materials[index], index, now)}")
        if self.quality:
            parts = [f"{name}={value!r}" for name, value in self.quality.items()]
            lines.append(f"quality = scene.quality.replace({', '.join(parts)})")
            given.append("quality=quality")
        if lines and scene.of_a_node:
            lines.insert(0, "scene = rm.studio(scene)")
        if given:
            lines.append(f"scene = scene.replace({', '.join(given)})")
        return "\n".join(lines)


def _material_python(old: Material, index: int, now: Mapping[str, Any]) -> str:
    """A material as Python, with the line of the file that it replaces."""
    where = f"  # in place of {old.where}" if old.where else ""
    given = {n: v for n, v in old.arguments().items() if v is not None and n not in (*MAPS, "normal", "height")}
    given = {n: _plain(v) for n, v in given.items() if not (n == "color" and "albedo" in now)}
    plain = all(is_number(v) for v in given.values()) and old.normal is None and old.height is None
    values = {n: v for n, v in {**(given if plain else {}), **now}.items() if is_number(v)}
    made = "rm.Material" if plain else f"scene.materials[{index}].replace"
    return f"{made}({', '.join(f'{n}={_written(v)}' for n, v in values.items())}){where}"


def params_as_python(specs: Mapping[str, Spec], params: Mapping[str, Value]) -> str:
    """The changed parameters as lines for the scene file, with their values as defaults."""
    lines = []
    for name, value in params.items():
        spec = specs[name]
        ends = [f"{end}={_written(at)}" for end, at in (("min", spec.min), ("max", spec.max)) if at is not None]
        lines.append(f"rm.Param({', '.join([json.dumps(name), _written(value), *ends])})")
    return "\n".join(lines)


def editable_lights(scene: Scene) -> tuple[LightEdit, ...]:
    """The lights of a scene in editable form."""
    return tuple(
        LightEdit(i, type(light).__name__, {n: _plain(v) for n, v in light.arguments().items()})
        if type(light) in light_kinds.KINDS
        else LightEdit(i, type(light).__name__, {}, own=light)
        for i, light in enumerate(scene.lights, 1)
    )


def new_light(kind: str, number: int, scene: Scene) -> LightEdit:
    """A new light of a kind, above the subject of a scene."""
    subject = scene.subject
    reach = 1.0 if subject is None or not subject.bounded or subject.empty else float(np.linalg.norm(subject.size))
    place = tuple(round(v, 3) for v in (0.6 * reach, 1.2 * reach, 0.8 * reach))
    first: dict[str, Any] = {
        "sun_direction": (0.4, 0.8, 0.45),
        "direction": (-0.4, -0.8, -0.45),
        "position": place,
        "width": round(0.5 * reach, 3),
        "height": round(0.5 * reach, 3),
        "radius": round(0.1 * reach, 3) if kind == "SphereLight" else 0.0,
        "intensity": 1.0 if kind == "Sun" else round(reach**2, 3),
    }
    given = {n: v for n, v in first.items() if n in parameters_of(KINDS[kind])}
    made: Any = KINDS[kind]
    return LightEdit(number, kind, {n: _plain(v) for n, v in made(**given).arguments().items()})


def editable_material(material: Material) -> dict[str, Any]:
    """The values of a material by name: numbers, and expressions that cannot be edited. Values that it lacks, such as
    a clear coat, are not among them, because each costs time; see `unset_values`."""
    given = material.arguments()
    more = [name for name in _optional(material) if given.get(name) is not None]
    names = {name: "color" if name == "albedo" else name for name in (*_base(material), *more)}
    return {name: _plain(getattr(material, attribute)) for name, attribute in names.items()}


def unset_values(material: Material, values: Mapping[str, Any]) -> dict[str, Any]:
    """The values that an edited material lacks, with those that they start with when they are set."""
    return {name: start for name, start in _optional(material).items() if name not in values}


def _base(material: Material) -> tuple[str, ...]:
    return PHYSICAL if material.physical else PHONG


def _optional(material: Material) -> dict[str, Any]:
    maps = {"normal_strength": material.normal, "height_scale": material.height}
    scales = {name: MAPS[name] for name, map in maps.items() if map is not None}
    return {**(GLASS if material.physical else {}), **OCCLUSION, **scales}


def material_name(index: int, value: str) -> str:
    """The name of the parameter for a value of an edited material."""
    return f"material {index} {value}"


def _is_unset(value: Any) -> bool:
    return value is None or (isinstance(value, float) and value == 0.0)


def _param(name: str, value: Any, range: Range) -> Expr:
    """A parameter whose range holds its value."""
    low, high = range
    ends = None if low is None else min(low, np.min(value)), None if high is None else max(high, np.max(value))
    return Param(name, value, *(None if end is None else float(end) for end in ends))


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
            names = {*_base(old), *_optional(old)}
            new = {
                name: _param(material_name(index, name), value, RANGES[name])
                for name, value in values.items()
                if name in names and is_number(value)  # a pattern or an image is not editable
            }
            exchanged[old] = old.replace(**new)
    root = relabelled(scene.node, lambda material: exchanged.get(material, material))
    default = scene.materials[0]
    return root.material(exchanged[default]) if default in exchanged else root


def is_number(value: Any) -> bool:
    """True for a plain number or vector."""
    return isinstance(value, int | float | tuple)


def _written(value: Any, expression: str = "...") -> str:
    """A value as Python; `expression` stands for one that is not plain."""
    plain = _plain(value)
    if isinstance(plain, tuple):
        return f"({', '.join(f'{v:.6g}' for v in plain)})"
    if isinstance(plain, bool | str) or plain is None:
        return repr(plain)
    return f"{plain:.6g}" if isinstance(plain, int | float) else expression
