"""The generated part of shading: the colour of a hit from the scene's lights and fog."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from raymarch.errors import Location
from raymarch.expr.function import Function
from raymarch.expr.glsl import constant, literal
from raymarch.expr.node import Expr
from raymarch.plan import Plan, lights
from raymarch.plan.shading import ambient, ambient_sky, occluded
from raymarch.scene.light import Light, PointLight, SpotLight, Sun
from raymarch.scene.sky import DIRECTION
from raymarch.sdf.facts import Facts
from raymarch.shader.chunk import Chunk, Lines, Mapped
from raymarch.shader.looks import normal_of, place_of, surface_of
from raymarch.shader.tree import tree

SHADOW = {
    "hard": "hard_shadow",
    "two-sided": "two_sided_shadow",
    "cone": "cone_shadow",
    "triangulated": "triangulated_shadow",
    "sampled": "hard_shadow",
}
"""The functions of the kinds of shadow."""

ANSWER = {"phong": "phong", "physical": "physical", "mixed": "answer"}
"""The functions by which the models answer a light."""


class Values:
    """Values of the scene that the shader asks for by name: literals where they are constant, else functions."""

    def __init__(self) -> None:
        self.functions: list[Function] = []

    def add(self, name: str, value: Expr, where: Location | None) -> None:
        self.functions.append(Function(name, (), value, where=where))

    def text(self, name: str, value: Expr, where: Location | None) -> str:
        if value.is_constant:
            return constant(value)
        self.add(name, value, where)
        return f"{name}()"


def shading(plan: Plan, values: Values) -> Chunk:
    """The colour of a hit: what it gives off, each light in turn, a shadow only where it casts one, then fog.

    What it reads of the scene by name goes into `values`.
    """
    scene = plan.scene
    text = Lines("the scene's lights")
    text.needs |= {"Ray", "Hit"}
    if plan.material is not None and (scene.wanders or scene.branches):
        _lit(text, plan, values)
        if scene.wanders:
            _ways(text, plan)
        else:
            tree(text, plan)
        return _chunk(text, plan, values)
    text.add("vec3 shade(Ray ray, Hit hit) {")
    surfaced = plan.material is not None
    lit = surfaced and bool(scene.lights)
    if surfaced:
        call, name = surface_of(plan, "ray", "hit.t")
        text.add(f"    Surface surface = {call};", "Surface", name)
    if plan.emission is not None:
        place = place_of(plan) if plan.relief is not None else "ray.origin + hit.t * ray.direction"
        text.add(f"    vec3 color = emission_at({place});", "emission_at")
    else:
        text.add("    vec3 color = vec3(0.0);")
    if surfaced:
        _ambient(text, plan, values)
    if lit:
        _lights(text, plan, values)
    if scene.fog is not None:
        text.add("    color = through_fog(color, hit.t);", "through_fog", by="Scene(fog=...)", where=scene.where)
    text.add("    return color;")
    text.add("}")
    return _chunk(text, plan, values)


def _lights(text: Lines, plan: Plan, values: Values) -> None:
    """What all lights add to the colour of a surface."""
    if lights.as_data(plan.scene):
        _loop(text, plan)
        return
    for i, light in enumerate(plan.scene.lights):
        _light(text, i, light, values, plan)


def _lit(text: Lines, plan: Plan, values: Values) -> None:
    """The light that a surface gives off and gets from the sources; `followed` is the share of its reflection that
    ways of light bring."""
    followed = ", float followed" if plan.scene.branches else ""
    text.add(f"vec3 lit(Surface surface{followed}) {{", "Surface")
    text.add(f"    vec3 color = {f'emission_at({place_of(plan)})' if plan.emission is not None else 'vec3(0.0)'};")
    text.needs |= {"emission_at"} if plan.emission is not None else set()
    _ambient(text, plan, values)
    if plan.scene.lights:
        _lights(text, plan, values)
    for line in ("    return color;", "}", ""):
        text.add(line)


def _ways(text: Lines, plan: Plan) -> None:
    """The colour of a hit where light bounces: a way from surface to surface, and the light that joins it at each."""
    scene, add, glass = plan.scene, text.add, plan.glass is not None
    add("vec3 shade(Ray ray, Hit hit) {")
    add("    vec3 color = vec3(0.0);")
    add("    vec3 weight = vec3(1.0);")
    add("    float first = hit.t;")
    add("    float travelled = 0.0;")
    if scene.lights and plan.model != "phong":
        # Seen from a matte surface, a light in a mirror is a speck that chance finds too seldom (Kaplanyan 2013).
        add("    float dull = 0.0;  // roughness below which surfaces no longer mirror lights")
    if glass:
        add("    float side = 1.0;  // -1 inside of glass")
        add("    vec3 absorption = vec3(0.0);")
        add("    vec3 before = ray.origin;  // where the light comes to last")
    side = "side" if glass else "1.0"
    add(f"    for (int bounce = 0; bounce <= {scene.bounces}; bounce++) {{")
    add("        travelled += hit.t;")
    call, name = surface_of(plan, "ray", "travelled")
    add(f"        Surface surface = {call};", name)
    add("        surface.t = travelled;")
    if glass:
        add("        if (side < 0.0) weight *= exp(-absorption * distance(before, surface.p));")
        add("        before = surface.p;")
        add("        surface.normal *= side;")
    add("        int dimension = 16 + 8 * bounce;", "random_of_pixel")
    add("        vec3 direction;")
    indent = "        "
    if glass:
        _glass(text, plan)
        indent += "    "
    shines = bool(scene.lights) and plan.model != "phong"
    if shines:
        add(f"{indent}Surface shown = surface;")
        add(f"{indent}shown.material.roughness = max(surface.material.roughness, dull);")
    add(f"{indent}color += weight * lit({'shown' if shines else 'surface'});")
    last = f"bounce == {scene.bounces}"
    need = {"phong": {"from_matte"}, "physical": {"from_glossy"}, "mixed": {"from_matte", "from_glossy"}}[plan.model]
    given = "(surface, dimension, direction, weight)"
    if plan.model == "mixed":
        add(f"{indent}bool goes = random_of_pixel(dimension + 5) < surface.material.physical", *need)
        add(f"{indent}    ? from_glossy{given} : from_matte{given};")
        add(f"{indent}if ({last} || !goes) break;")
    else:
        add(f"{indent}if ({last} || !{next(iter(need))}{given}) break;", *need)
    if shines:
        matte = "surface.material.metalness < 1.0 ? max(surface.material.roughness, 0.4) : surface.material.roughness"
        add(f"{indent}dull = max(dull, {matte});")
    if glass:
        add("        }")
    add("        float start;")
    solid, needs = normal_of(plan)
    add(f"        vec3 outwards = dot(direction, surface.normal) < 0.0 ? -{solid} : {solid};", *needs)
    add("        ray = leaving(surface.p, outwards, direction, travelled, start);", "leaving")
    add(f"        hit = second(ray, start, travelled, {side});", "second")
    add("        if (!hit.found) {")
    add(f"            {'if (side > 0.0) ' if glass else ''}color += weight * sky(direction);", "sky")
    add("            break;")
    add("        }")
    add("    }")
    if scene.fog is not None:
        add("    color = through_fog(color, first);", "through_fog", by="Scene(fog=...)", where=scene.where)
    add("    return color;")
    add("}")


def _glass(text: Lines, plan: Plan) -> None:
    """Where a way goes on that meets glass, up to the opening of what is done where it does not."""
    for line in (
        f"Glass glass = glass_at({place_of(plan)});",
        "if (side < 0.0 || random_of_pixel(dimension + 3) < glass.transmission) {",
        f"    if (bounce == {plan.scene.bounces}) {{",  # what would still come is the sky's, lest glass end in black
        "        color += weight * sky(ray.direction);",
        "        break;",
        "    }",
        "    float ratio = side > 0.0 ? 1.0 / glass.ior : glass.ior;",
        "    float cosine = clamp(dot(surface.normal, surface.view), 0.0, 1.0);",
        "    if (random_of_pixel(dimension + 4) < reflectance(cosine, ratio)) {",
        "        direction = reflect(ray.direction, surface.normal);",
        "    } else {",
        "        direction = refract(ray.direction, surface.normal, ratio);",
        "        side = -side;",
        "        absorption = glass.absorption;",
        "    }",
        "} else {",
    ):
        text.add(f"        {line}", "Glass", "glass_at", "reflectance")


def _chunk(text: Lines, plan: Plan, values: Values) -> Chunk:
    """The lines, and what of the sky and the fog they read by name."""
    scene = plan.scene
    if scene.sky.constant:
        values.add("sky_color", scene.sky.radiance, scene.where)
    else:
        values.functions.append(Function("sky", (DIRECTION,), scene.sky.radiance, where=scene.where))
    if scene.fog is not None:
        values.add("fog_color", scene.fog.color, scene.where)
        values.add("fog_density", scene.fog.density, scene.where)
    return Chunk("shade", frozenset(text.needs), frozenset({"shade"}), tuple(text.lines))


def scene_cone(plan: Plan) -> Chunk:
    """The part of a cone about a ray, of a slope `width`, that meets the scene's box: the box seen by soft shadows.

    A point beside the ray by width * t is below a plane at `upper` where origin + (direction - width) t is.
    """
    text = Lines("the scene's bounds")
    text.add("vec2 scene_cone(Ray ray, vec2 range, float width) {", "Ray")
    for axis, low, high in box_ends(plan.scene.node.facts):
        at = f"range, ray.origin.{axis}, ray.direction.{axis}"
        if high is not None:
            text.add(f"    range = below({at} - width, {literal(high)});", "below")
        if low is not None:
            text.add(f"    range = above({at} + width, {literal(low)});", "above")
    text.add("    return range;")
    text.add("}")
    return Chunk("scene cone", frozenset(text.needs), frozenset({"scene_cone"}), tuple(text.lines))


def box_ends(facts: Facts) -> list[tuple[str, float | None, float | None]]:
    """Each axis with the ends of the scene's box, None for none, padded so that rounding cannot cut the surface off."""
    found: list[tuple[str, float | None, float | None]] = []
    for i, axis in enumerate("xyz"):
        ends = [float(facts.lower[i]), float(facts.upper[i])]
        largest = max([abs(e) for e in ends if np.isfinite(e)], default=0.0)
        pad = 2.0**-20 * max(largest, 2.0**-60)  # 8 ulp of the box's own coordinates
        low, high = (e + d if np.isfinite(e) else None for e, d in zip(ends, (-pad, pad), strict=True))
        found.append((axis, low, high))
    return found


def light_rows() -> Chunk:
    """The texture that holds many lights."""
    lines = (Mapped("uniform sampler2D u_lights;  // a row for each light", "the scene's lights"),)
    return Chunk("light rows", frozenset(), frozenset({"u_lights"}), lines)


FROM_SKY = {
    "phong": "matte_sky(surface)",
    "physical": "glossy_sky(surface, {followed})",
    "mixed": "mix(matte_sky(surface), glossy_sky(surface, {followed}), surface.material.physical)",
}
"""What the sky adds to a surface, by model, but for the share of its reflection that is followed."""


def _ambient(text: Lines, plan: Plan, values: Values) -> None:
    """Light without a place: the sky's, and the share of each light that Phong's materials take as such."""
    scene = plan.scene
    shares = _opened_by_map(plan)
    dimmed = shares or occluded(scene, plan.model)
    by = "Material(occlusion=...)" if shares else "Scene(occlusion=...)"
    if occluded(scene, plan.model):
        assert scene.occlusion is not None
        for name in ("reach", "strength", "decay"):
            values.add(f"occlusion_{name}", getattr(scene.occlusion, name), scene.where)
        share = "surface.open * " if shares else ""
        text.add(f"    float open = {share}openness(surface);", "openness", by=by, where=scene.where)
    elif shares:
        text.add("    float open = surface.open;", by=by, where=scene.where)
    if dimmed and scene.lights and plan.model != "physical":
        text.add("    surface.material.ambient *= open;", by=by, where=scene.where)
    if ambient_sky(scene):
        needs = {"phong": ("matte_sky",), "physical": ("glossy_sky",), "mixed": ("matte_sky", "glossy_sky")}[plan.model]
        factor = "open * " if dimmed else ""
        light = FROM_SKY[plan.model].format(followed="followed" if scene.branches else "0.0")
        text.add(f"    color += {factor}{light};", *needs, by="the sky's light", where=scene.where)


def _opened_by_map(plan: Plan) -> bool:
    """True if a material keeps out some of the ambient light that there is."""
    if plan.relief is None or not ambient(plan.scene, plan.model):
        return False
    share = dict(plan.relief.fields)["open"]
    return not (share.is_constant and float(share.data) == 1.0)


def _light(text: Lines, i: int, light: Light, values: Values, plan: Plan) -> None:
    """The lines of one light, with its numbers in them."""
    by, where, answer = type(light).__name__, light.where, ANSWER[plan.model]

    def value(name: str, of: Expr) -> str:
        return values.text(f"light_{i}_{name}", of, where)

    def add(line: str, *needs: str) -> None:
        text.add(f"    {line}", *needs, by=by, where=where)

    declared = "" if i else "Light "
    radiance = value("radiance", light.radiance)
    if isinstance(light, Sun):
        add(f"{declared}light = sun_light({value('direction', light.direction)}, {radiance});", "Light", "sun_light")
    else:
        assert isinstance(light, PointLight)
        place = f"surface.p, {value('position', light.position)}, {radiance}"
        if light.attenuation is None:
            add(f"{declared}light = point_light({place});", "Light", "point_light")
        else:
            terms = value("attenuation", light.attenuation)
            add(f"{declared}light = attenuated_light({place}, {terms});", "Light", "attenuated_light")
        if light.radius is not None:
            end = "window" if light.attenuation is None else "fade"
            add(f"light.radiance *= {end}(light.distance, {value('radius', light.radius)});", end)
    if isinstance(light, SpotLight):
        outer, inner = light.cosines
        cone = ", ".join((value("axis", light.direction), value("outer", outer), value("inner", inner)))
        add(f"light.radiance *= spot(light.direction, {cone});", "spot")
    if light.soft and light.penumbra == "sampled":
        width = value("softness", light.softness) + ("" if isinstance(light, Sun) else " / light.distance")
        samples = plan.scene.quality.light_samples
        if samples > 1:
            stride = 2 * len(plan.scene.lights)
            add(f"Light whole_{i} = light;")
            add(f"for (int k = 0; k < {samples}; k++) {{")
            add(f"    light = part_of(whole_{i}, {width}, {_dimension(i)} + {stride} * k);", "part_of")
            seen = _visibility(text, light, value)
            add(f"    color += {answer}(surface, light, {seen}) / {literal(samples)};", answer)
            add("}")
            return
        add(f"light = part_of(light, {width}, {_dimension(i)});", "part_of")
    add(f"color += {answer}(surface, light, {_visibility(text, light, value)});", answer)


def _dimension(light: int) -> int:
    """The first random dimension of a light, beyond those of bounces."""
    return 1024 + 2 * light


def _visibility(text: Lines, light: Light, value: Callable[[str, Expr], str]) -> str:
    """How much of a light is seen from the surface, as text."""
    if not light.shadow:
        return "1.0"
    call = SHADOW[light.penumbra if light.soft else "hard"]
    text.needs.add(call)
    width = ""
    if light.soft and light.penumbra != "sampled":
        width = f", {value('softness', light.softness)}{'' if isinstance(light, Sun) else ' / light.distance'}"
    shown = f"{call}(surface, light{width})"
    if isinstance(light, PointLight) and light.shadow_radius is not None:
        return f"light.distance < {value('shadow_radius', light.shadow_radius)} ? {shown} : 1.0"
    return shown


def _loop(text: Lines, plan: Plan) -> None:
    """The lines of all lights together: their numbers come from the rows of a texture."""
    has = lights.traits(plan.scene)
    names = lights.columns(has)
    answer = ANSWER[plan.model]

    def add(line: str, *needs: str) -> None:
        text.add(f"        {line}", *needs, where=plan.scene.where)

    text.add(f"    for (int i = 0; i < {len(plan.scene.lights)}; i++) {{", "u_lights", "Light", answer)
    for k, name in enumerate(names):
        add(f"vec4 {name} = texelFetch(u_lights, ivec2({k}, i), 0);")
    add("Light light;")
    sources = []
    if "sun" in has:
        sources.append((lights.SUN, "sun_light(place.xyz, source.rgb)", "sun_light"))
    if "point" in has:
        sources.append((lights.POINT, "point_light(surface.p, place.xyz, source.rgb)", "point_light"))
    if "attenuated" in has:
        made = "attenuated_light(surface.p, place.xyz, source.rgb, terms.xyz)"
        sources.append((lights.ATTENUATED, made, "attenuated_light"))
    for k, (kind, made, need) in enumerate(sources):
        condition = f"if (place.w == {kind}) " if k < len(sources) - 1 else ""
        add(f"{'else ' if k else ''}{condition}light = {made};", need)
    if {"window", "fade"} & has:
        if {"window", "fade"} <= has:
            end = f"place.w == {lights.ATTENUATED} ? fade(light.distance, source.w) : window(light.distance, source.w)"
        else:
            end = f"{'window' if 'window' in has else 'fade'}(light.distance, source.w)"
        add(f"if (source.w > 0.0) light.radiance *= {end};", *({"window", "fade"} & has))
    if "spot" in has:
        add("if (axis.w > 0.0) light.radiance *= spot(light.direction, axis.xyz, cone.x, cone.y);", "spot")
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
                add("    Light whole = light;")
                add(f"    for (int k = 0; k < {samples}; k++) {{")
                add(f"        light = part_of(whole, {width}, {first} + {stride} * k);", "part_of")
                shown = "hard_shadow(surface, light)"
                shown = f"{near.removesuffix(' && ')} ? {shown} : 1.0" if near else shown
                add(f"        float seen = {shown};")
                add(f"        color += {answer}(surface, light, seen) / {literal(samples)};", "hard_shadow")
                add("    }")
                add("    continue;")
                add("}")
            else:
                add(f"if (caster.x == {number}) light = part_of(light, {width}, {first});", "part_of")
        for k, shadow in enumerate(lights.shadows(has), 1):
            width = "" if shadow in ("hard", "sampled") else ", caster.y / (place.w == 0.0 ? 1.0 : light.distance)"
            add(
                f"if ({near}caster.x == {float(k)}) visibility = {SHADOW[shadow]}(surface, light{width});",
                SHADOW[shadow],
            )
    add(f"color += {answer}(surface, light, {visibility});")
    text.add("    }")
