"""Generated code that adds the light of each source to a surface: unrolled, or in a loop over rows of a texture."""

from __future__ import annotations

from collections.abc import Callable

from raymarch.expr.glsl import literal
from raymarch.expr.node import Expr
from raymarch.plan import Plan, lights
from raymarch.plan.shading import compensated
from raymarch.scene.light import Light, PointLight, SpotLight, Sun
from raymarch.shader.chunk import Chunk, Lines, Mapped, Values

SHADOW = {
    "hard": "hard_shadow",
    "two-sided": "two_sided_shadow",
    "cone": "cone_shadow",
    "triangulated": "triangulated_shadow",
    "sampled": "hard_shadow",
}
"""The GLSL function of each kind of shadow."""

RANGES = {"window": "range_window", "fade": "linear_falloff"}
"""The GLSL functions of falloff at the range, by the trait of a light."""

BSDF = {"phong": "eval_phong", "physical": "eval_microfacet", "mixed": "eval_bsdf"}
"""The GLSL functions that reflect a light, by model."""


def metal_bsdf(text: Lines, plan: Plan) -> None:
    """The function that reflects a light if some materials are metallic: the model's BSDF plus multiple scattering."""
    bsdf = BSDF[plan.model]
    for line in (
        "vec3 eval_bsdf_of_metal(Surface surface, vec3 ms_albedo, Light light, float visibility) {",
        f"    return {bsdf}(surface, light, visibility) + multiscatter(ms_albedo, surface, light, visibility);",
        "}",
        "",
    ):
        text.add(line, by="a metal")


def _bsdf_of(plan: Plan) -> str:
    """The start of a call that reflects a light, up to the light."""
    return "eval_bsdf_of_metal(surface, ms_albedo" if compensated(plan.scene) else f"{BSDF[plan.model]}(surface"


def all_lights(text: Lines, plan: Plan, values: Values) -> None:
    """Add the light of all sources to the colour of a surface."""
    if lights.as_data(plan.scene):
        _loop(text, plan)
        return
    for i, light in enumerate(plan.scene.lights):
        _light(text, i, light, values, plan)


def _light(text: Lines, i: int, light: Light, values: Values, plan: Plan) -> None:
    """The lines of one light, with its values as literals where constant."""
    by, where = type(light).__name__, light.where
    call = _bsdf_of(plan)

    def value(name: str, of: Expr) -> str:
        return values.text(f"light_{i}_{name}", of, where)

    def add(line: str) -> None:
        text.add(f"    {line}", by=by, where=where)

    declared = "" if i else "Light "
    radiance = value("radiance", light.radiance)
    if isinstance(light, Sun):
        add(f"{declared}light = sun_light({value('direction', light.direction)}, {radiance});")
    elif not isinstance(light, PointLight):
        raise lights.no_code(light, "raymarch/shader/lights.py")
    else:
        place = f"surface.p, {value('position', light.position)}, {radiance}"
        if light.attenuation is None:
            add(f"{declared}light = point_light({place});")
        else:
            terms = value("attenuation", light.attenuation)
            add(f"{declared}light = attenuated_light({place}, {terms});")
        if light.range is not None:
            end = "range_window" if light.attenuation is None else "linear_falloff"
            add(f"light.radiance *= {end}(light.distance, {value('range', light.range)});")
    if isinstance(light, SpotLight):
        outer, inner = light.cosines
        cone = ", ".join((value("axis", light.direction), value("outer", outer), value("inner", inner)))
        add(f"light.radiance *= spot_falloff(light.direction, {cone});")
    if light.soft and light.penumbra == "sampled":
        width = value("softness", light.softness) + _per_distance(light)
        samples = plan.scene.quality.light_samples
        if samples > 1:
            stride = 2 * len(plan.scene.lights)
            add(f"Light centre_{i} = light;")
            add(f"for (int k = 0; k < {samples}; k++) {{")
            add(f"    light = sample_disc(centre_{i}, {width}, {_dimension(i)} + {stride} * k);")
            visibility = _visibility(text, light, value)
            add(f"    color += {call}, light, {visibility}) / {literal(samples)};")
            add("}")
            return
        add(f"light = sample_disc(light, {width}, {_dimension(i)});")
    add(f"color += {call}, light, {_visibility(text, light, value)});")


def _dimension(light: int) -> int:
    """The first random dimension of a light, beyond those of path tracing."""
    return 1024 + 2 * light


def _per_distance(light: Light) -> str:
    """The factor that makes the tangent of an angle of a light's softness."""
    return " / light.distance" if light.has_position else ""


def _visibility(text: Lines, light: Light, value: Callable[[str, Expr], str]) -> str:
    """The visibility of a light from the surface, as GLSL text."""
    if not light.shadow:
        return "1.0"
    call = SHADOW[light.penumbra if light.soft else "hard"]
    width = ""
    if light.soft and light.penumbra != "sampled":
        width = f", {value('softness', light.softness)}{_per_distance(light)}"
    shown = f"{call}(surface, light{width})"
    if isinstance(light, PointLight) and light.shadow_radius is not None:
        return f"light.distance < {value('shadow_radius', light.shadow_radius)} ? {shown} : 1.0"
    return shown


def _loop(text: Lines, plan: Plan) -> None:
    """The loop over all lights, which reads their values from the rows of a texture."""
    has = lights.traits(plan.scene)
    names = lights.columns(has)
    call = _bsdf_of(plan)

    def add(line: str) -> None:
        text.add(f"        {line}", where=plan.scene.where)

    text.add(f"    for (int i = 0; i < {len(plan.scene.lights)}; i++) {{")
    for k, name in enumerate(names):
        add(f"vec4 {name} = texelFetch(u_lights, ivec2({k}, i), 0);")
    add("Light light;")
    sources = []
    if "sun" in has:
        sources.append((lights.SUN, "sun_light(place.xyz, source.rgb)"))
    if "point" in has:
        sources.append((lights.POINT, "point_light(surface.p, place.xyz, source.rgb)"))
    if "attenuated" in has:
        made = "attenuated_light(surface.p, place.xyz, source.rgb, terms.xyz)"
        sources.append((lights.ATTENUATED, made))
    for k, (kind, made) in enumerate(sources):
        condition = f"if (place.w == {kind}) " if k < len(sources) - 1 else ""
        add(f"{'else ' if k else ''}{condition}light = {made};")
    if {"window", "fade"} & has:
        if {"window", "fade"} <= has:
            kinds = f"place.w == {lights.ATTENUATED}"
            end = f"{kinds} ? linear_falloff(light.distance, source.w) : range_window(light.distance, source.w)"
        else:
            end = f"{'range_window' if 'window' in has else 'linear_falloff'}(light.distance, source.w)"
        add(f"if (source.w > 0.0) light.radiance *= {end};")
    if "spot" in has:
        add(
            "if (axis.w > 0.0) light.radiance *= spot_falloff(light.direction, axis.xyz, cone.x, cone.y);",
        )
    add("if (light.radiance == vec3(0.0)) continue;")
    visibility = "1.0"
    if "caster" in names:
        visibility = "visibility"
        add("float visibility = 1.0;")
        near = "(caster.z == 0.0 || light.distance < caster.z) && " if has - {"sun"} else ""
        if "sampled" in has:
            number = float(lights.shadows(has).index("sampled") + 1)
            width = "caster.y / (place.w == 0.0 ? 1.0 : light.distance)"
            first, samples = f"{_dimension(0)} + 2 * i", plan.scene.quality.light_samples
            if samples > 1:
                stride = 2 * len(plan.scene.lights)
                add(f"if (caster.x == {number}) {{")
                add("    Light centre = light;")
                add(f"    for (int k = 0; k < {samples}; k++) {{")
                add(f"        light = sample_disc(centre, {width}, {first} + {stride} * k);")
                shown = "hard_shadow(surface, light)"
                shown = f"{near.removesuffix(' && ')} ? {shown} : 1.0" if near else shown
                add(f"        float visible = {shown};")
                add(f"        color += {call}, light, visible) / {literal(samples)};")
                add("    }")
                add("    continue;")
                add("}")
            else:
                add(f"if (caster.x == {number}) light = sample_disc(light, {width}, {first});")
        for k, shadow in enumerate(lights.shadows(has), 1):
            width = "" if shadow in ("hard", "sampled") else ", caster.y / (place.w == 0.0 ? 1.0 : light.distance)"
            add(
                f"if ({near}caster.x == {float(k)}) visibility = {SHADOW[shadow]}(surface, light{width});",
            )
    add(f"color += {call}, light, {visibility});")
    text.add("    }")


def light_rows() -> Chunk:
    """The texture with the values of all lights."""
    lines = (Mapped("uniform sampler2D u_lights;  // one row per light", "the scene's lights"),)
    return Chunk.of("light rows", lines)
