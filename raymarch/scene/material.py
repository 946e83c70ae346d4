"""Materials: Phong or physical (microfacet) surfaces. For the field a material is an opaque label."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar

import numpy as np
from numpy.typing import NDArray

from raymarch.errors import SceneError, warn
from raymarch.expr.calls import checked
from raymarch.expr.convert import plain, short
from raymarch.expr.node import Expr, Operand, expr
from raymarch.expr.types import vector
from raymarch.expr.vocabulary import vec3
from raymarch.expr.walk import free_variables, rebuild, rewrite
from raymarch.scene.fields import ARGUMENTS, FIELDS, GLOSSY, GREY, SMOOTH
from raymarch.scene.material_values import ColorOrTexture, FloatOrTexture, check_map_sizes, material_value
from raymarch.scene.parameter import is_zero
from raymarch.scene.relief import FLAT, bump_gradient, height_field
from raymarch.scene.texture import Texture
from raymarch.scene.value import Value, value
from raymarch.sdf.domain import Scalar
from raymarch.sdf.interaction import POSITION, depends_on_interaction

if TYPE_CHECKING:
    from raymarch.scene.bsdf import BSDF

T = TypeVar("T")

MADE = {"albedo": "color"}
"""Parameters that are another name of a value."""


def once(function: Callable[[Material], T]) -> T:
    """Decorator: a property that is computed once. A plan asks often, and a scene may have thousands of materials."""
    name = function.__name__

    def get(self: Material) -> T:
        known = self._known
        if name not in known:
            known[name] = function(self)
        result: T = known[name]
        return result

    return property(get, doc=function.__doc__)  # type: ignore[return-value]  # typed as its value


@value
class Material(Value):
    """A surface material: Phong, or a microfacet model if any physical value is given.

    Parameters
    ----------
    color : base colour, linear RGB, each in [0, 1]. Default (0.5, 0.5, 0.5).
    shininess : Phong. Exponent of the highlight, > 0: 10 is dull, 100 polished. Default 32.
    specular : Phong. Strength of the highlight, in [0, 1]. Default 0.25.
    ambient : Phong. Fraction of the colour of each light that arrives from all directions, in shadow too, in [0, 1].
        Default 0.1.
    albedo : another name for `color`. It makes the material physical.
    metalness : physical. 0 for a dielectric, 1 for a metal, in [0, 1]. The albedo of a metal is the colour of its
        reflection. Default 0.
    roughness : physical. From 0 (a mirror) to 1. Its square is the width of the distribution of microfacet slopes.
        Default 0.5, or 0 for a material that transmits. Highlights of lights use at least 0.032, because a perfect
        mirror shows no point light.
    f0 : physical. Reflectance of a dielectric at normal incidence, a number or linear RGB in [0, 1]. Default 0.04.
    emission : emitted light, linear RGB, each >= 0, for both models. Default black.
    transmission : physical. Fraction of the light that is refracted into the solid, in [0, 1]. Default 0. It needs the
        `bounces` of the scene. With the path integrator rough glass is frosted (Walter et al. 2007); with "whitted"
        it is clear. Its shadows are those of an opaque solid.
    ior : physical. Index of refraction inside a material that transmits, in [1, 4]. Default 1.5.
    absorption : physical. Absorption coefficient per unit of length inside: exp(-absorption) of the light is left after
        one unit. A number or linear RGB, >= 0. Default 0. For glass that leaves the colour c after one unit:
        -numpy.log(c).
    clearcoat : physical. Weight of a clear coat over the surface, as varnish on wood, in [0, 1]. Default 0, which costs
        nothing. The coat has an index of refraction of 1.5. The emission is not under it.
    clearcoat_roughness : physical. Roughness of the coat, from 0 (a mirror) to 1. Default 0.
    subsurface : physical. Weight of light that is scattered in the solid and leaves it elsewhere, as in skin, wax,
        marble and milk, in place of diffuse reflection, in [0, 1]. Default 0, which costs nothing. It needs the
        `bounces` of the scene and the path integrator; else it is diffuse reflection, its limit for small radii.
    subsurface_radius : physical. Mean free path in the solid of red, green and blue light, lengths >= 0, or one for
        all. Default 0.1. Light of the longest one goes farthest: skin is about (1, 0.35, 0.2) of some millimetres.
    subsurface_color : physical. The colour of a thick solid in even light, linear RGB in [0, 1]. Default `color`.
    normal : a normal map, made by `planar(...)` or `triplanar(...)`. None for no map.
    normal_strength : factor of the slopes of the normal map, in [0, 100].
    height : a height map, or a function of the point that gives heights. The normal is perturbed as if the surface were
        raised by height * `height_scale`. The surface does not move; see `displace_by_image` for displacement.
    height_scale : factor of the heights, in units of length.
    occlusion : fraction of ambient light and sky light that reaches the surface, in [0, 1]. Default 1. Ignored by
        path-traced light.
    bsdf : physical. A class of BSDFs of your own, in place of microfacets; see "A BSDF" in docs/extending.md. A scene
        has at most one.

    Raises
    ------
    SceneError : a value outside its range, and for values of both models in one material.

    Notes
    -----
    A value may be a texture, such as `planar("wood.png")` or `triplanar("rock.png")`. Maps that share a projection must
    share a resolution.

    A value may be a function of the point, such as `lambda p: 0.5 + 0.5 * rm.sin(p.x)`. The point is in the space in
    which the material is given, so a pattern moves with the node. See `raymarch.checker`, `stripes` and
    `noise`. Equal materials are one material.

    The physical model is that of Cook and Torrance (1982): GGX distribution (Walter et al. 2007), height-correlated
    Smith masking (Heitz 2014), Schlick's Fresnel term (1994), and a diffuse term for the light that passes through the
    microfacets twice (Kelemen and Szirmay-Kalos 2001). So a white surface conserves energy, also at grazing angles.
    Metals include multiple scattering between microfacets (Kulla and Conty 2017). `clearcoat` and `clearcoat_roughness`
    are those of glTF's KHR_materials_clearcoat, with energy-conserving layers; see `raymarch/scene/layers.py`. The
    `subsurface` parameters are those of OpenPBR (2024) for isotropic scattering; see `raymarch/scene/subsurface.py`.

    Examples
    --------
    >>> rm.Material(albedo="gold", metalness=1, roughness=0.2).replace(roughness=0.5)
    Material(albedo=(1.0, 0.679542, 0.0), metalness=1.0, roughness=0.5)
    """

    BELONGS: ClassVar[str] = "node.material(...)"
    color: Expr
    albedo: Expr | None
    shininess: Expr
    specular: Expr
    ambient: Expr
    metalness: Expr
    roughness: Expr
    f0: Expr
    emission: Expr
    transmission: Expr
    ior: Expr
    absorption: Expr
    clearcoat: Expr
    clearcoat_roughness: Expr
    subsurface: Expr
    subsurface_radius: Expr
    subsurface_color: Expr
    occlusion: Expr
    normal: Texture | None
    normal_strength: Scalar
    height: Texture | Expr | None
    height_scale: Scalar
    bsdf: type[BSDF] | None
    physical: bool
    _given: dict[str, Any]
    _fields: dict[str, Expr]
    _known: dict[str, Any]

    def __init__(
        self,
        color: ColorOrTexture | None = None,
        shininess: FloatOrTexture | None = None,
        specular: FloatOrTexture | None = None,
        ambient: FloatOrTexture | None = None,
        *,
        albedo: ColorOrTexture | None = None,
        metalness: FloatOrTexture | None = None,
        roughness: FloatOrTexture | None = None,
        f0: ColorOrTexture | None = None,
        emission: ColorOrTexture | None = None,
        transmission: FloatOrTexture | None = None,
        ior: FloatOrTexture | None = None,
        absorption: ColorOrTexture | None = None,
        clearcoat: FloatOrTexture | None = None,
        clearcoat_roughness: FloatOrTexture | None = None,
        subsurface: FloatOrTexture | None = None,
        subsurface_radius: ColorOrTexture | None = None,
        subsurface_color: ColorOrTexture | None = None,
        normal: Texture | None = None,
        normal_strength: Scalar = 1.0,
        height: Texture | Callable[[Expr], Operand] | Expr | None = None,
        height_scale: Scalar = 0.02,
        occlusion: FloatOrTexture | None = None,
        bsdf: type[BSDF] | None = None,
    ) -> None:
        if isinstance(color, Expr) and color is albedo:  # `replace` of a physical material passes both
            color = None
        phong = {"shininess": shininess, "specular": specular, "ambient": ambient}
        physical = {"albedo": albedo, "metalness": metalness, "roughness": roughness, "f0": f0, "ior": ior}
        physical |= {"transmission": transmission, "absorption": absorption}
        physical |= {"clearcoat": clearcoat, "clearcoat_roughness": clearcoat_roughness, "subsurface": subsurface}
        physical |= {"subsurface_radius": subsurface_radius, "subsurface_color": subsurface_color}
        phong, physical = _without_unset(phong), _without_unset(physical)
        _check_own(bsdf)
        is_physical = bsdf is not None or any(v is not None for v in physical.values())
        _refuse_both(phong, {**physical, "bsdf": bsdf})
        if color is not None and albedo is not None:
            raise SceneError("Material: color together with albedo", legal="one of them; they are the same")
        name = "color" if albedo is None else "albedo"
        base = color if albedo is None else albedo
        _refuse_colors(absorption, subsurface_radius)
        raised = height_field(height)
        given = {**physical, "emission": emission, "occlusion": occlusion}
        check_map_sizes({name: base, **given, "normal": normal, "height": height})
        given = {**phong, **given, **{n: _spread(physical[n]) for n in ("f0", "absorption", "subsurface_radius")}}
        unset = {n: field.default for n, field in _VALUES.items() if given[n] is None}
        if is_physical:
            unset |= {"specular": 0.0, "ambient": 0.0}
        made = {
            n: _unset(n, unset[n]) if n in unset else material_value(n, given[n], of.size, of.low, of.high)
            for n, of in _VALUES.items()
        }
        if emission is not None and made["emission"].is_constant and np.max(made["emission"].data) == 255.0:
            what = f"Material: emission = {short(emission)}: the light of 255 white surfaces"
            warn(f"{what} (for a colour from 0 to 255, divide it by 255)")
        made["color"] = material_value(name, GREY if base is None else base, 3, 0.0, 1.0)
        if is_physical and physical["roughness"] is None:  # glass is smooth by default, other materials are not
            made["roughness"] = expr(0.5 if is_zero(made["transmission"]) else 0.0)
        if "subsurface" not in unset and "subsurface_color" in unset:
            made["subsurface_color"] = made["color"]
        relief = {"normal": normal, "height": raised, "normal_strength": normal_strength, "height_scale": height_scale}
        others = {**relief, "bsdf": bsdf}
        fields = {
            **made,
            "physical": expr(1.0 if is_physical else 0.0),
            "own": expr(0.0 if bsdf is None else 1.0),
            "exits": expr(0.0),
            "bump_gradient": bump_gradient(normal, normal_strength, raised, height_scale),
            "ambient_visibility": made["occlusion"],
        }
        kept = {n: _kept(value, made[MADE.get(n, n)]) for n, value in {**given, "color": color}.items()}
        self._set(
            **made,
            **others,
            albedo=made["color"] if is_physical else None,
            physical=is_physical,
            _fields={n: fields[n] for n in FIELDS},
            _given={**kept, **others},
            _known={},
        )

    @classmethod
    @checked
    def unlit(cls, color: ColorOrTexture) -> Material:
        """A material of one's own colours in every light: it emits its colour and reflects nothing.

        Parameters
        ----------
        color : linear RGB, each >= 0; a texture or a function of the point.

        Returns
        -------
        Material
            Fog and the tone curve apply to it as to all surfaces. Scenes with `bounces` are lit by it.

        Raises
        ------
        SceneError : a negative colour.

        Examples
        --------
        >>> rm.Material.unlit("gold").emission == rm.Material(emission="gold").emission
        True
        """
        return cls(color=(0.0, 0.0, 0.0), specular=0.0, ambient=0.0, emission=color)

    def arguments(self) -> dict[str, Any]:
        return dict(self._given)

    def _unchanged(self, changes: dict[str, Any]) -> dict[str, Any]:
        """The arguments without changes. `color` and `albedo` are one value: a change of one drops the other."""
        return {n: None if {n, *changes} >= {"color", "albedo"} else v for n, v in self._given.items()}

    def _identity(self) -> tuple[Any, ...]:
        return self._key

    def __hash__(self) -> int:
        return self._hash

    @once
    def _key(self) -> tuple[Any, ...]:
        return (*self._fields.values(), self.bsdf)

    @once
    def _hash(self) -> int:
        return hash(self._key)

    @property
    def expressions(self) -> list[Expr]:
        """All values in the order of FIELDS. They may depend on parameters, time, POSITION and the index of a cell."""
        return list(self._fields.values())

    @once
    def metallic(self) -> bool:
        """True if the metalness may be above 0 somewhere."""
        return self.physical and not is_zero(self.metalness)

    @once
    def emits(self) -> bool:
        """True if the surface may emit light somewhere."""
        return not is_zero(self.emission)

    @once
    def transmits(self) -> bool:
        """True if the transmission may be above 0 somewhere."""
        return not is_zero(self.transmission)

    @once
    def coated(self) -> bool:
        """True if the weight of the clear coat may be above 0 somewhere."""
        return not is_zero(self.clearcoat)

    @once
    def scatters(self) -> bool:
        """True if the weight of subsurface scattering may be above 0 somewhere."""
        return not is_zero(self.subsurface)

    @once
    def frosted(self) -> bool:
        """True if the material transmits and may be rough somewhere."""
        return self.transmits and not is_zero(self.roughness)

    def without_maps(self) -> Material:
        """The same material with each texture replaced by its mean, without normal, height and occlusion maps."""

        def rule(node: Expr, args: tuple[Expr, ...]) -> Expr:
            if node.op != "texture":
                return rebuild(node, args)
            weight = 1.0 if args[3].is_constant else 1.0 / 3.0  # one of three projections: their weights sum to 1
            mean = weight * node.data.levels[-1][0, 0].astype(np.float64)
            return expr(mean if node.type.is_vector else float(mean[0]))

        given = {n: getattr(self, n) for n in (*_VALUES, "color", "albedo") if self._given[n] is not None}
        new = rewrite(given.values(), rule)
        flat = {name: _kept(made, new[made]) for name, made in given.items()}
        return self.replace(**{**flat, "normal": None, "height": None, "occlusion": None})

    @once
    def mirrors(self) -> bool:
        """True if it may be so smooth somewhere that Whitted ray tracing traces its reflection; see `SMOOTH`."""
        clear = self.transmission.is_constant and float(self.transmission.data) == 1.0
        lobes = [self.roughness, *([self.clearcoat_roughness] if self.coated else [])]
        smooth = any(not r.is_constant or float(r.data) < 2.0 * SMOOTH for r in lobes)
        return self.physical and not clear and smooth

    @once
    def glossy(self) -> bool:
        """True if a lobe may be narrow somewhere; see `GLOSSY`."""
        lobes = [self.roughness, *([self.clearcoat_roughness] if self.coated else [])]
        return self.physical and any(not r.is_constant or float(r.data) < GLOSSY for r in lobes)

    @once
    def patterned(self) -> bool:
        """True if any value depends on the position."""
        return POSITION in free_variables(self.expressions)

    @once
    def relief(self) -> bool:
        """True if it perturbs normals or dims ambient light."""
        return (self._fields["bump_gradient"], self._fields["ambient_visibility"]) != (FLAT, expr(1.0))

    @once
    def textured(self) -> bool:
        """True if it has a texture, or another value that depends on the footprint or the normal."""
        return depends_on_interaction(self.expressions)


def materials_by_value(what: str, given: Mapping[str, Any], n: int) -> tuple[list[Material], NDArray[np.int64]]:
    """The distinct materials of n objects, and the index of each object's among them.

    given : arguments of Material, by name. A sequence or an array of n rows has a value for each object; any other
        value is that of all. what : the operation, for messages.
    """
    found = {name: _rows_of(what, name, value, n) for name, value in given.items()}
    columns = {name: values for name, values in found.items() if values is not None}
    of_all = {name: value for name, value in given.items() if name not in columns}
    rows: dict[tuple[Any, ...], int] = {}
    each = zip(*columns.values(), strict=True) if columns else [()] * n
    chosen = np.array([rows.setdefault(row, len(rows)) for row in each], np.int64)
    made = []
    for row, index in rows.items():
        try:
            made.append(Material(**of_all, **dict(zip(columns, row, strict=True))))
        except SceneError as fault:
            first = f"{what}: object {int(np.argmax(chosen == index))}: " if len(rows) > 1 else f"{what}: "
            raise SceneError(first + fault.what, legal=fault.legal) from None
    return made, chosen


def _rows_of(what: str, name: str, value: Any, n: int) -> list[Any] | None:
    """The values of n objects as numbers, strings and tuples; None for one value, which is that of all."""
    if isinstance(value, list | tuple) and value and all(isinstance(item, str) for item in value):
        found: list[Any] = list(value)
    else:
        array = np.asarray(value) if isinstance(value, np.ndarray | list | tuple) else np.zeros(())
        if array.ndim == 0 or array.dtype.kind not in "iuf" or (array.shape == (3,) and n != 3):
            return None
        if array.shape not in ((n,), (n, 3)):
            hint = "; of RGBA in sRGB, as matplotlib has it, [matplotlib.colors.to_hex(c) for c in colors]"
            legal = f"shape ({n}, 3), linear RGB, or ({n},)"
            raise SceneError(
                f"{what}: {name} of shape {array.shape}", legal=legal + hint if array.shape[-1] == 4 else legal
            )
        found = [tuple(row) if array.ndim == 2 else row for row in array.astype(np.float64).tolist()]
    if len(found) != n:
        raise SceneError(f"{what}: {len(found)} values of {name} for {n} objects", legal=f"{n} values, or one for all")
    return found


def _kept(given: Any, made: Expr) -> Any:
    """The argument that `replace` and pickles pass to the constructor: for a function, the expression it returned."""
    if given is None or isinstance(given, Texture):
        return given
    if made.is_constant:
        return tuple(made.data.tolist()) if made.type.is_vector else float(made.data)
    return made


def _without_unset(values: dict[str, Any]) -> dict[str, Any]:
    """The values, with None for default expressions: `dataclasses.replace` passes them for arguments not given."""
    return {n: None if any(value is e for e in _UNSET.get(n, ())) else value for n, value in values.items()}


_VALUES = {name: field for name, field in ARGUMENTS.items() if name != "color"}
"""The values beside the colour, by their arguments."""

_UNSET = {name: [expr(field.default)] for name, field in _VALUES.items()}
for _name in ("specular", "ambient"):
    _UNSET[_name].append(expr(0.0))  # of physical materials


@cache
def _unset(name: str, value: Any) -> Expr:
    """The expression of a value that is not given. A scene may have thousands of materials."""
    of = _VALUES[name]
    return material_value(name, value, of.size, of.low, of.high)


def _check_own(bsdf: Any) -> None:
    if bsdf is not None:
        # here for the time of a start: most scenes have no class of their own
        from raymarch.scene.bsdf import check_bsdf

        check_bsdf(bsdf)


def _refuse_colors(absorption: Any, radius: Any) -> None:
    """SceneError for the name of a colour in place of lengths or coefficients: what is meant would be a guess."""
    if isinstance(absorption, str):  # the colour that is removed would be its complement
        legal = "a coefficient per unit of length; -numpy.log((0.9, 0.2, 0.2)) leaves red light after one unit"
        raise SceneError(f"Material: absorption = {short(absorption)}", legal=legal)
    if isinstance(radius, str):
        legal = "a length for each of red, green and blue, such as (0.1, 0.04, 0.02)"
        raise SceneError(f"Material: subsurface_radius = {short(radius)}", legal=legal)


def _refuse_both(phong: dict[str, Any], physical: dict[str, Any]) -> None:
    one = next((name for name, v in phong.items() if v is not None), None)
    other = next((name for name, v in physical.items() if v is not None), None)
    if one is not None and other is not None:
        raise SceneError(
            f"Material: {one} together with {other}",
            legal="Phong's shininess, specular, ambient; or the physical albedo, metalness, roughness, f0",
        )


def _spread(value: Any) -> Any:
    """A number as three equal numbers; other values unchanged."""
    number = plain(value)
    if isinstance(number, bool | int | float):
        return (number, number, number)
    if isinstance(value, Expr) and value.type is vector(1):
        return vec3(value)
    return value
