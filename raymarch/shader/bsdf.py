"""Generated functions of the scene's BSDF, which read its values from the structs of the shader."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from raymarch.expr.branches import UNSEEN
from raymarch.expr.function import Function, trace
from raymarch.expr.node import Expr, const, construct, var
from raymarch.expr.operations import operations
from raymarch.expr.types import FLOAT, VEC2, VEC3, Type, struct, vector
from raymarch.expr.vocabulary import clamp, dot, get, record, vec3, where
from raymarch.expr.vocabulary import max as maximum
from raymarch.expr.walk import free_variables
from raymarch.plan import Plan
from raymarch.scene.bsdf import over_dielectric
from raymarch.scene.fields import FIELDS
from raymarch.scene.light import LIGHT
from raymarch.scene.reflectance import LEAST_COSINE, RANDOM
from raymarch.scene.subsurface import Scattered
from raymarch.scene.surfaces import pdf_lobes, sample_lobes
from raymarch.shader.chunk import Values

GLASS = struct("Glass", (("transmission", FLOAT), ("ior", FLOAT), ("absorption", VEC3)))
"""The struct of a material that transmits light. `absorption` is per unit of length."""

DIMENSIONS = {"direction": (1, 2), "lobe": (0,), "model": (5,), "several": (6,), "coat": (7,)}
"""The random dimensions of a sample, after the first one of a surface."""

INLINED = 24
"""Operations of a BSDF up to which it needs no function of its own: it costs no more than to choose not to call it."""


def material_of(plan: Plan) -> Type:
    """The struct Material of a scene."""
    assert plan.material is not None
    made = plan.material.type
    return dict(made.fields).get("material", made)


class Reflection:
    """The functions of a plan's BSDF. Each is added to `values` when a call of it is first written.

    The texts that methods return are calls in GLSL. They read the variables `surface`, `outside` and those of
    `prepare`.
    """

    def __init__(self, plan: Plan, values: Values) -> None:
        self.bsdf, self.values, self.material = plan.bsdf, values, material_of(plan)
        rough = {material.expressions[FIELDS.index("roughness")] for material in plan.scene.materials}
        varies = "roughness" in self.bsdf.fields and (len(rough) > 1 or not all(value.is_constant for value in rough))
        self.forgets = plan.device.branches
        self.new_roughness = [f"surface.material.roughness += {UNSEEN.data};"] if self.forgets and varies else []
        """A line that makes the roughness one that compilers do not know to be the same: for hardware. Else they keep
        what they have computed of it until it is read for the last time. A constant costs nothing."""
        self.surface = struct("Surface", (("normal", VEC3), ("view", VEC3), ("material", self.material)))
        self.scattered = next((layer for layer in self.bsdf.layers if isinstance(layer, Scattered)), None)
        self.outside = plan.glass is not None and plan.model == "mixed" and bool(plan.scene.lights)
        surface = {"surface": var("surface", self.surface)}
        self.prepared: dict[str, Type] = {}
        self.prepared = {name: value.type for name, value in self.bsdf.prepare(*self._at(surface)).items()}
        known = surface | {name: var(name, of) for name, of in self.prepared.items()}
        self.lobes = len(self.bsdf.lobes(self._at(known)[0], var("n_dot_v", FLOAT)))
        self._made: dict[str, Function] = {}
        self.sky_name = plan.scene.sky.lighting_function(None).name
        """The function of the sky's radiance that lights surfaces."""

    def prepare(self) -> list[str]:
        """The lines that compute what depends on the view alone."""
        return [
            f"    {type} {n} = {self._call(f'prepare_{n}', {}, self._prepared(n))};"
            for n, type in self.prepared.items()
        ]

    def _prepared(self, name: str) -> Callable[[Mapping[str, Expr]], Expr]:
        return lambda symbols: self.bsdf.prepare(*self._at(symbols))[name]

    def light(self, visibility: str, light: str = "light") -> str:
        """Reflected radiance of a light, which is the variable of a name."""
        return self._call("reflect_light", {"light": (LIGHT, light), "visibility": (FLOAT, visibility)}, self._light)

    def after_shadow(self, shadow: str, share: str = "") -> list[str]:
        """The lines that add reflected radiance after a shadow. share : what follows the sum.

        For hardware its roughness and direction are then ones that compilers do not know to be the same. Else they keep
        what pdfs and the prepared values have computed of them while the shadow is traced.
        """
        if not self.forgets or "shadow" not in shadow:
            return [f"color += {self.light(shadow)}{share};"]
        lines = [f"float shown = {shadow};", f"light.direction += {UNSEEN.data};", *self.new_roughness]
        return ["{", *(f"    {line}" for line in [*lines, f"color += {self.light('shown')}{share};"]), "}"]

    def _light(self, symbols: Mapping[str, Expr]) -> Expr:
        values, normal, _ = self._at(symbols)
        light, visibility, ambient = symbols["light"], symbols["visibility"], self.bsdf.ambient(values)
        direction = get(light, "direction")
        value = self._eval({**symbols, "direction": direction})
        if operations([value]) > INLINED:
            self._call("eval_bsdf", {"direction": (VEC3, "")}, self._eval)
            made = self._made["eval_bsdf"]
            value = made(*[symbols.get(p.data, direction) for p in made.params])
        dark = (dot(normal, direction) <= 0.0) | (visibility <= 0.0)  # the call is then not evaluated
        lit = where(dark, vec3(0.0), visibility * value)
        return get(light, "radiance") * (lit if ambient is None else ambient + lit)

    def _eval(self, symbols: Mapping[str, Expr]) -> Expr:
        return self.bsdf.eval(*self._at(symbols), symbols["direction"])

    def sky(self, traced: str) -> str:
        """Reflected light of the sky. `traced`: the fractions of the lobes that rays trace; "" for none."""

        def made(symbols: Mapping[str, Expr]) -> Expr:
            values, normal, view = self._at(symbols)
            mean, mirrored, blurred = (symbols[name] for name in ("mean", "mirrored", "blurred"))
            done = self._split(symbols["traced"]) if traced else [0.0] * self.lobes
            return self.bsdf.reflect_sky(values, _cosine(normal, view), mean, mirrored, blurred, done)

        given = {
            "mean": (VEC3, "sky_mean(surface.normal)"),
            "mirrored": (VEC3, f"{self.sky_name}(reflect(-surface.view, surface.normal))"),
            "blurred": (VEC3, "sky_mean(reflect(-surface.view, surface.normal))"),
            "traced": (self.per_lobe, traced),
        }
        return self._call("reflect_sky", given, made)

    @property
    def per_lobe(self) -> Type:
        """The type of one number for each lobe."""
        return vector(max(self.lobes, 1))

    def traced(self) -> str:
        """The fractions of the lobes that Whitted ray tracing replaces by mirrors."""

        def made(symbols: Mapping[str, Expr]) -> Expr:
            values, normal, view = self._at(symbols)
            each = self.bsdf.traced(values, _cosine(normal, view))
            return construct(*each) if len(each) > 1 else [*each, const(0.0)][0]

        return self._call("mirror_weight", {}, made)

    def mirrored(self) -> str:
        """Reflectance of the fractions `traced` of the lobes."""

        def made(symbols: Mapping[str, Expr]) -> Expr:
            values, normal, view = self._at(symbols)
            return self.bsdf.mirrored(values, _cosine(normal, view), self._split(symbols["traced"]))

        return self._call("mirror_reflectance", {"traced": (self.per_lobe, "traced")}, made)

    def sample(self) -> str:
        """A random direction, a BsdfSample; reads the variable `dimension`."""

        def made(symbols: Mapping[str, Expr]) -> Expr:
            return self.bsdf.sample(*self._at(symbols), type(RANDOM)(*(symbols[p.data] for p in RANDOM)))

        given = {}
        for name, p in zip(RANDOM._fields, RANDOM, strict=True):
            numbers = [
                f"random_of_pixel(dimension + {k})" if k else "random_of_pixel(dimension)" for k in DIMENSIONS[name]
            ]
            given[p.data] = p.type, numbers[0] if p.type is FLOAT else f"{p.type}({', '.join(numbers)})"
        return self._call("sample_bsdf", given, made)

    def sample_lobes(self) -> str:
        """A random direction of the narrow lobes; reads the variable `dimension`."""

        def made(symbols: Mapping[str, Expr]) -> Expr:
            return sample_lobes(self.bsdf, *self._at(symbols), symbols["u"], symbols["choice"])

        u, choice = "vec2(random_of_pixel(dimension), random_of_pixel(dimension + 1))", "random_of_pixel(dimension + 2)"
        return self._call("sample_lobes", {"u": (VEC2, u), "choice": (FLOAT, choice)}, made)

    def pdf_lobes(self) -> str:
        """The density of `sample_lobes` in the direction of `light`."""

        def made(symbols: Mapping[str, Expr]) -> Expr:
            return pdf_lobes(self.bsdf, *self._at(symbols), symbols["direction"])

        return self._call("pdf_lobes", {"direction": (VEC3, "light.direction")}, made)

    def over_dielectric(self, share: str) -> str:
        """The struct Material of which a share is the outside of glass; reads the variable `glass`."""

        def made(symbols: Mapping[str, Expr]) -> Expr:
            material, glass = symbols["material"], symbols["glass"]
            values = over_dielectric(self._values(material), get(glass, "ior"), symbols["share"])
            return record(self.material, *(values[name] for name, _ in self.material.fields))

        given = {"material": (self.material, "surface.material"), "glass": (GLASS, "glass"), "share": (FLOAT, share)}
        return self._call("as_dielectric", given, made)

    def entry(self) -> str:
        """The fraction of the light of the view that enters a medium that scatters it; reads the variable `below`."""
        scattered = self.scattered
        assert scattered is not None

        def made(symbols: Mapping[str, Expr]) -> Expr:
            surface = symbols["below"]
            n_dot_v = maximum(dot(get(surface, "normal"), get(surface, "view")), LEAST_COSINE)
            return scattered.entry(self._values(get(surface, "material")), n_dot_v)

        return self._call("subsurface_entry", {"below": (self.surface, "below")}, made)

    # Functions

    def _values(self, material: Expr) -> dict[str, Expr]:
        return {name: get(material, name) for name, _ in self.material.fields}

    def _at(self, symbols: Mapping[str, Expr]) -> tuple[dict[str, Expr], Expr, Expr]:
        """The values of the BSDF, the normal and the direction of the view."""
        surface = symbols["surface"]
        values = self._values(get(surface, "material"))
        if "outside" in symbols:
            values |= {f"outside {name}": value for name, value in self._values(symbols["outside"]).items()}
        values |= {name: symbols[name] for name in self.prepared if name in symbols}
        return values, get(surface, "normal"), get(surface, "view")

    def _split(self, traced: Expr) -> list[Expr]:
        return [traced] if self.lobes == 1 else [traced[i] for i in range(self.lobes)]

    def _call(
        self, name: str, given: Mapping[str, tuple[Type, str]], make: Callable[[Mapping[str, Expr]], Expr]
    ) -> str:
        """A call of a function, which is made once.

        given : types and texts of the arguments that it may read besides the surface, by name.
        """
        known = {"surface": (self.surface, "surface")}
        if self.outside and name in ("eval_bsdf", "reflect_light"):
            known["outside"] = (self.material, "outside")
        known |= {n: (type, n) for n, type in self.prepared.items()} | dict(given)
        if name not in self._made:
            types = [(n, type) for n, (type, _) in known.items()]
            traced = trace(name, lambda *symbols: make(dict(zip(known, symbols, strict=True))), types)
            read = free_variables([traced.body])
            params = tuple(p for p in traced.params if p in read)
            self._made[name] = Function(name, params, traced.body)
            self.values.functions.append(self._made[name])
        return f"{name}({', '.join(known[p.data][1] for p in self._made[name].params)})"


def _cosine(normal: Expr, view: Expr) -> Expr:
    return clamp(dot(normal, view), 0.0, 1.0)
