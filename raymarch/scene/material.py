"""Materials: what a surface looks like. To the field a material is an opaque label."""

from __future__ import annotations

from typing import Any

import numpy as np

from raymarch.errors import SceneError
from raymarch.expr.convert import plain
from raymarch.expr.node import Expr, expr
from raymarch.expr.types import vector
from raymarch.expr.vocabulary import vec3
from raymarch.expr.walk import free_variables, rebuild, rewrite
from raymarch.scene.look import refuse_sizes, value_of
from raymarch.scene.relief import FLAT, height_of, tilt_of
from raymarch.scene.texture import Texture
from raymarch.scene.value import Value, value
from raymarch.sdf.lower import POSITION, is_seen

PHONG = ("color", "shininess", "specular", "ambient")
PHYSICAL = ("color", "metalness", "roughness", "f0")
MIXED = (*PHONG, *PHYSICAL[1:], "physical")
"""The fields that shading reads: of scenes after Phong, of physical ones, and of those with both."""

SMOOTH = 0.1
"""Roughness up to which a tree of ways takes a surface for a mirror: its lobe is then some two pixels wide. From there
the share falls evenly to 0 at twice that, so that a pattern of roughness has no edges."""

GLASS = ("transmission", "ior", "absorption")
RELIEF = ("tilt", "open")
"""What maps add: how the normal is bent, and the share of ambient light that comes through."""

MADE = {"albedo": "color", "occlusion": "open"}
"""Parameters whose value shading reads under another name."""

FIELDS = (*MIXED, "emission", *GLASS, *RELIEF)


@value
class Material(Value):
    """A surface, shaded after Phong or, if any of the physical values is given, by microfacets.

    Parameters
    ----------
    color : linear RGB, each in [0, 1].
    shininess : Phong: exponent of the highlight, > 0 (10 dull, 100 polished); 32.
    specular : Phong: strength of the highlight, in [0, 1]; 0.25.
    ambient : Phong: share of each light's colour that arrives from everywhere, shadow or not, in [0, 1]; 0.1.
    albedo : another name for `color`, which makes the material physical.
    metalness : physical: 0 for dielectrics, 1 for metals, whose albedo is the colour of their reflection; 0.
    roughness : physical: from 0, a mirror, to 1; its square is the width of the microfacets' slopes; 0.5, but 0 of what
        transmits. Lights shine on anything below 0.032 as on that, because a mirror shows no point.
    f0 : physical: reflectance of a dielectric at right angles, a number or linear RGB in [0, 1]; 0.04.
    emission : linear RGB >= 0 of light that the surface gives off by itself; either kind has it; black.

    transmission : physical: share of the light that goes through, in [0, 1]; 0. Rough glass is frosted along random
        ways (Walter et al. 2007), and clear in a tree of them; it needs the scene's `bounces`. Shadows of lights are
        those of a solid.
    ior : physical: index of refraction of what transmits, in [1, 4]; 1.5.
    absorption : physical: what a unit of length inside takes away, exp(-absorption) is left; a number or linear RGB,
        >= 0.

    normal : a normal map, `planar(...)` or `triplanar(...)`; times `normal_strength`, in [0, 100]; 1.
    height : a height map, or a function of the point; the normal bends as if the surface were raised by it times
        `height_scale`, in units of length, in [-1000, 1000]; 0.02. Nothing moves: see `displace_by_image` for that.
    occlusion : share of the ambient light and of the sky's that comes through, in [0, 1]; 1. Bounces find their own.

    A value may be a picture, `planar("wood.png")` or `triplanar("rock.png")`; maps that lie alike have as many pixels.
    It may be a function of a point, `lambda p: ...`, in the words of `raymarch.expr.vocabulary`; it is asked in the
    space in which the material is given, so a pattern moves along with what it is painted on. See
    `raymarch.checker`, `stripes` and `noise`. Equal materials are one.

    The physical model is that of Cook and Torrance (1982): GGX distribution (Walter et al. 2007), height-correlated
    masking after Smith (Heitz 2014), Fresnel after Schlick (1994), and a diffuse part of what the facets let
    in and out again (Kelemen and Szirmay-Kalos 2001), so that a white surface gives back what it gets, also at its rim.
    Metals also give back the light that several facets mirror (Kulla and Conty 2017).

    Raises SceneError for a value outside its range, and for values of both models in one material.
    """

    _given: dict[str, Any]
    _fields: dict[str, Expr]
    physical: bool

    def __init__(
        self,
        color: Any = None,
        shininess: Any = None,
        specular: Any = None,
        ambient: Any = None,
        *,
        albedo: Any = None,
        metalness: Any = None,
        roughness: Any = None,
        f0: Any = None,
        emission: Any = None,
        transmission: Any = None,
        ior: Any = None,
        absorption: Any = None,
        normal: Any = None,
        normal_strength: Any = 1.0,
        height: Any = None,
        height_scale: Any = 0.02,
        occlusion: Any = None,
    ) -> None:
        self._begin()
        if isinstance(color, Expr) and color is albedo:  # of a physical material that was changed
            color = None
        phong = {"shininess": shininess, "specular": specular, "ambient": ambient}
        physical = {"albedo": albedo, "metalness": metalness, "roughness": roughness, "f0": f0}
        physical |= {"transmission": transmission, "ior": ior, "absorption": absorption}
        phong, physical = _without_unset(phong), _without_unset(physical)
        is_physical = any(v is not None for v in physical.values())
        _refuse_both(phong, physical)
        if color is not None and albedo is not None:
            raise SceneError("Material: color together with albedo", legal="one of them; they are the same")
        name = "color" if albedo is None else "albedo"
        base = color if albedo is None else albedo
        maps = {name: base, **physical, "emission": emission, "normal": normal, "height": height}
        refuse_sizes({**maps, "occlusion": occlusion})
        raised = height_of(height)
        made = {
            "color": value_of(name, _or(base, (0.8, 0.8, 0.8)), 3, 0.0, 1.0),
            "shininess": value_of("shininess", _or(shininess, 32.0), 1, 1e-3, 1e6),
            "specular": value_of("specular", 0.0 if is_physical else _or(specular, 0.25), 1, 0.0, 1.0),
            "ambient": value_of("ambient", 0.0 if is_physical else _or(ambient, 0.1), 1, 0.0, 1.0),
            "metalness": value_of("metalness", _or(metalness, 0.0), 1, 0.0, 1.0),
            "roughness": value_of("roughness", _or(roughness, 0.5), 1, 0.0, 1.0),
            "f0": value_of("f0", _spread(_or(f0, 0.04)), 3, 0.0, 1.0),
            "physical": expr(1.0 if is_physical else 0.0),
            "emission": value_of("emission", _or(emission, (0.0, 0.0, 0.0)), 3, 0.0, np.inf),
            "transmission": value_of("transmission", _or(transmission, 0.0), 1, 0.0, 1.0),
            "ior": value_of("ior", _or(ior, 1.5), 1, 1.0, 4.0),
            "absorption": value_of("absorption", _spread(_or(absorption, 0.0)), 3, 0.0, 1e6),
            "tilt": tilt_of(normal, normal_strength, raised, height_scale),
            "open": value_of("occlusion", _or(occlusion, 1.0), 1, 0.0, 1.0),
        }
        given = {**phong, **physical, "color": color, "emission": emission, "occlusion": occlusion}
        kept = {name: _kept(value, made[MADE.get(name, name)]) for name, value in given.items()}
        relief = {"normal": normal, "height": raised, "normal_strength": normal_strength, "height_scale": height_scale}
        self._set(physical=is_physical, _fields=made, _given={**kept, **relief})
        if is_physical and physical["roughness"] is None:  # what transmits is smooth, and the rest is not
            made["roughness"] = expr(0.0 if self.transmits else 0.5)

    def arguments(self) -> dict[str, Any]:
        return dict(self._given)

    def _unchanged(self, changes: dict[str, Any]) -> dict[str, Any]:
        """`color` and `albedo` are one value, and so each takes the other's place."""
        return {n: None if {n, *changes} >= {"color", "albedo"} else v for n, v in self._given.items()}

    def _identity(self) -> tuple[Any, ...]:
        return tuple(self.expressions)

    @property
    def color(self) -> Expr:
        """Linear RGB; the albedo."""
        return self._fields["color"]

    @property
    def albedo(self) -> Expr | None:
        """Linear RGB of a physical material."""
        return self._fields["color"] if self.physical else None

    @property
    def normal(self) -> Texture | None:
        """The normal map."""
        return self._given["normal"]

    @property
    def normal_strength(self) -> Any:
        """Factor of the normal map."""
        return self._given["normal_strength"]

    @property
    def height(self) -> Texture | Expr | None:
        """The height map, or heights as an expression of the point."""
        return self._given["height"]

    @property
    def height_scale(self) -> Any:
        """Factor of the heights."""
        return self._given["height_scale"]

    @property
    def occlusion(self) -> Expr:
        """Share of the ambient light that comes through."""
        return self._fields["open"]

    @property
    def shininess(self) -> Expr:
        """Exponent of Phong's highlight."""
        return self._fields["shininess"]

    @property
    def specular(self) -> Expr:
        """Strength of Phong's highlight."""
        return self._fields["specular"]

    @property
    def ambient(self) -> Expr:
        """Share of each light that arrives from everywhere."""
        return self._fields["ambient"]

    @property
    def metalness(self) -> Expr:
        """1 for a metal."""
        return self._fields["metalness"]

    @property
    def metallic(self) -> bool:
        """True if it is a metal somewhere."""
        share = self._fields["metalness"]
        return self.physical and (not share.is_constant or float(share.data) > 0.0)

    @property
    def roughness(self) -> Expr:
        """From a mirror's 0 to 1."""
        return self._fields["roughness"]

    @property
    def f0(self) -> Expr:
        """Reflectance of a dielectric at right angles, linear RGB."""
        return self._fields["f0"]

    @property
    def emission(self) -> Expr:
        """Light that the surface gives off, linear RGB."""
        return self._fields["emission"]

    @property
    def emits(self) -> bool:
        """True if it gives off light."""
        return not self.emission.is_constant or bool(np.any(self.emission.data))

    @property
    def expressions(self) -> list[Expr]:
        """All values in the order of FIELDS; they may depend on parameters, time, POSITION, and indices of cells."""
        return [self._fields[name] for name in FIELDS]

    @property
    def transmits(self) -> bool:
        """True if light goes through it."""
        share = self._fields["transmission"]
        return not share.is_constant or bool(np.any(share.data))

    @property
    def transmission(self) -> Expr:
        """Share of the light that goes through."""
        return self._fields["transmission"]

    @property
    def ior(self) -> Expr:
        """Index of refraction of what transmits."""
        return self._fields["ior"]

    @property
    def absorption(self) -> Expr:
        """What a unit of length inside takes away, linear RGB."""
        return self._fields["absorption"]

    @property
    def frosted(self) -> bool:
        """True if light goes through it, and it is rough somewhere."""
        rough = self._fields["roughness"]
        return self.transmits and (not rough.is_constant or float(rough.data) > 0.0)

    def without_maps(self) -> Material:
        """The same material with the mean of each picture in its place, and nothing that bends normals."""

        def rule(node: Expr, args: tuple[Expr, ...]) -> Expr:
            if node.op != "texture":
                return rebuild(node, args)
            share = 1.0 if args[3].is_constant else 1.0 / 3.0  # of three projections, whose weights sum to 1
            mean = share * node.data.levels[-1][0, 0].astype(np.float64)
            return expr(mean if node.type.is_vector else float(mean[0]))

        given = {
            name: self._fields[MADE.get(name, name)]
            for name, value in self._given.items()
            if value is not None and MADE.get(name, name) in FIELDS
        }
        new = rewrite(given.values(), rule)
        flat = {name: _kept(made, new[made]) for name, made in given.items()}
        return self.replace(**{**flat, "normal": None, "height": None, "occlusion": None})

    @property
    def mirrors(self) -> bool:
        """True if it is so smooth somewhere that a tree of ways follows its reflection."""
        rough, share = self._fields["roughness"], self._fields["transmission"]
        clear = share.is_constant and float(share.data) == 1.0
        return self.physical and not clear and (not rough.is_constant or float(rough.data) < 2.0 * SMOOTH)

    @property
    def patterned(self) -> bool:
        """True if any value depends on the position."""
        return POSITION in free_variables(self.expressions)

    @property
    def relief(self) -> bool:
        """True if it bends normals or keeps ambient light out."""
        return (self._fields["tilt"], self._fields["open"]) != (FLAT, expr(1.0))

    @property
    def textured(self) -> bool:
        """True if it has a picture, or anything else that depends on how a surface is seen."""
        return is_seen(self.expressions)


def _kept(given: Any, made: Expr) -> Any:
    """What `replace` and pickles hand to the constructor again: no function, but what came of it."""
    if given is None or isinstance(given, Texture):
        return given
    if made.is_constant:
        return tuple(made.data.tolist()) if made.type.is_vector else float(made.data)
    return made


def _without_unset(values: dict[str, Any]) -> dict[str, Any]:
    """None for the expressions that stand for what a material was not given, as `dataclasses.replace` hands on."""
    return {n: None if any(value is e for e in _UNSET.get(n, ())) else value for n, value in values.items()}


_UNSET = {
    "shininess": (expr(32.0),),
    "specular": (expr(0.0), expr(0.25)),
    "ambient": (expr(0.0), expr(0.1)),
    "metalness": (expr(0.0),),
    "roughness": (expr(0.5),),
    "f0": (expr((0.04, 0.04, 0.04)),),
    "transmission": (expr(0.0),),
    "ior": (expr(1.5),),
    "absorption": (expr((0.0, 0.0, 0.0)),),
}


def _refuse_both(phong: dict[str, Any], physical: dict[str, Any]) -> None:
    one = next((name for name, v in phong.items() if v is not None), None)
    other = next((name for name, v in physical.items() if v is not None), None)
    if one is not None and other is not None:
        raise SceneError(
            f"Material: {one} together with {other}",
            legal="Phong's shininess, specular, ambient; or the physical albedo, metalness, roughness, f0",
        )


def _or(value: Any, otherwise: Any) -> Any:
    return otherwise if value is None else value


def _spread(value: Any) -> Any:
    """A number as three equal ones."""
    number = plain(value)
    if isinstance(number, bool | int | float):
        return (number, number, number)
    if isinstance(value, Expr) and value.type is vector(1):
        return vec3(value)
    return value
